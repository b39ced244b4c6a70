"""Sweeps: run one case for many values of some keys; one folder per run, one table, one figure; or a job array.

A stopped sweep can be continued: finished runs are kept, incomplete runs are resumed. A run that fails
is listed at the end; the others are kept.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
import shlex
import sys
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cfddem.backend.errors import CfddemError, InputError, RunStopped, library
from cfddem.backend.launch import safe_workers
from cfddem.backend.law_choice import import_laws, imported_laws
from cfddem.case.compare import Points, points_of
from cfddem.case.gallery import full_key, read_value
from cfddem.case.input_errors import field_of
from cfddem.case.schema import Case
from cfddem.io.files import require_no_links
from cfddem.io.folder import holds_surfaces_of, text_with_kept_files
from cfddem.io.quantities import shown_unit
from cfddem.preflight.summary import preflight

if TYPE_CHECKING:
    import pandas


Over = Mapping[str, Sequence[Any]] | Sequence[Mapping[str, Any]]
"""Values by key, of which all combinations are run; or sets of values."""

PUBLISHED = "voidage by "
"""Beginning of the names of voidages by published laws, which stand beside the measures of a run."""

LONGEST_NAME = 120
"""Most characters of the name of a run; longer ones end in a number of their own."""

MOST_NAMES = 3
"""Measures that a message names."""

MOST = 10_000
"""Largest number of runs."""


@dataclass(frozen=True)
class Outcome:
    """The result of one run."""

    folder: str
    values: dict[str, Any]  # of the changed keys
    status: str  # finished, failed, stopped, refused (before it began) or waiting
    message: str = ""
    measures: dict[str, tuple[float, float, str]] = field(default_factory=dict)  # mean, error, unit
    seconds: float = 0.0
    kept: bool = False  # it was finished before this sweep
    drifting: tuple[str, ...] = ()  # measures whose means are not stationary

    @property
    def name(self) -> str:
        """Name of the run."""
        return Path(self.folder).name

    def summary(self) -> dict[str, Any]:
        """Plain values for JSON."""
        measures = {name: dict(zip(("mean", "error", "unit"), numbers)) for name, numbers in self.measures.items()}
        return asdict(self) | {"measures": measures}


def ranges(texts: Sequence[str]) -> dict[str, list[Any]]:
    """Keys and their values from texts such as `fluid.viscosity=1e-3,2e-3` and `seed=1..5`.

    errors  InputError for an unknown key, a key without values or too many runs

    >>> ranges(["viscosity=1e-3,2e-3", "seed=1..3", "laws.drag=wen_yu,di_felice"])
    {'fluid.viscosity': [0.001, 0.002], 'bed.seed': [1, 2, 3], 'laws.drag': ['wen_yu', 'di_felice']}
    """
    by_key: dict[str, list[Any]] = {}
    for entry in texts:
        key, equals, text = entry.partition("=")
        if not equals or not text.strip():
            raise InputError("--over", entry, "key=value,value,... or key=first..last, such as seed=1..5")
        key = full_key(key.strip())
        if key in by_key:
            raise InputError("--over", key, "given once")
        span = re.fullmatch(r"\s*(-?\d{1,9})\.\.(-?\d{1,9})\s*", text)
        values = list(range(int(span[1]), int(span[2]) + 1)) if span else _values(text)
        if not values:
            raise InputError("--over", entry, "a range of at least one number, smaller first")
        by_key[key] = values
    count = math.prod(len(values) for values in by_key.values())
    if not by_key or count > MOST:
        raise InputError("--over", None, f"given, for at most {MOST} runs", f"here {count if by_key else 0}")
    return by_key


def _values(text: str) -> list[Any]:
    """Values separated by commas, which may be lists in brackets."""
    whole = read_value(f"[{text}]")
    return whole if isinstance(whole, list) else [read_value(part.strip()) for part in text.split(",")]


def run_name(values: Mapping[str, Any]) -> str:
    """Name of a run: last words of the keys, and values.

    >>> run_name({"fluid.viscosity": 0.001, "bed.seed": 2})
    'viscosity-0.001_seed-2'
    """
    parts = [f"{key.split('.')[-1]}-{value}" for key, value in values.items()]
    name = re.sub(r"[^\w.+-]+", "-", "_".join(parts)).strip("-")
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 9]}-{zlib.crc32(name.encode()):08x}"


def sweep(
    path: Path,
    over: Over,
    output: Path,
    *,
    overrides: Mapping[str, Any] | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Callable[[Outcome], None] = lambda _: None,
) -> list[Outcome]:
    """Run a case for every combination of values, or for every set of values.

    path       of the case file
    over       values by key, of which all combinations are run; or sets of values
    output     folder of the sweep: one folder per run, `sweep.csv`, `sweep.png`
    overrides  values that all runs share
    jobs       number of concurrent runs; if more than one, each uses one thread
    scheduler  address of a dask scheduler whose workers make the runs, instead of this machine; they need the same
               folders and packages
    progress   called after every run
    returns    outcomes, in the order of the values
    errors     InputError before any run starts
    """
    if jobs < 1:
        raise InputError("--jobs", jobs, "at least 1")
    runs = cases_of(path, over, overrides or {})
    measured = _curves(case for case, _ in runs.values())
    make_output(output)
    place = output.absolute() if scheduler else output  # workers have other working folders
    outcomes: dict[str, Outcome] = {}
    work = [(case, values, place / name, jobs > 1) for name, (case, values) in runs.items()]
    for outcome in on_this_machine(work, jobs) if scheduler is None else _on_workers(work, scheduler):
        outcomes[outcome.name] = outcome
        progress(outcome)
        if outcome.status == "stopped":  # stopping one run stops the sweep
            break
    waiting = "not started; the same command continues the sweep"
    ordered = [
        outcomes.get(name, Outcome(str(output / name), values, "waiting", waiting))
        for name, (_, values) in runs.items()
    ]
    write_table(ordered, output / "sweep.csv")
    _write_figure(ordered, output / "sweep.png", not isinstance(over, Mapping), measured)
    return ordered


def make_output(output: Path) -> None:
    """Make the folder of a sweep if it does not exist."""
    if output.exists() and not output.is_dir():
        raise InputError("output", str(output), "a folder", "a file of that name exists")
    output.mkdir(parents=True, exist_ok=True)
    require_no_links(output)


_Work = list[tuple[Case, dict[str, Any], Path, bool]]
"""Arguments of `_one` for each run."""


def on_this_machine(work: _Work, jobs: int) -> Iterator[Outcome]:
    """Outcomes as runs end, several runs at a time."""
    from joblib import Parallel, delayed

    with safe_workers():
        laws = imported_laws()
        yield from Parallel(n_jobs=jobs, return_as="generator_unordered")(delayed(_one)(*job, laws) for job in work)


def _on_workers(work: _Work, scheduler: str) -> Iterator[Outcome]:
    """Outcomes as runs end on the workers of a dask scheduler, which decide how many run at a time."""
    if find_spec("distributed") is None:
        raise InputError("--scheduler", scheduler, "used with dask", "pip install 'cfddem[cluster]'")
    from distributed import Client, as_completed

    try:
        client = Client(scheduler, timeout=30)
    except (OSError, ValueError) as failure:
        raise InputError(
            "--scheduler", scheduler, "the address of a dask scheduler that answers", str(failure)
        ) from None
    with client:
        laws = imported_laws()
        futures = [client.submit(_one, *job[:3], True, laws, pure=False, retries=1) for job in work]
        for done in as_completed(futures):
            yield done.result()


def cases_of(path: Path, over: Over, overrides: Mapping[str, Any]) -> dict[str, tuple[Case, dict[str, Any]]]:
    """Case and changed values of every run, by its name."""
    runs: dict[str, tuple[Case, dict[str, Any]]] = {}
    for values in _sets(over):
        try:
            case, name = Case.from_toml(path, {**overrides, **values}), run_name(values)
        except InputError as failure:
            key = failure.field.removeprefix("--set ")
            if key == failure.field or not any(f"{key}.".startswith(f"{varied}.") for varied in values):
                raise
            option = "--over" if isinstance(over, Mapping) else "--vary"
            raise InputError(f"{option} {key}", failure.value, failure.limit, failure.remedy) from None
        if name in runs:
            raise InputError("--over", name, "a different name for every run", "a value is given twice")
        runs[name] = case, values
    return runs


def _sets(over: Over) -> Iterator[dict[str, Any]]:
    """Values of every run."""
    if isinstance(over, Mapping):
        for combination in itertools.product(*over.values()):
            yield dict(zip(over, combination))
    else:
        yield from map(dict, over)


def _one(case: Case, values: dict[str, Any], folder: Path, one_thread: bool, laws: Sequence[Path] = ()) -> Outcome:
    """Run or resume one run, or keep it if it is finished; any failure becomes part of the outcome.

    laws  files of the user's laws, for a process that does not know them
    """
    from cfddem.backend.compile import use_threads
    from cfddem.io.reading import open_run
    from cfddem.run.resuming import changed_laws
    from cfddem.run.runner import Run

    begun, kept = time.monotonic(), False
    try:
        import_laws(laws)
        if one_thread:
            use_threads(1)
        checked = preflight(case)
        if checked.status == "error":
            reasons = "; ".join(f"{issue.key}: {issue.reason}" for issue in checked.issues if issue.severity == "error")
            return Outcome(str(folder), values, "refused", reasons)
        if not (folder / "run.json").exists():
            Run.begin(case, folder).go()
        else:
            before = open_run(folder)
            same = _without_data(before.case_text) == _without_data(text_with_kept_files(case))
            if not same or not holds_surfaces_of(case, folder):
                raise InputError("output", str(folder), "a folder of the same case", "choose another folder")
            if changed := changed_laws(before.provenance, case):
                limit = f"a folder of runs with the same laws; the source of laws.{changed[0]} has changed"
                raise InputError("output", str(folder), limit, "choose another folder")
            kept = before.status == "finished"
            if not kept:
                Run.resume(folder).go()
        outcome = Outcome(str(folder), values, open_run(folder).status)
    except CfddemError as failure:
        status = "stopped" if isinstance(failure, RunStopped) else "failed"
        outcome = Outcome(str(folder), values, status, str(failure).replace("\n", "; "))
    except Exception as failure:  # a failed run must not end the sweep
        outcome = Outcome(str(folder), values, "failed", f"{type(failure).__name__}: {failure}")
    return _measured(outcome, time.monotonic() - begun, kept)


def _without_data(text: str) -> Case:
    """A case as a run folder holds it, without measured data, which change nothing in a run."""
    return Case.from_text(text).model_copy(update={"compare": {}})


def _measured(outcome: Outcome, seconds: float, kept: bool) -> Outcome:
    """The outcome with its means, if the run finished."""
    from cfddem.analysis.report import report

    values = asdict(outcome) | {"seconds": seconds, "kept": kept}
    if outcome.status == "finished":
        result = report(Path(outcome.folder))
        means = {name: (measure.mean, measure.error, measure.unit) for name, measure in result.measures.items()}
        if "rate" in result.impacts:
            means["collision_rate"] = (result.impacts["rate"], math.nan, "1/s")
        values["drifting"] = tuple(name for name, measure in result.measures.items() if measure.stationary is False)
        laws = {row.law: (row.expected, math.nan, row.unit) for row in result.laws}
        values["measures"] = means | {name: law for name, law in laws.items() if name.startswith(PUBLISHED)}
    return Outcome(**values)


def write_table(outcomes: Sequence[Outcome], path: Path) -> None:
    """Write one line per run: name, changed values, status, means with errors, message."""
    units = {name: unit for outcome in outcomes for name, (_, _, unit) in outcome.measures.items()}
    fresh = path.with_name(f".{path.name}")
    with fresh.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        measures = [(f"{name} [{shown_unit(unit)}]", f"{name} error")[: _width(name)] for name, unit in units.items()]
        table.writerow(["run", *outcomes[0].values, "status", *itertools.chain(*measures), "message"])
        for outcome in outcomes:
            pairs = [outcome.measures.get(name, ("", "", ""))[: _width(name)] for name in units]
            row = [outcome.name, *outcome.values.values(), outcome.status, *itertools.chain(*pairs), outcome.message]
            table.writerow(row)
    fresh.replace(path)


def _width(name: str) -> int:
    """Columns of a measure in the table: its mean and error, or the value of a law."""
    return 1 if name.startswith(PUBLISHED) else 2


def _curves(cases: Iterable[Case]) -> list[Points]:
    """Measured curves against the inlet velocity that the first case names."""
    curves = [points_of(name, table) for case in itertools.islice(cases, 1) for name, table in case.compare.items()]
    return [points for points in curves if points.against == "inlet_velocity"]


def _write_figure(outcomes: Sequence[Outcome], path: Path, sampled: bool, measured: Sequence[Points]) -> None:
    from cfddem.plotting.study_figures import Point, sample_figure, sweep_figure

    points = [Point(outcome.values, outcome.measures) for outcome in outcomes if outcome.measures]
    if sampled:
        sample_figure(points, path)
    else:
        sweep_figure(points, path, measured)


def drifts(outcomes: Sequence[Outcome]) -> str:
    """How many runs have means that still drift, and which, in one sentence; empty if none has."""
    drifting = [outcome.drifting for outcome in outcomes if outcome.drifting]
    names = list(dict.fromkeys(itertools.chain(*drifting)))
    if not names:
        return ""
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return (
        f"means still drift in {len(drifting)} of {len(outcomes)} runs: {', '.join(names[:MOST_NAMES])}{more}; "
        "use a longer run.until, or a later run.average_from"
    )


def failures(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """One line for every run that did not finish."""
    for outcome in outcomes:
        if outcome.status != "finished":
            yield f"{outcome.name}: {outcome.status}; {outcome.message}"


# ---------------------------------------------------------------- a sweep as a job array


SLURM = """#!/bin/bash
# One run a task. Set partition, account and time; then: sbatch {script}
# A run that is stopped writes a checkpoint; submitted again, it goes on from there. Runs that have finished are kept.
#SBATCH --job-name={name}
#SBATCH --array=1-{count}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --time=24:00:00
#SBATCH --signal=TERM@120
#SBATCH --output={output}/%a.log
export NUMBA_NUM_THREADS=$SLURM_CPUS_PER_TASK
srun bash -c "exec $(sed -n "${{SLURM_ARRAY_TASK_ID}}p" {jobs})"
"""


def write_jobs(
    path: Path, over: Over, output: Path, overrides: Mapping[str, Any] | None = None
) -> tuple[Path, Path, int]:
    """Write `jobs.txt`, one command for each run of a sweep, and `jobs.slurm`, which starts them; nothing is run.

    Arguments as of :func:`cfddem.studies.sweep.sweep`, which collects table and figure when the jobs have ended.

    returns  the two files, and the number of runs
    errors   InputError for a case with errors, before anything is written
    """
    shared = dict(overrides or {})
    runs = cases_of(path, over, shared)
    for name, (case, _) in runs.items():
        errors = [f"{issue.key}: {issue.reason}" for issue in preflight(case).issues if issue.severity == "error"]
        if errors:
            raise InputError(f"run {name}", None, "a case without errors", "; ".join(errors))
    make_output(output)
    output = output.absolute()
    program = Path(sys.executable).parent / "cfddem"
    lines = []
    for name, (_, values) in runs.items():
        words = [str(program), "run", str(Path(path).absolute()), "-o", str(output / name), "--continue"]
        for key, value in {**shared, **values}.items():
            words += ["--set", f"{key}={_text(value)}"]
        for file in imported_laws():
            words += ["--laws", str(file)]
        lines.append(shlex.join(words))
    jobs, script = output / "jobs.txt", output / "jobs.slurm"
    jobs.write_text("\n".join(lines) + "\n", encoding="utf-8")
    names = {"name": output.name, "count": len(lines), "output": output, "script": script}
    script.write_text(SLURM.format(jobs=shlex.quote(str(jobs)), **names), encoding="utf-8")
    return jobs, script, len(lines)


def _text(value: Any) -> str:
    """A value as `--set` reads it."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(list(value)) if isinstance(value, tuple) else str(value)


