"""What came out of a run: means with errors, beside what the laws of beds say."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.assembly import particle_diameters
from cfddem.case import Case
from cfddem.record.reading import open_run
from cfddem.record.series import block_average, stationarity
from closures import bed as laws_of_beds

MEASURES = ("bed_height", "bed_voidage", "pressure_drop", "granular_temperature", "fastest", "contact_count")


def report(folder: Path) -> dict[str, Any]:
    """Means over the averaging window of a run, and the laws that hold for it.

    folder   of the run
    returns  plain values: `case`, `status`, `window`, `measures` (mean, error, unit), `laws` (law, computed,
             expected, ratio), `ledger`
    """
    run = open_run(folder)
    case = Case.from_text(run.case_text, str(folder / "case.toml"))
    history = run.history
    time = history["time"]
    end = float(time[-1])
    begin = 0.5 * end if case.run.average_from is None else min(case.run.average_from, end)
    window = time >= begin
    measures = {}
    for name in MEASURES:
        if name in history:
            average = block_average(history[name][window])
            steady = stationarity(history[name][window])
            measures[name] = {
                "mean": average.mean,
                "error": average.error,
                "unit": run.unit(name),
                "drift": steady.drift,
            }
    ledger: dict[str, float] = {
        name: float(np.nanmax(np.abs(history[name][1:]))) if len(time) > 1 else float("nan")
        for name in ("exchange_imbalance", "volume_imbalance")
        if name in history
    }
    ledger["particles_lost"] = float(history["particle_count"][0] - history["particle_count"][-1])
    return {
        "case": case.title or folder.name,
        "folder": str(folder),
        "status": run.status,
        "message": run.message,
        "window": [begin, end],
        "measures": measures,
        "laws": _laws(case, measures),
        "ledger": ledger,
    }


def _laws(case: Case, measures: dict[str, Any]) -> list[dict[str, Any]]:
    """Each law of beds that applies, with what the run gave for it."""
    if case.fluid is None or case.column.ends != "flow" or not isinstance(case.bed.inlet_velocity, float):
        return []
    gravity = abs(case.laws.gravity[2])
    rows = []
    if not case.bed.fixed and case.bed.inlet_velocity > 0.0:
        weight = buoyant_weight(case) / floor_area(case.column.size, case.column.shape)
        rows.append(_compared("pressure drop over buoyant weight", measures["pressure_drop"]["mean"], weight, "Pa"))
    liquid = case.fluid.density > 100.0
    if liquid and gravity > 0.0 and not case.bed.fixed and case.bed.inlet_velocity > 0.0:
        found = measures["bed_voidage"]["mean"]
        for name, voidage in expansion_laws(case).items():
            rows.append(_compared(f"voidage by {name}", found, voidage, "-"))
    return rows


def expansion_laws(case: Case) -> dict[str, float]:
    """Voidage of a liquid bed by each published law of its expansion [-]."""
    assert case.fluid is not None and isinstance(case.bed.inlet_velocity, float)
    density, viscosity, diameter = case.fluid.density, case.fluid.viscosity, case.bed.diameter
    archimedes = density * (case.solid.density - density) * abs(case.laws.gravity[2]) * diameter**3 / viscosity**2
    if archimedes <= 0.0:
        return {}
    reynolds = laws_of_beds.terminal_reynolds_brown_lawler(archimedes)
    terminal = reynolds * viscosity / (density * diameter)
    exponents = {
        "Richardson-Zaki": laws_of_beds.exponent_richardson_zaki(reynolds, 0.0),
        "Garside": laws_of_beds.exponent_garside(reynolds),
        "Khan-Richardson": laws_of_beds.exponent_khan_richardson(archimedes, 0.0),
    }
    return {
        name: laws_of_beds.expanded_voidage(case.bed.inlet_velocity, terminal, exponent)
        for name, exponent in exponents.items()
    }


def buoyant_weight(case: Case) -> float:
    """Weight of the particles less that of the fluid they displace [N]."""
    assert case.fluid is not None
    volume = float((math.pi / 6.0 * particle_diameters(case) ** 3).sum())
    return volume * (case.solid.density - case.fluid.density) * abs(case.laws.gravity[2])


def floor_area(size: tuple[float, float, float], shape: str) -> float:
    """Area of the column's floor [m2]."""
    return 0.25 * math.pi * size[0] ** 2 if shape == "cylinder" else size[0] * size[1]


def _compared(law: str, computed: float, expected: float, unit: str) -> dict[str, Any]:
    return {"law": law, "computed": computed, "expected": expected, "ratio": computed / expected, "unit": unit}


def lines(result: dict[str, Any]) -> list[str]:
    """The report as text, at most 100 columns wide."""
    begin, end = result["window"]
    out = [f"{result['case']}: {result['status']}", f"means from {begin:g} to {end:g} s", ""]
    for name, each in result["measures"].items():
        error = "" if math.isnan(each["error"]) else f" +- {each['error']:.2g}"
        unit = "" if each["unit"] == "1" else each["unit"]
        out.append(f"  {name.replace('_', ' '):<24} {each['mean']:.4g}{error} {unit}".rstrip())
    if result["laws"]:
        out += ["", f"  {'law':<40} {'run':>10} {'law':>10} {'ratio':>7}"]
        for row in result["laws"]:
            out.append(f"  {row['law']:<40} {row['computed']:>10.4g} {row['expected']:>10.4g} {row['ratio']:>7.3f}")
    out += ["", "  ledger, largest over the run"]
    out += [f"  {name.replace('_', ' '):<24} {value:.2g}" for name, value in result["ledger"].items()]
    return out
