"""Many runs of one case, a key or several changed from run to run: a folder each, one table, one figure.

A sweep that was stopped goes on where it was: finished runs are left as they are, begun ones are resumed. A run that
fails is listed at the end, and the others are kept.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from cfddem.card import card
from cfddem.case import Case
from cfddem.errors import CfddemError, InputError, RunStopped
from cfddem.gallery import full_key, read_value

MOST = 10_000
"""More runs than this are a slip of the pen."""

SHOWN = ("bed_height", "bed_voidage", "pressure_drop")
"""Measures in the figure."""


@dataclass(frozen=True)
class Outcome:
    """What became of one run."""

    folder: str
    values: dict[str, Any]  # what was changed, by key
    status: str  # finished, failed, stopped, refused before it began, or waiting
    message: str = ""
    measures: dict[str, tuple[float, float, str]] = field(default_factory=dict)  # mean, error, unit
    seconds: float = 0.0
    kept: bool = False  # it was finished before this sweep

    @property
    def name(self) -> str:
        """Name of the run."""
        return Path(self.folder).name


def ranges(given: Sequence[str]) -> dict[str, list[Any]]:
    """Keys and their values from texts such as `fluid.viscosity=1e-3,2e-3` and `seed=1..5`.

    >>> ranges(["viscosity=1e-3,2e-3", "seed=1..3", "laws.drag=wen_yu,di_felice"])
    {'fluid.viscosity': [0.001, 0.002], 'bed.seed': [1, 2, 3], 'laws.drag': ['wen_yu', 'di_felice']}
    """
    found: dict[str, list[Any]] = {}
    for each in given:
        key, equals, text = each.partition("=")
        if not equals or not text.strip():
            raise InputError("--over", each, "key=value,value,... or key=first..last, such as seed=1..5")
        key = full_key(key.strip())
        if key in found:
            raise InputError("--over", key, "given once")
        span = re.fullmatch(r"\s*(-?\d{1,9})\.\.(-?\d{1,9})\s*", text)
        values = list(range(int(span[1]), int(span[2]) + 1)) if span else _values(text)
        if not values:
            raise InputError("--over", each, "a range of at least one number, smaller first")
        found[key] = values
    count = math.prod(len(values) for values in found.values())
    if not found or count > MOST:
        raise InputError("--over", None, f"given, for at most {MOST} runs", f"here {count if found else 0}")
    return found


def _values(text: str) -> list[Any]:
    """Values between commas; brackets keep theirs."""
    whole = read_value(f"[{text}]")
    return whole if isinstance(whole, list) else [read_value(each.strip()) for each in text.split(",")]


def run_name(values: Mapping[str, Any]) -> str:
    """Name of a run: last words of the keys, and values.

    >>> run_name({"fluid.viscosity": 0.001, "bed.seed": 2})
    'viscosity-0.001_seed-2'
    """
    parts = [f"{key.split('.')[-1]}-{value}" for key, value in values.items()]
    return re.sub(r"[^\w.+-]+", "-", "_".join(parts)).strip("-")[:120]


def sweep(
    path: Path,
    over: Mapping[str, Sequence[Any]],
    output: Path,
    *,
    overrides: Mapping[str, Any] | None = None,
    jobs: int = 1,
    say: Callable[[Outcome], None] = lambda _: None,
) -> list[Outcome]:
    """Run a case for every combination of values.

    path       of the case file
    over       values by key
    output     folder of the sweep: a folder for each run, `sweep.csv`, `sweep.png`
    overrides  values that stay the same
    jobs       runs at a time, each on one thread if there are several
    say        is told of every run that has ended
    returns    outcomes, in the order of the values
    """
    from joblib import Parallel, delayed

    if jobs < 1:
        raise InputError("--jobs", jobs, "at least 1")
    runs: dict[str, tuple[Case, dict[str, Any]]] = {}
    for combination in itertools.product(*over.values()):
        values = dict(zip(over, combination))
        case = Case.from_toml(path, {**(overrides or {}), **values})
        if run_name(values) in runs:
            raise InputError("--over", run_name(values), "another name for every run", "a value stands there twice")
        runs[run_name(values)] = case, values
    if output.exists() and not output.is_dir():
        raise InputError("output", str(output), "a folder", "a file of that name is there")
    output.mkdir(parents=True, exist_ok=True)
    outcomes: dict[str, Outcome] = {}
    work = (delayed(_one)(case, values, output / name, jobs > 1) for name, (case, values) in runs.items())
    for outcome in Parallel(n_jobs=jobs, return_as="generator_unordered")(work):
        outcomes[outcome.name] = outcome
        say(outcome)
        if outcome.status == "stopped":  # whoever stops a run means all of them
            break
    ordered = [
        outcomes.get(name, Outcome(str(output / name), values, "waiting", "not begun; the same line goes on"))
        for name, (_, values) in runs.items()
    ]
    write_table(ordered, output / "sweep.csv")
    figure(ordered, output / "sweep.png")
    return ordered


def _one(case: Case, values: dict[str, Any], folder: Path, alone: bool) -> Outcome:
    """Run, resume or leave one run; whatever goes wrong is told and not raised."""
    from cfddem.kernels import use_threads
    from cfddem.record.reading import open_run
    from cfddem.run import Run

    begun, kept = time.monotonic(), False
    outcome = Outcome(str(folder), values, "refused")
    try:
        if alone:
            use_threads(1)
        made = card(case)
        if made.colour == "red":
            reasons = "; ".join(f"{each.key}: {each.reason}" for each in made.findings if each.colour == "red")
            return Outcome(str(folder), values, "refused", reasons)
        if not (folder / "run.json").exists():
            Run.begin(case, folder).go()
        else:
            before = open_run(folder)
            if Case.from_text(before.case_text, str(folder / "case.toml")) != case:
                raise InputError("output", str(folder), "a folder of the same case", "give another folder")
            kept = before.status == "finished"
            if not kept:
                Run.resume(folder).go()
        outcome = Outcome(str(folder), values, open_run(folder).status)
    except CfddemError as failure:
        status = "stopped" if isinstance(failure, RunStopped) else "failed"
        outcome = Outcome(str(folder), values, status, str(failure).replace("\n", "; "))
    except Exception as failure:  # one run must never take the others with it
        outcome = Outcome(str(folder), values, "failed", f"{type(failure).__name__}: {failure}")
    return _measured(outcome, time.monotonic() - begun, kept)


def _measured(outcome: Outcome, seconds: float, kept: bool) -> Outcome:
    """The outcome with its means, where there are any."""
    from cfddem.report import report

    values = asdict(outcome) | {"seconds": seconds, "kept": kept}
    if outcome.status == "finished":
        found = report(Path(outcome.folder))["measures"]
        values["measures"] = {name: (each["mean"], each["error"], each["unit"]) for name, each in found.items()}
    return Outcome(**values)


# ---------------------------------------------------------------- table and figure


def write_table(outcomes: Sequence[Outcome], path: Path) -> None:
    """One line a run: name, what was changed, status, means with their errors, message."""
    units = {name: unit for each in outcomes for name, (_, _, unit) in each.measures.items()}
    shown = {name: f"{name} [{'-' if unit == '1' else unit}]" for name, unit in units.items()}
    fresh = path.with_name(f".{path.name}")
    with fresh.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        measures = itertools.chain.from_iterable((title, f"{name} error") for name, title in shown.items())
        table.writerow(["run", *outcomes[0].values, "status", *measures, "message"])
        for each in outcomes:
            pairs = [each.measures.get(name, ("", "", ""))[:2] for name in shown]
            row = [each.name, *each.values.values(), each.status, *itertools.chain(*pairs), each.message]
            table.writerow(row)
    fresh.replace(path)


def figure(outcomes: Sequence[Outcome], path: Path) -> bool:
    """Means over the first key that was changed, a curve for each combination of the others.

    returns  whether there was anything to draw
    """
    from cfddem.view import plots

    done = [each for each in outcomes if each.measures]
    names = [name for name in SHOWN if done and all(name in each.measures for each in done)]
    if not names:
        return False
    first, *others = done[0].values
    groups: dict[str, list[Outcome]] = {}
    for each in done:
        group = ", ".join(f"{key.split('.')[-1]} = {each.values[key]}" for key in others)
        groups.setdefault(group, []).append(each)
    numeric = all(isinstance(each.values[first], int | float) for each in done)
    places = {str(value): k for k, value in enumerate(dict.fromkeys(str(each.values[first]) for each in done))}
    picture, axes = plots.panels(len(names), width=4.2 * len(names), height=4.0)
    for name, panel in zip(names, axes if len(names) > 1 else [axes]):
        for (group, those), colour in zip(groups.items(), plots.shades(len(groups))):
            x = [each.values[first] if numeric else places[str(each.values[first])] for each in those]
            mean, error = zip(*(each.measures[name][:2] for each in those))
            bars = [0.0 if math.isnan(each) else each for each in error]
            panel.errorbar(x, mean, yerr=bars, fmt="o-", color=colour, capsize=2.0, label=group or None)
        if not numeric:
            panel.set_xticks(range(len(places)), list(places))
        unit = done[0].measures[name][2]
        plots.label(
            panel, first, _unit(first) if numeric else "-", name.replace("_", " "), "-" if unit == "1" else unit
        )
    if others and len(groups) <= 8:
        plots.legend(axes[0] if len(names) > 1 else axes)
    plots.save(picture, path)
    return True


def _unit(key: str) -> str:
    """Unit of a key of a case, as its description says it."""
    from cfddem.mistakes import field_of

    found = re.search(r"\[([^\]]*)\]$", field_of(Case, key.split(".")) or "")
    return found[1] if found else "-"


def failures(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """A line for every run that did not finish."""
    for each in outcomes:
        if each.status != "finished":
            yield f"{each.name}: {each.status}; {each.message}"
