"""Commands for cases: start one, check it, run it, resume it, sweep over its values."""

from __future__ import annotations

import math
import os
import re
import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from cfddem.backend.communicator import division_of
from cfddem.backend.errors import InputError
from cfddem.backend.json_text import as_json
from cfddem.backend.law_choice import import_laws
from cfddem.backend.tables import table
from cfddem.cli.json_output import print_json
from cfddem.cli.ranks import on_ranks

if TYPE_CHECKING:
    from cfddem.backend.communicator import Communicator
    from cfddem.case.schema import Case
    from cfddem.preflight.summary import Preflight

CASE = "case file or gallery name; default: the only TOML file here"
SET = "KEY=VALUE that replaces a value of the case; may be repeated"
THREADS = "number of threads; default: all processors, one for small cases"
RANKS = "number of processes that share the run; default: as started by mpiexec, else 1"
CONTINUE = "resume the run if the folder holds one"
FROM = "run folder whose end is the beginning of this run"
DIVISION = "ranks along x, y and z, such as 2x2x1; default: the shape with the least work of the busiest rank"
REPORT = "print the report as JSON"
JSON = "print the result as JSON"
LOG = "file for progress, one line per history row"
LAWS = "Python file with your laws, to be executed, as no file of a case or run folder is; may be repeated"


@Parameter(name="*")
@dataclass(frozen=True)
class Processors:
    """On how many processors a run is made; its fields are options."""

    threads: Annotated[int | None, Parameter(help=THREADS)] = None
    ranks: Annotated[int | None, Parameter(help=RANKS)] = None
    division: Annotated[str | None, Parameter(help=DIVISION)] = None


WHOLE_MACHINE = Processors()
"""As many threads as there are, or as the launcher says."""


@Parameter(name="*")
@dataclass(frozen=True)
class Changes:
    """What a command adds to a case file; its fields are options."""

    set: Annotated[list[str] | None, Parameter(help=SET, negative="")] = None
    laws: Annotated[list[Path] | None, Parameter(help=LAWS, negative="")] = None

    def import_laws(self) -> None:
        """Make the user's laws known."""
        import_laws(self.laws or ())

    def values(self) -> dict[str, Any]:
        """Values by key, after the user's laws are known."""
        from cfddem.case.gallery import overrides

        self.import_laws()
        return overrides(self.set or [])

    def case(self, path: Path) -> Case:
        """The case of a file with its values replaced."""
        from cfddem.case.schema import Case

        return Case.from_toml(path, self.values())


AS_IT_IS = Changes()
"""The case as its file has it."""


def new(
    name: Annotated[str | None, Parameter(help="gallery name; without it, the gallery is listed")] = None,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="file to write; default: NAME.toml")] = None,
    schema: Annotated[bool, Parameter(help="print the JSON schema of case files, for editors", negative="")] = False,
    json: Annotated[bool, Parameter(help=JSON, negative="")] = False,
) -> None:
    """Copy a commented case from the gallery to this folder, as a start for your own.

    Example: cfddem new liquid-bed
    """
    from cfddem.case.gallery import copy_from_gallery, gallery
    from cfddem.case.schema import Case

    if schema:
        print(as_json(Case.model_json_schema(), indent=2))
    elif name is None:
        titles = [(name, case.title) for name, case in gallery().items()]
        if json:
            print_json("gallery", {"cases": [{"name": name, "title": title} for name, title in titles]})
        else:
            print("\n".join(table(titles, widths=(20,), gap=2)))
    else:
        written = copy_from_gallery(name, output)
        if json:
            print_json("written", {"files": [written]})
            return
        print(f"written to {written}; edit it, then: cfddem check {written}, cfddem run {written}")


def check(
    case: Annotated[Path | None, Parameter(help=CASE)] = None,
    *,
    changes: Changes = AS_IT_IS,
    strict: Annotated[bool, Parameter(help="exit with code 1 if there are warnings", negative="")] = False,
    ranks: Annotated[int | None, Parameter(help="number of processes that are to share the run")] = None,
    division: Annotated[str | None, Parameter(help=DIVISION)] = None,
    picture: Annotated[Path | None, Parameter(help="PNG file for a drawing of the case, seen along y")] = None,
    json: Annotated[bool, Parameter(help=JSON, negative="")] = False,
) -> None:
    """Check a case before it runs: numbers, time steps, cost, warnings and errors. Nothing is run.

    Exit code: 0 without errors, 2 with errors.

    Example: cfddem check liquid-bed --set bed.inlet_velocity=0.04
    """
    from cfddem.case.gallery import find_case
    from cfddem.io.files import require_folder
    from cfddem.run.check import check as checked

    shape = division_of(division) if division else None
    ranks = math.prod(shape) if shape and not ranks else ranks
    described = changes.case(find_case(case))
    result = checked(described, ranks, shape)
    if picture is not None:
        if picture.suffix.lower() != ".png":
            raise InputError("--picture", str(picture), "a PNG file", "let its name end in .png")
        require_folder(picture)
        from cfddem.plotting.case_drawing import case_drawing
        from cfddem.plotting.curves import save

        save(case_drawing(described), picture)
    if json:
        print_json("check", result.summary())
    else:
        print("\n".join(with_colour(result.lines())))
    sys.exit({"ok": 0, "warning": int(strict), "error": 2}[result.status])


