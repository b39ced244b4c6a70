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

Spheres in the engine are larger by the minimum gap, so that dry contact begins where solids touch. The laws of the
bridges are those of Davis (2023) with this gap added.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
from joblib import Parallel, delayed
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError
from cfddem.backend.launch import safe_workers
from cfddem.case.materials import Material
from cfddem.case.settings import Settings, takes
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeFilm, BridgeLaws, BridgePull
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from closures import contact, timescales
from closures.bridge import constant_capillary, davis_tangential, deforming_potential, deforming_share
from closures.lubrication import film_strength
from scenarios.references.three_spheres.events import CONTACT, MEET, RELEASE, SEPARATE, Path, integrate
from scenarios.references.three_spheres.motion import APART, FIRST, JOINED, SECOND, SPINS, STATE, Numbers, view

PAIRS = (12, 23, 13)
OUTCOMES = ("FA", "PA1", "PA2", "PA3", "FS")
"""Full agglomeration; agglomeration of two spheres while sphere 1, 2 or 3 separates; full separation."""

UNTIL = 8.0
"""Default end, in diameters travelled at the speed of impact; the published sequences end by 6.1. Without a capillary
force every rotating pair separates in the end, so the outcome depends on when the simulation ends."""

SLOWEST_BOUNCE = 1e-4
"""Contacts slower than this fraction of the impact stay pressed together; 1e-3 to 2e-6 agree to 8 digits."""

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
        listed, listed_keys = [], set()
        for event in self.events:
            key = (event.kind, event.pair)
            if event.kind != "contact" or key not in listed_keys:
                listed.append(vars(event).copy())
            listed_keys.add(key)
        contacts = [event.pair for event in self.events if event.kind == "contact"]
        return {
            "outcome": self.outcome,
            "restitution12": self.restitution12,
            "restitution23": self.restitution23,
            "contacts": {str(pair): contacts.count(pair) for pair in PAIRS},
            "events": listed,
        }


class Collision(Settings):
    """Sphere 1 strikes sphere 2 of a resting pair 2-3; all spheres are equal and coated with a viscous film.

    Gaps and films are scaled with the film of the first pair, delta_12; sphere 1 flies along x.
    """

    by_place: ClassVar[int] = 3

    stokes: float = Field(8.0, ge=1e-5, description="St_n = m* v_n0 / (6 pi eta R*^2), of the normal impact speed [-]")
    theta12: float = Field(
        45.0, gt=-90, lt=90, description="angle of the line of centres 1-2 at impact to the velocity [deg]"
    )
    theta23: float = Field(0.0, ge=-180, le=180, description="angle of the line of centres 2-3 to the velocity [deg]")
    film_ratio: float = Field(0.01, gt=0, le=0.5, description="h_a = delta_12 over the diameter of the spheres [-]")
    minimum_gap: float = Field(0.05, gt=0, description="h_m, gap at which solids touch, over delta_12 [-]")
    capillary_number: float = Field(
        math.inf, ge=0.01, allow_inf_nan=True,
        description="Ca = 3 eta R* v_n0 / (sigma delta_12); infinite for no capillary force [-]",
    )  # fmt: skip
    friction: float = Field(0.0, ge=0, description="mu_f, of the solids [-]")
    restitution: float = Field(1.0, ge=0, le=1, description="e_dry, of the solids [-]")
    gap23: float = Field(1.0, description="initial gap of the pair 2-3 over delta_12 [-]")
    film23: float = Field(1.0, description="film of the pair 2-3 over delta_12 [-]")
    film13: float = Field(1.0, description="film of the pair 1-3 over delta_12 [-]")
    spheres: int = Field(3, ge=2, le=3, description="3, or 2 for a collision without sphere 3")
    until: float = Field(
        UNTIL, gt=0, description="end, as the distance travelled at the speed of impact over the diameter [-]"
    )
    slowest_bounce: float = Field(
        SLOWEST_BOUNCE, gt=0, le=0.01,
        description="hard contacts slower than this fraction of v_n0 stay pressed together [-]",
    )  # fmt: skip
    solver: Literal["particles", "equations"] = Field(
        "particles",
        description='the "particles" engine with soft contacts, or "equations" in polar coordinates with hard ones',
    )
    overlap: float = Field(
        0.002, gt=0, le=1,
        description="of soft contacts: deepest overlap of an impact without a film, over the minimum gap [-]",
    )  # fmt: skip
    tolerance: float | None = Field(
        None, ge=1e-13, le=1e-3, description="of each step of the equations, relative; 1e-11 if not given [-]"
    )

    @model_validator(mode="after")
    def _gaps_suit_films(self) -> Collision:
        if not self.minimum_gap < min(1.0, self.film23, self.film13):
            raise InputError("minimum_gap", self.minimum_gap, "below every film")
        if not self.gap23 >= self.minimum_gap:
            raise InputError("gap23", self.gap23, "at least minimum_gap")
        return self


