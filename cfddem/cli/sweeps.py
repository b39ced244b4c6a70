"""The command `sweep`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cfddem.cli.cases import CASE, JSON, SET
from cfddem.cli.json_output import print_json
from cfddem.cli.printing import announce_compilation

SENSITIVITY = "how much each key matters: sobol (shares of variance) or morris (effects over the ranges; fewer runs)"


def sweep(
    case: Annotated[Path | None, Parameter(help=CASE)] = None,
    *,
    over: Annotated[
        list[str] | None, Parameter(help="KEY=1,2,3 or KEY=1..5; repeat for all combinations", negative="")
    ] = None,
    vary: Annotated[
        list[str] | None, Parameter(help="KEY=LOW..HIGH; may be repeated; the ranges are sampled", negative="")
    ] = None,
    sample: Annotated[str, Parameter(help="how ranges are sampled: latin (hypercube) or sobol")] = "latin",
    runs: Annotated[int, Parameter(help="number of samples, or of rows of a sensitivity")] = 16,
    sensitivity: Annotated[str | None, Parameter(help=SENSITIVITY)] = None,
    set: Annotated[list[str] | None, Parameter(help=SET, negative="")] = None,
    jobs: Annotated[int, Parameter(name=["--jobs", "-j"], help="number of runs at a time")] = 1,
    scheduler: Annotated[str | None, Parameter(help="address of a dask scheduler, whose workers make the runs")] = None,
    write_jobs: Annotated[bool, Parameter(help="write commands and a Slurm script, run nothing", negative="")] = False,
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
    from cfddem.case.gallery import find_case, overrides
    from cfddem.studies import sensitivity as of_keys
    from cfddem.studies.samples import chosen_values
    from cfddem.studies.sweep import Outcome, failures
    from cfddem.studies.sweep import sweep as run_all

    path = find_case(case)
    asked = None if sensitivity is None else of_keys.asked(sensitivity, over or [], vary or [], runs)
    values = chosen_values(over or [], vary or [], sample, runs) if asked is None else asked.runs
    folder = output or Path(f"{path.stem}-sweep")
    if write_jobs:
        from cfddem.studies.sweep import write_jobs as write

        lines, script, count = write(path, values, folder, overrides(set or []))
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

    if jobs == 1 and scheduler is None and not json:
        announce_compilation()
    outcomes = run_all(
        path, values, folder, overrides=overrides(set or []), jobs=jobs, scheduler=scheduler, progress=progress
    )
    failed = list(failures(outcomes))
    for line in failed:
        print(f"cfddem: {line}", file=sys.stderr)
    found = None
    if asked is not None and not any(each.status == "waiting" for each in outcomes):
        found = of_keys.sensitivity(asked.design, asked.varied, outcomes)
        of_keys.write_results(found, folder)
    if json:
        runs_made = [each.summary() for each in outcomes]
        print_json("sweep", {"folder": folder, "runs": runs_made, "sensitivity": found and found.summary()})
    else:
        print("\n".join([*(found.lines() if found else ()), f"table and figure written to {folder}"]))
    if failed:
        sys.exit(3)
