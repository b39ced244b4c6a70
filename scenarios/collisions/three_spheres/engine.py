"""Three wet spheres in the particle engine: Cartesian coordinates, soft Hertz-Mindlin contacts, and liquid bridges.

Spheres in the engine are larger by the minimum gap, so that dry contact begins where solids touch. The laws of the
bridges are those of Davis (2023) with this gap added.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeFilm, BridgeLaws, BridgePull
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from closures import contact, timescales
from closures.bridge import constant_capillary, davis_tangential, deforming_potential, deforming_share
from closures.lubrication import film_strength
from scenarios.references.three_spheres.events import CONTACT, MEET, SEPARATE, Path
from scenarios.references.three_spheres.motion import APART, FIRST, JOINED, SECOND, SPINS, STATE, Numbers

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


def integrate(state: np.ndarray, numbers: Numbers, until: float, overlap: float) -> Path:
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
    return ParticleSolver(spheres, pair_table([solid]), laws=Laws(bridge=laws), check_steps=False)


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
            before, after = (sign * (each[pair, 0] - at) for each in pairs)
            if before > 0.0 >= after:
                share = before / (before - after)
                speed = abs((1.0 - share) * pairs[0][pair, 1] + share * pairs[1][pair, 1]) / SPEED
                path.events.append((kind, pair, float(times[0] + share * (times[1] - times[0])), float(speed)))
