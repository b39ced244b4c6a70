"""What heat, vapour and evaporation add to the time of a gas bed, on one thread, in one run.

    python tests/benchmarks/bench_heat.py [--bed NAME ...] [--steps N] [--profile]

Beds are those of the gallery, and `light`: 500 seeds with fluid steps of 0.2 ms, in which 20 particle steps are made.

Four runs of a bed make their steps in turns: dry, with heat, wet with heat, and that with vapour and evaporation. They
see the same load of the machine, and processor time is counted. All move alike, as liquid without pull changes no
motion. Each line is the median of the ratios of single steps.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import statistics
import time
from typing import Any

from cfddem.backend.compile import use_threads
from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.run.simulation import Simulation

LIMIT = 0.15
"""What either may add."""

HEAT = {
    "particle_temperature": 311.3, "fluid_temperature": 311.3, "inlet_temperature": 400.0,
    "fluid_heat_capacity": 1010.0, "conductivity": 0.03, "heat_capacity": {"seed": 840.0},
}  # fmt: skip
VAPOUR = {"fluid_fraction": 0.042, "inlet_fraction": 0.005, "diffusivity": 3.2e-5}
LIQUID = {
    "viscosity": 1e-3, "surface_tension": 0.07, "thickness": 8e-7, "pull": "none", "film": "none", "tangential": "none",
    "rupture": "film",
}  # fmt: skip


LIGHT: dict[str, Any] = {
    "bed.count": 500, "column.depth": 0.0144, "column.height": 0.0216, "bed.start": "suspended", "run.fluid_step": 2e-4,
}  # fmt: skip
"""Changes of the drying bed."""


def dry_case(bed: str) -> Case:
    """A bed of the gallery without liquid, heat and vapour."""
    case = Case.from_toml(gallery_files()["drying-bed" if bed == "light" else bed], LIGHT if bed == "light" else {})
    absent = dict.fromkeys(("liquid", "heat", "vapour", "evaporation"))
    return case.with_(**absent, **{"laws.heat_transfer": "gunn", "laws.lubrication": "none"})


def runs(bed: str) -> list[Simulation]:
    """The four runs."""
    case = dry_case(bed)
    tables: list[dict[str, Any]] = [
        {},
        {"heat": HEAT},
        {"heat": HEAT, "liquid": LIQUID},
        {"heat": HEAT, "liquid": LIQUID, "vapour": VAPOUR, "evaporation": {}},
    ]
    return [Simulation(case.with_(**each)) for each in tables]


def measure(bed: str, steps: int) -> list[Simulation]:
    """Print what both add to one bed."""
    simulations = runs(bed)
    dry, drying = simulations[0], simulations[-1]
    spent: list[list[float]] = []
    for n in range(steps + 20):
        seconds = []
        for simulation in simulations:
            begin = time.process_time()
            simulation.step()
            seconds.append(time.process_time() - begin)
        if n >= 20:
            spent.append(seconds)
    mean = [1e3 * statistics.median(each) for each in zip(*spent)]
    print(
        f"{bed}: {dry.particles.count} particles, {dry.fluid.grid.cells} cells; ms per step: "
        + ", ".join(f"{each:.2f}" for each in mean)
    )
    for name, one, other in (("heat", 0, 1), ("vapour and evaporation", 2, 3)):
        added = statistics.median(each[other] / each[one] for each in spent) - 1.0
        print(f"  {name:24} adds {100.0 * added:5.1f} %  (limit {100.0 * LIMIT:.0f} %)", flush=True)
    parts = drying.timers.seconds
    shares = ", ".join(f"{name} {1e3 * value / drying.steps:.3f}" for name, value in parts.items())
    print(f"  of the last, ms per step: {shares}")
    return simulations


def main() -> None:
    """Measure and print."""
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--bed", nargs="+", default=["light", "drying-bed", "gas-bed"])
    asked.add_argument("--steps", type=int, default=300)
    asked.add_argument("--profile", action="store_true")
    given = asked.parse_args()
    use_threads(1)
    for bed in given.bed:
        simulations = measure(bed, given.steps)
        if given.profile:
            with cProfile.Profile() as profiler:
                for _ in range(200):
                    simulations[-1].step()
            pstats.Stats(profiler).sort_stats("tottime").print_stats(45)


if __name__ == "__main__":
    main()
