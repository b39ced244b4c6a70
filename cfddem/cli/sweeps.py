"""The commands `sweep` and `calibrate`."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from cfddem.backend.errors import InputError
from cfddem.backend.tables import line_width
from cfddem.cli.cases import AS_IT_IS, CASE, JSON, Changes, print_warnings
from cfddem.cli.json_output import print_json

if TYPE_CHECKING:
    from cfddem.studies.calibration import Calibration, Trial


SENSITIVITY = "how much each key matters: sobol (shares of variance) or morris (effects over the ranges; fewer runs)"


@Parameter(name="*")
@dataclass(frozen=True)
class Values:
    """The values of a sweep; its fields are options."""

    over: Annotated[
        list[str] | None, Parameter(help="KEY=1,2,3 or KEY=1..5; repeat for all combinations", negative="")
    ] = None
    vary: Annotated[
        list[str] | None, Parameter(help="KEY=LOW..HIGH; may be repeated; the ranges are sampled", negative="")
    ] = None
    sample: Annotated[str, Parameter(help="how ranges are sampled: latin (hypercube) or sobol")] = "latin"
    runs: Annotated[int, Parameter(help="number of samples, or of rows of a sensitivity")] = 16
    sensitivity: Annotated[str | None, Parameter(help=SENSITIVITY)] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Workers:
    """Who makes the runs of a sweep; its fields are options."""

    jobs: Annotated[int, Parameter(name=["--jobs", "-j"], help="number of runs at a time")] = 1
    scheduler: Annotated[str | None, Parameter(help="address of a dask scheduler, whose workers make the runs")] = None
    write_jobs: Annotated[bool, Parameter(help="write commands and a Slurm script, run nothing", negative="")] = False


NO_VALUES, HERE = Values(), Workers()


def sweep(
    case: Annotated[Path | None, Parameter(help=CASE)] = None,
    *,
    values: Values = NO_VALUES,
    changes: Changes = AS_IT_IS,
    workers: Workers = HERE,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="folder; default: NAME-sweep")] = None,
    json: Annotated[bool, Parameter(help=JSON, negative="")] = False,
) -> None:
    """Run a case for many values, one folder each, and write a table and a figure of the results.

    The values are listed (--over), or fill ranges evenly (--vary, --sample, --runs). With --sensitivity the ranges are
    sampled so that the result says how much each key matters; --vary then also takes KEY=VALUE,VALUE,...

    After a stop, the same command continues with the missing runs. With --write-jobs nothing is run: the folder gets
    one command for each run, and a script for Slurm; the same command without it collects the results afterwards.
    Exit code: 3 if a run fails; the others are kept.

    Example: cfddem sweep liquid-bed --over seed=1..2 --set start=suspended --set until=0.01 -o seeds
    """
    from cfddem.case.gallery import find_case
    from cfddem.studies import sensitivity as of_keys
    from cfddem.studies.samples import chosen_values
    from cfddem.studies.sweep import Outcome, drifts, failures
    from cfddem.studies.sweep import sweep as run_all

    path, over, vary = find_case(case), values.over or [], values.vary or []
    shared = changes.values()
    kind = values.sensitivity
    asked = None if kind is None else of_keys.asked(kind, over, vary, values.runs)
    chosen = chosen_values(over, vary, values.sample, values.runs) if asked is None else asked.runs
    folder = output or Path(f"{path.stem}-sweep")
    if workers.write_jobs:
        from cfddem.studies.sweep import write_jobs as write

        lines, script, count = write(path, chosen, folder, shared)
        if json:
            print_json("written", {"files": [lines, script]})
        else:
            print(f"{count} commands written to {lines}; submit with: sbatch {script}")
        return
    done = 0

    def progress(outcome: Outcome) -> None:
        nonlocal done
        done += 1
        status = "already finished" if outcome.kept else f"{outcome.status} in {outcome.seconds:.0f} s"
        print(f"{done:>4}  {outcome.name[:60]:<60}  {status}", file=sys.stderr if json else sys.stdout, flush=True)

    if workers.jobs == 1 and workers.scheduler is None and not json:
        from cfddem.backend.compile import announce_compilation  # loads the compiler

        announce_compilation()
    outcomes = run_all(
        path, chosen, folder, overrides=shared, jobs=workers.jobs, scheduler=workers.scheduler,
        progress=progress,
    )  # fmt: skip
    failed = list(failures(outcomes))
    for line in failed:
        print(f"cfddem: {line}", file=sys.stderr)
    sensitivity = None
    if asked is not None and not any(outcome.status == "waiting" for outcome in outcomes):
        sensitivity = of_keys.sensitivity(asked.design, asked.varied, outcomes)
        of_keys.write_results(sensitivity, folder)
    if json:
        runs_made = [outcome.summary() for outcome in outcomes]
        print_json("sweep", {"folder": folder, "runs": runs_made, "sensitivity": sensitivity and sensitivity.summary()})
    else:
        print("\n".join([*(sensitivity.lines() if sensitivity else ()), f"table and figure written to {folder}"]))
        if drift := drifts(outcomes):
            print("\n".join(textwrap.wrap(f"cfddem: warning: {drift}", line_width())), file=sys.stderr)
    if failed:
        sys.exit(3)


# ---------------------------------------------------------------- calibration


COLLIDE = "material of measured collisions, instead of a case: delrin, glass, steel_smooth or steel_rough"


@Parameter(name="*")
@dataclass(frozen=True)
class Effort:
    """How many runs a search makes; its fields are options."""

    trials: Annotated[int, Parameter(help="number of runs, with those of earlier calls")] = 30
    jobs: Annotated[int, Parameter(name=["--jobs", "-j"], help="number of runs at a time")] = 1


USUAL = Effort()


def calibrate(
    case: Annotated[Path | None, Parameter(help=CASE)] = None,
    *,
    vary: Annotated[list[str], Parameter(help="KEY=LOW..HIGH; may be repeated; 'KEY=LOW..HIGH log'", negative="")],
    match: Annotated[
        list[Path] | None,
        Parameter(help="CSV file of measured points with errors, beside those of the case", negative=""),
    ] = None,
    collide: Annotated[str | None, Parameter(help=COLLIDE)] = None,
    effort: Effort = USUAL,
    changes: Changes = AS_IT_IS,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="folder; default: NAME-calibration")] = None,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Find values of a case for which it agrees with measured data, with errors; say which the data do not identify.

    The data need a column of errors. After a stop, the same command continues. Trials that fail are recorded, and the
    search goes on. Exit code: 3 if every trial fails. Runs of a case need: pip install 'cfddem[calibrate]'

    With --collide the data are collisions of two spheres or a sphere and a wall; keys of --vary and --set are values
    of the material and options of the command collide. All collisions are computed by each call.

    Example: cfddem calibrate box.toml --match measured.csv --vary material.glass.restitution=0.6..1
    """
    from cfddem.case.gallery import find_case
    from cfddem.case.schema import Case
    from cfddem.preflight.summary import preflight
    from cfddem.studies.calibration import calibrate as search
    from cfddem.studies.calibration import write_results
    from cfddem.studies.samples import variables
    from cfddem.studies.sweep import make_output

    def progress(trial: Trial) -> None:
        values = ", ".join(f"{key.split('.')[-1]} {value:.4g}" for key, value in trial.values.items())
        result = f"mean square difference {trial.chi2:.4g}" if trial.computed else trial.status[:60]
        print(f"{trial.number:>4}  {values:<40}  {result}", file=sys.stderr if json else sys.stdout, flush=True)

    if effort.jobs == 1 and not json:
        from cfddem.backend.compile import announce_compilation  # loads the compiler

        announce_compilation()
    if collide is not None:
        if case is not None or effort.jobs != 1:
            raise InputError("--collide", collide, "used without a case and without --jobs")
        folder = output or Path("collide-calibration")
        changes.import_laws()
        of_collisions = _of_collisions(collide, match or (), vary, changes.set or (), effort.trials, progress)
        make_output(folder)
        write_results(of_collisions, folder)
        _print(of_collisions, folder, json)
        return
    path = find_case(case)
    shared = changes.values()
    print_warnings(preflight(Case.from_toml(path, shared)))
    folder = output or Path(f"{path.stem}-calibration")

    of_runs = search(
        path, match or (), variables(vary), folder, trials=effort.trials, jobs=effort.jobs,
        overrides=shared, progress=progress,
    )  # fmt: skip
    _print(of_runs, folder, json)


