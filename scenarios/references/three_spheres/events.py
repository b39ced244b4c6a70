"""Three wet spheres from event to event: films meet and separate; solids touch, press together and let go.

`scipy.integrate.solve_ivp` integrates each segment between two events and locates the event that ends it.

A pair that is pressed together bounces ever faster. No contact is missed, because a segment starts just above the
gap at which the contact is detected. Contacts slower than a limit end in a constraint that holds the pair at the
minimum gap until the contact force becomes tensile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from cfddem.backend.errors import RunFailed
from scenarios.references.ode import ABSOLUTE, METHOD, RELATIVE, event
from scenarios.references.three_spheres.motion import (
    APART,
    JOINED,
    RESTING,
    Numbers,
    View,
    forces,
    observe,
    rates_of,
    strike,
    view,
)

TOUCH = 1e-10
"""Solids touch where the gap exceeds the minimum gap by less than this, over the film."""

STILL = 1e-12
"""Slower relative motion counts as rest."""

RIM = 1e-13
"""Films separate this much farther out than they meet, and solids touch this much below the minimum gap, so that an
event is not found again where the next segment starts; over the film of the first pair."""

TENSILE = 1e-12
"""Tension at which solids pressed together separate, over the viscous force of the first pair."""

FIRST_STEP = 1e-2
STRIDE = 0.1
"""Longest step: distance that the striker travels at its speed of impact, over the diameter."""

MOST_SEGMENTS = 50_000

GAP, APPROACH, FORCE = 0, 1, 2
"""Rows of `motion.observe`."""

KINDS = ("contact", "meet", "separate", "release", "closest")
CONTACT, MEET, SEPARATE, RELEASE, CLOSEST = KINDS
"""Kinds of events. A release ends a resting contact; at a closest approach only the gap is checked."""


@dataclass
class Path:
    """The motion up to a time, and its events."""

    state: np.ndarray
    modes: np.ndarray
    time: float = 0.0
    events: list[tuple[str, int, float, float]] = field(default_factory=list)  # kind, pair, time, speed
    times: list[np.ndarray] = field(default_factory=list)
    states: list[np.ndarray] = field(default_factory=list)  # (11, n) each

    def parting_speed(self, pair: int) -> float:
        """Speed at which the films of a pair separated for the first time; 0 where they did not."""
        return next((speed for kind, which, _, speed in self.events if (kind, which) == (SEPARATE, pair)), 0.0)


def integrate(
    state: np.ndarray, modes: np.ndarray, numbers: Numbers, until: float, tolerance: float | None = None
) -> Path:
    """Integrate to the end, from event to event.

    tolerance  of each step, relative; the default keeps times of events to 1e-8
    """
    path = Path(state.copy(), modes.copy())
    _record(path, np.array([0.0]), path.state[:, None])
    speed = max(
        1.0,
        *(
            math.hypot(pair_view.approach, pair_view.distance * pair_view.turning)
            for pair_view in _views(path, numbers)
        ),
    )
    longest = STRIDE / (numbers.film_ratio * speed)
    for _ in range(MOST_SEGMENTS):
        if path.time >= until or _flies_apart(path, numbers, until - path.time):
            return path
        _release(path, numbers)
        segment = _segment(path, numbers, until, longest, tolerance or RELATIVE)
        _record(path, segment.t[1:], segment.y[:, 1:])
        path.time, path.state = float(segment.t[-1]), segment.y[:, -1].copy()
        if segment.status == 1:
            kind, pair = next(
                watched for watched, times in zip(segment.watched, segment.t_events) if _ended(watched, times)
            )
            _happen(path, numbers, kind, pair)
            _record(path, np.array([path.time]), path.state[:, None])
    raise RunFailed(
        f"three spheres at St = {numbers.stokes:.6g} cannot be followed beyond t = {path.time:.6g}; "
        "try a larger slowest_bounce"
    )


def _ended(watched: tuple[str, int], times: np.ndarray) -> bool:
    """Whether an event ended the segment."""
    return watched[0] != CLOSEST and len(times) > 0


def _segment(path: Path, numbers: Numbers, until: float, longest: float, tolerance: float) -> Any:
    """Integrate to the next event; the result also lists the watched events as (kind, pair)."""
    watched, flat = _watched(path, numbers), numbers.flat()
    while True:
        segment = solve_ivp(
            lambda _, state: rates_of(state, path.modes, flat),
            (path.time, until),
            path.state,
            METHOD,
            events=list(watched.values()),
            rtol=tolerance,
            atol=ABSOLUTE / RELATIVE * tolerance,
            first_step=min(FIRST_STEP, longest, until - path.time),
            max_step=longest,
        )
        if segment.status < 0:
            raise RunFailed(
                f"three spheres at St = {numbers.stokes:.6g} stopped at t = {segment.t[-1]:.6g}: {segment.message}"
            )
        missed = _missed(segment, watched, path, numbers)
        if missed is None:
            segment.watched = list(watched)
            return segment
        until = missed


def _watched(path: Path, numbers: Numbers) -> dict[tuple[str, int], Any]:
    """Events that can happen to the pairs in their present modes."""
    watched: dict[tuple[str, int], Any] = {}
    flat, last = numbers.flat(), (None, np.zeros((3, 3)))

    def seen(state: Any) -> np.ndarray:
        nonlocal last
        if last[0] is not state:  # all events are asked for the same state in turn
            last = state, observe(state, path.modes, flat)
        return last[1]

    for pair, (mode, film) in enumerate(zip(path.modes, numbers.films)):

        def beyond(at: float, pair: int = pair) -> Any:
            return lambda _, state: seen(state)[GAP, pair] - at

        def approach(_: float, state: Any, pair: int = pair) -> float:
            return float(seen(state)[APPROACH, pair])

        def pressed(_: float, state: Any, pair: int = pair) -> float:
            return float(seen(state)[FORCE, pair]) + TENSILE

        if mode == RESTING:
            watched[RELEASE, pair] = event(pressed, -1)
            continue
        if mode == APART:
            watched[MEET, pair] = event(beyond(film), -1)
        else:
            now = float(seen(path.state)[GAP, pair])
            watched[CONTACT, pair] = event(beyond(min(numbers.minimum_gap, now) - RIM), -1)
            watched[SEPARATE, pair] = event(beyond(max(film, now) + RIM), 1)
        watched[CLOSEST, pair] = event(approach, -1, terminal=False)
    return watched


def _missed(segment: Any, watched: dict[tuple[str, int], Any], path: Path, numbers: Numbers) -> float | None:
    """Time of the first closest approach at which a pair passed an event undetected within one step."""
    times = []
    for (kind, pair), at, states in zip(watched, segment.t_events, segment.y_events):
        if kind != CLOSEST or not len(at):
            continue
        least = numbers.films[pair] if path.modes[pair] == APART else numbers.minimum_gap
        gaps = np.array([view(state, numbers.film_ratio, pair).gap for state in states])
        times += [time for time, gap in zip(at, gaps) if gap < least - TOUCH and path.time < time < segment.t[-1]]
    return min(times, default=None)


def _happen(path: Path, numbers: Numbers, kind: str, pair: int) -> None:
    """Apply an event and the contacts that follow from it immediately."""
    pair_view = view(path.state, numbers.film_ratio, pair)
    if kind == CONTACT:
        _place(path, pair, numbers.minimum_gap)
        if pair_view.approach > STILL:
            path.events.append((kind, pair, path.time, pair_view.approach))
        _touch(path, numbers, pair, pair_view.approach)
    elif kind == RELEASE:
        path.modes[pair] = JOINED
    else:
        _place(path, pair, numbers.films[pair])
        path.modes[pair] = JOINED if kind == MEET else APART
        path.events.append((kind, pair, path.time, abs(pair_view.approach)))
    _touch_others(path, numbers)


def _touch(path: Path, numbers: Numbers, pair: int, speed: float) -> None:
    """A hard contact, or one so slow that the pair stays pressed together."""
    rests = speed <= numbers.slowest_bounce
    strike(path.state, numbers, pair, 0.0 if rests else numbers.restitution)
    path.modes[pair] = RESTING if rests else JOINED
    if rests and pair < 2:
        path.state[4 * pair + 2] = 0.0


def _touch_others(path: Path, numbers: Numbers) -> None:
    """Apply the contacts that follow immediately from an impulse, until none is left."""
    for _ in range(300):
        still = True
        for pair in range(3):
            mode, pair_view = path.modes[pair], view(path.state, numbers.film_ratio, pair)
            resting, speed = mode == RESTING, pair_view.approach
            touching = resting or (mode == JOINED and pair_view.gap - numbers.minimum_gap < TOUCH)
            if touching and (speed > STILL or (resting and -numbers.slowest_bounce < speed < -STILL)):
                if not resting:
                    path.events.append((CONTACT, pair, path.time, speed))
                _touch(path, numbers, pair, speed)
                still = False
            elif resting and speed < -STILL:
                path.modes[pair] = JOINED
        if still:
            return


def _release(path: Path, numbers: Numbers) -> None:
    """Let go of pairs whose contact force would be tensile, the largest first."""
    while (path.modes == RESTING).any():
        contact = np.where(path.modes == RESTING, forces(path.state, path.modes, numbers)[2], math.inf)
        if contact.min() >= -TENSILE:
            return
        path.modes[int(contact.argmin())] = JOINED


def _flies_apart(path: Path, numbers: Numbers, remaining: float) -> bool:
    """Whether all films are apart and free flight brings no two spheres together in the time that remains."""
    if (path.modes != APART).any():
        return False
    for pair_view, film in zip(_views(path, numbers), numbers.films):
        across = pair_view.distance * pair_view.turning
        speed, reach = math.hypot(pair_view.approach, across), 1.0 / numbers.film_ratio + film
        passes = pair_view.distance * abs(across) >= reach * speed
        if pair_view.approach > 0.0 and not passes and pair_view.distance - reach < speed * remaining:
            return False
    return True


def _views(path: Path, numbers: Numbers) -> list[View]:
    return [view(path.state, numbers.film_ratio, pair) for pair in range(3)]


def _place(path: Path, pair: int, gap: float) -> None:
    """Set the gap of a pair to the exact value that it has reached within rounding."""
    if pair < 2:
        path.state[4 * pair] = gap


def _record(path: Path, times: np.ndarray, states: np.ndarray) -> None:
    path.times.append(times.copy())
    path.states.append(states.copy())
