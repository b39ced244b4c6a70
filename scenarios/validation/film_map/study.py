"""The map of films: agitated beds with and without films over four dimensionless numbers.

Each bed with a film is compared with the bed without one from the same seed. Runs are kept: interrupted runs are
continued, finished ones are not repeated, and several processes may share them.
"""

from __future__ import annotations

import math
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from cfddem.analysis.report import window_of
from cfddem.backend.compile import use_threads
from cfddem.features.energy import LOST
from cfddem.io.reading import RunData
from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, SKY, blank, label, save
from scenarios.beds.lubrication_study.study import outcome
from scenarios.validation.film_map import effects
from scenarios.validation.film_map.design import DENSITY_RATIOS, ROUGHNESS, SOLID_FRACTIONS, Run, bed, plan, stokes_of
from scenarios.validation.film_map.effects import CHANGED, OF_FILMS, Beds, Estimate, change, compared, mean
from scenarios.validation.kept_runs import finished, kept, taken
from scenarios.validation.table import Progress, Row

OF_COLLISIONS = ("film", "film_shear", "contact_damping", "hysteresis", "friction", "rolling")
"""Lines of the energy ledger that films and contacts lose."""

REMAINDER = 1e-3
"""Largest energy that the ledger of a bed leaves unexplained, over the dissipation."""


def study(folder: Path, progress: Progress, hours: float = math.inf) -> list[Row]:
    """Run the missing beds on one thread, write table and figure of those there are, and return the table.

    Several processes may share the folder. From then on, this process runs on one thread.

    hours  after which no further bed begins
    """
    use_threads(1)
    end = monotonic() + 3600.0 * hours
    for run in plan():
        if monotonic() >= end:
            break
        advance(folder / "runs", run, progress)
    beds = effects.finished_beds(folder / "runs")
    effects.write_beds(beds, folder / "beds.csv")
    draw(beds, folder / "map.png")
    return rows(beds)


def advance(home: Path, run: Run, progress: Progress) -> None:
    """Run one bed and keep its means, unless they are kept or another process runs it."""
    with taken(home, run.name) as mine:
        if mine:
            kept(home / f"{run.name}.json", lambda: _means(home, run, progress))


def rows(beds: Beds) -> list[Row]:
    """Changes by films with errors, shares of beds with films, and the balance of energy."""
    table = []
    for point, film in effects.compared(beds):
        for measure, words in (CHANGED | OF_FILMS).items():
            changed = measure in CHANGED
            effect = (effects.change if changed else effects.mean)(beds, point, film, measure)
            if effect is not None:
                note = (
                    "one seed" if effect.seeds == 1 else f"standard error {effect.error:.2g} over {effect.seeds} seeds"
                )
                words = f"{words}, relative change by films" if changed else words
                table.append(Row(f"{point.name}, {film}: {words}", effect.value, note=note))
    if beds:
        largest = max(means["largest_remainder"] for means in beds.values())
        words = f"energy that the ledgers of {len(beds)} beds leave unexplained, over the dissipation"
        table.append(Row(words, largest, 0.0, REMAINDER))
    return table


def _means(home: Path, run: Run, progress: Progress) -> dict[str, float]:
    case = bed(run.point, run.film, run.seed)
    return means_of(finished(case, home, run.name, progress, {}), run)


def means_of(data: RunData, run: Run) -> dict[str, float]:
    """Means of a finished run; quantities that a bed without films does not have are absent.

    returns  voidage, bed_height [m], granular_temperature and its parts along and across gravity [m2/s2], collisions
             in which solids meet and approaches to within the reach of a film, of one sphere [1/s], stokes (median),
             gap_ratio (median of h_eps over the roughness), solids_meet (share of the approaches), contacts (over the
             number of spheres), dissipated (by films and contacts, over all dissipation), dissipation (of one sphere
             by films and contacts [W]), stokes_of_fluctuations (at the root of the granular temperature)
             and largest_remainder (of the energy ledger)
    """
    case = bed(run.point, run.film, run.seed)
    begin, end = window_of(data, case)
    inside = data.history["time"] >= begin
    of_bed = outcome(data, case)
    numbers = {name: getattr(of_bed, name) for name in ("bed_height", "granular_temperature", "collisions", "contacts")}
    numbers |= {name: getattr(of_bed, name) for name in ("stokes", "solids_meet")}
    history = {
        "voidage": "bed_voidage",
        "temperature_along": "granular_temperature_along",
        "temperature_across": "granular_temperature_across",
    }
    numbers |= {name: float(np.nanmean(data.history[column][inside])) for name, column in history.items()}
    rows = {name: column[data.collisions["end"] >= begin] for name, column in data.collisions.items()}
    films = np.isfinite(rows["stokes"]) & (rows["stokes"] > 0.0)
    if films.any():
        numbers["approaches"] = 2.0 * float(rows["weight"][films].sum()) / (case.particle_count * (end - begin))
        numbers["gap_ratio"] = float(np.median((rows["elastohydrodynamic_gap"] / rows["roughness_gap"])[films]))
    recorded = [name for name in LOST if f"energy_{name}" in data.history]
    lost = {name: np.ptp(data.history[f"energy_{name}"][inside][[0, -1]]) for name in recorded}
    by_collisions = sum(lost[name] for name in OF_COLLISIONS if name in lost)
    numbers["dissipated"] = float(by_collisions / sum(lost.values()))
    numbers["dissipation"] = float(by_collisions) / (case.particle_count * (end - begin))
    numbers["largest_remainder"] = float(np.abs(data.history["energy_remainder"]).max() / sum(lost.values()))
    numbers["stokes_of_fluctuations"] = stokes_of(case, math.sqrt(numbers["granular_temperature"]))
    return {name: value for name, value in numbers.items() if math.isfinite(value)}