@takes(Collision)
def simulate_three_spheres(collision: Collision) -> Triplet:
    """Let sphere 1 strike sphere 2 of a resting pair 2-3; all spheres are equal and coated with a viscous film.

    Gaps and films are scaled with the film of the first pair, delta_12; sphere 1 flies along x.

    >>> simulate_three_spheres(2, 45, solver="equations").outcome     # sphere 1 separates after it has met sphere 3
    'PA1'
    >>> simulate_three_spheres(3.5, 45, capillary_number=100, solver="equations").outcome
    'FA'
    """
    film_ratio, films, spheres = collision.film_ratio, (1.0, collision.film23, collision.film13), collision.spheres
    numbers = Numbers(
        collision.stokes, film_ratio, collision.minimum_gap, 4.0 / collision.capillary_number, collision.friction,
        collision.restitution, films, collision.slowest_bounce,
    )  # fmt: skip
    one = math.radians(collision.theta12)
    state = np.zeros(STATE)
    state[:4] = 1.0, one, 1.0, math.tan(one) / (1.0 / film_ratio + 1.0)
    out_of_reach = (1e3 / film_ratio, 0.5 * math.pi)
    state[4:6] = (collision.gap23, math.radians(collision.theta23)) if spheres == 3 else out_of_reach
    gap13 = view(state, film_ratio, 2).gap
    if spheres == 3 and gap13 < collision.minimum_gap:
        raise InputError("theta23", collision.theta23, "such that sphere 3 does not overlap sphere 1")
    modes = np.array([JOINED, *(JOINED if gap <= film else APART for gap, film in zip((state[4], gap13), films[1:]))])

    diameters = math.cos(one) / film_ratio  # time v_n0 t / delta_12 over time v_10 t / diameter
    if collision.solver == "equations":
        path = integrate(state, modes, numbers, collision.until * diameters, collision.tolerance)
    else:
        path = integrate_in_engine(state, numbers, collision.until * diameters, collision.overlap)
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


# ---------------------------------------------------------------- three spheres in the particle engine


DIAMETER, DENSITY, SPEED = 0.01, 2000.0, 1.0
"""Scales of the run; outcomes depend on dimensionless numbers only [m, kg/m3, m/s]."""

FILM_STEP, LONGEST_FILM_STEP = 1e-3, 0.05
"""Way in a step in a film over delta_12, and longest step there over delta_12 / v_n0."""

IMPACT_STEP = 0.005
"""Step in contact, over the Hertz time; with 0.02, contacts that stick are 0.3 % late."""

WARY = 0.03
"""Speed over v_n0 at which a pair in its film is expected to touch, where it is slower."""

RESTING, RESTING_STEP, RESTING_STEPS = 0.01, 0.1, 50
"""Speed over v_n0 below which solids count as pressed together; their step over the Hertz time, and steps at once."""

SLOWEST = 1e-5
"""Speed of a contact over v_n0 below which its step no longer grows."""

FLIGHT = 0.1
"""Longest step where films are apart: way at the speed of impact over the diameter."""


def _along(gap: float, film: float, viscosity: float, reduced_radius: float, touch: float) -> float:
    apart, strength = gap + touch, film_strength(viscosity, reduced_radius - 0.25 * touch)
    return strength * deforming_share(apart, film + touch) / apart


def _potential(gap: float, film: float, viscosity: float, reduced_radius: float, touch: float) -> float:
    strength = film_strength(viscosity, reduced_radius - 0.25 * touch)
    return strength * deforming_potential(gap + touch, film + touch)


def _sideways(gap: float, film: float, viscosity: float, reduced_radius: float, touch: float) -> float:
    return davis_tangential(viscosity, reduced_radius - 0.25 * touch, gap + touch, film + touch)


def _pull(gap: float, film: float, surface_tension: float, reduced_radius: float, touch: float) -> float:
    return constant_capillary(surface_tension, reduced_radius - 0.25 * touch) if gap < film else 0.0


