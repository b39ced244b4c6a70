"""Figures of three wet spheres: outcomes over Stokes number and angle, restitutions, and sequences of positions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, SKY, label, legend, panels, save
from scenarios.collisions.three_spheres.study import OUTCOMES, Triplet, centres, outcomes

COLOURS = {"FA": "#3b3b3b", "PA1": BLUE, "PA2": GREEN, "PA3": ORANGE, "FS": "#dcebf5"}
MEANINGS = {
    "FA": "FA: all stick",
    "PA1": "PA1: sphere 1 leaves",
    "PA2": "PA2: sphere 2 leaves",
    "PA3": "PA3: sphere 3 leaves",
    "FS": "FS: all separate",
}
SPHERES = {1: BLUE, 2: GREY, 3: ORANGE}


def outcome_map(stokes: np.ndarray, theta12: np.ndarray, table: dict[str, np.ndarray], title: str = "") -> Any:
    """Which spheres stick together, over Stokes number and angle of impact."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    figure, axes = panels(width=8.4, height=4.8)
    numbers = np.vectorize(OUTCOMES.index)(table["outcome"])
    colours = ListedColormap([COLOURS[outcome] for outcome in OUTCOMES])
    axes.pcolormesh(
        stokes, theta12, numbers, cmap=colours, norm=BoundaryNorm(np.arange(-0.5, 5.0), 5), shading="nearest"
    )
    axes.grid(False)
    for outcome in (name for name in OUTCOMES if name in table["outcome"]):
        axes.plot([], [], "s", ms=9, color=COLOURS[outcome], label=MEANINGS[outcome])
    label(axes, "Stokes number  $St_n$", "-", r"angle of impact  $\theta_{12}$", "deg", title)
    legend(axes, loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure


def draw_map(path: Path, conditions: dict[str, Any], count: int = 40) -> None:
    """Draw the map of outcomes for Stokes numbers up to 20 and all angles, by the equations; the rest as given."""
    stokes, theta12 = np.linspace(0.5, 20.0, count), np.linspace(0.0, 85.0, count)
    kept = {name: value for name, value in conditions.items() if name not in ("stokes", "theta12", "solver")}
    number = kept.get("capillary_number", math.inf)
    title = "no capillary pull" if number == math.inf else f"capillary number {number:g}"
    save(outcome_map(stokes, theta12, outcomes(stokes, theta12, **kept), title), path)


def restitution_contours(stokes: np.ndarray, theta12: np.ndarray, table: dict[str, np.ndarray]) -> Any:
    """Wet restitution of both pairs, as in figure 10(b) of Davis (2023)."""
    figure, panel = panels(2, width=10.0, height=4.6, sharey=True)
    for axes, pair, levels, colour in (
        (panel[0], "12", np.arange(0.1, 0.85, 0.1), BLUE),
        (panel[1], "23", np.arange(0.1, 0.65, 0.1), ORANGE),
    ):
        lines = axes.contour(stokes, theta12, table[f"restitution{pair}"], levels=levels, colors=colour, linewidths=1.5)
        axes.clabel(lines, fontsize=8.5, fmt="%.1f")
        label(
            axes,
            "Stokes number  $St_n$",
            "-",
            r"angle of impact  $\theta_{12}$" if pair == "12" else "",
            "deg" if pair == "12" else "",
            f"wet restitution of spheres {pair[0]} and {pair[1]}",
        )
    panel[1].set_ylabel("")
    return figure


def restitution_curves(stokes: np.ndarray, curves: dict[float, dict[str, np.ndarray]], head_on: np.ndarray) -> Any:
    """Wet restitution of both pairs against the Stokes number at several angles, and of two spheres head-on."""
    from cfddem.plotting.curves import shades

    figure, axes = panels(width=8.4, height=4.8)
    for colour, (angle, table) in zip(shades(len(curves)), curves.items()):
        axes.plot(stokes, table["restitution12"], color=colour, label=f"{angle:g} deg")
        axes.plot(stokes, table["restitution23"], color=colour, ls="--", lw=1.4)
    axes.plot([], [], color=GREY, label="spheres 1 and 2")
    axes.plot([], [], color=GREY, ls="--", lw=1.4, label="spheres 2 and 3")
    axes.plot(stokes, head_on, color=RED, ls=":", label="two spheres, head-on")
    axes.set(xlim=(0, stokes[-1]), ylim=(0, 1))
    label(axes, "Stokes number  $St_n$", "-", "wet restitution", "-", "Restitution of both pairs")
    legend(axes, loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure


def sequences(runs: list[tuple[str, Triplet, list[float]]], film_ratio: float = 0.01) -> Any:
    """Positions of the spheres at some times, one row per run, relative to their centre of mass."""
    from matplotlib.patches import Circle

    most = max(len(times) for _, _, times in runs)
    figure, _ = panels(width=1.65 * most, height=1.9 * len(runs))
    figure.clear()
    for row, (title, run, times) in enumerate(runs):
        places, clock = centres(run.history, film_ratio), run.history["time_star"]
        for column, time in enumerate(times):
            now = _at(time, clock, places)
            axes = figure.add_subplot(len(runs), most, row * most + column + 1)
            for sphere, colour in SPHERES.items():
                x, y = now[sphere - 1]
                axes.add_patch(Circle((x, y), 0.5, facecolor=colour, edgecolor="white", lw=0.8))
                axes.text(x, y, str(sphere), color="white", ha="center", va="center", fontsize=9)
            axes.set(xlim=(-2.2, 2.2), ylim=(-1.7, 1.7), aspect="equal", xticks=[], yticks=[])
            for side in axes.spines.values():
                side.set_visible(False)
            axes.set_title((f"{title}\n" if column == 0 else "\n") + f"t* = {time:.2f}", fontsize=9.5, loc="left")
    return figure


def _at(time: float, clock: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Positions of the spheres at a time; spheres that have separated fly on in straight lines."""
    last = int(np.searchsorted(clock, min(time, clock[-1])))
    first = max(int(np.searchsorted(clock, clock[last])) - 1, 0)
    share = (time - clock[first]) / (clock[last] - clock[first]) if last > first else 0.0
    return np.asarray(places[first] + share * (places[last] - places[first]))


def gaps(runs: dict[str, Triplet], minimum_gap: float) -> Any:
    """Gaps of the pairs 1-2 and 2-3 against time."""
    figure, axes = panels(width=8.0, height=4.4)
    for (title, run), colour in zip(runs.items(), (BLUE, GREEN, ORANGE, SKY)):
        time = run.history["time"]
        axes.plot(time, run.history["gap12"], color=colour, label=title)
        axes.plot(time, run.history["gap23"], color=colour, ls="--", lw=1.4)
    axes.axhline(minimum_gap, color=GREY, lw=1.0, ls=":")
    axes.plot([], [], color=GREY, label="spheres 1 and 2")
    axes.plot([], [], color=GREY, ls="--", lw=1.4, label="spheres 2 and 3")
    axes.set(xlim=(0, 6), ylim=(0, 1.02))
    label(axes, r"time  $t\,v_{n0}/\delta_{12}$", "-", r"gap  $h/\delta_{12}$", "-", "Through the film and back")
    legend(axes, loc="upper right")
    return figure


def soft_and_hard(hard: Triplet, soft: Any, overlaps: Sequence[float], errors: dict[str, np.ndarray]) -> Any:
    """Gaps in the particle engine and of hard spheres, and their difference against the overlap."""
    figure, (left, right) = panels(2, width=10.0, height=4.4)
    for pair, colour in (("12", BLUE), ("23", ORANGE)):
        title = f"spheres {pair[0]} and {pair[1]}"
        left.plot(hard.history["time"], hard.history[f"gap{pair}"], color=colour, label=f"{title}, hard, polar")
        time = soft.history["time"]
        some = np.searchsorted(time, np.arange(0.0, time[-1], 0.12))
        left.plot(time[some], soft.history[f"gap{pair}"][some], "o", mfc="white", color=colour, ms=4,
                  label=f"{title}, soft, engine")  # fmt: skip
        right.loglog(overlaps, errors[pair], "o-", color=colour, label=title)
    left.set(xlim=(0, 8), ylim=(0, 1.02))
    label(
        left, r"time  $t\,v_{n0}/\delta_{12}$", "-", r"gap  $h/\delta_{12}$", "-", "St = 12, 30 deg; overlap 0.02 $h_m$"
    )
    label(right, r"deepest overlap over $h_m$", "-", "difference of restitution", "-", "Softer solids differ more")
    legend(left, loc="center right")
    legend(right, loc="upper left")
    return figure
