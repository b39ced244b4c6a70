"""Calibration: find values of keys for which a case agrees with measured data, and say which the data identify.

Trials are proposed by Optuna (tree-structured Parzen estimator) after a sample of Sobol; every second one lies where
a smooth fit to all trials has its best point. The journal in the folder holds all trials: the same command continues
a stopped calibration. A trial that fails is recorded as failed, and the search goes on.
"""

from __future__ import annotations

import hashlib
import json
import math
import signal
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.measured import compared_at, largest_chi2, with_files
from cfddem.analysis.report import window_of
from cfddem.analysis.response import Response, fewest_runs, response
from cfddem.backend.errors import CfddemError, InputError, RunStopped
from cfddem.backend.json_text import as_json
from cfddem.case.compare import Points, held, points_of, require_measured_units, steps_of
from cfddem.case.schema import Case
from cfddem.io.files import write_whole
from cfddem.io.reading import open_run
from cfddem.run import history
from cfddem.studies import sweep
from cfddem.studies.samples import Array, Variable, unit_samples

STUDY = "calibration"

SEED = "bed.seed"
"""Every trial starts from another random bed, so that the scatter of runs is part of the errors."""


@dataclass(frozen=True)
class Trial:
    """One trial that has ended."""

    number: int
    values: dict[str, float]
    status: str  # finished, or why it has no value
    computed: tuple[float, ...]  # of the run at all measured points; empty if it failed
    chi2: float  # mean square difference in errors of the data; NaN if it failed


@dataclass(frozen=True)
class Calibration:
    """The result of a calibration."""

    variables: tuple[Variable, ...]
    data: tuple[Points, ...]
    trials: tuple[Trial, ...]
    response: Response | None  # None with too few finished trials

    @property
    def finished(self) -> list[Trial]:
        """Trials with a value."""
        return [trial for trial in self.trials if trial.computed]

    @property
    def best(self) -> Trial | None:
        """The trial that differs least from the data."""
        return min(self.finished, key=lambda trial: trial.chi2, default=None)

    @property
    def verdict(self) -> str:
        """Whether the best values agree with the data, in words; empty without a finished trial."""
        if self.best is None:
            return ""
        agrees, chi2, most = self._agrees()
        if agrees:
            return "the case agrees with the data at its best values"
        return (
            f"no values in these ranges agree with the data: reduced chi-squared {chi2:.3g}, by chance at most "
            f"{most:.2g}; the estimates are the closest values, not measured ones: check case, data and ranges"
        )

    def _agrees(self) -> tuple[bool, float, float]:
        """Whether the best values agree with the data, their reduced chi-squared, and the largest one by chance."""
        points = sum(len(measured.value) for measured in self.data)
        chi2 = min(trial.chi2 for trial in self.finished)
        most = largest_chi2(points)
        if chi2 > most and self.response is not None:
            chi2, most = self.response.chi2, largest_chi2(max(points - len(self.variables), 1))
        return chi2 <= most, chi2, most

    def estimates(self) -> list[dict[str, Any]]:
        """Best value, standard error and verdict of each key, as plain values."""
        if (fit := self.response) is None:
            return []
        rows, agrees = [], self._agrees()[0]
        for place, variable in enumerate(self.variables):
            share, error = float(fit.best[place]), float(fit.error[place])
            low, high = (variable.value(min(max(end, 0.0), 1.0)) for end in (share - error, share + error))
            tied = [
                f"{self.variables[b if a == place else a].key} ({r:+.2f})"
                for a, b, r in fit.tied() if place in (a, b)
            ]  # fmt: skip
            identified = bool(fit.identified[place])
            rows.append({
                "key": variable.key, "value": variable.value(share), "error": 0.5 * (high - low) if variable.logarithmic
                else error * (variable.high - variable.low), "low": variable.low, "high": variable.high,
                "identified": identified, "tied": tied, "at_limit": min(share, 1.0 - share) < 0.01,
                "verdict": _verdict(identified, tied, min(share, 1.0 - share) < 0.01, agrees),
            })  # fmt: skip
        return rows

    def summary(self) -> dict[str, Any]:
        """Plain values for JSON."""
        best = self.best
        return {
            "estimates": self.estimates(),
            "chi2": None if self.response is None else self.response.chi2,
            "verdict": self.verdict,
            "best": None if best is None else {"trial": best.number, "values": best.values, "chi2": best.chi2},
            "trials": len(self.trials),
            "failed": len(self.trials) - len(self.finished),
            "data": [
                {"name": points.name, "quantity": points.quantity, "points": len(points.value)} for points in self.data
            ],
        }


