"""Three wet spheres in the particle engine: Cartesian coordinates, soft Hertz-Mindlin contacts, films as impulses.

Spheres in the engine are larger by the minimum gap, so that dry contact begins where solids touch. Before and after
each step, every pair with joined films receives the impulse of its film, exact for an isolated pair. Pairs are treated
in one order and then in reverse.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import serial
from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from closures import contact, timescales
from closures.bridge import constant_capillary, davis_tangential, deforming_share
from closures.lubrication import film_strength
from scenarios.collisions.three_spheres.events import CONTACT, MEET, SEPARATE, Path
from scenarios.collisions.three_spheres.motion import APART, FIRST, JOINED, SECOND, SPINS, STATE, Numbers

DIAMETER, DENSITY, SPEED = 0.01, 2000.0, 1.0
"""Scales of the run; outcomes depend on dimensionless numbers only [m, kg/m3, m/s]."""

FILM_STEP = 1e-3
"""Step where no solids touch, over delta_12 / v_n0."""

IMPACT_STEP = 0.02
"""Step in contact, over the Hertz time."""


def follow(state: np.ndarray, numbers: Numbers, until: float, overlap: float) -> Path:
    """Integrate to the end in the particle engine.

    state    at the start, as in :mod:`scenarios.collisions.three_spheres.motion`
    until    end, in delta_12 / v_n0 [-]
    overlap  deepest overlap of an impact without a film over the minimum gap: how soft the solids are [-]
    """
    film = numbers.film_ratio * DIAMETER
    touch, films = numbers.minimum_gap * film, film * np.array(numbers.films)
    run, viscosity = _spheres(state, numbers, overlap * touch)
    tension = 0.75 * viscosity * 0.25 * DIAMETER * SPEED * numbers.pull / film
    stiffness = contact.hertz_stiffness(float(run.table[0, 0]["contact_modulus"]), 0.5 * float(run.particles.radius[0]))
    reduced_mass = 0.5 * float(run.particles.mass[0])
    short, long = IMPACT_STEP * timescales.hertz_time(reduced_mass, stiffness, SPEED), FILM_STEP * film / SPEED
    body = run.particles
    arrays = body.position, body.velocity, body.spin, body.inverse_mass, body.inverse_inertia
    path, pairs = Path(state.copy(), np.full(3, APART)), _pairs(run)
    times, states = [0.0], [_polar(run, film)]
    while run.time * SPEED / film < until:
        near = pairs[:, 0] - touch < 3.0 * long * np.maximum(pairs[:, 1], 0.1 * SPEED)
        step = short if near.any() else long
        _apply_films(*arrays, viscosity, tension, films, 0.5 * DIAMETER, 0.5 * step)
        run.advance(step)
        _apply_films(*arrays, viscosity, tension, films, 0.5 * DIAMETER, 0.5 * step)
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


def _spheres(state: np.ndarray, numbers: Numbers, overlap: float) -> tuple[ParticleSolver, float]:
    """The spheres at the moment of impact, and the viscosity of their films."""
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
    # the steps are chosen here: short in contact, long where only films act
    run = ParticleSolver(spheres, pair_table([solid]), laws=Laws(film=False), check_steps=False)
    return run, 0.5 * mass * SPEED / (film_strength(1.0, 0.25 * DIAMETER) * numbers.stokes)


def _pairs(run: ParticleSolver) -> np.ndarray:
    """Gap between the solids [m] and approach speed [m/s] of each pair (3, 2)."""
    position, velocity = run.particles.position, run.particles.velocity
    apart, opening = position[SECOND] - position[FIRST], velocity[SECOND] - velocity[FIRST]
    distance = np.linalg.norm(apart, axis=1)
    return np.stack([distance - DIAMETER, -(apart * opening).sum(axis=1) / distance], axis=1)


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
                path.events.append((kind, pair, times[0] + share * (times[1] - times[0]), float(speed)))


@serial
def _apply_films(position, velocity, spin, inverse_mass, inverse_inertia, viscosity, tension, films, radius, span):
    """Apply the impulses of the films of all pairs over a time: half of it in one order of pairs, half in reverse."""
    normal, slip = np.empty(3), np.empty(3)
    for turn in range(6):
        pair = turn if turn < 3 else 5 - turn
        i, j, film = FIRST[pair], SECOND[pair], films[pair]
        square = 0.0
        for axis in range(3):
            normal[axis] = position[j, axis] - position[i, axis]
            square += normal[axis] ** 2
        distance = math.sqrt(square)
        gap = distance - 2.0 * radius
        if gap >= film:
            continue
        reduced_radius, mobility = 0.5 * radius, inverse_mass[i] + inverse_mass[j]
        opening = 0.0
        for axis in range(3):
            normal[axis] /= distance
            opening += (velocity[j, axis] - velocity[i, axis]) * normal[axis]
        for axis in range(3):
            following, last = (axis + 1) % 3, (axis + 2) % 3
            turning = spin[i, following] * normal[last] - spin[i, last] * normal[following]
            turning += spin[j, following] * normal[last] - spin[j, last] * normal[following]
            slip[axis] = velocity[i, axis] - velocity[j, axis] + opening * normal[axis] + radius * turning
        resistance = film_strength(viscosity, reduced_radius) * deforming_share(gap, film) / gap
        push = -opening * -math.expm1(-0.5 * span * resistance * mobility) / mobility
        push -= 0.5 * span * constant_capillary(tension, reduced_radius)
        mobility += radius**2 * (inverse_inertia[i] + inverse_inertia[j])
        sliding = davis_tangential(viscosity, reduced_radius, gap, film)
        drag = -math.expm1(-0.5 * span * sliding * mobility) / mobility
        for axis in range(3):
            impulse = push * normal[axis] + drag * slip[axis]
            velocity[i, axis] -= inverse_mass[i] * impulse
            velocity[j, axis] += inverse_mass[j] * impulse
            following, last = (axis + 1) % 3, (axis + 2) % 3
            couple = radius * drag * (normal[following] * slip[last] - normal[last] * slip[following])
            spin[i, axis] -= inverse_inertia[i] * couple
            spin[j, axis] -= inverse_inertia[j] * couple
