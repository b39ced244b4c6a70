"""Measures of wet particles: where the liquid is, bridges, agglomerates, and how evenly the particles are coated."""

from __future__ import annotations

import math

import numpy as np

from cfddem.analysis import agglomerates
from cfddem.analysis.agglomerates import AgglomerateSizes
from cfddem.backend.communicator import SERIAL
from cfddem.particles import zone_times
from cfddem.run import wet_state
from cfddem.run.budgets.liquid import LiquidBudget
from cfddem.run.simulation import Simulation


def liquid_on_particles(simulation: Simulation) -> float:
    """Volume of liquid in the films of the particles."""
    return _budget(simulation).on_particles


def liquid_in_bridges(simulation: Simulation) -> float:
    """Volume of liquid in bridges."""
    return _budget(simulation).in_bridges


def liquid_gained_by_walls(simulation: Simulation) -> float:
    """Volume of liquid on the walls less that at the start."""
    return _budget(simulation).gained_by_walls


def liquid_sprayed(simulation: Simulation) -> float:
    """Volume of liquid that the spray has brought to particles so far."""
    return _budget(simulation).sprayed


def liquid_missed(simulation: Simulation) -> float:
    """Volume of liquid sprayed so far that found no particle."""
    spray = simulation.spray
    return 0.0 if spray is None else spray.missed * spray.drop_volume


def liquid_imbalance(simulation: Simulation) -> float:
    """Change of all liquid that the spray did not bring, over all liquid."""
    return _budget(simulation).imbalance


def bridge_liquid_share(simulation: Simulation) -> float:
    """Share of the liquid that is in bridges."""
    budget = _budget(simulation)
    return budget.in_bridges / budget.total if budget.total > 0.0 else math.nan


def wet_share(simulation: Simulation) -> float:
    """Share of the particles that carry liquid, on themselves or in a bridge."""
    return SERIAL.count(_carried(simulation) > 0.0) / max(len(simulation.whole("id")), 1)


def coating_variation(simulation: Simulation) -> float:
    """Standard deviation of the liquid on a particle over its mean, with its part of the liquid of its bridges."""
    carried = _carried(simulation)
    mean = carried.mean()  # local: of all ranks
    return float(carried.std() / mean) if mean > 0.0 else math.nan  # local: of all ranks


def bridge_count(simulation: Simulation) -> float:
    """Number of liquid bridges."""
    bridges = simulation.particle_solver.bridges
    return 0.0 if bridges is None else float(bridges.count)


def bridges_per_particle(simulation: Simulation) -> float:
    """Mean number of bridges of a particle to other particles."""
    first, _, _ = wet_state.joined(simulation.particle_solver)
    return 2.0 * len(first) / max(len(simulation.whole("id")), 1)


def agglomerate_size(simulation: Simulation) -> float:
    """Mean number of particles in the agglomerate of a particle."""
    return _sizes(simulation).mean_by_particle


def largest_agglomerate(simulation: Simulation) -> float:
    """Number of particles in the largest agglomerate."""
    return float(_sizes(simulation).largest)


def agglomerated_share(simulation: Simulation) -> float:
    """Share of the particles that a bridge joins to another."""
    return _sizes(simulation).joined


def spray_zone_share(simulation: Simulation) -> float:
    """Share of the particles in the spray zone."""
    owned, total, spray = simulation.owned, simulation.communicator.sum, simulation.spray
    assert spray is not None  # a measure of cases with a spray
    return float(total(spray.zone(owned.position)) / max(total([owned.count]), 1))


def spray_residence_time(simulation: Simulation) -> float:
    """Mean time so far of a visit to the spray zone."""
    return zone_times.mean_visit(simulation.owned, simulation.communicator)


def spray_circulation_time(simulation: Simulation) -> float:
    """Mean time so far from one entry of a particle into the spray zone to its next."""
    return zone_times.mean_round(simulation.owned, simulation.communicator)


MEASURES = (
    ("1", "measure", bridge_liquid_share),
    ("1", "measure", wet_share),
    ("1", "measure", coating_variation),
    ("1", "measure", bridge_count),
    ("1", "measure", bridges_per_particle),
    ("1", "measure", agglomerate_size),
    ("1", "measure", largest_agglomerate),
    ("1", "measure", agglomerated_share),
    ("m3", "recorded", liquid_on_particles),
    ("m3", "recorded", liquid_in_bridges),
    ("m3", "recorded", liquid_gained_by_walls),
    ("1", "imbalance", liquid_imbalance),
)
"""Unit, group and function of the measures of cases with a liquid."""

OF_SPRAY = (
    ("m3", "recorded", liquid_sprayed),
    ("m3", "recorded", liquid_missed),
    ("1", "measure", spray_zone_share),
    ("s", "recorded", spray_residence_time),
    ("s", "recorded", spray_circulation_time),
)
"""Those of cases with a spray."""


def _budget(simulation: Simulation) -> LiquidBudget:
    assert simulation.liquid is not None
    return simulation.liquid


def _sizes(simulation: Simulation) -> AgglomerateSizes:
    first, second, _ = wet_state.joined(simulation.particle_solver)
    return agglomerates.summary(first, second, len(wet_state.ids(simulation.particle_solver)))


def _carried(simulation: Simulation) -> np.ndarray:
    return wet_state.carried(simulation.particle_solver)
