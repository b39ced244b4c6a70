"""A wet sphere strikes a resting pair of wet spheres: which spheres stick together, and which separate.

What you'll learn: how inertia, the angle of impact and the capillary force decide between agglomerates and separate
spheres, and why the third sphere matters.

>>> from scenarios.collisions.three_spheres import simulate_three_spheres
>>> result = simulate_three_spheres(stokes=20, theta12=30)
>>> round(result.restitution12, 3), round(result.restitution23, 3), result.outcome
(0.774, 0.58, 'FS')
>>> first = result.events[0]
>>> first.kind, first.pair, round(first.time, 2)
('contact', 12, 0.97)
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from cfddem.backend.errors import InputError, nearest
from cfddem.backend.launch import safe_workers
from scenarios.collisions.three_spheres.engine import integrate as integrate_in_engine
from scenarios.references.three_spheres.events import RELEASE, Path, integrate
from scenarios.references.three_spheres.motion import APART, JOINED, STATE, Numbers, view

PAIRS = (12, 23, 13)
OUTCOMES = ("FA", "PA1", "PA2", "PA3", "FS")
"""Full agglomeration; agglomeration of two spheres while sphere 1, 2 or 3 separates; full separation."""

UNTIL = 8.0
"""Default end, in diameters travelled at the speed of impact; the published sequences end by 6.1. Without a capillary
force every rotating pair separates in the end, so the outcome depends on when the simulation ends."""

SLOWEST_BOUNCE = 1e-4
"""Contacts slower than this fraction of the impact stay pressed together; 1e-3 to 2e-6 agree to 8 digits."""

SOLVERS = ("particles", "equations")

MAP_TOLERANCE, PARALLEL_FROM = 1e-8, 200
"""Tolerance of the runs of a map, and number of runs from which it uses all cores."""


@dataclass(frozen=True)
class Event:
    """Films meet or separate, or solids touch."""

    kind: str  # "contact", "meet" or "separate"
    pair: int  # 12, 23 or 13
    time: float  # t v_n0 / delta_12 [-]
    time_star: float  # t v_10 / diameter [-]
    speed: float  # along the line of centres, over v_n0; positive both on approach and on separation [-]


@dataclass(frozen=True)
class Triplet:
    """Result for three spheres. Restitutions are taken where the films of a pair separate for the first time."""

    outcome: str  # one of OUTCOMES
    restitution12: float  # normal speed of separation over that of impact; 0 if the pair does not separate [-]
    restitution23: float  # the same for 2 and 3, over the impact of 1 on 2 [-]
    events: tuple[Event, ...] = field(repr=False)
    history: dict[str, np.ndarray] = field(repr=False)

    def summary(self) -> dict[str, Any]:
        """The result without its history, ready for JSON; of repeated contacts of a pair the first is listed."""
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


def simulate_three_spheres(
    stokes: float = 8.0,
    theta12: float = 45.0,
    theta23: float = 0.0,
    *,
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
    solver: str = "particles",
    overlap: float = 0.002,
    tolerance: float | None = None,
) -> Triplet:
    r"""Let sphere 1 strike sphere 2 of a resting pair 2-3; all spheres are equal and coated with a viscous film.

    Gaps and films are scaled with the film of the first pair, delta_12; sphere 1 flies along x.

    stokes            St_n = m* v_n0 / (6 pi eta R*^2), of the normal speed of impact [-]
    theta12           angle of the line of centres 1-2 at impact to the velocity, -90 < theta12 < 90 [deg]
    theta23           angle of the line of centres 2-3 to the velocity [deg]
    film_ratio        h_a = delta_12 over the diameter of the spheres [-]
    minimum_gap       h_m, gap at which solids touch, over delta_12 [-]
    capillary_number  Ca = 3 eta R* v_n0 / (sigma delta_12); infinite for no capillary force [-]
    friction          mu_f, of the solids [-]
    restitution       e_dry, of the solids [-]
    gap23             initial gap of the pair 2-3 over delta_12 [-]
    film23            film of the pair 2-3 over delta_12 [-]
    film13            film of the pair 1-3 over delta_12 [-]
    spheres           3, or 2 for a collision without sphere 3
    until             end, as the distance travelled at the speed of impact over the diameter [-]
    slowest_bounce    hard contacts slower than this fraction of v_n0 stay pressed together [-]
    solver            the "particles" engine with soft contacts, or "equations" in polar coordinates with hard ones
    overlap           of soft contacts: deepest overlap of an impact without a film, over the minimum gap [-]
    tolerance         of each step of the equations, relative; 1e-11 if not given [-]
    returns           :class:`Triplet`

    >>> simulate_three_spheres(stokes=2, theta12=45).outcome          # sphere 1 separates after it has met sphere 3
    'PA1'
    >>> simulate_three_spheres(stokes=3.5, theta12=45, capillary_number=100).outcome
    'FA'
    """
    _check(locals())
    films = (1.0, film23, film13)
    numbers = Numbers(
        float(stokes), film_ratio, minimum_gap, 4.0 / capillary_number, friction, restitution, films, slowest_bounce
    )
    one = math.radians(theta12)
    state = np.zeros(STATE)
    state[:4] = 1.0, one, 1.0, math.tan(one) / (1.0 / film_ratio + 1.0)
    state[4:6] = (gap23, math.radians(theta23)) if spheres == 3 else (1e3 / film_ratio, 0.5 * math.pi)  # out of reach
    gap13 = view(state, film_ratio, 2).gap
    if spheres == 3 and gap13 < minimum_gap:
        raise InputError("theta23", theta23, "such that sphere 3 does not overlap sphere 1")
    modes = np.array([JOINED, *(JOINED if gap <= film else APART for gap, film in zip((state[4], gap13), films[1:]))])

    diameters = math.cos(one) / film_ratio  # time v_n0 t / delta_12 over time v_10 t / diameter
    if solver == "equations":
        path = integrate(state, modes, numbers, until * diameters, tolerance)
    else:
        path = integrate_in_engine(state, numbers, until * diameters, overlap)
    events = tuple(
        Event(kind, PAIRS[pair], time, time / diameters, speed)
        for kind, pair, time, speed in path.events
        if kind != RELEASE
    )
    return Triplet(
        outcome=outcome_of(path.modes) if spheres == 3 else "FS" if path.modes[0] == APART else "FA",
        restitution12=path.parting_speed(0),
        restitution23=path.parting_speed(1),
        events=events,
        history=_history(path, diameters, film_ratio),
    )


def _check(given: Mapping[str, Any]) -> None:
    """Check the arguments of :func:`simulate_three_spheres`."""
    thinnest = min(1.0, given["film23"], given["film13"])
    limits = {
        "stokes": (lambda x: 1e-5 <= x < math.inf, "at least 1e-5 and finite"),
        "theta12": (lambda x: -90.0 < x < 90.0, "between -90 and 90 degrees"),
        "theta23": (lambda x: -180.0 <= x <= 180.0, "between -180 and 180 degrees"),
        "film_ratio": (lambda x: 0.0 < x <= 0.5, "above 0 and at most 0.5"),
        "minimum_gap": (lambda x: 0.0 < x < thinnest, "above 0 and below every film"),
        "capillary_number": (lambda x: x >= 0.01, "at least 0.01; infinite for no capillary force"),
        "friction": (lambda x: 0.0 <= x < math.inf, "at least 0 and finite"),
        "restitution": (lambda x: 0.0 <= x <= 1.0, "between 0 and 1"),
        "gap23": (lambda x: given["minimum_gap"] <= x < math.inf, "at least minimum_gap and finite"),
        "film23": (math.isfinite, "finite"),
        "film13": (math.isfinite, "finite"),
        "spheres": (lambda x: x in (2, 3), "2 or 3"),
        "until": (lambda x: 0.0 < x < math.inf, "above 0 and finite"),
        "slowest_bounce": (lambda x: 0.0 < x <= 0.01, "above 0 and at most 0.01"),
        "solver": (lambda x: x in SOLVERS, nearest(str(given["solver"]), SOLVERS)),
        "overlap": (lambda x: 0.0 < x <= 1.0, "above 0 and at most 1"),
        "tolerance": (lambda x: x is None or 1e-13 <= x <= 1e-3, "from 1e-13 to 1e-3"),
    }
    for name, (holds, limit) in limits.items():
        if not holds(given[name]):
            raise InputError(name, given[name], limit)


def outcome_of(modes: np.ndarray) -> str:
    """Outcome from the modes of the pairs 12, 23 and 13 at the end."""
    joined = [mode != APART for mode in modes]
    if sum(joined) != 1:
        return "FS" if not any(joined) else "FA"
    return ("PA3", "PA1", "PA2")[joined.index(True)]


def _history(path: Path, diameters: float, film_ratio: float) -> dict[str, np.ndarray]:
    """History by name; speeds over v_n0, angles in degrees, rates of turning and spins in v_n0/delta_12."""
    names = ("gap12", "angle12", "approach12", "turning12", "gap23", "angle23", "approach23", "turning23", "spin1",
             "spin2", "spin3")  # fmt: skip
    time = np.concatenate(path.times)
    columns = {"time": time, "time_star": time / diameters, **dict(zip(names, np.hstack(path.states)))}
    for pair in ("12", "23"):
        columns[f"angle{pair}"] = np.degrees(columns[f"angle{pair}"])
    apart = centres(columns, film_ratio)
    columns["gap13"] = (np.hypot(*(apart[:, 2] - apart[:, 0]).T) - 1.0) / film_ratio
    return columns


def centres(history: dict[str, np.ndarray], film_ratio: float) -> np.ndarray:
    """Positions of the three centres relative to the centre of mass, in diameters: (times, spheres, x and y)."""
    steps = []
    for pair in ("12", "23"):
        angle = np.radians(history[f"angle{pair}"])
        steps.append((1.0 + film_ratio * history[f"gap{pair}"])[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1))
    places = np.stack([np.zeros_like(steps[0]), steps[0], steps[0] + steps[1]], 1)
    return np.asarray(places - places.mean(1, keepdims=True))


def outcomes(stokes: Iterable[float], theta12: Iterable[float], **conditions: Any) -> dict[str, np.ndarray]:
    """Outcome and restitutions for every Stokes number (columns) at every angle (rows); large maps use all cores.

    stokes, theta12  values of the two axes
    conditions       further arguments of :func:`simulate_three_spheres`, the same for all. If not given, `solver` is
                     "equations" and `tolerance` 1e-8, which keeps restitutions to 1e-5
    returns          arrays "outcome", "restitution12", "restitution23" of shape (angles, Stokes numbers)

    >>> outcomes([2.0, 20.0], [45.0])["outcome"].tolist()
    [['PA1', 'FS']]
    """
    numbers, angles = list(stokes), list(theta12)
    conditions = {"tolerance": MAP_TOLERANCE, "solver": "equations"} | conditions
    jobs = -1 if len(numbers) * len(angles) >= PARALLEL_FROM else 1
    with safe_workers():
        table = Parallel(n_jobs=jobs)(delayed(_row)(numbers, angle, conditions) for angle in angles)
    names = ("outcome", "restitution12", "restitution23")
    return {name: np.array([[run[place] for run in row] for row in table]) for place, name in enumerate(names)}


def _row(stokes: list[float], theta12: float, conditions: dict[str, Any]) -> list[tuple[str, float, float]]:
    """Outcome and both restitutions at one angle."""
    runs = (simulate_three_spheres(number, theta12, **conditions) for number in stokes)
    return [(run.outcome, run.restitution12, run.restitution23) for run in runs]
