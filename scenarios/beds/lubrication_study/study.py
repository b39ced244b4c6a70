"""Effect of lubrication films on a liquid bed: no film, smooth, rough and soft spheres, in two liquids.

Each bed is run from several seeds, with two stiffnesses of the softened contact, and without agitation. Runs are kept
as folders: interrupted runs are continued, and finished runs are not repeated.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.analysis.fluctuations import regime_map
from cfddem.analysis.measures import profile
from cfddem.analysis.report import window_of
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run
from cfddem.preflight.expansion import expansion_exponents
from scenarios.validation.kept_runs import finished
from scenarios.validation.table import Progress

Array = NDArray[np.float64]

SPHERES: dict[str, dict[str, Any]] = {
    "no film": {"laws.lubrication": "none"},
    "smooth": {},
    "rough": {"material.sphere.roughness": 1.0e-5},
    "soft": {"material.sphere.youngs_modulus": 5.0e5},
}
"""Changes to the case file, which describes the smooth spheres."""

VISCOSITIES = (2.2e-3, 3.5e-3)
"""[Pa s]; Re_m = 53 and 27, inside of the range in which agitation was measured."""

MODULI = (1.0e5, 4.0e5)
"""Moduli of the softened contact [Pa]."""

SEEDS = (1, 2, 3, 4, 5)

VOIDAGE = 0.6
"""Voidage by Richardson and Zaki; sets the velocity of each bed."""


class Setting(NamedTuple):
    """A bed of the study, for any seed."""

    spheres: str
    viscosity: float  # [Pa s]
    modulus: float  # [Pa]
    agitation: str = "free_spheres"

    @property
    def name(self) -> str:
        """Name for folders."""
        bed = f"{self.spheres.replace(' ', '_')}-{1e3 * self.viscosity:g}mPas-{self.modulus:.0e}Pa"
        return f"{bed}-{self.agitation}"


SETTINGS = [
    *(Setting(*values) for values in itertools.product(SPHERES, VISCOSITIES, MODULI)),
    *(Setting(*values) for values in itertools.product(SPHERES, VISCOSITIES, MODULI[:1], ("none",))),
]


@dataclass(frozen=True)
class Outcome:
    """One bed, averaged over its window."""

    bed_height: float  # [m]
    granular_temperature: float  # [m2/s2]
    contacts: float  # at one time, over the number of spheres
    collisions: float  # in which solids meet, per sphere [1/s]
    stokes: float  # median of the collisions; NaN without a film
    solids_meet: float  # share of the collisions in which they do; NaN without a film
    voidage: Array  # layer by layer
    level: np.ndarray  # middle of each layer [m]


class Mean(NamedTuple):
    """Over the seeds, with its standard error."""

    value: Any
    error: Any
    seeds: int


def bed(setting: Setting, seed: int) -> Case:
    """A case of the study."""
    case = gallery()["lubrication-study"]
    case = case.with_(**{
        "fluid.viscosity": setting.viscosity,
        "material.sphere.contact_modulus": setting.modulus,
        "bed.seed": seed,
        "laws.agitation": setting.agitation,
        **SPHERES[setting.spheres],
    })  # fmt: skip
    exponent, velocity = expansion_exponents(case)["Richardson-Zaki"]
    return case.with_(**{"bed.inlet_velocity": velocity * VOIDAGE**exponent})


def folder_of(home: Path, setting: Setting, seed: int) -> Path:
    """Folder of a run."""
    return home / f"{setting.name}-seed{seed}"


def run_beds(home: Path, progress: Progress, seeds: Sequence[int] = SEEDS) -> None:
    """Run all beds: the softer contacts first, and seed by seed, so that partial results are balanced."""
    for modulus, seed in itertools.product(MODULI, seeds):
        for setting in (other for other in SETTINGS if other.modulus == modulus):
            finished(bed(setting, seed), home, folder_of(home, setting, seed).name, progress, {})


def outcomes(home: Path) -> dict[Setting, list[Outcome]]:
    """Results of the finished runs."""
    of_settings: dict[Setting, list[Outcome]] = {}
    for setting, seed in itertools.product(SETTINGS, SEEDS):
        folder = folder_of(home, setting, seed)
        if (folder / "run.json").exists() and (run := open_run(folder)).status == "finished":
            of_settings.setdefault(setting, []).append(outcome(run, bed(setting, seed)))
    return of_settings


def outcome(run: RunData, case: Case) -> Outcome:
    """Averages of one run."""
    begin, end = window_of(run, case)
    inside = run.history["time"] >= begin
    layers = [profile(run.fluid("voidage", int(place))) for place in np.flatnonzero(run.times >= begin)]
    rows = {name: column[run.collisions["end"] >= begin] for name, column in run.collisions.items()}
    regimes = regime_map(rows) if case.laws.lubrication != "none" else None
    spheres = case.particle_count
    assert run.grid is not None
    return Outcome(
        bed_height=float(run.history["bed_height"][inside].mean()),
        granular_temperature=float(run.history["granular_temperature"][inside].mean()),
        contacts=float(run.history["contact_count"][inside].mean()) / spheres,
        collisions=2.0 * meetings(rows, 0.25 * case.bed.diameter) / (spheres * (end - begin)),
        stokes=regimes.median_stokes if regimes else np.nan,
        solids_meet=regimes.contact_fraction if regimes else np.nan,
        voidage=np.mean(layers, axis=0),
        level=(np.arange(len(layers[0])) + 0.5) * run.grid.spacing[2],
    )


def meetings(rows: Mapping[str, Array], reach: float) -> float:
    """Number of collisions in which the solids of two spheres touched.

    rows   the record of collisions
    reach  range of a film [m]

    With a film, all touches until the pair has left the range of the film are one row. Without a film, each touch is a
    row; two touches of a pair count as one if, at its speed of separation, it cannot have left that range between them.
    """
    between = (rows["second"] >= 0) & (rows["closest_gap"] < np.maximum(rows["minimum_gap"], 0.0))
    if np.isfinite(rows["stokes"]).any():
        return float(rows["weight"][between].sum())
    first, second, begin, end = (rows[name][between] for name in ("first", "second", "begin", "end"))
    low, high = np.minimum(first, second), np.maximum(first, second)
    parting = np.abs(rows["approach_speed"] * rows["restitution"])[between]
    order = np.lexsort((begin, high, low))
    same = (np.diff(low[order]) == 0) & (np.diff(high[order]) == 0)
    apart = begin[order][1:] - end[order][:-1]
    again = same & (apart * parting[order][:-1] < 2.0 * reach)
    return float(rows["weight"][between].sum() - rows["weight"][between][order][1:][again].sum())


def mean(beds: Sequence[Outcome], measure: str) -> Mean:
    """Mean of a quantity over the seeds; the standard error needs at least two."""
    return _mean(np.array([getattr(bed, measure) for bed in beds]))


def change(beds: Sequence[Outcome], others: Sequence[Outcome], measure: str) -> Mean:
    """Change of a quantity from other beds to beds of the same seeds, seed by seed, over the mean of the others [-].

    As far as both have run: each bed runs from one seed after the other.
    """
    pairs = [(getattr(bed, measure), getattr(other, measure)) for bed, other in zip(beds, others)]
    of_beds, of_others = (np.array(side) for side in zip(*pairs))
    return _mean((of_beds - of_others) / of_others.mean())


def _mean(values: Array) -> Mean:
    error = values.std(axis=0, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.full_like(values[0], np.nan)
    return Mean(values.mean(axis=0), error, len(values))
