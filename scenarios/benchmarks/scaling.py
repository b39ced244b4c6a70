"""How the cost of a step grows: with particles, threads, the ratio of sizes, the reach of films, and cells.

Each row is measured once after a start, and compared with the bytes that its loops must move. The time that these
bytes take at the memory speed of the machine is the least that the method can need; the same at another memory speed
says what another machine could reach at best.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from scenarios.benchmarks import fluid_box
from scenarios.benchmarks.dense_bed import DIAMETER, GRAIN, STEP, bed
from scenarios.benchmarks.memory import PARTICLE_BYTES, bytes_of_pair, bytes_of_step, triad

SIZES = (1_000, 10_000, 100_000, 1_000_000)
RATIOS = (1, 2, 4, 8)
"""Large diameter over small diameter; half of the volume each."""
REACHES = (0.05, 0.2, 1.0)
"""Reach of the film over the reduced radius."""
EDGES = (32, 48, 64, 96)
"""Cells along the edge of a cube of fluid."""

SOLID_FRACTION, SPHERES, SPEED = 0.58, 8_000, 0.02
"""Of a packing of two sizes; small spheres have `DIAMETER`, all have random velocities [m/s]."""

GPU = 3e12
"""Memory speed of a graphics processor [bytes/s]."""


def bench(threads: int = 2) -> dict[str, Any]:
    """Nanoseconds of a particle-step or of a step of a cell, row by row.

    threads  of the rows that compare threads; all others have one
    returns  memory speed, bytes that the method moves, and rows: group, name, ns, bytes, share of the memory speed
    """
    speed = triad(1)
    use_threads(1)
    rows = [_particles("particles", f"{size}{', films' * film}", bed(size, film=film), speed)
            for film in (False, True) for size in SIZES]  # fmt: skip
    rows += [
        _particles("reach of films", f"{reach:g} R*", bed(10_000, film=True, reach=reach), speed) for reach in REACHES
    ]
    rows += [_particles("ratio of sizes", f"{ratio}", _two_sizes(ratio), speed) for ratio in RATIOS]
    rows += [_fluid(edge, speed) for edge in EDGES]
    if threads > 1:
        together = triad(threads)
        use_threads(threads)
        rows += [_particles("threads", f"{size}, {threads} threads", bed(size), together) for size in SIZES[1:3]]
    return {"triad [GB/s]": speed / 1e9, "bytes": moved(), "rows": rows}


def moved() -> dict[str, float]:
    """Bytes that the method moves for a particle, a pair and a cell in a step if nothing stays in a cache."""
    pairs = {"pair, dry": bed(1_000), "pair, films": bed(1_000, film=True), "pair, bridges": bed(1_000, bridges=True)}
    return {
        "particle": float(PARTICLE_BYTES),
        **{name: bytes_of_pair(run) for name, run in pairs.items()},
        "cell, stage": float(fluid_box.STAGE_BYTES),
        "cell, pressure iteration": float(fluid_box.ITERATION_BYTES),
    }


def _two_sizes(ratio: int) -> ParticleSolver:
    """A periodic box of spheres of two sizes that move at random."""
    large = round(SPHERES / (1 + ratio**3))
    diameters = np.repeat([DIAMETER * ratio, DIAMETER], [large, SPHERES - large])
    centres, box = random_packing(diameters, SOLID_FRACTION, seed=1)
    velocity = np.random.default_rng(1).normal(0.0, SPEED, centres.shape)
    spheres = make_particles(centres, 0.5 * diameters, GRAIN.density, velocity=velocity)
    return ParticleSolver(spheres, pair_table([GRAIN]), laws=Laws(), box=tuple(box))


def _particles(group: str, name: str, run: ParticleSolver, speed: float) -> dict[str, Any]:
    """One row: a run of particles, after some steps to warm up."""
    count = run.particles.count
    steps = max(20, 4_000_000 // count)
    run.advance(STEP, max(5, steps // 4))
    begin = time.perf_counter()
    run.advance(STEP, steps)
    seconds = (time.perf_counter() - begin) / steps / count
    return _row(group, name, seconds, bytes_of_step(run) / count, speed)


def _fluid(edge: int, speed: float) -> dict[str, Any]:
    """One row: a cube of fluid."""
    measured = fluid_box.measure((edge, edge, edge), speed)
    cells = edge**3
    return _row("cells", f"{edge}^3", measured["step [s]"] / cells, measured["bytes"] / cells, speed)


def _row(group: str, name: str, seconds: float, moved: float, speed: float) -> dict[str, Any]:
    """A row of plain values."""
    return {"group": group, "name": name, "ns": 1e9 * seconds, "bytes": moved, "share": moved / speed / seconds}


def rows(result: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """A result as lines of a table."""
    yield "memory", f"triad {result['triad [GB/s]']:.1f} GB/s on one thread"
    for name, count in result["bytes"].items():
        yield name, f"{count:.0f} bytes a step"
    for row in result["rows"]:
        best = 1e9 * row["bytes"] / GPU
        yield (
            row["group"],
            f"{row['name']:<20} {row['ns']:8.1f} ns, {row['bytes']:6.0f} bytes, {row['share']:.2f} of the triad; "
            f"at {GPU / 1e12:g} TB/s not below {best:.2f} ns",
        )
