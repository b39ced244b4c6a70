"""Numerical convergence of beds: the same bed with finer cells, a shorter step, and stiffer contacts.

The width of the filter kernel and all physical parameters are kept. Runs with stiffer contacts use the shorter step and
are compared with the run that only has the shorter step.
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
from cfddem.io.reading import Run as Written
from scenarios.beds.liquid_bed.study import alginate
from scenarios.validation.kept_runs import finished
from scenarios.validation.table import Progress, Row

LIMIT = 0.05
"""Largest relative change of a converged mean."""


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
    case = Case.from_toml(gallery()["defluidisation"])
    changes = {"title": "Slugging bed, for refinement", "bed.inlet_velocity": 0.6, "run.every": 0.25}
    return RefinementBed(case.with_(**changes), 1.0, 6.0)


def variants(case: Case) -> dict[str, tuple[dict[str, Any], str]]:
    """Changes to a case by name, and the name of the run that each is compared with."""
    step = case.run.particle_step
    assert step is not None
    finer = tuple(width if width >= whole else width / 1.5 for width, whole in zip(_edges(case), case.column.size))
    stiffer = {
        f"material.{name}.contact_modulus": 4.0 * each.contact_modulus
        for name, each in case.material.items()
        if each.contact_modulus is not None
    }
    half = {"run.particle_step": 0.5 * step}
    return {
        "as it is": ({}, ""),
        "cells finer by 1.5": ({"column.cell": finer}, "as it is"),
        "half the particle step": (half, "as it is"),
        "four times the contact modulus": (stiffer | half, "half the particle step"),
    }


def _edges(case: Case) -> tuple[float, float, float]:
    cell = case.column.cell
    return cell if isinstance(cell, tuple) else (cell, cell, cell)


def refined(folder: Path, progress: Progress) -> list[Row]:
    """A liquid bed and a gas bed that slugs."""
    rows = []
    for name, bed in (("liquid bed", liquid()), ("slugging gas bed", gas())):
        found: dict[str, Means] = {}
        for change, (changes, other) in variants(bed.case).items():
            home = f"refinement_{name}_{change}".replace(" ", "_")
            limits = {"run.until": bed.until, "run.average_from": bed.averaged_from}
            found[change] = means(finished(bed.case, folder, home, progress, changes | limits), bed.averaged_from)
            if other:
                rows += compared(f"{name}, {change}", found[change], found[other], gusty=name != "liquid bed")
    return rows


def means(run: Written, begin: float) -> Means:
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
