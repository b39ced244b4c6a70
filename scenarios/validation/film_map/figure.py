"""The figure of the map of films."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, SKY, blank, label, save
from scenarios.validation.film_map.design import DENSITY_RATIOS, ROUGHNESS, SOLID_FRACTIONS
from scenarios.validation.film_map.effects import CHANGED, Beds, Estimate, change, compared, mean

PANELS = {
    "bed_height": ("bed height", "change by films", "%"),
    "granular_temperature": ("granular temperature", "change by films", "%"),
    "collisions": ("collisions of a sphere", "change by films", "%"),
    "solids_meet": ("collisions in which solids meet", "share", "%"),
    "dissipation": ("dissipation by films and contacts", "over that without films", "-"),
}
"""Title of each panel, and label and unit of its axis."""

COLOURS = dict(zip(SOLID_FRACTIONS, (SKY, GREEN, BLUE)))
OF_HEAVY = dict(zip(SOLID_FRACTIONS, (ORANGE, RED, GREY)))
MARKS = dict(zip(ROUGHNESS, "osD"))


def draw(beds: Beds, path: Path) -> None:
    """Changes by films, and shares, against the median Stokes number of the collisions."""
    figure, axes = blank(2, 3, width=11.0, height=7.2)
    for each, (what, (title, name, unit)) in zip(axes, PANELS.items()):
        factor, none = (1.0, 1.0) if what == "dissipation" else (100.0, 0.0)
        for point, film in compared(beds):
            stokes = mean(beds, point, film, "stokes")
            shown = (change if what in CHANGED else mean)(beds, point, film, what)
            if stokes is not None and shown is not None:
                each.errorbar(
                    stokes.value, none + factor * shown.value, _error(shown, factor), _error(stokes, 1.0),
                    **_style(point.solid_fraction, point.density_ratio, film, point.agitated),
                )  # fmt: skip
        if what in CHANGED:
            each.axhline(none, color="0.4", linewidth=0.8, zorder=0)
        each.set_xscale("log")
        if what == "dissipation":
            each.set_yscale("log")
            each.yaxis.set_major_formatter("{x:g}")
            each.yaxis.set_minor_formatter("{x:g}")
        label(each, "median St of the collisions", "-", name, unit, title)
    _explain(axes[-1], beds)
    save(figure, path)


def _error(found: Estimate, factor: float) -> float | None:
    return None if math.isnan(found.error) else factor * found.error


def _style(solid_fraction: float, density_ratio: float, film: str, agitated: bool) -> dict[str, Any]:
    heavy = density_ratio == max(DENSITY_RATIOS)
    colour = (OF_HEAVY if heavy else COLOURS)[solid_fraction]
    light = density_ratio == min(DENSITY_RATIOS)
    return {
        "fmt": MARKS[film], "color": colour, "mfc": "white" if agitated else colour, "markersize": 4 if light else 6,
        "capsize": 2, "linewidth": 1.0,
    }  # fmt: skip


def _explain(axes: Any, beds: Beds) -> None:
    """Legend in the panel that is left."""
    axes.set_axis_off()
    shown = compared(beds)
    for density_ratio in DENSITY_RATIOS:
        for solid_fraction in SOLID_FRACTIONS:
            if any((p.density_ratio, p.solid_fraction) == (density_ratio, solid_fraction) for p, _ in shown):
                style = _style(solid_fraction, density_ratio, next(iter(MARKS)), False)
                axes.errorbar([], [], **style, label=f"density ratio {density_ratio:g}, {solid_fraction:g} solids")
    for film, roughness in ROUGHNESS.items():
        if any(each == film for _, each in shown):
            style = {"fmt": MARKS[film], "color": "0.3", "label": f"{film}: roughness {roughness / 5e-4:g} R*"}
            style["label"] += ", deformed" if film == "soft" else ""
            axes.errorbar([], [], **style, linewidth=1.0)
    if any(point.agitated for point, _ in shown):
        axes.errorbar([], [], fmt="o", color="0.3", mfc="white", label="hollow: with agitation", linewidth=1.0)
    if shown:
        axes.legend(loc="center left", frameon=False, fontsize=9.5)
