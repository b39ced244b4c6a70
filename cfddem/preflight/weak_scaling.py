"""A model of the time of a step on many ranks, from measured numbers of one machine."""

from __future__ import annotations

import math
from dataclasses import dataclass

RANDOM_PACKING = 0.6
"""Solid fraction of a bed, for its length in diameters."""

BYTES_PER_PARTICLE = 3000.0
"""Memory for a particle with its pairs [byte]."""


@dataclass(frozen=True)
class Machine:
    """Numbers of a machine. The defaults are rounded values of ordinary cores and of a network with 2 GB/s a rank.

    particle_step    time of a particle step, with its pairs, on one rank [s]
    latency          of a message [s]
    bandwidth        of a rank [byte/s]
    reduction        time of a sum over all ranks, for each doubling of their number [s]
    message          what a ghost receives in a step: 72 byte dry, 104 byte with films [byte]
    messages         exchanges in a step: 1 dry, 2 with films
    """

    particle_step: float = 1.5e-7
    latency: float = 5e-6
    bandwidth: float = 2e9
    reduction: float = 5e-6
    message: float = 72.0
    messages: int = 1


@dataclass(frozen=True)
class Scaling:
    """A step on many ranks, by the model.

    step        time of a step [s]
    exchange    part of it for halo and reductions [-]
    efficiency  speed-up over the number of ranks; without imbalance [-]
    owned       particles of a rank
    ghosts      of a rank
    memory      of a rank, without cells [byte]
    """

    step: float
    exchange: float
    efficiency: float
    owned: float
    ghosts: float
    memory: float


def weak_scaling(
    particles: float, ranks: int, machine: Machine | None = None, *, aspect: float = 1.0, reach: float = 1.1
) -> Scaling:
    """Time of a particle step on many ranks that divide a bed into slabs.

    A rank has two neighbours. Its ghosts lie within the reach of a pair of its two borders. A pair across a border is
    computed on both sides:

    .. math:: t = c (n + g / 2) + m (2 l + g b / w) + r \\log_2 p

    particles  number of particles of the bed
    ranks      number of ranks p
    machine    c, l, w, r, b and m; see `Machine`
    aspect     length of the bed across the slabs, over the side of a square section
    reach      of the list of pairs, in diameters: 1 and the skin, and the reach of films
    returns    see `Scaling`

    >>> one, many = weak_scaling(1e6, 1), weak_scaling(64e6, 64)
    >>> one.efficiency, round(many.efficiency, 2), round(many.ghosts / many.owned, 2)
    (1.0, 0.79, 0.37)
    >>> round(weak_scaling(64e6, 64, aspect=8.0).efficiency, 2)
    0.94
    """
    given, owned = machine or Machine(), particles / ranks
    volume = particles * math.pi / (6.0 * RANDOM_PACKING)  # in cubes of the diameter
    length = (volume * aspect**2) ** (1.0 / 3.0)
    ghosts = min(2.0 * reach * particles / length, particles - owned) if ranks > 1 else 0.0
    work = given.particle_step * (owned + 0.5 * ghosts)
    exchange = 0.0
    if ranks > 1:
        halo = given.messages * 2.0 * given.latency + ghosts * given.message / given.bandwidth
        exchange = halo + given.reduction * math.log2(ranks)
    step = work + exchange
    memory = BYTES_PER_PARTICLE * (owned + ghosts)
    return Scaling(step, exchange / step, given.particle_step * owned / step, owned, ghosts, memory)