# ---------------------------------------------------------------- the table of a sweep


def open_sweep(folder: str | Path) -> pandas.DataFrame:
    """The runs of a sweep as a table: one row for each run, by its name.

    A measure is a column with its mean, followed by `NAME_error` with the standard error. Values that a run does not
    have, and errors that are not known, are NaN. `attrs["units"]` has the unit of each column.

    folder   of the sweep, which holds `sweep.csv`
    returns  keys that were changed, status, measures, message
    errors   InputError if there is no table, or pandas is not installed

    >>> open_sweep("velocities")[["bed.inlet_velocity", "bed_height", "bed_height_error"]]    # doctest: +SKIP
    """
    pandas = library("pandas", "open_sweep", "data")
    path = Path(folder) / "sweep.csv"
    if not path.is_file():
        remedy = "`cfddem sweep` writes it when the runs have ended; the same command goes on with a sweep"
        raise InputError("folder", str(folder), "a folder with sweep.csv", remedy)
    try:
        table = pandas.read_csv(path, index_col="run", encoding="utf-8")
    except (ValueError, OSError) as failure:  # of pandas: a table without its columns, or no text
        first = str(failure).splitlines()[0]
        raise InputError("folder", str(folder), "a folder with a table of runs in sweep.csv", first) from None
    units: dict[str, str] = {}
    names: dict[str, str] = {}
    for heading in table.columns:
        if match := re.fullmatch(r"(.+?) \[(.*)\]", heading):
            names[heading] = match[1]
            units |= {match[1]: match[2], f"{match[1]}_error": match[2]}
        elif heading.endswith(" error"):
            names[heading] = f"{heading.removesuffix(' error')}_error"
        elif match := re.search(r"\[([^\[\]]*)\]$", field_of(Case, heading.split(".")) or ""):
            units[heading] = match[1]
    table = table.rename(columns=names)
    table.attrs["units"] = {name: units[name] for name in table.columns if name in units}
    return table  # type: ignore[no-any-return]
