"""The motion of two bodies along their line of centres over a step in which only their bridge resists."""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline
from cfddem.particles.interactions.bond import SMALLEST_GAP
from cfddem.particles.interactions.film_law import next_guess
from cfddem.particles.interactions.slots import (
    BRIDGE_ENERGY,
    BRIDGE_POTENTIAL,
    CUT_CONSTANT,
    BridgeState,
    bridge_energy,
    bridge_potential,
    bridge_pull,
    bridge_resistance,
)

SHORT = 0.05
"""Change of the gap up to which Gauss' rule of three points is used, over the gap: it integrates A/h to 1e-11."""

STILL = 1e-8
"""Change of the gap in a step, over the gap or h_min, below which the resistance is taken as constant."""

_NODES, _WEIGHTS = (tuple(float(x) for x in numbers) for numbers in np.polynomial.legendre.leggauss(5))
_ASIDE = math.sqrt(0.6)


@inline
def at_gap(state, gap):
    """The same bridge at another gap."""
    return BridgeState(
        gap, state.film, state.volume, state.reduced_radius, state.minimum_gap,
        state.viscosity, state.surface_tension, state.contact_angle, state.capillary_number, state.functions,
    )  # fmt: skip


@inline
def held_gap(state):
    """Gap below which the resistance is cut."""
    return max(state.minimum_gap, SMALLEST_GAP)


@inline
def _resistance(state, gap):
    return bridge_resistance(at_gap(state, gap))


@inline
def _above(state, a, change):
    """Integral of the resistance over a change of the gap from a, nowhere below h_min."""
    b = a + change
    if abs(change) < SHORT * min(a, b):
        middle, aside = a + 0.5 * change, 0.5 * _ASIDE * change
        ends = _resistance(state, middle - aside) + _resistance(state, middle + aside)
        return change * (5.0 * ends + 8.0 * _resistance(state, middle)) * (1.0 / 18.0)
    if BRIDGE_POTENTIAL:
        return bridge_potential(at_gap(state, b)) - bridge_potential(at_gap(state, a))
    total, low = 0.0, math.log(a)
    way = math.log(b) - low
    pieces = int(abs(way)) + 1
    half = 0.5 * way / pieces
    for piece in range(pieces):
        for n in range(len(_NODES)):
            gap = math.exp(low + (2 * piece + 1 + _NODES[n]) * half)
            total += half * _WEIGHTS[n] * gap * _resistance(state, gap)
    return total


@inline
def resistance_integral(state, a, change, floor):
    """Integral of the resistance over a change of the gap from a, cut below h_min [N s].

    The change is given and not the end, whose round-off may be as large as the change.
    """
    b = a + change
    if min(a, b) >= floor:
        return _above(state, a, change)
    below = change if max(a, b) <= floor else min(b, floor) - min(a, floor)
    total = _resistance(state, floor) * below if CUT_CONSTANT else 0.0
    if max(a, b) > floor:
        total += _above(state, max(a, floor), max(b, floor) - max(a, floor))
    return total


@inline
def cut_resistance(state, gap, floor):
    """Resistance at a gap, cut below h_min."""
    return _resistance(state, max(gap, floor)) if CUT_CONSTANT or gap >= floor else 0.0


@inline
def speed_after_bridge(speed, state, integrated_gap, step, inverse_mass):
    """Rate of the gap after a step in which only the bridge acts.

    Solves u1 + I(h, h + u1 dt) / m = u0 + I(h, ha) / m by Newton's method, kept between 0 and the speed without
    resistance; I is the integral of the resistance. It ends where the equation holds to round-off, as computed or by a
    bound on what the last change leaves, for resistances that rise or fall all the way between two guesses.

    integrated_gap  ha, gap up to which the impulse has been given [m]
    inverse_mass   1/m of the mass that the pair gives this bridge [1/kg]
    """
    gap, floor = state.gap, held_gap(state)
    total = speed
    if integrated_gap != gap:
        total += inverse_mass * resistance_integral(state, gap, integrated_gap - gap, floor)
    guess = total / (1.0 + step * inverse_mass * cut_resistance(state, gap, floor))
    if abs(step * guess) < STILL * max(gap, floor) and (gap > floor) == (gap + step * guess > floor):
        return guess
    middle = gap + 0.5 * step * guess
    if middle > floor:
        guess = total / (1.0 + step * inverse_mass * _resistance(state, middle))
    low, high = min(total, 0.0), max(total, 0.0)
    for _ in range(100):
        excess = guess + inverse_mass * resistance_integral(state, gap, step * guess, floor) - total
        allowed = 1e-13 * (abs(total) + abs(guess))
        if abs(excess) <= allowed:
            return guess
        end = gap + step * guess
        resistance = cut_resistance(state, end, floor)
        slope = 1.0 + step * inverse_mass * resistance
        following, low, high = next_guess(guess, excess, slope, low, high)
        change, new_end = following - guess, gap + step * following
        guess = following
        bend = step * inverse_mass * abs(cut_resistance(state, new_end, floor) - resistance)
        jumps = not CUT_CONSTANT and (end >= floor) != (new_end >= floor)
        if change == 0.0 or (not jumps and abs(excess + slope * change) + bend * abs(change) <= allowed):
            return guess
    return guess


@inline
def pull_energy(state):
    """Energy of the pull: its integral over the gap, from contact to the gap [J]."""
    force = bridge_pull(at_gap(state, 0.0))
    if state.gap <= 0.0:
        return force * state.gap
    if BRIDGE_ENERGY:
        return bridge_energy(state)
    # the force falls fastest at contact: pieces that grow with the gap
    total, low = 0.0, 0.0
    for piece in range(6):
        high = state.gap * 0.5 ** (5 - piece)
        half = 0.5 * (high - low)
        for n in range(len(_NODES)):
            total += half * _WEIGHTS[n] * bridge_pull(at_gap(state, low + half * (1.0 + _NODES[n])))
        low = high
    return total
