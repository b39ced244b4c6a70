"""A coupled simulation from public objects, as the page docs/how-to/without-a-case.md puts it together."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.particles.solver import ParticleSolver
from cfddem.run.simulation import Simulation
from cfddem.run.time_steps import StepSettings

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "without-a-case.md").read_text(encoding="utf-8")
FIRST, SECOND = re.findall(r"```python\n(.*?)```", PAGE, re.S)
FIELDS = ("position", "velocity", "spin", "applied")


def put_together() -> dict[str, Any]:
    """Names of the first block of the page, before the simulation has advanced."""
    names: dict[str, Any] = {}
    exec(FIRST.split("simulation.until")[0], names)
    return names


CASE = """
[fluid]
density = 998.0
viscosity = 1e-3
[material.glass]
density = 2540
youngs_modulus = 60e9
contact_modulus = 1e6
poisson = 0.23
friction = 0.4
[column]
width = 0.02
height = 0.06
cell = 0.005
sides = "periodic"
[bed]
diameter = 2e-3
start = "placed"
positions = []
inlet_velocity = 0.05
[laws]
drag = "di_felice"
lubrication = "none"
agitation = "none"
surface = "smeared"
self_disturbance_correction = false
[run]
until = 0.01
reference_speed = 0.15
"""


def case_of_the_page(beads: np.ndarray) -> Case:
    """The same simulation as a case."""
    return Case.from_text(CASE, "bed.toml", {"bed.positions": beads.tolist()})


def test_the_page_takes_at_most_25_lines() -> None:
    assert len([line for line in FIRST.splitlines() if line.strip()]) <= 25


def test_it_is_the_simulation_of_the_same_case_bit_for_bit() -> None:
    names = put_together()
    case = case_of_the_page(names["solver"].particles.position)
    by_case, by_parts = Simulation(case), names["simulation"]
    assert np.array_equal(by_case.fluid.velocity, by_parts.fluid.velocity)
    for simulation in (by_case, by_parts):
        simulation.until(0.01)
    assert by_case.steps == by_parts.steps > 5 and by_case.limiting == by_parts.limiting
    for name in FIELDS:
        assert np.array_equal(by_case.particles[name], by_parts.particles[name]), name
    for name in ("voidage", "velocity", "pressure"):
        assert np.array_equal(getattr(by_case.fluid, name), getattr(by_parts.fluid, name)), name


def test_it_takes_own_forces_and_continues_from_a_checkpoint() -> None:
    names = put_together()
    exec(SECOND, names)
    simulation = names["simulation"]
    simulation.step()
    again = put_together()
    exec(SECOND.splitlines()[0], again)
    own = again["simulation"].forces["<lambda>"]
    again = put_together()
    resumed = Simulation.of(
        again["solver"], again["coupling"], steps=StepSettings(reference_speed=0.15), features=[own],
        state=names["state"],
    )  # fmt: skip
    resumed.step()
    for name in FIELDS:
        assert np.array_equal(simulation.particles[name], resumed.particles[name]), name
    assert "particles" in simulation._repr_html_()


def test_what_needs_a_case_says_so() -> None:
    names = put_together()
    with pytest.raises(InputError, match="made of solvers, without a case"):
        _ = names["simulation"].case
    solver = names["solver"]
    falling = ParticleSolver(solver.particles, solver.table, gravity=(0.0, 0.0, -9.81))
    with pytest.raises(InputError, match=r"gravity.*Weight"):
        Simulation.of(falling, names["coupling"], steps=StepSettings(0.1))
