"""The pre-run check: estimates for a run, with errors and warnings.

It uses correlations only: nothing is compiled, poured or allocated, so that it takes a fraction of a second.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from traceback import extract_tb
from typing import Any, Literal

import numpy as np

from cfddem.backend import html
from cfddem.backend.errors import CfddemError, InputError
from cfddem.backend.tables import line_width
from cfddem.case.schema import Case, require_case
from cfddem.fluid.cell_counts import cell_counts
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.checks import find_issues
from cfddem.preflight.collision_estimate import estimate_collision, estimate_wet, pair_row, reduced
from cfddem.preflight.flow_checks import suggested_cell
from cfddem.preflight.geometry_checks import check_length, check_particle_size, fits
from cfddem.preflight.issue import ORDER, Issue, Severity
from cfddem.preflight.overview import Row, overview
from cfddem.preflight.step_estimate import estimate_cost, estimate_steps
from closures import registry
from closures.check import check as check_law

LARGEST, SMALLEST = 1e20, 1e-30
"""Magnitudes of values of a case beyond which estimates overflow, or say nothing; 0 and seeds are free."""

USUAL = 1e-12, 1e12
"""Magnitudes of values that upset no estimate."""

_EXTREME, _UNITS = "too large or too small for the correlations", "give all values in SI units: m, kg, s, Pa"


class PreflightError(CfddemError):
    """A case with errors in its pre-run check."""

    exit_code = 2
    issues: tuple[Issue, ...] = ()


@dataclass(frozen=True)
class Preflight:
    """Result of the pre-run check: numbers, errors and warnings."""

    title: str
    rows: tuple[Row, ...]
    issues: tuple[Issue, ...]

    @property
    def status(self) -> Literal["ok", "warning", "error"]:
        """Severity of the worst error or warning; ok if there is none."""
        severities = {issue.severity for issue in self.issues}
        return "error" if "error" in severities else "warning" if "warning" in severities else "ok"

    @property
    def to_act_on(self) -> tuple[Issue, ...]:
        """Errors and warnings; notes need no action."""
        return tuple(issue for issue in self.issues if issue.severity != "note")

    def with_errors(self, errors: Iterable[Issue]) -> Preflight:
        """The result with further errors."""
        return replace(self, issues=(*errors, *self.issues))

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def summary(self) -> dict[str, Any]:
        """Plain values: status, issues, and the numbers by group and name."""
        groups: dict[str, dict[str, Any]] = {}
        for row in self.rows:
            value = row.value if math.isfinite(row.value) else None
            groups.setdefault(row.group, {})[row.name] = {"value": value, "unit": row.unit, "note": row.note}
        issues = [asdict(issue) for issue in self.issues]
        return {"case": self.title, "status": self.status, "issues": issues, "numbers": groups}

    def lines(self) -> list[str]:
        """The whole result as text, at most 100 columns wide."""
        out, group = [textwrap.shorten(self.title, line_width(), placeholder=" ...")], ""
        for row in self.rows:
            if row.group != group:
                group = row.group
                out += ["", group.capitalize()]
            out += row.lines()
        return [*out, "", *self.issue_lines()]

    def _repr_html_(self) -> str:
        """All numbers, errors and warnings, in a notebook."""
        issues: list[tuple[str, ...]] = [
            (issue.severity, issue.key, issue.reason, issue.remedy) for issue in self.issues
        ]
        numbers: list[tuple[str, ...]] = [(row.name, f"{row.value:.4g}", row.unit, row.note) for row in self.rows]
        return html.table(f"{self.title}: {self.status}", issues + numbers)

    def issue_lines(self) -> list[str]:
        """Errors, warnings and notes as text, at most 100 columns wide."""
        lines = [line for issue in self.issues for line in issue.lines()]
        return [*lines, "ok: no errors, no warnings"] if self.status == "ok" else lines


def preflight(case: Case) -> Preflight:
    """Check a case before it runs.

    >>> result = preflight(Case(
    ...     fluid=dict(density=998.0, viscosity=1e-3),
    ...     material=dict(glass=dict(density=2540.0, youngs_modulus=60e9, contact_modulus=1e7, poisson=0.23)),
    ...     column=dict(width=0.02, height=0.12, cell=0.005),
    ...     bed=dict(diameter=2e-3, count=2000, inlet_velocity=0.05),
    ...     run=dict(until=2.0),
    ... ))
    >>> result.status, [round(row.value, 3) for row in result.rows if row.name.startswith("u / ")]
    ('ok', [1.867, 0.185])
    """
    require_case(case)
    title = case.title or "case without a title"
    with np.errstate(all="ignore"):  # values that overflow are reported below
        return _preflight(case, title)


def _preflight(case: Case, title: str) -> Preflight:
    if case.laws.missing:
        words = "; ".join(f"law {name} is not installed here: no prediction" for name in case.laws.missing.values())
        return Preflight(title, (), (Issue("warning", "laws", words, "install the package that provides it"),))
    key, value = most_extreme(case)
    if not SMALLEST <= abs(value) <= LARGEST:
        return Preflight(title, (), (Issue("error", key, f"{value:g} is {_EXTREME}", _UNITS),))
    own = list(check_own_laws(case))
    if any(issue.severity == "error" for issue in own):
        return Preflight(title, (), tuple(own))
    try:
        cell_counts(case.column.size, case.column.cell)  # also of a dry case, whose history is kept by cells
        bed = estimate_bed(case)
        collision = estimate_collision(case, bed)
        wet = estimate_wet(case, collision)
        steps = estimate_steps(case, bed)
        cost = estimate_cost(case, bed, steps)
        issues = find_issues(case, bed, collision, wet, steps, cost)
        if case.bed.height is not None and case.bed.height > case.column.height:  # its weight and count mean nothing
            return Preflight(title, (), tuple(issue for issue in issues if issue.key == "bed.height"))
        issues = sorted([*issues, *own], key=lambda issue: ORDER.index(issue.severity))
        rows = overview(case, bed, collision, wet, steps, cost) if fits(case) else ()  # else they mean nothing
        return Preflight(title, rows, tuple(issues))
    except InputError as failure:
        reason = f"{'' if failure.value is None else f'{failure.value!r} '}must be {failure.limit}"
        key = failure.field.replace("grid.", "column.")
        remedy = suggested_cell(case) if key == "column.cell" else failure.remedy or "change it"
        return Preflight(title, (), (Issue("error", key, reason, remedy),))
    except (ArithmeticError, ValueError) as failure:
        if not fits(case):  # a length in mm upsets the estimates
            return Preflight(title, (), tuple(check_length(case, refused=True) or check_particle_size(case)))
        key, value = most_extreme(case)
        if USUAL[0] <= abs(value) <= USUAL[1]:  # as a shape or a table of the user can do
            at = [frame for frame in extract_tb(failure.__traceback__) if "numpy" not in Path(frame.filename).parts][-1]
            reason = f"the check fails in {at.filename}:{at.lineno}: {type(failure).__name__}: {failure}"
            return Preflight(title, (), (Issue("error", "case", reason, "see what Python code of yours returns"),))
        return Preflight(title, (), (Issue("error", key, f"{value:g} is {_EXTREME}", _UNITS),))


@contextmanager
def refused_extremes(case: Case) -> Iterator[None]:
    """Refuse a case whose values overflow in the estimates inside a `with` block.

    errors  InputError
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except CfddemError:
        raise
    except (ArithmeticError, ValueError):
        key, value = most_extreme(case)
        raise InputError(key, value, f"a value that is not {_EXTREME}", _UNITS) from None


