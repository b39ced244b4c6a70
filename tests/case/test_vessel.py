"""Vessels of a case: one line is the wall of particles and of the fluid; patches of floor and lid by name."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import call
from example_case import GLASS

from cfddem.backend.errors import InputError
from cfddem.case.column_grid import coverage, grid_of
from cfddem.case.schema import Case
from cfddem.case.vessel import start_box, vessel_of
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.cut_cells import open_share
from cfddem.fluid.surfaces import turned
from cfddem.particles.initial.filling import clear_of_walls
from cfddem.particles.state import make_particles
from cfddem.particles.walls.arrays import near_walls, wall_arrays
from cfddem.particles.walls.shapes import Turned
from cfddem.preflight.bed_estimate import mean_inlet_velocity
from cfddem.preflight.geometry_checks import check_vessel
from cfddem.preflight.summary import preflight
from cfddem.run.build import boundaries_of, laws_of, materials_of, walls_of
from cfddem.run.division import require_parallel
from cfddem.run.initial_particles import particles_of

TEXT = (
    """
[fluid]
density = 1.2
viscosity = 1.8e-5

[column]
width = 0.16
height = 0.24
cell = 0.01

[vessel]
shape = "cone"
radius = 0.03
length = 0.1733

[patch.nozzle]
kind = "inlet"
shape = "disc"
diameter = 0.04
velocity = [[0.0, 4.0], [1.0, 12.0]]

[bed]
diameter = 4.0e-3
height = 0.06

