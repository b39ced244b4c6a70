"""Three wet spheres: one strikes a resting pair, and who sticks to whom is the question.

What you'll learn: how inertia, the angle of impact and the capillary pull decide between agglomerates and separate
spheres, and why the third sphere matters.

>>> from scenarios.three_spheres import simulate
>>> result = simulate(stokes=20, theta12=30)
>>> round(result.restitution12, 3), round(result.restitution23, 3), result.outcome
(0.774, 0.58, 'FS')
>>> first = result.events[0]
>>> first.kind, first.pair, round(first.time, 2)
('contact', 12, 0.97)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cfddem.errors import InputError, RunFailed
from scenarios import three_spheres_events as march
from scenarios.three_spheres_motion import APART, FILM_RATIO, JOINED, STATE, STOKES

PAIRS = (12, 23, 13)
KINDS = ("contact", "meet", "separate")
OUTCOMES = ("FA", "PA1", "PA2", "PA3", "FS")
"""Full agglomeration; agglomeration of two while sphere 1, 2 or 3 leaves; full separation."""

UNTIL = 8.0
"""Diameters that the striker would have flown: the published sequences end by 6.1. Without a capillary pull every pair
that turns parts at last, so what counts as an agglomerate needs an end of watching."""

SLOWEST_BOUNCE = 1e-4
"""Contacts slower than this part of the impact stay pressed together; 1e-3 to 2e-6 give the same to 8 digits."""

_NOWHERE = -1e30  # film of a pair that never meets
_BUFFER = 4000


@dataclass(frozen=True)
class Event:
    """Films meet or separate, or solids touch."""

    kind: str  # "contact", "meet" or "separate"
    pair: int  # 12, 23 or 13
    time: float  # t v_n0 / delta_12 [-]
    time_star: float  # t v_10 / diameter [-]
    speed: float  # along the line of centres, over v_n0, positive whether they approach or part [-]


@dataclass(frozen=True)
class Triplet:
    """What came of three spheres. Restitutions are taken where the films of a pair part for the first time."""

    outcome: str  # one of OUTCOMES
    restitution12: float  # normal speed of parting over that of impact; 0 where the pair does not part [-]
    restitution23: float  # the same of 2 and 3, over the impact of 1 on 2 [-]
    events: tuple[Event, ...] = field(repr=False)
    history: dict[str, np.ndarray] = field(repr=False)

    def summary(self) -> dict[str, Any]:
        """The result without its history, ready for JSON; of repeated contacts of a pair the first is kept."""
        listed, seen = [], set()
        for event in self.events:
            key = (event.kind, event.pair)
            if event.kind != "contact" or key not in seen:
                listed.append(vars(event).copy())
            seen.add(key)
        contacts = [event.pair for event in self.events if event.kind == "contact"]
        return {
            "outcome": self.outcome,
            "restitution12": self.restitution12,
            "restitution23": self.restitution23,
            "contacts": {str(pair): contacts.count(pair) for pair in PAIRS},
            "events": listed,
        }


def simulate(
    stokes: float,
    theta12: float,
    theta23: float = 0.0,
    film_ratio: float = 0.01,
    minimum_gap: float = 0.05,
    capillary_number: float = math.inf,
    friction: float = 0.0,
    restitution: float = 1.0,
    gap23: float = 1.0,
    film23: float = 1.0,
    film13: float = 1.0,
    spheres: int = 3,
    until: float = UNTIL,
    slowest_bounce: float = SLOWEST_BOUNCE,
) -> Triplet:
    r"""Let sphere 1 strike sphere 2 of a resting pair 2-3, all equal and coated with a viscous film.

    Gaps and films count in the film of the first pair, delta_12; the striker flies along x.

    stokes            St_n = m* v_n0 / (6 pi eta R*^2), of the normal speed of impact [-]
    theta12           angle of the line of centres 1-2 at impact against the velocity, -90 < theta12 < 90 [deg]
    theta23           angle of the line of centres 2-3 against the velocity [deg]
    film_ratio        h_a = delta_12 over the diameter of the spheres [-]
    minimum_gap       h_m, gap at which solids touch, over delta_12 [-]
    capillary_number  Ca = 3 eta R* v_n0 / (sigma delta_12) [-]
    friction          mu_f, of the solids [-]
    restitution       e_dry, of the solids [-]
    gap23             first gap of the pair 2-3 over delta_12 [-]
    film23, film13    films of the other pairs over delta_12 [-]
    spheres           3, or 2 for a collision without sphere 3
    until             end, as the way of the striker at its speed of impact over its diameter [-]
    slowest_bounce    contacts slower than this part of v_n0 stay pressed together [-]
    returns           :class:`Triplet`

    >>> simulate(stokes=2, theta12=45).outcome                      # sphere 1 leaves after it has met sphere 3
    'PA1'
    >>> simulate(stokes=3.5, theta12=45, capillary_number=100).outcome
    'FA'
    """
    given = locals()
    start = _start(**{name: given[name] for name in given if name != "until"})
    speeds, rows, log = _follow(start, until, keep=True)
    state, modes, numbers = start
    diameters = _diameters(theta12, film_ratio)
    events = tuple(
        Event(KINDS[int(kind)], PAIRS[int(pair)], float(time), float(time) / diameters, float(speed))
        for time, kind, pair, speed in log
    )
    outcome = str(label(modes)) if spheres == 3 else "FS" if modes[0] == APART else "FA"
    return Triplet(outcome, float(speeds[0]), float(speeds[1]), events, _columns(rows, diameters, film_ratio))


Start = tuple[np.ndarray, np.ndarray, np.ndarray]
"""State, modes and numbers of a run."""


def _diameters(theta12: float, film_ratio: float) -> float:
    """Time v_n0 t / delta_12 over time v_10 t / diameter."""
    return math.cos(math.radians(theta12)) / film_ratio


def _follow(start: Start, until: float, keep: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run to the end: speeds of the first partings (0 where there was none), history and events; changes the start."""
    _check("until", until, 0.0 < until < math.inf, "above 0 and finite")
    state, modes, numbers = start
    end = until * _diameters(math.degrees(state[1]), numbers[FILM_RATIO])
    clock, counts, speeds = np.array([0.0, 1e-3]), np.zeros(2, np.int64), np.full(3, np.nan)
    samples, log = np.empty((_BUFFER if keep else 0, 1 + STATE)), np.empty((_BUFFER, 4))
    rows, logged = [np.concatenate([[0.0], state])[None]], []
    reason = march.FULL
    while reason == march.FULL:
        counts[:] = 0
        reason = march.advance(clock, state, modes, numbers, end, samples, log, counts, speeds)
        rows.append(samples[: counts[0]].copy())
        logged.append(log[: counts[1]].copy())
    if reason == march.STUCK:
        raise RunFailed(
            f"three spheres at St = {numbers[STOKES]:.6g} cannot be followed beyond t = {clock[0]:.6g}; "
            "try a larger slowest_bounce"
        )
    return np.nan_to_num(speeds), np.concatenate(rows), np.concatenate(logged)