def most_extreme(case: Case) -> tuple[str, float]:
    """Key and value of the number of a case whose decimal logarithm is the largest in magnitude.

    >>> most_extreme(Case(
    ...     material=dict(glass=dict(density=1e300, youngs_modulus=60e9, poisson=0.23)),
    ...     column=dict(width=0.02, height=0.12, cell=0.005), bed=dict(diameter=2e-3, count=2), run=dict(until=2.0),
    ... ))
    ('material.glass.density', 1e+300)
    """
    numbers = [
        (key, value) for key, value in _numbers(case.model_dump(), ()) if value != 0.0 and not key.endswith("seed")
    ]
    return max(numbers, key=lambda key_and_value: abs(math.log10(abs(key_and_value[1]))))


def _numbers(values: Any, key: tuple[str, ...]) -> Iterator[tuple[str, float]]:
    """Every number of nested values, with its key."""
    if isinstance(values, Mapping):
        for name, value in values.items():
            yield from _numbers(value, (*key, str(name)))
    elif isinstance(values, list | tuple):
        for number, value in enumerate(values):
            if not (isinstance(value, float) and abs(value) < SMALLEST):  # a component is 0 up to rounding
                yield from _numbers(value, (*key, str(number)) if isinstance(value, Mapping) else key)
    elif isinstance(values, int | float) and not isinstance(values, bool):
        yield ".".join(key), float(values) if abs(values) < 10**308 else math.inf


def refuse_errors(case: Case) -> Preflight:
    """Result of the pre-run check of a case without errors.

    Raises PreflightError with all errors otherwise.
    """
    result = preflight(case)
    errors = tuple(issue for issue in result.issues if issue.severity == "error")
    if errors:
        failure = PreflightError("\n".join(map(str, errors)))
        failure.issues = errors
        raise failure
    return result


# ---------------------------------------------------------------- laws of a user


FATAL = ("fails", "cannot be compiled", "takes", "does not take", "returns", "is nan", "is inf", "is -inf", "is not")
"""How problems begin with which a law cannot be used in a run."""


def check_own_laws(case: Case) -> Iterator[Issue]:
    """Check the laws of a case that are not built in against the requirements of their kinds."""
    for kind, law in case.laws.own_laws.items():
        for problem in _problems(law.function):
            fatal = problem.startswith(FATAL) or "must be positive" in problem
            remedy = "correct it, or state the range for which it holds" if fatal else "see closures.check"
            yield Issue("error" if fatal else "warning", f"laws.{kind}", f"{law.name} {problem}", remedy)
    contact = case.laws.contact_law
    if not contact.force.__module__.startswith("cfddem."):
        species = next(iter(case.species.values()))
        mass, radius = reduced(case, species, species.diameter)
        for fatal, problem in contact.problems(mass, radius, pair_row(case, species)):
            severity: Severity = "error" if fatal else "warning"
            yield Issue(severity, "laws.contact", f"{contact.name}: {problem}", "correct the functions of the law")
    for name, reason in registry.load_package_laws().items():
        yield Issue("warning", "laws", f"the package {name} could not be loaded: {reason}", "correct or remove it")


@lru_cache(maxsize=64)
def _problems(law: Callable[..., float]) -> tuple[str, ...]:
    """What the check finds; a law is compiled once for it."""
    return tuple(check_law(law))
