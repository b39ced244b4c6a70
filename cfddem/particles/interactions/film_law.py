"""What a film law consists of, and the integrator of films over a step.

A film law gives its resistance as a function of numbers, by name: gap, viscosity, reduced_radius, minimum_gap,
cutoff_gap. It may also give its potential, the integral of the resistance over the gap, from `gap` to `end_gap`.
Without one the engine integrates the resistance by Gauss' rule.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.backend.compile import inline
from cfddem.backend.law_set import bind_arguments, check_compiles, compile_source
from cfddem.particles.interactions.slots import (
    POTENTIAL,
    SHORT_POTENTIAL,
    FilmState,
    GapState,
    user_potential,
    user_resistance,
    user_short_potential,
)
from cfddem.particles.vectors import LEAST
from closures import lubrication

LARGEST_CHANGE = 0.1
"""Change of the gap in a step up to which the short solution is used, over the gap; with a short potential."""
LARGEST_SAMPLED_CHANGE = 0.05
"""The same without one: Gauss' rule of three points then integrates A/h to 1e-11."""

SLIDING_ARGUMENTS = ("gap", "viscosity", "reduced_radius", "minimum_gap", "asymmetry")
"""Arguments that a user's resistance to sliding may take, by name."""

_NODES, _WEIGHTS = (tuple(float(x) for x in numbers) for numbers in np.polynomial.legendre.leggauss(5))
_ASIDE = math.sqrt(0.6)


@dataclass(frozen=True)
class FilmLaw:
    """A film law.

    resistance       force per rate of the gap, at gaps from the minimum gap to the cut-off gap [kg/s]
    potential        its integral over the gap from `gap` to `end_gap`, both in that range [N s]
    short_potential  the same for gaps that differ by less than a tenth, without branches or logarithm, so that the
                     loop works on several pairs at once
    sliding          force over the slip of the surfaces, at gaps from the minimum gap on, also by `asymmetry`, the
                     difference of the radii over their sum, -1 at a wall [kg/s]. The resistance to rolling, and that
                     which couples both, follow by the ratios of two spheres (Jeffrey & Onishi 1984)
    """

    resistance: Callable[..., float]
    potential: Callable[..., float] | None = None
    short_potential: Callable[..., float] | None = None
    sliding: Callable[..., float] | None = None

    def check(self) -> None:
        """Refuse functions that cannot be compiled."""
        for function in (self.resistance, self.potential, self.short_potential, self.sliding):
            if function is not None:
                check_compiles("laws.lubrication", function)

    def choices(self) -> dict[str, Any]:
        """What goes into the slots of the loops."""
        sources = {name: f"film.{name}" for name in FilmState._fields}
        ends = {**sources, "gap": "gap", "end_gap": "end_gap"}
        potentials = {
            name: law for name in ("potential", "short_potential") if (law := getattr(self, name)) is not None
        }
        of_sliding = [*SLIDING_ARGUMENTS]
        sliding = {} if self.sliding is None else {"film_sliding": bind_arguments(
            self.sliding, ", ".join(["scale", *of_sliding]), dict(zip(of_sliding, of_sliding)), "scale * {}"
        )}  # fmt: skip
        return {
            **sliding,
            "user_resistance": bind_arguments(self.resistance, "film", sources),
            **{f"user_{name}": bind_arguments(law, "gap, end_gap, film", ends) for name, law in potentials.items()},
            "POTENTIAL": self.potential is not None,
            "SHORT_POTENTIAL": self.short_potential is not None,
            "film_resistance": resistance_at_least,
            "explicit_resistance": resistance_with_lever,
            "speed_after_short_film": speed_after_short_step,
            "speed_after_film": speed_after_step,
        }


def built_in() -> dict[str, Any]:
    """The film of Nijssen et al. (2023), whose closures solve the step themselves."""
    return {
        "film_resistance": _nijssen_resistance,
        "explicit_resistance": _nijssen_explicit_resistance,
        "speed_after_short_film": _nijssen_short_step,
        "speed_after_film": _nijssen_step,
    }


