"""`cfddem validate heat`: heat and drying beside exact solutions, measurements and balances."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, label, legend, panels, save
from scenarios.validation.heat import drops, hot_bed, packed, scheme, spheres
from scenarios.validation.table import Curves, Progress, Row, in_parts

PARTS = (
    spheres.exact_cases, drops.mfix, drops.fujita, scheme.orders, scheme.conservation, packed.schumann,
    packed.wet_drops, packed.dried_beads, hot_bed.hot_bed,
)  # fmt: skip


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    return in_parts(PARTS, _draw, folder, progress)


def _draw(folder: Path, curves: Curves) -> None:
    """Drops that shrink, hot seeds that cool, and a packed bed that cools."""
    figure, (left, middle, right) = panels(3, width=11.0, height=4.0)
    colours = (BLUE, ORANGE, GREEN, GREY)
    for ((speed, fraction), measured), colour in zip(drops.SHRUNK.items(), colours):
        run = curves[f"fujita/{speed:g} m per s, vapour {fraction:g}"]
        name = f"{speed:g} m/s, {'30 %' if fraction else 'dry'}"
        left.plot(run["time"][0], run["area"][0], color=colour, label=name)
        left.plot(drops.TIMES, measured, "o", ms=4, color=colour)
    label(left, "time", "s", "(d/d0)², points: Fujita", "-")
    legend(left)
    columns = {name: values for name, (values, _) in curves["hot bed"].items()}
    for name, colour, line in (
        ("run", BLUE, "-"), ("every cell", ORANGE, "--"), ("layers", GREEN, ":"), ("mixed at once", GREY, "-."),
    ):  # fmt: skip
        shown = name if name == "run" else f"balance: {name}"
        middle.plot(columns["time"], columns[name], color=colour, ls=line, label=shown)
    label(middle, "time", "s", "mean temperature of hot seeds", "K")
    legend(middle)
    for name, colour in zip(("0.5 s", "0.8 s", "1.1 s"), colours):
        run = curves[f"schumann/{name}"]
        right.plot(1e3 * np.asarray(run["height"][0]), run["exact"][0], color=colour, label=f"exact, {name}")
        right.plot(1e3 * np.asarray(run["height"][0]), run["solids"][0], "o", ms=3, color=colour)
    label(right, "height", "mm", "cooling of a packed bed, points: run", "-")
    legend(right)
    save(figure, folder / "heat.png")
