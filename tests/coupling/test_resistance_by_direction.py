"""Drag beside walls in a fluid that moves: momentum, energy, and beads that a stream takes along."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cfddem import Case, Simulation
from cfddem.features.energy import EnergyLedger

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
        received = (weight * (sent.cell_product - sent.cell_conductance[..., None] * seen)).sum(axis=(0, 1, 2))
        forces = sum(simulation.terms.implicit_force.values())
        np.testing.assert_allclose(
            fluid.grid.cell_volume * received, -forces.sum(axis=0), rtol=0.0, atol=1e-12 * np.abs(forces).sum()
        )
    row = simulation.feature(EnergyLedger).row()
    assert abs(row["energy_remainder"]) < 1e-3 * row["energy_put_in"]


@pytest.mark.parametrize(("density", "most"), [(2540.0, 0.15), (7800.0, 0.5)])
def test_a_stream_takes_a_bead_at_the_floor_along_as_in_fine_steps(density: float, most: float) -> None:
    """Water that accelerates at 1 m/s2; the bead is held in one direction 1400 times as hard as in the others."""

    def speed(step: float | None) -> float:
        simulation = beads_beside_floor([1e-5], {"material.glass.density": density, "run.fluid_step": step})
        assert simulation.coupling.fluid is not None
        simulation.coupling.fluid.boundaries.driving[0] = 998.0
        simulation.until(0.0096)
        return float(simulation.particles.velocity[0, 0])

    fine = speed(5e-5)
    assert speed(2e-4) == pytest.approx(fine, rel=0.06)
    assert speed(None) == pytest.approx(fine, rel=most)
