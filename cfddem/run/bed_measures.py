"""Measures of beds: random motion by direction, waves, and pressure of the contacts."""

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
