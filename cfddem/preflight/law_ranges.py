"""Laws outside of the ranges for which they were fitted, and what that changes in the result.

The change is estimated by other laws, which were fitted at the state of the bed. Where there are none, the message says
so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from inspect import signature
from statistics import median

from cfddem.backend.law_choice import drag_by_name
from cfddem.case.bed import POURED_SOLID_FRACTION
from cfddem.case.schema import Case
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.issue import Issue
from closures import balance
from closures.agitation import TIMES
from closures.capillary_pull import lambert_energy, rabinovich_energy, willett_energy
from closures.lift import saffman_mei
from closures.registry import REGISTRY, Law, is_built_in, law_of, load_built_in_laws

DILUTE = 0.95
"""Voidage above which a law for single spheres may be used [-]."""

REMEDY = "choose another law; cfddem explain lists all with their ranges"

ON_BY_DEFAULT = 'on by default; laws.agitation = "none" leaves it out'
"""What a user should know who has chosen no law of agitation."""

AGITATED = "inside, agitation changes bed heights by up to 3 %; without it small beds come to rest"
"""Effect on the beds of the lubrication study with and without agitation."""

NOT_FITTED_WITH = (
    "fitted without added mass and history force; with both, granular temperatures are 10 to 27 % lower and farther "
    "from those of resolved suspensions"
)
"""Effect of these forces on the law of agitation, by `cfddem validate agitation`."""


def check_ranges(case: Case, bed: BedEstimate) -> Iterator[Issue]:
    """Check that the laws of the fluid's forces are used inside of their ranges."""
    law = case.laws.drag_law
    if law is None or not case.resists:
        return
    state = state_of(case, bed)
    ratios = [species.sauter_diameter / case.bed.diameter for species in case.species.values()]
    if reason := outside(law, state, ratios):
        yield Issue("warning", "laws.drag", reason + _and(effect_of_drag(case, law, bed)), REMEDY, False)
    added, agitation = case.laws.added_mass_law, "none" if case.stands_still else case.agitation
    if isinstance(added, Law) and (reason := outside(added, state, ratios)):
        yield Issue("warning", "laws.added_mass", reason + _and(_effect_of_added_mass(case, state)), REMEDY)
    if isinstance(agitation, Law) and (reason := outside(agitation, state)):
        remedy = "; ".join(["trust heights more than granular temperatures", *by_default(case)])
        yield Issue("note", "laws.agitation", reason + _and(AGITATED), remedy, case.laws.agitation == "auto")
    if isinstance(agitation, Law) and agitation.name in TIMES and (added != 0.0 or case.laws.history != "none"):
        remedy = 'leave these forces out, or set laws.agitation = "none"'
        yield Issue("warning", "laws.agitation", f"{agitation.name} was {NOT_FITTED_WITH}", remedy)
    if case.laws.lift and (reason := outside(law_of(saffman_mei), state)):
        yield Issue("warning", "laws.lift", reason + _and(_effect_of_lift(case, bed)), "set it to false")


def by_default(case: Case) -> list[str]:
    """That the case has a law of agitation without asking for it, in words; empty if it asks."""
    return [ON_BY_DEFAULT] if case.laws.agitation == "auto" else []


def state_of(case: Case, bed: BedEstimate) -> dict[str, float]:
    """Arguments of laws in the estimated bed, by name."""
    voidage = bed.voidage if bed.inlet > 0.0 or case.bed.start == "poured" else 1.0
    return {
        "reynolds": bed.reynolds,
        "voidage": voidage,
        "solid_fraction": 1.0 - voidage,
        "density_ratio": case.solid_density / case.required_fluid.density,
    }


def outside(law: Law, state: Mapping[str, float], diameter_ratios: Sequence[float] = ()) -> str:
    """The arguments of a law that lie outside of its range, in words; empty if there are none."""
    if ignores_voidage(law) and state["voidage"] < DILUTE:
        return f"{law.name} is for single spheres, but the bed has a voidage of {state['voidage']:.3g}"
    ranges, values = [], []
    for name, value in (*state.items(), *(("diameter_ratio", ratio) for ratio in diameter_ratios)):
        low, high = law.ranges.get(name, (-math.inf, math.inf))
        if value < low or value > high:  # a value that is not known, NaN, is neither
            ranges.append(f"{name} {low:g} to {high:g}")
            values.append(f"{value:.3g}")
    return f"{law.name} is for {' and '.join(ranges)}, but the bed has {' and '.join(values)}" if ranges else ""


def ignores_voidage(law: Law) -> bool:
    """Whether a law of drag is one for single spheres."""
    if law.kind != "drag" or not _is_plain(law):
        return False
    factor = drag_by_name(law)
    return factor(1.0, 0.42) == factor(1.0, 1.0)


