"""The lubrication study as a validation: figures, rows for every bed, and the effect of softened contacts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.fluctuations import regime_map
from cfddem.io.reading import open_run
from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, blank, draw_regimes, label, legend, save
from scenarios.beds.lubrication_study.study import (
    MODULI,
    SEEDS,
    SETTINGS,
    SPHERES,
    VISCOSITIES,
    Mean,
    Outcome,
    Setting,
    change,
    folder_of,
    mean,
    outcomes,
    run_beds,
)
from scenarios.validation.table import Progress, Row

STIFFER = 0.05
"""Largest relative change of the bed height with contacts four times as stiff."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run the missing beds, draw the figures, and return the table."""
    home = folder / "runs"
    run_beds(home, progress)
    of_settings = outcomes(home)
    measures(of_settings, folder / "measures.png")
    profiles(of_settings, folder / "profiles.png")
    regimes(home, folder / "regimes.png")
    return rows(of_settings)


def rows(of_settings: dict[Setting, list[Outcome]]) -> list[Row]:
    """Results of every bed with errors, then the changes by films and by the contact stiffness."""
    table = []
    for setting in SETTINGS:
        if setting.modulus == MODULI[0] and setting in of_settings:
            table += _of_bed(setting, of_settings[setting])
    for setting in SETTINGS:
        bare = setting._replace(spheres="no film")
        if setting != bare and setting in of_settings and bare in of_settings:
            table += _changes(f"{_named(setting)}, {setting.modulus:.0e} Pa", "by the film",
                              of_settings[setting], of_settings[bare])  # fmt: skip
    for setting in SETTINGS:
        softer = setting._replace(modulus=MODULI[0])
        if setting.modulus != MODULI[0] and setting in of_settings and softer in of_settings:
            ratio = mean(of_settings[setting], "bed_height").value / mean(of_settings[softer], "bed_height").value
            table.append(Row(f"{_named(setting)}: bed height, stiffer over softer contacts", ratio, 1.0, STIFFER))
            table += _changes(_named(setting), "by stiffer contacts", of_settings[setting], of_settings[softer])
    return table


def _of_bed(setting: Setting, beds: list[Outcome]) -> list[Row]:
    table = []
    for measure, (name, unit, factor) in (MEASURES | COUNTS).items():
        average = mean(beds, measure)
        if np.isfinite(average.value):  # there is no Stokes number without a film
            note = _note(average, factor)
            table.append(Row(f"{_named(setting)}: {name}", factor * average.value, unit=unit, note=note))
    return table


def _changes(beds: str, cause: str, changed: list[Outcome], others: list[Outcome]) -> list[Row]:
    """Relative changes of the measures, seed by seed."""
    changes = {name: change(changed, others, measure) for measure, (name, _, _) in MEASURES.items()}
    return [Row(f"{beds}: change of {name} {cause}", 100.0 * average.value, unit="%", note=_note(average, 100.0))
            for name, average in changes.items()]  # fmt: skip


def _note(average: Mean, factor: float) -> str:
    """Standard error in a unit, by the factor from SI to it."""
    seeds = f"over {average.seeds} seeds"
    return f"standard error {factor * average.error:.2g} {seeds}" if average.seeds > 1 else "one seed"


def _named(setting: Setting) -> str:
    rest = ", without agitation" if setting.agitation == "none" else ""
    return f"{setting.spheres}, {1e3 * setting.viscosity:g} mPa s{rest}"


# ---------------------------------------------------------------- figures


COLOURS = dict(zip(SPHERES, (GREY, BLUE, ORANGE, GREEN)))
MEASURES = {
    "bed_height": ("bed height", "mm", 1e3),
    "granular_temperature": ("granular temperature", "mm2/s2", 1e6),
    "collisions": ("collisions of a sphere", "1/s", 1.0),
}
"""Name, unit, and factor from SI to that unit."""

COUNTS = {
    "contacts": ("contacts over spheres", "-", 1.0),
    "stokes": ("median Stokes number", "-", 1.0),
    "solids_meet": ("collisions in which solids meet", "%", 100.0),
}
"""Of what the table has besides, likewise."""

