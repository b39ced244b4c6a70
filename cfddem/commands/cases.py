"""Commands about cases: begin one, check it, run it, go on with it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def run(
    case: Annotated[Path | None, Parameter(help="TOML file, or a name of the gallery; the only one here")] = None,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="new folder; NAME-run")] = None,
    set: Annotated[list[str] | None, Parameter(help="key=value in place of the file's; repeat for more")] = None,
    threads: Annotated[int | None, Parameter(help="of the machine; all if not given")] = None,
) -> None:
    """Run a case into a folder, and report what came out.

    Example: cfddem run liquid-bed -o bed --set run.until=0.1
    """
    from cfddem.case import Case
    from cfddem.gallery import find_case, overrides
    from cfddem.kernels import use_threads
    from cfddem.progress import live_line
    from cfddem.report import lines
    from cfddem.report import report as summary
    from cfddem.run import Run

    path = find_case(case)
    described = Case.from_toml(path, overrides(set or []))
    folder = output or Path(f"{path.stem}-run")
    use_threads(threads)
    with live_line() as line:
        text = described.to_toml() if set else path.read_text()
        Run.begin(described, folder, text=text, report=line.update, progress=line.say).go()
    print("\n".join(lines(summary(folder))))
    print(f"\nwritten to {folder}; see it with: cfddem view {folder}")


def resume(
    folder: Annotated[Path | None, Parameter(help="of a run; the newest one here if not given")] = None,
    *,
    until: Annotated[float | None, Parameter(help="new end [s]")] = None,
    threads: Annotated[int | None, Parameter(help="of the machine; all if not given")] = None,
) -> None:
    """Go on with a run that was stopped or killed, to the same bits.

    Example: cfddem resume bed --until 0.12
    """
    from cfddem.kernels import use_threads
    from cfddem.progress import live_line
    from cfddem.record.reading import newest_run
    from cfddem.run import Run

    use_threads(threads)
    folder = folder or newest_run(Path())
    with live_line() as line:
        Run.resume(folder, until=until, report=line.update, progress=line.say).go()
    print(f"written to {folder}")
