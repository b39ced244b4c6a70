"""Published laws of the expansion of liquid beds: the voidage by each, and whether it holds for a bed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from cfddem.case.bed import POURED_SOLID_FRACTION
from cfddem.case.schema import Case
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.issue import Issue
from closures import bed as laws_of_beds
from closures import numbers
from closures.balance import voidage_of_slip
from closures.registry import law_of

Law = Callable[..., float]

FREE_SIDES = ("free_slip", "periodic")
"""Sides that do not retard the flow: no wall correction applies."""

SCATTERED, SCATTER = 500.0, (0.03, 0.04)
"""Re_t above which published beds scatter, and by how much in voidage [-].

Laws whose curve passes through the terminal velocity lie 0.03 to 0.05 below those fitted to beds alone. Published
curves contain the waves and voids that beds of heavy particles have.
"""


@dataclass(frozen=True)
class Expansion:
    """The voidage of a bed by one published law, and what lies outside of the range of that law, in words."""

    law: str
    voidage: float
    outside: str


@dataclass(frozen=True)
class Expansions:
    """The voidages of a bed by all published laws."""

    reynolds: float  # Re_t, at the terminal velocity [-]
    every: tuple[Expansion, ...]

    @property
    def held(self) -> tuple[Expansion, ...]:
        """Laws that hold at the bed's Re_t and d/D; all laws if none does."""
        return tuple(expansion for expansion in self.every if not expansion.outside) or self.every

    @property
    def scattered(self) -> bool:
        """Whether published beds scatter at this Re_t."""
        return self.reynolds > SCATTERED


def is_compared(case: Case) -> bool:
    """Whether published laws of expansion apply: one species in a liquid that enters steadily through the floor."""
    inlet = case.bed.inlet_velocity
    return bool(
        case.in_liquid
        and case.required_fluid.viscosity > 0.0
        and case.column.ends == "flow"
        and isinstance(inlet, float)
        and inlet > 0.0
        and not (case.stands_still or case.bed.jets or case.bed.species)
        and not (case.wall or case.feed or case.outlet or case.drains)
        and abs(case.laws.gravity[2]) > 0.0
    )


@dataclass(frozen=True)
class _Column:
    """What the laws ask of a bed and its column."""

    archimedes: float  # Ar [-]; 0 or below for particles that float
    reynolds: float  # Re_t [-]
    terminal: float  # u_t [m/s]
    wall: float  # d/D; 0 without walls that retard the flow [-]

    @property
    def beside_walls(self) -> float:
        """The terminal velocity with the wall factor of Richardson and Zaki [m/s]."""
        return laws_of_beds.wall_factor_richardson_zaki(self.wall) * self.terminal


def _column_of(case: Case) -> _Column:
    density, viscosity, diameter = case.required_fluid.density, case.required_fluid.viscosity, case.bed.diameter
    archimedes = numbers.archimedes(diameter, case.solid_density, density, viscosity, abs(case.laws.gravity[2]))
    wall = 0.0 if case.column.sides in FREE_SIDES else diameter / min(case.column.size[:2])
    reynolds = laws_of_beds.terminal_reynolds_brown_lawler(archimedes) if archimedes > 0.0 else 0.0
    return _Column(archimedes, reynolds, reynolds * viscosity / (density * diameter), wall)


def expansion_exponents(case: Case) -> dict[str, tuple[float, float]]:
    """Exponent n [-] and velocity at voidage 1 [m/s] of each power law with one exponent, with wall corrections."""
    bed = _column_of(case)
    if bed.archimedes <= 0.0:
        return {}
    retarded = laws_of_beds.wall_factor_khan_richardson(bed.wall) * bed.terminal
    return {
        "Richardson-Zaki": (laws_of_beds.exponent_richardson_zaki(bed.reynolds, bed.wall), bed.beside_walls),
        "Garside": (laws_of_beds.exponent_garside(bed.reynolds), bed.beside_walls),
        "Khan-Richardson": (laws_of_beds.exponent_khan_richardson(bed.archimedes, bed.wall), retarded),
    }


def expansions(case: Case) -> Expansions:
    """The voidage of a bed by each published law, with corrections for walls; none for particles that float."""
    bed, velocity = _column_of(case), case.bed.inlet_velocity
    assert isinstance(velocity, float)
    if bed.archimedes <= 0.0:
        return Expansions(0.0, ())
    power, walls = laws_of_beds.expanded_voidage, laws_of_beds.wall_factor_richardson_zaki
    slip, ratio = laws_of_beds.slip_ratio_garside, laws_of_beds.velocity_ratio_two_parameters
    between = laws_of_beds.expanded_voidage_hirata_bulos
    limit, exponent = ratio(bed.reynolds) * bed.beside_walls, laws_of_beds.exponent_two_parameters(bed.reynolds)
    packed = 1.0 - POURED_SOLID_FRACTION
    voidage = {name: power(velocity, end, exponent) for name, (exponent, end) in expansion_exponents(case).items()} | {
        "Garside's slip form": voidage_of_slip(velocity / bed.beside_walls, partial(slip, reynolds=bed.reynolds)),
        "two-parameter Richardson-Zaki": power(velocity, limit, exponent),
        "Hirata-Bulos": between(velocity, bed.terminal, bed.reynolds, bed.wall, packed),
    }
    ranges: dict[str, tuple[Law, ...]] = {
        "Richardson-Zaki": (walls,),
        "Garside": (laws_of_beds.exponent_garside, walls),
        "Khan-Richardson": (laws_of_beds.wall_factor_khan_richardson,) if bed.wall > 0.0 else (),
        "Garside's slip form": (slip, walls),
        "two-parameter Richardson-Zaki": (ratio, walls),
        "Hirata-Bulos": (between,),
    }
    return Expansions(
        bed.reynolds, tuple(Expansion(name, value, _outside(ranges[name], bed)) for name, value in voidage.items())
    )


def _outside(functions: tuple[Law, ...], bed: _Column) -> str:
    """What of a bed lies outside of the ranges of functions, in words; empty if nothing does."""
    reasons = []
    for function in functions:
        for name, (low, high) in law_of(function).ranges.items():
            value, shown = (bed.reynolds, "Re_t") if name == "reynolds" else (bed.wall, "d/D")
            if not low <= value <= high:
                reasons.append(f"{shown} {value:.3g} is outside of {low:g} to {high:g}")
    return "; ".join(reasons)


def spread_in_words(estimates: Expansions) -> str:
    """The scatter of published beds at this Re_t, in words; empty where they do not scatter."""
    if not estimates.scattered:
        return ""
    low, high = SCATTER
    beds = f"published beds scatter by {low:g} to {high:g} in voidage at Re_t above {SCATTERED:g}"
    return f"{beds}, here {estimates.reynolds:.0f}"


def check_expansion(case: Case, bed: BedEstimate) -> Iterator[Issue]:
    """Note that no published law is exact for a bed of coarse or heavy particles in a liquid."""
    if not (is_compared(case) and bed.inlet > bed.onset):
        return
    estimates = expansions(case)
    if estimates.scattered:
        voidages = [expansion.voidage for expansion in estimates.held]
        reason = (
            f"{spread_in_words(estimates)}; their laws give {min(voidages):.3f} to {max(voidages):.3f} for this bed"
        )
        yield Issue("note", "bed.inlet_velocity", reason, "compare the bed height with the whole range", False)
