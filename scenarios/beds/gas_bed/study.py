"""Bubbling gas beds after experiments, and the standard gas bed, which measures the speed of a coupled run.

The standard bed has the box, particles and gas of Goldschmidt et al. (2004): 24 750 spheres at rest, into which gas
begins to flow. Its two time steps and its smeared surfaces are prescribed, so that different codes do the same work.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.run.simulation import Simulation
from scenarios.benchmarks import kept_speeds

DATA = Path(__file__).parents[2] / "data"
STEP, FLUID_STEPS = 5e-6, (2e-5, 1e-4)
"""Steps of the particles and of the fluid [s]."""

OPENFOAM = 44_800.0
"""Seconds that DPMFoam of OpenFOAM v1912 took for a simulated second of this bed on one core of an AMD EPYC, with the
shorter fluid step; measured over the first 2 ms."""

MEASURED = 2e-3
"""Simulated time over which the speed is measured, as it was for DPMFoam [s]."""


def mueller() -> Case:
    """The small bubbling bed of the gallery."""
    return gallery()["gas-bed"]


def van_wachem() -> Case:
    """The flat bubbling bed of the gallery."""
    return gallery()["gas-bed-flat"]


def standard_bed(fluid_step: float = FLUID_STEPS[0]) -> Case:
    """The standard gas bed. The width lies along x, the fastest direction in memory.

    fluid_step  [s]
    """
    with np.load(DATA / "gas_bed_24750.npz") as bed:
        centres = bed["pos_nm"][:, [1, 0, 2]] * 1e-9 + np.array([0.075, 0.0075, 0.0])
    return Case.model_validate(
        {
            "title": "Standard gas bed",
            "fluid": {"density": 1.2, "viscosity": 1.8e-5},
            "material": {
                "glass": {
                    "density": 2526.0, "youngs_modulus": 1e8, "poisson": 0.35, "restitution": 0.97, "friction": 0.1,
                }
            },
            "column": {
                "width": 0.15, "depth": 0.015, "height": 0.45, "cell": (0.005, 0.0075, 0.005),
                "sides": "no_slip", "front": "free_slip",
            },
            "bed": {"diameter": 2.5e-3, "positions": centres.tolist(), "inlet_velocity": 1.875},
            "laws": {
                "drag": "gidaspow", "lubrication": "none", "surface": "smeared", "self_disturbance_correction": False,
            },
            "run": {"until": 1.0, "particle_step": STEP, "fluid_step": fluid_step, "reference_speed": 1.0},
        }
    )  # fmt: skip


def bench(threads: int = 1, measured: float = MEASURED) -> dict[str, Any]:
    """Seconds for a simulated second of the standard gas bed on this machine, at both fluid steps.

    threads   of the run
    measured  simulated time of a measurement [s]
    returns   what was run; for each fluid step the wall and processor time, the shares of the parts, and the speed
              relative to DPMFoam
    """
    use_threads(threads)
    _measure(max(FLUID_STEPS), measured)  # warm-up: loads the compiled loops
    runs = [_measure(fluid_step, measured) for fluid_step in FLUID_STEPS]
    return {"particles": len(standard_bed().bed.positions or ()), "threads": threads, "step [s]": STEP, "runs": runs}


def _measure(fluid_step: float, measured: float) -> dict[str, Any]:
    """Seconds and shares of one run of the standard bed."""
    simulation = Simulation(standard_bed(fluid_step))
    for _ in range(3):
        simulation.step()
    before = dict(simulation.timers.seconds)
    begin, wall, processor = simulation.time, perf_counter(), process_time()
    while simulation.time < begin + measured * (1.0 - 1e-9):
        simulation.step()
    wall, processor = perf_counter() - wall, process_time() - processor
    time = simulation.time - begin
    parts = {name: seconds - before.get(name, 0.0) for name, seconds in simulation.timers.seconds.items()}
    return {
        "fluid step [s]": fluid_step,
        "wall [s/s]": wall / time,
        "processor [s/s]": processor / time,
        "shares": {part: seconds / wall for part, seconds in parts.items() if seconds > 0.0},
        "times as fast as DPMFoam": OPENFOAM * time / wall,
        "times as fast as DPMFoam, by processor": OPENFOAM * time / processor,
    }


def rows(result: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """A result as lines of a table."""
    yield "standard gas bed", f"{result['particles']} spheres, {result['threads']} thread(s), step {STEP:g} s"
    for run in result["runs"]:
        name = f"fluid step {run['fluid step [s]']:g} s"
        bed = kept_speeds.gas_bed(run["fluid step [s]"], result["threads"])
        yield (
            name,
            f"{run['wall [s/s]']:.0f} s of wall, {run['processor [s/s]']:.0f} s of processor per simulated second",
        )
        yield "", ", ".join(f"{part} {share:.0%}" for part, share in run["shares"].items())
        ratios = run["times as fast as DPMFoam"], run["times as fast as DPMFoam, by processor"]
        yield (
            "",
            f"{ratios[0]:.1f} times as fast as DPMFoam ({OPENFOAM:.0f} s on one core); {ratios[1]:.1f} by processor"
            + kept_speeds.beside(bed, 3600.0 / run["wall [s/s]"]),
        )
    yield "", "wall and processor differ where other programs run on the same cores"
