"""Targets of `cfddem validate`, and how one is run. Importing this module loads none of them."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from cfddem.backend.errors import InputError
from cfddem.backend.json_text import as_json
from cfddem.backend.tables import WIDTH, grid

if TYPE_CHECKING:
    from scenarios.validation.table import Progress, Row

TARGETS: dict[str, str] = {
    "binary-collision": "scenarios.collisions.immersed_pair.validation",
    "particles": "scenarios.validation.particles.study",
    "fluid": "scenarios.validation.fluid",
    "coupling": "scenarios.validation.coupling",
    "beds": "scenarios.validation.beds",
    "lubrication": "scenarios.beds.lubrication_study.validation",
    "bed-steps": "scenarios.beds.lubrication_study.steps",
    "gas-bed-steps": "scenarios.validation.gas_bed_steps",
    "film-map": "scenarios.validation.film_map.study",
    "film-impact": "scenarios.collisions.film_impact.validation",
    "wet-tumbler": "scenarios.collisions.wet_tumbler.validation",
    "wet": "scenarios.validation.wet",
    "wet-beds": "scenarios.beds.wet_bed.validation",
    "waves": "scenarios.validation.bed_waves.study",
    "agitation": "scenarios.validation.agitation.study",
    "sheared-films": "scenarios.validation.sheared_films.study",
    "heat": "scenarios.validation.heat.study",
    "drying": "scenarios.validation.heat.drying",
    "heated-bed": "scenarios.validation.heated_bed",
    "resolved": "scenarios.references.resolved_suspension.study",
}
"""Name of each target, and the module that holds its `study`."""

ONLY_IF_NAMED = ("resolved", "wet-beds", "bed-steps", "gas-bed-steps", "film-map")
"""Targets that take up to a day; `all` leaves them out."""

PIECEMEAL = ("wet-beds", "bed-steps", "gas-bed-steps", "film-map")
"""Targets that make their table of what has been computed, and go on with the rest another time."""


def validate(name: str, output: Path, data: Sequence[Path] = (), hours: float | None = None) -> bool:
    """Run a target, print its table and write its files into `output`/`name`; arguments as in :func:`measure`.

    returns  whether every limit holds
    """
    report = measure(name, output, data, hours)
    _show(report, Path(output) / name)
    return bool(report["holds"])


def measure(name: str, output: Path, data: Sequence[Path] = (), hours: float | None = None) -> dict[str, Any]:
    """Run a target and write its files into `output`/`name`.

    name     one of TARGETS
    output   folder for all targets
    data     files of measured points, for targets that have a function `compare_data`
    hours    after which a target of `PIECEMEAL` begins no further piece; the table is made of those there are
    returns  `target`, whether every limit `holds`, `seconds`, `versions` and `rows`, as in `table.json`
    """
    from scenarios.validation.table import replacing

    folder = Path(output) / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / ".writable").touch()
        (folder / ".writable").unlink()
    except OSError as refusal:
        raise InputError("output", str(output), "a folder that can be written", str(refusal)) from refusal
    begin = perf_counter()
    with _progress(name) as progress:
        module = import_module(TARGETS[name])
        compared: Sequence[Row] = [module.compare_data(folder, path) for path in data]  # wrong files end early
        limited = {} if hours is None else {"hours": hours}
        rows: Sequence[Row] = [*module.study(folder, progress, **limited), *compared]
    seconds = perf_counter() - begin
    report = {
        "target": name,
        "holds": all(row.verdict != "FAILS" for row in rows),
        "seconds": round(seconds, 1),
        "versions": {"python": platform.python_version()}
        | {package: version(package) for package in ("cfddem", "numpy", "numba")},
        "rows": [row.as_dict() for row in rows],
    }
    with replacing(folder / "table.json") as path:
        path.write_text(as_json(report, indent=1) + "\n", encoding="utf-8")
    return report


@contextmanager
def _progress(name: str) -> Iterator[Progress]:
    """Show on a terminal what is being computed; print nothing otherwise."""
    from rich.console import Console

    with Console(stderr=True).status(name) as status:
        yield lambda doing: status.update(f"{name}: {doing}")


def _show(report: Mapping[str, Any], folder: Path) -> None:
    """Print the table, the verdict and the folder of the files."""
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False)
    console = Console(highlight=False, width=min(WIDTH, console.width) if console.is_terminal else WIDTH)
    colour = {"holds": "green", "FAILS": "bold red", "report": "dim"}
    shown: list[Sequence[str | Text]] = [
        (
            row["quantity"] if row["unit"] == "-" else f"{row['quantity']} [{row['unit']}]",
            *(_number(row[name]) for name in ("value", "reference", "difference", "limit")),
            Text(row["verdict"], style=colour[row["verdict"]], no_wrap=True),
        )
        for row in report["rows"]
    ]
    headings = ("quantity (worst of n)", "model", "reference", "difference", "limit", "verdict")
    console.print(grid(shown, headings, right=(1, 2, 3, 4), widths=(20, 0, 0, 0, 0, 7), gap=2))
    verdicts = [row["verdict"] for row in report["rows"]]
    judged = len(verdicts) - verdicts.count("report")
    console.print(
        f"{report['target']}: {judged - verdicts.count('FAILS')} of {judged} limits hold; "
        f"{verdicts.count('report')} rows are for information."
    )
    print(f"{report['seconds']:.0f} s; figures, histories and table in {folder}")


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
