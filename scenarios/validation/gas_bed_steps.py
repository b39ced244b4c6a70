"""Whether a small gas bed with sharp surfaces depends on its fluid step, its cells and its kernel.

It has 2 000 seeds of the case `gas-bed`, 12 diameters high in a square column of 12 diameters, and slugs. Every run has
the same seed, so that the errors are those of time alone. The bed drifts for seconds, so that every run is compared
with the bed as it is over the same time. Runs are kept as folders: interrupted runs are continued, and finished runs
are not repeated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import numpy as np

from cfddem.analysis.bed_laws import buoyant_weight
from cfddem.backend.compile import use_threads
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run
from scenarios.beds.gas_bed.study import mueller
from scenarios.validation.kept_runs import finished, taken
from scenarios.validation.table import Progress, Row

BEGIN, SLUG = 0.4, 1.0 / 6.0
"""Begin of the means, and length of a slug, over which blocks are taken [s]."""

EDGE = 0.0144
"""Width and depth of the column [m]: five cells of 2.40 diameters, or seven of 1.71."""


@dataclass(frozen=True)
class Variant:
    """A run of the bed with other steps, cells or kernel."""

    name: str
    changes: dict[str, float] = field(hash=False)
    until: float  # [s]


VARIANTS = (
    Variant("0.5 ms, 2.40 d", {}, 2.9),
    Variant("0.125 ms, 2.40 d", {"run.fluid_step": 1.25e-4}, 1.2),
    Variant("0.5 ms, 1.71 d", {"column.cell": EDGE / 7.0}, 2.2),
    Variant("0.25 ms, 2.40 d", {"run.fluid_step": 2.5e-4}, 2.9),
    Variant("0.5 ms, 2.40 d, kernel of 1 d", {"laws.kernel_width": 1.0}, 2.9),
    Variant("0.5 ms, 2.40 d, kernel of 2 d", {"laws.kernel_width": 2.0}, 2.9),
)
"""The first is the bed as it is; 0.5 ms is its default step, and 1.5 d its default kernel."""


class Value(NamedTuple):
    """A mean with the standard error of its blocks."""

    mean: float
    error: float


class Means(NamedTuple):
    """What is compared."""

    height: Value  # [m]
    drop: Value  # over the weight of the bed
    deviation: Value  # of the drop in time, likewise
    carried: Value  # by gas and floor together, likewise


QUANTITIES = {
    "mean height": "m",
    "pressure drop over weight": "-",
    "its deviation in time": "-",
    "pressure drop and wall load over weight": "-",
}
"""Names of the means, in their order, with their units."""


def bed() -> Case:
    """The small bed, with sharp surfaces, the default."""
    return mueller().with_(**{
        "title": "Small slugging bed", "column.width": EDGE, "column.depth": EDGE, "column.height": 5.0 * EDGE,
        "column.cell": EDGE / 5.0, "bed.count": 2000, "run.average_from": BEGIN,
    })  # fmt: skip


def study(folder: Path, progress: Progress, hours: float = math.inf) -> list[Row]:
    """Make the missing runs, each on one thread, and return the table of those there are.

    Several processes may share the folder. From then on, this process runs on one thread.

    hours  after which no further run begins
    """
    use_threads(1)
    end = monotonic() + 3600.0 * hours
    for variant in VARIANTS:
        if monotonic() <= end:
            with taken(folder, home(variant)) as mine:
                if mine:
                    finished(bed(), folder, home(variant), progress, variant.changes | {"run.until": variant.until})
    begun = [variant for variant in VARIANTS if (folder / home(variant) / "run.json").exists()]
    opened = {variant: open_run(folder / home(variant)) for variant in begun}
    runs = {variant: run for variant, run in opened.items() if run.status == "finished"}
    usual = runs.get(VARIANTS[0])
    return table({
        variant: (means(run, variant.until), means(usual, variant.until) if usual else None)
        for variant, run in runs.items()
    })  # fmt: skip


def home(variant: Variant) -> str:
    """Folder of a run.

    >>> home(VARIANTS[0])
    '0.5_ms_2.40_d'
    """
    return variant.name.replace(",", "").replace(" ", "_")


def means(run: RunData, until: float) -> Means:
    """Means of a run to a time [s], with the errors of blocks of a slug each."""
    history, case = run.history, Case.from_text(run.case_text)
    weight = buoyant_weight(case) / case.column.floor_area
    inside = (history["time"] > BEGIN) & (history["time"] < until + 1e-9)
    drop, floor = (history[name][inside] / weight for name in ("pressure_drop", "wall_load"))
    slugs = ((history["time"][inside] - BEGIN) / SLUG).astype(int)
    variance = blocked((drop - drop.mean()) ** 2, slugs)
    deviation = math.sqrt(variance.mean)
    return Means(
        blocked(history["bed_height"][inside], slugs), blocked(drop, slugs),
        Value(deviation, 0.5 * variance.error / deviation), blocked(drop + floor, slugs),
    )  # fmt: skip


def blocked(values: np.ndarray, blocks: np.ndarray) -> Value:
    """Mean of all values, and the standard error of the means of whole blocks.

    blocks  number of the block of each value, ascending; the last one may be incomplete
    """
    parts = [values[blocks == block].mean() for block in range(blocks[-1])]
    return Value(float(values.mean()), float(np.std(parts, ddof=1) / math.sqrt(len(parts))))


def table(by_variant: Mapping[Variant, tuple[Means, Means | None]]) -> list[Row]:
    """Every mean, beside that of the bed as it is over the same time."""
    rows = []
    for variant, (own, usual) in by_variant.items():
        for place, (quantity, unit) in enumerate(QUANTITIES.items()):
            value, other = own[place], usual[place] if usual and variant.changes else None
            note = f"error {value.error:.2g}" + (f", of the reference {other.error:.2g}" if other else "")
            name = f"{variant.name}, {variant.until:g} s: {quantity}"
            rows.append(Row(name, value.mean, other.mean if other else None, unit=unit, note=note))
    return rows
