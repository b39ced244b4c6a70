"""Commands about cases: begin one, check it, run it, go on with it."""

from __future__ import annotations

import json as _json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cfddem.commands.printing import tell_of_compilation


def new(
    name: Annotated[str | None, Parameter(help="of the gallery; lists it if not given")] = None,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="file to write; NAME.toml here")] = None,
    schema: Annotated[bool, Parameter(help="print the JSON schema of case files, for editors", negative="")] = False,
) -> None:
    """Begin a case: write a commented one of the gallery into this folder, to be changed.

    Example: cfddem new liquid-bed
    """
    from cfddem.gallery import gallery, gallery_case

    if schema:
        from cfddem.case import Case

        print(_json.dumps(Case.model_json_schema(), indent=2))
        return
    if name is None:
        for known, path in gallery().items():
            print(f"{known:<20}  {gallery_case(path).title}")
        return
    from cfddem.gallery import begin

    written = begin(name, output)
    print(f"written to {written}; change it, then cfddem check, then cfddem run")


def check(
    case: Annotated[Path | None, Parameter(help="TOML file, or a name of the gallery; the only one here")] = None,
    *,
    set: Annotated[list[str] | None, Parameter(help="key=value in place of the file's; repeat for more")] = None,
    strict: Annotated[bool, Parameter(help="amber ends with exit code 1", negative="")] = False,
    json: Annotated[bool, Parameter(help="print the card as JSON", negative="")] = False,
) -> None:
    """Say what a run will be before it runs: numbers, clocks, cost, and what speaks against it.

    Ends with exit code 0 for green and amber, 2 for red.

    Example: cfddem check liquid-bed --set bed.inlet_velocity=0.1
    """
    from cfddem.card import card
    from cfddem.case import Case
    from cfddem.gallery import find_case, overrides

    made = card(Case.from_toml(find_case(case), overrides(set or [])))
    print(_json.dumps(made.summary()) if json else "\n".join(made.lines()))
    sys.exit({"green": 0, "amber": int(strict), "red": 2}[made.colour])


def run(
    case: Annotated[Path | None, Parameter(help="TOML file, or a name of the gallery; the only one here")] = None,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="new folder; NAME-run")] = None,
    set: Annotated[list[str] | None, Parameter(help="key=value in place of the file's; repeat for more")] = None,
    threads: Annotated[int | None, Parameter(help="of the machine; all if not given")] = None,
    log: Annotated[Path | None, Parameter(help="file that gets a line of progress for every row of history")] = None,
) -> None:
    """Run a case into a folder, and report what came out. A case whose card is red is refused.

    Example: cfddem run liquid-bed -o bed --set start=suspended --set run.until=0.02
    """
    from cfddem.card import refuse_red
    from cfddem.case import Case
    from cfddem.case_text import read_text
    from cfddem.gallery import find_case, overrides

    path = find_case(case)
    described = Case.from_toml(path, overrides(set or []))
    for finding in refuse_red(described).findings:
        print("\n".join(finding.lines("cfddem: ")), file=sys.stderr)
    from cfddem.kernels import use_threads
    from cfddem.progress import live_line
    from cfddem.rehearsal import rehearsal
    from cfddem.report import lines
    from cfddem.report import report as summary
    from cfddem.run import Run

    folder = output or Path(f"{path.stem}-run")
    use_threads(threads)
    with live_line(log) as line:
        text = described.to_toml() if set else read_text(path)
        with rehearsal(described):
            prepared = Run.begin(described, folder, text=text, report=line.update, progress=line.say)
        prepared.go()
    print("\n".join(lines(summary(folder))))
    print(f"\nwritten to {folder}; see it with: cfddem view {folder}")


def resume(
    folder: Annotated[Path | None, Parameter(help="of a run; the newest one here if not given")] = None,
    *,
    until: Annotated[float | None, Parameter(help="new end [s]")] = None,
    threads: Annotated[int | None, Parameter(help="of the machine; all if not given")] = None,
    log: Annotated[Path | None, Parameter(help="file that gets a line of progress for every row of history")] = None,
) -> None:
    """Go on with a run that was stopped or killed, to the same bits.

    Example: cfddem resume bed --until 0.03
    """
    from cfddem.kernels import use_threads
    from cfddem.progress import live_line
    from cfddem.record.reading import newest_run
    from cfddem.run import Run

    use_threads(threads)
    folder = folder or newest_run(Path())
    with live_line(log) as line:
        Run.resume(folder, until=until, report=line.update, progress=line.say).go()
    print(f"written to {folder}")


def sweep(
    case: Annotated[Path | None, Parameter(help="TOML file, or a name of the gallery; the only one here")] = None,
    *,
    over: Annotated[list[str], Parameter(help="key=1,2,3 or key=1..5; repeat for all combinations")],
    set: Annotated[list[str] | None, Parameter(help="key=value for all runs; repeat for more")] = None,
    jobs: Annotated[int, Parameter(name=["--jobs", "-j"], help="runs at a time")] = 1,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="folder; NAME-sweep")] = None,
    json: Annotated[bool, Parameter(help="print the outcomes as JSON", negative="")] = False,
) -> None:
    """Run a case for many values: a folder each, a table and a figure. Once stopped, the same line goes on.

    Ends with exit code 3 if a run did not finish; the others are kept.

    Example: cfddem sweep liquid-bed --over seed=1..2 --set start=suspended --set until=0.01 -o seeds
    """
    from dataclasses import asdict

    from cfddem.gallery import find_case, overrides
    from cfddem.sweep import Outcome, failures, ranges
    from cfddem.sweep import sweep as run_all

    path = find_case(case)
    values = ranges(over)
    done = 0

    def say(outcome: Outcome) -> None:
        nonlocal done
        done += 1
        took = "was finished" if outcome.kept else f"{outcome.status} in {outcome.seconds:.0f} s"
        print(f"{done:>4}  {outcome.name[:60]:<60}  {took}", file=sys.stderr if json else sys.stdout, flush=True)

    folder = output or Path(f"{path.stem}-sweep")
    if jobs == 1:
        tell_of_compilation()
    outcomes = run_all(path, values, folder, overrides=overrides(set or []), jobs=jobs, say=say)
    bad = list(failures(outcomes))
    if json:
        print(_json.dumps([asdict(each) for each in outcomes]))
    else:
        print(f"table and figure in {folder}")
    for line in bad:
        print(f"cfddem: {line}", file=sys.stderr)
    if bad:
        sys.exit(3)
