"""Measures of feeds and outlets."""

from __future__ import annotations

from cfddem.run.simulation import Simulation


def fed_count(simulation: Simulation) -> float:
    """Number of particles that feeds have inserted so far."""
    return simulation.equipment.fed


def waiting_count(simulation: Simulation) -> float:
    """Number of particles that are due, and wait for a free place in the box of a feed."""
    return simulation.equipment.waiting


def removed_count(simulation: Simulation) -> float:
    """Number of particles that outlets have removed so far."""
    return simulation.equipment.removed[0]


def removed_mass(simulation: Simulation) -> float:
    """Mass of the particles that outlets have removed so far."""
    return simulation.equipment.removed[1]


OF_FEEDS = (("1", "recorded", fed_count), ("1", "recorded", waiting_count))
OF_OUTLETS = (("1", "recorded", removed_count), ("kg", "recorded", removed_mass))
"""Unit, group and function of each measure."""
