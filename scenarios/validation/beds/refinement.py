"""Numerical convergence of beds: the same bed with finer cells, a shorter step, and stiffer contacts.

The width of the filter kernel and all physical parameters are kept. Runs with stiffer contacts use the shorter step and
are compared with the run that only has the shorter step.

A bed that slugs is an oscillator: a small change of the drag changes its amplitude much. The particles of its snapshots
are therefore also put into finer cells, which shows the error of the cells without that of the motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cfddem.analysis.series import Average, block_average
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run
from cfddem.run.history import pressure_drop
from cfddem.run.simulation import Simulation
from scenarios.beds.liquid_bed.study import alginate
from scenarios.validation.kept_runs import finished
from scenarios.validation.table import Progress, Row

LIMIT = 0.05
"""Largest relative change of a converged mean."""

FINER = 1.5
"""Factor by which cells are finer."""

INSTANT, STEPS = 2e-5, 12
"""Fluid step [s], and their number, in which the gas flow adapts to given particles; these move by 0.1 mm."""


@dataclass(frozen=True)
class RefinementBed:
    """A bed, and the length of its run."""

    case: Case
    averaged_from: float  # [s]
    until: float  # [s]


class Means(NamedTuple):
    """Means that are compared, each with its standard error."""

    height: Average  # [m]
    drop: Average  # [Pa]
    variance: Average  # of the pressure drop [Pa2]


def liquid() -> RefinementBed:
    """Alginate beads in water, uniformly fluidised."""
    changes = {
        "title": "Liquid bed, for refinement",
        "column.width": 0.032,
        "bed.count": 1600,
        "run.particle_step": 4e-5,
    }
    return RefinementBed(alginate(0.009).with_(**changes), 6.0, 9.0)


def gas() -> RefinementBed:
    """Slugs of air in the narrow column of the gallery's ramp."""
    case = gallery()["defluidisation"]
    changes = {"title": "Slugging bed, for refinement", "bed.inlet_velocity": 0.6, "run.every": 0.25}
    return RefinementBed(case.with_(**changes), 1.0, 6.0)


def variants(case: Case) -> dict[str, tuple[dict[str, Any], str]]:
    """Changes to a case by name, and the name of the run that each is compared with."""
    step = case.run.particle_step
    assert step is not None
    stiffer = {
        f"material.{name}.contact_modulus": 4.0 * each.contact_modulus
        for name, each in case.material.items()
        if each.contact_modulus is not None
    }
    half = {"run.particle_step": 0.5 * step}
    return {
        "as it is": ({}, ""),
        "cells finer by 1.5": ({"column.cell": finer_cells(case, FINER)}, "as it is"),
        "half the particle step": (half, "as it is"),
        "four times the contact modulus": (stiffer | half, "half the particle step"),
    }


def finer_cells(case: Case, factor: float) -> tuple[float, ...]:
    """Edges of cells that are finer by a factor, except across a column one cell thick [m]."""
    return tuple(edge if edge >= whole else edge / factor for edge, whole in zip(_edges(case), case.column.size))


def _edges(case: Case) -> tuple[float, float, float]:
    cell = case.column.cell
    return cell if isinstance(cell, tuple) else (cell, cell, cell)


def refined(folder: Path, progress: Progress) -> list[Row]:
    """A liquid bed and a gas bed that slugs."""
    rows = []
    for name, bed in (("liquid bed", liquid()), ("slugging gas bed", gas())):
        found: dict[str, Means] = {}
        for change, (changes, other) in variants(bed.case).items():
            limits = {"run.until": bed.until, "run.average_from": bed.averaged_from}
            found[change] = means(
                finished(bed.case, folder, _home(name, change), progress, changes | limits), bed.averaged_from
            )
            if other:
                rows += compared(f"{name}, {change}", found[change], found[other], gusty=name != "liquid bed")
    progress("particles of the slugging gas bed in finer cells")
    return [*rows, *same_particles(gas(), open_run(folder / _home("slugging gas bed", "as it is")))]


def _home(name: str, change: str) -> str:
    """Folder of a run."""
    return f"refinement_{name}_{change}".replace(" ", "_")


def same_particles(bed: RefinementBed, run: RunData) -> list[Row]:
    """Ratios of the pressure drop, and of its deviation, of the particles of the snapshots in finer and finer cells."""
    factors = (1.0, FINER, 2.0 * FINER)
    drops = [instantaneous_drops(bed.case, run, bed.averaged_from, factor) for factor in factors]
    rows = []
    for factor, coarser, finer, coarse in zip(factors[1:], factors, drops[1:], drops):
        name = f"slugging gas bed, same particles in cells finer by {factor:g}"
        other = "those of the case" if coarser == 1.0 else f"cells finer by {coarser:g}"
        for quantity, ratio in (
            ("pressure drop", finer.mean() / coarse.mean()),
            ("standard deviation of the pressure", finer.std() / coarse.std()),
        ):
            note = f"{len(finer)} snapshots"
            rows.append(Row(f"{name}: {quantity} over that in {other}", float(ratio), 1.0, LIMIT, note=note))
    return rows


def instantaneous_drops(case: Case, run: RunData, begin: float, factor: float) -> np.ndarray:
    """Pressure drop over the particles of every snapshot from a time on [s], in cells that are finer by a factor."""
    drops = []
    for place in np.flatnonzero(run.times > begin):
        simulation = placed(case, run.particles(int(place)), factor)
        simulation.until(STEPS * INSTANT)
        drops.append(pressure_drop(simulation))
    return np.array(drops)


def placed(case: Case, particles: Mapping[str, np.ndarray], factor: float) -> Simulation:
    """The particles of a snapshot in cells that are finer by a factor; the gas is not in balance with them yet."""
    changes = {
        "column.cell": finer_cells(case, factor),
        "bed.count": None,
        "bed.positions": particles["position"].tolist(),
        "run.fluid_step": INSTANT,
    }
    simulation = Simulation(case.with_(**changes))
    simulation.particles.velocity[:] = particles["velocity"][simulation.particles.id]
    return simulation


def means(run: RunData, begin: float) -> Means:
    """Means of a run from a time on [s]."""
    history: Mapping[str, np.ndarray] = run.history
    window = history["time"] > begin
    drop = history["pressure_drop"][window]
    return Means(
        block_average(history["bed_height"][window]), block_average(drop), block_average((drop - drop.mean()) ** 2)
    )


def compared(name: str, changed: Means, kept: Means, gusty: bool) -> list[Row]:
    """Ratios of the means; for a bed that is not uniform, also of the pressure fluctuations."""
    rows = [
        _ratio(f"{name}: height over the reference run", changed.height, kept.height),
        _ratio(f"{name}: pressure drop over the reference run", changed.drop, kept.drop),
    ]
    if gusty:
        title = f"{name}: standard deviation of the pressure over the reference run"
        rows.append(_ratio(title, changed.variance, kept.variance, 0.5))
    return rows


def _ratio(quantity: str, changed: Average, kept: Average, power: float = 1.0) -> Row:
    error = power * np.hypot(changed.error / changed.mean, kept.error / kept.mean)
    return Row(quantity, float((changed.mean / kept.mean) ** power), 1.0, LIMIT, note=f"standard error {error:.2g}")
