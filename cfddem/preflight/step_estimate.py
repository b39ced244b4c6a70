"""Estimates of time steps, computing time, memory and disk space. All time scales of preflight are read here."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

from cfddem.case.bed import Species
from cfddem.case.feeds import fed_count
from cfddem.case.schema import Case
from cfddem.fluid.cell_counts import cell_counts
from cfddem.fluid.step_limit import VISCOUS, courant_step, fluid_step_limits
from cfddem.particles.step_criteria import TimeScales, crossing_step
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.collision_estimate import pair_row, reduced


@dataclass(frozen=True)
class StepEstimate:
    """Time steps of a run and what limits them."""

    time_scales: TimeScales  # of the particles
    particle: float  # particle step [s]; infinite for fixed particles
    limits: dict[str, float]  # of the fluid step, by criterion [s]
    cells: tuple[int, int, int] | None  # number of cells; None without a fluid

    @property
    def limiting(self) -> str:
        """Criterion that sets the fluid step."""
        return min(self.limits, key=self.limits.__getitem__)

    @property
    def fluid(self) -> float:
        """Fluid step; without a fluid, the interval at which the particle time scales are read again [s]."""
        return self.limits[self.limiting]

    @property
    def substeps(self) -> int:
        """Particle steps in a fluid step; 0 for fixed particles."""
        return 0 if math.isinf(self.particle) else max(1, math.ceil(self.fluid / self.particle - 1e-9))


def estimate_steps(case: Case, bed: BedEstimate) -> StepEstimate:
    """Estimate the time steps of a case at its start."""
    run, speed = case.run, max(case.reference_speed, 1e-12)
    every = [_time_scales(case, species, speed) for species in case.species.values()]
    shortest = min(every, key=lambda scales: scales.recommended)
    particle = math.inf if case.stands_still else run.particle_step or shortest.recommended
    if not case.has_fluid:
        return StepEstimate(shortest, particle, fluid_step_limits(particle, run.fluid_step, {}), None)
    cells = cell_counts(case.column.size, case.column.cell)
    spacing = [length / count for length, count in zip(case.column.size, cells)]
    fastest, flow = max(bed.inlet / bed.voidage, case.fastest_inflow), {}
    if fastest > 0.0:
        flow["Courant"] = courant_step(fastest, spacing)
    rates = [width**-2 for width, count in zip(spacing, cells) if count > 1]
    if rates and case.around.viscosity > 0.0:
        flow["viscous"] = VISCOUS * case.around.density / (2.0 * case.around.viscosity * sum(rates))
    if not case.stands_still:
        flow["particle Courant"] = courant_step(speed, spacing)
    return StepEstimate(shortest, particle, fluid_step_limits(particle, run.fluid_step, flow), cells)


def _time_scales(case: Case, species: Species, speed: float) -> TimeScales:
    """Time scales of two of the smallest particles of a species."""
    mass, radius = reduced(case, species, species.smallest_diameter)
    hertz, impact = case.laws.contact_law.impact_steps(mass, radius, pair_row(case, species), speed)
    return TimeScales(hertz, impact, math.inf, math.inf, crossing_step(2.0 * radius, speed))


# ---------------------------------------------------------------- computing time, memory and disk space


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
    particle_steps: float
    fluid_steps: float
    cell_seconds: float  # part of the seconds for the cells of the fluid


def estimate_cost(case: Case, bed: BedEstimate, steps: StepEstimate) -> CostEstimate:
    """Estimate the cost of a run to within a factor of two or three."""
    cells, count = math.prod(steps.cells or (0, 0, 0)), bed.count + fed_count(case)
    particle_steps = case.run.until / min(steps.particle, steps.fluid)
    fluid_steps = case.run.until / steps.fluid
    cell_seconds = fluid_steps * cells / CELL_STEPS_PER_SECOND
    seconds = particle_steps * count / PARTICLE_STEPS_PER_SECOND + cell_seconds
    seconds += fluid_steps * count / EXCHANGES_PER_SECOND * bool(cells)
    snapshots = 1.0 + case.run.until / (case.run.every or case.run.until / 50.0)
    return CostEstimate(
        seconds,
        BYTES_AT_LEAST + BYTES_PER_PARTICLE * count + BYTES_PER_CELL * cells,
        snapshots * (120.0 * count + 40.0 * cells),
        snapshots,
        BYTES_PER_CELL * cells > BYTES_PER_PARTICLE * count,
        particle_steps,
        fluid_steps * bool(cells),
        cell_seconds,
    )


def available_memory() -> float:
    """Memory of this machine [byte]; infinite if unknown."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return math.inf