def _of_collisions(
    material: str, match: Sequence[Path], vary: Sequence[str], changes: Sequence[str], trials: int,
    progress: Callable[[Trial], None],
) -> Calibration:  # fmt: skip
    """The calibration of collisions."""
    from cfddem.studies.samples import variables
    from scenarios.collisions.immersed_pair.calibration import fit, key_of, settings

    varied = variables(vary, key_of)
    return fit(material, match, varied, settings(changes), trials=trials, progress=progress)


def _print(calibration: Calibration, folder: Path, json: bool) -> None:
    """Print a result; ends with code 3 where every trial has failed."""
    if json:
        print_json("calibrate", {"folder": folder, **calibration.summary()})
    else:
        print("\n".join(lines(calibration.summary(), folder)))
    if not calibration.finished:
        sys.exit(3)


def lines(result: dict, folder: Path) -> list[str]:  # type: ignore[type-arg]
    """The result of a calibration as text."""
    out = [""]
    for estimate in result["estimates"]:
        value = f"{estimate['value']:.4g} +- {estimate['error']:.2g}"
        out += [
            f"{estimate['key']:<34} {value:<22} of {estimate['low']:g} to {estimate['high']:g}",
            f"  {estimate['verdict']}",
        ]
    if not result["estimates"]:
        out.append("too few finished trials for an estimate; repeat the command with more --trials")
    if result["best"] is not None:
        chi2 = "" if result["chi2"] is None else f"; {result['chi2']:.2g} with the scatter of the runs"
        out += ["", *textwrap.wrap(result["verdict"], line_width())]
        out += [f"reduced chi-squared of the best trial: {result['best']['chi2']:.3g}{chi2}"]
    out += [f"{result['trials']} trials, {result['failed']} failed; table and figure in {folder}"]
    return out
