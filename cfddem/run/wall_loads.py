"""Force, torque and power of the moving walls of a case, from the contacts, films and bridges between particles and
them. A film or a bridge gives impulses: its force is that of the last step over the step."""

from __future__ import annotations

import math

import numpy as np

from cfddem.case.schema import Case
from cfddem.io.quantities import Quantity
from cfddem.particles.walls.nearest_point import DISTANCE, NORMAL, TOUCH
from cfddem.run.simulation import Simulation

AXES = "xyz"

IMPULSES = ("film_push", "impulse", "shear_impulse", "bridge_impulse")
"""Fields of pairs whose first three values are an impulse of the last step on the particle [N s]."""

COUPLES = ("shear_couples", "shear_impulse")
"""Fields of pairs whose last three values are an angular impulse of the last step on the wall [N m s]."""


def columns(case: Case) -> dict[str, Quantity]:
    """Columns of the history: for every wall that moves, and the torque for those that turn."""
    found: dict[str, Quantity] = {}
    for number, wall in enumerate(case.wall):
        if not wall.moves:
            continue
        name, words = f"wall_{number}", f"of the particles on wall {number}"
        found |= {f"{name}_force_{axis}": Quantity("N", f"force {words} along {axis}", "measure") for axis in AXES}
        if any(wall.spin):
            found[f"{name}_torque"] = Quantity("N m", f"torque {words} about its spin axis", "measure")
        meaning = f"power that the motion of wall {number} gives to the particles"
        found[f"{name}_power"] = Quantity("W", meaning, "measure")
    return found


def wall_loads(simulation: Simulation) -> dict[str, float]:
    """Values of the columns."""
    solver, walls = simulation.particle_solver, simulation.particle_solver.walls
    first = len(walls.sweep) - len(simulation.case.wall)  # the walls of the case are the last ones
    force, torque = (np.array(simulation.communicator.sum(each, axis=())) for each in _loads(simulation))
    found: dict[str, float] = {}
    for number, wall in enumerate(simulation.case.wall):
        m, name = first + number, f"wall_{number}"
        if not wall.moves:
            continue
        found |= {f"{name}_force_{axis}": float(each) for axis, each in zip(AXES, force[m])}
        if any(wall.spin):
            found[f"{name}_torque"] = float(torque[m] @ np.array(wall.spin)) / math.hypot(*wall.spin)
        found[f"{name}_power"] = -float(force[m] @ solver.walls.velocity[m] + torque[m] @ solver.walls.spin[m])
    return found


def _loads(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Force on each wall, and torque about the centre of its spin, from the particles of this rank (walls, 3)."""
    solver = simulation.particle_solver
    edges, walls, particles = solver.edges, solver.walls, solver.particles
    force, torque = np.zeros((2, len(walls.sweep), 3))
    at_walls = slice(edges.between_particles, None)
    owner, own = walls.wall[edges.second[at_walls]], edges.first[at_walls]
    touch = edges.touch.reshape(-1, TOUCH)
    place = particles.position[own] - touch[:, DISTANCE, None] * touch[:, NORMAL : NORMAL + 3]
    arm = place - (walls.centre + walls.shift)[owner]
    rate = 1.0 / solver.last_step if solver.last_step > 0.0 else 0.0
    for name, factor in {"force": 1.0, "bridge_force": 1.0, **dict.fromkeys(IMPULSES, rate)}.items():
        if name in edges:
            pushed = -factor * edges[name][at_walls, :3]
            np.add.at(force, owner, pushed)
            np.add.at(torque, owner, np.cross(arm, pushed))
    for name in COUPLES:
        if name in edges:
            np.add.at(torque, owner, rate * edges[name][at_walls, -3:])
    if "moment" in edges:  # of rolling resistance
        np.subtract.at(torque, owner, edges["moment"][at_walls])
    return force, torque
