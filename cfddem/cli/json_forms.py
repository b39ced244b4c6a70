"""Forms of what commands print with `--json`: names and types of each object, from which JSON schemas are made."""

from __future__ import annotations

from typing import Any, Literal, NotRequired

from typing_extensions import TypedDict

Number = float | None
"""A number; null where it is not known, not finite, or has no meaning."""

# ---------------------------------------------------------------- parts


class Quantity(TypedDict):
    """A number of a pre-run check."""

    value: Number
    unit: str
    note: str


class Issue(TypedDict):
    """An error, warning or note of a pre-run check, with the key of the case."""

    severity: Literal["error", "warning", "note"]
    key: str
    reason: str
    remedy: str
    in_report: bool


class Mistake(TypedDict):
    """An error. For wrong input, also where it is, what is wrong, its limit, and what to do."""

    message: str
    place: NotRequired[str]
    key: NotRequired[str]
    value: NotRequired[str]
    limit: NotRequired[str]
    remedy: NotRequired[str]


class KeyResult(TypedDict):
    """A quantity that a reader asks for first. `holds`: as expected, not so, or null without an expectation."""

    name: str
    value: Number | str
    error: Number
    unit: str
    verdict: str
    holds: bool | None
    error_is_lower_bound: bool


class Measure(TypedDict):
    """Mean of a measure over the averaging window, with its standard error and its drift."""

    mean: Number
    error: Number
    error_is_lower_bound: bool
    unit: str
    meaning: str
    drift: Number
    drift_error: Number
    drift_times: tuple[Number, Number]
    stationary: bool | None
    inlet_changes: str


class Law(TypedDict):
    """A value of a run beside that of a published law."""

    law: str
    computed: Number
    expected: Number
    ratio: Number
    unit: str
    outside_range: str


class EnergyLine(TypedDict):
    """A line of the energy budget."""

    group: str
    name: str
    energy: Number
    fraction: Number


class Citation(TypedDict):
    """A law that a run has used."""

    kind: str
    name: str
    reference: str


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

    schema: str
    cases: list[GalleryCase]


class Written(TypedDict):
    """`new NAME`, `view`, `export`, `sweep --write-jobs`: the files that were written."""

    schema: str
    files: list[str]


class CheckOutput(TypedDict):
    """`check`: status, issues, and numbers by group and name."""

    schema: str
    case: str
    status: Literal["ok", "warning", "error"]
    issues: list[Issue]
    numbers: dict[str, dict[str, Quantity]]


class Stability(TypedDict):
    """`stability`: the uniform bed, and its waves."""

    schema: str
    voidage: float
    slip: float
    kernel: float
    added_mass: float
    granular_temperature: float
    height: Number
    cell: float
    waves: list[Wave]
    fastest: FastestWave


class ReportOutput(TypedDict):
    """`run`, `resume`, `report`: the report of a run."""

    schema: str
    case: str
    folder: str
    status: str
    message: str
    window: tuple[float, float]
    films: str
    key_results: list[KeyResult]
    measures: dict[str, Measure]
    measured: list[dict[str, Any]]
    laws: list[Law]
    laws_note: str
    ledger: dict[str, Number]
    energy: dict[str, Number]
    energy_lines: list[EnergyLine]
    collisions: dict[str, Number]
    impacts: dict[str, Number]
    film_solution: dict[str, Number]
    warnings: list[str]
    actions: dict[str, list[str]]
    wall_time: dict[str, float]
    steps: dict[str, Number]
    preflight: dict[str, Any]
    provenance: dict[str, Any]
    references: list[Citation]


class Comparison(TypedDict):
    """`compare`: several runs, the first of which is the reference."""

    schema: str
    runs: list[dict[str, Any]]
    changed: dict[str, list[Any]]
    key_results: dict[str, list[Any]]
    measures: dict[str, dict[str, Any]]
    page: str


class Sweep(TypedDict):
    """`sweep`: its runs; with `--sensitivity`, how much each key matters for each measure."""

    schema: str
    folder: str
    runs: list[SweepRun]
    sensitivity: SensitivityPart | None


class CalibrationOutput(TypedDict):
    """`calibrate`: estimates of the varied keys."""

    schema: str
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

    schema: str
    holds: bool
    targets: list[Target]


