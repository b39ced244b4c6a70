"""Commands for the results of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def report(
    folder: Annotated[Path | None, Parameter(help="run folder; default: the newest one here")] = None,
    *,
    output: Annotated[
        Path | None, Parameter(name=["--output", "-o"], help="HTML file; default: NAME-report.html")
    ] = None,
    json: Annotated[
        bool, Parameter(help="print the report as JSON; writes no page unless -o is given", negative="")
    ] = False,
) -> None:
    """Report the results of a run as text and as an HTML page with figures.

    The report holds time averages with errors, comparison with correlations, conservation and warnings.

    Example: cfddem report bed
    """
    from cfddem.analysis.report import report as summary
    from cfddem.analysis.report_text import as_json, lines
    from cfddem.io.files import require_folder
    from cfddem.io.reading import newest_run

    folder = folder or newest_run(Path())
    require_folder(output)
    result = summary(folder)
    if json and output is None:
        print(as_json(result))
        return
    from cfddem.plotting.report_page import page

    written = page(folder, output, result)
    print(as_json(result) if json else "\n".join([*lines(result), "", f"  page with figures: {written}"]))


def view(
    folder: Annotated[Path | None, Parameter(help="run folder; default: the newest one here")] = None,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="PNG file; default: NAME.png")] = None,
    snapshot: Annotated[int, Parameter(help="number of the snapshot; 0 is the first, -1 the last")] = -1,
    show: Annotated[
        list[str] | None, Parameter(help="spheres, voidage, bubbles or streamlines; may be repeated", negative="")
    ] = None,
    colour: Annotated[
        str,
        Parameter(help="quantity that colours the spheres: speed, or a recorded field (liquid, agglomerate)"),
    ] = "speed",
    movie: Annotated[Path | None, Parameter(help="movie of all snapshots, .mp4 or .gif")] = None,
    history: Annotated[bool, Parameter(help="curves over time instead of a picture", negative="")] = False,
    collisions: Annotated[bool, Parameter(help="map of recorded collisions instead of a picture", negative="")] = False,
    waves: Annotated[bool, Parameter(help="solid fraction over height and time instead", negative="")] = False,
    window: Annotated[bool, Parameter(help="interactive window instead of a file", negative="")] = False,
) -> None:
    """Make a picture or movie of a run, or curves over time.

    Example: cfddem view bed --movie bed.gif
    """
    from cfddem.io.files import require_folder
    from cfddem.io.reading import newest_run
    from cfddem.plotting import curves as plots
    from cfddem.plotting import pictures, wave_figures
    from cfddem.plotting.window import window as on_screen

    folder, panels = folder or newest_run(Path()), show or ()
    require_folder(output)
    require_folder(movie)
    if window:
        on_screen(folder, colour)
    elif movie is not None:
        print(pictures.movie(folder, movie, show=panels, colour=colour))
    elif collisions:
        print(plots.collisions(folder, output))
    elif waves:
        print(wave_figures.wave_map(folder, output))
    elif history:
        print(plots.history(folder, output))
    else:
        print(pictures.picture(folder, output, snapshot=snapshot, show=panels, colour=colour))


def export(
    folder: Annotated[Path | None, Parameter(help="run folder; default: the newest one here")] = None,
    *,
    to: Annotated[str, Parameter(help="format: vtu, csv or netcdf")] = "vtu",
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="folder; default: NAME-FORMAT")] = None,
    snapshot: Annotated[
        list[int] | None, Parameter(help="number of a snapshot, may be repeated; default: all", negative="")
    ] = None,
) -> None:
    """Convert a run to another format. ParaView, pyvista and h5py read run.vtkhdf directly.

    Example: cfddem export bed --to csv
    """
    from cfddem.io.export import export as run
    from cfddem.io.reading import newest_run

    files = run(folder or newest_run(Path()), to, output, snapshot)
    print(f"{len(files)} files in {files[0].parent}" if files else "nothing written: the run has no snapshots")
