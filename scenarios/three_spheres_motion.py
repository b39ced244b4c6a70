"""Equations of motion of three wet spheres in a plane, in polar coordinates of each pair.

Lengths count in the film of the first pair, speeds in its normal speed of impact, forces in the viscous force of
the two: sphere diameter D = 1/h_a, mass 2 St. The state holds gap, angle, approach speed and rate of turning of the
pairs 1-2 and 2-3, and the spins of the spheres; the pair 1-3 follows from the other two. Angles and spins are
counter-clockwise. Where two spheres stay pressed together, a constraint takes the place of their endless bouncing.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.kernels import kernel
from closures.bridge import davis_tangential, deforming_share
from scenarios.adaptive import STAGES, stepper

FIRST = np.array([0, 1, 0])
SECOND = np.array([1, 2, 2])
"""Spheres of the pairs 1-2, 2-3 and 1-3."""

COUPLING = np.array([2.0, -1.0, 1.0, -1.0, 2.0, 1.0, 1.0, 1.0, 2.0])
"""How a push in one pair (column) shifts another (row), over the mass of a sphere."""

APART, JOINED, RESTING = 0, 1, 2
"""Modes of a pair: films apart, films joined, solids pressed together."""

STATE = 11
ROOM = STAGES * STATE + 48
"""Room for the slopes of a step and for what a rate needs on its way."""

STOKES, FILM_RATIO, MINIMUM_GAP, PULL, FRICTION, RESTITUTION, FILM, SLOWEST = 0, 1, 2, 3, 4, 5, 6, 9
"""Places in the numbers of a run; the films of the three pairs stand from FILM on."""

SLIDING = 1e-3
"""Speed below which friction of solids pressed together falls off to nothing."""


@kernel
def look(state, numbers, pair, seen):
    """Gap, approach speed, rate of turning, unit vector and distance of a pair, written into `seen`."""
    diameter = 1.0 / numbers[FILM_RATIO]
    if pair < 2:
        at = 4 * pair
        seen[0], seen[1], seen[2] = state[at], state[at + 2], state[at + 3]
        seen[3], seen[4] = math.cos(state[at + 1]), math.sin(state[at + 1])
        seen[5] = diameter + state[at]
        return
    x = y = u = v = 0.0
    for at in (0, 4):
        distance = diameter + state[at]
        c, s = math.cos(state[at + 1]), math.sin(state[at + 1])
        turning = distance * state[at + 3]
        x += distance * c
        y += distance * s
        u += -state[at + 2] * c - turning * s
        v += -state[at + 2] * s + turning * c
    distance = math.hypot(x, y)
    c, s = x / distance, y / distance
    seen[0], seen[1], seen[2] = distance - diameter, -(u * c + v * s), (v * c - u * s) / distance
    seen[3], seen[4], seen[5] = c, s, distance


@kernel
def slip(state, numbers, pair, seen):
    """Speed of the surface of the first sphere against that of the second."""
    radius = 0.5 / numbers[FILM_RATIO]
    return -seen[5] * seen[2] + radius * (state[8 + FIRST[pair]] + state[8 + SECOND[pair]])


@kernel
def rates(state, modes, numbers, slopes, at):
    """Slopes of the state; behind them the normal forces between solids pressed together."""
    mass, radius = 2.0 * numbers[STOKES], 0.5 / numbers[FILM_RATIO]
    seen, work = slopes[STAGES * STATE + 3 :], slopes[STAGES * STATE + 24 :]
    push, drag, grip, opening = work[0:3], work[3:6], work[6:9], work[9:12]
    for pair in range(3):
        view = seen[6 * pair : 6 * pair + 6]
        look(state, numbers, pair, view)
        push[pair] = drag[pair] = grip[pair] = 0.0
        if modes[pair] == APART:
            continue
        film, sliding = numbers[FILM + pair], slip(state, numbers, pair, view)
        gap = max(view[0], 0.5 * numbers[MINIMUM_GAP])  # only trials of a step look below the minimum gap
        push[pair] = view[1] * deforming_share(gap, film) / gap - numbers[PULL]
        # strength A = 6 pi eta R*^2 is 1 here, and R* a quarter of the diameter
        reduced_radius = 0.5 * radius
        drag[pair] = sliding * davis_tangential(1.0, reduced_radius, gap, film) / (6.0 * math.pi * reduced_radius**2)
        if modes[pair] == RESTING:
            grip[pair] = numbers[FRICTION] * min(1.0, max(-1.0, sliding / SLIDING))
    for row in range(3):
        opening[row] = seen[6 * row + 5] * seen[6 * row + 2] ** 2
        for pair in range(3):
            opening[row] += COUPLING[3 * row + pair] * along(seen, row, pair, push[pair], drag[pair]) / mass
    pressed(modes, seen, grip, opening, mass, work[12:24])
    for pair in range(3):
        force = work[12 + pair]
        push[pair] += force
        drag[pair] += force * grip[pair]
        slopes[STAGES * STATE + pair] = force
    for row in range(2):
        view, place = seen[6 * row : 6 * row + 6], at + 4 * row
        normal = tangential = 0.0
        for pair in range(3):
            share = COUPLING[3 * row + pair] / mass
            normal += share * along(seen, row, pair, push[pair], drag[pair])
            tangential += share * along(seen, row, pair, drag[pair], -push[pair])
        slopes[place] = -view[1]
        slopes[place + 1] = view[2]
        slopes[place + 2] = -normal - view[5] * view[2] ** 2
        slopes[place + 3] = (tangential + 2.0 * view[1] * view[2]) / view[5]
        if modes[row] == RESTING:
            slopes[place] = slopes[place + 2] = 0.0
    inertia = 0.4 * mass * radius**2
    for sphere in range(3):
        torque = 0.0
        for pair in range(3):
            if FIRST[pair] == sphere or SECOND[pair] == sphere:
                torque -= radius * drag[pair]
        slopes[at + 8 + sphere] = torque / inertia


@kernel
def along(seen, row, pair, push, drag):
    """Component along the line of centres of a pair of a force given along and across that of another."""
    cosine = seen[6 * row + 3] * seen[6 * pair + 3] + seen[6 * row + 4] * seen[6 * pair + 4]
    sine = seen[6 * row + 3] * seen[6 * pair + 4] - seen[6 * row + 4] * seen[6 * pair + 3]
    return push * cosine - drag * sine


@kernel
def pressed(modes, seen, grip, opening, mass, work):
    """Normal forces that keep pairs pressed together from moving along their lines of centres; into work[:3]."""
    force, table = work[0:3], work[3:12]
    for row in range(3):
        force[row] = -opening[row] if modes[row] == RESTING else 0.0
        for pair in range(3):
            held = modes[row] == RESTING and modes[pair] == RESTING
            push = COUPLING[3 * row + pair] * along(seen, row, pair, 1.0, grip[pair]) / mass
            table[3 * row + pair] = push if held else 1.0 if row == pair else 0.0
    for pivot in range(3):  # the diagonal leads, so elimination needs no exchange of rows
        for row in range(pivot + 1, 3):
            factor = table[3 * row + pivot] / table[4 * pivot]
            for column in range(pivot, 3):
                table[3 * row + column] -= factor * table[3 * pivot + column]
            force[row] -= factor * force[pivot]
    for row in range(2, -1, -1):
        for column in range(row + 1, 3):
            force[row] -= table[3 * row + column] * force[column]
        force[row] /= table[4 * row]


step = stepper(rates, "three_spheres")


@kernel
def strike(state, numbers, pair, restitution, seen):
    """Impulse of a hard contact with sliding friction, or without sliding where friction suffices."""
    mass, radius = 2.0 * numbers[STOKES], 0.5 / numbers[FILM_RATIO]
    look(state, numbers, pair, seen)
    c, s = seen[3], seen[4]
    sliding = slip(state, numbers, pair, seen)
    normal = 0.5 * mass * (1.0 + restitution) * seen[1]
    sticking = mass * sliding / 7.0
    limit = numbers[FRICTION] * max(normal, 0.0)
    tangential = min(limit, max(-limit, sticking))
    x, y = normal * c - tangential * s, normal * s + tangential * c
    for row in range(2):
        share = COUPLING[3 * row + pair] / mass
        look(state, numbers, row, seen)
        state[4 * row + 2] -= share * (x * seen[3] + y * seen[4])
        state[4 * row + 3] += share * (y * seen[3] - x * seen[4]) / seen[5]
    for sphere in (FIRST[pair], SECOND[pair]):
        state[8 + sphere] -= radius * tangential / (0.4 * mass * radius**2)
