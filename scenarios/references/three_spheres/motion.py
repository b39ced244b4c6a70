"""Equations of motion of three wet spheres in a plane, in polar coordinates of each pair.

Lengths are scaled with the film of the first pair, speeds with its normal speed of impact, and forces with the viscous
force of the two. The sphere diameter is D = 1/h_a and the mass 2 St. The state holds gap, angle, approach speed and
rate of turning of the pairs 1-2 and 2-3, and the spins of the spheres; the pair 1-3 follows from the other two. Angles
and spins are positive counter-clockwise. Spheres pressed together are held by a constraint instead of endless bounces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import serial
from closures.bridge import davis_tangential, deforming_share

FIRST = np.array([0, 1, 0])
SECOND = np.array([1, 2, 2])
"""Spheres of the pairs 1-2, 2-3 and 1-3."""

COUPLING = np.array([[2.0, -1.0, 1.0], [-1.0, 2.0, 1.0], [1.0, 1.0, 2.0]])
"""Relative acceleration of a pair (row) due to a force in another pair (column), times the mass of a sphere."""

APART, JOINED, RESTING = 0, 1, 2
"""Modes of a pair: films apart, films joined, solids pressed together."""

STATE = 11
SPINS = 8
"""Length of the state, and the place of the first spin in it."""

SLIDING = 1e-3
"""Below this sliding speed, friction of solids pressed together falls linearly to zero."""


class Numbers(NamedTuple):
    """Dimensionless numbers of a run."""

    stokes: float
    film_ratio: float  # h_a
    minimum_gap: float  # h_m
    pull: float  # capillary, 4/Ca
    friction: float
    restitution: float
    films: tuple[float, float, float]  # of the pairs 1-2, 2-3 and 1-3
    slowest_bounce: float

    def flat(self) -> np.ndarray:
        """All numbers in one array, which costs a compiled function less to take (10,)."""
        return np.array([*self[:6], *self.films, self.slowest_bounce])


class View(NamedTuple):
    """Geometry and relative motion of a pair."""

    gap: float
    approach: float  # speed along the line of centres, positive when approaching
    turning: float  # of the line of centres
    cosine: float  # of the direction from the first sphere to the second
    sine: float
    distance: float


@serial
def view(state, film_ratio, pair):
    """Geometry and relative motion of the pair 0 (1-2), 1 (2-3) or 2 (1-3)."""
    diameter = 1.0 / film_ratio
    if pair < 2:
        at = 4 * pair
        c, s = math.cos(state[at + 1]), math.sin(state[at + 1])
        return View(state[at], state[at + 2], state[at + 3], c, s, diameter + state[at])
    x = y = u = v = 0.0
    for at in (0, 4):
        distance = diameter + state[at]
        c, s = math.cos(state[at + 1]), math.sin(state[at + 1])
        across = distance * state[at + 3]
        x += distance * c
        y += distance * s
        u += -state[at + 2] * c - across * s
        v += -state[at + 2] * s + across * c
    distance = math.hypot(x, y)
    c, s = x / distance, y / distance
    return View(distance - diameter, -(u * c + v * s), (v * c - u * s) / distance, c, s, distance)


@serial
def slip(state, film_ratio, pair, pair_view):
    """Sliding speed of the surface of the first sphere relative to the second."""
    spins = state[SPINS + FIRST[pair]] + state[SPINS + SECOND[pair]]
    return -pair_view.distance * pair_view.turning + 0.5 / film_ratio * spins


@serial
def along(own, other, push, drag):
    """Component along the line of centres of a pair of a force given along and across that of another pair."""
    cosine = own.cosine * other.cosine + own.sine * other.sine
    sine = own.cosine * other.sine - own.sine * other.cosine
    return push * cosine - drag * sine


@serial
def forces(state, modes, numbers):
    """Forces of the pairs along (3,) and across (3,) their lines of centres, and the contact forces in them (3,)."""
    h_a = numbers.film_ratio
    views = (view(state, h_a, 0), view(state, h_a, 1), view(state, h_a, 2))
    push, drag, grip, contact = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    mass, reduced_radius = 2.0 * numbers.stokes, 0.25 / h_a
    pressed = False
    for pair in range(3):
        if modes[pair] == APART:
            continue
        pair_view, film = views[pair], numbers.films[pair]
        sliding = slip(state, h_a, pair, pair_view)
        # only trial steps reach below the minimum gap or beyond the film
        gap = min(film, max(pair_view.gap, 0.5 * numbers.minimum_gap))
        push[pair] = pair_view.approach * deforming_share(gap, film) / gap - numbers.pull
        # the strength A = 6 pi eta R*^2 is 1 in these units
        drag[pair] = sliding * davis_tangential(1.0, reduced_radius, gap, film) / (6.0 * math.pi * reduced_radius**2)
        if modes[pair] == RESTING:
            pressed = True
            grip[pair] = numbers.friction * min(1.0, max(-1.0, sliding / SLIDING))
    if pressed:
        contact = contact_forces(views, modes, push, drag, grip, mass)
        push += contact
        drag += contact * grip
    return push, drag, contact


@serial
def contact_forces(views, modes, push, drag, grip, mass):
    """Normal forces that keep the pairs pressed together at rest along their lines of centres (3,)."""
    table, right = np.eye(3), np.zeros(3)
    for row in range(3):
        if modes[row] != RESTING:
            continue
        right[row] = -views[row].distance * views[row].turning ** 2
        for pair in range(3):
            coupling = COUPLING[row, pair] / mass
            right[row] -= coupling * along(views[row], views[pair], push[pair], drag[pair])
            if modes[pair] == RESTING:
                table[row, pair] = coupling * along(views[row], views[pair], 1.0, grip[pair])
    return np.linalg.solve(table, right)


@serial
def rates(state, modes, numbers):
    """Rates of change of the state (11,)."""
    h_a = numbers.film_ratio
    mass, radius = 2.0 * numbers.stokes, 0.5 / h_a
    views = (view(state, h_a, 0), view(state, h_a, 1), view(state, h_a, 2))
    push, drag, _ = forces(state, modes, numbers)
    slopes = np.zeros(STATE)
    for row in range(2):
        pair_view, at = views[row], 4 * row
        normal = tangential = 0.0
        for pair in range(3):
            share = COUPLING[row, pair] / mass
            normal += share * along(pair_view, views[pair], push[pair], drag[pair])
            tangential += share * along(pair_view, views[pair], drag[pair], -push[pair])
        slopes[at + 1] = pair_view.turning
        slopes[at + 3] = (tangential + 2.0 * pair_view.approach * pair_view.turning) / pair_view.distance
        if modes[row] != RESTING:
            slopes[at] = -pair_view.approach
            slopes[at + 2] = -normal - pair_view.distance * pair_view.turning**2
    for pair in range(3):
        turn = radius * drag[pair] / (0.4 * mass * radius**2)
        slopes[SPINS + FIRST[pair]] -= turn
        slopes[SPINS + SECOND[pair]] -= turn
    return slopes


@serial
def rates_of(state, modes, flat):
    """Rates of change of the state (11,), given `Numbers.flat()`."""
    return rates(state, modes, _numbers(flat))


@serial
def observe(state, modes, flat):
    """Gap, approach speed and contact force of each pair (3, 3), given `Numbers.flat()`."""
    numbers, table = _numbers(flat), np.zeros((3, 3))
    for pair in range(3):
        pair_view = view(state, numbers.film_ratio, pair)
        table[0, pair], table[1, pair] = pair_view.gap, pair_view.approach
    if (modes == RESTING).any():
        table[2] = forces(state, modes, numbers)[2]
    return table


@serial
def _numbers(f):
    return Numbers(f[0], f[1], f[2], f[3], f[4], f[5], (f[6], f[7], f[8]), f[9])


@serial
def strike(state, numbers, pair, restitution):
    """Apply the impulse of a hard contact with sliding friction, or without sliding where friction suffices."""
    h_a = numbers.film_ratio
    mass, radius = 2.0 * numbers.stokes, 0.5 / h_a
    pair_view = view(state, h_a, pair)
    sliding = slip(state, h_a, pair, pair_view)
    normal = 0.5 * mass * (1.0 + restitution) * pair_view.approach
    limit = numbers.friction * max(normal, 0.0)
    tangential = min(limit, max(-limit, mass * sliding / 7.0))
    x = normal * pair_view.cosine - tangential * pair_view.sine
    y = normal * pair_view.sine + tangential * pair_view.cosine
    for row in range(2):
        share = COUPLING[row, pair] / mass
        moved = view(state, h_a, row)
        state[4 * row + 2] -= share * (x * moved.cosine + y * moved.sine)
        state[4 * row + 3] += share * (y * moved.cosine - x * moved.sine) / moved.distance
    for sphere in (FIRST[pair], SECOND[pair]):
        state[SPINS + sphere] -= radius * tangential / (0.4 * mass * radius**2)
