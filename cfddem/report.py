"""What came out of a run: means with errors, beside what the laws of beds say, and what speaks against it."""

from __future__ import annotations

import json
import math
import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.card import card
from cfddem.case import Case
from cfddem.errors import InputError
from cfddem.expected import LIQUID
from cfddem.lone_sphere import beside_its_drag_law
from cfddem.placement import grains_of
from cfddem.record import energy
from cfddem.record.quantities import MEAN_HEIGHT
from cfddem.record.reading import Run, open_run
from cfddem.record.regimes import RegimeMap, regime_map
from cfddem.record.series import block_average, stationarity
from cfddem.run_warnings import counted, warnings_of
from closures import bed as laws_of_beds
from closures import numbers
from closures.law import SHELF

MEASURES = (
    "bed_height", "bed_voidage", "bed_voidage_pressure", "pressure_drop", "wall_support", "granular_temperature",
    "fastest", "contact_count",
)  # fmt: skip

OF_ONE = ("bed_height", "wall_support", "fastest", "contact_count")
"""What is told of a sphere alone, which is no bed."""

FREE_SIDES = ("free_slip", "periodic")
"""Sides that do not hold the flow back: the bed is then as wide as one likes."""


def report(folder: Path) -> dict[str, Any]:
    """Means over the averaging window of a run, and the laws that hold for it.

    folder   of the run
    returns  plain values: `case`, `status`, `window`, `measures` (mean, error, unit, drift, stationary), `laws`
             (law, computed, expected, ratio), `ledger`, `energy` (lines of the energy ledger at the end [J], where the
             case asks for one), `encounters` (of the window, where those on films are recorded), `warnings`,
             `wall_time`, `card`, `provenance`
    """
    run = open_run(folder)
    if not len(run.history.get("time", ())):
        raise InputError("folder", str(folder), "a run with a history", "it ended before its first row")
    case = case_of(run)
    begin, end = window_of(run, case)
    inside = run.history["time"] >= begin
    heights = [name for name in run.history if name.startswith(MEAN_HEIGHT)]
    told = OF_ONE if case.particle_count == 1 else (*MEASURES, *heights)
    measures = {name: _measured(run, name, inside) for name in told if name in run.history}
    measures = {name: each for name, each in measures.items() if each["known"] > 0.5}
    laws = [*_laws(case, measures), *(_compared(*row) for row in beside_its_drag_law(run, case))]
    return {
        "case": case.title or folder.resolve().name,
        "folder": str(folder),
        "status": run.status,
        "message": run.message,
        "window": [begin, end],
        "measures": measures,
        "laws": laws,
        "ledger": _ledger(run),
        "energy": _energy(run),
        "encounters": _encounters(run, begin),
        "warnings": warnings_of(run, case, measures, laws),
        "wall_time": run.about.get("wall_time", {}),
        "steps": {"particles": int(run.steps[-1]) if len(run.steps) else 0, "fluid": counted(run, "fluid_steps")},
        "card": card(case).summary(),
        "provenance": run.provenance,
    }


def case_of(run: Run) -> Case:
    """The case that a run was begun with."""
    return Case.from_text(run.case_text, str(run.folder / "case.toml"))


def window_of(run: Run, case: Case) -> tuple[float, float]:
    """Begin and end of the means: as the case says, else the second half of what was run [s]."""
    end = float(run.history["time"][-1])
    return (0.5 * end if case.run.average_from is None else min(case.run.average_from, end)), end


def _measured(run: Run, name: str, inside: np.ndarray) -> dict[str, Any]:
    """Mean with its error, and whether the series is stationary in the window."""
    column = run.history[name][inside]
    values = column[np.isfinite(column)]
    average, steady = block_average(values), stationarity(values)
    return {
        "known": len(values) / len(column),
        "mean": average.mean,
        "error": average.error,
        "error_is_lower_bound": not average.enough,
        "unit": run.unit(name),
        "long_name": run.long_name(name),
        "drift": steady.drift,
        "drift_error": steady.error,
        "stationary": None if math.isnan(steady.drift) else steady.stationary,
    }


def steadiness(measured: dict[str, Any]) -> str:
    """Whether a measure is stationary, in words."""
    if measured["stationary"] is None:
        return "too short to say"
    if measured["stationary"]:
        return "stationary"
    drift = measured["drift"]
    return f"drifts, by {drift:+.2g}" if abs(drift) > 3.0 * measured["drift_error"] else "still settling"


