"""What films change in the beds of the map: their means, and differences from the bed without films, seed by seed."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenarios.validation.film_map.design import DRY, ROUGHNESS, Point, Run, bed, plan, viscosity_of
from scenarios.validation.table import replacing

Means = Mapping[str, float]
Beds = dict[Run, Means]

UNITS = {
    "voidage": "-", "bed_height": "m", "granular_temperature": "m2/s2", "temperature_along": "m2/s2",
    "temperature_across": "m2/s2", "collisions": "1/s", "approaches": "1/s", "stokes": "-",
    "stokes_of_fluctuations": "-", "gap_ratio": "-", "solids_meet": "-", "contacts": "-", "dissipated": "-",
    "dissipation": "W", "largest_remainder": "-",
}  # fmt: skip
"""Means of a bed and their units, in the order of the columns."""

CHANGED = {
    "bed_height": "bed height",
    "granular_temperature": "granular temperature",
    "temperature_along": "granular temperature along gravity",
    "temperature_across": "granular temperature across gravity",
    "collisions": "collisions of a sphere",
    "dissipation": "dissipation by films and contacts",
}
"""Quantities that are compared with the bed without films."""

OF_FILMS = {
    "stokes": "median Stokes number of the collisions",
    "gap_ratio": "median h_eps over roughness",
    "solids_meet": "share of collisions in which solids meet",
    "dissipated": "share of films and contacts in the dissipation",
}
"""Quantities of beds with films that are shown as they are."""


class Estimate(NamedTuple):
    """A mean over seeds, with its standard error; NaN where there is one seed."""

    value: float
    error: float
    seeds: int


def estimate(values: Sequence[float]) -> Estimate:
    """Mean and standard error.

    >>> estimate([1.0, 3.0])
    Estimate(value=2.0, error=1.0, seeds=2)
    """
    count = len(values)
    error = float(np.std(values, ddof=1)) / math.sqrt(count) if count > 1 else math.nan
    return Estimate(float(np.mean(values)), error, count)


def change(beds: Beds, point: Point, film: str, measure: str) -> Estimate | None:
    """Relative change by a film, seed by seed; None where no seed has both beds."""
    changes = [
        means[measure] / dry[measure] - 1.0
        for run, means in beds.items()
        if (run.point, run.film) == (point, film)
        and (dry := beds.get(run._replace(film=DRY))) is not None
        and measure in means and dry.get(measure, 0.0) != 0.0
    ]  # fmt: skip
    return estimate(changes) if changes else None


def mean(beds: Beds, point: Point, film: str, measure: str) -> Estimate | None:
    """Mean over the seeds; None where there is none."""
    values = [
        means[measure] for run, means in beds.items() if (run.point, run.film) == (point, film) and measure in means
    ]
    return estimate(values) if values else None


def compared(beds: Beds) -> list[tuple[Point, str]]:
    """Points and films of which some seed has both beds, in the order of the design."""
    pairs = {(run.point, run.film) for run in beds if run.film != DRY and run._replace(film=DRY) in beds}
    roughness = list(ROUGHNESS)
    return sorted(pairs, key=lambda pair: (not pair[0].agitated, pair[0], roughness.index(pair[1])))


# ---------------------------------------------------------------- files


def finished_beds(home: Path) -> Beds:
    """The means of all finished beds."""
    beds: Beds = {}
    for run in plan():
        path = home / f"{run.name}.json"
        if path.exists():
            beds[run] = json.loads(path.read_text(encoding="utf-8"))
    return beds


_KEYS = ("reynolds", "solid_fraction", "density_ratio", "agitated", "film", "seed")
_SET = {"roughness": "m", "youngs_modulus": "Pa", "viscosity": "Pa s", "velocity": "m/s"}


def write_beds(beds: Beds, path: Path) -> None:
    """Write a CSV file, one row for each bed; lengths are those of spheres of 2 mm."""
    with replacing(path) as fresh, fresh.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow([
            *(f"{name} [-]" for name in _KEYS), *(f"{name} [{unit}]" for name, unit in (_SET | UNITS).items()),
        ])  # fmt: skip
        for run, means in sorted(beds.items()):
            case = bed(*run)
            velocity = case.bed.inlet_velocity
            assert isinstance(velocity, float)
            roughness = math.nan if run.film == DRY else ROUGHNESS[run.film]
            described = (roughness, case.solid.youngs_modulus, viscosity_of(case), velocity)
            numbers = (*described, *(means.get(name, math.nan) for name in UNITS))
            point = run.point
            out.writerow([
                *(f"{number:g}" for number in point[:3]), int(point.agitated), run.film, run.seed,
                *("" if math.isnan(number) else f"{number:.6g}" for number in numbers),
            ])  # fmt: skip


def read_beds(lines: Iterable[str]) -> Beds:
    """Beds from the lines of such a file."""
    beds: Beds = {}
    for row in csv.DictReader(lines):
        values = {name.split(" [")[0]: text for name, text in row.items()}
        reynolds, solid_fraction, density_ratio = (float(values[name]) for name in _KEYS[:3])
        point = Point(reynolds, solid_fraction, density_ratio, values["agitated"] == "1")
        run = Run(point, values["film"], int(values["seed"]))
        beds[run] = {name: float(values[name]) for name in UNITS if values[name]}
    return beds