@inline
def _nijssen_resistance(film):
    return lubrication.film_strength(film.viscosity, film.reduced_radius) / film.gap


@inline
def _nijssen_explicit_resistance(film):
    strength = lubrication.film_strength(film.viscosity, film.reduced_radius)
    return lubrication.film_resistance(strength, film.gap, film.minimum_gap, film.cutoff_gap)


@inline
def _nijssen_short_step(speed, film, integrated_gap, step, strength_per_mass, inverse_mass):
    return lubrication.speed_after_short_step(
        speed, film.gap, integrated_gap, step, strength_per_mass, film.minimum_gap, film.cutoff_gap
    )


@inline
def _nijssen_step(speed, film, integrated_gap, step, strength_per_mass, inverse_mass):
    return lubrication.speed_after_film(
        speed, film.gap, integrated_gap, step, strength_per_mass, film.minimum_gap, film.cutoff_gap
    )


def range_check(kind: str, fields: tuple[str, ...], ranges: Mapping[str, tuple[float, float]]) -> Any:
    """A function of a state that returns 1 where an argument of a law lies outside of its range, else 0."""
    tests = [f"not ({low!r} <= {kind}.{name} <= {high!r})" for name, (low, high) in ranges.items() if name in fields]
    text = " or ".join(tests).replace("-inf", "-INF").replace("inf", "INF") or "False"
    return compile_source(f"def outside({kind}):\n    return 1 if {text} else 0\n", INF=math.inf)


def gap_choices(law: Callable[..., float]) -> dict[str, Any]:
    """What goes into the slots of the loops for a user's law of the minimum gap."""
    return {"user_minimum_gap": bind_arguments(law, "gap", {name: f"gap.{name}" for name in GapState._fields})}


# ---------------------------------------------------------------- integrator


@inline
def at_gap(film, gap):
    """The same film at another gap."""
    return FilmState(gap, film.viscosity, film.reduced_radius, film.minimum_gap, film.cutoff_gap)


@inline
def at_least(film):
    """The film at its gap or h_min, where its law is evaluated."""
    return at_gap(film, max(film.gap, film.minimum_gap))


@inline
def resistance_at_least(film):
    """Resistance of a film; above 0 within its reach, because 0 marks a film that is out of reach."""
    resistance = user_resistance(film)
    return LEAST if resistance < LEAST else resistance


@inline
def resistance_with_lever(film):
    """Resistance that an explicit force has; 0 for solids that overlap and out of reach."""
    if film.gap <= 0.0 or film.gap > film.cutoff_gap:
        return 0.0
    lever = min(film.gap / film.minimum_gap, 1.0)
    return resistance_at_least(at_least(film)) * lever


@inline
def _short_integral(gap, end, film, least):
    """Integral of the resistance between two near gaps on one side of h_min, without branches."""
    if SHORT_POTENTIAL:
        inside = user_short_potential(gap, end, film)
    else:
        middle, aside = 0.5 * (gap + end), 0.5 * _ASIDE * (end - gap)
        ends = user_resistance(at_gap(film, middle - aside)) + user_resistance(at_gap(film, middle + aside))
        inside = (end - gap) * (5.0 * ends + 8.0 * user_resistance(at_gap(film, middle))) * (1.0 / 18.0)
    a, b = max(gap, 0.0), max(end, 0.0)
    below = least * (b - a) * (b + a) * 0.5 / film.minimum_gap
    return inside if film.gap > film.minimum_gap else below


@inline
def next_guess(guess, excess, slope, low, high):
    """Next guess for the root of an increasing function, and the bounds that hold it.

    excess  value of the function at the guess
    slope   of the function there
    """
    if excess > 0.0:
        high = guess
    else:
        low = guess
    following = guess - excess / slope
    if not low < following < high:
        following = 0.5 * (low + high)
    return following, low, high