def _ledger(run: Run) -> dict[str, float]:
    """What must not change, at its largest over the run."""
    history = run.history
    ledger = {
        name: float(np.nanmax(np.abs(history[name][1:]))) if len(history[name]) > 1 else math.nan
        for name in ("exchange_imbalance", "volume_imbalance")
        if name in history
    }
    return ledger | {"particles_lost": float(history["particle_count"][0] - history["particle_count"][-1])}


def _energy(run: Run) -> dict[str, float]:
    """The energy ledger at the end [J]; empty where the run has none."""
    lines = (name for name in energy.FIELDS if name in run.history)
    return {name.removeprefix("energy_"): float(run.history[name][-1]) for name in lines}


def _encounters(run: Run, begin: float) -> dict[str, float]:
    """How hard the encounters of the window were; empty where none on films were recorded."""
    found = recorded_regimes(run, begin)
    if found is None:
        return {}
    return {
        "number": found.encounters,
        "median_stokes": found.median_stokes,
        "solids_meet": found.solids_meet,
        "film_deforms": found.deformed,
    }


def recorded_regimes(run: Run, begin: float) -> RegimeMap | None:
    """The regime map of all encounters that ended after a time [s]; None where none on films were recorded."""
    rows = run.collisions
    if "weight" not in rows:
        return None
    late = (rows["end"] >= begin) & np.isfinite(rows["stokes"]) & (rows["stokes"] > 0.0)
    return regime_map({name: column[late] for name, column in rows.items()}) if late.any() else None


def energy_lines(ledger: dict[str, float]) -> list[tuple[str, str, float, float]]:
    """Group, line, energy [J] and its part of what was put in [-], in the order in which they are read.

    A line that is nothing is left out.
    """
    put_in = max(ledger["put_in"], 1e-300)
    groups = {
        "stored since the start": energy.STORED,
        "gained": energy.GAINED,
        "lost": energy.LOST,
        "between the phases": energy.PASSED,
    }
    lines = [(group, name, ledger.get(name, 0.0)) for group, names in groups.items() for name in names]
    lines = [line for line in lines if line[2] != 0.0] + [("not explained", "remainder", ledger["remainder"])]
    return [(group, name, value, value / put_in) for group, name, value in lines]


# ---------------------------------------------------------------- laws


def _laws(case: Case, measures: dict[str, Any]) -> list[dict[str, Any]]:
    """Each law of beds that applies, with what the run gave for it."""
    if case.fluid is None or case.column.ends != "flow" or not isinstance(case.bed.inlet_velocity, float):
        return []
    if (
        case.bed.inlet_velocity <= 0.0
        or case.bed.jet is not None
        or not {"bed_voidage", "pressure_drop"} <= {*measures}
    ):
        return []
    drop = measures["pressure_drop"]["mean"]
    if case.bed.fixed:
        height, voidage = measures["bed_height"]["mean"], measures["bed_voidage"]["mean"]
        inlet, fluid = case.bed.inlet_velocity, case.fluid
        slope = laws_of_beds.ergun_gradient(inlet, case.bed.diameter, fluid.density, fluid.viscosity, voidage)
        return [_compared("pressure drop by Ergun", drop, slope * height, "Pa", "ergun_gradient", voidage=voidage)]
    weight = buoyant_weight(case) / case.column.floor_area
    rows = [_compared("pressure drop by the buoyant weight", drop, weight, "Pa")]
    if case.fluid.density > LIQUID and abs(case.laws.gravity[2]) > 0.0 and not case.bed.species:
        for name, voidage in expansion_laws(case).items():
            for way, told in (("bed_voidage", "height"), ("bed_voidage_pressure", "pressure")):
                if way in measures:
                    rows.append(_compared(f"voidage by {name}, from {told}", measures[way]["mean"], voidage, "-"))
    return rows


def expansion_laws(case: Case) -> dict[str, float]:
    """Voidage of a liquid bed by each published law of its expansion [-]."""
    assert isinstance(case.bed.inlet_velocity, float)
    return {
        name: laws_of_beds.expanded_voidage(case.bed.inlet_velocity, limit, exponent)
        for name, (exponent, limit) in expansion_exponents(case).items()
    }


