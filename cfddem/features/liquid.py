"""Liquid on the particles of a case: its budget, bridges, agglomerates, and how evenly the particles are coated."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL
from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.model.fields import Field
from cfddem.particles.interactions.bridge_view import (
    AgglomerateSizes,
    Bridges,
    agglomerate_sizes,
    agglomerates,
    carried_liquid,
)
from cfddem.particles.solver import ParticleSolver

CARRIED = Field(
    "liquid_carried", "m3", role="scratch", snapshot=True,
    meaning="liquid of the particle, half of its bridges to others and all at walls included",
)  # fmt: skip
AGGLOMERATE = Field(
    "agglomerate", role="scratch", dtype=np.int64, snapshot=True, meaning="lowest id in the agglomerate of the particle"
)
SIZE = Field("agglomerate_size", role="scratch", dtype=np.int64, snapshot=True, meaning="particles in the agglomerate")
SNAPSHOT_FIELDS = (CARRIED, AGGLOMERATE, SIZE)
"""What snapshots of wet particles contain beside the fields of the solver."""


class LiquidOnParticles(CaseFeature):
    """Volumes of liquid of a simulation, summed over all ranks, and what snapshots of wet particles contain.

    brought     liquid that came from outside since the start, such as that of a spray [m3]
    evaporated  liquid that has left as vapour since the start [m3]
    """

    name, table, kept = "liquid", "liquid", ("start", "brought", "evaporated")
    fields = SNAPSHOT_FIELDS

    def __init__(self, case: Case, simulation: Any) -> None:
        self.particle_solver, self.brought, self.evaporated = simulation.particle_solver, 0.0, 0.0
        self.bridges: Bridges = self.particle_solver.feature(Bridges)
        self.start = self.total

    def before_snapshot(self, simulation: Any) -> None:
        """Find the liquid that each particle carries, and its agglomerate."""
        _fill_snapshot_fields(self.particle_solver)

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
        """Change of the total that nothing brought or took away, over all liquid there was [-]."""
        came = self.start + self.brought + self.bridges.fed
        return abs(self.total + self.evaporated - came) / max(came, -self.gained_by_walls, self.on_particles, 1e-300)


# ---------------------------------------------------------------- of all ranks


def _ids(solver: ParticleSolver) -> np.ndarray:
    """Ids of the particles of all ranks, in ascending order (N,)."""
    particles = solver.particles
    return np.sort(solver.communicator.joined(particles.id[: particles.owned]))


def _joined(solver: ParticleSolver, bonds: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places among `_ids` of the particles that each bridge between particles joins (n,), (n,), and its liquid [m3].

    bonds  whether solid bonds count, too, without liquid
    """
    bridges, all_ids = solver.feature(Bridges), _ids(solver)
    bodies, volume = bridges.bodies.reshape(-1, 2), bridges.volume
    pairs = bodies[:, 1] >= 0
    bodies, volume = bodies[pairs], volume[pairs]
    if bonds:
        solid = solver.edges.ends(solver.particles.id, bridges.bonds)
        bodies, volume = np.concatenate([bodies, solid]), np.append(volume, np.zeros(len(solid)))
    bodies, volume = solver.communicator.joined(bodies), solver.communicator.joined(volume)
    return np.searchsorted(all_ids, bodies[:, 0]), np.searchsorted(all_ids, bodies[:, 1]), volume


def _carried(solver: ParticleSolver) -> np.ndarray:
    """Liquid of every particle by id, with half of its bridges to others and all at walls (N,) [m3]."""
    bridges, collect, particles = solver.feature(Bridges), solver.communicator.joined, solver.particles
    names = collect(particles.id[: particles.owned])
    order = np.argsort(names)
    liquid = carried_liquid(collect(particles.liquid[: particles.owned])[order], *_joined(solver))
    bodies = bridges.bodies.reshape(-1, 2)
    at_wall = bodies[:, 1] < 0
    places = np.searchsorted(names[order], collect(bodies[at_wall, 0]))
    np.add.at(liquid, places, collect(bridges.volume[at_wall]))
    return liquid


def _fill_snapshot_fields(solver: ParticleSolver) -> None:
    """Find the `SNAPSHOT_FIELDS` of the particles of this rank."""
    particles, all_ids = solver.particles, _ids(solver)
    first, second, _ = _joined(solver, bonds=True)
    belongs = agglomerates(first, second, len(all_ids))
    lowest = np.full(len(all_ids), np.iinfo(np.int64).max)
    np.minimum.at(lowest, belongs, all_ids)
    places = np.searchsorted(all_ids, particles.id[: particles.owned])
    particles.liquid_carried[: particles.owned] = _carried(solver)[places]
    particles.agglomerate[: particles.owned] = lowest[belongs][places]
    particles.agglomerate_size[: particles.owned] = np.bincount(belongs)[belongs][places]