# ---------------------------------------------------------------- figure


PANELS = {
    "bed_height": ("bed height", "change by films", "%"),
    "granular_temperature": ("granular temperature", "change by films", "%"),
    "collisions": ("collisions of a sphere", "change by films", "%"),
    "solids_meet": ("collisions in which solids meet", "share", "%"),
    "dissipation": ("dissipation by films and contacts", "over that without films", "-"),
}
"""Title of each panel, and label and unit of its axis."""

COLOURS = dict(zip(SOLID_FRACTIONS, (SKY, GREEN, BLUE)))
OF_HEAVY = dict(zip(SOLID_FRACTIONS, (ORANGE, GREY, RED)))
MARKS = dict(zip(ROUGHNESS, "osD"))


def draw(beds: Beds, path: Path) -> None:
    """Changes by films, and shares, against the median Stokes number of the collisions."""
    from matplotlib.ticker import LogLocator, NullFormatter

    figure, axes = blank(2, 3, width=11.0, height=7.2)
    for panel, (measure, (title, name, unit)) in zip(axes, PANELS.items()):
        factor, none = (1.0, 1.0) if measure == "dissipation" else (100.0, 0.0)
        for point, film in compared(beds):
            stokes = mean(beds, point, film, "stokes")
            shown = (change if measure in CHANGED else mean)(beds, point, film, measure)
            if stokes is not None and shown is not None:
                panel.errorbar(
                    stokes.value, none + factor * shown.value, _error(shown, factor), _error(stokes, 1.0),
                    **_style(point.solid_fraction, point.density_ratio, film, point.agitated),
                )  # fmt: skip
        if measure in CHANGED:
            panel.axhline(none, color="0.4", linewidth=0.8, zorder=0)
        panel.set_xscale("log")
        panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        panel.xaxis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter(NullFormatter())
        label(panel, "median St of the collisions", "-", name, unit, title)
    _explain(axes[-1], beds)
    save(figure, path)


def _error(effect: Estimate, factor: float) -> float | None:
    return None if math.isnan(effect.error) else factor * effect.error


def _style(solid_fraction: float, density_ratio: float, film: str, agitated: bool) -> dict[str, Any]:
    heavy = density_ratio == max(DENSITY_RATIOS)
    colour = (OF_HEAVY if heavy else COLOURS)[solid_fraction]
    light = density_ratio == min(DENSITY_RATIOS)
    return {
        "fmt": MARKS[film], "color": colour, "mfc": colour if agitated else "white", "markersize": 4 if light else 6,
        "capsize": 2, "linewidth": 1.0,
    }  # fmt: skip


def _explain(axes: Any, beds: Beds) -> None:
    """Legend in the panel that is left."""
    axes.set_axis_off()
    shown = compared(beds)
    for density_ratio in DENSITY_RATIOS:
        for solid_fraction in SOLID_FRACTIONS:
            if any((p.density_ratio, p.solid_fraction) == (density_ratio, solid_fraction) for p, _ in shown):
                style = _style(solid_fraction, density_ratio, next(iter(MARKS)), True)
                axes.errorbar([], [], **style, label=f"density ratio {density_ratio:g}, {solid_fraction:g} solids")
    for film, roughness in ROUGHNESS.items():
        if any(other == film for _, other in shown):
            style = {"fmt": MARKS[film], "color": "0.3", "label": f"{film}: roughness {roughness / 5e-4:g} R*"}
            style["label"] += ", deformed" if film == "soft" else ""
            axes.errorbar([], [], **style, linewidth=1.0)
    if any(not point.agitated for point, _ in shown):
        axes.errorbar([], [], fmt="o", color="0.3", mfc="white", label="hollow: without agitation", linewidth=1.0)
    if shown:
        axes.legend(loc="center left", frameon=False, fontsize=9.5)
