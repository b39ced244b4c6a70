"""What the film does to a liquid bed: one small bed with no film, smooth, rough and soft spheres, in two viscosities.

Each bed is run from several seeds, and at two stiffnesses of the softened contact. Runs are kept as folders: what
was stopped goes on, what is there is not run again.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.case import Case
from cfddem.gallery import gallery
from cfddem.record.measures import voidage_profile
from cfddem.record.reading import Run as Written
from cfddem.record.reading import open_run
from cfddem.record.regimes import regime_map
from cfddem.report import expansion_exponents, window_of
from scenarios.kept_runs import finished
from scenarios.validation import Tell

Array = NDArray[np.float64]

SPHERES: dict[str, dict[str, Any]] = {
    "no film": {"laws.lubrication": "none"},
    "smooth": {},
    "rough": {"material.sphere.roughness": 1.0e-5},
    "soft": {"material.sphere.youngs_modulus": 5.0e5},
}
"""What is changed in the case; smooth spheres are those of its file."""

VISCOSITIES = (1.0e-3, 4.0e-3)
"""[Pa s]"""

MODULI = (1.0e5, 4.0e5)
"""Of the softened contact [Pa]."""

SEEDS = (1, 2, 3, 4, 5)

VOIDAGE = 0.6
"""That Richardson and Zaki expect of every bed: its velocity follows from it."""


class Setting(NamedTuple):
    """A bed of the study, whatever its seed."""

    spheres: str
    viscosity: float  # [Pa s]
    modulus: float  # [Pa]

    @property
    def name(self) -> str:
        """For folders."""
        return f"{self.spheres.replace(' ', '_')}-{1e3 * self.viscosity:g}mPas-{self.modulus:.0e}Pa"


SETTINGS = [Setting(*each) for each in itertools.product(SPHERES, VISCOSITIES, MODULI)]


@dataclass(frozen=True)
class Outcome:
    """One bed, averaged over its window."""

    bed_height: float  # [m]
    granular_temperature: float  # [m2/s2]
    contacts: float  # at an instant, over the number of spheres
    collisions: float  # in which solids meet, per sphere [1/s]
    stokes: float  # median of the encounters; NaN without a film
    solids_meet: float  # share of the encounters in which they do; NaN without a film
    voidage: Array  # layer by layer
    level: Array  # middle of each layer [m]


class Mean(NamedTuple):
    """Over the seeds, with its standard error."""

    value: Any
    error: Any
    seeds: int


def bed(setting: Setting, seed: int) -> Case:
    """A case of the study."""
    case = Case.from_toml(gallery()["lubrication-study"])
    case = case.with_(**{
        "fluid.viscosity": setting.viscosity,
        "material.sphere.contact_modulus": setting.modulus,
        "bed.seed": seed,
        **SPHERES[setting.spheres],
    })  # fmt: skip
    exponent, velocity = expansion_exponents(case)["Richardson-Zaki"]
    return case.with_(**{"bed.inlet_velocity": velocity * VOIDAGE**exponent})


def folder_of(home: Path, setting: Setting, seed: int) -> Path:
    """Where a run is kept."""
    return home / f"{setting.name}-seed{seed}"


def simulate(home: Path, tell: Tell, seeds: Sequence[int] = SEEDS) -> None:
    """Run all beds, the softer contacts first, one seed after the other, so that what is there is even at any time."""
    for modulus, seed in itertools.product(MODULI, seeds):
        for setting in (each for each in SETTINGS if each.modulus == modulus):
            finished(bed(setting, seed), home, folder_of(home, setting, seed).name, tell, {})


def outcomes(home: Path) -> dict[Setting, list[Outcome]]:
    """What the finished runs gave."""
    found: dict[Setting, list[Outcome]] = {}
    for setting, seed in itertools.product(SETTINGS, SEEDS):
        folder = folder_of(home, setting, seed)
        if (folder / "run.json").exists() and (run := open_run(folder)).status == "finished":
            found.setdefault(setting, []).append(outcome(run, bed(setting, seed)))
    return found


def outcome(run: Written, case: Case) -> Outcome:
    """Averages of one run."""
    begin, end = window_of(run, case)
    inside = run.history["time"] >= begin
    layers = [voidage_profile(run.fluid("voidage", int(place))) for place in np.flatnonzero(run.times >= begin)]
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
        solids_meet=regimes.solids_meet if regimes else np.nan,
        voidage=np.mean(layers, axis=0),
        level=(np.arange(len(layers[0])) + 0.5) * run.grid.spacing[2],
    )


def meetings(rows: Mapping[str, Array], reach: float) -> float:
    """How often the solids of two spheres met.

    rows   the record of encounters
    reach  of a film [m]

    With a film all touches until the pair has left its reach are one encounter. Without one each touch is a row; two
    of a pair are then one if it cannot have gone as far and come back at the speed with which it parted.
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


def mean(beds: list[Outcome], what: str) -> Mean:
    """One number of the beds of all seeds; the error needs two of them."""
    values = np.array([getattr(each, what) for each in beds])
    error = values.std(axis=0, ddof=1) / np.sqrt(len(beds)) if len(beds) > 1 else np.full_like(values[0], np.nan)
    return Mean(values.mean(axis=0), error, len(beds))
