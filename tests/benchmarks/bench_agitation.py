"""Cost of agitation in a liquid bed: time of a step with it over the time without it.

    python tests/benchmarks/bench_agitation.py [--count N] [--rounds N] [--law NAME]

Alumina beads in water at a voidage of 0.64, with films. Rounds alternate; the ratio is that of the medians.
Most of it is the faster motion of the agitated beads; the last line shows the part of the closure itself.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time

from cfddem.backend.compile import use_threads
from cfddem.case.schema import Case
from cfddem.run.simulation import Simulation

DIAMETER, VOIDAGE = 3.087e-3, 0.64


def bed(count: int, law: str) -> Simulation:
    """The bed, twice as high as wide, under a free layer of water."""
    volume = count * math.pi / 6.0 * DIAMETER**3 / (1.0 - VOIDAGE)
    cell = 8e-3
    width = cell * max(2, round((volume / 2.0) ** (1.0 / 3.0) / cell))
    height = cell * math.ceil(1.25 * volume / width**2 / cell)
    case = Case.from_text(f"""
[fluid]
density = 997.0
viscosity = 8.354e-4
[material.alumina]
density = 3585.9
youngs_modulus = 3.0e11
contact_modulus = 2.0e7
poisson = 0.3
restitution = 0.9
friction = 0.1
roughness = 1e-6
[column]
width = {width}
height = {height}
cell = {cell}
sides = "free_slip"
[bed]
diameter = {DIAMETER}
count = {count}
start = "suspended"
inlet_velocity = 0.157
[laws]
drag = "wen_yu"
agitation = "{law}"
[run]
until = 10.0
""")
    return Simulation(case)


def main() -> None:
    """Measure and print."""
    asked = argparse.ArgumentParser()
    asked.add_argument("--count", type=int, default=4000)
    asked.add_argument("--rounds", type=int, default=7)
    asked.add_argument("--law", default="pseudo_turbulence")
    given = asked.parse_args()
    use_threads(1)
    runs = {law: bed(given.count, law) for law in ("none", given.law)}
    times: dict[str, list[float]] = {law: [] for law in runs}
    for run in runs.values():
        for _ in range(5):
            run.step()
    parts = {law: run.timers.seconds.copy() for law, run in runs.items()}
    for _ in range(given.rounds):
        for law, run in runs.items():
            begin, reached = time.process_time(), run.time
            for _ in range(5):
                run.step()
            times[law].append((time.process_time() - begin) / (run.time - reached))
    without, with_it = (statistics.median(each) for each in times.values())
    print(f"{given.count} beads: {without:.1f} s per simulated second without agitation, {with_it:.1f} with it")
    print(f"ratio {with_it / without:.3f}")
    part, steps = "voidage and drag", 5 * given.rounds
    spent = [(run.timers.seconds[part] - parts[law].get(part, 0.0)) / steps for law, run in runs.items()]
    whole = without * runs["none"].last_step
    print(f"the closure itself: {100.0 * (spent[1] - spent[0]) / whole:.1f} % of a step without agitation")


if __name__ == "__main__":
    main()
