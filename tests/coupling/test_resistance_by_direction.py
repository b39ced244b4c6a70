"""Drag beside walls in a fluid that moves: momentum, energy, and beads that a stream takes along."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cfddem import Case, Simulation
from cfddem.coupling.forces.drag import WallDrag
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.terms import CouplingTerms, ForceTerms
from cfddem.coupling.transfer import slip_of
from cfddem.features.energy import EnergyLedger
from cfddem.model.feature import FluidForce
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane

WIDTH, RADIUS = 0.032, 1e-3


def beads_beside_floor(gaps: list[float], changes: dict[str, Any]) -> Simulation:
    """Glass beads at gaps [radii] above a floor in water, without films and without friction."""
    glass = {
        "density": 2540.0, "youngs_modulus": 6e10, "contact_modulus": 1e6, "poisson": 0.23, "friction": 0.0,
    }  # fmt: skip
    places = [(0.004 + 0.005 * n, 0.016, RADIUS * (1.0 + gap)) for n, gap in enumerate(gaps)]
    case = Case(
        fluid={"density": 998.0, "viscosity": 1e-3},
        material={"glass": glass},
        column={"width": WIDTH, "height": WIDTH, "cell": 0.008, "sides": "periodic", "ends": "closed"},
        bed={"diameter": 2.0 * RADIUS, "positions": places},
        laws={"wall_drag": "nearest", "lubrication": "none"},
        run={"until": 0.01},
    )
    return Simulation(case.with_(**changes))


@pytest.mark.parametrize(
    "laws",
    [
        {},
        {"laws.agitation": "pseudo_turbulence"},
        {"laws.surface": "smeared", "laws.history": "mei_adrian", "laws.added_mass": 0.5},
    ],
    ids=["sharp", "agitation", "history"],
)
def test_momentum_and_energy_are_kept_beside_a_wall(laws: dict[str, Any]) -> None:
    """What the fluid receives is the opposite of what beads do; energy closes to 1e-3 of what is put in."""
    start = {"bed.initial_velocity": (0.02, 0.01, -0.02), "run.energy_budget": True}
    simulation = beads_beside_floor([1e-3, 0.1, 0.3, 0.6], laws | start)
    fluid = simulation.coupling.fluid
    for _ in range(8):
        simulation.step()
        weight, seen = fluid.drag_response()
        sent = simulation.terms.implicit
        received = (weight * (sent.cell_product - sent.cell_conductance * seen)).sum(axis=(0, 1, 2))
        forces = sum(simulation.terms.implicit_force.values())
        np.testing.assert_allclose(
            fluid.grid.cell_volume * received, -forces.sum(axis=0), rtol=0.0, atol=1e-12 * np.abs(forces).sum()
        )
    row = simulation.feature(EnergyLedger).row()
    assert abs(row["energy_remainder"]) < 1e-3 * row["energy_put_in"]


@pytest.mark.parametrize(("density", "most"), [(2540.0, 1e-3), (7800.0, 0.012)])
def test_a_stream_takes_a_bead_at_the_floor_along_as_in_fine_steps(density: float, most: float) -> None:
    """Water that accelerates at 1 m/s2; the bead is held in one direction 1400 times as hard as in the others, and with
    one conductance for all directions the long steps would be wrong by 8 and 44 %."""

    def speed(step: float | None) -> float:
        simulation = beads_beside_floor([1e-5], {"material.glass.density": density, "run.fluid_step": step})
        assert simulation.coupling.fluid is not None
        simulation.coupling.fluid.boundaries.driving[0] = 998.0
        simulation.until(0.0096)
        return float(simulation.particles.velocity[0, 0])

    fine = speed(5e-5)
    assert speed(2e-4) == pytest.approx(fine, rel=5e-4)
    assert speed(None) == pytest.approx(fine, rel=most)


def test_a_stream_takes_a_bead_at_a_slanting_wall_along_as_in_fine_steps() -> None:
    """Without the foreseen change of the fluid the long steps would be wrong by 23 %."""
    normal = np.array((1.0, 0.0, 2.0)) / 5.0**0.5
    wall = Plane(point=tuple(np.full(3, 0.016) - 1.01 * RADIUS * normal), normal=tuple(normal))

    def speed(step: float) -> float:
        changes = {"bed.positions": [(0.016, 0.016, 0.016)], "laws.gravity": (0.0, 0.0, 0.0), "run.fluid_step": step}
        simulation = beads_beside_floor([1.0], changes)
        simulation.forces["wall_drag"]._surfaces = WallDrag([wall], "nearest", film=False)._surfaces
        fluid = simulation.coupling.fluid
        force = np.broadcast_to((998.0, 0.0, 0.0), (*fluid.grid.shape, 3))
        fluid.body_forces.append(lambda: force)
        simulation.until(0.0096)
        return float(simulation.particles.velocity[0] @ (normal[2], 0.0, -normal[0]))

    assert speed(2e-4) == pytest.approx(speed(5e-5), rel=0.01)


def test_a_force_of_ones_own_resists_by_direction() -> None:
    """A bead in still fluid that is held along x alone, and one whose resistance is zero in all directions."""

    class Held(FluidForce):
        name, lines = "held", ("drag",)

        def act(self, terms: CouplingTerms) -> None:
            tensor = np.zeros((terms.particles.count, 3, 3))
            tensor[:, 0, 0] = 0.05
            terms.resist("drag", tensor)

    start = {"bed.positions": [(0.016, 0.016, 0.016)], "bed.initial_velocity": (0.01, 0.01, 0.0)}
    simulation = beads_beside_floor([1.0], start | {"laws.wall_drag": "none"})
    simulation.add(Held())
    for _ in range(3):
        simulation.step()
    assert abs(simulation.particles.velocity[0, 0]) < 0.2 * simulation.particles.velocity[0, 1]
    assert (slip_of(np.zeros((1, 3)), np.zeros(1), np.zeros((1, 3, 3))) == 0.0).all()


def test_beads_that_slide_along_the_floor_are_mapped_to_where_they_go() -> None:
    """Heavy along the floor, light towards it: the voidage at the end of a step is that of their places then."""
    simulation = beads_beside_floor([1e-5], {"bed.initial_velocity": (0.05, 0.0, 0.0)})
    for _ in range(12):
        simulation.step()
    beads, step = simulation.particles, simulation.last_step
    beyond = beads.mapped_position[:, 0] - beads.position[:, 0]
    assert np.abs(beyond).max() < 0.02 * step * beads.velocity[0, 0]
    assert beads.response_rate[0, 2] > 100.0 * beads.response_rate[0, 0]


def test_a_fluctuation_acts_through_the_drag_law_alone() -> None:
    """Beside a wall and beside a history force: what all resistance receives, and each line of it."""
    draw = np.random.default_rng(1)
    half, slip, fluctuation = draw.normal(size=(4, 3, 3)), *draw.normal(size=(2, 4, 3))
    beside, drag, history = half @ half.swapaxes(1, 2), *draw.uniform(1.0, 2.0, (2, 4))
    terms = ForceTerms(make_particles(draw.normal(size=(4, 3)), RADIUS, 2540.0), 1e-3, 1e-3)
    terms.flow = SampledFlow(slip, np.zeros((4, 3)), *np.ones((4, 4)))
    for line, resistance in (("drag", drag), ("drag", beside), ("history", history)):
        terms.resist(line, resistance)
    terms.fluctuate("drag", fluctuation)
    assert terms.directions is not None
    whole = beside + np.multiply.outer(drag + history, np.eye(3))
    force = np.einsum("nde,ne->nd", whole, terms.directions.slip)
    of_drag = np.einsum("nde,ne->nd", beside, slip) + drag[:, None] * (slip + fluctuation)
    np.testing.assert_allclose(force, of_drag + history[:, None] * slip, rtol=1e-10, atol=1e-10)
    terms.receive(force)
    np.testing.assert_allclose(terms.implicit_force["drag"], of_drag, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(terms.implicit_force["history"], history[:, None] * slip, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(terms.mean_slip("drag"), slip, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(("film", "most"), [("none", 5e-4), ("nijssen", 1e-4)])
def test_beside_walls_too_agitation_pushes_a_bed_as_a_whole_nowhere(film: str, most: float) -> None:
    """The sum of what fluctuations do to all particles in a step, found by leaving them out, over that of its sizes.
    Beads held by walls take up less of them within a step."""
    places = (0.00105 + 0.00278 * np.indices((6, 6, 4)).reshape(3, -1).T).tolist()
    bed = {"bed.positions": places, "bed.inlet_velocity": 0.06, "laws.agitation": "pseudo_turbulence"}
    column = {"column.width": 0.016, "column.cell": 0.004, "column.sides": "no_slip", "column.ends": "flow"}
    simulation = beads_beside_floor([1.0], bed | column | {"laws.lubrication": film})
    for _ in range(5):
        simulation.step()
    coupling, beads = simulation.coupling, simulation.owned
    terms = coupling.prepare(beads, simulation.last_step)
    pushed = terms.implicit.target.copy()
    terms.fluctuations.clear()
    left = coupling.momentum.prepare(
        beads, terms.cell_map, terms.resistance, terms.step, terms.unseen, None, terms.directions
    )
    force = left.implicit * (left.target - pushed)
    assert 0.0 < np.abs(force.sum(axis=0)).sum() < most * np.abs(force).sum()
