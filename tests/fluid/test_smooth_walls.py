"""Smooth walls cut the cells of the fluid: flow rates, torques, mass, rest and cost."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from cfddem.backend.errors import InputError
from cfddem.fluid.budgets import continuity_residual
from cfddem.fluid.conditions import Inlet, Outlet, Periodic
from cfddem.fluid.cut_cells import contents, volumes, within
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.near_walls import NoWalls
from cfddem.fluid.pressure import multigrid
from cfddem.fluid.solver import FluidSolver, Scheme
from cfddem.fluid.surfaces import Plane, Surface, cylinder, together, turned
from cfddem.fluid.wall_force import force_on_walls

THROUGH = {"z_low": Inlet(0.1), "z_high": Outlet()}


def pipe(n: int, shift: tuple[float, float]) -> float:
    """Error of the flux through a pipe of n cells across, shifted against the grid in cells, over pi G R^4/(8 mu)."""
    radius, viscosity, fall, across = 0.5, 0.5, 2.0, n + 2
    h = 2.0 * radius / n
    centre = ((0.5 * across + shift[0]) * h, (0.5 * across + shift[1]) * h, 0.0)
    grid = within(Grid((across, across, 1), (h, h, h)), cylinder(centre, radius))
    fluid = FluidSolver(grid, {"z_low": Periodic(fall), "z_high": Periodic(fall)}, density=1.0, viscosity=viscosity)
    fluid.run_until(0.8)
    flux = float(fluid.volume_flux(2)[0].sum()) * h * h
    return abs(flux / (math.pi * fall * radius**4 / (8.0 * viscosity)) - 1.0)


@pytest.mark.parametrize("spacing", [(0.1, 0.1, 0.1), (0.05, 0.08, 0.13)])
def test_volumes_of_cells_are_those_of_sections_that_are_cut_farther_from_the_wall(spacing):
    """Bit for bit, for a cone that turns about a rod, over a floor that slants."""
    cone = turned([(0.0, 0.1), (0.5, 0.6), (1.0, 0.6)], (0.51, 0.53, 0.0), spin=2.0)
    rod = cylinder((0.51, 0.53, 0.0), 0.11, inside=False)
    walls = together(cone, rod, Plane((0.5, 0.5, 0.2), (0.2, 0.1, 1.0)))
    centres = np.meshgrid(*(h * (np.arange(int(1.1 / h)) + 0.5) for h in spacing), indexing="ij")
    found = volumes(walls, spacing, *centres)
    assert 0.1 < np.mean((found > 0.0) & (found < 1.0)) < 0.9
    assert np.array_equal(found, contents(walls, spacing, *centres)[0])


def test_the_flux_through_a_pipe_of_8_cells_is_met():
    """Solid cells are up to 7 % off at 16 cells."""
    assert pipe(8, (0.27, 0.13)) < 0.015


@pytest.mark.slow
@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.5, 0.5), (0.27, 0.13), (0.41, 0.07)])
def test_the_flux_through_a_pipe_of_16_cells_is_met_within_half_a_percent_at_second_order(shift):
    coarse, fine = pipe(8, shift), pipe(16, shift)
    assert fine < 0.005
    assert math.log2(coarse / fine) > 1.7


def couette(n: int, inner: float, outer: float) -> tuple[float, float, float]:
    """Flow between turning cylinders of radii 0.5 and 1 with n cells across the gap: torques on the inner and the
    outer one over the exact ones, and the largest error of the velocity in the middle of the gap over the wall's."""
    a, b = 0.5, 1.0
    h, across = (b - a) / n, 4 * n + 2
    centre = ((0.5 * across + 0.3) * h, (0.5 * across + 0.1) * h, 0.0)
    walls = together(cylinder(centre, b, spin=outer), cylinder(centre, a, inside=False, spin=inner))
    grid = within(Grid((across, across, 1), (h, h, h)), walls)
    fluid = FluidSolver(grid, {"z_low": Periodic(), "z_high": Periodic()}, density=1.0, viscosity=1.0)
    fluid.run_until(0.3, largest=0.1 * h * h)
    exact = 4.0 * math.pi * (inner - outer) * a * a * b * b / (b * b - a * a) * h
    place, force = force_on_walls(fluid)
    x, y, _ = (place - centre).T
    torque, radius = x * force[:, 1] - y * force[:, 0], np.hypot(x, y)
    solid, vortex = (outer * b * b - inner * a * a) / (b * b - a * a), (inner - outer) * a * a * b * b / (b * b - a * a)
    x, y, _ = np.broadcast_arrays(*grid.faces(0))
    away = np.hypot(x - centre[0], y - centre[1])
    right = -(solid + vortex / away**2) * (y - centre[1])
    wrong = np.abs(fluid.face_velocity(0) - right)[np.abs(away - 0.75) < 0.15].max()
    return -float(torque[radius < 0.75].sum()) / exact, float(torque[radius > 0.75].sum()) / exact, float(wrong)


