"""Laws of one's own in the pair loop: a minimum gap and the resistance of a film, one function each.

A loop asks such a law through the address of its machine code. So the loops stay compiled as they are with the
laws that are built in, and only the law itself is compiled for a run.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import cfunc, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from cfddem.chosen_laws import OF_THE_PAIR_LOOP, chosen
from cfddem.errors import InputError
from cfddem.kernels import inline
from cfddem.particles.pairs import THICKEST

SHORT = 1e-5
"""A change of the gap by less than this share is short: what a film does meanwhile is that of its middle, to 1e-11."""

_NODES, _WEIGHTS = (tuple(float(x) for x in each) for each in np.polynomial.legendre.leggauss(5))


@cache
def address(law: Callable[..., float], kind: str) -> int:
    """Where the machine code of a law is; it takes all arguments of its kind, and 1 to ask if they are in range.

    law   decorated with @closures.law(...)
    kind  "minimum_gap" or "lubrication"
    """
    return int(_machine_code(law, kind).address)


@cache
def _machine_code(law: Callable[..., float], kind: str) -> Any:
    card, names = chosen(kind, law), OF_THE_PAIR_LOOP[kind][0]
    taken = inspect.signature(law).parameters  # `chosen` has let pass words of `names` only: safe to evaluate
    value = njit(error_model="numpy")(eval(f"lambda {', '.join(names)}: law({', '.join(taken)})", {"law": law}))
    low, high = zip(*(card.ranges.get(name, (-math.inf, math.inf)) for name in names))

    def answer(a, b, c, d, e, whether_outside):  # type: ignore[no-untyped-def]
        if whether_outside == 0.0:
            return float(value(a, b, c, d, e))
        asked = (a, b, c, d, e)
        for k in range(5):
            if not low[k] <= asked[k] <= high[k]:
                return 1.0
        return 0.0

    try:
        return cfunc(types.float64(*[types.float64] * 6), error_model="numpy")(answer)
    except Exception as refusal:  # whatever stops the compiler, errors of its own or others
        reason = " ".join(str(refusal).split())[:200]
        raise InputError(f"laws.{kind}", card.name, "numbers, math and if, which can be compiled", reason) from None


@intrinsic
def _call(typing: Any, code: Any, numbers: Any) -> Any:
    """Call machine code at an address with numbers; where no law is (None) it is never reached."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        if isinstance(code, types.NoneType):
            return ir.Constant(ir.DoubleType(), math.nan)
        kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType()] * len(numbers))
        return builder.call(
            builder.inttoptr(values[0], kind.as_pointer()), cgutils.unpack_tuple(builder, values[1], len(numbers))
        )

    return types.float64(code, numbers), generate


@inline
def own_minimum_gap(roughness, approach_speed, viscosity, reduced_modulus, reduced_radius, laws):
    """Minimum gap by a law of one's own: at least that of asperities, at most what neighbour lists allow for.

    returns  gap, not a number where the law gives none [m]
    """
    asked = (roughness, approach_speed, viscosity, reduced_modulus, reduced_radius, 0.0)
    gap = _call(laws.minimum_gap, asked)
    return max(roughness, min(gap, THICKEST * reduced_radius)) if gap == gap else gap


@inline
def gap_is_outside(roughness, approach_speed, viscosity, reduced_modulus, reduced_radius, laws):
    """1 where the law of the minimum gap is asked outside of its range."""
    return np.int64(
        _call(laws.minimum_gap, (roughness, approach_speed, viscosity, reduced_modulus, reduced_radius, 1.0))
    )


@inline
def own_film(gap, viscosity, reduced_radius, minimum_gap, laws):
    """Resistance of a film by a law of one's own, at this gap or the minimum one; without lever [kg/s]."""
    at = max(gap, minimum_gap)
    asked = (at, viscosity, reduced_radius, minimum_gap, laws.cutoff_ratio * reduced_radius, 0.0)
    return _call(laws.lubrication, asked)


@inline
def film_is_outside(gap, viscosity, reduced_radius, minimum_gap, laws):
    """1 where the law of the film is asked outside of its range."""
    at = max(gap, minimum_gap)
    asked = (at, viscosity, reduced_radius, minimum_gap, laws.cutoff_ratio * reduced_radius, 1.0)
    return np.int64(_call(laws.lubrication, asked))


@inline
def own_resistance(gap, viscosity, reduced_radius, minimum_gap, laws):
    """The same with the lever, as an explicit force has it: nothing for solids that overlap or are out of reach."""
    if gap <= 0.0 or gap > laws.cutoff_ratio * reduced_radius:
        return 0.0
    return own_film(gap, viscosity, reduced_radius, minimum_gap, laws) * min(gap / minimum_gap, 1.0)


@inline
def own_impulse(gap, end, viscosity, reduced_radius, minimum_gap, laws):
    """Integral of the resistance over the gap, from one to another, lever included [N s].

    Below h_min the resistance is linear. In the film Gauss' rule of five points takes ln h, a factor e at a time.
    """
    cutoff = laws.cutoff_ratio * reduced_radius
    if min(gap, end) > minimum_gap and max(gap, end) < cutoff and abs(end - gap) < SHORT * gap:
        return (end - gap) * own_film(0.5 * (gap + end), viscosity, reduced_radius, minimum_gap, laws)
    total, a, b = 0.0, min(max(gap, 0.0), minimum_gap), min(max(end, 0.0), minimum_gap)
    if a != b:
        least = own_film(minimum_gap, viscosity, reduced_radius, minimum_gap, laws)
        total = 0.5 * least * (b - a) * (b + a) / minimum_gap
    a, b = min(max(gap, minimum_gap), cutoff), min(max(end, minimum_gap), cutoff)
    if a == b:
        return total
    a = math.log(a)
    way = math.log(b) - a
    pieces = int(abs(way)) + 1
    half = 0.5 * way / pieces
    for piece in range(pieces):
        middle = a + (2 * piece + 1) * half
        for k in range(len(_NODES)):
            at = math.exp(middle + half * _NODES[k])
            total += half * _WEIGHTS[k] * at * own_film(at, viscosity, reduced_radius, minimum_gap, laws)
    return total


@inline
def speed_after_own_film(speed, gap, accounted_gap, step, inverse_mass, viscosity, reduced_radius, minimum_gap, laws):
    """Rate of the gap after a step in which only the film acts, as `closures.lubrication.speed_after_film`.

    inverse_mass  of the pair, as far as this film has it [1/kg]
    """
    film = (viscosity, reduced_radius, minimum_gap, laws)
    total = speed + inverse_mass * own_impulse(gap, accounted_gap, *film)
    low, high = min(total, 0.0), max(total, 0.0)  # a film brakes, and never turns a motion round
    guess = total / (1.0 + step * inverse_mass * own_resistance(gap, *film))
    if abs(step * guess) < 1e-7 * gap:
        return guess  # the resistance has not changed by more than rounding
    for _ in range(100):
        excess = guess + inverse_mass * own_impulse(gap, gap + step * guess, *film) - total
        if abs(excess) <= 1e-14 * (abs(total) + abs(guess)):
            return guess
        if excess > 0.0:
            high = guess
        else:
            low = guess
        following = guess - excess / (1.0 + step * inverse_mass * own_resistance(gap + step * guess, *film))
        if not low < following < high:
            following = 0.5 * (low + high)
        if following == guess:
            return guess
        guess = following
    return guess
