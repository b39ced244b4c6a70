r"""How much each key of a case matters for the means of its runs: indices of Sobol, and elementary effects of Morris.

Keys vary within ranges, independently and evenly; a key with words or listed values takes them equally often.

.. math::
    S_i = \frac{\mathrm{Var}_i\,\mathrm{E}_{\sim i}(f)}{\mathrm{Var}(f)}, \qquad
    T_i = \frac{\mathrm{E}_{\sim i}\mathrm{Var}_i(f)}{\mathrm{Var}(f)}, \qquad
    \mu^*_i = \frac1r \sum_j \left|\frac{f(x_j + \Delta e_i) - f(x_j)}{\Delta}\right|

The first-order index :math:`S_i` is the share of the variance that a key causes alone, the total one :math:`T_i` with
all of its interactions. The elementary effect :math:`\mu^*_i` is the mean change over the whole range of a key.
Estimators are those of Saltelli et al. (2010, Comput. Phys. Commun. 181, 259) and Jansen (1999, Comput. Phys. Commun.
117, 35); effects are those of Morris (1991, Technometrics 33, 161) and Campolongo et al. (2007, Environ. Model. Softw.
22, 1509). The means of runs have errors: their variance is taken from :math:`\mathrm{Var}(f)` and from :math:`T_i`.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.errors import InputError, nearest
from cfddem.backend.tables import table
from cfddem.io.quantities import shown_unit
from cfddem.studies.samples import MOST_VARIABLES, Array, Variable, variables
from cfddem.studies.sweep import Outcome, ranges, run_name

KINDS = ("sobol", "morris")

LEVELS = 4
"""Levels of a range in the design of Morris."""

STEP = LEVELS / (2.0 * (LEVELS - 1.0))
"""Share of the range by which a key changes in it."""

MOST_RUNS = 100_000

RESAMPLED = 400
"""Sets of rows from which errors are found."""

FEWEST = 4
"""Fewest rows of a design with all runs finished."""

FIRST_SHOWN = ("bed_height", "bed_voidage", "pressure_drop", "granular_temperature", "collision_rate")
"""Measures that are printed, as far as there are any; others are in the table."""


class Choice(NamedTuple):
    """A key and the values that it takes."""

    key: str
    values: tuple[Any, ...]

    def value(self, share: float) -> Any:
        """The value at a share of the list.

        >>> [Choice("laws.drag", ("wen_yu", "ergun")).value(share) for share in (0.0, 0.49, 0.5, 1.0)]
        ['wen_yu', 'wen_yu', 'ergun', 'ergun']
        """
        return self.values[min(int(share * len(self.values) * (1.0 + 1e-12)), len(self.values) - 1)]


def factors(texts: Sequence[str]) -> list[Variable | Choice]:
    """Keys with ranges or listed values from texts such as `friction=0.1..0.5` and `laws.drag=wen_yu,ergun`.

    errors  InputError

    >>> [each.key for each in factors(["bed.diameter=1e-3..2e-3", "laws.drag=wen_yu,ergun"])]
    ['bed.diameter', 'laws.drag']
    """
    varied: list[Variable | Choice] = []
    for text in texts:
        if ".." in text.partition("=")[2]:
            varied += variables([text])
        else:
            ((key, values),) = ranges([text]).items()
            varied.append(Choice(key, tuple(values)))
            if len(values) < 2:
                raise InputError("--vary", text, "key=low..high, or key=value,value,...")
    keys = [factor.key for factor in varied]
    for key in keys:
        if keys.count(key) > 1:
            raise InputError("--vary", key, "given once")
    if not 1 <= len(varied) <= MOST_VARIABLES:
        raise InputError("--vary", len(varied), f"given 1 to {MOST_VARIABLES} times")
    return varied


# ---------------------------------------------------------------- designs


@dataclass(frozen=True)
class Design:
    """Points at which a case is run, in shares of the ranges.

    kind    one of KINDS
    points  sobol: (k + 2, n, k), the samples A and B and, for each key, A with its column of B;
            morris: (k + 1, n, k), trajectories that change one key after the other
    order   morris: (n, k), the key that each step changes
    """

    kind: str
    points: Array
    order: np.ndarray

    @property
    def rows(self) -> int:
        """Number n of rows of the sample, or of trajectories."""
        return self.points.shape[1]


def design(kind: str, count: int, keys: int, seed: int = 1) -> Design:
    """A design for a number of keys.

    count   rows of the sample, a power of two for Sobol, or trajectories
    errors  InputError for an unknown kind or a wrong count
    """
    if kind not in KINDS:
        raise InputError("--sensitivity", kind, nearest(kind, KINDS))
    most = MOST_RUNS // (keys + 2)
    if not FEWEST <= count <= most:
        raise InputError("--runs", count, f"{FEWEST} to {most}, rows of the design with {keys} keys")
    if kind == "sobol":
        from scipy.stats import qmc

        if count & (count - 1):
            raise InputError("--runs", count, f"a power of two, such as {1 << (count.bit_length() - 1)}")
        drawn = qmc.Sobol(2 * keys, scramble=True, seed=seed).random(count)
        first, second = drawn[:, :keys], drawn[:, keys:]
        mixed = [np.where(np.arange(keys) == key, second, first) for key in range(keys)]
        return Design(kind, np.array([first, second, *mixed]), np.zeros((count, 0), int))
    chance = np.random.default_rng(seed)
    order = np.array([chance.permutation(keys) for _ in range(count)])
    upward = chance.random((count, keys)) < 0.5
    start = chance.integers(0, LEVELS // 2, (count, keys)) / (LEVELS - 1.0)
    points = [np.where(upward, start, start + STEP)]
    for step in range(keys):
        changes = np.arange(keys) == order[:, step, None]
        points.append(np.where(changes, np.where(upward, start + STEP, start), points[-1]))
    return Design(kind, np.array(points), order)


def values_of(chosen: Design, varied: Sequence[Variable | Choice]) -> list[list[dict[str, Any]]]:
    """Values of all keys at every point of a design."""
    return [
        [{variable.key: variable.value(float(share)) for variable, share in zip(varied, point)} for point in rows]
        for rows in chosen.points
    ]


def runs_of(values: Sequence[Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """The values of the points of a design, each once: points may coincide."""
    return list({run_name(row): dict(row) for rows in values for row in rows}.values())


class Asked(NamedTuple):
    """What a command asks for."""

    design: Design
    varied: list[Variable | Choice]

    @property
    def runs(self) -> list[dict[str, Any]]:
        """Values of all runs."""
        return runs_of(values_of(self.design, self.varied))


def asked(kind: str, over: Sequence[str], vary: Sequence[str], count: int) -> Asked:
    """The design for the options of a command.

    errors  InputError
    """
    if over or not vary:
        raise InputError("--sensitivity", kind, "used with --vary KEY=LOW..HIGH, without --over")
    varied = factors(vary)
    return Asked(design(kind, count, len(varied)), varied)


# ---------------------------------------------------------------- indices


def sobol_indices(values: Array, errors: Array | float = 0.0) -> tuple[Array, Array]:
    """First-order and total indices (k,), (k,) of values at the points of a design.

    values  (k + 2, n)
    errors  standard errors of the values, of the same shape; 0 for exact ones
    """
    noise = float(np.mean(np.square(errors)))
    centred = values - values[:2].mean()
    first, second, mixed = centred[0], centred[1], centred[2:]
    variance = float(np.mean(centred[:2] ** 2)) - noise
    if variance <= 0.0:
        return np.full(len(mixed), math.nan), np.full(len(mixed), math.nan)
    total = 0.5 * ((first - mixed) ** 2).mean(axis=1) - noise
    return (second * (mixed - first)).mean(axis=1) / variance, total / variance


def effects(values: Array, chosen: Design) -> Array:
    """Elementary effects (k, n) of values (k + 1, n) along the trajectories of a design."""
    per_factor = np.empty((chosen.order.shape[1], chosen.rows))
    for step in range(chosen.order.shape[1]):
        rows, keys = np.arange(chosen.rows), chosen.order[:, step]
        way = chosen.points[step + 1, rows, keys] - chosen.points[step, rows, keys]
        per_factor[keys, rows] = (values[step + 1] - values[step]) / way
    return per_factor


def _sobol_rows(values: Array, errors: Array, chosen: Design) -> list[dict[str, float]]:
    """Indices and their errors by key; of a measure (k + 2, n)."""
    chance, count = np.random.default_rng(1), values.shape[1]
    drawn = chance.integers(0, count, (RESAMPLED, count))
    resampled = np.array([sobol_indices(values[:, rows], errors[:, rows]) for rows in drawn])
    noisy = np.array(
        [sobol_indices(values + errors * chance.normal(size=values.shape), math.sqrt(2.0) * errors) for _ in drawn]
    )
    first, total = sobol_indices(values, errors)
    spread, noise = resampled.std(axis=0), noisy.std(axis=0)
    return [
        {
            "first": float(first[k]), "first_error": float(spread[0, k]), "total": float(total[k]),
            "total_error": float(spread[1, k]), "total_error_of_means": float(noise[1, k]),
        }
        for k in range(len(first))
    ]  # fmt: skip


def _morris_rows(values: Array, errors: Array, chosen: Design) -> list[dict[str, float]]:
    """Elementary effects and their errors by key; of a measure (k + 1, n)."""
    elementary = effects(values, chosen)
    noise = np.hypot(errors[1:], errors[:-1]) / STEP  # of the step, not of the key
    of_key = np.empty_like(elementary)
    for step in range(len(noise)):
        of_key[chosen.order[:, step], np.arange(chosen.rows)] = noise[step]
    count = math.sqrt(chosen.rows)
    size = np.abs(elementary)
    return [
        {
            "effect": float(size[k].mean()), "effect_error": float(size[k].std(ddof=1)) / count,
            "signed_effect": float(elementary[k].mean()), "spread": float(elementary[k].std(ddof=1)),
            "effect_of_noise": float(math.sqrt(2.0 / math.pi) * of_key[k].mean()),
        }
        for k in range(len(elementary))
    ]  # fmt: skip


# ---------------------------------------------------------------- results


@dataclass(frozen=True)
class Sensitivity:
    """How much keys matter for the measures of a sweep.

    kind      of the design
    keys      that were varied
    measures  by name: unit, and for each key a row of numbers
    rows      of the design with all runs finished, of all
    runs      that were made
    """

    kind: str
    keys: list[str]
    measures: dict[str, tuple[str, list[dict[str, float]]]]
    rows: tuple[int, int]
    runs: int

    def summary(self) -> dict[str, Any]:
        """Plain values for JSON."""
        measures = {
            name: {"unit": unit, "keys": [{"key": key, **row} for key, row in zip(self.keys, rows)]}
            for name, (unit, rows) in self.measures.items()
        }
        return {"kind": self.kind, "rows": self.rows[0], "rows_asked": self.rows[1], "measures": measures}

    def lines(self) -> list[str]:
        """The keys by importance for the first measures, as text."""
        out: list[str] = []
        for name in self.shown():
            unit, rows = self.measures[name]
            listed = sorted(zip(self.keys, rows), key=lambda key_and_row: -key_and_row[1][_MAIN[self.kind]])
            out += [
                "",
                f"{name.replace('_', ' ')} [{shown_unit(unit)}]" * (self.kind == "morris") or name.replace("_", " "),
            ]
            out += table(
                [(key, *_cells(row, self.kind)) for key, row in listed], ("", *_HEADINGS[self.kind]), gap=2, indent=2
            )
        missing = self.rows[1] - self.rows[0]
        out += ["", f"{self.rows[0]} of {self.rows[1]} rows, {self.runs} runs"]
        if missing:
            out += [f"{missing} rows are left out, of which a run has failed or is missing"]
        return [*out, *_NOTES[self.kind]]

    def shown(self) -> list[str]:
        """Measures that are printed and drawn."""
        return [name for name in FIRST_SHOWN if name in self.measures] or list(self.measures)[:4]


_MAIN = {"sobol": "total", "morris": "effect"}
_HEADINGS = {
    "sobol": ("alone", "with interactions", "error by means"),
    "morris": ("effect", "signed", "spread", "of noise alone"),
}
_NOTES = {
    "sobol": ["shares of the variance; errors are standard errors from the rows, the last from the errors of means"],
    "morris": ["change over the whole range of a key; a spread as large as the effect: curved, or with interactions"],
}


def _cells(row: Mapping[str, float], kind: str) -> tuple[str, ...]:
    if kind == "sobol":
        pairs = ((row[name], row[f"{name}_error"]) for name in ("first", "total"))
        return (*(f"{value:.3f} +- {error:.2g}" for value, error in pairs), f"{row['total_error_of_means']:.2g}")
    first = f"{row['effect']:.4g} +- {row['effect_error']:.2g}"
    return first, *(f"{row[name]:.3g}" for name in ("signed_effect", "spread", "effect_of_noise"))


def sensitivity(chosen: Design, varied: Sequence[Variable | Choice], outcomes: Sequence[Outcome]) -> Sensitivity:
    """The sensitivity of all measures of the runs at the points of a design.

    outcomes  of the runs of `runs_of`, in any order
    errors    InputError where too few rows have finished
    """
    by_name = {run_name(outcome.values): outcome for outcome in outcomes}
    names = [[run_name(point) for point in rows] for rows in values_of(chosen, varied)]
    finished = np.array(
        [[bool(by_name[name].measures) if name in by_name else False for name in rows] for rows in names]
    )
    whole = np.all(finished, axis=0)
    if whole.sum() < FEWEST:
        limit = f"at least {FEWEST} rows of {chosen.rows} with all runs finished"
        raise InputError("--sensitivity", int(whole.sum()), limit, "more --runs, or narrower ranges")
    kept = Design(chosen.kind, chosen.points[:, whole], chosen.order[whole])
    places = np.flatnonzero(whole).tolist()
    points = [[by_name[rows[place]] for place in places] for rows in names]
    common = [
        name for name in points[0][0].measures if all(name in outcome.measures for rows in points for outcome in rows)
    ]
    measures: dict[str, tuple[str, list[dict[str, float]]]] = {}
    for name in common:
        means = np.array([[outcome.measures[name][:2] for outcome in rows] for rows in points], float)
        values, errors = means[..., 0], np.nan_to_num(means[..., 1], nan=0.0)
        if not np.isfinite(values).all() or np.ptp(values) <= 1e-12 * np.abs(values).max():
            continue
        rows = (_sobol_rows if kept.kind == "sobol" else _morris_rows)(values, errors, kept)
        measures[name] = points[0][0].measures[name][2], rows
    return Sensitivity(
        kept.kind, [factor.key for factor in varied], measures, (int(whole.sum()), chosen.rows), len(by_name)
    )


def write_results(sensitivity: Sensitivity, folder: Path) -> None:
    """Write `sensitivity.csv`, one row for each measure and key, and `sensitivity.png`."""
    from cfddem.plotting.study_figures import sensitivity_figure

    with (folder / "sensitivity.csv").open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        first = next(iter(sensitivity.measures.values()), ("", [{}]))[1][0]
        out.writerow(["measure", "unit", "key", *first])
        for name, (unit, rows) in sensitivity.measures.items():
            for key, row in zip(sensitivity.keys, rows):
                out.writerow([name, shown_unit(unit), key, *(f"{number:.6g}" for number in row.values())])
    sensitivity_figure(sensitivity, folder / "sensitivity.png")
