"""Openings in the sides of vessels and boxes: flow by velocity, mass flow and pressure, and particles that leave."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_case import GLASS

from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of, patch_faces
from cfddem.case.patches import CasePatch
from cfddem.case.schema import Case
from cfddem.case.vessel_shape import outline, overlap
from cfddem.features.feeds import Opening
from cfddem.fluid.solver import FluidSolver, Scheme
from cfddem.particles.state import make_particles
from cfddem.plotting.case_drawing import case_drawing
from cfddem.plotting.curves import save
from cfddem.preflight.summary import preflight
from cfddem.run.build import boundaries_of
from cfddem.run.history import row
from cfddem.run.simulation import Simulation

TEXT = (
    """
[fluid]
density = 1.2
viscosity = 1.8e-5

[column]
width = 0.08
height = 0.12
cell = 0.01
ends = "closed"

[vessel]
shape = "cylinder"

[patch.air]
kind = "inlet"
side = "x_low"
shape = "disc"
diameter = 0.03
centre = [0.043, 0.031]
velocity = 2.0

[patch.out]
kind = "outlet"
side = "y_high"
shape = "box"
centre = [0.037, 0.08]
size = [0.033, 0.022]

[bed]
diameter = 4e-3
count = 10
start = "suspended"

[run]
until = 0.1
reference_speed = 2.0
"""
    + GLASS
)

VESSELS: dict[str, Any] = {
    "round": {"shape": "cylinder"},
    "cone": {"shape": "cone", "radius": 0.03, "length": 0.05},
    "narrow box": {"shape": "box", "size": [0.06, 0.07]},
    "column": None,
}
DRIVEN: dict[str, Any] = {
    "velocity": {},
    "mass flow": {"patch.air.velocity": None, "patch.air.mass_flow": 1e-3},
    "pressure": {"patch.air.velocity": None, "patch.air.pressure": 5.0},
}
DISC = math.pi * 0.015**2


def made(**given: Any) -> Case:
    return Case.from_text(TEXT, "c.toml", {name.replace("__", "."): value for name, value in given.items()})


def flow_in(case: Case, steps: int = 30, tolerance: float = 1e-13) -> tuple[FluidSolver, list[np.ndarray]]:
    """A fluid after some steps, and its flow through all faces normal to x, y, z [m3/s]."""
    grid, fluid = grid_of(case), case.required_fluid
    flow = FluidSolver(
        grid, boundaries_of(case), density=fluid.density, viscosity=fluid.viscosity, scheme=Scheme(tolerance=tolerance)
    )  # fmt: skip
    for _ in range(steps):
        flow.step(min(2e-3, 0.5 * flow.largest_step().step))
    return flow, [flow.volume_flux(d) * grid.face_area(d) for d in range(3)]


# ---------------------------------------------------------------- flow


@pytest.mark.parametrize("driven", DRIVEN.values(), ids=DRIVEN)
@pytest.mark.parametrize("vessel", VESSELS.values(), ids=VESSELS)
def test_what_enters_through_a_side_leaves_through_another_to_round_off(vessel: Any, driven: Any) -> None:
    """A given flow is that of the true disc; in every cell mass is kept to 1e-12 of the largest flux."""
    x, y, z = flow_in(Case.from_text(TEXT, "c.toml", {"vessel": vessel} | driven))[1]
    balance = np.diff(x, axis=2) + np.diff(y, axis=1) + np.diff(z, axis=0)
    largest, entering = np.abs(x).max(), x[:, :, 0].sum()
    print(f"in {entering:.6g} m3/s, in a cell {np.abs(balance).max() / largest:.2g} of the largest flux are lost")
    assert np.abs(balance).max() < 1e-12 * largest
    assert y[:, -1].sum() == pytest.approx(entering, rel=1e-12) and entering > 1e-4
    assert not z[[0, -1]].any() and not x[:, :, -1].any() and not y[:, 0].any()
    if "patch.air.mass_flow" in driven:
        assert entering == pytest.approx(1e-3 / 1.2, rel=1e-12)
    elif "patch.air.pressure" not in driven:
        assert entering == pytest.approx(2.0 * DISC, rel=1e-9 if vessel else 2e-3)


@pytest.mark.parametrize("vessel", VESSELS.values(), ids=VESSELS)
def test_what_enters_through_the_holes_of_a_plate_leaves_through_the_lid_to_round_off(vessel: Any) -> None:
    """Seven holes of a tenth of a cell in a floor without other inlets."""
    plate = {"kind": "inlet", "shape": "holes", "holes": 7, "pitch": 8e-3, "diameter": 1e-3, "velocity": 20.0}
    case = made(vessel=vessel, patch={"plate": plate, "top": {"kind": "outlet", "side": "lid"}})
    grid = grid_of(case)
    x, y, z = flow_in(case)[1]
    balance = np.diff(x, axis=2) + np.diff(y, axis=1) + np.diff(z, axis=0)
    print(f"in a cell {np.abs(balance).max() / np.abs(z).max():.2g} of the largest flux are lost")
    assert np.abs(balance).max() < 1e-12 * max(np.abs(each).max() for each in (x, y, z))
    assert z[0].sum() == pytest.approx(7 * 20.0 * math.pi / 4.0 * 1e-6, rel=1e-12)
    assert z[-1].sum() == pytest.approx(z[0].sum(), rel=1e-12)
    reached = np.hypot(*(each[0] - 0.04 for each in grid.centres()[:2])) < 0.008 + math.sqrt(0.5) * grid.spacing[0]
    assert not z[0][~np.broadcast_to(reached, z[0].shape)].any()


@pytest.mark.parametrize(
    ("low", "high"), [("floor", "lid"), ("lid", "floor"), ("x_low", "x_high"), ("y_high", "y_low")]
)
def test_a_pressure_is_that_of_fluid_at_rest_outside(low: str, high: str) -> None:
    """Through the whole of two opposite sides, by Bernoulli: p = rho u2 / 2 once the flow is steady."""
    sides = {
        "patch.air": {"kind": "inlet", "side": low, "pressure": 3.0},
        "patch.out": {"kind": "outlet", "side": high},
    }
    column = {"width": 0.04, "height": 0.04, "cell": 0.01, "ends": "closed"}
    case = made(vessel=None, fluid__viscosity=1e-9, column=column, **sides)
    flow, through = flow_in(case, 400, 1e-10)
    axis = 2 if low in ("floor", "lid") else "xy".index(low[0])
    speed = math.sqrt(2.0 * 3.0 / 1.2) * (1.0 if low in ("floor", "x_low") else -1.0)
    assert through[axis].sum() / (grid_of(case).cells[axis] + 1) == pytest.approx(speed * 0.04**2, rel=2e-3)
    assert flow.pressure.max() < 3.0


def test_an_opening_above_atmospheric_pressure_draws_fluid_in_and_one_below_it_lets_it_out() -> None:
    """An outlet of 4 Pa beside one at 0 Pa."""
    x, y, _ = flow_in(made(patch__air__kind="outlet", patch__air__velocity=None, patch__air__pressure=-4.0))[1]
    assert x[:, :, 0].sum() < -1e-4 and y[:, -1].sum() == pytest.approx(x[:, :, 0].sum(), rel=1e-12)


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"patch.air.centre": [0.043, 0.005]}, "patch.air.centre.*in the wall of the vessel, off its corners"),
        ({"patch.air.centre": [0.07, 0.03]}, r"patch.air.centre.*in the wall of the vessel.*y = 0.055 to 0.085 m"),
        ({"vessel": None, "patch.air.centre": [0.07, 0.03]}, "patch.air.centre.*in the side, off its corners"),
        ({"patch.air.centre": [0.9, 0.9]}, r"patch.air.centre = \(0.9, 0.9\): must be such that.*move it"),
        ({"vessel.shape": "cone", "vessel.radius": 0.005, "vessel.length": 0.12}, "patch.air.centre.*in the wall"),
        ({"patch.out": {"kind": "outlet", "side": "y_high"}}, "patch.out.shape.*box or disc"),
        ({"patch.out.side": "x_low", "patch.out.centre": [0.043, 0.045]}, "patch.out.centre.*beside patch.air.*0.01"),
        ({"patch.out.kind": "wall"}, "patch.out.kind.*inlet or outlet|together with an outlet"),
        ({"patch.air.side": "x_hihg"}, "patch.air.side.*one of floor, lid, x_low"),
        ({"patch.out.kind": "inlet", "patch.out.velocity": 1.0}, "patch.*together with an outlet"),
        ({"patch.air.velocity": None}, "patch.air.velocity: must be given for an inlet.*pressure"),
        ({"patch.air.pressure": 3.0}, "patch.air.pressure.*left out where there is a velocity"),
        ({"vessel.spin": 3.0}, "vessel.spin.*left out beside patch.air"),
        ({"vessel": {"shape": "box", "size": [0.05, 0.05], "turn": 30.0}}, "patch.air.side.*a box that is turned"),
        ({"vessel": None, "column.shape": "cylinder"}, "patch.air.side.*floor or lid of a column with steps"),
        ({"vessel": None, "column.sides": "periodic"}, "patch.air.side.*a side that is not periodic"),
    ],
    ids=str,
)  # fmt: skip
def test_an_opening_that_cannot_be_is_refused_in_a_line(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said) as refusal:
        Case.from_text(TEXT, "c.toml", given)
    assert len(str(refusal.value)) < 400


def test_an_opening_smaller_than_a_cell_is_no_opening_and_the_check_says_so() -> None:
    small = made(patch__air__diameter=0.012)
    said = [each.reason for each in preflight(small).issues if each.key == "patch.air"]
    assert any("1.2 cells across" in each for each in said), said
    assert not [each for each in preflight(made()).issues if each.key.startswith("patch")]


def test_openings_that_meet_in_a_face_bring_the_given_flow_and_those_apart_are_not_refused() -> None:
    """Boxes with half a cell between them along z, in the same faces."""
    box = {"shape": "box", "side": "x_low", "size": [0.03, 0.02]}
    low, high = ({**box, "centre": [0.04, z]} for z in (0.024, 0.0451))
    inlet, outlet = {"kind": "inlet", "velocity": 2.0} | low, {"kind": "outlet"} | high
    for given in ({"air": inlet, "out": outlet}, {"out": outlet, "air": inlet}):
        case = made(patch=given)
        x, entering = flow_in(case)[1][0][:, :, 0], patch_faces(case, "x_low").shares["air"] > 0.0
        assert x[entering].sum() == pytest.approx(2.0 * 0.03 * 0.02, rel=1e-9)
        assert x[~entering].sum() == pytest.approx(-2.0 * 0.03 * 0.02, rel=1e-9)


@pytest.mark.parametrize(
    ("one", "other", "common"),
    [
        ({"diameter": 0.03}, {"diameter": 0.01, "centre": (0.06, 0.08)}, 0.02 - 0.05),
        ({"diameter": 0.03}, {"size": (0.04, 0.02), "centre": (0.043, 0.0)}, 0.015 - 0.023),
        ({"diameter": 0.03}, {"size": (0.04, 0.02), "centre": (0.03, 0.0)}, 0.015 - 0.01),
        ({"size": (0.02, 0.02)}, {"size": (0.04, 0.02), "centre": (0.03, 0.0)}, 0.0),
        ({"size": (0.02, 0.02)}, {"size": (0.04, 0.02), "centre": (0.01, 0.017)}, 0.003),
    ],
    ids=["discs", "a disc beside a box", "a disc and a box", "boxes that touch", "boxes"],
)
def test_discs_and_boxes_overlap_by_their_distance(one: Any, other: Any, common: float) -> None:
    """A disc of 3 cm or a box at (0.03, 0.04) m less than its neighbour, by hand."""
    first, second = (
        CasePatch(kind="outlet", shape="disc" if "diameter" in each else "box", **{"centre": (0.0, 0.0)} | each)
        for each in (one, other)
    )
    if "centre" in other and "diameter" in other:
        first = first.model_copy(update={"centre": (0.03, 0.04)})
    assert overlap(first, second, (0.0, 0.0)) == pytest.approx(common, abs=1e-15)
    assert overlap(second, first, (0.0, 0.0)) == pytest.approx(common, abs=1e-15)


def test_a_pressure_gives_the_speed_of_free_flow_where_no_other_is_given() -> None:
    """sqrt(2 x 5000 Pa / 1.2 kg/m3) = 91.3 m/s; beside 4990 Pa outside, that of 10 Pa."""
    driven = {"patch.air.velocity": None, "patch.air.pressure": 5000.0, "run.reference_speed": None}
    case = Case.from_text(TEXT, "c.toml", driven)
    assert case.reference_speed == pytest.approx(91.287, rel=1e-4) and case.fastest_inflow == 0.0
    said = [str(each) for each in preflight(case).issues if each.key == "run.reference_speed"]
    assert len(said) == 1 and "91.3 m/s" in said[0] and "m/s, if they are slower" in said[0]
    beside = case.with_(**{"patch.out.pressure": 4990.0})
    assert beside.reference_speed == pytest.approx(math.sqrt(2.0 * 10.0 / 1.2))
    given = case.with_(**{"run.reference_speed": 3.0})
    assert given.reference_speed == 3.0
    assert not [each for each in preflight(given).issues if each.key == "run.reference_speed"]
    assert {row.name: row.value for row in preflight(given).rows}["free flow by the pressures"] > 91.0
    assert made(run__reference_speed=None).reference_speed == pytest.approx(2.0 * 2.0), "of a velocity, as ever"


@pytest.mark.parametrize(
    "patch",
    [
        {"shape": "disc", "diameter": 3.9e-3, "side": "y_high", "centre": [0.04, 0.06]},
        {"shape": "ring", "diameter": 0.02, "inner_diameter": 0.0125, "side": "lid"},
        {"shape": "box", "size": [0.02, 3.9e-3], "side": "floor"},
    ],
    ids=lambda each: each["side"],
)
def test_a_particle_that_fits_through_no_opening_never_leaves_and_the_check_says_so(patch: dict[str, Any]) -> None:
    case = made(patch__out={"kind": "outlet", "particles": "leave"} | patch)
    (found,) = [each for each in preflight(case).issues if each.key == "patch.out.particles"]
    assert found.severity == "error" and "m across, and no particle fits through; the smallest is" in found.reason
    mixed = case.with_(bed={"sizes": [[2e-3, 0.5], [4e-3, 0.5]], "count": 10, "start": "suspended"})
    (found,) = [each for each in preflight(mixed).issues if each.key == "patch.out.particles"]
    assert found.severity == "warning" and "not every particle fits through; the largest is 0.004 m" in found.reason
    for free in (case.with_(**{"patch.out.particles": "stay"}), case.with_(**{"bed.diameter": 3e-3})):
        assert not [each for each in preflight(free).issues if each.key == "patch.out.particles"]


def test_openings_are_in_the_text_and_the_drawing_of_a_case(tmp_path: Path) -> None:
    case = made()
    assert Case.from_text(case.to_toml()) == case
    save(case_drawing(case), tmp_path / "case.png")
    assert (tmp_path / "case.png").stat().st_size > 1000


# ---------------------------------------------------------------- particles


@pytest.mark.parametrize("name", VESSELS)
def test_particles_leave_where_they_touch_the_wall_and_lie_within_the_opening(name: str) -> None:
    """Of spheres all around the vessel, at its wall or off it, those at the disc on the side of low x alone."""
    case = Case.from_text(TEXT, "c.toml", {"vessel": VESSELS[name], "patch.air.particles": "leave"})
    radius, random = 2e-3, np.random.default_rng(3)
    place = random.uniform((0.0, 0.0, radius), (0.08, 0.08, 0.12 - radius), (200_000, 3))
    if name in ("round", "cone"):
        away = case.beyond_the_side(place, radius)
    else:
        half = np.array([0.03, 0.035] if name == "narrow box" else [0.04, 0.04])
        away = (np.abs(place[:, :2] - 0.04) - half + radius).max(axis=1)
    place, away = place[away < 0.0], away[away < 0.0]
    taken = Opening(case, case.patch["air"]).takes(make_particles(place, radius, 1000.0))
    beside = np.hypot(place[:, 1] - 0.043, place[:, 2] - 0.031)
    if name in ("round", "cone"):
        touches = (away > -0.05 * radius) & (place[:, 0] < 0.04)
    else:
        touches = place[:, 0] < 0.04 - half[0] + 1.05 * radius
    assert 10 < taken.sum() < 0.05 * len(place)
    wrong = taken != (touches & (beside < 0.015 - radius))
    assert wrong.sum() <= (2 if name == "cone" else 0)  # across a cone distances differ by its slope


@pytest.mark.parametrize("name", ["column", "round"])
def test_a_particle_that_would_touch_and_return_within_a_step_leaves_before_it(name: str) -> None:
    """At 1.9, 2.1 and -1.9 mm a step towards the wall, with a gap of 2 mm."""
    case = Case.from_text(TEXT, "c.toml", {"vessel": VESSELS[name], "patch.air.particles": "leave"})
    touch = 2e-3 if name == "column" else 0.04 - math.sqrt(0.038**2 - 0.003**2)  # 38 mm from the axis, at y
    spheres = make_particles(np.tile([touch + 2e-3, 0.043, 0.031], (3, 1)), 2e-3, 1000.0)
    spheres.velocity[:, 0] = -1.9, -2.1, 1.9
    opening = Opening(case, case.patch["air"])
    assert not opening.takes(spheres).any()
    opening.step = 1e-3
    assert opening.takes(spheres).tolist() == [False, True, False]


@pytest.mark.parametrize("speed", [0.4, 4.0])
def test_a_bed_overflows_a_weir_and_the_particles_are_counted_with_their_times(speed: float) -> None:
    """Two spheres roll to the side, one above the sill and one below it; a third one rests. The fast one would cross,
    touch and return within a step. What it takes along is in the balance."""
    weir = {"kind": "outlet", "side": "x_high", "shape": "box", "centre": [0.02, 0.03], "size": [0.04, 0.02],
            "particles": "leave"}  # fmt: skip
    case = made(
        vessel=None, patch={"weir": weir}, run__until=0.05, fluid__viscosity=1e-9,
        column={"width": 0.04, "height": 0.04, "cell": 0.01, "ends": "closed"},
        laws={"gravity": [0.0, 0.0, 0.0]}, run__reference_speed=speed,
        bed={"diameter": 4e-3, "positions": [[0.03, 0.02, 0.03], [0.03, 0.02, 0.0219], [0.01, 0.02, 0.01]],
             "start": "placed", "initial_velocity": [speed, 0.0, 0.0]},
    )  # fmt: skip
    simulation = Simulation(case)
    while simulation.particles.count == 3 and simulation.time < 0.05:
        simulation.step()
    found, step = row(simulation), simulation.last_step
    print(f"{speed * step:.3g} m in a step; imbalance {found['momentum_imbalance']:.2g}")
    assert found["removed_count"] == 1 and simulation.particles.count == 2
    assert 0.0 <= 0.008 / speed - found["residence_time"] <= 1.1 * step + 1e-4 / speed
    assert found["momentum_imbalance"] < 1e-12
    assert (simulation.particles.position[:, 0] < 0.038 + 1e-5).all()
    assert outline(case.patch["weir"], (0.02, 0.02))[:, 1].min() == pytest.approx(0.02)
