"""Commands for the results of a run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from cfddem.cli.json_output import print_json

if TYPE_CHECKING:
    from cfddem.analysis.report_text import Report

FOLDER = "run folder; default: the newest one here"
FILES = "print the names of the written files as JSON"
PANELS = "spheres, voidage, bubbles, streamlines, or temperature or vapour of the fluid; may be repeated"
COLOUR = (
    "what colours the spheres: speed, collisions, moisture, or a recorded field (species, temperature, liquid, "
    "agglomerate); default: species of a mixture, else speed"
)


def report(
    folder: Annotated[Path | None, Parameter(help=FOLDER)] = None,
    *,
    output: Annotated[
        Path | None, Parameter(name=["--output", "-o"], help="HTML or Markdown (.md) file; default: NAME-report.html")
    ] = None,
    json: Annotated[
        bool, Parameter(help="print the report as JSON; writes no page unless -o is given", negative="")
    ] = False,
    markdown: Annotated[
        bool, Parameter(help="print the report as Markdown; writes no page unless -o is given", negative="")
    ] = False,
    data: Annotated[
        list[Path] | None,
        Parameter(help="CSV file of measured points, beside those of the case; may be repeated", negative=""),
    ] = None,
) -> None:
    """Report the results of a run as text and as a page with figures.

    The answer comes first: bed height, voidage, pressure drop and regime, each with its error and a verdict. Then come
    warnings by what to do about them, all means, comparison with correlations, and conservation.

    Example: cfddem report bed
    """
    from cfddem.analysis.report import report as summary
    from cfddem.analysis.report_text import lines
    from cfddem.io.files import require_folder
    from cfddem.io.reading import newest_run

    folder = folder or newest_run(Path())
    require_folder(output)
    result = summary(folder, data or ())
    if (json or markdown) and output is None:
        _print(result, json)
        return
    from cfddem.plotting.report_page import markdown_page, page

    if output is not None and output.suffix.lower() == ".md":
        written = markdown_page(folder, output, result, data or ())
    else:
        written = page(folder, output, result, data or ())
    if json or markdown:
        _print(result, json)
    else:
        print("\n".join([*lines(result), "", f"  page with figures: {written}"]))


def _print(result: Report, json: bool) -> None:
    """Print a report as JSON or as Markdown."""
    from cfddem.analysis.report_text import markdown

    if json:
        print_json("report", result.summary())
    else:
        print(markdown(result).rstrip())


def compare(
    folders: Annotated[
        list[Path], Parameter(help="run folders, or that of a sweep; the first run is the reference", negative="")
    ],
    *,
    output: Annotated[
        Path, Parameter(name=["--output", "-o"], help="HTML page, or PNG with the histories alone")
    ] = Path("compare.html"),
    json: Annotated[bool, Parameter(help="print the comparison as JSON", negative="")] = False,
) -> None:
    """Compare runs: keys of their cases that differ, means with differences over their errors, curves in one figure.

    Example: cfddem compare seeds/seed-1 seeds/seed-2
    """
    from cfddem.analysis.comparison import compare as compared
    from cfddem.analysis.comparison import lines
    from cfddem.backend.errors import InputError
    from cfddem.io.files import require_folder
    from cfddem.io.folder import runs_inside

    require_folder(output)
    folders = [
        run
        for folder in folders
        for run in ([folder] if (folder / "run.json").exists() else runs_inside(folder) or [folder])
    ]
    if output.suffix.lower() not in (".html", ".png"):
        raise InputError("output", str(output), "a file that ends in .html or .png")
    result = compared(folders)
    from cfddem.plotting.report_page import comparison_page

    written = comparison_page(folders, output, result)
    if json:
        print_json("compare", result | {"page": written})
        return
    kind = "figure" if output.suffix.lower() == ".png" else "page with figures"
    print("\n".join([*lines(result), "", f"{kind}: {written}"]))


@Parameter(name="*")
@dataclass(frozen=True)
class Look:
    """What a picture or movie shows; its fields are options."""

    snapshot: Annotated[int, Parameter(help="number of the snapshot; 0 is the first, -1 the last")] = -1
    show: Annotated[list[str] | None, Parameter(help=PANELS, negative="")] = None
    colour: Annotated[str | None, Parameter(help=COLOUR)] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Instead:
    """What is made instead of a picture; its fields are options."""

    movie: Annotated[Path | None, Parameter(help="movie of all snapshots, .gif, or .mp4 with cfddem[movie]")] = None
    history: Annotated[bool, Parameter(help="curves over time instead of a picture", negative="")] = False
    collisions: Annotated[bool, Parameter(help="map of recorded collisions instead of a picture", negative="")] = False
    waves: Annotated[bool, Parameter(help="solid fraction over height and time instead", negative="")] = False
    window: Annotated[bool, Parameter(help="interactive window instead of a file", negative="")] = False
    web: Annotated[bool, Parameter(help="page in the browser instead of a file; stop with Ctrl-C", negative="")] = False
    port: Annotated[int | None, Parameter(help="port of the page; default: 8080, or any free one")] = None


LAST, PICTURE = Look(), Instead()


def view(
    folder: Annotated[Path | None, Parameter(help=FOLDER)] = None,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="PNG file; default: NAME.png")] = None,
    look: Look = LAST,
    instead: Instead = PICTURE,
    json: Annotated[bool, Parameter(help=FILES, negative="")] = False,
) -> None:
    """Make a picture or movie of a run, or curves over time; or look at it in a window or in the browser.

    The page in the browser follows a run that is still going. It can be opened on this computer only.

    Example: cfddem view bed --movie bed.gif
    """
    from cfddem.io.files import require_folder
    from cfddem.io.reading import newest_run, open_run
    from cfddem.plotting import curves as plots
    from cfddem.plotting import pictures, study_figures
    from cfddem.plotting.colours import usual
    from cfddem.plotting.scene import window as on_screen

    folder, panels, colour = folder or newest_run(Path()), look.show or (), look.colour
    require_folder(output)
    require_folder(instead.movie)
    if instead.web:
        from cfddem.plotting.browser import browse

        browse(folder, colour or usual(open_run(folder)), instead.port)
    elif instead.window:
        on_screen(folder, colour or usual(open_run(folder)))
    else:
        if instead.movie is not None:
            written = pictures.movie(folder, instead.movie, show=panels, colour=colour)
        elif instead.collisions:
            written = plots.collisions(folder, output)
        elif instead.waves:
            written = study_figures.wave_map(folder, output)
        elif instead.history:
            written = plots.history(folder, output)
        else:
            written = pictures.picture(folder, output, snapshot=look.snapshot, show=panels, colour=colour)
        if json:
            print_json("written", {"files": [written]})
        else:
            print(written)


def export(
    folder: Annotated[Path | None, Parameter(help=FOLDER)] = None,
    *,
    to: Annotated[str, Parameter(help="format: vtu, csv or netcdf")] = "vtu",
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="folder; default: NAME-FORMAT")] = None,
    snapshot: Annotated[
        list[int] | None, Parameter(help="number of a snapshot, may be repeated; default: all", negative="")
    ] = None,
    json: Annotated[bool, Parameter(help=FILES, negative="")] = False,
) -> None:
    """Convert a run to another format. ParaView, pyvista and h5py read run.vtkhdf directly.

    Example: cfddem export bed --to csv
    """
    from cfddem.io.export import export as run
    from cfddem.io.reading import newest_run

    files = run(folder or newest_run(Path()), to, output, snapshot)
    if json:
        print_json("written", {"files": files})
        return
    print(f"{len(files)} files in {files[0].parent}" if files else "nothing written: the run has no snapshots")
