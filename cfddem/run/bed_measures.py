"""Measures of beds: random motion by direction, waves, pressure of the contacts, and loads on walls."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from cfddem.analysis import measures
from cfddem.analysis.waves import FEWEST_LAYERS, LAYER
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.features.feeds import LANDED
from cfddem.fluid.cut_cells import open_share
from cfddem.io.quantities import Quantity
from cfddem.particles.walls.nearest_point import DISTANCE, NORMAL, TOUCH
from cfddem.run.simulation import Simulation

BED = (0.2, 0.8)
"""Part of the bed height, away from floor and surface, over which the bed is measured."""


def granular_temperature_along(simulation: Simulation) -> float:
    """Mean square of the velocity fluctuations along z."""
    return float(granular_temperature(simulation).components[2])


def granular_temperature_across(simulation: Simulation) -> float:
    """Mean square of the velocity fluctuations along x or y, mean of the two."""
    components = granular_temperature(simulation).components
    return float(0.5 * (components[0] + components[1]))


def layer_deviation(simulation: Simulation) -> float:
    """Standard deviation of the solid fraction of layers of 2.5 diameters within the bed."""
    case = simulation.case
    low, high = (share * bed_height(simulation) for share in BED)
    count = int((high - low) / (LAYER * case.bed.diameter))
    if count < FEWEST_LAYERS:
        return math.nan
    edges = np.linspace(low, high, count + 1)
    area = np.array([open_volume(case, a, b) / (b - a) for a, b in pairwise(edges)])
    layers = measures.layer_solid_fraction(simulation.whole("position"), simulation.whole("radius"), edges, area)
    return float(layers.std())  # local: a layer of the whole column


def collisional_pressure(simulation: Simulation) -> float:
    """Pressure of the contacts within the bed: a third of the sum of force times separation, over the volume."""
    solver, positions = simulation.particle_solver, simulation.particles.position
    edges, pairs = solver.edges, slice(0, solver.edges.between_particles)
    mine = edges.first[pairs] < simulation.particles.owned  # one rank counts a pair that two compute
    touching = np.flatnonzero((edges.force[pairs] != 0.0).any(axis=1) & mine)  # local: components of a row
    apart = positions[edges.first[touching]] - positions[edges.second[touching]]
    box = np.where(np.isfinite(solver.box), solver.box, 0.0)
    apart -= box * np.rint(apart / np.maximum(box, np.finfo(float).tiny))
    volume = open_volume(simulation.case, 0.0, bed_height(simulation))
    return float(simulation.communicator.sum(edges.force[touching] * apart)) / (3.0 * volume)


def floor_pressure(simulation: Simulation) -> float:
    """Normal contact force of the particles on the floor, per floor area; NaN without a floor."""
    if simulation.case.column.ends == "periodic":
        return math.nan
    floor = -simulation.particle_solver.wall_force[0, 2]  # the floor is the first wall
    return float(simulation.communicator.sum(np.array([floor]))) / open_area(simulation.case)


MEASURES = (
    ("m2/s2", granular_temperature_along),
    ("m2/s2", granular_temperature_across),
    ("1", layer_deviation),
    ("Pa", collisional_pressure),
    ("Pa", floor_pressure),
)
"""Unit and function of each measure."""


def open_area(case: Case) -> float:
    """Floor area of the open cells [m2]."""
    return float(_open_areas(case)[0])


def open_volume(case: Case, low: float, high: float) -> float:
    """Volume of the open cells between two heights [m3]."""
    areas, edges = _open_areas(case), grid_of(case).spacing[2] * np.arange(grid_of(case).open.shape[0] + 1.0)
    edges[-1] = max(edges[-1], high)  # the top of the column, up to rounding
    return float((areas * np.diff(edges.clip(low, high))).sum())  # local: of the whole grid


def _open_areas(case: Case) -> np.ndarray:
    """Cross-section of the open cells in each layer of cells (nz,) [m2]."""
    column = case.column
    open_part = open_share(grid_of(case)).mean(axis=(1, 2))  # local: every rank knows the whole grid
    return np.asarray(open_part * column.size[0] * column.size[1])


def cells_of(simulation: Simulation) -> measures.Cells:
    """The cell of every particle of all ranks."""
    grid = grid_of(simulation.case)
    return measures.cells_of(simulation.whole("position"), grid.shape, grid.spacing)


def granular_temperature(simulation: Simulation) -> measures.GranularTemperature:
    """Granular temperature of all particles, in the cells of the fluid."""
    return measures.granular_temperature(simulation.whole("velocity"), cells_of(simulation))


def bed_height(simulation: Simulation) -> float:
    """Height below which 99 % of the volume of the bed lies [m]."""
    position, radius = simulation.whole("position"), simulation.whole("radius")
    if LANDED.name in simulation.owned:
        landed = simulation.whole(LANDED.name) > 0
        position, radius = position[landed], radius[landed]
    return measures.bed_height(position, radius)


def bed_solids(simulation: Simulation) -> float:
    """Volume of the particles of the bed: all but those that a feed has inserted, before their first contact [m3]."""
    owned = simulation.owned
    counted = owned.volume * owned.landed if LANDED.name in owned else owned.volume
    return float(simulation.communicator.sum(counted))


# ---------------------------------------------------------------- loads on walls


AXES = "xyz"

IMPULSES = ("film_push", "impulse", "shear_impulse", "bridge_impulse")
"""Fields of pairs whose first three values are an impulse of the last step on the particle [N s]."""

COUPLES = ("shear_couples", "shear_impulse")
"""Fields of pairs whose last three values are an angular impulse of the last step on the wall [N m s]."""


def wall_load_columns(case: Case) -> dict[str, Quantity]:
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
    """Values of the columns, from contacts, films and bridges; a film or bridge has its last impulse over the step."""
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
