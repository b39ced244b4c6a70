"""Checks of a law: finite values, limits, monotonicity and continuity expected of its kind."""

from __future__ import annotations

import inspect
import itertools
import math
import re
from collections.abc import Callable, Iterator
from numbers import Real

from closures.drag import ergun
from closures.kinds import ARGUMENTS, arguments_of
from closures.lubrication import film_strength
from closures.registry import Law, is_built_in, law_of

Curve = Callable[[float], float]

PLAUSIBLE: dict[str, tuple[float, float]] = {
    "reynolds": (1e-3, 1e3),
    "voidage": (0.4, 1.0),
    "solid_fraction": (0.01, 0.6),
    "diameter_ratio": (0.5, 2.0),
    "density_ratio": (1.0, 1e4),
    "along": (0.0, 1.0),
    "restitution": (0.1, 1.0),
    "wall_ratio": (1e-3, 0.1),
    "viscosity": (1e-5, 1.0),
    "approach_speed": (1e-4, 1.0),
    "roughness": (1e-8, 1e-6),
    "reduced_modulus": (1e6, 1e11),
    "reduced_radius": (1e-5, 1e-2),
    "stokes": (1.0, 1e3),
    "archimedes": (1e-2, 1e8),
    "gap": (1e-9, 1e-4),
    "minimum_gap": (1e-8, 1e-6),
    "cutoff_gap": (1e-5, 1e-2),
    "poisson": (0.1, 0.45),
}
"""Range in which an argument is sampled if the law states none; SI units. Other arguments: 0.001 to 1."""

JUMP = 0.005
"""Relative change at one point above which a law is reported as discontinuous."""


def check(law: Callable[..., float]) -> list[str]:
    """Check a law against the requirements of its kind.

    law      a function decorated with @closures.law(...)
    returns  one message per violated requirement, with the place; empty if all hold

    every        arguments of its kind; finite in the stated range; the same value compiled and interpreted
    drag         finite at rest; Stokes drag within 5 % for an isolated sphere; increasing with solid fraction; force
                 increasing with velocity; no jump above 0.5 %; 0.3 to 2 times Ergun in a creeping dense bed
    minimum_gap  positive; not decreasing with viscosity, speed or roughness
    lubrication  not negative; not increasing with the gap; not decreasing with viscosity or radius; 1/3 to 3 times
                 Brenner's law near contact
    agitation    not negative
    added_mass   1/2 for an isolated sphere; not decreasing with solid fraction
    restitution  between 0 and 1; not decreasing with the Stokes number
    lift         shear lift is zero without shear

    >>> from closures.drag import di_felice, gidaspow
    >>> check(di_felice)
    []
    >>> print(*check(gidaspow))
    jumps by -73 % at voidage = 0.8 (reynolds = 1e+03)
    """
    entry = law_of(law)
    problems = list(_declared(entry)) or list(_finite(entry))
    if not problems:
        problems = [*_same_compiled(entry), *REQUIREMENTS.get(entry.kind, _none)(entry)]
    return problems


def _arguments(entry: Law) -> list[str]:
    return list(inspect.signature(entry.function).parameters)


def samples(entry: Law, name: str, count: int) -> list[float]:
    """Values of an argument over its range; logarithmic spacing if the range spans more than two decades."""
    usual_low, usual_high = PLAUSIBLE.get(name.removesuffix("_i").removesuffix("_j"), (1e-3, 1.0))
    low, high = entry.ranges.get(name, (usual_low, usual_high))
    low = low if low > 0.0 else min(usual_low, 0.01 * high)
    high = high if math.isfinite(high) else max(usual_high, 100.0 * low)
    shares = [k / (count - 1) for k in range(count)]
    if high > 100.0 * low:
        return [low ** (1.0 - share) * high**share for share in shares]
    return [low + share * (high - low) for share in shares]


def _shown(stated: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:.3g}" for name, value in stated.items())


def _declared(entry: Law) -> Iterator[str]:
    """Arguments of a user's law that nothing can give, or that are missing; helpers of built-in laws take others."""
    if entry.kind in ARGUMENTS and not is_built_in(entry.function):
        (may, must), names = ARGUMENTS[entry.kind], _arguments(entry)
        odd, missing = [name for name in names if name not in may], [name for name in must if name not in names]
        if odd or missing:
            difference = f"takes {', '.join(odd)}" if odd else f"does not take {', '.join(missing)}"
            yield f"{difference}: not a law of kind {entry.kind}, {arguments_of(entry.kind)}"


def _finite(entry: Law) -> Iterator[str]:
    names = _arguments(entry)
    for values in itertools.product(*(samples(entry, name, 4) for name in names)):
        stated = dict(zip(names, values))
        try:
            value = entry.function(**stated)
        except Exception as failure:  # whatever a user's function raises
            yield f"fails ({failure}) at {_shown(stated)}"
            return
        if not isinstance(value, Real):
            yield f"returns {value!r}, which is not a number, at {_shown(stated)}"
            return
        if not math.isfinite(value):
            yield f"is {value} at {_shown(stated)}"
            return