def effect_of_drag(case: Case, law: Law, bed: BedEstimate) -> str:
    """How far drag, and the number that follows from it, lie from those by the laws that were fitted here.

    returns  words; empty if the law takes other arguments
    """
    state = state_of(case, bed)
    if not _is_plain(law) or not bed.archimedes > 0.0:
        return ""
    others = _fitted_here(law, state)
    if not others:
        return "no other law was fitted here, so that the error is not known"
    at = (state["reynolds"], state["voidage"])
    drag = _spread([drag_by_name(law)(*at) / other.function(*at) for other in others])
    count = (
        f"the median of the {len(others)} built-in laws"
        if len(others) > 1
        else f"that of {others[0].name}, the one law"
    )
    if case.stands_still:
        return f"its drag and the pressure drop differ by {drag} from {count} fitted here"
    text = f"its drag differs by {drag} from {count} fitted here"
    if (ignores_voidage(law) and state["voidage"] < DILUTE) or (bed.inlet > 0.0 and state["voidage"] >= 1.0):
        return text
    name, own = _result(case, bed, law, state)
    result = [own / value for other in others if (value := _result(case, bed, other, state)[1]) > 0.0]
    return f"{text}, and the {name} by {_spread(result)}" if own > 0.0 and result else text


def effect_of_bridge(angle: float, radius: float, volume: float, rupture: float) -> str:
    """How far the energy of a bridge by the law of Willett lies from that by other laws, in words.

    angle    of contact [rad]
    radius   reduced [m]
    volume   of the bridge [m3]
    rupture  gap at which it breaks [m]
    """
    at = (1.0, angle, radius, volume, rupture)
    own, others = willett_energy(*at), (lambert_energy(*at), rabinovich_energy(*at))
    if not all(number > 0.0 for number in (own, *others)):
        return ""
    lambert, rabinovich = (f"{100.0 * (own / other - 1.0):+.0f} %" for other in others)
    return f"; its energy differs by {lambert} from that by Lambert and by {rabinovich} from that by Rabinovich"


def _is_plain(law: Law) -> bool:
    """Whether a law takes Reynolds number and voidage only."""
    return len(signature(law.function).parameters) == 2


def _fitted_here(law: Law, state: Mapping[str, float]) -> list[Law]:
    """Other built-in laws of drag whose ranges hold the state."""
    load_built_in_laws()
    return [
        other
        for other in REGISTRY["drag"].values()
        if other is not law and is_built_in(other.function) and _is_plain(other) and not outside(other, state)
    ]


def _result(case: Case, bed: BedEstimate, law: Law, state: Mapping[str, float]) -> tuple[str, float]:
    """The number of interest that follows from a law of drag: its name and value; NaN if there is none."""
    if case.stands_still:
        return "pressure drop", law.function(bed.reynolds, state["voidage"])
    if bed.inlet > bed.onset and case.required_fluid.is_liquid:
        packed = 1.0 - POURED_SOLID_FRACTION
        voidage = balance.voidage_in_balance(bed.archimedes, bed.reynolds, drag_by_name(law), packed)
        return "bed height", 1.0 / max(1.0 - voidage, 1e-9)
    name = "velocity of minimum fluidisation" if state["voidage"] < DILUTE and bed.inlet > 0.0 else "settling velocity"
    return name, balance.reynolds_in_balance(bed.archimedes, state["voidage"], drag_by_name(law))


def _effect_of_added_mass(case: Case, state: Mapping[str, float]) -> str:
    """Share of the added mass in the inertia of a particle, in words."""
    carried = case.laws.added_mass_at(state["voidage"]) / state["density_ratio"]
    return f"the added mass is {100.0 * carried / (1.0 + carried):.2g} % of the inertia of a particle"


def _effect_of_lift(case: Case, bed: BedEstimate) -> str:
    """Lift over drag at a shear of the velocity over the width of the column, in words."""
    shear = bed.reynolds * case.bed.diameter / min(case.column.size[:2])
    share = 100.0 * saffman_mei(bed.reynolds, shear) / bed.drag_factor
    return f"at a shear of the inlet velocity over the width, lift is {share:.2g} % of the drag"


def _spread(ratios: list[float]) -> str:
    """The median of ratios as per cent below or above 1, and their range."""
    middle, low, high = (f"{100.0 * (ratio - 1.0):+.0f}" for ratio in (median(ratios), min(ratios), max(ratios)))
    return f"{middle} %" if low == high else f"{middle} % (single laws {low} to {high} %)"


def _and(text: str) -> str:
    return f"; {text}" if text else ""
