"""The lubrication study as a validation: its figures, a row for every bed, and whether softened contacts matter."""

from __future__ import annotations

from pathlib import Path

from scenarios.lubrication_study import MODULI, SETTINGS, Outcome, Setting, mean, outcomes, simulate
from scenarios.lubrication_study_figures import MEASURES, measures, profiles, regimes
from scenarios.validation import Row, Tell

STIFFER = 0.05
"""Largest change of the bed height where contacts are four times as stiff, over the height."""


def study(folder: Path, tell: Tell) -> list[Row]:
    """Run all beds that are not there yet, draw the figures, and return the table."""
    home = folder / "runs"
    simulate(home, tell)
    found = outcomes(home)
    measures(found, folder / "measures.png")
    profiles(found, folder / "profiles.png")
    regimes(home, folder / "regimes.png")
    return rows(found)


def rows(found: dict[Setting, list[Outcome]]) -> list[Row]:
    """Measures of every bed with its error, then the change with the stiffness of contacts."""
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
        note = f"standard error {factor * error:.2g} over {seeds} seeds"
        made.append(Row(f"{_named(setting)}: {name}", factor * value, unit=unit, note=note))
    return made


def _named(setting: Setting) -> str:
    return f"{setting.spheres}, {1e3 * setting.viscosity:g} mPa s"