@inline
def speed_after_short_step(speed, film, integrated_gap, step, strength_per_mass, inverse_mass):
    """Rate of the gap after a step in which only the film acts, where the gap hardly changes; else NaN.

    Solves u1 + I(h, h + u1 dt) / m = u0 + I(h, ha) / m by two steps of Newton, I being the integral of the resistance.

    strength_per_mass  resistance times gap (or h_min) over m [m/s]
    inverse_mass       1/m of the mass that the pair gives this film [1/kg]
    """
    gap, minimum_gap = film.gap, film.minimum_gap
    inside = gap > minimum_gap
    resistance = user_resistance(at_gap(film, max(gap, minimum_gap)))
    weight = step * inverse_mass
    lever = 1.0 / minimum_gap
    total = speed + inverse_mass * _short_integral(gap, integrated_gap, film, resistance)
    guess = total / (1.0 + weight * resistance * (1.0 if inside else lever * max(gap, 0.0)))
    last = guess
    for _ in range(2):
        end = gap + step * guess
        excess = guess + inverse_mass * _short_integral(gap, end, film, resistance) - total
        slope = user_resistance(at_gap(film, max(end, minimum_gap))) if inside else resistance * lever * max(end, 0.0)
        last = excess / (1.0 + weight * slope)
        guess -= last
    end = gap + step * guess
    low, high = min(gap, end, integrated_gap), max(gap, end, integrated_gap)
    change = LARGEST_CHANGE if SHORT_POTENTIAL else LARGEST_SAMPLED_CHANGE
    shortly = (low > minimum_gap and high < film.cutoff_gap and high - low <= change * low) if inside else (
        high <= minimum_gap
    )  # fmt: skip
    # the last correction bounds what the next one would be
    curvature = inverse_mass * resistance * (1.0 / low if inside else lever)
    converged = curvature * (step * last) ** 2 <= 1e-14 * (abs(total) + abs(guess))
    return guess if shortly and converged else math.nan


@inline
def _integral(gap, end, film):
    """Integral of the resistance over the gap, from one to another, lever included [N s].

    Below h_min the resistance is linear in the gap. Without a potential Gauss' rule of five points takes ln h, a factor
    e at a time.
    """
    minimum_gap, cutoff = film.minimum_gap, film.cutoff_gap
    total, a, b = 0.0, min(max(gap, 0.0), minimum_gap), min(max(end, 0.0), minimum_gap)
    if a != b:
        total = 0.5 * user_resistance(at_gap(film, minimum_gap)) * (b - a) * (b + a) / minimum_gap
    a, b = min(max(gap, minimum_gap), cutoff), min(max(end, minimum_gap), cutoff)
    if a == b:
        return total
    if POTENTIAL:
        return total + user_potential(a, b, film)
    if abs(b - a) < LARGEST_SAMPLED_CHANGE * a:
        return total + _short_integral(a, b, at_gap(film, max(a, 2.0 * minimum_gap)), 0.0)
    a = math.log(a)
    way = math.log(b) - a
    pieces = int(abs(way)) + 1
    half = 0.5 * way / pieces
    for piece in range(pieces):
        middle = a + (2 * piece + 1) * half
        for k in range(len(_NODES)):
            at = math.exp(middle + half * _NODES[k])
            total += half * _WEIGHTS[k] * at * user_resistance(at_gap(film, at))
    return total


@inline
def speed_after_step(speed, film, integrated_gap, step, strength_per_mass, inverse_mass):
    """The same rate for any change of the gap: Newton's method, kept between 0 and the speed without resistance."""
    gap = film.gap
    total = speed + inverse_mass * _integral(gap, integrated_gap, film)
    low, high = min(total, 0.0), max(total, 0.0)
    guess = total / (1.0 + step * inverse_mass * resistance_with_lever(film))
    if abs(step * guess) < 1e-7 * gap:
        return guess  # the resistance has not changed by more than rounding
    for _ in range(100):
        excess = guess + inverse_mass * _integral(gap, gap + step * guess, film) - total
        if abs(excess) <= 1e-14 * (abs(total) + abs(guess)):
            return guess
        slope = resistance_with_lever(at_gap(film, gap + step * guess))
        following, low, high = next_guess(guess, excess, 1.0 + step * inverse_mass * slope, low, high)
        if following == guess:
            return guess
        guess = following
    return guess
