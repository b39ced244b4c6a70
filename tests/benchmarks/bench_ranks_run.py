"""A run of many beads on ranks: memory of a rank, time of a step, and the files in the reader of ParaView.

    mpiexec -n 4 python tests/benchmarks/bench_ranks_run.py [beads] [steps]

Beads are suspended in a dry box and fall. Time is the processor time of the slowest rank in the steps, messages
included; a rank that waits for a message spins, so that more ranks than cores take longer. Set NUMBA_NUM_THREADS=1.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from cfddem import Case, Run, open_run
from cfddem.backend.launch import communicator

CASE = """
material.glass = {{density = 2500.0, youngs_modulus = 6e10, contact_modulus = 2e6, poisson = 0.25}}
column = {{width = {width}, depth = {depth}, height = {height}, cell = 0.01}}
bed = {{diameter = 1e-3, count = {count}, start = "suspended"}}
run = {{until = {until}, every = {until}, particle_step = {step}}}
"""
STEP, FRACTION = 1e-5, 0.3


def main(beads: int, steps: int) -> None:
    """Run, and print on rank 0."""
    ranks = communicator()
    volume = beads * np.pi / 6.0 * 1e-9 / FRACTION
    width = 0.02 * np.ceil(np.cbrt(volume * 4.0) / 0.02)
    sides = {"width": width, "depth": 0.5 * width, "height": 0.5 * width}
    case = Case.from_text(CASE.format(count=beads, until=steps * STEP, step=STEP, **sides))
    with tempfile.TemporaryDirectory() as folder:
        run = Run.begin(case, Path(ranks.broadcast(folder)) / "run", communicator=ranks)
        run.simulation.step(2 * STEP)  # loads or compiles all loops
        seconds = time.process_time()
        run.go()
        seconds = ranks.largest([time.process_time() - seconds])
        parts = run.simulation.particle_solver.timers.seconds
        loops = ranks.largest([sum(parts.get(name, 0.0) for name in ("pairs and motion", "neighbour lists"))])
        memory = 1e-6 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        memories = ranks.joined(np.array([memory]))
        owned = ranks.joined(np.array([run.simulation.owned.rows]))
        if ranks.rank == 0:
            print(f"{ranks.size} ranks, {beads} beads, {owned.min()} to {owned.max()} on a rank")
            print(f"  memory of rank 0 {memories[0]:.2f} GB, of others at most {memories[1:].max(initial=0.0):.2f} GB")
            print(f"  {1e3 * loops / steps:.0f} ms a step in the particle solver, wall time; run {seconds:.1f} s")
            print(f"  {seen(run.folder.folder)}")
        ranks.any([False])  # the folder stays until rank 0 has read it


def seen(folder: Path) -> str:
    """What the reader of ParaView finds, against the snapshots."""
    sys.path.insert(0, str(Path(__file__).parents[1]))

    import rooms  # noqa: F401
    from toy_run import series

    written = open_run(folder)
    found = list(series(folder / "run.vtkhdf"))
    for number, (_, blocks) in enumerate(found):
        assert np.array_equal(blocks["particles"].points, written.particles(number)["position"])
    points = len(found[-1][1]["particles"].points)
    return f"ParaView's reader: {len(found)} times, {points} points, those of the snapshots"


if __name__ == "__main__":
    numbers = [int(float(word)) for word in sys.argv[1:]]
    main(*(numbers + [1_000_000, 20][len(numbers) :]))