def calibrate(
    path: Path,
    match: Sequence[Path],
    varied: Sequence[Variable],
    output: Path,
    *,
    trials: int = 30,
    jobs: int = 1,
    overrides: Mapping[str, Any] | None = None,
    progress: Callable[[Trial], None] = lambda _: None,
) -> Calibration:
    """Search for the values of keys for which a case agrees with measured data.

    path       of the case file
    match      files of measured points, beside those of `[compare]` in the case
    varied     keys and their ranges
    output     folder: `journal.log`, one folder per trial, and the results
    trials     number of all trials, with those of earlier calls
    jobs       number of concurrent trials
    overrides  values that all trials share
    progress   called after every trial
    errors     InputError before any trial starts
    """
    if trials < 1 or jobs < 1:
        raise InputError("--trials" if trials < 1 else "--jobs", min(trials, jobs), "at least 1")
    case = with_files(Case.from_toml(path, overrides), match)
    data = _data(case)
    require_measured_units(case.compare, history.units_of(case))
    for low_or_high in (0.0, 1.0):  # both ends of all ranges are valid values
        case.with_(**{variable.key: variable.value(low_or_high) for variable in varied})
    sweep.make_output(output)
    study = _study(output, _fingerprint(case, varied, data))
    done = [_trial(trial) for trial in study.get_trials(deepcopy=False) if "status" in trial.user_attrs]
    search = _Search(study, varied, data, done)
    while len(search.done) < trials:
        asked = search.ask(min(jobs, trials - len(search.done)))
        work = []
        for number, values in asked:
            folder = output / f"trial-{number:04d}"
            try:
                work.append((case.with_(**values, **_seed(case, varied, number)), values, folder, jobs > 1))
            except InputError as failure:  # a value or a combination that no case can have
                progress(search.tell(number, sweep.Outcome(str(folder), values, "refused", str(failure)), ()))
        for outcome in sweep.on_this_machine(work, jobs):
            number = int(outcome.name.removeprefix("trial-"))
            if outcome.status == "stopped":
                raise RunStopped("calibration stopped; the same command continues it", signal.SIGINT)
            progress(search.tell(number, outcome, _computed(outcome, case, data)))
    calibration = Calibration(tuple(varied), tuple(data), tuple(search.done), response_of(varied, data, search.done))
    write_results(calibration, output)
    return calibration


def _data(case: Case) -> list[Points]:
    data = [points_of(name, compared) for name, compared in case.compare.items()]
    if not data:
        raise InputError("--match", None, "given, or [compare] in the case", "there is nothing to calibrate against")
    for points in data:
        if not np.isfinite(points.error).all():  # local: of measured points
            remedy = "add a column error, or relative_error in [compare] of the case"
            raise InputError(f"data {points.name}", None, "given with standard errors", remedy)
        if points.against != "inlet_velocity":
            continue
        in_run = held(case.bed.inlet_velocity, case.run.until, points.place)
        if not in_run.all():  # local: measured points
            missing = float(points.place[~in_run][0])
            remedy = f"for all points: {steps_of(points.place, case.run.until)}"
            raise InputError(f"data {points.name} inlet_velocity", missing, "a velocity that the case holds", remedy)
    return data


def _seed(case: Case, varied: Sequence[Variable], number: int) -> dict[str, int]:
    return {} if SEED in [variable.key for variable in varied] else {SEED: case.bed.seed + number}


# ---------------------------------------------------------------- the search


class _Search:
    """Proposes trials, and keeps those that have ended."""

    def __init__(self, study: Any, varied: Sequence[Variable], data: Sequence[Points], done: list[Trial]) -> None:
        self.study, self.varied, self.data, self.done = study, varied, data, done
        self.first = unit_samples(len(varied), 2 * fewest_runs(len(varied)), "sobol")
        self._open: dict[int, Any] = {}

    def ask(self, count: int) -> Iterator[tuple[int, dict[str, float]]]:
        """Number and values of the next trials."""
        import optuna

        ranges = {
            variable.key: optuna.distributions.FloatDistribution(variable.low, variable.high, log=variable.logarithmic)
            for variable in self.varied
        }
        for place in range(count):
            self._enqueue(len(self.done) + place)
            trial = self.study.ask(ranges)
            self._open[trial.number] = trial
            yield trial.number, dict(trial.params)

    def tell(self, number: int, outcome: sweep.Outcome, computed: tuple[float, ...]) -> Trial:
        """Record a trial that has ended."""
        import optuna

        trial = self._open.pop(number)
        status = "finished" if computed else f"{outcome.status}: {outcome.message}".removesuffix(": ")
        trial.set_user_attr("computed", computed)
        trial.set_user_attr("status", status)
        if computed:
            self.study.tell(trial, chi2_of(computed, self.data))
        else:
            self.study.tell(trial, state=optuna.trial.TrialState.FAIL)
        record = Trial(number, dict(trial.params), status, computed, chi2_of(computed, self.data))
        self.done.append(record)
        return record

    def _enqueue(self, place: int) -> None:
        """Fix the values of the trial at a place: a sample first, then each second one at the best of the fit."""
        if place < len(self.first):
            shares = self.first[place]
        elif place % 2 and (fit := response_of(self.varied, self.data, self.done)) is not None:
            spread = np.random.default_rng(place).normal(size=len(fit.best))
            shares = (fit.best + 0.5 * fit.error * spread).clip(0.0, 1.0)
        else:
            return
        self.study.enqueue_trial({variable.key: variable.value(share) for variable, share in zip(self.varied, shares)})