def _check(name: str, value: float, holds: bool, limit: str) -> None:
    if not holds:
        raise InputError(name, value, limit)


def _start(
    stokes: float,
    theta12: float,
    theta23: float,
    film_ratio: float,
    minimum_gap: float,
    capillary_number: float,
    friction: float,
    restitution: float,
    gap23: float,
    film23: float,
    film13: float,
    spheres: int,
    slowest_bounce: float,
) -> Start:
    """State, modes and numbers of a run at the moment of impact."""
    _check("stokes", stokes, 0.0 < stokes < math.inf, "above 0 and finite")
    _check("theta12", theta12, -90.0 < theta12 < 90.0, "between -90 and 90 degrees")
    _check("theta23", theta23, -180.0 <= theta23 <= 180.0, "between -180 and 180 degrees")
    _check("film_ratio", film_ratio, 0.0 < film_ratio <= 0.5, "above 0 and at most 0.5")
    _check("minimum_gap", minimum_gap, 0.0 < minimum_gap < min(1.0, film23, film13), "above 0 and below every film")
    _check("capillary_number", capillary_number, capillary_number > 0.0, "above 0; infinite for no capillary pull")
    _check("friction", friction, 0.0 <= friction < math.inf, "at least 0 and finite")
    _check("restitution", restitution, 0.0 <= restitution <= 1.0, "between 0 and 1")
    _check("gap23", gap23, minimum_gap <= gap23 < math.inf, "at least minimum_gap and finite")
    for name, film in (("film23", film23), ("film13", film13)):
        _check(name, film, film < math.inf, "finite")
    _check("spheres", spheres, spheres in (2, 3), "2 or 3")
    _check("slowest_bounce", slowest_bounce, 0.0 < slowest_bounce <= 0.01, "above 0 and at most 0.01")
    one, two, diameter = math.radians(theta12), math.radians(theta23), 1.0 / film_ratio
    state = np.zeros(STATE)
    state[:4] = 1.0, one, 1.0, math.tan(one) / (diameter + 1.0)
    state[4:6] = gap23, two
    films = (1.0, film23, film13) if spheres == 3 else (1.0, _NOWHERE, _NOWHERE)
    seen = np.empty(6)
    numbers = np.array(
        [stokes, film_ratio, minimum_gap, 4.0 / capillary_number, friction, restitution, *films, slowest_bounce]
    )
    march.look(state, numbers, 2, seen)
    _check("theta23", theta23, spheres == 2 or seen[0] >= minimum_gap, "such that sphere 3 does not lie in sphere 1")
    modes = np.array([JOINED, *(JOINED if gap <= film else APART for gap, film in zip((gap23, seen[0]), films[1:]))])
    return state, modes, numbers