MOST = 8.0
"""Density of the darkest shade of the maps [1/decade2]."""

Found = dict[Setting, list[Outcome]]


def measures(of_settings: Found, path: Path) -> None:
    """Means with errors for every kind of sphere and both viscosities; stiffer contacts as hollow points."""
    figure, axes = blank(1, len(MEASURES), width=11.0, height=3.9)
    for panel, (measure, (name, unit, factor)) in zip(axes, MEASURES.items()):
        for place, viscosity in enumerate(VISCOSITIES):
            for number, spheres in enumerate(SPHERES):
                for shift, modulus in zip((-0.09, 0.09), MODULI):
                    beds = of_settings.get(Setting(spheres, viscosity, modulus))
                    if not beds:
                        continue
                    value, error, _ = mean(beds, measure)
                    style: Any = {"mfc": "white"} if modulus != MODULI[0] else {}
                    named = spheres if place == 0 and modulus == MODULI[0] else None
                    panel.errorbar(
                        5 * place + number + shift, factor * value, factor * error, fmt="o", capsize=3,
                        color=COLOURS[spheres], label=named, **style,
                    )  # fmt: skip
        label(panel, "viscosity", "mPa s", name, unit)
        panel.set_xticks([1.5, 6.5], [f"{1e3 * viscosity:g}" for viscosity in VISCOSITIES])
        panel.set_ylim(0.0, 1.08 * panel.get_ylim()[1])
        panel.grid(False, axis="x")
    legend(axes[0], loc="lower left", ncols=2)
    save(figure, path)


def profiles(of_settings: Found, path: Path) -> None:
    """Voidage against height, with the error of the mean over seeds."""
    figure, axes = blank(1, len(VISCOSITIES), width=8.0, height=4.2, sharey=True)
    for panel, viscosity in zip(axes, VISCOSITIES):
        for spheres in SPHERES:
            beds = of_settings.get(Setting(spheres, viscosity, MODULI[0]))
            if not beds:
                continue
            value, error, _ = mean(beds, "voidage")
            height = 1e3 * beds[0].level
            panel.errorbar(value, height, xerr=error, color=COLOURS[spheres], label=spheres, capsize=2, linewidth=1.2)
        label(panel, "voidage", "-", "height", "mm", f"{1e3 * viscosity:g} mPa s")
    axes[1].set_ylabel("")
    legend(axes[0], loc="upper left")
    save(figure, path)


def regimes(home: Path, path: Path) -> None:
    """The regime maps of smooth, rough and soft spheres in both viscosities, all seeds together."""
    kinds = [spheres for spheres in SPHERES if spheres != "no film"]
    figure, axes = blank(len(VISCOSITIES), len(kinds), width=11.0, height=6.6, sharex=True, sharey=True)
    shades: Any = None
    for place, (viscosity, spheres) in enumerate((v, s) for v in VISCOSITIES for s in kinds):
        rows: dict[str, list[np.ndarray]] = {}
        for seed in SEEDS:
            folder = folder_of(home, Setting(spheres, viscosity, MODULI[0]), seed)
            if not (folder / "run.json").exists():
                continue
            run = open_run(folder)
            late = run.collisions["end"] >= run.times[-1] / 3.0
            for name, column in run.collisions.items():
                rows.setdefault(name, []).append(column[late])
        map_of_regimes = regime_map({name: np.concatenate(columns) for name, columns in rows.items()})
        shades = draw_regimes(axes[place], map_of_regimes, f"{spheres}, {1e3 * viscosity:g} mPa s", most=MOST)
    for place, panel in enumerate(axes):
        panel.set(xlim=(0.03, 300.0), ylim=(1e-5, 100.0))
        panel.set_ylabel("" if place % len(kinds) else "elastohydrodynamic gap\nover roughness  [-]")
        if place < len(kinds):
            panel.set_xlabel("")
    figure.colorbar(shades, ax=axes.tolist(), label="density of collisions  [1/decade2]", shrink=0.8)
    save(figure, path)