@pytest.mark.slow
@pytest.mark.parametrize(("inner", "outer"), [(1.0, 0.0), (0.0, 1.0)])
def test_turning_cylinders_drag_the_fluid(inner, outer):
    assert couette(4, inner, outer)[2] < 0.003


@pytest.mark.slow
def test_torques_between_cylinders_are_met_within_a_percent():
    """The inner one turns, then the outer one; 16 cells across the gap."""
    on_inner, on_outer, wrong = couette(16, 1.0, 0.0)
    assert on_inner == pytest.approx(1.0, abs=0.01)
    assert on_outer == pytest.approx(1.0, abs=0.01)
    assert wrong < 0.0003
    on_inner, on_outer, wrong = couette(16, 0.0, 1.0)
    assert on_inner == pytest.approx(1.0, abs=0.01)
    assert on_outer == pytest.approx(1.0, abs=0.01)
    assert wrong < 0.0003


# ---------------------------------------------------------------- mass, rest, geometry

lengths = st.floats(0.15, 0.7)
places = st.tuples(st.floats(0.3, 0.7), st.floats(0.3, 0.7), st.just(0.0))
walls = st.one_of(
    st.builds(cylinder, places, lengths),
    st.builds(lambda c, a, b: turned([(0.1, a), (0.9, b)], c), places, lengths, lengths),
    st.builds(lambda c, a: cylinder(c, a, axis=0, inside=False), st.tuples(st.just(0.0), *2 * (st.floats(0.0, 1.0),)),
              st.floats(0.05, 0.2)),
    st.builds(Plane, st.tuples(*3 * (st.floats(0.0, 0.4),)), st.tuples(*3 * (st.floats(0.1, 1.0),))),
)  # fmt: skip


@settings(max_examples=5, deadline=None, derandomize=True)
@given(st.lists(walls, min_size=1, max_size=3))
def test_mass_is_kept_within_a_few_walls(drawn):
    assert_mass_is_kept(drawn)


@pytest.mark.slow
@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.lists(walls, min_size=1, max_size=3))
def test_mass_is_kept_within_any_walls(drawn):
    assert_mass_is_kept(drawn)


def assert_mass_is_kept(drawn: list[Surface]) -> None:
    """Cell by cell, in a moving voidage, over the largest flux."""
    try:
        grid = within(Grid((7, 8, 9), (1.0 / 7, 1.0 / 8, 1.0 / 9)), together(*drawn))
    except InputError:
        reject()  # no fluid is left, or a wall hides within a cell
    fluid = FluidSolver(
        grid, {"z_high": Outlet(), "x_low": Outlet()}, density=1.0, viscosity=0.01, scheme=Scheme(tolerance=1e-13)
    )
    before, after = (0.6 + 0.1 * np.sin(np.arange(grid.open.size) + step).reshape(grid.shape) for step in (0.0, 0.3))
    fluid.set_voidage(before)
    fluid.set_velocity((0.3, 0.2, 1.0))
    connected = fluid.boundaries.cut.own_volume() * grid.open > 0.0
    if fluid._projection._equation.closed_regions is not None:  # fluid without a way out
        reject()
    fluid.step(1e-3, after)
    largest = max(float(np.abs(fluid.volume_flux(d)).max()) * grid.face_area(d) for d in range(3))
    residual = np.abs(continuity_residual(fluid))[connected]
    assert residual.max() < 1e-12 * max(largest, 1e-300)