_COLOURS = {"ok": "32", "warning": "33", "error": "31"}
"""Terminal colour codes of the words that state a status."""


def with_colour(lines: Iterable[str]) -> Iterator[str]:
    """Lines with their leading status word coloured on a terminal; unchanged elsewhere, or where NO_COLOR is set."""
    if not sys.stdout.isatty() or os.environ.get("NO_COLOR"):
        yield from lines
        return
    for line in lines:
        yield re.sub(r"^(ok|warning|error)(?=:)", lambda word: f"\x1b[{_COLOURS[word[0]]}m{word[0]}\x1b[0m", line)


def stability(
    case: Annotated[Path | None, Parameter(help=CASE)] = None,
    *,
    changes: Changes = AS_IT_IS,
    plot: Annotated[Path | None, Parameter(help="PNG file for growth and speed against wavelength")] = None,
    json: Annotated[bool, Parameter(help=JSON, negative="")] = False,
) -> None:
    """Show which waves grow in a liquid bed, by linear theory: growth and speed against wavelength. Nothing is run.

    The theory has the drag law, kernel, added mass and agitation of the case, and the damping of its cells.

    Example: cfddem stability liquid-bed --set agitation=free_spheres
    """
    from cfddem.case.gallery import find_case
    from cfddem.io.files import require_folder
    from cfddem.preflight.bed_estimate import estimate_bed
    from cfddem.preflight.bed_waves import lines, summary, waves_of
    from cfddem.preflight.summary import refused_extremes

    require_folder(plot)
    described = changes.case(find_case(case))
    with refused_extremes(described):
        waves = waves_of(described, estimate_bed(described))
    if waves is None:
        remedy = "waves are computed for free particles above minimum fluidisation, denser than their liquid"
        raise InputError("case", described.title or None, "a fluidised liquid bed", remedy)
    if json:
        print_json("stability", summary(waves))
    else:
        print("\n".join(lines(waves)))
    if plot is not None:
        from cfddem.plotting.study_figures import growth_curves

        growth_curves(waves, plot)
        print(f"figure: {plot}", file=sys.stderr if json else sys.stdout)


def run(
    case: Annotated[Path | None, Parameter(help=CASE)] = None,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="new folder; default: NAME-run")] = None,
    changes: Changes = AS_IT_IS,
    processors: Processors = WHOLE_MACHINE,
    go_on: Annotated[bool, Parameter(name="--continue", help=CONTINUE, negative="")] = False,
    origin: Annotated[Path | None, Parameter(name="--from", help=FROM)] = None,
    log: Annotated[Path | None, Parameter(help=LOG)] = None,
    json: Annotated[bool, Parameter(help=REPORT, negative="")] = False,
) -> None:
    """Run a case, write snapshots and history to a new folder, and print a report.

    The case is checked first. With errors it is not run. With --from, the run has the case of another one, changed by
    --set, and begins where that has ended, with its particles, contacts, flow and time.

    Example: cfddem run liquid-bed -o bed --set run.until=0.02 --set average_from=0.01
    """
    from cfddem.case.gallery import find_case
    from cfddem.case.toml_text import read_text
    from cfddem.io.folder import read_about

    if origin is None:
        path = find_case(case)
        folder = output or Path(f"{path.stem}-run")
    else:
        if case is not None:
            remedy = "change its values with --set KEY=VALUE"
            raise InputError("case", str(case), f"left out: the case is that of {origin}", remedy)
        read_about(origin)
        path, folder = origin / "case.toml", output or Path(f"{origin.absolute().name}-run")
    described = changes.case(path)
    communicator = on_ranks(processors.ranks, processors.threads, folder, processors.division)
    if go_on and (folder / "run.json").exists():
        if communicator.rank == 0:
            _warn_of_another_case(described, folder)
        resume(folder, processors=processors, log=log, json=json)
        return
    _refuse_or_warn(described, communicator)
    from cfddem.backend.compile import use_threads
    from cfddem.run.progress import live_line
    from cfddem.run.runner import Run
    from cfddem.run.warmup import threads_for, warmup

    if communicator.size == 1:
        use_threads(threads_for(described, processors.threads))
    with live_line(log, communicator.rank == 0) as line:
        text = None if changes.set or origin is not None else read_text(path)
        with warmup(described) if communicator.rank == 0 else nullcontext():
            prepared = Run.begin(
                described, folder, text=text, report=line.update, progress=line.progress, communicator=communicator,
                origin=origin,
            )  # fmt: skip
        prepared.go()
    if communicator.rank == 0:
        _print_report(folder, json)


