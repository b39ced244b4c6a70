"""Liquid on the particles of a case: its budget, bridges, agglomerates, and how evenly the particles are coated."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL
from cfddem.case.schema import Case
from cfddem.data.fields import Field
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.particles.agglomerates import AgglomerateSizes, agglomerates, carried_liquid, sizes, summary
from cfddem.particles.interactions.bridge_view import Bridges
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

    name, table = "liquid", "liquid"
    fields = SNAPSHOT_FIELDS

    def __init__(self, case: Case, simulation: Any) -> None:
        self.particle_solver, self.brought, self.evaporated = simulation.particle_solver, 0.0, 0.0
        self.bridges: Bridges = self.particle_solver.feature(Bridges)
        self.start = self.total

    @classmethod
    def measures(cls, case: Case) -> tuple[Measured, ...]:
        """Where the liquid is, and what it joins."""
        bonds = (Measured("1", "measure", bond_count), Measured("1", "recorded", bonds_formed))
        return (*MEASURES, *(bonds if case.liquid and case.liquid.bond else ()))

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

    def checkpoint(self) -> dict[str, Any]:
        """The liquid at the start, and what has come and gone since."""
        return {"start": self.start, "brought": self.brought, "evaporated": self.evaporated}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.start, self.brought = float(state["start"]), float(state["brought"])
        self.evaporated = float(state.get("evaporated", 0.0))


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
    particles.agglomerate_size[: particles.owned] = sizes(belongs)[belongs][places]


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
    return SERIAL.count(_carried(simulation.particle_solver) > 0.0) / max(len(simulation.whole("id")), 1)


def coating_variation(simulation: Any) -> float:
    """Standard deviation of the liquid on a particle over its mean, with its part of the liquid of its bridges."""
    carried = _carried(simulation.particle_solver)
    mean = carried.mean()  # local: of all ranks
    return float(carried.std() / mean) if mean > 0.0 else math.nan  # local: of all ranks


def coating_at_10_percent(simulation: Any) -> float:
    """Liquid on a particle over the mean, below which 10 % of the particles lie."""
    return _coating_quantile(simulation, 0.1)


def coating_at_50_percent(simulation: Any) -> float:
    """Median of the liquid on a particle over the mean."""
    return _coating_quantile(simulation, 0.5)


def coating_at_90_percent(simulation: Any) -> float:
    """Liquid on a particle over the mean, below which 90 % of the particles lie."""
    return _coating_quantile(simulation, 0.9)


def _coating_quantile(simulation: Any, share: float) -> float:
    carried = _carried(simulation.particle_solver)
    mean = carried.mean()  # local: of all ranks
    return float(np.quantile(carried, share) / mean) if mean > 0.0 else math.nan  # local: of all ranks


def bridge_count(simulation: Any) -> float:
    """Number of liquid bridges."""
    return float(_budget(simulation).bridges.count)


def bond_count(simulation: Any) -> float:
    """Number of solid bonds."""
    bridges = _budget(simulation).bridges
    return float(simulation.communicator.sum([len(bridges.bonds)]))


def bonds_formed(simulation: Any) -> float:
    """Number of solid bonds that have formed between the particles that are there."""
    return float(_budget(simulation).bridges.bonds_formed)


def bridges_per_particle(simulation: Any) -> float:
    """Mean number of bridges of a particle to other particles."""
    first, _, _ = _joined(simulation.particle_solver)
    return 2.0 * len(first) / max(len(simulation.whole("id")), 1)


def agglomerate_size(simulation: Any) -> float:
    """Mean number of particles in the agglomerate of a particle."""
    return _sizes(simulation).mean_by_particle


def largest_agglomerate(simulation: Any) -> float:
    """Number of particles in the largest agglomerate."""
    return float(_sizes(simulation).largest)


def agglomerated_share(simulation: Any) -> float:
    """Share of the particles that a bridge or a bond joins to another."""
    return _sizes(simulation).joined


def _budget(simulation: Any) -> LiquidOnParticles:
    budget: LiquidOnParticles = simulation.feature(LiquidOnParticles)
    return budget


def _sizes(simulation: Any) -> AgglomerateSizes:
    first, second, _ = _joined(simulation.particle_solver, bonds=True)
    return summary(first, second, len(_ids(simulation.particle_solver)))


MEASURES = tuple(
    Measured(*each)
    for each in (
        ("1", "measure", bridge_liquid_share),
        ("1", "measure", wet_share),
        ("1", "measure", coating_variation),
        ("1", "measure", coating_at_10_percent),
        ("1", "measure", coating_at_50_percent),
        ("1", "measure", coating_at_90_percent),
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