def _same_compiled(entry: Law) -> Iterator[str]:
    import closures.compiled  # noqa: F401  sets the cache folder before numba is imported

    from numba import njit  # isort: skip

    names = _arguments(entry)
    compiled = njit(error_model="numpy")(entry.function)
    for values in zip(*(samples(entry, name, 5) for name in names)):
        try:
            value = compiled(*values)
        except Exception as failure:  # numba raises many types of error, not only its own
            yield f"cannot be compiled: {first_cause(failure)}"
            return
        plain = entry.function(*values)
        if not math.isclose(value, plain, rel_tol=1e-12):
            yield f"is {plain:.6g}, but {value:.6g} when compiled, at {_shown(dict(zip(names, values)))}"
            return


def first_cause(refusal: Exception) -> str:
    """The first cause that the compiler gives, in one line, and the remedy.

    >>> first_cause(TypeError("Failed in nopython mode pipeline (step: x)\\nUnknown attribute 'x' of y:\\n\\n z"))
    "Unknown attribute 'x' of y; use numbers, math and if"
    """
    lines = [line.strip() for line in re.sub(r"\x1b\[\d*m", "", str(refusal)).splitlines()]
    told = [line for line in lines if line and not line.startswith(("Failed in", "During", ">>>"))]
    cause = told[0].rstrip(":. ") if told else type(refusal).__name__
    return f"{cause}; use numbers, math and if"


def _first_decrease(values: list[float], curve: Curve) -> float | None:
    """The first value at which a curve decreases, or None."""
    heights = [curve(value) for value in values]
    for value, before, after in zip(values[1:], heights, heights[1:]):
        if after < before - 1e-9 * abs(before):
            return value
    return None


def _largest_jump(values: list[float], curve: Curve) -> tuple[float, float]:
    """Position and relative size of the largest jump; bisection separates jumps from steep slopes."""
    place, largest = values[0], 0.0
    for left, right in itertools.pairwise(values):
        for _ in range(50):
            if abs(curve(right) / curve(left) - 1.0) <= max(JUMP, abs(largest)):
                break
            middle = 0.5 * (left + right)
            in_left_half = abs(curve(middle) / curve(left) - 1.0) > abs(curve(right) / curve(middle) - 1.0)
            left, right = (left, middle) if in_left_half else (middle, right)
        else:
            place, largest = left, curve(right) / curve(left) - 1.0
    return place, largest


def _drag(entry: Law) -> Iterator[str]:
    sizes = dict.fromkeys(set(_arguments(entry)) - {"reynolds", "voidage"}, 1.0)
    numbers, voidages = samples(entry, "reynolds", 401), samples(entry, "voidage", 401)

    def factor(reynolds: float, voidage: float) -> float:
        return entry.function(reynolds=reynolds, voidage=voidage, **sizes)

    try:
        isolated = factor(0.0, voidages[-1])
    except (ArithmeticError, ValueError) as failure:
        yield f"fails ({failure}) at reynolds = 0; the slip velocity of a particle can be zero"
        return
    lowest = min(factor(reynolds, voidage) for reynolds in numbers[::20] for voidage in voidages[::20])
    if lowest <= 0.0:
        yield f"is {lowest:.3g} in its range; drag must be positive"
        return
    if voidages[-1] == 1.0 and not sizes and abs(isolated - 1.0) > 0.05:
        yield f"tends to {isolated:.3g} for a slow isolated sphere; Stokes drag is 1"

    yield from _creeping_bed(voidages, lambda voidage: factor(numbers[0], voidage))

    def at_voidage(voidage: float) -> Curve:
        return lambda reynolds: factor(reynolds, voidage)

    def at_reynolds(reynolds: float) -> Curve:
        return lambda voidage: factor(reynolds, voidage)

    def force(voidage: float) -> Curve:
        return lambda reynolds: reynolds * factor(reynolds, voidage)

    def at_solid_fraction(reynolds: float) -> Curve:
        return lambda solids: factor(reynolds, 1.0 - solids)

    solids = [1.0 - voidage for voidage in reversed(voidages)]
    some_voidages, some_numbers = voidages[::80], numbers[::80]
    yield from _not_monotone("force decreases with", "reynolds", numbers, "voidage", some_voidages, force)
    yield from _not_monotone("decreases with", "solid_fraction", solids, "reynolds", some_numbers, at_solid_fraction)
    yield from _worst_jump("reynolds", numbers, "voidage", some_voidages, at_voidage)
    yield from _worst_jump("voidage", voidages, "reynolds", some_numbers, at_reynolds)


