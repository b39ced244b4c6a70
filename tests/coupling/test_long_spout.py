"""A spouting cone with a draft tube, over a million steps of the particles: none is lost, none is in a wall."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cfddem.case.schema import Case
from cfddem.fluid.budgets import continuity_residual
from cfddem.run.history import row
from cfddem.run.simulation import Simulation

CASE = Path(__file__).parents[2] / "scenarios/beds/wurster/case.toml"
COARSE = {
    "bed": {"diameter": 6e-3, "count": 300, "seed": 1, "start": "poured"}, "column.cell": 0.012, "liquid": None,
    "spray": None, "heat": None, "vapour": None, "evaporation": None, "run.until": 100.0, "run.particle_step": 6e-6,
    "run.every": None, "run.average_from": None, "run.energy_budget": True,
}  # fmt: skip
TUBE, LOW, HIGH = 0.022, 0.016, 0.088
"""Radius of the draft tube, and its ends [m]."""

RADIUS, MIDDLE = 3e-3, 0.048


def spouted(steps: int) -> dict[str, float]:
    """Run so many steps of the particles; returns the deepest overlaps with walls [m], how often pellets enter and
    leave the tube, and the worst of the budgets of volume and energy [-]."""
    case = Case.from_text(CASE.read_text(encoding="utf-8"), "case.toml", COARSE)
    simulation = Simulation(case)
    solver, fluid = simulation.particle_solver, simulation.fluid
    ids, inside, begun = np.sort(simulation.particles.id), np.zeros(simulation.particles.count, bool), solver.steps
    found = dict.fromkeys(("vessel", "floor", "tube", "volume", "entered the tube", "left it"), 0.0)
    while solver.steps - begun < steps:
        simulation.step()
        particles = simulation.particles
        order = np.argsort(particles.id)
        assert np.array_equal(particles.id[order], ids), "a particle is lost"
        place = particles.position[order]
        assert np.isfinite(place).all() and (place[:, 2] < case.column.height).all()
        across = np.hypot(place[:, 0] - MIDDLE, place[:, 1] - MIDDLE)
        beside = (place[:, 2] > LOW) & (place[:, 2] < HIGH)
        entered = float(fluid.volume_flux(2)[0].sum() * fluid.face_areas[2])
        deepest = {
            "vessel": case.beyond_the_side(place, np.full(len(ids), RADIUS)).max(),
            "floor": (RADIUS - place[:, 2]).max(),
            "tube": (RADIUS - np.abs(across - TUBE))[beside].max(initial=0.0),
            "volume": np.abs(continuity_residual(fluid)).max() / max(entered, 1e-3),
        }
        found |= {name: max(found[name], float(value)) for name, value in deepest.items()}
        now = beside & (across < TUBE)
        found["entered the tube"] += int((now & ~inside).sum())
        found["left it"] += int((inside & ~now).sum())
        inside = now
    energies = row(simulation)
    remainder = energies["energy_remainder"] / energies["energy_put_in"]
    return found | {"steps": solver.steps - begun, "seconds": simulation.time, "energy": remainder}


@pytest.mark.slow
def test_no_pellet_is_lost_or_in_a_wall_over_a_million_steps_of_a_spout_with_a_draft_tube() -> None:
    """The guard of the solver is on. By places and ids alone: overlaps with walls stay below a tenth of a radius, and
    pellets pass through the tube again and again. The budgets of volume and of energy close all the while."""
    found = spouted(1_000_000)
    print({name: float(f"{value:.3g}") for name, value in found.items()})
    assert max(found[name] for name in ("vessel", "floor", "tube")) < 0.1 * RADIUS
    assert found["entered the tube"] > 1000 and found["left it"] > 1000
    assert found["volume"] < 1e-6 and abs(found["energy"]) < 0.02