[run]
until = 0.5
reference_speed = 2.5
particle_step = 1e-5
"""
    + GLASS
)

CONE = [(0.0, 0.03), (0.1733, 0.08), (0.24, 0.08)]
CHAINS = {
    "cone": CONE,
    "steps outward": [(0.0, 0.03), (0.05, 0.03), (0.08, 0.07), (0.2, 0.08)],
    "bulge with a neck": [(0.0, 0.03), (0.05, 0.06), (0.1, 0.06), (0.15, 0.03), (0.24, 0.03)],
    "waist": [(0.0, 0.07), (0.1, 0.03), (0.2, 0.07)],
}


def made(**given: Any) -> Case:
    return Case.from_text(TEXT, "c.toml", {name.replace("__", "."): value for name, value in given.items()})


def vessel(**table: Any) -> Case:
    """A case with another vessel, and no patch."""
    values = made().model_dump(exclude_defaults=True, exclude_none=True)
    return Case(**(values | {"vessel": table, "patch": {}}))


def test_a_cone_that_ends_at_the_lid_by_a_sum_is_not_above_it() -> None:
    cone = {"shape": "cone", "radius": 0.03, "length": 0.1 + 0.2}
    case = Case(**(vessel(**cone).model_dump() | {"column": {"width": 0.16, "height": 0.3, "cell": 0.01}}))
    assert case.vessel.length > case.column.height
    assert not any("above the lid" in issue.reason for issue in check_vessel(case))


# ---------------------------------------------------------------- one line for particles and fluid


@pytest.mark.parametrize("line", CHAINS.values(), ids=CHAINS)
def test_particles_and_fluid_are_as_far_from_the_wall(line):
    """Of all places in the vessel; a sphere that is not at a wall is clear of it."""
    wall, surface = wall_arrays([Turned(line=tuple(line))]), turned(line, (0.0, 0.0, 0.0))
    rng = np.random.default_rng(4)
    height, angle = rng.uniform(0.0, line[-1][0], 400), rng.uniform(0.0, 2.0 * math.pi, 400)
    radius = np.interp(height, *np.array(line).T) * np.sqrt(rng.uniform(0.0, 1.0, 400))
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    away = surface.distance(*places.T)
    places, away = places[away > 1e-4], away[away > 1e-4]
    touching = near_walls(make_particles(places, away * (1.0 + 1e-6), 1.0), wall, 0.0, 0.0)[0]
    assert set(touching) == set(range(len(places)))
    assert not len(near_walls(make_particles(places, away * (1.0 - 1e-6), 1.0), wall, 0.0, 0.0)[0])


def test_a_sphere_beside_a_corner_touches_the_wall_once():
    """Above a cone of 16 degrees it lies on the cylinder, overlapping by 1 % of its radius, 0.15 mm above their corner:
    nearer than the end of a cone that ended there. In the corner it touches both."""
    radius = 2e-3
    wall, slope = wall_arrays([Turned(line=tuple(CONE))]), 0.05 / 0.1733
    for above, contacts in ((1.5e-4, 1), (-2.0 * radius * slope, 2), (-5e-3, 1)):
        on_cone = 0.08 + above * slope - 0.99 * radius * math.hypot(1.0, slope)
        out, height = min(0.08 - 0.99 * radius, on_cone) if contacts == 1 else 0.08 - 0.99 * radius, CONE[1][0] + above
        sphere = make_particles(np.array([[out, 0.0, height]]), radius, 1000.0)
        assert len(near_walls(sphere, wall, 0.0, 0.0)[0]) == contacts


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"shape": "cylinder", "radius": 0.05}, [(0.0, 0.05), (0.24, 0.05)]),
        ({"shape": "cone", "radius": 0.03, "top_radius": 0.05, "length": 0.3}, [(0.0, 0.03), (0.24, 0.046)]),
        ({"shape": "chain", "line": [[0.0, 0.03], [0.1, 0.03], [0.2, 0.06]]},
         [(0.0, 0.03), (0.1, 0.03), (0.2, 0.06), (0.24, 0.06)]),
    ],
)  # fmt: skip
def test_a_vessel_is_a_line_and_holds_what_the_cells_hold(table, line):
    """The volume of its cells is that of its frustums; its floor is its lowest circle."""
    case = vessel(**table)
    assert np.allclose(case.line, line)
    heights, radii = np.linspace(0.0, 0.24, 4001), np.interp(np.linspace(0.0, 0.24, 4001), *np.array(line).T)
    volume = np.trapezoid(math.pi * radii**2, heights)
    assert open_share(grid_of(case)).sum() * grid_of(case).cell_volume == pytest.approx(volume, rel=4e-3)
    assert case.floor_area == pytest.approx(math.pi * line[0][1] ** 2)
    shape = vessel_of(case)
    assert (shape is None) == (len({radius for _, radius in line}) == 1)
    if shape is not None:
        assert shape.volumes[-1] == pytest.approx(volume, rel=1e-3)
    pieces = case.vessel.walls_in(case.column)
    assert [(w.point[2], w.radius) for w in pieces] == [(low, r) for (low, r), _ in pairwise(line)]


def test_particles_start_in_the_vessel():
    case = made(bed__start="suspended", bed__count=500, bed__height=None)
    corner, size = start_box(case)
    assert corner[0] >= 0.0 and size[0] == pytest.approx(0.16 / math.sqrt(2.0))
    spheres = particles_of(case, materials_of(case), walls_of(case), laws_of(case))
    assert clear_of_walls(spheres.position, 2e-3 * (1.0 - 1e-6), walls_of(case)).all()
    assert (case.beyond_the_side(spheres.position, 2e-3) <= 1e-9).all()
    for radius in (0.03, 0.0):
        many = made(vessel__radius=radius, patch={}, bed__start="suspended", bed__count=12_000, bed__height=None)
        assert particles_of(many, materials_of(many), walls_of(many), laws_of(many)).count == 12_000
    assert made(
        vessel__shape="chain",
        vessel__radius=None,
        vessel__length=None,
        vessel__line=[[0.0, 0.03], [0.2, 0.06], [0.4, 0.1]],
    ).line[-1] == pytest.approx((0.24, 0.068))


def test_a_vessel_survives_text_and_commands(tmp_path: Path):
    case = made()
    assert Case.from_text(case.to_toml()) == case
    (tmp_path / "case.toml").write_text(TEXT)
    drawn = call("check", str(tmp_path / "case.toml"), "--picture", str(tmp_path / "case.png"))
    assert drawn.code == 0 and (tmp_path / "case.png").stat().st_size > 5000
    assert "cells cut by the vessel" in drawn.out and "smallest cut cell" in drawn.out


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"vessel.top_radius": 0.1}, "vessel.top_radius = 0.1: must be within the column: at most 0.08 m"),
        ({"vessel.top_radius": 3.0, "vessel.length": 9.0}, r"vessel.top_radius = 3.0: .*at the lid, where it is 0\."),
        ({"vessel.radius": 30.0}, "vessel.radius = 30.0: must be within the column: at most 0.08 m"),
        ({"vessel.line": [[0.0, 0.01], [0.1, 0.02]]}, 'vessel.line = .*left out for shape = "cone"'),
        ({"vessel": {"shape": "chain", "line": [[0.0, 0.03], [0.1, 0.05], [0.05, 0.06]]}}, "rising heights, but 0.05"),
        ({"vessel": {"shape": "chain", "line": [[0.1, 0.03], [0.2, 0.05]]}}, "the first at height 0, the floor"),
        ({"vessel.length": None}, 'vessel.length: must be given for shape = "cone"'),
        ({"column.shape": "cylinder"}, "column.shape.*left out where there is a vessel"),
        ({"column.sides": "free_slip"}, "column.sides.*left out where there is a vessel"),
        ({"column.walls": "smooth"}, "column.walls"),
        ({"vessel.fill_level": 0.5}, "without a free surface"),
        ({"wall": [{"shape": "cylinder", "radius": 0.002, "point": [0.08, 0.08, 0.02], "length": 0.01, "caps": True}]},
         r"wall\.0\.solid.*vessel"),
        ({"patch.nozzle.side": "flor"}, "patch.nozzle.side = 'flor': must be one of floor, lid"),
        ({"patch.nozzle.velocity": None}, "patch.nozzle.velocity: must be given for an inlet"),
        ({"patch.nozzle.pressure": 5.0}, "patch.nozzle.pressure = 5.0: must be left out"),
        ({"patch.nozzle.velocity": [[1.0, 1.0], [0.0, 2.0]]}, "in increasing time"),
        ({"column.ends": "closed"}, "patch.nozzle: must be together with an outlet"),
        ({"patch.top": {"kind": "wall", "side": "lid"}}, "together with an outlet"),
        ({"bed.jet": {"velocity": 1.0, "width": 0.02}}, "bed.jet.*patches"),
        ({"column.ends": "periodic"}, "patch|column.ends"),
    ],
    ids=str,
)  # fmt: skip
def test_what_a_vessel_and_its_patches_cannot_have_is_refused_in_a_line(given, said):
    with pytest.raises(InputError, match=said) as refusal:
        Case.from_text(TEXT, "c.toml", given)
    assert len(str(refusal.value)) < 400


def test_processes_share_a_vessel_by_its_layers_of_cells():
    """16 x 16 x 24 cells, at least three layers each."""
    require_parallel(made(), 200)
    with pytest.raises(InputError, match=r"ranks.*at most 5 x 5 x 8 for 16 x 16 x 24 cells"):
        require_parallel(made(), 201)


# ---------------------------------------------------------------- patches


def test_the_flow_through_a_patch_is_its_velocity_times_its_area():
    """Of a disc that no face follows, with a flow that rises; of ring and disc together; of a parabola."""
    case, faces = made(), {}
    ring = {"kind": "inlet", "shape": "ring", "diameter": 0.058, "inner_diameter": 0.04, "velocity": 3.0}
    with_ring = made(**{"patch.annulus": ring, "patch.nozzle.profile": "parabolic"})
    for name, each in (("disc", case), ("ring", with_ring)):
        grid = grid_of(each)
        boundaries = Boundaries(grid, boundaries_of(each))
        boundaries.set_inlets(0.5, np.ones(grid.padded_shape))
        side = next(each for each in boundaries.sides if each.name == "z_low")
        inflow = side.wall[2, 2:-3, 2:-3] * boundaries.cut.aperture[2][2, 2:-3, 2:-3]
        faces[name] = inflow.sum() * grid.face_area(2)
    disc, area = 8.0 * math.pi * 0.02**2, math.pi * (0.029**2 - 0.02**2)
    assert faces["disc"] == pytest.approx(disc, rel=4e-3)
    assert faces["ring"] == pytest.approx(disc + 3.0 * area, rel=4e-3)
    assert coverage(with_ring, with_ring.patch["nozzle"]).max() == pytest.approx(
        5.0 / 3.0, rel=0.01
    )  # beside the middle


def inflow(case: Case) -> float:
    """Flow through the floor at 0.5 s [m3/s]."""
    aperture = Boundaries(grid_of(case), boundaries_of(case)).cut.aperture
    open_part = aperture[2][2, 2:-3, 2:-3] if case.vessel else 1.0
    return float((faces_of(case) * open_part).sum() * grid_of(case).face_area(2))


def faces_of(case: Case) -> np.ndarray:
    """Velocity through the faces of the floor at 0.5 s (ny, nx) [m/s]."""
    boundaries = Boundaries(grid_of(case), boundaries_of(case))
    boundaries.set_inlets(0.5, np.ones(grid_of(case).padded_shape))
    side = next(each for each in boundaries.sides if each.name == "z_low")
    return side.wall[2, 2:-3, 2:-3]


def lens(one: float, other: float, apart: float) -> float:
    """Area that two circles have in common, in closed form [m2]."""
    to_one = (apart**2 + one**2 - other**2) / (2.0 * apart)
    parts = [r**2 * math.acos(d / r) - d * math.sqrt(r**2 - d**2) for r, d in ((one, to_one), (other, apart - to_one))]
    return sum(parts)


@pytest.mark.parametrize(
    ("patch", "area", "to"),
    [
        ({"shape": "disc", "diameter": 0.033}, 0.25 * math.pi * 0.033**2, 1e-9),
        ({"shape": "whole"}, 0.25 * math.pi * 0.06**2, 1e-9),
        ({"shape": "disc", "diameter": 0.05, "centre": [0.07, 0.08]}, lens(0.025, 0.03, 0.01), 3e-3),
        ({"shape": "disc", "diameter": 0.05, "centre": [0.055, 0.08]}, lens(0.025, 0.03, 0.025), 3e-3),
    ],
    ids=["on faces", "whole", "beyond the edge", "half outside"],
)  # fmt: skip
def test_a_mass_flow_enters_exactly_also_where_no_face_follows_the_edge(patch, area, to):
    """Its speed is that through the part of the patch that lies on the floor."""
    flow = {"kind": "inlet", "mass_flow": [[0.0, 0.0], [1.0, 0.012]]}
    case = made(patch={"nozzle": flow | patch})
    assert inflow(case) == pytest.approx(0.006 / 1.2, rel=1e-9)
    assert case.fastest_inflow == pytest.approx(0.012 / 1.2 / area, rel=to)
    with pytest.raises(InputError, match=r"mass_flow.*left out where there is a velocity"):
        made(patch={"nozzle": flow | patch | {"velocity": 1.0}})


def test_patches_may_cover_every_cell_of_the_floor():
    """A disc and the ring around it: nothing is left to the inlet of the floor itself, which is no error."""
    disc = {"kind": "inlet", "shape": "disc", "diameter": 0.02, "velocity": 12.0}
    ring = {"kind": "inlet", "shape": "ring", "diameter": 0.06, "inner_diameter": 0.02, "velocity": 1.0}
    case = made(patch={"nozzle": disc, "annulus": ring}, vessel={"shape": "cylinder", "radius": 0.03})
    assert inflow(case) == pytest.approx(0.25 * math.pi * (12.0 * 0.02**2 + 0.06**2 - 0.02**2), rel=0.01)


@pytest.mark.parametrize("profile", ["uniform", "parabolic"])
def test_the_speed_of_a_mass_flow_through_a_disc_beyond_a_side_is_that_at_its_faces(profile):
    """A disc of 23.7 mm, 3 mm from a side of a box; its highest speed at a face is that of the check."""
    text = re.sub(r"(?ms)^\[vessel\].*?(?=^\[patch)", "", TEXT)
    disc = {"kind": "inlet", "shape": "disc", "centre": [0.003, 0.08], "diameter": 0.0237, "mass_flow": 1e-3}
    patch = {"nozzle": disc | {"profile": profile}}
    case = Case.from_text(text, "c.toml", {"patch": patch, "column.cell": 0.0025, "bed.diameter": 1e-3})
    if profile == "uniform":
        half, away = 0.01185, 0.003
        area = half**2 * (math.pi - math.acos(away / half)) + away * math.sqrt(half**2 - away**2)
        assert case.fastest_inflow == pytest.approx(1e-3 / 1.2 / area, rel=3e-3)  # 2.86 m/s
        assert mean_inlet_velocity(case) == pytest.approx(1e-3 / 1.2 / 0.16**2, rel=1e-9)
    assert faces_of(case).max() == pytest.approx(case.fastest_inflow, rel=0.03)
    said = [each.reason for each in preflight(case).issues if each.key == "patch.nozzle"]
    assert sum("% of it lies outside of the floor, and passes its part of mass_flow" in each for each in said) == 1, (
        said
    )


@pytest.mark.parametrize(
    "given",
    [{"velocity": 4.0, "profile": "parabolic"}, {"mass_flow": 0.002, "profile": "parabolic"}, {"mass_flow": 0.002}],
    ids=str,
)
def test_the_floor_beneath_an_inlet_lets_nothing_through(given):
    """Through faces that a disc covers comes what it brings alone; around it the floor has its own velocity."""
    patch = {"nozzle": {"kind": "inlet", "shape": "disc", "diameter": 0.04} | given}
    alone, both = (faces_of(made(patch=patch, bed__inlet_velocity=each, column__cell=0.005)) for each in (0.0, 1.0))
    x = 0.005 * (np.arange(32) + 0.5) - 0.08
    away = np.hypot(x, x[:, None])
    inside, outside = away < 0.02 - 0.0036, (away > 0.02 + 0.0036) & (away < 0.03)
    assert inside.sum() == 32 and (alone[inside] > 0.0).all() and (both[inside] == alone[inside]).all()
    assert outside.any() and (both - alone)[outside] == pytest.approx(1.0)


PLATE: dict[str, Any] = {"kind": "inlet", "shape": "holes", "diameter": 3e-3, "velocity": 20.0}


@pytest.mark.parametrize(
    ("holes", "number"),
    [
        ({"holes": 19, "pitch": 0.011}, 19),
        ({"holes": 1, "centre": [0.071, 0.083]}, 1),
        ({"holes": 1, "pitch": 1e-3, "centre": [0.071, 0.083]}, 1),
        ({"holes": [[0.062, 0.081], [0.0801, 0.09], [0.1, 0.0703]]}, 3),
        ({"holes": 61, "pitch": 3e-3}, 61),
    ],
    ids=str,
)
@pytest.mark.parametrize("vessel", ["cone", "column"])
def test_the_flow_through_the_holes_of_a_plate_is_that_of_their_area(holes, number, vessel):
    """Holes of 0.3 cells, in the cone also in cut cells: by velocity and by mass flow, beside a nozzle and on a floor
    with a flow of its own."""
    base: dict[str, Any] = {"vessel": None} if vessel == "column" else {}
    area = number * math.pi / 4.0 * 3e-3**2
    plate = made(patch={"plate": PLATE | holes}, **base)
    assert inflow(plate) == pytest.approx(20.0 * area, rel=1e-12)
    assert plate.patch["plate"].area == pytest.approx(area)
    rises = {"velocity": None, "mass_flow": [[0.0, 0.0], [1.0, 0.004]]}
    assert inflow(made(patch={"plate": PLATE | holes | rises}, **base)) == pytest.approx(0.002 / 1.2, rel=1e-12)
    nozzle = made().patch["nozzle"].model_dump(exclude_unset=True)
    both = made(patch={"plate": PLATE | holes, "nozzle": nozzle}, **base)
    assert inflow(both) - inflow(made(**base)) == pytest.approx(20.0 * area, rel=1e-9)
    floor = {"bed__inlet_velocity": 1.0} | base
    alone = inflow(made(patch={"top": {"kind": "outlet", "side": "lid"}}, **floor))
    opened = inflow(made(patch={"plate": PLATE | holes}, **floor))
    assert opened == pytest.approx(inflow(plate) + alone - area, rel=1e-6)
    assert Case.from_text(plate.to_toml()) == plate


def test_holes_lie_in_rows_about_the_centre_and_only_faces_above_them_have_a_flow():
    case = made(vessel=None, patch={"plate": PLATE | {"holes": 37, "pitch": 0.012}})
    places = case.patch["plate"].places((0.08, 0.08))
    apart = np.linalg.norm(places[:, None] - places, axis=-1) + np.eye(37)
    assert apart.min() == pytest.approx(0.012) and places.mean(axis=0) == pytest.approx([0.08, 0.08])
    assert np.linalg.norm(places - 0.08, axis=1).max() == pytest.approx(0.036)
    reached = np.zeros((16, 16), bool)
    for corner in np.stack(np.meshgrid([-1.5e-3, 1.5e-3], [-1.5e-3, 1.5e-3]), axis=-1).reshape(-1, 2):
        column, row = np.floor((places + corner) / 0.01).astype(int).T
        reached[row, column] = True
    enters = faces_of(case) > 0.0
    assert enters.any() and not (enters & ~reached).any()
    x, y = (places[:5] + np.array([0.0, 1e-3])).T
    assert case.patch["plate"].holds(x, y, (0.08, 0.08), 0.4e-3).all()
    assert not case.patch["plate"].holds(x, y, (0.08, 0.08), 0.6e-3).any()


@pytest.mark.parametrize("centre", [(0.08, 0.08), (0.0813, 0.0777)])
@pytest.mark.parametrize("across", [3.3, 10.0, 10.3])
def test_one_hole_many_cells_wide_has_the_velocities_of_a_disc(centre, across):
    """Each face within the edge has the velocity of the patch, within the correction to the exact area."""
    given = {"diameter": across * 5e-3, "centre": centre, "velocity": 20.0}
    hole, disc = (
        faces_of(made(vessel=None, column__cell=5e-3, patch={"plate": {"kind": "inlet"} | given | shape}))
        for shape in ({"shape": "holes", "holes": 1}, {"shape": "disc"})
    )
    assert (disc == 20.0).sum() >= 0.25 * across**2 and hole.shape == disc.shape == (32, 32)
    assert hole[disc == 20.0] == pytest.approx(20.0, rel=0.01)
    assert hole == pytest.approx(disc, abs=0.1 * 20.0)  # the edge cuts faces


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"holes": 7}, "patch.plate.pitch: must be given for a number of holes"),
        ({"holes": 7, "pitch": 2e-3}, "patch.plate.pitch.*at least 0.003 m apart; the nearest two are 0.002 m"),
        ({"holes": [[0.08, 0.08], [0.082, 0.08]]}, "patch.plate.holes.*the nearest two are 0.002 m apart"),
        ({"holes": [[0.08, 0.08]], "pitch": 0.01}, "patch.plate.pitch = 0.01: must be left out where holes are listed"),
        ({"holes": 0, "pitch": 0.01}, "patch.plate.holes"),
        ({"holes": []}, "patch.plate.holes"),
        ({"pitch": 0.01}, "patch.plate.holes: must be given"),
        ({"holes": 7, "pitch": 0.01, "velocity": None, "pressure": 5.0}, "patch.plate.shape.*by velocity or mass_flow"),
        ({"holes": 7, "pitch": 0.01, "kind": "outlet", "velocity": None}, "patch.plate.shape.*by velocity"),
        ({"holes": 7, "pitch": 0.01, "side": "x_low"}, "patch.plate.side.*floor or lid"),
        ({"holes": 7, "pitch": 0.01, "profile": "parabolic"}, "patch.plate.profile"),
        ({"shape": "disc", "pitch": 0.01}, "patch.plate.pitch.*left out for shape"),
    ],
    ids=str,
)
def test_a_plate_that_has_no_holes_or_holes_that_overlap_is_refused_in_a_line(given, said):
    with pytest.raises(InputError, match=said) as refusal:
        made(patch={"plate": PLATE | given})
    assert len(str(refusal.value)) < 300 and "\n" not in str(refusal.value)


def test_the_check_tells_of_holes_beyond_the_floor_and_of_jets_that_cells_do_not_resolve():
    far = made(patch={"plate": PLATE | {"holes": [[0.08, 0.08], [0.12, 0.08]]}})
    found = [each for each in preflight(far).issues if each.key.startswith("patch")]
    assert any(each.severity == "warning" and "50 % of it lies outside" in each.reason for each in found)
    (jets,) = [each for each in found if each.key == "patch.plate.diameter"]
    assert jets.severity == "note" and "0.3 cells" in jets.reason
    wide = made(patch={"plate": PLATE | {"holes": 1, "pitch": 0.03, "diameter": 0.025}})
    assert not [each for each in preflight(wide).issues if each.key == "patch.plate.diameter"]


def test_an_inlet_opens_the_wall_before_it_and_a_wall_closes_the_inlet_before_it():
    plate = {"kind": "wall", "side": "floor", "shape": "ring", "diameter": 0.06, "inner_diameter": 0.0001}
    nozzle = made().patch["nozzle"].model_dump(exclude_unset=True)
    assert inflow(made(patch={"plate": {"kind": "wall"}, "nozzle": nozzle})) == pytest.approx(inflow(made()), rel=1e-12)
    open_floor = made(patch={"plate": {"kind": "wall"}, "nozzle": nozzle}, bed__inlet_velocity=1.0)
    assert inflow(open_floor) == pytest.approx(inflow(made()), rel=1e-12)
    half = {"kind": "wall", "shape": "box", "centre": [0.04, 0.08], "size": [0.08, 0.16]}
    assert inflow(made(**{"patch.half": half})) == pytest.approx(0.5 * inflow(made()), rel=1e-9)
    with pytest.raises(InputError, match="inlet"):
        inflow(made(patch={"nozzle": nozzle, "plate": plate}))


def test_velocities_of_inlets_that_overlap_add_up():
    floor = {"kind": "inlet", "velocity": 1.0}
    alone, nozzle = inflow(made(patch={"floor": floor})), made().patch["nozzle"].model_dump(exclude_unset=True)
    assert inflow(made(patch={"floor": floor, "nozzle": nozzle})) == pytest.approx(alone + inflow(made()), rel=1e-9)


def test_a_lid_may_be_closed_but_for_its_outlets():
    """Two outlets of a closed lid are those that are open."""
    outlet = {"kind": "outlet", "side": "lid", "shape": "disc", "diameter": 0.03}
    case = made(**{
        "column.ends": "closed",
        "patch.left": outlet | {"centre": [0.05, 0.08]}, "patch.right": outlet | {"centre": [0.11, 0.08]},
    })  # fmt: skip
    boundaries = Boundaries(grid_of(case), boundaries_of(case))
    side = next(each for each in boundaries.sides if each.name == "z_high")
    at = np.flatnonzero(side.outlet[2:-3, 2:-3].any(axis=0))
    assert boundaries.has_outlet and set(at) <= {3, 4, 5, 6, 9, 10, 11, 12} and {4, 5, 10, 11} <= set(at)


@pytest.mark.parametrize("driven", [{"velocity": 1.0}, {"velocity": None, "pressure": 5.0}], ids=str)
def test_a_lid_that_several_walls_close_together_is_found_for_every_kind_of_inlet(driven):
    half = {"kind": "wall", "side": "lid", "shape": "box", "size": [0.08, 0.16]}
    left, right = half | {"centre": [0.04, 0.08]}, half | {"centre": [0.12, 0.08]}
    for walls, closed in (({"left": left}, False), ({"left": left, "right": right}, True)):
        case = made(patch={"air": {"kind": "inlet"} | driven} | walls)
        found = [each for each in preflight(case).issues if each.key == "patch.left" and each.severity == "error"]
        assert len(found) == closed
        assert all("what enters has to leave" in each.reason for each in found)


@pytest.mark.parametrize(
    ("given", "key", "severity", "said"),
    [
        ({}, None, None, ""),
        ({"patch.nozzle.centre": [0.02, 0.08]}, "patch.nozzle", "error", "outside of the floor .*disc of 0.06 m"),
        ({"patch.nozzle.diameter": 0.08}, "patch.nozzle", "warning", "outside of the floor, and has no flow"),
        ({"vessel.radius": 0.015, "patch.nozzle.diameter": 0.02}, "vessel.radius", "warning", "3 cells across"),
        ({"vessel.radius": 0.0019, "patch": {}}, "vessel.radius", "warning", "less than a particle"),
        ({"vessel.radius": 0.0}, "patch.nozzle", "error", "outside of the floor"),
        ({"vessel": {"shape": "cone", "radius": 0.08, "top_radius": 0.01, "length": 0.2}},
         "vessel.top_radius", "warning", "2 cells across"),
        ({"patch.top": {"kind": "wall", "side": "lid", "shape": "disc", "diameter": 0.3}}, "patch.top", "error",
         "leave no part of it open"),
    ],
)  # fmt: skip
def test_the_pre_run_check_sees_vessel_and_patches(given, key, severity, said):
    found = preflight(Case.from_text(TEXT, "c.toml", given)).issues
    about = [each for each in found if each.key.startswith(("vessel", "patch", "column.cell"))]
    if key is None:
        assert not about
    else:
        assert any(each.key == key and each.severity == severity and re.search(said, each.reason) for each in about)
