"""Memory speed of this machine, and how much of it a loop reaches."""

from __future__ import annotations

import time

import numpy as np

from cfddem.backend.compile import prange, threaded, use_threads
from cfddem.backend.gpu import BLOCK, cuda, name_of_gpu
from cfddem.particles.solver import ParticleSolver

GRAPH_BYTES = 4 + 4 + 1
"""First and second particle and image of a pair [bytes]."""

PARTICLE_BYTES = 8 * (2 * (3 + 3 + 3 + 3 + 3) + 3 + 4)
"""Of a particle: position, velocity, spin, force and torque read and written, the origin of the list read, and radius,
inverse mass, inverse inertia and viscosity [bytes]."""

INCIDENT_BYTES = 2 * 4
"""A pair in the list of edges of each of its two particles [bytes]."""


def triad(threads: int = 1, count: int = 10_000_000, repeats: int = 5) -> float:
    """Speed of a = b + s c on arrays that fit no cache, best of a few [bytes/s]; three streams count.

    threads  that share the loop
    count    numbers in each array
    """
    use_threads(threads)
    a, b, c = np.zeros(count), np.ones(count), np.ones(count)
    _triad(a, b, c, 3.0)  # compiles
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        _triad(a, b, c, 3.0)
        best = min(best, time.perf_counter() - begin)
    return 3 * a.nbytes / best


@threaded
def _triad(a, b, c, s):
    """One pass over the arrays."""
    for n in prange(len(a)):
        a[n] = b[n] + s * c[n]


def triad_of_gpu(count: int = 50_000_000, repeats: int = 5) -> float:
    """The same of the graphics processor [bytes/s]."""
    name_of_gpu()  # refuses where there is none

    @cuda.jit
    def loop(a, b, c, s):  # type: ignore[no-untyped-def]
        n = cuda.grid(1)
        if n < len(a):
            a[n] = b[n] + s * c[n]

    arrays = [cuda.to_device(np.ones(count)) for _ in range(3)]
    best = np.inf
    for _ in range(repeats + 1):  # the first compiles
        cuda.synchronize()
        begin = time.perf_counter()
        loop[-(-count // BLOCK), BLOCK](*arrays, 3.0)
        cuda.synchronize()
        best = min(best, time.perf_counter() - begin)
    return 24 * count / best


def bytes_of_step(run: ParticleSolver) -> float:
    """Bytes that a particle step must move if nothing were found in a cache between its passes [bytes].

    What a pair remembers is read and written once, what it hands to its particles is written and read once; a film
    or a bridge needs one further pass over the graph, and a film over its memory. New lists do not count.
    """
    return len(run.edges.first) * bytes_of_pair(run) + len(run.particles.radius) * PARTICLE_BYTES


def bytes_of_pair(run: ParticleSolver) -> float:
    """Part of a pair in these bytes."""
    passes = 1 + run.laws.film + (run.bridges is not None)
    memory = sum(2 * array.nbytes for array in run.edges.arrays.values()) / max(len(run.edges.first), 1)
    return memory + passes * GRAPH_BYTES + INCIDENT_BYTES
