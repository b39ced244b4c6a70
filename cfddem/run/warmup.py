"""Kernel warm-up: another process compiles the loops of the fluid while this one compiles those of the particles.

Compiled loops are cached, so this shortens the first run on a machine. The other process makes two steps of the case's
fluid around two of its spheres and discards the result. Loops that it does not finish are compiled when needed.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.backend.launch import python_command
from cfddem.case.column_grid import grid_of
from cfddem.case.feeds import fed_count
from cfddem.case.schema import Case
from cfddem.fluid.momentum import transport
from closures.compiled import cache_folder


def is_new() -> bool:
    """Whether the loops of the fluid are missing in the cache for the threads in use; one of them is checked."""
    loop = transport.in_use
    name = f"{loop.__module__.rpartition('.')[2]}.{loop.__qualname__}"
    return not any(cache_folder().rglob(f"{name}-*.nbi"))


def _cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def warmup(case: Case) -> Iterator[None]:
    """Warm up while the block runs, for a case with a fluid, an empty cache and more than one core."""
    if not case.has_fluid or _cores() == 1 or not is_new():
        yield
        return
    process = subprocess.Popen(
        python_command("-m", "cfddem.run.warmup"), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, env={**os.environ, "NUMBA_NUM_THREADS": str(use_threads(None))},
    )  # fmt: skip
    try:
        assert process.stdin is not None
        with suppress(OSError):  # the process may have ended already
            process.stdin.write(case.to_toml().encode())
            process.stdin.close()
        yield
    finally:
        process.terminate()
        process.wait()


def warm_up(case: Case) -> None:
    """Make two steps of a case's fluid around two spheres; the second uses what the first has stored."""
    from cfddem.particles.state import make_particles
    from cfddem.run.build import flow_of

    width, depth, height = case.column.size
    radius = 0.5 * case.bed.largest_diameter
    places = np.array([[0.5 * width + side * radius, 0.5 * depth, 0.5 * height] for side in (-1.2, 1.2)])
    spheres = make_particles(places, radius, case.solid_density)
    fluid, coupling = flow_of(case, spheres)
    for _ in range(2):
        step = min(fluid.largest_step().step, 1e-6)  # nothing limits the step of a fluid at rest
        terms = coupling.prepare(spheres, step)
        fluid.step(step, *terms.fields)
        coupling.apply(spheres, terms)


if __name__ == "__main__":
    warm_up(Case.from_text(sys.stdin.read()))


# ---------------------------------------------------------------- the number of threads


FEW_PARTICLES, FEW_CELLS = 5_000, 20_000
"""Up to so many particles and cells, a second thread gains nothing; 1 600 beads take 1.3 times as long on two."""


def threads_for(case: Case, number: int | None) -> int | None:
    """The number that the user has given; without it 1 for a small case, else None, which stands for all processors.

    The loops of a small case also compile faster for one thread.
    """
    if number is not None:
        return number
    cells = math.prod(grid_of(case).cells) if case.has_fluid else 0
    is_small = case.particle_count + fed_count(case) <= FEW_PARTICLES and cells <= FEW_CELLS
    return 1 if is_small else None
