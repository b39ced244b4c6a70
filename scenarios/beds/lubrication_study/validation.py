"""The lubrication study as a validation: figures, rows for every bed, and the effect of softened contacts."""

from __future__ import annotations

from pathlib import Path

from scenarios.beds.lubrication_study.figures import MEASURES, measures, profiles, regimes
from scenarios.beds.lubrication_study.study import MODULI, SETTINGS, Outcome, Setting, mean, outcomes, run_beds
from scenarios.validation.table import Progress, Row

STIFFER = 0.05
"""Largest relative change of the bed height with contacts four times as stiff."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run the missing beds, draw the figures, and return the table."""
    home = folder / "runs"
    run_beds(home, progress)
    found = outcomes(home)
    measures(found, folder / "measures.png")
    profiles(found, folder / "profiles.png")
    regimes(home, folder / "regimes.png")
    return rows(found)


def rows(found: dict[Setting, list[Outcome]]) -> list[Row]:
    """Results of every bed with errors, then the change with the contact stiffness."""
    table = []
    for setting in SETTINGS:
        if setting.modulus == MODULI[0] and setting in found:
            table += _of_bed(setting, found[setting])
    for setting in SETTINGS:
        softer = setting._replace(modulus=MODULI[0])
        if setting.modulus != MODULI[0] and setting in found and softer in found:
            ratio = mean(found[setting], "bed_height").value / mean(found[softer], "bed_height").value
            table.append(Row(f"{_named(setting)}: bed height, stiffer over softer contacts", ratio, 1.0, STIFFER))
    return table


def _of_bed(setting: Setting, beds: list[Outcome]) -> list[Row]:
    made = []
    for what, (name, unit, factor) in MEASURES.items():
        value, error, seeds = mean(beds, what)
        note = f"standard error {factor * error:.2g} over {seeds} seeds" if seeds > 1 else "one seed"
        made.append(Row(f"{_named(setting)}: {name}", factor * value, unit=unit, note=note))
    return made


def _named(setting: Setting) -> str:
    moved = "" if setting.agitation == "none" else ", with agitation"
    return f"{setting.spheres}, {1e3 * setting.viscosity:g} mPa s{moved}"