def test_a_fluid_at_rest_in_a_cone_stays_at_rest():
    cone = turned([(0.0, 0.1), (1.0, 0.45)], (0.5, 0.5, 0.0))
    grid = within(Grid((10, 10, 10), (0.1, 0.1, 0.1)), cone)
    fluid = FluidSolver(
        grid, {"z_high": Outlet()}, density=1000.0, viscosity=1e-3, gravity=(0.0, 0.0, -9.81), voidage=0.6
    )
    for _ in range(5):
        fluid.step(1e-3)
    assert np.abs(fluid.fields.velocity).max() < 1e-10 * math.sqrt(9.81 * 1.0)


def test_walls_close_around_every_cell_and_have_the_right_area():
    """Of a cone: volume, and area of the wall, which is what is missing among the faces of cells."""
    cone = turned([(0.0, 0.2), (1.0, 0.4)], (0.5, 0.5, 0.0))
    grid = within(Grid((16, 16, 16), (1.0 / 16,) * 3), cone)
    fluid = FluidSolver(grid, THROUGH, density=1.0, viscosity=0.01)
    cut = fluid.boundaries.cut
    volume = float(np.sum(cut.own_volume() * grid.open)) * grid.cell_volume
    assert volume == pytest.approx(math.pi / 3.0 * (0.2**2 + 0.2 * 0.4 + 0.4**2), rel=2e-3)
    missing = [np.diff(grid.inner_faces(cut.of_faces(d), d), axis=2 - d) * grid.face_area(d) for d in range(3)]
    area = float(np.linalg.norm(missing, axis=0).sum())
    assert area == pytest.approx(math.pi * (0.2 + 0.4) * math.hypot(1.0, 0.2), rel=2e-3)


def iterations(grid: Grid) -> float:
    fluid = FluidSolver(grid, THROUGH, density=1.0, viscosity=1e-3)
    counts = [fluid.step(0.02).pressure_iterations for _ in range(4)]
    return float(np.mean([each for of_step in counts for each in of_step]))


def test_the_pressure_needs_few_more_iterations_than_in_the_box():
    grid = Grid((12, 12, 24), (1.0 / 12,) * 3)
    assert iterations(within(grid, cylinder((0.51, 0.49, 0.0), 0.47))) < iterations(grid) + 3.0


def test_sweeps_that_go_too_far_save_iterations_between_smooth_walls(monkeypatch):
    """The flow is that of sweeps that balance each cell, up to the tolerance."""
    grid = within(Grid((12, 12, 24), (1.0 / 12,) * 3), cylinder((0.51, 0.49, 0.0), 0.47))

    def flow() -> tuple[float, Array]:
        fluid = FluidSolver(grid, THROUGH, density=1.0, viscosity=1e-3)
        reports = [fluid.step(0.02) for _ in range(20)]
        assert not fluid.pressure[~grid.open].any()
        return sum(sum(report.pressure_iterations) for report in reports), fluid.velocity

    over_relaxed, velocity = flow()
    monkeypatch.setattr(multigrid, "OVER_RELAXATION", 1.0)
    balanced, same = flow()
    assert over_relaxed < 0.95 * balanced
    np.testing.assert_allclose(velocity, same, rtol=0.0, atol=1e-7)


def test_a_box_has_nothing_of_smooth_walls():
    fluid = FluidSolver(Grid((4, 4, 4), (0.1,) * 3), THROUGH, density=1.0, viscosity=1e-3)
    assert type(fluid.walls) is NoWalls
    assert fluid.boundaries.cut.shares == ()
    assert len(force_on_walls(fluid)[0]) == 0


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("wall", "message"),
    [
        (lambda: cylinder((0.5, 0.5, 0.0), -1.0), "a positive length"),
        (lambda: turned([(0.0, 1.0)], (0.5, 0.5, 0.0)), "at least two points"),
        (lambda: Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), sliding=(0.0, 0.0, 1.0)), "slide along themselves"),
        (lambda: cylinder((5.0, 5.0, 0.0), 0.5), "no cell holds fluid"),
    ],
)
def test_walls_that_cannot_be_are_refused(wall, message):
    with pytest.raises(InputError, match=message):
        within(Grid((4, 4, 4), (0.25,) * 3), wall())


def test_a_wall_thinner_than_a_cell_is_refused():
    """Two chambers whose fluid meets within a cell."""

    class Chambers(Plane):
        def distance(self, x, y, z):
            return np.abs(x - 0.5) - 0.02

    surface: Surface = Chambers((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    with pytest.raises(InputError, match="thicker than a cell"):
        within(Grid((4, 4, 4), (0.25,) * 3), surface)
