"""The figure of the map of films."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, SKY, blank, label, save
from scenarios.validation.film_map.design import DENSITY_RATIOS, ROUGHNESS, SOLID_FRACTIONS
from scenarios.validation.film_map.effects import Beds, Estimate, change, compared, mean

PANELS = {
    "bed_height": ("change of the bed height", True),
    "granular_temperature": ("change of the granular temperature", True),
    "collisions": ("change of the collision rate", True),
    "solids_meet": ("collisions in which solids meet", False),
    "dissipation": ("dissipation with films over that without", True),
}
"""Title of each panel, and whether it shows changes."""

COLOURS = dict(zip(SOLID_FRACTIONS, (SKY, GREEN, BLUE)))
OF_HEAVY = dict(zip(SOLID_FRACTIONS, (ORANGE, RED, GREY)))
MARKS = dict(zip(ROUGHNESS, "osD"))


def draw(beds: Beds, path: Path) -> None:
    """Changes by films, and shares, against the median Stokes number of the collisions."""
    figure, axes = blank(2, 3, width=11.0, height=7.2)
    for each, (what, (title, is_change)) in zip(axes, PANELS.items()):
        for point, film in compared(beds):
            stokes = mean(beds, point, film, "stokes")
            shown = (change if is_change else mean)(beds, point, film, what)
            if stokes is None or shown is None:
                continue
            factor, offset = (1.0, 1.0) if what == "dissipation" else (100.0, 0.0)
            each.errorbar(
                stokes.value, offset + factor * shown.value, _error(shown, factor), _error(stokes, 1.0),
                **_style(point.solid_fraction, point.density_ratio, film, point.agitated),
            )  # fmt: skip
        if is_change and what != "dissipation":
            each.axhline(0.0, color="0.4", linewidth=0.8, zorder=0)
        each.set_xscale("log")
        label(each, "median St of the collisions", "-", title, "-" if what == "dissipation" else "%")
        if what == "dissipation":
            each.axhline(1.0, color="0.4", linewidth=0.8, zorder=0)
            each.set_yscale("log")
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
    axes.legend(loc="center left", frameon=False, fontsize=9.5)
