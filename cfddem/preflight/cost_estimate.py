"""Estimates of computing time, memory and disk space."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

from cfddem.case.feeds import fed_count
from cfddem.case.schema import Case
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.step_estimate import StepEstimate

BYTES_PER_PARTICLE, BYTES_PER_CELL, BYTES_AT_LEAST = 3000.0, 1300.0, 0.45e9
"""Memory of a dense run: arrays per particle and per cell, and a process with its compiled loops [byte]."""

PARTICLE_STEPS_PER_SECOND, CELL_STEPS_PER_SECOND, EXCHANGES_PER_SECOND = 4e6, 3e5, 4e5
"""Speed of one core: particle steps, cells of fluid steps, particles of fluid steps.

Measured with 2 000 to 128 000 spheres in a liquid; dry particles with few contacts are two to three times as fast.
"""


@dataclass(frozen=True)
class CostEstimate:
    """Computing time on one core, memory and disk space."""

    seconds: float
    memory: float  # [byte]
    disk: float  # [byte]
    snapshots: float
    cells_dominate: bool  # cells take more memory than particles


def estimate_cost(case: Case, bed: BedEstimate, steps: StepEstimate) -> CostEstimate:
    """Estimate the cost of a run to within a factor of two or three."""
    cells, count = math.prod(steps.cells or (0, 0, 0)), bed.count + fed_count(case)
    particle_steps = case.run.until / min(steps.particle, steps.fluid)
    fluid_steps = case.run.until / steps.fluid
    seconds = particle_steps * count / PARTICLE_STEPS_PER_SECOND
    seconds += fluid_steps * (cells / CELL_STEPS_PER_SECOND + count / EXCHANGES_PER_SECOND * bool(cells))
    snapshots = 1.0 + case.run.until / (case.run.every or case.run.until / 50.0)
    return CostEstimate(
        seconds,
        BYTES_AT_LEAST + BYTES_PER_PARTICLE * count + BYTES_PER_CELL * cells,
        snapshots * (120.0 * count + 40.0 * cells),
        snapshots,
        BYTES_PER_CELL * cells > BYTES_PER_PARTICLE * count,
    )


def available_memory() -> float:
    """Memory of this machine [byte]; infinite if unknown."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return math.inf
