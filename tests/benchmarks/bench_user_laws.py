"""Speed of a user's film law against the same law built in, on the standard dense bed.

    python tests/benchmarks/bench_user_laws.py [--count N] [--rounds N]

Prints million particle-steps a second of each, and the ratio of medians; rounds alternate.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from typing import Any

from cfddem import Laws, ParticleSolver, Plane, make_particles, pair_table
from cfddem.backend.compile import use_threads
from cfddem.particles.interactions.film_law import FilmLaw
from closures.lubrication import short_film_potential
from scenarios.benchmarks.dense_bed import DIAMETER, GRAIN, STEP, positions


def strength(viscosity: float, reduced_radius: float) -> float:
    """A of the resistance A/h [N s]."""
    return 6.0 * math.pi * viscosity * reduced_radius**2


def resistance(gap: float, viscosity: float, reduced_radius: float) -> float:
    """Resistance of the film [kg/s]."""
    return strength(viscosity, reduced_radius) / gap


def potential(gap: float, end_gap: float, viscosity: float, reduced_radius: float) -> float:
    """Integral of the resistance over the gap [N s]."""
    return strength(viscosity, reduced_radius) * math.log(end_gap / gap)


def short_potential(gap: float, end_gap: float, viscosity: float, reduced_radius: float) -> float:
    """The same for near gaps, by a series [N s]."""
    return strength(viscosity, reduced_radius) * short_film_potential(gap, end_gap - gap, 0.0)


def bed(count: int, **laws: Any) -> ParticleSolver:
    """The dense bed with the film of water."""
    centres, (width, depth) = positions(count)
    return ParticleSolver(
        make_particles(centres, 0.5 * DIAMETER, GRAIN.density, viscosity=1e-3),
        pair_table([GRAIN]),
        walls=[Plane()],
        laws=Laws(film=True, **laws),
        gravity=(0.0, 0.0, -9.81),
        box=(width, depth, None),
    )


def main() -> None:
    """Measure and print."""
    asked = argparse.ArgumentParser()
    asked.add_argument("--count", type=int, default=10_000)
    asked.add_argument("--rounds", type=int, default=5)
    given = asked.parse_args()
    use_threads(1)
    steps = max(20, 2_000_000 // given.count)
    runs = {
        "built in": bed(given.count),
        "user, with potentials": bed(given.count, lubrication=FilmLaw(resistance, potential, short_potential)),
        "user, resistance only": bed(given.count, lubrication=FilmLaw(resistance)),
    }
    times: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run.advance(STEP, steps)
    for _ in range(given.rounds):
        for name, run in runs.items():
            begin = time.process_time()
            run.advance(STEP, steps)
            times[name].append(time.process_time() - begin)
    usual = statistics.median(times["built in"])
    for name, each in times.items():
        speed = given.count * steps / statistics.median(each) / 1e6
        print(f"{name:24} {speed:6.2f} million particle-steps/s, {usual / statistics.median(each):.2f} of built in")


if __name__ == "__main__":
    main()
