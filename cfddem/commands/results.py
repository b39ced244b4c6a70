"""Commands about what a run has written."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def report(
    folder: Annotated[Path | None, Parameter(help="of a run; the newest one here if not given")] = None,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="page; NAME-report.html here")] = None,
    json: Annotated[bool, Parameter(help="print the result as JSON instead; no page without -o", negative="")] = False,
) -> None:
    """Say what came out of a run, and write it on an HTML page with figures: means with errors, laws of beds, warnings.

    Example: cfddem report bed
    """
    from cfddem.record.files import must_have_folder
    from cfddem.record.reading import newest_run
    from cfddem.report import as_json, lines
    from cfddem.report import report as summary

    folder = folder or newest_run(Path())
    must_have_folder(output)
    result = summary(folder)
    if json and output is None:
        print(as_json(result))
        return
    from cfddem.view.page import page

    written = page(folder, output, result)
    print(as_json(result) if json else "\n".join([*lines(result), "", f"  with figures: {written}"]))


def view(
    folder: Annotated[Path | None, Parameter(help="of a run; the newest one here if not given")] = None,
    *,
    output: Annotated[
        Path | None, Parameter(name=["--output", "-o"], help="PNG to write; NAME.png here if not given")
    ] = None,
    snapshot: Annotated[int, Parameter(help="0 the first, -1 the last")] = -1,
    show: Annotated[list[str] | None, Parameter(help="spheres, voidage, bubbles, streamlines; repeat for more")] = None,
    colour: Annotated[str, Parameter(help="of the spheres: speed, or a recorded field")] = "speed",
    movie: Annotated[Path | None, Parameter(help="film of all snapshots instead, .mp4 or .gif")] = None,
    history: Annotated[bool, Parameter(help="curves in time instead", negative="")] = False,
    encounters: Annotated[bool, Parameter(help="map of the encounters instead, where recorded", negative="")] = False,
    window: Annotated[bool, Parameter(help="on the screen instead", negative="")] = False,
) -> None:
    """Make a picture of a run, a film, or curves in time.

    Example: cfddem view bed --movie bed.gif
    """
    from cfddem.record.files import must_have_folder
    from cfddem.record.reading import newest_run
    from cfddem.view import pictures, plots
    from cfddem.view.window import window as on_screen

    folder, panels = folder or newest_run(Path()), show or ()
    must_have_folder(output)
    must_have_folder(movie)
    if window:
        on_screen(folder, colour)
    elif movie is not None:
        print(pictures.movie(folder, movie, show=panels, colour=colour))
    elif encounters:
        print(plots.encounters(folder, output))
    elif history:
        print(plots.history(folder, output))
    else:
        print(pictures.picture(folder, output, snapshot=snapshot, show=panels, colour=colour))


def export(
    folder: Annotated[Path | None, Parameter(help="of a run; the newest one here if not given")] = None,
    *,
    to: Annotated[str, Parameter(help="vtu, csv or netcdf")] = "vtu",
    output: Annotated[
        Path | None, Parameter(name=["--output", "-o"], help="folder to write to; NAME-FORMAT here if not given")
    ] = None,
    snapshot: Annotated[list[int] | None, Parameter(help="0 the first, -1 the last; all if not given")] = None,
) -> None:
    """Write a run in another format. ParaView, pyvista and h5py open run.vtkhdf as it is.

    Example: cfddem export bed --to csv
    """
    from cfddem.record.export import export as run
    from cfddem.record.reading import newest_run

    files = run(folder or newest_run(Path()), to, output, snapshot)
    print(f"{len(files)} files in {files[0].parent}" if files else "nothing to write: the run holds no snapshot")