def expansion_exponents(case: Case) -> dict[str, tuple[float, float]]:
    """Exponent n [-] and velocity at voidage 1 [m/s] of each published law; with walls where they hold the flow."""
    assert case.fluid is not None
    density, viscosity, diameter = case.fluid.density, case.fluid.viscosity, case.bed.diameter
    archimedes = numbers.archimedes(diameter, case.solid_density, density, viscosity, abs(case.laws.gravity[2]))
    if archimedes <= 0.0:
        return {}
    reynolds = laws_of_beds.terminal_reynolds_brown_lawler(archimedes)
    terminal = reynolds * viscosity / (density * diameter)
    wall = 0.0 if case.column.sides in FREE_SIDES else diameter / min(case.column.size[:2])
    laws = {
        "Richardson-Zaki": (
            laws_of_beds.exponent_richardson_zaki(reynolds, wall),
            laws_of_beds.wall_factor_richardson_zaki(wall),
        ),
        "Garside": (laws_of_beds.exponent_garside(reynolds), laws_of_beds.wall_factor_richardson_zaki(wall)),
        "Khan-Richardson": (
            laws_of_beds.exponent_khan_richardson(archimedes, wall),
            laws_of_beds.wall_factor_khan_richardson(wall),
        ),
    }
    return {name: (exponent, factor * terminal) for name, (exponent, factor) in laws.items()}


def buoyant_weight(case: Case) -> float:
    """Weight of the particles less that of the fluid they displace [N]."""
    assert case.fluid is not None
    grains = grains_of(case)
    excess = float((math.pi / 6.0 * grains.diameter**3 * (grains.density - case.fluid.density)).sum())
    return excess * abs(case.laws.gravity[2])


def _compared(what: str, computed: float, expected: float, unit: str, law: str = "", **asked: float) -> dict[str, Any]:
    """One law beside the run; and where it was asked outside of its own range."""
    ranges = SHELF["bed"][law].ranges if law else {}
    outside = [
        f"{name} {asked[name]:.3g} is not within {low:g} to {high:g}"
        for name, (low, high) in ranges.items()
        if name in asked and not low <= asked[name] <= high
    ]
    return {
        "law": what, "computed": computed, "expected": expected, "ratio": computed / expected, "unit": unit,
        "outside_range": "; ".join(outside),
    }  # fmt: skip


# ---------------------------------------------------------------- as text


def lines(result: dict[str, Any]) -> list[str]:
    """The report as text, at most 100 columns wide."""
    begin, end = result["window"]
    out = [f"{result['case']}: {result['status']}", f"means from {begin:g} to {end:g} s", ""]
    for name, each in result["measures"].items():
        error = "" if math.isnan(each["error"]) else f" +- {each['error']:.2g}"
        unit = "" if each["unit"] == "1" else each["unit"]
        value = f"{each['mean']:.4g}{error} {unit}".rstrip()
        out.append(f"  {name.replace('_', ' '):<24} {value:<28} {steadiness(each)}")
    if result["laws"]:
        wide = max(40, *(len(row["law"]) for row in result["laws"]))
        out += ["", f"  {'law':<{wide}} {'run':>10} {'law':>10} {'ratio':>7}"]
        for row in result["laws"]:
            out.append(f"  {row['law']:<{wide}} {row['computed']:>10.4g} {row['expected']:>10.4g} {row['ratio']:>7.3f}")
    out += ["", "  ledger, largest over the run"]
    out += [f"  {name.replace('_', ' '):<24} {value:.2g}" for name, value in result["ledger"].items()]
    if result.get("encounters"):
        met = result["encounters"]
        out += [
            "",
            f"  {met['number']:.0f} encounters on films: median St {met['median_stokes']:.3g}; the solids meet in "
            f"{100.0 * met['solids_meet']:.3g} %, the film deforms them in {100.0 * met['film_deforms']:.3g} %",
        ]
    if result.get("energy"):
        put_in = result["energy"]["put_in"]
        out += ["", f"  energy, of {put_in:.4g} J put in"]
        for group, name, joules, part in energy_lines(result["energy"]):
            out.append(f"  {group:<24} {name.replace('_', ' '):<24} {joules:>12.4g} J {100.0 * part:>9.3f} %")
    total = sum(result["wall_time"].values())
    if total:
        parts = sorted(result["wall_time"].items(), key=lambda each: -each[1])
        shares = ", ".join(f"{name} {100 * seconds / total:.0f} %" for name, seconds in parts[:6])
        out += ["", *textwrap.wrap(f"  wall time {total:.3g} s: {shares}", 98, subsequent_indent="    ")]
    if result["warnings"]:
        out.append("")
        for each in result["warnings"]:
            out += textwrap.wrap(f"warning: {each}", 98, initial_indent="  ", subsequent_indent="    ")
    return out


def as_json(result: Any) -> str:
    """The report as JSON, with null for what has no value."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: plain(each) for name, each in value.items()}
        if isinstance(value, list | tuple):
            return [plain(each) for each in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return json.dumps(plain(result), allow_nan=False)
