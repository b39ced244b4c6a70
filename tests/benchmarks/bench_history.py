"""Cost of the history force: nanoseconds per particle and fluid step, on one thread.

    python tests/benchmarks/bench_history.py [--count N ...] [--kernel NAME ...] [--share X ...] [--rounds N]

Spheres of 1 mm in water whose slips fluctuate around one value. Shares are the fluid step over t_c, the time in which
the memory decays. The time of each line is the median of the rounds.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.coupling.forces.history import History
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.particles.state import make_particles
from closures.history import decay_time

DIAMETER, DENSITY, WATER, VISCOSITY, SLIP = 1e-3, 2500.0, 1000.0, 1e-3, 0.1


def cost(kernel: str, count: int, share: float, rounds: int) -> float:
    """Time of one step of the history force, per particle [ns]."""
    numbers = np.random.default_rng(1)
    history = History(kernel, WATER)  # type: ignore[arg-type]
    spheres = make_particles(np.zeros((count, 3)), 0.5 * DIAMETER, DENSITY, viscosity=VISCOSITY)
    for field in history.fields:
        spheres.declare(field)
    scale = decay_time(SLIP, DIAMETER, VISCOSITY / WATER) if kernel == "mei_adrian" else DIAMETER**2 * WATER / VISCOSITY
    step, drag = share * scale, np.full(count, 3.0 * np.pi * VISCOSITY * DIAMETER)
    one, other, inertia = np.ones(count), np.zeros((count, 3)), spheres.mass
    slips = [np.array([0.0, 0.0, SLIP]) + 0.03 * SLIP * numbers.normal(size=(count, 3)) for _ in range(3)]
    last, times = 0.0, []
    for n in range(rounds + 3):
        flow = SampledFlow(slips[n % 3], other, one, one, one, one)
        begin = time.process_time()
        terms = history.terms(spheres, flow, drag, inertia, step, last)
        history.store(spheres, other, terms, step)
        times.append(time.process_time() - begin)
        last = step
    return 1e9 * statistics.median(times[3:]) / count


def main() -> None:
    """Measure and print."""
    asked = argparse.ArgumentParser()
    asked.add_argument("--count", type=int, nargs="+", default=[2000, 20_000, 200_000])
    asked.add_argument("--kernel", nargs="+", default=["mei_adrian", "basset"])
    asked.add_argument("--share", type=float, nargs="+", default=[0.002, 0.02, 0.2])
    asked.add_argument("--rounds", type=int, default=30)
    given = asked.parse_args()
    use_threads(1)
    for kernel in given.kernel:
        for share in given.share:
            spent = [f"{cost(kernel, count, share, given.rounds):4.0f} ns of {count}" for count in given.count]
            print(f"{kernel:10} step {share:g} t_c: {', '.join(spent)} particles")


if __name__ == "__main__":
    main()
