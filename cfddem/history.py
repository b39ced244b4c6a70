"""A row of a run's history: what is measured of a simulation at an instant."""

from __future__ import annotations

import numpy as np

from cfddem.assembly import grid_of
from cfddem.case import Case
from cfddem.particles.state import Bodies, kinetic_energy
from cfddem.placement import species_of
from cfddem.record import energy
from cfddem.record.ledger import exchange_imbalance, volume_imbalance
from cfddem.record.measures import (
    bed_height,
    cells_of,
    entrance_rise,
    granular_temperature,
    pressure_drop,
    voidage_by_pressure,
)
from cfddem.record.quantities import MEAN_HEIGHT
from cfddem.simulation import Simulation

FIELDS = {
    "fluid_steps": ("1", "number of the fluid step"),
    "fastest": ("m/s", "speed of the fastest particle"),
    "exchange_imbalance": ("1", "momentum given by the fluid and not got by particles, over that given"),
    "volume_imbalance": ("1", "volume gained by a cell against its faces, over the largest flux"),
    "outside_range": (
        "1",
        "how often drag law, or minimum gap and film of one's own, were asked outside of their range, so far",
    ),
    **energy.FIELDS,
}
"""What a run records beside the known quantities."""

BED = (0.2, 0.8)
"""Part of the bed height in which the slope of the pressure is taken, away from floor and surface."""


def measure(simulation: Simulation) -> dict[str, float]:
    """One row of history: what a bed is like now."""
    bodies, fluid = simulation.particles.bodies, simulation.fluid
    column = simulation.case.column
    height = bed_height(bodies.position, bodies.radius)
    grid = grid_of(column)
    cells = cells_of(bodies.position, grid.shape, grid.spacing)
    row = {
        "time": simulation.time,
        "fluid_steps": float(simulation.steps),
        "bed_height": height,
        "granular_temperature": granular_temperature(bodies.velocity, cells).mean,
        "kinetic_energy": kinetic_energy(bodies),
        "fastest": float(np.sqrt((bodies.velocity**2).sum(axis=1).max(initial=0.0))),
        "particle_count": float(bodies.count),
        "contact_count": float((simulation.particles.edges.force != 0.0).any(axis=1).sum()),
    }
    if simulation.energy is not None:
        row |= simulation.energy.row()
    row |= _mean_heights(simulation.case, bodies)
    if fluid is None or simulation.exchange is None:
        return row
    floor = float(grid.open.mean()) * column.size[0] * column.size[1]
    volume = bodies.volume
    carried = 0.0 if simulation.case.bed.fixed else abs(simulation.gravity[2])  # a packed bed need not be carried
    weight = (np.average(bodies.density, weights=volume) - fluid.density) * carried
    low, high = (share * height for share in BED)
    row |= {
        "bed_voidage": 1.0 - 0.99 * volume.sum() / (floor * height),
        "bed_voidage_pressure": voidage_by_pressure(
            fluid.pressure, grid.spacing, float(weight), low, high, open_cells=grid.open
        ),
        "pressure_drop": pressure_drop(fluid.pressure, grid.spacing, 0.0, column.height, open_cells=grid.open)
        + entrance_rise(fluid.volume_flux(2)[0], fluid.mean_voidage[0], fluid.density, grid.open[0]),
        "wall_support": -float(simulation.particles.wall_force[:, 2].sum()) / floor,
        "exchange_imbalance": exchange_imbalance(fluid, simulation.exchange),
        "volume_imbalance": volume_imbalance(fluid),
        "outside_range": float(simulation.exchange.outside + simulation.particles.outside),
    }
    return row


def _mean_heights(case: Case, bodies: Bodies) -> dict[str, float]:
    """Mean height of each species of a mixture by the volume of its particles [m]."""
    if not case.bed.species:
        return {}
    species, volume = species_of(case)[bodies.id], bodies.volume
    carried = np.bincount(species, volume * bodies.position[:, 2]) / np.bincount(species, volume)
    return {f"{MEAN_HEIGHT}{name}": float(height) for name, height in zip(case.bed.species, carried)}
