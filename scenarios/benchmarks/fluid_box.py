"""Time of a fluid step, beside the time in which the memory of the machine moves what a step must move.

A bed of voidage about 0.45 that moves a little each step fills the lower half of a box. Gas enters below at 0.3 m/s
and leaves above; drag 2 000 kg/m3/s, model A, pressure tolerance 1e-9 of the largest flux through a face in every
cell; two stages, so two pressure solves. A step counts everything: checks, ghost cells, limits of the step.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.fluid.conditions import Inlet, Outlet
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver
from scenarios.benchmarks import kept_speeds
from scenarios.benchmarks.memory import triad

CELLS = {(32, 8, 128): 0.05, (64, 64, 64): 0.25}
"""Cells of the boxes, and the longest step that is accepted [s]."""

STAGE_BYTES, ITERATION_BYTES = 200 + 260 + 120, 780
"""Bytes that the loops must move for a cell if nothing were found in a cache: in a stage (transport, predictor, the
rest), and in an iteration of the pressure solver, coarse grids included."""

ICOFOAM = {(64, 64, 64): 0.50}
"""Step of icoFoam, two PISO correctors, pressure to 1e-6, on one core of an AMD EPYC [s]."""

STEP, WARM, MEASURED = 5e-4, 5, 15


def box(cells: tuple[int, int, int]) -> tuple[FluidSolver, Callable[[float], np.ndarray], np.ndarray, np.ndarray]:
    """The fluid, its voidage as a function of time, and its drag."""
    grid = Grid(cells, (0.005,) * 3)
    x, y, z = grid.centres()
    inside = np.broadcast_to(z < 0.5 * grid.size[2], grid.shape)

    def voidage(t: float) -> np.ndarray:
        return np.where(inside, 0.45 + 0.05 * np.sin(20 * t + 50 * x) * np.sin(40 * y + 1), 1.0)

    fluid = FluidSolver(
        grid, {"z_low": Inlet(0.3), "z_high": Outlet()}, density=1.2, viscosity=1.8e-5, voidage=voidage(0.0)
    )
    return fluid, voidage, np.where(inside, 2000.0, 0.0), np.zeros((*grid.shape, 3))


def bench(threads: int = 1) -> dict[str, Any]:
    """Seconds of a fluid step in each box, and the same over the time that memory alone would take.

    threads  of the fluid
    """
    speed = triad(threads)
    use_threads(threads)
    return {"threads": threads, "triad [GB/s]": speed / 1e9, "boxes": [measure(cells, speed) for cells in CELLS]}


def measure(cells: tuple[int, int, int], speed: float) -> dict[str, Any]:
    """Median of some steps in a box after some to warm up.

    speed  of the memory [bytes/s]
    """
    fluid, voidage, drag, momentum = box(cells)
    times, iterations = [], []
    for n in range(1, WARM + MEASURED + 1):
        field = voidage(n * STEP)
        begin = time.perf_counter()
        report = fluid.step(STEP, field, drag, momentum)
        times.append(time.perf_counter() - begin)
        iterations.append(sum(report.pressure_iterations))
    median, work = float(np.median(times[WARM:])), float(np.mean(iterations[WARM:]))
    moved = float(np.prod(cells)) * (2 * STAGE_BYTES + work * ITERATION_BYTES)
    return {
        "cells": list(cells),
        "step [s]": median,
        "longest accepted [s]": CELLS.get(cells),
        "step of icoFoam [s]": ICOFOAM.get(cells),
        "pressure iterations": work,
        "bytes": moved,
        "share of the triad": moved / speed / median,
    }


def rows(result: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """A result as lines of a table."""
    yield "fluid step", f"{result['threads']} thread(s), triad {result['triad [GB/s]']:.1f} GB/s"
    for box in result["boxes"]:
        cells, step = box["cells"], box["step [s]"]
        name = kept_speeds.fluid_box(cells, result["threads"])
        yield (
            " x ".join(str(count) for count in cells),
            f"{step:.4f} s, {1e9 * step / np.prod(cells):.0f} ns a cell, {box['pressure iterations']:.1f} pressure "
            f"iterations, {box['share of the triad']:.2f} of the triad{kept_speeds.beside(name, 1.0 / step)}",
        )