def _creeping_bed(voidages: list[float], factor: Curve) -> Iterator[str]:
    """Compare a dense bed with Ergun's law; a law of the total force gives about 2.5 times as much."""
    dense = max(voidages[0], 0.45)
    if dense > 0.6 or factor(dense) == factor(voidages[-1]):
        return
    share = factor(dense) / ergun(0.0, dense)
    if not 0.3 < share < 2.0:
        yield (
            f"is {share:.2g} times Ergun's law in creeping flow at voidage {dense:.2g}; F = F_d / (3 pi eta d U): "
            "F_d excludes the pressure gradient (voidage times the total force) and U is the superficial slip"
        )


def _not_monotone(
    complaint: str, name: str, values: list[float], other: str, others: list[float], curve_at: Callable[[float], Curve]
) -> Iterator[str]:
    for fixed in others:
        place = _first_decrease(values, curve_at(fixed))
        if place is not None:
            yield f"{complaint} {name} at {name} = {place:.3g} ({other} = {fixed:.3g})"
            return


def _worst_jump(
    name: str, values: list[float], other: str, others: list[float], curve_at: Callable[[float], Curve]
) -> Iterator[str]:
    jumps = [(*_largest_jump(values, curve_at(fixed)), fixed) for fixed in others]
    place, size, fixed = max(jumps, key=lambda jump: abs(jump[1]))
    if size:
        yield f"jumps by {100.0 * size:.2g} % at {name} = {place:.3g} ({other} = {fixed:.3g})"


def _bounded_and_rising(
    limits: tuple[float, float], rising: tuple[str, ...], takes: frozenset[str] = frozenset()
) -> Callable[[Law], Iterator[str]]:
    """Check the limits of the value and the arguments with which it must not decrease; skip laws without `takes`."""

    def rules(entry: Law) -> Iterator[str]:
        names = _arguments(entry)
        if not takes <= set(names):
            return
        middle = {name: samples(entry, name, 3)[1] for name in names}
        for name in names:
            values = samples(entry, name, 101)

            def curve(value: float, name: str = name) -> float:
                return entry.function(**{**middle, name: value})

            for value in values:
                if not limits[0] <= curve(value) <= limits[1]:
                    yield f"is {curve(value):.3g}, outside {limits[0]:.3g} to {limits[1]:.3g}, at {name} = {value:.3g}"
                    break
            place = _first_decrease(values, curve) if name.startswith(rising) else None
            if place is not None:
                yield f"decreases with {name} at {name} = {place:.3g}"

    return rules


def _film(entry: Law) -> Iterator[str]:
    """Check a film resistance; laws of this kind without these arguments are skipped."""
    names = _arguments(entry)
    if not {"gap", "viscosity", "reduced_radius"} <= set(names):
        return
    middle = {name: samples(entry, name, 3)[1] for name in names}

    def curve_of(name: str) -> Curve:
        return lambda value: entry.function(**{**middle, name: value})

    gaps = samples(entry, "gap", 101)
    falling = _first_decrease(gaps, lambda gap: -curve_of("gap")(gap))
    if falling is not None:
        yield f"increases with gap at gap = {falling:.3g}"
    yield from _bounded_and_rising((0.0, math.inf), ("viscosity", "reduced_radius"))(entry)
    near = {**middle, "gap": gaps[0]}
    share = entry.function(**near) * near["gap"] / film_strength(near["viscosity"], near["reduced_radius"])
    if not 1.0 / 3.0 <= share <= 3.0:
        yield (
            f"is {share:.2g} times Brenner's law, 6 pi eta R*^2/h, at gap = {gaps[0]:.3g}; the law must return force "
            "over rate of the gap, with R* = R_i R_j/(R_i + R_j)"
        )


def _added_mass(entry: Law) -> Iterator[str]:
    isolated = entry.function(1.0)
    if not math.isclose(isolated, 0.5):
        yield f"is {isolated:.3g} for an isolated sphere; it must be 1/2"
    place = _first_decrease([0.01 * k for k in range(60)], lambda solids: entry.function(1.0 - solids))
    if place is not None:
        yield f"decreases with solid fraction at voidage = {1.0 - place:.3g}"


def _lift(entry: Law) -> Iterator[str]:
    names = _arguments(entry)
    if "shear_reynolds" not in names:
        return
    rest = {name: samples(entry, name, 3)[1] for name in names} | {"shear_reynolds": 0.0}
    if entry.function(**rest) != 0.0:
        yield f"is {entry.function(**rest):.3g} without shear; it must be 0"


def _none(_: Law) -> Iterator[str]:
    return iter(())


REQUIREMENTS: dict[str, Callable[[Law], Iterator[str]]] = {
    "drag": _drag,
    "minimum_gap": _bounded_and_rising((5e-324, math.inf), ("viscosity", "approach_speed", "roughness")),
    "lubrication": _film,
    "restitution": _bounded_and_rising((0.0, 1.0), ("stokes",), takes=frozenset({"stokes", "restitution"})),
    "agitation": _bounded_and_rising((0.0, math.inf), ()),
    "added_mass": _added_mass,
    "lift": _lift,
}
"""Requirements of each kind beyond finite values."""