class Benchmark(TypedDict):
    """`bench`: what was measured, which depends on the target."""

    schema: str
    target: str
    result: Any


class Explanation(TypedDict):
    """`explain`: laws, keys of a case, and what a table does not have."""

    schema: str
    laws: list[LawPage]
    keys: list[KeyPage]
    not_there: str


class Doctor(TypedDict):
    """`doctor`: checks of the machine."""

    schema: str
    ok: bool
    checks: list[Check]


class Collision(TypedDict):
    """`collide` at one Stokes number; `stokes` is null for a dry collision."""

    schema: str
    stokes: Number
    velocity: float
    viscosity: float
    outcome: Literal["no_touch", "touch_no_rebound", "rebound"]
    restitution: Number
    restitution_tangential: Number
    rebound_angle_striker: Number
    rebound_angle_relative: Number
    minimum_gap: float
    mechanism: str
    friction_used: Number
    stop_gap: Number
    spin: tuple[float, float]
    warnings: list[str]


class Collisions(TypedDict):
    """`collide` over a range of Stokes numbers; each collision as in `collide`, without `schema`."""

    schema: str
    collisions: list[dict[str, Any]]


class MeasuredCollisions(TypedDict):
    """`collide --data`: how well computed collisions agree with measured points."""

    schema: str
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


class WetWall(TypedDict):
    """`wet-wall`."""

    schema: str
    outcome: Literal["rebound", "stick"]
    restitution: Number
    restitution_tangential: Number
    restitution_rotational: Number
    spin: Number
    energy_lost: dict[str, Number]
    half_filling_angle: Number
    friction: Number
    contact_speed: Number
    bridge_volume: Number
    rupture_length: Number
    duration: Number
    warnings: list[str]


class WetPair(TypedDict):
    """`wet-pair`."""

    schema: str
    outcome: Literal["bounce", "stick_rotate_separate", "stick"]
    restitution: Number
    spin: Number
    separation_time: Number
    minimum_gap: Number
    velocity: Number
    turned: Number
    warnings: list[str]


class ThreeSpheres(TypedDict):
    """`three-spheres`: times over (film / impact speed), `time_star` over (diameter / impact speed)."""

    schema: str
    outcome: str
    restitution12: Number
    restitution23: Number
    contacts: dict[str, int]
    events: list[dict[str, Any]]


class FilmImpact(TypedDict):
    """`film-impact`."""

    schema: str
    outcome: Literal["rebound", "stick"]
    restitution: Number
    stokes: Number
    film_ratio: float
    added_mass: float
    minimum_gap: Number
    p1: dict[str, Number]
    p2: dict[str, Number]
    p3: dict[str, Number]
    p4: dict[str, Number]
    turned_speed: Number
    turning_energy: tuple[Number, Number]
    fastest: Number
    energies: dict[str, Number]
    ledger_error: Number
    volume_error: Number
    momentum_error: Number
    lowest_pressure: Number
    highest_pressure: Number
    wetted_radius: Number
    mass_carried: Number
    contacts: int
    steps: int
    cells: int
    seconds: float
    warnings: list[str]


class Failure(TypedDict):
    """Any command that fails: its exit code, and all errors, as on the standard error output."""

    schema: str
    exit_code: int
    errors: list[Mistake]


SCHEMAS: dict[str, tuple[int, Any]] = {
    "error": (1, Failure),
    "gallery": (1, Gallery),
    "written": (1, Written),
    "check": (1, CheckOutput),
    "stability": (1, Stability),
    "report": (1, ReportOutput),
    "compare": (1, Comparison),
    "sweep": (1, Sweep),
    "calibrate": (1, CalibrationOutput),
    "collide": (1, Collision),
    "collide-range": (1, Collisions),
    "collide-data": (1, MeasuredCollisions),
    "wet-wall": (1, WetWall),
    "wet-pair": (1, WetPair),
    "three-spheres": (1, ThreeSpheres),
    "film-impact": (1, FilmImpact),
    "validate": (1, Validation),
    "bench": (1, Benchmark),
    "explain": (1, Explanation),
    "doctor": (1, Doctor),
}
"""Version and form of each schema."""
