"""What must be true of a law of its kind: limits, signs and continuity, for the laws here and for a user's own."""

from __future__ import annotations

import inspect
import itertools
import math
from collections.abc import Callable, Iterator

from closures.drag import ergun
from closures.law import Law, page
from closures.lubrication import film_strength

Curve = Callable[[float], float]

PLAUSIBLE: dict[str, tuple[float, float]] = {
    "reynolds": (1e-3, 1e3),
    "voidage": (0.4, 1.0),
    "solid_fraction": (0.01, 0.6),
    "diameter_ratio": (0.5, 2.0),
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
"""Where an argument is tried if its law states no range; SI units. Others between 0.001 and 1."""

JUMP = 0.005
"""A law that changes by more than this at one point has a jump there."""


def check(law: Callable[..., float]) -> list[str]:
    """Complaints about a law: what its kind must fulfil and it does not; empty where all is well.

    law      a function decorated with @closures.law(...)
    returns  sentences that say what was found, and where

    Every law must give finite numbers in its range, and the same ones when compiled. Drag must be finite at rest, tend
    to Stokes drag within 5 %, rise with velocity and crowding, not jump by more than 0.5 %, and be between 0.3 and 2
    times Ergun's in a creeping dense bed. A minimum gap must be positive and not fall with viscosity, speed or
    roughness. The resistance of a film must not be negative, rise with the gap, or fall with viscosity or radius, and
    be between a third of Brenner's and three times as much where spheres nearly touch. Added mass must start at 1/2
    and not fall with crowding. Restitution must stay between 0 and 1 and not fall with the Stokes number. Shear lift
    must vanish with the shear.

    >>> from closures.drag import di_felice, gidaspow
    >>> check(di_felice)
    []
    >>> print(*check(gidaspow))
    jumps by -73 % at voidage = 0.8 (reynolds = 1e+03)
    """
    card = page(law)
    complaints = list(_finite(card))
    if not complaints:
        complaints = [*_compiled_alike(card), *KINDS.get(card.kind, _nothing_more)(card)]
    return complaints


def _arguments(card: Law) -> list[str]:
    return list(inspect.signature(card.function).parameters)


def samples(card: Law, name: str, count: int) -> list[float]:
    """Values of an argument over its range, evenly spaced in decades where the range spans more than two."""
    usual_low, usual_high = PLAUSIBLE.get(name.removesuffix("_i").removesuffix("_j"), (1e-3, 1.0))
    low, high = card.ranges.get(name, (usual_low, usual_high))
    low = low if low > 0.0 else min(usual_low, 0.01 * high)
    high = high if math.isfinite(high) else max(usual_high, 100.0 * low)
    shares = [k / (count - 1) for k in range(count)]
    if high > 100.0 * low:
        return [low ** (1.0 - share) * high**share for share in shares]
    return [low + share * (high - low) for share in shares]


def _shown(stated: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:.3g}" for name, value in stated.items())


def _finite(card: Law) -> Iterator[str]:
    names = _arguments(card)
    for values in itertools.product(*(samples(card, name, 4) for name in names)):
        stated = dict(zip(names, values))
        try:
            value = card.function(**stated)
        except (ArithmeticError, ValueError) as failure:
            yield f"fails ({failure}) at {_shown(stated)}"
            return
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            yield f"is {value} at {_shown(stated)}"
            return


def _compiled_alike(card: Law) -> Iterator[str]:
    import closures.compiled  # noqa: F401  says where compiled code is kept, before the compiler is loaded

    from numba import njit  # isort: skip

    names = _arguments(card)
    compiled = njit(error_model="numpy")(card.function)
    for values in zip(*(samples(card, name, 5) for name in names)):
        try:
            value = compiled(*values)
        except Exception as refusal:  # whatever stops the compiler, errors of its own or others, is the complaint
            yield f"cannot be compiled: {' '.join(str(refusal).split())[:200]}"
            return
        plain = card.function(*values)
        if not math.isclose(value, plain, rel_tol=1e-12):
            yield f"is {plain:.6g}, but {value:.6g} when compiled, at {_shown(dict(zip(names, values)))}"
            return


def _falls(values: list[float], curve: Curve) -> float | None:
    """The value at which a curve that must not fall does."""
    heights = [curve(value) for value in values]
    for value, before, after in zip(values[1:], heights, heights[1:]):
        if after < before - 1e-9 * abs(before):
            return value
    return None


def _largest_jump(values: list[float], curve: Curve) -> tuple[float, float]:
    """Where a curve jumps most, and by what share; a steep piece is halved until it is a jump or none."""
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


def _drag(card: Law) -> Iterator[str]:
    if not {"reynolds", "voidage"} <= set(_arguments(card)):
        yield "is not a drag law: it must take reynolds and voidage"
        return
    sizes = dict.fromkeys(set(_arguments(card)) - {"reynolds", "voidage"}, 1.0)
    numbers, voidages = samples(card, "reynolds", 401), samples(card, "voidage", 401)

    def factor(reynolds: float, voidage: float) -> float:
        return card.function(reynolds=reynolds, voidage=voidage, **sizes)

    try:
        alone = factor(0.0, voidages[-1])
    except (ArithmeticError, ValueError) as failure:
        yield f"fails ({failure}) at reynolds = 0: a particle may rest in its fluid"
        return
    lowest = min(factor(reynolds, voidage) for reynolds in numbers[::20] for voidage in voidages[::20])
    if lowest <= 0.0:
        yield f"is {lowest:.3g} somewhere in its range: drag must be positive"
        return
    if voidages[-1] == 1.0 and not sizes and abs(alone - 1.0) > 0.05:
        yield f"tends to {alone:.3g} and not to 1, Stokes drag, for a slow sphere alone"

    yield from _creeping_bed(voidages, lambda voidage: factor(numbers[0], voidage))

    def at_voidage(voidage: float) -> Curve:
        return lambda reynolds: factor(reynolds, voidage)

    def at_reynolds(reynolds: float) -> Curve:
        return lambda voidage: factor(reynolds, voidage)

    def force(voidage: float) -> Curve:
        return lambda reynolds: reynolds * factor(reynolds, voidage)

    def crowded(reynolds: float) -> Curve:
        return lambda solids: factor(reynolds, 1.0 - solids)

    solids = [1.0 - voidage for voidage in reversed(voidages)]
    some_voidages, some_numbers = voidages[::80], numbers[::80]
    yield from _first_fall("force falls with", "reynolds", numbers, "voidage", some_voidages, force)
    yield from _first_fall("falls with", "solid_fraction", solids, "reynolds", some_numbers, crowded)
    yield from _worst_jump("reynolds", numbers, "voidage", some_voidages, at_voidage)
    yield from _worst_jump("voidage", voidages, "reynolds", some_numbers, at_reynolds)


def _creeping_bed(voidages: list[float], factor: Curve) -> Iterator[str]:
    """A dense bed is near Ergun; two and a half times as much is the mark of a law of the total force."""
    dense = max(voidages[0], 0.45)
    if dense > 0.6 or factor(dense) == factor(voidages[-1]):
        return
    share = factor(dense) / ergun(0.0, dense)
    if not 0.3 < share < 2.0:
        yield (
            f"is {share:.2g} times Ergun's in a creeping bed of voidage {dense:.2g}: F is of the force without the "
            "pressure gradient, voidage times the total, over 3 pi eta d U with the superficial slip U"
        )


def _first_fall(
    what: str, name: str, values: list[float], other: str, others: list[float], curve_at: Callable[[float], Curve]
) -> Iterator[str]:
    for fixed in others:
        place = _falls(values, curve_at(fixed))
        if place is not None:
            yield f"{what} {name} at {name} = {place:.3g} ({other} = {fixed:.3g})"
            return


def _worst_jump(
    name: str, values: list[float], other: str, others: list[float], curve_at: Callable[[float], Curve]
) -> Iterator[str]:
    jumps = [(*_largest_jump(values, curve_at(fixed)), fixed) for fixed in others]
    place, size, fixed = max(jumps, key=lambda jump: abs(jump[1]))
    if size:
        yield f"jumps by {100.0 * size:.2g} % at {name} = {place:.3g} ({other} = {fixed:.3g})"


def _other_kind(
    limits: tuple[float, float], rising: tuple[str, ...], takes: frozenset[str] = frozenset()
) -> Callable[[Law], Iterator[str]]:
    """Rules of a kind: limits of the value, and arguments with which it must not fall; for laws that take these."""

    def rules(card: Law) -> Iterator[str]:
        names = _arguments(card)
        if not takes <= set(names):
            return
        middle = {name: samples(card, name, 3)[1] for name in names}
        for name in names:
            values = samples(card, name, 101)

            def curve(value: float, name: str = name) -> float:
                return card.function(**{**middle, name: value})

            for value in values:
                if not limits[0] <= curve(value) <= limits[1]:
                    yield f"is {curve(value):.3g}, outside {limits[0]:.3g} to {limits[1]:.3g}, at {name} = {value:.3g}"
                    break
            place = _falls(values, curve) if name.startswith(rising) else None
            if place is not None:
                yield f"falls with {name} at {name} = {place:.3g}"

    return rules


def _film(card: Law) -> Iterator[str]:
    """Rules of a film's resistance; other laws of its kind, parts of one, have none."""
    names = _arguments(card)
    if not {"gap", "viscosity", "reduced_radius"} <= set(names):
        return
    middle = {name: samples(card, name, 3)[1] for name in names}

    def curve_of(name: str) -> Curve:
        return lambda value: card.function(**{**middle, name: value})

    gaps = samples(card, "gap", 101)
    falling = _falls(gaps, lambda gap: -curve_of("gap")(gap))
    if falling is not None:
        yield f"rises with gap at gap = {falling:.3g}"
    yield from _other_kind((0.0, math.inf), ("viscosity", "reduced_radius"))(card)
    near = {**middle, "gap": gaps[0]}
    share = card.function(**near) * near["gap"] / film_strength(near["viscosity"], near["reduced_radius"])
    if not 1.0 / 3.0 <= share <= 3.0:
        yield (
            f"is {share:.2g} times Brenner's, 6 pi eta R*^2/h, at gap = {gaps[0]:.3g}: it is a force per rate of the "
            "gap, and R* = R_i R_j/(R_i + R_j)"
        )


def _added_mass(card: Law) -> Iterator[str]:
    alone = card.function(1.0)
    if not math.isclose(alone, 0.5):
        yield f"is {alone:.3g} and not 1/2 for a sphere alone"
    place = _falls([0.01 * k for k in range(60)], lambda solids: card.function(1.0 - solids))
    if place is not None:
        yield f"falls with crowding at voidage = {1.0 - place:.3g}"


def _lift(card: Law) -> Iterator[str]:
    names = _arguments(card)
    if "shear_reynolds" not in names:
        return
    rest = {name: samples(card, name, 3)[1] for name in names} | {"shear_reynolds": 0.0}
    if card.function(**rest) != 0.0:
        yield f"is {card.function(**rest):.3g} without shear"


def _nothing_more(_: Law) -> Iterator[str]:
    return iter(())


KINDS: dict[str, Callable[[Law], Iterator[str]]] = {
    "drag": _drag,
    "minimum_gap": _other_kind((5e-324, math.inf), ("viscosity", "approach_speed", "roughness")),
    "lubrication": _film,
    "restitution": _other_kind((0.0, 1.0), ("stokes",), takes=frozenset({"stokes", "restitution"})),
    "added_mass": _added_mass,
    "lift": _lift,
}
"""What a kind must fulfil beyond finite numbers."""
