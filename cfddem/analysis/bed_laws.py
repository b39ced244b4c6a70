"""Published laws of beds, compared with the means of a run: weight balance, Ergun, bed expansion."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np

from cfddem.analysis.measures import OF_THE_BED
from cfddem.analysis.report_values import LawComparison, Measure, comparison
from cfddem.case.column_grid import grid_of
from cfddem.case.particle_properties import particle_properties
from cfddem.case.schema import Case
from cfddem.fluid.cut_cells import open_share
from cfddem.io.reading import RunData
from cfddem.preflight.bed_estimate import bed_drag
from cfddem.preflight.expansion import Expansions, expansions, is_compared, spread_in_words
from closures import bed as laws_of_beds
from closures.balance import Sphere, pressure_gradient, speed_after, terminal_velocity
from closures.drag import ergun
from closures.registry import REGISTRY

FROM_HEIGHT, FROM_PRESSURE = "bed_voidage", "bed_voidage_from_pressure"
"""Measures of the voidage. Published laws were fitted to bed heights, so that the first is compared with them."""


def compared_with_bed_laws(case: Case, measures: Mapping[str, Measure]) -> list[LawComparison]:
    """One row for each law that applies to the case.

    measures  of the report
    """
    if (
        case.column.ends != "flow"
        or not isinstance(case.bed.inlet_velocity, float)
        or case.bed.inlet_velocity <= 0.0
        or case.bed.jets
        or _equipped(case)
        or not {"bed_voidage", "pressure_drop"} <= {*measures}
    ):
        return []
    drop = measures["pressure_drop"].mean
    if case.stands_still:
        return list(_of_a_fixed_bed(case, measures, drop))
    weight = buoyant_weight(case) / case.floor_area
    rows = [comparison("pressure drop by the buoyant weight", drop, weight, "Pa")]
    if "wall_load" in measures:
        carried = drop + measures["wall_load"].mean
        rows.append(comparison("pressure drop and wall load by the weight", carried, weight, "Pa"))
    if is_compared(case):
        voidage = measures[FROM_HEIGHT].mean
        for expansion in expansions(case).held:
            rows.append(comparison(f"voidage by {expansion.law}", voidage, expansion.voidage, "1", expansion.outside))
    return rows


def _of_a_fixed_bed(case: Case, measures: Mapping[str, Measure], drop: float) -> Iterator[LawComparison]:
    """The pressure drop by the drag law of the case, and by Ergun, over the length that all particles fill."""
    assert isinstance(case.bed.inlet_velocity, float)
    fluid = case.required_fluid
    length, voidage = measures["bed_height"].mean / OF_THE_BED, measures["bed_voidage"].mean
    flow = case.bed.inlet_velocity, case.bed.diameter, fluid.density, fluid.viscosity, voidage
    drag = bed_drag(case)
    if drag is not ergun:
        expected = length * pressure_gradient(*flow, drag)
        yield comparison(f"pressure drop by {drag.__name__}", drop, expected, "Pa")
    outside = _outside_range("ergun_gradient", voidage=voidage)
    yield comparison("pressure drop by Ergun", drop, length * laws_of_beds.ergun_gradient(*flow), "Pa", outside)


def expansion_note(case: Case, laws: list[LawComparison], measures: Mapping[str, Measure]) -> str:
    """Where the voidage of a run lies in the range of the published ones, and which of its two voidages to compare.

    laws      rows of the comparison
    measures  of the report
    returns   a few sentences; empty if no voidage is compared
    """
    rows = [law for law in laws if law.law.startswith("voidage by ")]
    if not rows:
        return ""
    low, high = (pick(row.expected for row in rows) for pick in (min, max))
    computed = rows[0].computed
    off = max(low - computed, computed - high)
    where = f"{off:.3f} {'below' if computed < low else 'above'} them" if off > 0.0 else "within"
    note = f"the published voidages differ by {high - low:.3f}, {low:.3f} to {high:.3f}; that of the run lies {where}"
    estimates = expansions(case)
    note += "".join(
        f". {sentence[0].upper()}{sentence[1:]}"
        for sentence in (spread_in_words(estimates), _beyond(estimates))
        if sentence
    )
    if FROM_PRESSURE in measures:
        other = measures[FROM_PRESSURE].mean - computed
        note += (
            f". Compare the bed voidage, from the height, as the laws were fitted to heights; that from the pressure, "
            f"{abs(other):.3f} {'higher' if other > 0.0 else 'lower'}, is of the middle of the bed"
        )
    return note


def _beyond(estimates: Expansions) -> str:
    """Laws that are not compared because they do not hold for a bed, in words; empty if there are none."""
    others = [expansion for expansion in estimates.every if expansion not in estimates.held]
    voidages = ", ".join(f"{expansion.law} {expansion.voidage:.3f} ({expansion.outside})" for expansion in others)
    return f"outside of their ranges: {voidages}" if others else ""


def expansion_laws(case: Case) -> dict[str, float]:
    """Voidage of a liquid-fluidised bed by each published expansion law that holds for it [-]."""
    return {expansion.law: expansion.voidage for expansion in expansions(case).held}


def buoyant_weight(case: Case) -> float:
    """Weight of the particles minus that of the displaced fluid [N]."""
    particles = particle_properties(case)
    excess = float((math.pi / 6.0 * particles.diameter**3 * (particles.density - case.around.density)).sum())
    return excess * abs(case.laws.gravity[2])


def _equipped(case: Case) -> bool:
    """Whether walls, feeds or outlets change the floor area or the number of particles."""
    changed = case.wall or case.feed or case.outlet or case.drains
    return bool(changed or (case.vessel and not case.vessel.is_upright))


def weight_over_floor(case: Case) -> float | None:
    """Buoyant weight per floor area [Pa]; None if the flow does not have to carry it."""
    if not case.has_fluid or case.stands_still or abs(case.laws.gravity[2]) == 0.0 or _equipped(case):
        return None
    return buoyant_weight(case) / case.floor_area


def _outside_range(law: str, **arguments: float) -> str:
    """Arguments that lie outside of the range of a law, in words; empty if there are none."""
    ranges = REGISTRY["bed"][law].ranges
    return "; ".join(
        f"{name} {value:.3g} is outside of {ranges[name][0]:g} to {ranges[name][1]:g}"
        for name, value in arguments.items()
        if name in ranges and not ranges[name][0] <= value <= ranges[name][1]
    )


# ---------------------------------------------------------------- a single sphere


MOST_SNAPSHOTS = 200
"""Largest number of snapshots that are read."""

ALIGNED = 1e-3
"""A slip velocity is along gravity if its transverse part is below this fraction."""


def compared_with_drag_law(run: RunData, case: Case) -> Iterator[tuple[str, float, float, str]]:
    """Name, value of the run, value of the drag law, and unit, for a run with one sphere that settles or rises.

    The first row is the last speed against the terminal velocity; the second the speed at the time of the largest
    deviation from the equation of motion. Speeds are relative to the mean of the fluid, up to the first contact.
    """
    drag, fluid, law = case.laws.drag_function(), case.around, case.laws.drag_law
    if not case.is_one_sphere or case.stands_still or law is None or drag is None:
        return
    density, gravity = case.solid_density, np.array(case.laws.gravity)
    strength = math.hypot(*gravity)
    if fluid.viscosity == 0.0 or density == fluid.density or strength == 0.0:
        return
    times, slip = slip_velocity(run, case)
    if len(times) < 2:
        return
    direction = math.copysign(1.0, density - fluid.density) * gravity / strength
    speeds = slip @ direction
    sphere = Sphere(case.bed.diameter, density, fluid.density, fluid.viscosity, drag, strength)
    yield f"terminal velocity by {law.name}", float(speeds[-1]), terminal_velocity(*sphere), "m/s"
    if case.laws.history != "none":
        return  # the equation of motion has a memory
    transverse = np.abs(slip - np.outer(speeds, direction)).max()
    if transverse > ALIGNED * np.abs(slip).max():
        return
    exact = [float(speeds[0])]
    for begin, end in pairwise(times):
        exact.append(speed_after(end - begin, exact[-1], sphere, added_mass=case.laws.added_mass_at(1.0)))
    worst = int(np.abs(speeds - exact).argmax())
    if worst:
        name = f"equation of motion, largest deviation at {times[worst]:.3g} s"
        yield name, float(speeds[worst]), exact[worst], "m/s"


def slip_velocity(run: RunData, case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and velocities [m/s] of the sphere relative to the mean fluid velocity, up to its first contact."""
    history = run.history
    contacts = history["time"][history["contact_count"] > 0.0]
    end, shares = contacts.min(initial=math.inf), open_share(grid_of(case))
    before = np.flatnonzero(run.times < end)
    chosen = before[np.unique(np.linspace(0, len(before) - 1, min(len(before), MOST_SNAPSHOTS)).astype(int))]
    times, slip = [], []
    for place in chosen.tolist():
        velocity = run.particles(place)["velocity"]
        if len(velocity):  # the sphere may have left the column
            times.append(run.times[place])
            of_fluid = run.fluid("velocity", place) * shares[..., None]
            slip.append(velocity[0] - of_fluid.mean(axis=(0, 1, 2)) / float(shares.mean()))
    return np.array(times), np.array(slip, float).reshape(-1, 3)
