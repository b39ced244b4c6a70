"""What commands print with `--json`: one object, whose `schema` names its form and the number of its version.

The number rises when a name goes or gets another meaning; new names may come without. Units are SI.

A schema is made from a form, names and types of the object. A result that is a dataclass and prints all its values has
the form of the dataclass, see :func:`form_of`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import reduce
from importlib import import_module
from operator import or_
from types import UnionType
from typing import Any, Literal, NotRequired, get_args, get_origin, get_type_hints

from typing_extensions import TypedDict

from cfddem.backend.errors import CfddemError, InputError, nearest
from cfddem.backend.json_text import as_json
from cfddem.preflight.issue import Issue

Number = float | None
"""A number; null where it is not known, not finite, or has no meaning."""

# ---------------------------------------------------------------- parts


class Quantity(TypedDict):
    """A number of a pre-run check."""

    value: Number
    unit: str
    note: str


class Mistake(TypedDict):
    """An error. For wrong input, also where it is, what is wrong, its limit, and what to do."""

    message: str
    place: NotRequired[str]
    key: NotRequired[str]
    value: NotRequired[str]
    limit: NotRequired[str]
    remedy: NotRequired[str]


class GalleryCase(TypedDict):
    """A case of the gallery."""

    name: str
    title: str


class Wave(TypedDict):
    """A wave: growth by theory, on the cells of the case, and on cells with agitation."""

    wavelength: float
    speed: float
    growth: float
    on_cells: float
    agitated: float


class FastestWave(TypedDict):
    """The wave that grows fastest on the cells."""

    wavelength: float
    speed: float
    growth: float
    amplification: Number


class Mean(TypedDict):
    """Mean of a measure of a run of a sweep; null without an error."""

    mean: Number
    error: Number
    unit: str


class SweepRun(TypedDict):
    """A run of a sweep."""

    folder: str
    values: dict[str, Any]
    status: Literal["finished", "failed", "stopped", "refused", "waiting"]
    message: str
    measures: dict[str, Mean]
    seconds: float
    kept: bool
    drifting: list[str]  # measures whose means are not stationary


class SensitiveMeasure(TypedDict):
    """How much each key matters for a measure: `first` and `total` (sobol), or `effect` (morris), with errors."""

    unit: str
    keys: list[dict[str, Any]]


class SensitivityPart(TypedDict):
    """How much keys matter."""

    kind: Literal["sobol", "morris"]
    rows: int
    rows_asked: int
    measures: dict[str, SensitiveMeasure]


class LawPage(TypedDict):
    """Documentation of a law."""

    name: str
    kind: str
    sentence: str
    equation: str | None
    arguments: list[str]
    ranges: dict[str, tuple[float, float]]
    reference: str
    module: str


class KeyPage(TypedDict):
    """Documentation of a key of a case. Parts in capitals, such as NAME, stand for names or numbers."""

    key: str
    required: bool
    default: Any
    meaning: str
    unit: str | None
    choices: list[str]


class Check(TypedDict):
    """Result of a check of the machine."""

    name: str
    ok: bool
    text: str


class Target(TypedDict):
    """Comparisons of a target of the validation."""

    target: str
    holds: bool
    seconds: float
    versions: dict[str, str]
    rows: list[dict[str, Any]]


# ---------------------------------------------------------------- one for each schema


class Gallery(TypedDict):
    """`new` without a name: the gallery."""

    cases: list[GalleryCase]


class Written(TypedDict):
    """`new NAME`, `view`, `export`, `sweep --write-jobs`: the files that were written."""

    files: list[str]


class CheckOutput(TypedDict):
    """`check`: status, issues, and numbers by group and name."""

    case: str
    status: Literal["ok", "warning", "error"]
    issues: list[Issue]
    numbers: dict[str, dict[str, Quantity]]


class Stability(TypedDict):
    """`stability`: the uniform bed, and its waves."""

    voidage: float
    slip: float
    kernel: float
    added_mass: float
    granular_temperature: float
    height: Number
    cell: float
    waves: list[Wave]
    fastest: FastestWave


class Comparison(TypedDict):
    """`compare`: several runs, the first of which is the reference."""

    runs: list[dict[str, Any]]
    changed: dict[str, list[Any]]
    key_results: dict[str, list[Any]]
    measures: dict[str, dict[str, Any]]
    page: str


class Sweep(TypedDict):
    """`sweep`: its runs; with `--sensitivity`, how much each key matters for each measure."""

    folder: str
    runs: list[SweepRun]
    sensitivity: SensitivityPart | None


class CalibrationOutput(TypedDict):
    """`calibrate`: estimates of the varied keys."""

    folder: str
    estimates: list[dict[str, Any]]
    chi2: Number
    verdict: str
    best: dict[str, Any] | None
    trials: int
    failed: int
    data: list[dict[str, Any]]


class Validation(TypedDict):
    """`validate`: comparisons with published results."""

    holds: bool
    targets: list[Target]


class Benchmark(TypedDict):
    """`bench`: what was measured, which depends on the target."""

    target: str
    result: Any


class Explanation(TypedDict):
    """`explain`: laws, keys of a case, and what a table does not have."""

    laws: list[LawPage]
    keys: list[KeyPage]
    not_there: str


class Doctor(TypedDict):
    """`doctor`: checks of the machine."""

    ok: bool
    checks: list[Check]


class Collisions(TypedDict):
    """`collide` over a range of Stokes numbers; each collision as in `collide`, without `schema`."""

    collisions: list[dict[str, Any]]


class MeasuredCollisions(TypedDict):
    """`collide --data`: how well computed collisions agree with measured points."""

    name: str
    quantity: str
    unit: str
    against: str
    points: int
    outside: int
    bias: Number
    rms: Number
    relative_rms: Number
    chi2: Number
    errors: Number
    holds: bool | None
    verdict: str
    figure: str


class ThreeSpheres(TypedDict):
    """`three-spheres`: times over (film / impact speed), `time_star` over (diameter / impact speed)."""

    outcome: str
    restitution12: Number
    restitution23: Number
    contacts: dict[str, int]
    events: list[dict[str, Any]]


class Failure(TypedDict):
    """Any command that fails: its exit code, and all errors, as on the standard error output."""

    exit_code: int
    errors: list[Mistake]


SCHEMAS: dict[str, tuple[int, Any]] = {
    "error": (1, Failure),
    "gallery": (1, Gallery),
    "written": (1, Written),
    "check": (1, CheckOutput),
    "stability": (1, Stability),
    "report": (1, "cfddem.analysis.report_text:Report"),
    "compare": (1, Comparison),
    "sweep": (1, Sweep),
    "calibrate": (1, CalibrationOutput),
    "collide": (1, "scenarios.collisions.immersed_pair.study:Collision"),
    "collide-range": (1, Collisions),
    "collide-data": (1, MeasuredCollisions),
    "wet-wall": (1, "scenarios.collisions.wet_wall.study:Impact"),
    "wet-pair": (1, "scenarios.collisions.wet_pair.study:WetPair"),
    "three-spheres": (1, ThreeSpheres),
    "film-impact": (1, "scenarios.collisions.film_impact.result:FilmImpact"),
    "validate": (1, Validation),
    "bench": (1, Benchmark),
    "explain": (1, Explanation),
    "doctor": (1, Doctor),
}
"""Version and form of each schema, or the module and name of the dataclass that has it."""


def form(name: str) -> Any:
    """The form of a schema: that of its results, and the word `schema` itself."""
    source = SCHEMAS[name][1]
    if not isinstance(source, str):
        typed = TypedDict(source.__name__, {"schema": str, **get_type_hints(source, include_extras=True)})  # type: ignore[misc]
        typed.__doc__ = source.__doc__
        return typed
    module, _, kind = source.partition(":")
    return form_of(getattr(import_module(module), kind), {"schema": str})


def form_of(kind: Any, more: dict[str, Any] | None = None) -> Any:
    """The form of a dataclass or named tuple as JSON: its values that `repr` shows, where NaN is null.

    more  further names and types
    """
    shown = {field.name for field in fields(kind) if field.repr} if is_dataclass(kind) else set(kind._fields)
    hints = {name: _in_json(hint) for name, hint in get_type_hints(kind).items() if name in shown}
    typed = TypedDict(kind.__name__, {**(more or {}), **hints})  # type: ignore[misc]
    typed.__doc__ = kind.__doc__
    return typed


def _in_json(hint: Any) -> Any:
    """A type as JSON has it."""
    if hint is float:
        return Number
    if is_dataclass(hint) or hasattr(hint, "_fields"):
        return form_of(hint)
    inner = tuple(_in_json(argument) if argument is not Ellipsis else argument for argument in get_args(hint))
    origin = get_origin(hint)
    if origin is UnionType:
        return reduce(or_, inner)
    return origin[inner] if origin in (list, dict, tuple) else hint


def word(name: str) -> str:
    """The value of `schema` in an object.

    >>> word("check")
    'cfddem/check/1'
    """
    return f"cfddem/{name}/{SCHEMAS[name][0]}"


def json_schema(name: str) -> dict[str, Any]:
    """The JSON schema of what commands print with `--json`.

    errors  InputError for an unknown name
    """
    if name not in SCHEMAS:
        raise InputError("name", name, nearest(name, ["case", *SCHEMAS]))
    from pydantic import TypeAdapter

    schema = TypeAdapter(form(name)).json_schema()
    schema["properties"]["schema"] |= {"const": word(name)}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": word(name)} | schema


_printed = False
"""Whether the command has printed its object."""


def begin() -> None:
    """A command begins: it has not printed anything."""
    global _printed
    _printed = False


def print_json(name: str, value: Mapping[str, Any]) -> None:
    """Print a result in the form of a schema."""
    global _printed
    _printed = True
    print(as_json({"schema": word(name), **value}))


def asked_for_json() -> bool:
    """Whether the command line has `--json`."""
    return "--json" in sys.argv[1:]


def print_failure(message: str, code: int, failure: BaseException | None = None) -> None:
    """Print an error as JSON, unless the command has printed its result, and failed after that.

    message  one error in each line
    failure  the error itself, if it is known
    """
    if not _printed:
        print_json("error", {"exit_code": code, "errors": list(_mistakes(message, failure))})


def _mistakes(message: str, failure: BaseException | None) -> Iterator[Mistake]:
    issues = getattr(failure, "issues", ())
    if issues:  # of a case with errors in its check
        for issue in issues:
            yield {"message": str(issue), "key": issue.key, "limit": issue.reason, "remedy": issue.remedy}
        return
    errors: tuple[CfddemError, ...] = getattr(failure, "errors", (failure,) if isinstance(failure, InputError) else ())
    if not errors:
        for line in message.splitlines():
            yield {"message": line}
    for error in errors:
        mistake: Mistake = {"message": str(error)}
        if isinstance(error, InputError):
            place, _, key = error.field.rpartition(" ")  # such as "bed.toml:14: " and "--set "
            value = "" if error.value is None else str(error.value)
            mistake |= {
                "place": place.rstrip(":"), "key": key, "value": value, "limit": error.limit, "remedy": error.remedy,
            }  # fmt: skip
        yield mistake