def label(modes: np.ndarray) -> np.ndarray:
    """Outcome of three spheres from which pairs (12, 23, 13) are joined at the end."""
    joined = np.asarray(modes) != APART
    bonds = joined.sum(-1)
    alone = np.where(joined[..., 0], "PA3", np.where(joined[..., 1], "PA1", "PA2"))
    return np.where(bonds == 0, "FS", np.where(bonds == 1, alone, "FA"))


def _columns(rows: np.ndarray, diameters: float, film_ratio: float) -> dict[str, np.ndarray]:
    """History by name; speeds over v_n0, angles in degrees, rates of turning and spins in v_n0/delta_12."""
    names = ("gap12", "angle12", "approach12", "turning12", "gap23", "angle23", "approach23", "turning23", "spin1",
             "spin2", "spin3")  # fmt: skip
    columns = {"time": rows[:, 0], "time_star": rows[:, 0] / diameters}
    columns |= {name: rows[:, 1 + place] for place, name in enumerate(names)}
    for pair in ("12", "23"):
        columns[f"angle{pair}"] = np.degrees(columns[f"angle{pair}"])
    apart = centres(columns, film_ratio)
    columns["gap13"] = (np.hypot(*(apart[:, 2] - apart[:, 0]).T) - 1.0) / film_ratio
    return columns


def centres(history: dict[str, np.ndarray], film_ratio: float) -> np.ndarray:
    """Places of the three centres about their common centre of mass, in diameters: (times, spheres, x and y)."""
    steps = []
    for pair in ("12", "23"):
        angle = np.radians(history[f"angle{pair}"])
        steps.append((1.0 + film_ratio * history[f"gap{pair}"])[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1))
    places = np.stack([np.zeros_like(steps[0]), steps[0], steps[0] + steps[1]], 1)
    return np.asarray(places - places.mean(1, keepdims=True))


def outcomes(
    stokes: Sequence[float], theta12: Sequence[float], until: float = UNTIL, **conditions: Any
) -> dict[str, np.ndarray]:
    """Outcome and restitutions of every Stokes number (columns) at every angle (rows).

    stokes, theta12  values of the two axes
    until            as in :func:`simulate`
    conditions       further arguments of :func:`simulate`, the same for all
    returns          arrays "outcome", "restitution12", "restitution23" of shape (angles, Stokes numbers)

    >>> outcomes([2.0, 20.0], [45.0])["outcome"].tolist()
    [['PA1', 'FS']]
    """
    shape = (len(theta12), len(stokes))
    modes, speeds = np.zeros((*shape, 3), np.int64), np.zeros((*shape, 3))
    settings = _defaults() | conditions
    for row, angle in enumerate(theta12):
        for column, number in enumerate(stokes):
            start = _start(**settings | {"stokes": number, "theta12": angle})
            speeds[row, column] = _follow(start, until, keep=False)[0]
            modes[row, column] = start[1]
    return {"outcome": label(modes), "restitution12": speeds[..., 0], "restitution23": speeds[..., 1]}


def _defaults() -> dict[str, Any]:
    """What `simulate` assumes where nothing is said."""
    names = simulate.__code__.co_varnames[2 : simulate.__code__.co_argcount]
    return {name: value for name, value in zip(names, simulate.__defaults__ or ()) if name != "until"}
