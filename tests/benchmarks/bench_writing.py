"""What snapshots and checkpoints cost a run of 100 000 particles, as a share of its time at the default interval.

    python tests/benchmarks/bench_writing.py [--count N] [--until T]

Beads of 1 mm in water, spread evenly, with their films. A few fluid steps and two snapshots are made and timed in one
run folder; a run to T writes 50 times, the steps between two of its snapshots take what those here took.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path

from cfddem.case.schema import Case
from cfddem.run.runner import Run

WRITINGS = ("snapshots", "checkpoints")


def case(count: int, until: float) -> Case:
    """A column as wide as the beads need, two snapshots after the first."""
    width = 0.004 * max(2, round(math.sqrt(count / 1e6 * 0.04) / 0.004))
    return Case.model_validate(
        {
            "fluid": {"density": 998.0, "viscosity": 1e-3},
            "material": {
                "glass": {
                    "density": 2500.0, "youngs_modulus": 1e7, "poisson": 0.25, "restitution": 0.9, "friction": 0.3,
                    "roughness": 1e-6,
                }
            },
            "column": {"width": width, "height": 0.052, "cell": 0.004, "sides": "free_slip"},
            "bed": {"diameter": 1e-3, "count": count, "start": "suspended", "inlet_velocity": 0.05},
            "run": {"until": until, "every": 0.5 * until, "reference_speed": 0.1},
        }
    )  # fmt: skip


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--until", type=float, default=2.0, help="length of the run that is judged [s]")
    arguments = parser.parse_args()
    short = 3.3e-3
    with tempfile.TemporaryDirectory() as folder:
        run = Run.begin(case(arguments.count, short), Path(folder, "run"))
        run.go()
        seconds = dict(run.simulation.timers.seconds)
    writing = sum(seconds.get(name, 0.0) for name in WRITINGS)
    stepping = sum(each for name, each in seconds.items() if name not in (*WRITINGS, "first calls"))
    between = stepping / short * arguments.until / 50.0
    once = writing / 3.0  # the first snapshot is that of the start
    print(f"{arguments.count} particles: a snapshot and its checkpoint {once:.2f} s, the steps between {between:.0f} s")
    print(f"writing takes {once / between:.2%} of a run to {arguments.until:g} s (limit 5 %)")


if __name__ == "__main__":
    main()
