"""A model of the time of a step on many ranks, from measured numbers of one machine."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cfddem.backend.brick_shapes import Shape, shapes

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
    shape       ranks along x, y, z
    """

    step: float
    exchange: float
    efficiency: float
    owned: float
    ghosts: float
    memory: float
    shape: Shape


def weak_scaling(
    particles: float, ranks: int, machine: Machine | None = None, *, aspect: float = 1.0, reach: float = 1.1,
    shape: Shape | None = None,
) -> Scaling:  # fmt: skip
    """Time of a particle step on many ranks that divide a bed into bricks.

    A rank has ghosts within the reach of a pair around its brick, and up to 26 neighbours k. A pair across a border is
    computed on both sides:

    .. math:: t = c (n + g / 2) + m (k l + g b / w) + r \\log_2 p

    particles  number of particles of the bed
    ranks      number of ranks p
    machine    c, l, w, r, b and m; see `Machine`
    aspect     length of the bed along x over the side of a square section
    reach      of the list of pairs, in diameters: 1 and the skin, and the reach of films
    shape      ranks along x, y, z; that with the fewest ghosts if None
    returns    see `Scaling`

    >>> one, many = weak_scaling(1e6, 1), weak_scaling(64e6, 64)
    >>> one.efficiency, round(many.efficiency, 2), round(many.ghosts / many.owned, 2), many.shape
    (1.0, 0.95, 0.07, (4, 4, 4))
    >>> round(weak_scaling(64e6, 64, shape=(64, 1, 1)).efficiency, 2)
    0.79
    """
    given, owned = machine or Machine(), particles / ranks
    volume = particles * math.pi / (6.0 * RANDOM_PACKING)  # in cubes of the diameter
    side = (volume / aspect) ** (1.0 / 3.0)
    edges = np.array([aspect * side, side, side])

    def ghosts_of(each: Shape) -> float:
        """Ghosts of the rank that has most."""
        sides = np.minimum(np.array(each) - 1, 2)
        around = float(np.prod(1.0 + sides * reach * np.array(each) / edges))
        return min((around - 1.0) * owned, particles - owned)

    best = shape or min(shapes(ranks, (ranks, ranks, ranks)), key=ghosts_of)
    ghosts = ghosts_of(best)
    work = given.particle_step * (owned + 0.5 * ghosts)
    exchange = 0.0
    if ranks > 1:
        beside = math.prod(min(n, 3) for n in best) - 1
        halo = given.messages * beside * given.latency + ghosts * given.message / given.bandwidth
        exchange = halo + given.reduction * math.log2(ranks)
    step = work + exchange
    memory = BYTES_PER_PARTICLE * (owned + ghosts)
    return Scaling(step, exchange / step, given.particle_step * owned / step, owned, ghosts, memory, best)


CALL = 25e-6
"""Processor time of a rank for each exchange and each sum, beside the network [s]."""

WITH_FILMS, DRY = (4.0, 25.0), (1.0, 1.0)
"""Exchanges and sums over all ranks in a particle step; films are solved together by iteration."""

HALOS, SUMS = 100.0, 80.0
"""Exchanges of cells for each divided axis, and sums over all ranks, in a fluid step with its solution of the pressure.

Counted and measured by `tests/benchmarks/bench_scaling_model.py`; `HALOS` grow from 33 for few cells to 150 for 64^3.
"""


@dataclass(frozen=True)
class RunCost:
    """What a run costs one process, and how often its ranks would exchange.

    seconds         of one process [s]
    particle_steps  in the run
    fluid_steps     in the run; 0 without a fluid
    particles       in the run
    films           or bridges between particles, in the run
    """

    seconds: float
    particle_steps: float
    fluid_steps: float
    particles: float
    films: bool = False


def efficiency(cost: RunCost, shape: Shape, busiest: float, machine: Machine | None = None) -> float:
    """Speed-up of a run over the number of its ranks.

    .. math:: t_p = \\frac{w}{p} t_1 + N_s (m (k l + c) + g b / B + s (r \\log_2 p + c))
              + N_f (h a (2 l + c) + s_f (r \\log_2 p + c))

    with N_s particle steps of m exchanges with k neighbours and s sums, N_f fluid steps of h exchanges along each of a
    divided axes and s_f sums, and the time c of a rank for each of these.

    cost     of one process
    shape    ranks along x, y, z
    busiest  work of the busiest rank over the mean w, ghosts included
    machine  l, B, r and b; see `Machine`

    >>> dry = RunCost(seconds=1000.0, particle_steps=1e5, fluid_steps=0, particles=1e5)
    >>> round(efficiency(dry, (1, 2, 1), 1.05), 2), round(efficiency(dry, (4, 4, 4), 1.3), 2)
    (0.93, 0.36)
    """
    given, ranks = machine or Machine(), math.prod(shape)
    if ranks == 1:
        return 1.0
    beside, reduction = math.prod(min(n, 3) for n in shape) - 1, given.reduction * math.log2(ranks) + CALL
    exchanges, sums = WITH_FILMS if cost.films else DRY
    ghosts = (busiest - 1.0) * cost.particles / ranks
    step = exchanges * (beside * given.latency + CALL) + ghosts * given.message / given.bandwidth + sums * reduction
    divided = sum(n > 1 for n in shape)
    flow = HALOS * divided * (2.0 * given.latency + CALL) + SUMS * reduction
    total = busiest * cost.seconds / ranks + cost.particle_steps * step + cost.fluid_steps * flow
    return cost.seconds / (ranks * total)