def integrate_in_engine(state: np.ndarray, numbers: Numbers, until: float, overlap: float) -> Path:
    """Integrate to the end in the particle engine.

    state    at the start, as in :mod:`scenarios.references.three_spheres.motion`
    until    end, in delta_12 / v_n0 [-]
    overlap  deepest overlap of an impact without a film over the minimum gap: how soft the solids are [-]
    """
    film = numbers.film_ratio * DIAMETER
    touch, films = numbers.minimum_gap * film, film * np.array(numbers.films)
    run = _spheres(state, numbers, overlap * touch, films)
    path, pairs = Path(state.copy(), np.full(3, APART)), _pairs(run)
    pairs[:, 0] = np.where(pairs[:, 0] < films + 1e-9 * film, np.minimum(pairs[:, 0], films), pairs[:, 0])  # rounding
    times, states, end = [0.0], [_polar(run, film)], until * film / SPEED
    while run.time < end * (1.0 - 1e-12):
        steps, spans = zip(*(_step(run, pair, touch, reach, film) for pair, reach in zip(pairs, films)))
        step = min(*steps, end - run.time)
        run.advance(step, max(1, int(min(*spans, end - run.time) / step)))
        _release(run)
        before, pairs = pairs, _pairs(run)
        times.append(run.time * SPEED / film)
        states.append(_polar(run, film))
        _find_events(path, times[-2:], (before, pairs), touch, films)
    columns = np.array(states).T
    columns[[1, 5]] = np.unwrap(columns[[1, 5]], axis=1)  # angles
    path.times, path.states = [np.array(times)], [columns]
    path.time, path.state = times[-1], columns[:, -1]
    path.modes[:] = np.where(pairs[:, 0] <= films, JOINED, APART)
    return path


def _step(run: ParticleSolver, pair: np.ndarray, touch: float, reach: float, film: float) -> tuple[float, float]:
    """Longest time step that a pair allows, and the longest time without a look at it [s].

    pair   see `_pairs`
    touch  minimum gap [m]
    reach  thickness of the film of the pair [m]
    film   that of the first pair [m]
    """
    (gap, approach, speed), unit = pair.tolist(), film / SPEED
    if gap > reach:  # in flight nothing changes, up to just before the films can meet
        step = min(FLIGHT * DIAMETER / SPEED, max(FILM_STEP * unit, (gap - reach) / max(speed, 1e-9 * SPEED)))
        return step, step
    stiffness = contact.hertz_stiffness(float(run.table[0, 0]["contact_modulus"]), 0.5 * float(run.particles.radius[0]))
    reduced_mass, overlap = 0.5 * float(run.particles.mass[0]), max(touch - gap, 0.0)
    # speed of the impact that leads to this state of a contact
    impact = math.sqrt(0.8 * stiffness / reduced_mass * overlap**2.5 + approach**2)
    hertz = timescales.hertz_time(reduced_mass, stiffness, max(impact, SLOWEST * SPEED))
    rests = impact < RESTING * SPEED
    short = (RESTING_STEP if rests else IMPACT_STEP) * hertz
    span = RESTING_STEPS * short if rests else short
    if overlap > 0.0:
        return short, span
    fast = max(abs(approach), WARY * SPEED)
    way = min(FILM_STEP * film / fast, LONGEST_FILM_STEP * unit, 0.5 * (gap - touch) / fast)
    return max(short, way), max(span, way)


