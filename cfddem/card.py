"""The card: what a run will be before it runs, in numbers, and what speaks against it.

It is made of laws alone, so that it is there at once: nothing is compiled, poured or allocated for it.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from cfddem.case import Case
from cfddem.errors import CfddemError, InputError
from cfddem.expected import Bed, Cost, Encounter, Steps, bed_of, cost_of, encounter_of, steps_of
from cfddem.finding import WIDTH, Finding
from cfddem.findings import findings
from cfddem.findings_flow import bubbles
from cfddem.mixture import bed_drag, sinking
from closures import timescales


class RedCard(CfddemError):
    """A case that is not worth running."""

    exit_code = 2


@dataclass(frozen=True)
class Row:
    """One number of the card."""

    group: str
    name: str
    value: float
    unit: str = ""
    note: str = ""


@dataclass(frozen=True)
class Card:
    """What a run will be: numbers, and what speaks against it."""

    title: str
    rows: tuple[Row, ...]
    findings: tuple[Finding, ...]

    @property
    def colour(self) -> str:
        """green, amber or red: that of the worst finding."""
        colours = {each.colour for each in self.findings}
        return "red" if "red" in colours else "amber" if colours else "green"

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def summary(self) -> dict[str, Any]:
        """Plain values: colour, findings, and the numbers by group and name."""
        groups: dict[str, dict[str, Any]] = {}
        for row in self.rows:
            value = row.value if math.isfinite(row.value) else None
            groups.setdefault(row.group, {})[row.name] = {"value": value, "unit": row.unit, "note": row.note}
        found = [asdict(each) for each in self.findings]
        return {"case": self.title, "colour": self.colour, "findings": found, "numbers": groups}

    def lines(self) -> list[str]:
        """The card as text, at most 100 columns wide."""
        out, group = [textwrap.shorten(self.title, WIDTH, placeholder=" ...")], ""
        for row in self.rows:
            if row.group != group:
                group = row.group
                out += ["", group]
            out.append(f"  {row.name:<34} {_number(row.value):>10} {row.unit:<5} {row.note}".rstrip())
        return [*out, "", *self.verdict()]

    def verdict(self) -> list[str]:
        """The colour, and what speaks against the run, at most 100 columns wide."""
        if not self.findings:
            return ["green: nothing speaks against it"]
        return [line for each in self.findings for line in each.lines()]


def card(case: Case) -> Card:
    """The card of a case.

    >>> made = card(Case(
    ...     fluid=dict(density=998.0, viscosity=1e-3),
    ...     material=dict(glass=dict(density=2540.0, youngs_modulus=60e9, contact_modulus=1e7, poisson=0.23)),
    ...     column=dict(width=0.02, height=0.12, cell=0.005),
    ...     bed=dict(diameter=2e-3, count=2000, inlet_velocity=0.05),
    ...     run=dict(until=2.0),
    ... ))
    >>> made.colour, [round(row.value, 3) for row in made.rows if row.name.startswith("u / ")]
    ('green', [1.867, 0.185])
    """
    title = case.title or "a case without a title"
    try:
        bed = bed_of(case)
        pair = encounter_of(case, bed)
        steps = steps_of(case, bed)
        cost = cost_of(case, bed, steps)
        found = findings(case, bed, pair, steps, cost)
    except InputError as refused:
        reason = f"{'' if refused.value is None else f'{refused.value!r} '}must be {refused.limit}"
        key = refused.field.replace("grid.", "column.")
        return Card(title, (), (Finding("red", key, reason, refused.remedy or "change it"),))
    except (ArithmeticError, ValueError):
        reason = "numbers so large or small that no law can be evaluated"
        return Card(title, (), (Finding("red", "case", reason, "all values are in SI units: m, kg, s, Pa"),))
    rows = [
        *_flow_rows(case, bed),
        *_species_rows(case, bed),
        *_film_rows(case, pair),
        *_step_rows(case, bed, steps),
        *_outlook(case, bed, cost),
    ]
    return Card(title, tuple(rows), tuple(found))


def refuse_red(case: Case) -> Card:
    """The card of a case, if it is not red; else RedCard with everything that speaks against the run."""
    made = card(case)
    if made.colour == "red":
        raise RedCard("\n".join(str(each) for each in made.findings if each.colour == "red"))
    return made


def _flow_rows(case: Case, bed: Bed) -> Iterator[Row]:
    group = "particles and flow"
    yield Row(group, "particles", bed.count)
    if case.fluid is None:
        return
    cells = case.column.cell if isinstance(case.column.cell, float) else min(case.column.cell)
    yield Row(group, "cell / diameter", cells / case.bed.largest, "", "of the largest species" * bool(case.bed.species))
    yield Row(group, "density ratio", case.solid_density / case.fluid.density, "", "solid over fluid")
    if math.isnan(bed.archimedes):
        return
    yield Row(group, "Re_p", bed.reynolds, "", f"of the {'superficial inlet' if bed.inlet else 'terminal'} velocity")
    yield Row(group, "Ar", bed.archimedes)
    slowest = "the slowest species" if case.bed.species else "one particle"
    yield Row(group, "u_mf", bed.onset, "m/s", f"minimum fluidisation by {bed_drag(case).__name__}")
    yield Row(group, "u_t", bed.terminal, "m/s", f"of {slowest} alone, Brown and Lawler")
    if bed.inlet and bed.onset and bed.terminal:
        yield Row(group, "u / u_mf", bed.inlet / bed.onset)
        yield Row(group, "u / u_t", bed.inlet / bed.terminal)


def _species_rows(case: Case, bed: Bed) -> Iterator[Row]:
    """What each species of a mixture is, and whether it sinks."""
    if not case.bed.species:
        return
    group, whole = "species", sum(case.volumes.values())
    flows = bed.inlet > bed.onset
    forces = sinking(case, bed.inlet, bed.voidage) if flows else {}
    for name, each in case.species.items():
        yield Row(group, f"{name}: particles", case.counts[name])
        yield Row(group, f"{name}: share of the volume", case.volumes[name] / whole)
        yield Row(group, f"{name}: diameter over mean", each.sauter / case.bed.diameter, "", "over the Sauter mean")
        if name in forces:
            note = "in the even mixture it " + ("sinks" if forces[name] > 0.0 else "rises")
            yield Row(group, f"{name}: force over weight", forces[name], "", note)


def _film_rows(case: Case, pair: Encounter) -> Iterator[Row]:
    if case.bed.fixed:
        return
    among, diameter = f" of {pair.species}" * bool(case.bed.species), case.species[pair.species].diameter
    group = f"collisions{among} at {pair.speed:.3g} m/s"
    if pair.gap > 0.0:
        yield Row(group, "St", pair.stokes, "", "inertia of a pair against its film")
        own = case.laws.pair_laws.get("minimum_gap")
        film = "elasticity of the solids" if own is None else own.name
        regime = film if pair.film_gap > pair.roughness_gap else "roughness"
        yield Row(group, "minimum gap", pair.gap, "m", f"set by {regime}")
        yield Row(group, "minimum gap / roughness", pair.gap / pair.roughness_gap)
        if pair.softening < 1.0:
            note = "if the film felt the softened modulus, too"
            yield Row(group, "minimum gap, softened", pair.softened_gap, "m", note)
    yield Row(group, "contact modulus / real", pair.softening)
    yield Row(group, "overlap / diameter", pair.overlap / diameter, "", "deepest, dry")
    if pair.softening < 1.0:
        yield Row(group, "overlap / diameter, real", pair.real_overlap / diameter, "", "with the real modulus")
    resting = pair.resting_overlap / diameter
    yield Row(group, "overlap / diameter, at rest", resting, "", "under the bed's weight")


def _step_rows(case: Case, bed: Bed, steps: Steps) -> Iterator[Row]:
    group, read = "clocks", steps.clocks
    if not case.bed.fixed:
        chosen = "given" if case.run.step else "2 % of the Hertz time, or half the limit"
        yield Row(group, "step of the particles", steps.particle, "s", chosen)
        yield Row(group, "2 % of the Hertz time", read.hertz, "s")
        yield Row(group, "limit of impacts", read.impact, "s", "binds" if read.binding == "impact" else "")
        yield Row(group, "limit of crossing", read.crossing, "s", "binds" if read.binding == "crossing" else "")
    if case.fluid is None or math.isinf(steps.fluid):
        return
    yield Row(group, "step of the fluid", steps.fluid, "s", f"set by {steps.binding}")
    for name, limit in sorted(steps.limits.items(), key=lambda each: each[1]):
        yield Row(group, f"{name} clock", limit, "s", "binds" if name == steps.binding else "")
    if not case.bed.fixed:
        yield Row(group, "particle steps in a fluid step", max(1.0, math.ceil(steps.fluid / steps.particle - 1e-9)))
    if not math.isnan(bed.drag_factor) and 0.0 < bed.voidage < 1.0:
        fluid, density = case.fluid, case.solid_density
        relaxation = timescales.drag_time(case.bed.diameter, density, fluid.viscosity, bed.voidage, bed.drag_factor)
        load = (1.0 - bed.voidage) * density / (bed.voidage * fluid.density)
        stiffness = load * steps.fluid / relaxation
        yield Row(group, "beta dt / (eps rho)", stiffness, "", "stiffness of the drag; it is implicit")


def _outlook(case: Case, bed: Bed, cost: Cost) -> Iterator[Row]:
    group = "to be expected"
    if case.fluid is not None and not math.isnan(bed.archimedes) and (case.bed.start == "poured" or bed.inlet):
        note = (
            "at least: it bubbles"
            if bubbles(case, bed)
            else "by the balance of weight and drag"
            if bed.inlet > bed.onset
            else ""
        )
        yield Row(group, "bed height", bed.height, "m", note)
        yield Row(group, "bed voidage", bed.voidage)
        if bed.inlet:
            note = "Ergun" if case.bed.fixed or bed.inlet < bed.onset else "buoyant weight over the floor"
            yield Row(group, "pressure drop", bed.pressure_drop, "Pa", note)
    elif case.bed.start == "poured":
        yield Row(group, "bed height", bed.height, "m", "poured")
    amount, unit = _duration(cost.seconds)
    yield Row(group, "time on one core", amount, unit, "to a factor of three, loops compiled")
    yield Row(group, "memory", cost.memory / 1e9, "GB")
    yield Row(group, "snapshots", cost.snapshots, "", f"{cost.disk / 1e6:.3g} MB")


def _duration(seconds: float) -> tuple[float, str]:
    for length, unit in ((86_400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds > 2.0 * length:
            return seconds / length, unit
    return seconds, "s"


def _number(value: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:.0f}" if float(value).is_integer() and abs(value) < 1e7 else f"{value:.4g}"