# ---------------------------------------------------------------- measures


def _wet_share(_: Any, simulation: Any) -> float:
    return SERIAL.count(_carried(simulation.particle_solver) > 0.0) / max(len(simulation.whole("id")), 1)


def _variation(_: Any, simulation: Any) -> float:
    carried = _carried(simulation.particle_solver)
    mean = carried.mean()  # local: of all ranks
    return float(carried.std() / mean) if mean > 0.0 else math.nan  # local: of all ranks


def _coating(share: float) -> Callable[[Any, Any], float]:
    """Measure of the liquid on a particle over the mean, below which a share of the particles lies."""

    def quantile(_: Any, simulation: Any) -> float:
        carried = _carried(simulation.particle_solver)
        mean = carried.mean()  # local: of all ranks
        return float(np.quantile(carried, share) / mean) if mean > 0.0 else math.nan  # local: of all ranks

    return quantile


def _bridges_per_particle(_: Any, simulation: Any) -> float:
    first, _, _ = _joined(simulation.particle_solver)
    return 2.0 * len(first) / max(len(simulation.whole("id")), 1)


def _sizes(simulation: Any) -> AgglomerateSizes:
    first, second, _ = _joined(simulation.particle_solver, bonds=True)
    return agglomerate_sizes(first, second, len(_ids(simulation.particle_solver)))


def _has_bonds(case: Case) -> bool:
    return bool(case.liquid and case.liquid.bond)


LiquidOnParticles.measures = (
    Measured("bridge_liquid_share", "1", "measure", "share of the liquid that is in bridges",
             lambda liquid, _: liquid.in_bridges / liquid.total if liquid.total > 0.0 else math.nan),
    Measured("wet_share", "1", "measure", "share of the particles that carry liquid, on themselves or in a bridge",
             _wet_share),
    Measured("coating_variation", "1", "measure",
             "standard deviation of the liquid on a particle over its mean, with its part of the liquid of its bridges",
             _variation),
    Measured("coating_at_10_percent", "1", "measure",
             "liquid on a particle over the mean, below which 10 % of the particles lie", _coating(0.1)),
    Measured("coating_at_50_percent", "1", "measure", "median of the liquid on a particle over the mean",
             _coating(0.5)),
    Measured("coating_at_90_percent", "1", "measure",
             "liquid on a particle over the mean, below which 90 % of the particles lie", _coating(0.9)),
    Measured("bridge_count", "1", "measure", "number of liquid bridges", lambda liquid, _: liquid.bridges.count),
    Measured("bridges_per_particle", "1", "measure", "mean number of bridges of a particle to other particles",
             _bridges_per_particle),
    Measured("agglomerate_size", "1", "measure", "mean number of particles in the agglomerate of a particle",
             lambda _, simulation: _sizes(simulation).mean_by_particle),
    Measured("largest_agglomerate", "1", "measure", "number of particles in the largest agglomerate",
             lambda _, simulation: _sizes(simulation).largest),
    Measured("agglomerated_share", "1", "measure", "share of the particles that a bridge or a bond joins to another",
             lambda _, simulation: _sizes(simulation).joined),
    Measured("liquid_on_particles", "m3", "recorded", "volume of liquid in the films of the particles",
             lambda liquid, _: liquid.on_particles),
    Measured("liquid_in_bridges", "m3", "recorded", "volume of liquid in bridges", lambda liquid, _: liquid.in_bridges),
    Measured("liquid_gained_by_walls", "m3", "recorded", "volume of liquid on the walls less that at the start",
             lambda liquid, _: liquid.gained_by_walls),
    Measured("liquid_imbalance", "1", "imbalance",
             "change of all liquid that the spray did not bring, over all liquid", lambda liquid, _: liquid.imbalance),
    Measured("bond_count", "1", "measure", "number of solid bonds",
             lambda liquid, simulation: simulation.communicator.sum([len(liquid.bridges.bonds)]), _has_bonds),
    Measured("bonds_formed", "1", "recorded",
             "number of solid bonds that have formed between the particles that are there",
             lambda liquid, _: liquid.bridges.bonds_formed, _has_bonds),
)  # fmt: skip