def _warn_of_another_case(described: Case, folder: Path) -> None:
    """Say where a case differs from that of the run that is resumed instead."""
    from cfddem.analysis.comparison import changed
    from cfddem.case.schema import Case

    keys = list(changed([Case.from_toml(folder / "case.toml"), described]))
    if keys:
        more = f" and {len(keys) - 3} more" * (len(keys) > 3)
        print(
            f"cfddem: warning: {', '.join(keys[:3])}{more}: the case given differs from that of {folder}, which goes "
            "on with its own; for the case given, choose another folder",
            file=sys.stderr,
        )


def _refuse_or_warn(described: Case, communicator: Communicator) -> None:
    """Refuse a case with errors, or one that ranks cannot share; print its warnings."""
    from cfddem.preflight.summary import refuse_errors

    if communicator.size > 1:
        from cfddem.run.division import require_parallel

        require_parallel(described, communicator.size, communicator.shape)
    result = refuse_errors(described)
    if communicator.rank == 0:
        print_warnings(result)


def print_warnings(result: Preflight) -> None:
    """Print the errors and warnings of a pre-run check."""
    for issue in result.to_act_on:
        print("\n".join(issue.lines("cfddem: ")), file=sys.stderr)


def _print_report(folder: Path, json: bool) -> None:
    """Print the report of a run, and where the run is."""
    from cfddem.analysis.report import report as summary
    from cfddem.analysis.report_text import lines

    if json:
        print_json("report", summary(folder).summary())
        return
    print("\n".join(lines(summary(folder))))
    print(f"\nwritten to {folder}; for a picture: cfddem view {folder}")


def resume(
    folder: Annotated[Path | None, Parameter(help="run folder; default: the newest one here")] = None,
    *,
    until: Annotated[float | None, Parameter(help="new end time [s]")] = None,
    laws: Annotated[list[Path] | None, Parameter(help=LAWS, negative="")] = None,
    set: Annotated[list[str] | None, Parameter(show=False, negative="")] = None,
    processors: Processors = WHOLE_MACHINE,
    log: Annotated[Path | None, Parameter(help=LOG)] = None,
    json: Annotated[bool, Parameter(help=REPORT, negative="")] = False,
) -> None:
    """Continue a run that was stopped or killed, or extend one that has finished, and print a report.

    The result is the same to the last bit as that of an uninterrupted run.

    Example: cfddem resume bed --until 0.03
    """
    from cfddem.backend.compile import use_threads
    from cfddem.io.reading import newest_run, open_run
    from cfddem.run.progress import live_line
    from cfddem.run.resuming import case_to_continue
    from cfddem.run.runner import Run
    from cfddem.run.warmup import threads_for

    folder = folder or newest_run(Path())
    if set:
        values = shlex.join(word for value in set for word in ("--set", value))
        remedy = f"to go on with another value: cfddem run --from {folder} {values} -o NEW"
        raise InputError("--set", set[0], "left out: resume goes on with the case of the run and takes --until", remedy)
    communicator = on_ranks(processors.ranks, processors.threads, folder, processors.division)
    import_laws(laws or ())
    if until is None and (before := open_run(folder)).status == "finished":
        if communicator.rank == 0 and json:
            _print_report(folder, json)
        elif communicator.rank == 0:
            print(f"{folder} has already finished, at {before.history['time'][-1]:g} s; extend it with --until TIME")
        return
    if communicator.size == 1:
        use_threads(threads_for(case_to_continue(folder, None, until), processors.threads))
    with live_line(log, communicator.rank == 0) as line:
        Run.resume(folder, until=until, report=line.update, progress=line.progress, communicator=communicator).go()
    if communicator.rank == 0:
        _print_report(folder, json)
