"""How golden runs are made."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from solver_options import grouped

from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.io import checkpoint
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.run.simulation import Simulation
from closures.registry import REGISTRY, law
from scenarios.benchmarks import dense_bed

SCENARIOS = Path(__file__).parents[2] / "scenarios"

TIGHT = 1e-11
"""Tolerance of the pressure: so tight that what is left of it does not hide a change."""


def particles(
    position: Any, radius: Any, materials: Sequence[Material], *, of: Any = 0, film: float = 0.0, **state: Any
) -> ParticleSolver:
    """A run of particles alone.

    position, radius  [m]
    materials  of the pair table
    of         material of each particle
    film       viscosity of the fluid between them; none at 0 [Pa s]
    state      velocity, spin, fixed of the particles; liquid = (thickness, laws) of bridges; all else of the solver
    """
    density = np.array([each.density for each in materials])[np.broadcast_to(of, (len(position),))]
    own = {name: state.pop(name) for name in ("velocity", "spin", "fixed") if name in state}
    made = make_particles(np.asarray(position, float), radius, density, material=of, viscosity=film, **own)
    choices = {"film": film > 0.0} | state.pop("laws", {})
    if "liquid" in state:
        thickness, choices["bridge"] = state.pop("liquid")
        coat(made, thickness)
    return ParticleSolver(made, pair_table(materials), laws=Laws(**choices), **grouped(**state))


def stirred_dense_bed(film: bool, speed: float = 0.3) -> ParticleSolver:
    """The standard bed of 1 000 spheres, with random velocities and spins."""
    run, draw = dense_bed.bed(1000, film), np.random.default_rng(1)
    velocity, spin = draw.normal(0.0, speed, (1000, 3)), draw.normal(0.0, 100.0, (1000, 3))
    run.particles.velocity[:], run.particles.spin[:] = velocity[run.particles.id], spin[run.particles.id]
    run.refresh()
    return run


def coupled(text: str | Path, steps: int = 2, **changes: Any) -> Simulation:
    """A case after a few fluid steps.

    text     of the case, or its file among the scenarios
    changes  of the case, with __ for the point: bed__count=3
    """
    values = {name.replace("__", "."): value for name, value in changes.items()}
    case = Case.from_toml(text, values) if isinstance(text, Path) else Case.from_text(text, "case", values)
    return go_on(begun(Simulation(case)), steps)


def begun(simulation: Simulation) -> Simulation:
    """The simulation with a tight tolerance of the pressure."""
    if simulation.has_fluid:
        simulation.fluid.tolerance = TIGHT
    return simulation


def go_on(simulation: Simulation, steps: int) -> Simulation:
    """Make some fluid steps."""
    for _ in range(steps):
        simulation.step()
    return simulation


def kept_and_restored(simulation: Simulation) -> Simulation:
    """The simulation as a file gives it back."""
    with tempfile.TemporaryDirectory() as folder:
        checkpoint.write(Path(folder), {"simulation": simulation.checkpoint()})
        return begun(Simulation.restored(simulation.case, checkpoint.newest(Path(folder))["simulation"]))


def own_law(kind: str, function: Callable[..., float]) -> Callable[..., float]:
    """A function as a user-defined law, registered once."""
    known = REGISTRY[kind].get(function.__name__)
    return known.function if known else law(kind, "a golden run")(function)