def _study(output: Path, fingerprint: str) -> Any:
    """The study in a folder; one that another calibration has begun is refused."""
    if find_spec("optuna") is None:
        raise InputError("calibrate", None, "used with Optuna", "pip install 'cfddem[calibrate]'")
    import optuna
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    file = str(output / "journal.log")
    storage = JournalStorage(JournalFileBackend(file, lock_obj=JournalFileOpenLock(file)))
    warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
    sampler = optuna.samplers.TPESampler(seed=1, n_startup_trials=1, multivariate=True)
    study = optuna.create_study(storage=storage, study_name=STUDY, load_if_exists=True, sampler=sampler)
    earlier = study.user_attrs.get("fingerprint")
    if earlier not in (None, fingerprint):
        limit = "a folder of the same case, laws, data and ranges"
        raise InputError("output", str(output), limit, "choose another folder with -o")
    study.set_user_attr("fingerprint", fingerprint)
    for trial in study.get_trials(deepcopy=False):
        if trial.state == optuna.trial.TrialState.RUNNING:  # of a process that was killed; it does not count
            study.tell(trial.number, state=optuna.trial.TrialState.FAIL)
    sampler.reseed_rng()
    return study


def _trial(frozen: Any) -> Trial:
    computed = tuple(frozen.user_attrs.get("computed", ()))
    status = frozen.user_attrs["status"]
    return Trial(
        frozen.number, dict(frozen.params), status, computed, math.nan if frozen.value is None else frozen.value
    )


def _fingerprint(case: Case, varied: Sequence[Variable], data: Sequence[Points]) -> str:
    """A number that changes with case, ranges, data, or the source of the user's laws."""
    from cfddem.run.resuming import record_of

    plain = case.model_copy(update={"compare": {}})
    points = [
        [points.name, points.quantity, points.against, points.weight]
        + [column.tolist() for column in (points.place, points.value, points.error)]
        for points in data
    ]
    text = json.dumps([plain.to_toml(), [list(variable) for variable in varied], points, record_of(case)])
    return hashlib.sha256(text.encode()).hexdigest()


def _computed(outcome: sweep.Outcome, case: Case, data: Sequence[Points]) -> tuple[float, ...]:
    """Values of a run at all measured points; none if it failed, or lacks a value."""
    if outcome.status != "finished":
        return ()
    run = open_run(outcome.folder)
    begin, _ = window_of(run, case)
    try:
        values = np.concatenate([compared_at(run, case, points, begin).computed for points in data])
    except CfddemError:
        return ()
    return tuple(values.tolist()) if np.isfinite(values).all() else ()  # local: of measured points


def chi2_of(computed: Sequence[float], data: Sequence[Points]) -> float:
    """Mean square difference in errors of the data, with the weights of the data; NaN without values."""
    if not len(computed):
        return math.nan
    value, error, weight = _joined(data)
    squares = ((np.array(computed) - value) / error) ** 2
    return float((weight * squares).sum() / weight.sum())  # local: of measured points


def _joined(data: Sequence[Points]) -> tuple[Array, Array, Array]:
    """Value, error and weight of all points."""
    weights = [np.full(len(points.value), points.weight) for points in data]
    return (
        np.concatenate([points.value for points in data]), np.concatenate([points.error for points in data]),
        np.concatenate(weights),
    )  # fmt: skip


def response_of(varied: Sequence[Variable], data: Sequence[Points], done: Sequence[Trial]) -> Response | None:
    """The response of a model to its keys, by the trials with a value; None with too few of them."""
    if not (good := [trial for trial in done if trial.computed]):
        return None
    shares = np.array([[variable.share(trial.values[variable.key]) for variable in varied] for trial in good])
    return response(shares, np.array([trial.computed for trial in good]), *_joined(data))


def _verdict(identified: bool, tied: Sequence[str], at_limit: bool, agrees: bool) -> str:
    if tied:
        return f"only together with {', '.join(tied)}: these keys cannot be told apart by the data"
    if not identified and agrees:
        return "not identified: the data hardly depend on it within its range"
    if not identified:
        return "not known: no value in its range agrees with the data" + "; widen it, the best is at its end" * at_limit
    return "identified" + (", at the end of its range: widen it" if at_limit else "")


# ---------------------------------------------------------------- results


def write_results(calibration: Calibration, output: Path) -> None:
    """Write `calibration.json`, `trials.csv` and `calibration.png`."""
    from cfddem.plotting.study_figures import calibration_figure

    write_whole(output / "calibration.json", as_json(calibration.summary()).encode())
    lines = [",".join(["trial", *(variable.key for variable in calibration.variables), "chi2", "status"])]
    for trial in calibration.trials:
        words = trial.status.replace('"', "'")
        lines.append(",".join([str(trial.number), *map(str, trial.values.values()), f"{trial.chi2:.6g}", f'"{words}"']))
    write_whole(output / "trials.csv", ("\n".join(lines) + "\n").encode())
    if calibration.finished:
        calibration_figure(calibration, output / "calibration.png")
