"""Closed surfaces of triangles as walls of the fluid: distances, flow rates, mass, and what is no vessel."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_smooth_walls import assert_mass_is_kept

from cfddem.backend.errors import InputError
from cfddem.fluid.conditions import Periodic
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver
from cfddem.fluid.surfaces import cylinder, turned
from cfddem.fluid.triangles import closed_surface, section_area, signed_volume, through_ends

SIDES = 64


def revolved(rings: list[tuple[float, float]], sides: int = SIDES) -> np.ndarray:
    """The closed surface of rings of (height, radius) about the z axis, normals outwards (T, 3, 3)."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=-1)
    rows = [radius * circle + [0.0, 0.0, height] for height, radius in rings]
    rows = [0.0 * circle + [0.0, 0.0, rings[0][0]], *rows, 0.0 * circle + [0.0, 0.0, rings[-1][0]]]
    triangles = []
    for low, high in pairwise(rows):
        next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        triangles += [np.stack([low, next_low, next_high], axis=1), np.stack([low, next_high, high], axis=1)]
    return np.concatenate(triangles)


def turned_by(corners: np.ndarray, lean: float, spin: float) -> np.ndarray:
    """Triangles turned about the z axis, then about the y axis [rad]."""
    c, s = math.cos(spin), math.sin(spin)
    about_z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    c, s = math.cos(lean), math.sin(lean)
    return corners @ (np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) @ about_z).T


CUBE = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
FACES = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6],
         [3, 0, 4], [3, 4, 7]]  # fmt: skip
BOX = CUBE[FACES].astype(float)


def test_distances_are_those_of_a_box_at_any_turn_at_faces_edges_and_corners():
    """Closed form, inside and outside; the volume and sections are those of the box."""
    rng = np.random.default_rng(3)
    for lean, spin in ((0.0, 0.0), (0.4, 1.1)):
        surface = closed_surface(turned_by(BOX, lean, spin))
        places = rng.uniform(-2.0, 2.0, (4000, 3))
        beyond = np.abs(places) - 1.0
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        exact = np.where(outside > 0.0, -outside, -beyond.max(axis=1))
        turned = turned_by(places[:, None, :], lean, spin)[:, 0]
        assert np.abs(surface.distance(*turned.T) - exact).max() < 1e-14
    assert signed_volume(BOX) == pytest.approx(8.0) and section_area(BOX, 0.3) == pytest.approx(4.0)
    through = through_ends(np.add(BOX, [0.0, 0.0, 1.0]), 2.0, 0.5)
    assert signed_volume(through) == pytest.approx(4.0 * 3.0)
    assert closed_surface(through).distance(0.0, 0.2, np.array([-0.1, 0.0, 2.1])) == pytest.approx([0.4, 0.5, 0.4])


def test_distances_of_a_hollow_surface_are_right_at_its_edges():
    """A waist, whose edge stands out into the fluid: the exact distance is that of the turned line."""
    line = [(-2.0, 1.0), (0.0, 0.3), (2.0, 1.0)]
    surface, exact = closed_surface(revolved(line, 720)), turned(line, (0.0, 0.0, 0.0))
    places = np.random.default_rng(5).uniform([-1.0, -1.0, -0.9], [1.0, 1.0, 0.9], (2000, 3)).T
    assert np.abs(surface.distance(*places) - exact.distance(*places)).max() < 2e-5


def flux(surface, n: int) -> float:
    """Flux of a flow along z through a pipe with n cells across a diameter of 1."""
    across, h, viscosity, fall = n + 2, 1.0 / n, 0.5, 2.0
    grid = within(Grid((across, across, 1), (h, h, h)), surface)
    fluid = FluidSolver(grid, {"z_low": Periodic(fall), "z_high": Periodic(fall)}, density=1.0, viscosity=viscosity)
    fluid.run_until(0.8)
    return float(fluid.volume_flux(2)[0].sum()) * h * h


def test_a_pipe_of_triangles_has_the_flow_rate_of_the_smooth_one():
    """Turned about its axis, within what its polygon lacks: the area of N sides is 1 - (2 pi/N)^2/6 of the disc."""
    n = 8
    middle = (0.5 * (n + 2) + 0.27) / n, (0.5 * (n + 2) + 0.13) / n, 0.0
    smooth = flux(cylinder(middle, 0.5), n)
    lack = 2.0 * (2.0 * math.pi / SIDES) ** 2 / 6.0
    for spin in (0.0, 0.03):
        pipe = closed_surface(turned_by(revolved([(-5.0, 0.5), (5.0, 0.5)]), 0.0, spin) + middle)
        assert flux(pipe, n) == pytest.approx(smooth * (1.0 - lack), rel=1e-3)


drawn_as = st.tuples(
    st.booleans(), *3 * (st.floats(0.15, 0.4),), st.floats(-0.5, 0.5), st.floats(0.0, 3.0),
    *2 * (st.floats(0.4, 0.6),),
)  # fmt: skip


@settings(max_examples=4, deadline=None, derandomize=True)
@given(drawn_as)
def test_mass_is_kept_within_a_few_surfaces(drawn):
    assert_mass_is_kept([leaning(*drawn)])


@pytest.mark.slow
@settings(max_examples=100, deadline=None, derandomize=True)
@given(drawn_as)
def test_mass_is_kept_within_any_surface(drawn):
    assert_mass_is_kept([leaning(*drawn)])


def leaning(is_box, a, b, c, lean, spin, x, y):
    """A box or a waist that leans, through the lid of the unit box."""
    rings = [(-0.8, a), (c - 0.3, b), (0.8, a)]
    corners = BOX * [a, b, 0.8] if is_box else revolved(rings, 12)
    return closed_surface(np.add(turned_by(corners, lean, spin), [x, y, 0.5]))


@pytest.mark.parametrize(
    ("corners", "said"),
    [
        (BOX[1:], "3 edges have not, one at"),
        (BOX[:, ::-1], "it is inside out; reverse its triangles"),
        (np.concatenate([BOX[:1, ::-1], BOX[1:]]), "3 edges lie between one that points inwards"),
        (
            np.concatenate([BOX, np.add(BOX[:, ::-1] * [0.5, 0.4, 0.3], 0.7)]),
            "not pass through itself; two triangles cross near",
        ),
        (np.concatenate([BOX, 0.5 * BOX]), "one vessel; it has 2 parts with fluid inside"),
    ],
    ids=["hole", "inside out", "one turned", "crossing", "nested"],
)
def test_a_surface_that_is_no_vessel_is_refused_in_a_line(corners, said):
    with pytest.raises(InputError, match=said) as refusal:
        closed_surface(corners, "vessel.file", "part.stl")
    assert len(str(refusal.value)) < 250 and str(refusal.value).startswith("vessel.file = 'part.stl': must be")
