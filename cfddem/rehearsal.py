"""The loops of the fluid, compiled in another process while a new machine compiles those of the particles.

Compiled loops are kept, so that this helps the first run of all. It is a rehearsal: two steps of the case's fluid
around two of its spheres, whose outcome nobody looks at. What does not get ready here is compiled where it is needed.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np

from cfddem.case import Case
from closures.compiled import cache_folder


def is_new() -> bool:
    """Has no fluid been run yet by these sources on this machine? One of its loops stands for all."""
    return not any(cache_folder().rglob("momentum.transport*.nbi"))


def _cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def rehearsal(case: Case) -> Iterator[None]:
    """Rehearse beside the preparation of a run in a fluid, where there is a core to spare."""
    if case.fluid is None or _cores() == 1 or not is_new():
        yield
        return
    beside = subprocess.Popen(
        [sys.executable, "-m", "cfddem.rehearsal"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        assert beside.stdin is not None
        with suppress(OSError):  # it may have ended at once
            beside.stdin.write(case.to_toml().encode())
            beside.stdin.close()
        yield
    finally:
        beside.terminate()
        beside.wait()


def rehearse(case: Case) -> None:
    """Two steps of a case's fluid around two spheres in the middle of the column; the first knows of none before it."""
    from cfddem.assembly import flow_of
    from cfddem.particles.state import bodies

    width, depth, height = case.column.size
    radius = 0.5 * case.bed.largest
    places = np.array([[0.5 * width + side * radius, 0.5 * depth, 0.5 * height] for side in (-1.2, 1.2)])
    spheres = bodies(places, radius, case.solid_density)
    fluid, exchange = flow_of(case, spheres)
    for _ in range(2):
        step = min(fluid.largest_step().step, 1e-6)  # at rest nothing limits it
        offer = exchange.offer(spheres, step)
        fluid.step(step, *offer.fields)
        exchange.answer(spheres, offer, np.array(case.laws.gravity))


if __name__ == "__main__":
    rehearse(Case.from_text(sys.stdin.read()))
