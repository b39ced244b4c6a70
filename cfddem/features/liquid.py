"""Liquid on the particles of a case: its budget, bridges, agglomerates, and how evenly the particles are coated."""

from __future__ import annotations

import math
from typing import Any

from cfddem.analysis import agglomerates
from cfddem.analysis.agglomerates import AgglomerateSizes
from cfddem.backend.communicator import SERIAL
from cfddem.case.schema import Case
from cfddem.features import wet_state
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.particles.interactions.bridge_view import Bridges


class LiquidOnParticles(CaseFeature):
    """Volumes of liquid of a simulation, summed over all ranks, and what snapshots of wet particles contain.

    brought  liquid that came from outside since the start, such as that of a spray [m3]
    """

    name = "liquid"
    fields = wet_state.SNAPSHOT_FIELDS

    def __init__(self, case: Case, simulation: Any) -> None:
        self.particle_solver, self.brought = simulation.particle_solver, 0.0
        self.bridges: Bridges = self.particle_solver.feature(Bridges)
        self.start = self.total

    @classmethod
    def is_in(cls, case: Case) -> bool:
        """Whether the case has a liquid."""
        return case.liquid is not None

    @classmethod
    def measures(cls, case: Case) -> tuple[Measured, ...]:
        """Where the liquid is, and what it joins."""
        return MEASURES

    def before_snapshot(self, simulation: Any) -> None:
        """Find the liquid that each particle carries, and its agglomerate."""
        wet_state.fill_snapshot_fields(self.particle_solver)

    @property
    def on_particles(self) -> float:
        """Volume in the films of the particles [m3]."""
        particles, total = self.particle_solver.particles, self.particle_solver.communicator.sum
        return float(total(particles.liquid[: particles.owned]))

    @property
    def in_bridges(self) -> float:
        """Volume in bridges [m3]."""
        return float(self.particle_solver.communicator.sum(self.bridges.volume))

    @property
    def gained_by_walls(self) -> float:
        """Volume on the walls less that at the start [m3]."""
        return self.bridges.gained_by_walls

    @property
    def total(self) -> float:
        """All liquid, but for that on the walls at the start [m3]."""
        return self.on_particles + self.in_bridges + self.gained_by_walls

    @property
    def imbalance(self) -> float:
        """Change of the total that sprays and inserted particles did not bring, over all liquid there was [-]."""
        came = self.start + self.brought + self.bridges.fed
        return abs(self.total - came) / max(came, -self.gained_by_walls, self.on_particles, 1e-300)

    def checkpoint(self) -> dict[str, Any]:
        """The liquid at the start, and what has come since."""
        return {"start": self.start, "brought": self.brought}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.start, self.brought = float(state["start"]), float(state["brought"])


# ---------------------------------------------------------------- measures


def liquid_on_particles(simulation: Any) -> float:
    """Volume of liquid in the films of the particles."""
    return _budget(simulation).on_particles


def liquid_in_bridges(simulation: Any) -> float:
    """Volume of liquid in bridges."""
    return _budget(simulation).in_bridges


def liquid_gained_by_walls(simulation: Any) -> float:
    """Volume of liquid on the walls less that at the start."""
    return _budget(simulation).gained_by_walls


def liquid_imbalance(simulation: Any) -> float:
    """Change of all liquid that the spray did not bring, over all liquid."""
    return _budget(simulation).imbalance


def bridge_liquid_share(simulation: Any) -> float:
    """Share of the liquid that is in bridges."""
    budget = _budget(simulation)
    return budget.in_bridges / budget.total if budget.total > 0.0 else math.nan


def wet_share(simulation: Any) -> float:
    """Share of the particles that carry liquid, on themselves or in a bridge."""
    return SERIAL.count(wet_state.carried(simulation.particle_solver) > 0.0) / max(len(simulation.whole("id")), 1)


def coating_variation(simulation: Any) -> float:
    """Standard deviation of the liquid on a particle over its mean, with its part of the liquid of its bridges."""
    carried = wet_state.carried(simulation.particle_solver)
    mean = carried.mean()  # local: of all ranks
    return float(carried.std() / mean) if mean > 0.0 else math.nan  # local: of all ranks


def bridge_count(simulation: Any) -> float:
    """Number of liquid bridges."""
    return float(_budget(simulation).bridges.count)


def bridges_per_particle(simulation: Any) -> float:
    """Mean number of bridges of a particle to other particles."""
    first, _, _ = wet_state.joined(simulation.particle_solver)
    return 2.0 * len(first) / max(len(simulation.whole("id")), 1)


def agglomerate_size(simulation: Any) -> float:
    """Mean number of particles in the agglomerate of a particle."""
    return _sizes(simulation).mean_by_particle


def largest_agglomerate(simulation: Any) -> float:
    """Number of particles in the largest agglomerate."""
    return float(_sizes(simulation).largest)


def agglomerated_share(simulation: Any) -> float:
    """Share of the particles that a bridge joins to another."""
    return _sizes(simulation).joined


def _budget(simulation: Any) -> LiquidOnParticles:
    budget: LiquidOnParticles = simulation.feature(LiquidOnParticles)
    return budget


def _sizes(simulation: Any) -> AgglomerateSizes:
    first, second, _ = wet_state.joined(simulation.particle_solver)
    return agglomerates.summary(first, second, len(wet_state.ids(simulation.particle_solver)))


MEASURES = tuple(
    Measured(*each)
    for each in (
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
)
"""Of cases with a liquid."""
