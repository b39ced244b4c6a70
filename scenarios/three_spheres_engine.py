"""The same three wet spheres in the particle engine: Cartesian coordinates, soft contacts, films laid over in kicks.

The engine's spheres are larger by the minimum gap, so that its dry Hertz-Mindlin contact begins where the solids touch.
Before and after each step every pair of films gives its impulse, exactly for the pair alone, in one order and back.

>>> from scenarios.three_spheres_engine import simulate
>>> run = simulate(stokes=20, theta12=30, until=2.5)
>>> round(run.restitution12, 2), [(event.kind, event.pair) for event in run.events]
(0.77, [('contact', 12), ('separate', 12), ('contact', 23)])
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from cfddem.kernels import kernel
from cfddem.materials import Material, pair_table
from cfddem.particles.forces import Laws
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import bodies
from closures import contact, timescales
from closures.bridge import constant_capillary, davis_tangential, deforming_share
from closures.lubrication import film_strength
from scenarios.three_spheres import Event

DIAMETER, DENSITY, SPEED = 0.01, 2000.0, 1.0
"""Any will do: outcomes depend on dimensionless numbers alone [m, kg/m3, m/s]."""

FILM_STEP = 1e-3
"""Step where solids are apart, over delta_12 / v_n0."""

IMPACT_STEP = 0.02
"""Step in contact over the Hertz time."""

PAIRS = {12: (0, 1), 23: (1, 2), 13: (0, 2)}


@dataclass(frozen=True)
class SoftTriplet:
    """What came of three spheres in the engine, in the units of :func:`scenarios.three_spheres.simulate`."""

    restitution12: float
    restitution23: float
    events: tuple[Event, ...] = field(repr=False)
    history: dict[str, np.ndarray] = field(repr=False)  # time and gaps


def simulate(
    stokes: float,
    theta12: float,
    theta23: float = 0.0,
    film_ratio: float = 0.01,
    minimum_gap: float = 0.05,
    capillary_number: float = math.inf,
    friction: float = 0.0,
    restitution: float = 1.0,
    until: float = 5.0,
    overlap: float = 0.002,
) -> SoftTriplet:
    """Let sphere 1 strike sphere 2 of a resting pair 2-3 in the particle engine.

    overlap  deepest overlap of an impact without a film over the minimum gap: how soft the solids are [-]
    until    end, in delta_12 / v_n0 [-]

    The other arguments are those of :func:`scenarios.three_spheres.simulate`.
    """
    film = film_ratio * DIAMETER
    touch = minimum_gap * film
    run, viscosity = _spheres(stokes, theta12, theta23, film, touch, friction, restitution, overlap * touch)
    tension = 3.0 * viscosity * 0.25 * DIAMETER * SPEED / (film * capillary_number)
    stiffness = contact.hertz_stiffness(float(run.table[0, 0]["contact_modulus"]), 0.5 * float(run.bodies.radius[0]))
    reduced_mass = 0.5 * float(run.bodies.mass[0])
    short = IMPACT_STEP * timescales.hertz_time(reduced_mass, stiffness, SPEED)
    long = FILM_STEP * film / SPEED
    rows = [_look(run)]
    times, events = [0.0], []
    while run.time * SPEED / film < until:
        gap = rows[-1][:, 0] - touch
        step = short if (gap < 3.0 * long * np.maximum(rows[-1][:, 1], 0.1 * SPEED)).any() else long
        _films(*_arrays(run), viscosity, tension, film, 0.5 * DIAMETER, 0.5 * step)
        run.advance(step)
        _films(*_arrays(run), viscosity, tension, film, 0.5 * DIAMETER, 0.5 * step)
        rows.append(_look(run))
        times.append(run.time)
        for place, pair in enumerate(PAIRS):
            for kind, at, sign in (("contact", touch, 1.0), ("separate", film, -1.0), ("meet", film, 1.0)):
                before, after = (sign * (row[place, 0] - at) for row in rows[-2:])
                if before > 0.0 >= after:
                    share = before / (before - after)
                    moment = (times[-2] + share * (times[-1] - times[-2])) * SPEED / film
                    speed = abs((1.0 - share) * rows[-2][place, 1] + share * rows[-1][place, 1]) / SPEED
                    star = moment * film_ratio / math.cos(math.radians(theta12))
                    events.append(Event(kind, pair, float(moment), float(star), float(speed)))
    partings = {pair: next((e.speed for e in events if e.kind == "separate" and e.pair == pair), 0.0) for pair in PAIRS}
    gaps = np.array(rows)[:, :, 0] / film
    columns = {f"gap{pair}": gaps[:, place] for place, pair in enumerate(PAIRS)}
    return SoftTriplet(partings[12], partings[23], tuple(events), {"time": np.array(times) * SPEED / film, **columns})


def _spheres(
    stokes: float,
    theta12: float,
    theta23: float,
    film: float,
    minimum_gap: float,
    friction: float,
    restitution: float,
    overlap: float,
) -> tuple[ParticleSolver, float]:
    """The three spheres at the moment of impact, and the viscosity of their films."""
    mass = DENSITY * math.pi / 6.0 * DIAMETER**3
    radius = 0.5 * (DIAMETER + minimum_gap)
    stiffness = 1.25 * 0.5 * mass * SPEED**2 / overlap**2.5
    poisson = 0.3
    modulus = 0.75 * stiffness / math.sqrt(0.5 * radius) * 2.0 * (1.0 - poisson**2)
    density = mass / (4.0 / 3.0 * math.pi * radius**3)
    solid = Material(
        density=density, youngs_modulus=modulus, poisson=poisson, restitution=restitution, friction=friction
    )
    places, angle = np.zeros((3, 3)), np.radians([theta12, theta23])
    for sphere in (1, 2):
        turn = angle[sphere - 1]
        places[sphere] = places[sphere - 1] + (DIAMETER + film) * np.array([math.cos(turn), math.sin(turn), 0.0])
    velocity = np.zeros((3, 3))
    velocity[0, 0] = SPEED / math.cos(angle[0])
    three = bodies(places, radius, density, velocity=velocity)
    # steps follow the films, which are laid over the engine; apart, spheres take longer ones than a contact could
    run = ParticleSolver(three, pair_table([solid]), laws=Laws(film=False), check_steps=False)
    return run, 0.5 * mass * SPEED / (film_strength(1.0, 0.25 * DIAMETER) * stokes)


def _arrays(run: ParticleSolver) -> tuple[np.ndarray, ...]:
    state = run.bodies
    return state.position, state.velocity, state.spin, state.inverse_mass, state.inverse_inertia


def _look(run: ParticleSolver) -> np.ndarray:
    """Gap of the solids proper and approach speed of each pair."""
    seen = []
    for i, j in PAIRS.values():
        apart = run.bodies.position[j] - run.bodies.position[i]
        distance = float(np.linalg.norm(apart))
        seen.append((distance - DIAMETER, -float(apart @ (run.bodies.velocity[j] - run.bodies.velocity[i])) / distance))
    return np.array(seen)


@kernel
def _films(position, velocity, spin, inverse_mass, inverse_inertia, viscosity, tension, film, radius, span):
    """Impulses of the films of all pairs over a time: half of it in one order of pairs, half in the other."""
    count = len(position)
    normal, slip = np.empty(3), np.empty(3)
    pairs = count * (count - 1) // 2
    for turn in range(2 * pairs):
        number = turn if turn < pairs else 2 * pairs - 1 - turn
        i, j = 0, 1 + number
        while j >= count:
            i, j = i + 1, j - count + i + 2
        square = 0.0
        for axis in range(3):
            normal[axis] = position[j, axis] - position[i, axis]
            square += normal[axis] ** 2
        distance = math.sqrt(square)
        gap = distance - 2.0 * radius
        if gap >= film:
            continue
        reduced_radius, ease = 0.5 * radius, inverse_mass[i] + inverse_mass[j]
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
        push = -opening * -math.expm1(-0.5 * span * resistance * ease) / ease
        push -= 0.5 * span * constant_capillary(tension, reduced_radius)
        ease += radius**2 * (inverse_inertia[i] + inverse_inertia[j])
        drag = -math.expm1(-0.5 * span * davis_tangential(viscosity, reduced_radius, gap, film) * ease) / ease
        for axis in range(3):
            impulse = push * normal[axis] + drag * slip[axis]
            velocity[i, axis] -= inverse_mass[i] * impulse
            velocity[j, axis] += inverse_mass[j] * impulse
            following, last = (axis + 1) % 3, (axis + 2) % 3
            couple = radius * drag * (normal[following] * slip[last] - normal[last] * slip[following])
            spin[i, axis] -= inverse_inertia[i] * couple
            spin[j, axis] -= inverse_inertia[j] * couple
