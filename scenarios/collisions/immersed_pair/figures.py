"""Figures of the validation of binary collisions, drawn from its curves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, SKY, decades, label, legend, panels, save, shades
from closures.restitution import legendre
from scenarios.validation.table import Curves

MATERIAL_STYLES = {
    "steel_smooth": ("steel, smooth (24 nm)", BLUE),
    "steel_rough": ("steel, rough (272 nm)", SKY),
    "glass": ("glass (134 nm)", ORANGE),
    "delrin": ("Delrin (796 nm)", GREEN),
}
CLASS_STYLES = {
    "low": ("$St_n$ = 20, steel in 80 % glycerol", BLUE),
    "middle": ("$St_n$ = 100, Delrin in water", GREEN),
    "high": ("$St_n$ = 1000, steel in water", ORANGE),
}


def draw(folder: Path, curves: Curves) -> None:
    """Write all figures."""
    for name, figure in FIGURES.items():
        save(figure(curves), folder / f"{name}.png")


def _of(curves: Curves, group: str) -> dict[str, Any]:
    """Arrays of a group without their units."""
    return {name: np.asarray(values) for name, (values, _) in curves[group].items()}


def _groups(curves: Curves, head: str) -> list[str]:
    return [group for group in curves if group.startswith(head + "/")]


def gap_histories(curves: Curves) -> Any:
    """Gap against time, linear and logarithmic."""
    figure, (left, right) = panels(2, width=9.6, height=4.4)
    groups = [group for group in _groups(curves, "figure_2") if not group.endswith("_17")]
    for group, colour in zip(groups, shades(len(groups), "plasma")):
        run = _of(curves, group)
        gap = run["gap"] / run["cutoff_gap"]
        begin = np.interp(-1.0, -gap[: int(gap.argmin())], run["time"][: int(gap.argmin())])
        time = (run["time"] - begin) * run["approach_speed"] / run["cutoff_gap"]
        if gap[-1] < 0.999:  # a pair at rest stays where it is
            time, gap = np.append(time, 8.0), np.append(gap, gap[-1])
        left.plot(time, gap, color=colour)
        right.plot(time, np.maximum(gap, 1e-6), color=colour, label=group.rsplit("_", 1)[1])
    floor = float(run["minimum_gap"] / run["cutoff_gap"])
    right.axhline(floor, color=GREY, lw=1.0, ls="--")
    right.text(5.9, 1.12 * floor, "$h_{min}$: asperities meet", color=GREY, ha="right", va="bottom", fontsize=9.5)
    left.set(xlim=(0, 6), ylim=(0, 1.02))
    right.set(xlim=(0, 6), ylim=(1.2e-4, 1.3), yscale="log")
    label(left, r"time  $t\,v_0/R^*$", "-", "gap  $h/R^*$", "-", "Delrin spheres meet in a liquid")
    label(right, r"time  $t\,v_0/R^*$", "-", "gap  $h/R^*$", "-", "The same on a logarithmic scale")
    legend(right, title="St", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def restitution(curves: Curves) -> Any:
    """Restitution against the Stokes number."""
    figure, axes = panels(height=5.0)
    axes.axvspan(1.0, 10.0, color="#f4f4f4", lw=0)
    axes.text(4.15, 0.6, "no rebound\nwas seen here\n(Joseph et al.\n2001)", color=GREY, fontsize=9.5, va="bottom")
    for name, (title, colour) in MATERIAL_STYLES.items():
        run = _of(curves, f"figure_3/{name}")
        low, high = run["restitution_lowest"], run["restitution_highest"]
        axes.fill_between(run["stokes"], low, high, color=colour, alpha=0.2, lw=0)
        axes.plot(run["stokes"], run["restitution"], color=colour, label=title)
        axes.plot(run["stokes"], run["closed_form"], color="#222222", lw=1.0, ls=(0, (1, 2)))
    axes.plot([], [], color="#222222", lw=1.0, ls=(0, (1, 2)), label="closed form with its + 1/2")
    axes.errorbar(27, 0.46, yerr=0.03, color=RED, capsize=4, lw=2, ls="", label="Gondret et al. (2002), near the wall")
    _legendre(axes, _of(curves, "figure_3/legendre_2006"))
    axes.axhline(0.97, color=GREY, lw=1.0, ls="--")
    axes.text(4.15, 0.975, "dry", color=GREY, fontsize=9.5, va="bottom")
    decades(axes, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)
    axes.set(xlim=(4, 3000), ylim=(-0.01, 1.05))
    label(axes, "Stokes number  St", "-", "restitution  $e$", "-", "Spheres of 12.7 mm collide head-on in a liquid")
    legend(axes, loc="lower right")
    return figure


def _legendre(axes: Any, fit: dict[str, Any]) -> None:
    """The fit for the densities of steel to Delrin in water, with the scatter of experiments."""
    stokes = np.geomspace(5, 3000, 200)
    heavy, light = (
        np.array([legendre(number * (1.0 + 0.5 / density), 0.97) for number in stokes]) for density in (7.78, 1.40)
    )
    axes.fill_between(stokes, heavy, light, color="#c9c9c9", lw=0, zorder=0.6, label="fit of Legendre et al. (2006)")
    axes.plot(
        fit["stokes_with_added_mass"], 0.97 * fit["restitution_ratio"], ".", color=GREY, ms=5, zorder=0.7,
        label="the same, no added mass",
    )  # fmt: skip
    some = (stokes > 20) & (stokes < 200)
    axes.fill_between(
        stokes[some], heavy[some] - 0.1, light[some] + 0.1, color="#ececec", lw=0, zorder=0.5,
        label="scatter of experiments about it",
    )  # fmt: skip


def roughness(curves: Curves) -> Any:
    """Restitution of Delrin against its roughness."""
    figure, axes = panels(height=4.6)
    groups = _groups(curves, "figure_4")
    line = []
    for group, colour in zip(groups, shades(len(groups))):
        run = _of(curves, group)
        height = run["roughness"] * 1e9
        axes.plot(height, run["restitution"], color=colour)
        line.append((float(run["elastohydrodynamic_gap"]) * 1e9, float(run["restitution_there"])))
        lift = -0.045 if group.endswith("_500") else 0.012
        axes.text(1.08, run["restitution"][0] + lift, f"St {group.rsplit('_', 1)[1]}", color=colour, fontsize=9.5)
    axes.plot(*zip(*line), "o:", color=RED, ms=5, lw=1.4, label=r"$h_\sigma = h_\varepsilon$")
    axes.axvline(796, color=GREY, lw=1.0, ls="--")
    axes.text(870, 0.02, "spheres of\nYang & Hunt", color=GREY, fontsize=9.5)
    axes.set(xscale="log", xlim=(1, 3e4), ylim=(0, 1.0))
    label(axes, r"roughness  $\sigma$", "nm", "restitution  $e$", "-", "Delrin of varied roughness meets at 0.1 m/s")
    legend(axes, loc="lower left", bbox_to_anchor=(0.0, 0.1))
    return figure


def oblique(curves: Curves) -> Any:
    """Rebound angles in three classes, in both readings, with both onsets of friction."""
    figure, (left, right) = panels(2, width=9.0, height=4.8, sharey=True)
    for name, (title, colour) in CLASS_STYLES.items():
        run = _of(curves, f"figure_5/{name}")
        for axes, reading in ((left, "striker"), (right, "relative")):
            angle, end = run["impact_angle"], f"angle_{reading}"
            axes.fill_between(
                angle, run[f"film_lowest_{end}"], run[f"film_highest_{end}"], color=colour, alpha=0.15, lw=0
            )
            axes.plot(angle, run[f"film_shown_{end}"], color=colour, label=title)
            axes.plot(angle, run[f"overlap_shown_{end}"], color=colour, ls="--", lw=1.4)
    right.plot([0, 70], [0, 70], color=GREY, lw=1.0, ls=":")
    right.text(33, 37, r"$\theta_1 = \theta_0$", color=GREY, fontsize=9.5, ha="right")
    left.plot([], [], color=GREY, label="friction from $h_{min}$ on (default)")
    left.plot([], [], color=GREY, ls="--", lw=1.4, label="friction at overlap (as published)")
    left.fill_between([], [], [], color=GREY, alpha=0.25, label="$St_n$ 10-25, 40-200, 500-2400")
    left.set(xlim=(0, 70), ylim=(0, 91), yticks=range(0, 91, 15))
    right.set(xlim=(0, 70))
    label(
        left,
        r"impact angle  $\theta_0$",
        "deg",
        r"rebound angle  $\theta_1$",
        "deg",
        "Rebound of the striker's own velocity",
    )
    label(
        right,
        r"impact angle  $\theta_0$",
        "deg",
        r"rebound angle  $\theta_1$",
        "deg",
        "Rebound of the relative velocity",
    )
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False, fontsize=9.5)
    return figure


def pair_and_wall(curves: Curves) -> Any:
    """Pair and wall against the binary Stokes number, as computed and with the exact offset removed."""
    figure, (left, right) = panels(2, width=9.0, height=4.4, sharey=True)
    for name in ("steel_rough", "glass", "delrin"):
        run, (title, colour) = _of(curves, f"pair_and_wall/{name}"), MATERIAL_STYLES[name]
        shifted = run["wall"] + 1.97 * np.log(2.0) / run["stokes"]
        for axes, wall in ((left, run["wall"]), (right, shifted)):
            axes.plot(run["stokes"], run["pair"], color=colour, label=title)
            axes.plot(run["stokes"], wall, "o", mfc="white", color=colour, ms=5)
    left.plot([], [], color=GREY, label="two spheres")
    left.plot([], [], "o", mfc="white", color=GREY, ms=5, label="sphere and wall")
    for axes in (left, right):
        decades(axes, 25, 50, 100, 200, 500, 1000, 2000)
        axes.set(xlim=(23, 2200), ylim=(0, 1.0))
    label(left, "binary Stokes number  St", "-", "restitution  $e$", "-", "Film up to $h_{co} = R^*$ of each")
    label(right, "binary Stokes number  St", "-", "restitution  $e$", "-", r"Wall raised by $(1+e_{dry})\,\ln 2/St$")
    legend(left, loc="lower right")
    return figure


def readings(curves: Curves) -> Any:
    """Restitution read where the pair leaves the film, and at a fixed time."""
    figure, axes = panels(height=4.2)
    for name in ("delrin", "glass"):
        run, (title, colour) = _of(curves, f"readings/{name}"), MATERIAL_STYLES[name]
        axes.plot(run["stokes"], run["restitution_at_cutoff"], color=colour, label=f"{title}: at $h_{{co}}$ outbound")
        axes.plot(run["stokes"], run["restitution_at_time"], color=colour, ls="--", label=r"at time $2 h_0/v_0$")
    axes.set(xlim=(18, 60), ylim=(0, 0.75))
    label(axes, "Stokes number  St", "-", "restitution  $e$", "-", "Two readings of the same rebound, in water")
    legend(axes, loc="lower right")
    return figure


GONDRET = {
    "film_alone": "film, contact, weight less buoyancy",
    "and_drag_and_added_mass": "and drag and added mass",
    "and_history_force": "and history force",
    "and_drag_beside_the_wall": "and drag beside the wall",
}
"""Curves of the bounce, each with one force more."""


def gondret(curves: Curves) -> Any:
    """Measured and computed bounce of a steel sphere."""
    figure, axes = panels(height=4.2)
    measured = _of(curves, "gondret_2002/measured")
    for (group, text), colour in zip(GONDRET.items(), (BLUE, SKY, GREY, ORANGE)):
        path = _of(curves, f"gondret_2002/{group}")
        axes.plot(path["time"] * 1e3, path["gap"] * 1e3, color=colour, label=text)
    axes.plot(measured["time"] * 1e3, measured["gap"] * 1e3, "o", color=RED, ms=5, label="Gondret et al. (2002)")
    axes.set(xlim=(-6, 46), ylim=(0, 4.2))
    label(axes, "time after contact", "ms", "gap", "mm", "A 6 mm steel sphere bounces in silicone oil, St = 27")
    legend(axes, loc="upper right")
    return figure


FIGURES: dict[str, Callable[[Curves], Any]] = {
    "figure_2_gap_histories": gap_histories,
    "figure_3_restitution": restitution,
    "figure_4_roughness": roughness,
    "figure_5_oblique": oblique,
    "pair_and_wall": pair_and_wall,
    "readings": readings,
    "gondret_2002": gondret,
}
