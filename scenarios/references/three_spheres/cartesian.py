"""A second solution of the three wet spheres, for comparison: positions and velocities in the plane.

It shares nothing with the polar equations of :mod:`scenarios.references.three_spheres.motion`: the forces are written
out here, and the motion is that of each sphere in Cartesian coordinates.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import Field
from scipy.integrate import solve_ivp

from cfddem.case.settings import takes
from scenarios.collisions.three_spheres.study import Collision
from scenarios.references.ode import event

PAIRS = {12: (0, 1), 23: (1, 2), 13: (0, 2)}
RIM = 1e-9
"""Films separate slightly farther out than they meet, so that rounding does not make and break them."""


class Conditions(Collision):
    """Those of `simulate_three_spheres`, with another end."""

    until: float = Field(20.0, gt=0, description="end, in delta_12 / v_n0 [-]")


@takes(Conditions)
def cartesian(conditions: Conditions) -> list[tuple[str, int, float, float]]:
    """Events of three wet spheres: kind, pair, time and speed, in the units of `simulate_three_spheres`.

    returns  events in their order, up to the first contact slower than 1e-3, where endless bouncing begins
    """
    film_ratio, minimum_gap, capillary_number = (
        conditions.film_ratio,
        conditions.minimum_gap,
        conditions.capillary_number,
    )
    friction, restitution, until = conditions.friction, conditions.restitution, conditions.until
    diameter, mass = 1.0 / film_ratio, 2.0 * conditions.stokes
    films = {12: 1.0, 23: conditions.film23, 13: conditions.film13}
    one, two = math.radians(conditions.theta12), math.radians(conditions.theta23)
    second = (diameter + 1.0) * np.array([math.cos(one), math.sin(one)])
    third = second + (diameter + conditions.gap23) * np.array([math.cos(two), math.sin(two)])
    y = np.concatenate([[0.0, 0.0], second, third, [1.0 / math.cos(one), 0, 0, 0, 0, 0], np.zeros(3)])
    bound = {pair: _look(y, pair, diameter)[0] <= films[pair] + RIM for pair in PAIRS}

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        change = np.zeros(15)
        change[:6] = y[6:12]
        for pair, (i, j) in PAIRS.items():
            if not bound[pair]:
                continue
            gap, approach, sliding, normal, across = _look(y, pair, diameter)
            gap, film = max(gap, 0.3 * minimum_gap), films[pair]
            film_impulse = approach * (2.0 * (film - gap) / (2.0 * film - gap)) ** 2 / gap - 4.0 / capillary_number
            shear = 4.0 / 3.0 * film_ratio * sliding * math.log((2.0 * film - gap) / gap)
            force = (film_impulse * normal + shear * across) / mass
            change[6 + 2 * i : 8 + 2 * i] -= force
            change[6 + 2 * j : 8 + 2 * j] += force
            for sphere in (i, j):
                change[12 + sphere] -= 0.5 * diameter * shear / (0.1 * mass * diameter**2)
        return change

    time, events = 0.0, []
    while time < until:
        watched: list[tuple[str, int, Any]] = []
        for pair in PAIRS:
            rims = [("separate", films[pair] + RIM, 1), ("contact", minimum_gap, -1)]
            for kind, at, direction in rims if bound[pair] else [("meet", films[pair] - RIM, -1)]:
                watched.append((kind, pair, _event(pair, at, direction, diameter)))
        part = solve_ivp(
            motion, (time, until), y, "DOP853", events=[event for _, _, event in watched],
            rtol=1e-10, atol=1e-12, first_step=1e-5, max_step=0.2,
        )  # fmt: skip
        time, y = float(part.t[-1]), part.y[:, -1]
        happened = [place for place, times in enumerate(part.t_events) if len(times)]
        if part.status != 1:
            break
        kind, pair, _ = watched[happened[0]]
        speed = _look(y, pair, diameter)[1]
        if kind == "contact" and speed < 1e-3:
            break
        if kind == "contact":
            y = _strike(y, pair, restitution, friction, mass, diameter)
        bound[pair] = kind != "separate"
        events.append((kind, pair, time, abs(speed)))
    return events


def _look(y: np.ndarray, pair: int, diameter: float) -> tuple[float, float, float, np.ndarray, np.ndarray]:
    """Gap, approach speed, slip of the surfaces, and the directions along and across."""
    i, j = PAIRS[pair]
    x = y[2 * j : 2 * j + 2] - y[2 * i : 2 * i + 2]
    v = y[6 + 2 * j : 8 + 2 * j] - y[6 + 2 * i : 8 + 2 * i]
    distance = math.hypot(*x)
    normal = x / distance
    across = np.array([-normal[1], normal[0]])
    return (
        distance - diameter,
        -float(v @ normal),
        float(-v @ across + 0.5 * diameter * (y[12 + i] + y[12 + j])),
        normal,
        across,
    )


def _event(pair: int, at: float, direction: int, diameter: float) -> Any:
    return event(lambda _, y: _look(y, pair, diameter)[0] - at, direction)


def _strike(y: np.ndarray, pair: int, restitution: float, friction: float, mass: float, diameter: float) -> np.ndarray:
    """Momenta after a hard contact."""
    _, approach, sliding, normal, across = _look(y, pair, diameter)
    push = 0.5 * mass * (1.0 + restitution) * approach
    pull = math.copysign(min(friction * push, 0.5 * mass * abs(sliding) / 3.5), sliding)
    y = y.copy()
    for sphere, sign in zip(PAIRS[pair], (-1.0, 1.0)):
        y[6 + 2 * sphere : 8 + 2 * sphere] += sign * (push * normal + pull * across) / mass
        y[12 + sphere] -= pull / (0.2 * mass * diameter)
    return y