def _spheres(state: np.ndarray, numbers: Numbers, overlap: float, films: np.ndarray) -> ParticleSolver:
    """The spheres at the moment of impact, with films that add up to those of the pairs."""
    mass, film = DENSITY * math.pi / 6.0 * DIAMETER**3, numbers.film_ratio * DIAMETER
    radius = 0.5 * (DIAMETER + numbers.minimum_gap * film)
    stiffness = 1.25 * 0.5 * mass * SPEED**2 / overlap**2.5
    poisson = 0.3
    solid = Material(
        density=mass / (4.0 / 3.0 * math.pi * radius**3),
        youngs_modulus=0.75 * stiffness / math.sqrt(0.5 * radius) * 2.0 * (1.0 - poisson**2),
        poisson=poisson,
        restitution=numbers.restitution,
        friction=numbers.friction,
    )
    places, angles = np.zeros((3, 3)), state[[1, 5]]
    for sphere, (angle, gap) in enumerate(zip(angles, state[[0, 4]]), start=1):
        direction = np.array([math.cos(angle), math.sin(angle), 0.0])
        places[sphere] = places[sphere - 1] + (DIAMETER + gap * film) * direction
    velocity = np.zeros((3, 3))
    velocity[0, 0] = SPEED / math.cos(angles[0])
    spheres = make_particles(places, radius, solid.density, velocity=velocity)
    touch = numbers.minimum_gap * film
    own = 0.5 * (np.array([[1, -1, 1], [1, 1, -1], [-1, 1, 1]]) @ (films - touch))  # of each sphere
    if own.min() < 0.0:
        limit = "films that three coated spheres can have: none above the sum of the others"
        raise InputError("films of the pairs", str(tuple(numbers.films)), limit, 'use solver="equations"')
    coat(spheres, own)
    viscosity = 0.5 * mass * SPEED / (film_strength(1.0, 0.25 * DIAMETER) * numbers.stokes)
    laws = BridgeLaws(
        viscosity=viscosity,
        surface_tension=0.75 * viscosity * 0.25 * DIAMETER * SPEED * numbers.pull / film,
        film=BridgeFilm(_along, _potential),
        cut="constant",
        tangential=_sideways,
        pull=BridgePull(_pull) if numbers.pull > 0.0 else "none",
        rupture="film",
        share="none",
        parameters={"touch": touch},
    )
    # the steps are chosen here: short in contact, long where only films act
    return ParticleSolver(
        spheres, pair_table([solid]), laws=Laws(bridge=laws), settings=SolverSettings(check_steps=False)
    )


def _release(run: ParticleSolver) -> None:
    """Release the tangential springs of contacts whose slip has turned back.

    Hard contacts that stick end without slip. Mindlin's spring gives slip back after it has stopped it, in a share that
    does not fall with the softness of the solids.
    """
    particles, edges = run.particles, run.edges
    for pair in np.flatnonzero(edges.spring[: edges.between_particles].any(axis=1)):
        first, second, spring = edges.first[pair], edges.second[pair], edges.spring[pair]
        normal = particles.position[first] - particles.position[second]
        surface = particles.radius[[first, second]] @ particles.spin[[first, second]] / np.linalg.norm(normal)
        slip = particles.velocity[first] - particles.velocity[second] - np.cross(surface, normal)
        if spring @ slip < 0.0:  # springs lie across the normal
            spring[:] = 0.0


def _pairs(run: ParticleSolver) -> np.ndarray:
    """Gap between the solids [m], approach speed and relative speed in all directions [m/s] of each pair (3, 3)."""
    position, velocity = run.particles.position, run.particles.velocity
    apart, opening = position[SECOND] - position[FIRST], velocity[SECOND] - velocity[FIRST]
    distance = np.sqrt((apart * apart).sum(axis=1))
    approach = -(apart * opening).sum(axis=1) / distance
    return np.stack([distance - DIAMETER, approach, np.sqrt((opening * opening).sum(axis=1))], axis=1)


def _polar(run: ParticleSolver, film: float) -> np.ndarray:
    """State of the spheres in the polar coordinates of the pairs."""
    state, rate = np.empty(STATE), film / SPEED
    position, velocity = run.particles.position, run.particles.velocity
    for pair, at in ((0, 0), (1, 4)):
        apart, opening = position[pair + 1] - position[pair], velocity[pair + 1] - velocity[pair]
        distance = math.hypot(apart[0], apart[1])
        turning = (apart[0] * opening[1] - apart[1] * opening[0]) / distance**2
        approach = -(apart[0] * opening[0] + apart[1] * opening[1]) / distance
        gap, angle = (distance - DIAMETER) / film, math.atan2(apart[1], apart[0])
        state[at : at + 4] = gap, angle, approach / SPEED, turning * rate
    state[SPINS:] = run.particles.spin[:, 2] * rate
    return state


def _find_events(
    path: Path, times: list[float], pairs: tuple[np.ndarray, np.ndarray], touch: float, films: np.ndarray
) -> None:
    """Add the events between the last two steps, by linear interpolation."""
    for pair in range(3):
        for kind, at, sign in ((CONTACT, touch, 1.0), (SEPARATE, films[pair], -1.0), (MEET, films[pair], 1.0)):
            before, after = (sign * (state[pair, 0] - at) for state in pairs)
            if before > 0.0 >= after:
                share = before / (before - after)
                speed = abs((1.0 - share) * pairs[0][pair, 1] + share * pairs[1][pair, 1]) / SPEED
                path.events.append((kind, pair, float(times[0] + share * (times[1] - times[0])), float(speed)))
