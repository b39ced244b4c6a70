"""The report of a run: means with errors, comparison with published laws, conservation, warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from cfddem.analysis.bed_laws import compared_with_bed_laws, compared_with_drag_law, expansion_note
from cfddem.analysis.fluctuations import RegimeMap, impacts, regime_map
from cfddem.analysis.key_results import DRIFTING, key_results
from cfddem.analysis.measured import compared_with_measured, with_files
from cfddem.analysis.report_text import Report
from cfddem.analysis.report_values import Citation, EnergyLine, Measure, comparison
from cfddem.analysis.run_warnings import NOTE, STATE, last_value, warnings_of
from cfddem.analysis.series import block_average, drift_of, stationarity
from cfddem.backend.errors import InputError
from cfddem.case.bed import at_times, pairs_of
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run
from cfddem.preflight.summary import preflight
from closures.registry import REGISTRY, Law, load_built_in_laws

NO_DRIFT = 1e-3
"""Drift over the mean up to which a mean is steady, whatever its error."""

ENERGY = "energy_"
"""Prefix of the columns of the energy budget in the history."""


def report(folder: str | Path, data: Sequence[str | Path] = ()) -> Report:
    """Means over the averaging window of a run, and the laws that apply to it.

    folder   of the run
    data     files of measured points beside those of the case
    errors   InputError if the run has no history, or for data that cannot be read

    >>> found = report("bed")                                              # doctest: +SKIP
    >>> found.measures["bed_height"].mean, found.key_results[0].verdict    # doctest: +SKIP
    """
    folder = Path(folder)
    run = open_run(folder)
    if not len(run.history.get("time", ())):
        raise InputError("folder", str(folder), "a run with a history", "the run ended before its first row")
    case = with_files(case_of(run), [Path(path) for path in data])
    begin, end = window_of(run, case)
    measures = _measures(run, begin, inlet_changes(case, begin, end))
    drag_law = (comparison(*row) for row in compared_with_drag_law(run, case))
    laws = [*compared_with_bed_laws(case, measures), *drag_law]
    energy = _energy(run)
    checked = preflight(case)
    actions = warnings_of(run, case, measures, laws, checked.issues)
    return Report(
        case=case.title or folder.resolve().name,
        folder=str(folder),
        status=run.status,
        message=run.message,
        window=(begin, end),
        films="" if case.stands_still else case.laws.film_in_words(case.around),
        surface=case.surface_in_words,
        key_results=key_results(run, case, measures, laws, STATE in actions),
        measures=measures,
        measured=[compared.score() for compared in compared_with_measured(run, case, begin)],
        laws=laws,
        laws_note=expansion_note(case, laws, measures),
        ledger=_ledger(run),
        energy=energy,
        energy_lines=_energy_lines(run, energy),
        collisions=_collisions(run, begin),
        impacts=_impacts(run, begin, end),
        film_solution=_film_solution(run, begin),
        warnings=[entry for action, group in actions.items() for entry in group if action != NOTE],
        actions=actions,
        wall_time=run.about.get("wall_time", {}),
        steps={"particles": int(run.steps[-1]) if len(run.steps) else 0, "fluid": last_value(run, "fluid_steps")},
        preflight=checked.summary(),
        provenance=run.provenance,
        references=references_of(case),
    )


def case_of(run: RunData) -> Case:
    """The case of a run."""
    case = Case.from_text(run.case_text, str(run.folder / "case.toml"), finished=True)
    return case.with_files_of(run.folder)


def window_of(run: RunData, case: Case) -> tuple[float, float]:
    """Start and end of the averaging window [s]: from `run.average_from`, or the second half of the run.

    If the inlet velocity changes in steps, the window is the second half of the last step.

    The run has recorded the start if the errors of its means have ended it.
    """
    first, end = float(run.history["time"][0]), float(run.history["time"][-1])
    if run.averages_from is not None:
        return run.averages_from, end
    if case.run.average_from is None:
        return _start_of_means(case, first, end), end
    return min(max(case.run.average_from, first), end), end


def _start_of_means(case: Case, first: float, end: float) -> float:
    """Middle of a run, or of the time for which its inlet holds its last velocity [s]."""
    times, velocities = pairs_of(case.bed.inlet_velocity).T
    last = at_times(case.bed.inlet_velocity, end)
    changing = [time for time, velocity in zip(times, velocities) if time < end and velocity != last]
    begins = [time for time in times if time < end and time > max(changing, default=-math.inf)]
    return 0.5 * (max(begins[0], first) + end) if begins else 0.5 * (first + end)


def recorded_regimes(run: RunData, begin: float) -> RegimeMap | None:
    """The regime map of all collisions that ended after a time [s]; None if none with films were recorded."""
    rows = run.collisions
    if "weight" not in rows:
        return None
    late = (rows["end"] >= begin) & np.isfinite(rows["stokes"]) & (rows["stokes"] > 0.0)
    return regime_map({name: column[late] for name, column in rows.items()}) if late.any() else None


def _in_group(run: RunData, group: str) -> list[str]:
    """Columns of the history whose declared group is, or starts with, the given one."""
    declared = run.quantities.get("history", {})
    return [name for name in run.history if name in declared and declared[name].group.startswith(group)]


def inlet_changes(case: Case, begin: float, end: float) -> str:
    """How the inlet velocity changes between two times [s], in words; empty if it is constant."""
    times = pairs_of(case.bed.inlet_velocity)[:, 0]
    inside = np.append(times[(times > begin) & (times < end)], [begin, end])
    within = at_times(case.bed.inlet_velocity, inside)
    low, high = float(within.min()), float(within.max())
    return f"the inlet velocity changes within that time, {low:.3g} to {high:.3g} m/s" if high > low else ""


def _measures(run: RunData, begin: float, changes: str) -> dict[str, Measure]:
    """Every measure with a value in at least half of the rows of the window: its mean and error, and its drift.

    Mean and drift are of the same rows. A start-up within them counts where it moves the mean.

    changes  how the inlet velocity changes in these rows, in words
    """
    inside, measures = run.history["time"] >= begin, dict[str, Measure]()
    for name in _in_group(run, "measure"):
        column, quantity = run.history[name][inside], run.quantity(name)
        finite = np.isfinite(column)
        if finite.sum() <= 0.5 * len(column):
            continue
        values, time = column[finite], run.history["time"][inside][finite]
        average, (drift, drift_error) = block_average(values), drift_of(time, values)
        steady = stationarity(values).stationary or abs(drift) <= NO_DRIFT * abs(average.mean)
        start_up = abs(drift) > max(3.0 * drift_error, DRIFTING * abs(average.mean))
        measures[name] = Measure(
            mean=average.mean,
            error=average.error,
            error_is_lower_bound=not average.enough,
            unit=quantity.unit,
            meaning=quantity.meaning,
            drift=drift,
            drift_error=drift_error,
            drift_times=(float(time[0]), float(time[-1])),
            stationary=None if math.isnan(drift) else steady and not start_up,
            inlet_changes=changes,
        )
    return measures


def _ledger(run: RunData) -> dict[str, float]:
    """Largest imbalance of each conserved quantity over the run, and the particles that are lost."""
    ledger = {
        name: float(np.nanmax(np.abs(run.history[name][1:]))) if len(run.history[name]) > 1 else math.nan
        for name in _in_group(run, "imbalance")
    }
    count, nothing = run.history["particle_count"], np.zeros(1)
    came = run.history.get("fed_count", nothing) - run.history.get("removed_count", nothing)
    return ledger | {"particles_lost": float(count[0] + came[-1] - came[0] - count[-1])}  # a run may go on from another


def _energy(run: RunData) -> dict[str, float]:
    """The energy budget at the end [J]; empty if the run has none."""
    return {name.removeprefix(ENERGY): float(run.history[name][-1]) for name in _in_group(run, "energy")}


def _energy_lines(run: RunData, energy: dict[str, float]) -> list[EnergyLine]:
    """Lines of the energy budget in reading order: group, name, energy [J] and its fraction of the input [-].

    Terms that are zero are omitted.
    """
    lines = []
    for name in energy:
        group = run.quantity(ENERGY + name).group.removeprefix("energy: ")
        if name != "put_in" and (energy[name] != 0.0 or group == "balance"):
            share = energy[name] / max(energy["put_in"], 1e-300)
            lines.append(EnergyLine(group, name, energy[name], share))
    return lines


def _collisions(run: RunData, begin: float) -> dict[str, float]:
    """Summary of the collisions in the window; empty if none with films were recorded."""
    regimes = recorded_regimes(run, begin)
    if regimes is None:
        return {}
    return {
        "number": regimes.collisions,
        "median_stokes": regimes.median_stokes,
        "contact_fraction": regimes.contact_fraction,
        "deformed_fraction": regimes.deformed_fraction,
    }


def _impacts(run: RunData, begin: float, end: float) -> dict[str, float]:
    """Rate [1/s] and mean speed [m/s] of the collisions between particles in the window; empty if not recorded."""
    if "weight" not in run.collisions or not end > begin:
        return {}
    statistics = impacts(run.collisions, begin, end, int(run.history["particle_count"][-1]))
    return {"rate": statistics.rate, "contact_rate": statistics.contact_rate, "mean_speed": statistics.mean_speed}


def _film_solution(run: RunData, begin: float) -> dict[str, float]:
    """Iterations of films solved together in a step, and their largest damping number in the window; empty if none."""
    steps, iterations, damping = (
        run.history.get(name, np.zeros(0))
        for name in ("film_step_count", "film_iteration_count", "film_damping_number")
    )
    inside = run.history["time"] >= begin
    if not len(steps) == len(iterations) == len(damping) == len(inside) or not inside.any():
        return {}  # a run without films, or a history that lacks a column
    if not steps[inside][-1] > steps[inside][0]:
        return {}
    per_step = (iterations[inside][-1] - iterations[inside][0]) / (steps[inside][-1] - steps[inside][0])
    return {"iterations": float(per_step), "damping_number": float(np.nanmax(damping[inside]))}


# ---------------------------------------------------------------- laws that a case uses, with their sources


FILM = {
    "nijssen": ("film_strength",),
    "nijssen_full": ("film_strength", "shear_resistance"),
    "nijssen_full_twist": ("film_strength", "shear_resistance"),
}
"""Names of the registered laws of the built-in films."""

BRIDGE = (
    ("capillary", "pull", "pull"),
    ("rupture", "rupture", "rupture"),
    ("bridge", "film", "share"),
    ("bridge", "tangential", "tangential"),
)
"""Kind of the laws of a bridge, key of `[liquid]` that names one, and the ending of its name in the registry."""


def references_of(case: Case) -> list[Citation]:
    """Kind, name and reference of each law of a case."""
    load_built_in_laws()
    citations = [Citation(law.kind.replace("_", " "), law.name, law.reference) for law in _used(case)]
    if not case.bed.fixed and case.particle_count > 1 and "contact" not in case.laws.missing:
        contact = case.laws.contact_law
        citations.append(Citation("contact law", contact.name, contact.reference))
    return [citation for place, citation in enumerate(citations) if citation not in citations[:place]]


def _used(case: Case) -> Iterator[Law]:
    laws = case.laws
    if case.has_fluid:
        choices = (laws.drag_law, laws.added_mass_law, case.agitation)
        yield from (law for law in choices if isinstance(law, Law))
        yield from (REGISTRY["history"][name] for name in (laws.history,) if name in REGISTRY["history"])
        yield from (REGISTRY["lift"][name] for name in ("saffman_mei", "magnus") if laws.lift)
        yield from (REGISTRY["lift"][name] for name in ("torque",) if laws.torque)
        yield from (REGISTRY["wall_drag"][name] for name in ("towards_wall", "along_wall") if laws.wall_drag != "none")
    if case.has_films and not case.stands_still:
        yield from (REGISTRY["lubrication"][name] for name in FILM.get(str(laws.film_in(case.around)), ()))
        yield laws.pair_laws.get("minimum_gap", REGISTRY["minimum_gap"]["elastohydrodynamic"])
        yield from (law for kind, law in laws.pair_laws.items() if kind == "lubrication")
    if case.liquid is not None:
        for kind, key, ending in BRIDGE:
            law = REGISTRY[kind].get(f"{getattr(case.liquid, key)}_{ending}")
            if law is not None:
                yield law
        if case.liquid.rupture == "capillary":
            yield REGISTRY["capillary"]["rupture_length"]
