"""Measures of walls: force and torque of the particles and of the fluid, and power of walls that move."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cfddem.case.schema import Case
from cfddem.case.walls import CaseWall
from cfddem.features.contact_heat_keys import wall_names
from cfddem.fluid.grid import Array
from cfddem.fluid.wall_force import SMOOTH, loads_on_walls
from cfddem.io.quantities import Quantity
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.walls.nearest_point import DISTANCE, NORMAL, TOUCH
from cfddem.run.simulation import Simulation

AXES = "xyz"

IMPULSES = ("film_push", "impulse", "shear_impulse", "bridge_impulse")
"""Fields of pairs whose first three values are an impulse of the last step on the particle [N s]."""

COUPLES = ("shear_couples", "shear_impulse")
"""Fields of pairs whose last three values are an angular impulse of the last step on the wall [N m s]."""

SIDES = {"floor": "z_low", "lid": "z_high"}
"""Names of walls of a case -> those of the sides of the grid, where they differ."""


class Loaded(NamedTuple):
    """A wall whose loads are recorded.

    number    among the walls of the particle solver
    name      of its columns
    words     what it is
    wall      table of the case; None for a wall of the column
    spin      of the vessel or of the wall [rad/s]
    of_fluid  its name for the fluid; empty where this has no force on it
    """

    number: int
    name: str
    words: str
    wall: CaseWall | None
    spin: tuple[float, float, float]
    of_fluid: str

    @property
    def moves(self) -> bool:
        """Whether it is a moving wall of the case."""
        return self.wall is not None and self.wall.moves


def loaded_walls(case: Case) -> Iterator[Loaded]:
    """The walls whose loads are recorded: those that move, or all of them with `run.wall_forces`."""
    names = wall_names(case)
    first = len(names) - len(case.wall)
    for number, name in enumerate(names):
        wall = case.wall[number - first] if number >= first else None
        spin = (0.0, 0.0, case.vessel.spin) if case.vessel and name == "side" else (0.0, 0.0, 0.0)
        of_fluid = SIDES.get(name, name) if case.has_fluid and wall is None else ""
        if name == "side":
            of_fluid = SMOOTH if case.has_smooth_walls else ""
        loaded = Loaded(
            number, f"wall_{name}" if wall else name, f"wall {name}" if wall else f"the wall {name}", wall,
            wall.spin if wall else spin, of_fluid,
        )  # fmt: skip
        if loaded.moves or case.run.wall_forces:
            yield loaded


def wall_load_columns(case: Case) -> dict[str, Quantity]:
    """Columns of the history, for every wall whose loads are recorded."""
    columns: dict[str, Quantity] = {}
    for wall in loaded_walls(case):
        sources = [("", "particles")] + [("fluid_", "fluid, its hydrostatic pressure left out,")] * bool(wall.of_fluid)
        about = "its spin axis" if any(wall.spin) else "the upright axis of the column"
        for of, source in sources:
            name, words = f"{wall.name}_{of}", f"of the {source} on {wall.words}"
            columns |= {f"{name}force_{axis}": Quantity("N", f"force {words} along {axis}", "measure") for axis in AXES}
            if any(wall.spin) or case.run.wall_forces:
                columns[f"{name}torque"] = Quantity("N m", f"torque {words} about {about}", "measure")
        if wall.moves:
            meaning = f"power that the motion of {wall.words} gives to the particles"
            columns[f"{wall.name}_power"] = Quantity("W", meaning, "measure")
    return columns


def wall_loads(simulation: Simulation) -> dict[str, float]:
    """Values of the columns, from contacts, films and bridges; a film or bridge has its last impulse over the step."""
    case, walls, loads_of_walls = simulation.case, simulation.particle_solver.walls, dict[str, float]()
    force, torque = loads_of_particles(simulation.particle_solver)
    axis = np.array((0.5 * case.column.size[0], 0.5 * case.column.size[1], 0.0))
    recorded = list(loaded_walls(case))
    of_fluid = loads_on_walls(simulation.fluid, axis) if any(wall.of_fluid for wall in recorded) else {}
    for wall in recorded:
        m = wall.number
        pushed, turned, about = force[m], torque[m], (0.0, 0.0, 1.0)
        if any(wall.spin):
            about = wall.spin
        else:  # about the axis of the column
            turned = turned + np.cross((walls.centre + walls.shift)[m] - axis, pushed)
        loads = {"": (pushed, turned)} | ({"fluid_": of_fluid[wall.of_fluid]} if wall.of_fluid else {})
        for of, (push, turn) in loads.items():
            loads_of_walls |= {f"{wall.name}_{of}force_{x}": float(value) for x, value in zip(AXES, push)}
            if any(wall.spin) or case.run.wall_forces:
                loads_of_walls[f"{wall.name}_{of}torque"] = float(turn @ np.array(about)) / math.hypot(*about)
        if wall.moves:
            loads_of_walls[f"{wall.name}_power"] = -float(pushed @ walls.velocity[m] + torque[m] @ walls.spin[m])
    return loads_of_walls


def loads_of_particles(solver: ParticleSolver) -> tuple[Array, Array]:
    """Force of the particles on each wall, and torque about the centre of its spin; of all ranks, with the same bits.

    returns  forces (walls, 3) [N], torques (walls, 3) [N m]
    """
    edges, walls, particles = solver.edges, solver.walls, solver.particles
    at_walls = slice(edges.between_particles, None)
    owner, own = walls.wall[edges.second[at_walls]], edges.first[at_walls]
    touch = edges.touch.reshape(-1, TOUCH)
    place = particles.position[own] - touch[:, DISTANCE, None] * touch[:, NORMAL : NORMAL + 3]
    arm = place - (walls.centre + walls.shift)[owner]
    rate = 1.0 / solver.last_step if solver.last_step > 0.0 else 0.0
    force, torque = np.zeros((2, len(owner), 3))
    for name, factor in {"force": 1.0, "bridge_force": 1.0, **dict.fromkeys(IMPULSES, rate)}.items():
        if name in edges:
            force -= factor * edges[name][at_walls, :3]
    torque += np.cross(arm, force)
    for name in COUPLES:
        if name in edges:
            torque += rate * edges[name][at_walls, -3:]
    if "moment" in edges:  # of rolling resistance
        torque -= edges["moment"][at_walls]
    rows = np.concatenate([force, torque], axis=1)
    sums = [solver.communicator.sum(rows[owner == number], axis=0) for number in range(len(walls.sweep))]
    force, torque = np.array(sums).reshape(-1, 2, 3).swapaxes(0, 1)
    return force, torque
