"""The liquid of each particle and its agglomerate, over all ranks: for measures and snapshots."""

from __future__ import annotations

import numpy as np

from cfddem.analysis.agglomerates import carried_liquid, sizes
from cfddem.data.fields import Field
from cfddem.particles.agglomerates import agglomerates
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


def ids(solver: ParticleSolver) -> np.ndarray:
    """Ids of the particles of all ranks, in ascending order (N,)."""
    particles = solver.particles
    return np.sort(solver.communicator.joined(particles.id[: particles.owned]))


def joined(solver: ParticleSolver) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places among `ids` of the particles that each bridge between particles joins (n,), (n,), and its liquid [m3]."""
    bridges, all_ids = solver.feature(Bridges), ids(solver)
    bodies, volume = bridges.bodies.reshape(-1, 2), bridges.volume
    pairs = bodies[:, 1] >= 0
    bodies, volume = solver.communicator.joined(bodies[pairs]), solver.communicator.joined(volume[pairs])
    return np.searchsorted(all_ids, bodies[:, 0]), np.searchsorted(all_ids, bodies[:, 1]), volume


def carried(solver: ParticleSolver) -> np.ndarray:
    """Liquid of every particle by id, with half of its bridges to others and all at walls (N,) [m3]."""
    bridges, collect, particles = solver.feature(Bridges), solver.communicator.joined, solver.particles
    names = collect(particles.id[: particles.owned])
    order = np.argsort(names)
    liquid = carried_liquid(collect(particles.liquid[: particles.owned])[order], *joined(solver))
    bodies = bridges.bodies.reshape(-1, 2)
    at_wall = bodies[:, 1] < 0
    places = np.searchsorted(names[order], collect(bodies[at_wall, 0]))
    np.add.at(liquid, places, collect(bridges.volume[at_wall]))
    return liquid


def fill_snapshot_fields(solver: ParticleSolver) -> None:
    """Find the `SNAPSHOT_FIELDS` of the particles of this rank."""
    particles, all_ids = solver.particles, ids(solver)
    first, second, _ = joined(solver)
    belongs = agglomerates(first, second, len(all_ids))
    lowest = np.full(len(all_ids), np.iinfo(np.int64).max)
    np.minimum.at(lowest, belongs, all_ids)
    places = np.searchsorted(all_ids, particles.id[: particles.owned])
    particles.liquid_carried[: particles.owned] = carried(solver)[places]
    particles.agglomerate[: particles.owned] = lowest[belongs][places]
    particles.agglomerate_size[: particles.owned] = sizes(belongs)[belongs][places]
