"""A wet impact on a wall in the particle engine: its contact, and a liquid bridge between a particle and a wall.

The bridge has the forces of :mod:`scenarios.references.wet_wall.motion` along the normal, as laws of the engine. What
the layer does along the wall is added between the steps.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.errors import RunFailed
from cfddem.case.materials import Material
from cfddem.particles.interactions.bridge_law import BridgeLaws, BridgePull
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures import capillary, timescales
from scenarios.references.wet_wall.motion import (
    BOUNCES,
    LONGEST,
    PHASES,
    Path,
    Toroid,
    Wet,
    film_along,
    pull,
    resistance,
    toroid_of,
    volume,
)

FILM_STEP = 2e-3
"""Way in a step where the solids are apart, over the layer or the gap, whichever is larger."""

SLOWEST = 0.02
"""Speed over that of impact below which the step in the liquid no longer grows."""

IMPACT_STEP = 0.005
"""Step in contact over the Hertz time."""

MOST_STEPS = 200_000


def _resistance(
    gap: float,
    reduced_radius: float,
    viscosity: float,
    surface_tension: float,
    capillary_number: float,
    half_filling_angle: float,
    density: float,
    smallest_gap: float,
) -> float:
    speed = capillary_number * surface_tension / viscosity
    return resistance(reduced_radius, gap, speed, half_filling_angle, viscosity, density, smallest_gap)


def _pull(
    gap: float,
    film: float,
    reduced_radius: float,
    surface_tension: float,
    contact_angle: float,
    half_filling_angle: float,
    smallest_arc: float,
    specific_weight: float,
) -> float:
    if gap < 0.0:
        return 0.0  # the liquid is pressed out of a contact
    toroid = Toroid(reduced_radius, film, half_filling_angle, contact_angle, smallest_arc)
    force = pull(toroid, surface_tension, reduced_radius + gap)
    return force + (specific_weight * volume(toroid, reduced_radius + gap) if gap > film else 0.0)


def _rupture(
    gap: float,
    film: float,
    reduced_radius: float,
    contact_angle: float,
    capillary_number: float,
    half_filling_angle: float,
    smallest_arc: float,
    length_from: float,
) -> float:
    toroid = Toroid(reduced_radius, film, half_filling_angle, contact_angle, smallest_arc)
    liquid = volume(toroid, reduced_radius + gap)
    return length_from + capillary.rupture_length(capillary_number, contact_angle, liquid)


def integrate(wet: Wet, solids: tuple[Material, Material], speed: float, along: float, spin: float) -> Path:
    """Move a sphere that arrives at the surface of the layer, or of a dry wall.

    solids  of the sphere and of the wall
    speed   towards the wall, > 0 [m/s]
    along   along the wall [m/s]
    spin    [rad/s]
    """
    run = _sphere(wet, solids, speed, along, spin)
    hertz = timescales.hertz_time(wet.mass, wet.stiffness, speed)
    times, rows, touched = [0.0], [_look(run)], math.inf
    while True:
        step = _step(wet, rows[-1], touched < math.inf, speed, hertz)
        _resist_along(wet, run, rows[-1], step)
        run.advance(step)
        times.append(run.time)
        rows.append(_look(run))
        gap, rate = rows[-1][0] - wet.radius, rows[-1][1]
        touched = min(touched, run.time) if gap < 0.0 else touched
        after = run.time - touched
        broken = after > 0.0 and gap > 0.0 and run.bridge_count == 0
        rests = after > 0.0 and (gap >= 0.0 > rate or (gap < 0.0 and after > BOUNCES * hertz))
        if broken or rests or run.time > LONGEST:
            return _path(wet, np.array(times), np.array(rows).T, stuck=not broken)
        if run.steps > MOST_STEPS:
            raise RunFailed(f"the sphere is still in the liquid after {MOST_STEPS} steps, at t = {run.time:.6g} s")


def _step(wet: Wet, row: tuple[float, ...], touched: bool, speed: float, hertz: float) -> float:
    """The next time step [s]: short in contact and just before it, else by the way in the liquid.

    touched  whether the solids have touched
    speed    of the impact [m/s]
    hertz    its Hertz time [s]
    """
    gap, rate = row[0] - wet.radius, row[1]
    way = FILM_STEP * max(gap, wet.film)
    near = gap < 0.0 if touched else gap <= 2.0 * way
    return IMPACT_STEP * hertz if near else way / max(abs(rate), SLOWEST * speed)


def _resist_along(wet: Wet, run: ParticleSolver, row: tuple[float, ...], step: float) -> None:
    """Give the sphere the impulse of the layer along the wall."""
    if 0.0 < row[0] - wet.radius <= wet.film:
        force, couple = film_along(wet, row[0], row[3], row[4])
        run.particles.velocity[0, 0] += step * force / wet.mass
        run.particles.spin[0, 1] -= step * couple / (0.4 * wet.mass * wet.radius**2)


def _sphere(wet: Wet, solids: tuple[Material, Material], speed: float, along: float, spin: float) -> ParticleSolver:
    """The sphere at the surface of the layer, above a wall that carries it."""
    pair = tuple(solid.model_copy(update={"friction": wet.friction}) for solid in solids)
    height = wet.radius + wet.film * (1.0 - 1e-9)
    sphere = make_particles(
        np.array([[0.0, 0.0, height]]), wet.radius, solids[0].density, velocity=np.array([[along, 0.0, -speed]])
    )
    sphere.spin[0, 1] = -spin
    liquid = BridgeLaws(
        viscosity=wet.viscosity,
        surface_tension=wet.surface_tension,
        contact_angle=wet.contact_angle,
        film=_resistance,
        pull=BridgePull(_pull),
        rupture=_rupture,
        wall_share=1.0,
        wall_film=wet.film,
        wall_patch=2.0 * wet.radius,
        parameters={
            "half_filling_angle": wet.half_filling_angle,
            "density": wet.liquid_density,
            "specific_weight": wet.liquid_density * wet.gravity,
            "smallest_gap": wet.smallest_gap,
            "smallest_arc": wet.smallest_arc,
            "length_from": wet.length_from,
        },
    )
    # the steps are chosen here: short in contact, long where only the liquid acts
    return ParticleSolver(
        sphere, pair_table(list(pair)), walls=[Plane(material=1)], laws=Laws(bridge=liquid if wet.film else None),
        gravity=(0.0, 0.0, -wet.gravity), settings=SolverSettings(check_steps=False),
    )  # fmt: skip


def _look(run: ParticleSolver) -> tuple[float, ...]:
    """Height and its rate, distance along the wall and its rate, spin, and spring of the contact."""
    body = run.particles
    x, _, z = body.position[0]
    u, _, w = body.velocity[0]
    return z, w, x, u, -float(body.spin[0, 1]), float(run.edges.spring.reshape(-1, 3)[:, 0].sum())


def _path(wet: Wet, time: np.ndarray, rows: np.ndarray, stuck: bool) -> Path:
    """The motion with its phases, and the energy that each kind of force has taken: by the heights at which it acts."""
    height, rate, _, along, spin, _ = rows
    gap = height - wet.radius
    touched = np.flatnonzero(gap < 0.0)
    first, last = (touched[0], touched[-1]) if len(touched) else (len(time), len(time))
    row = np.arange(len(time))
    phase = np.select([row < first, row <= last, gap <= wet.film], [1, 2, 3], 4)
    kinetic = 0.5 * (rate**2 + along**2) + 0.2 * (wet.radius * spin) ** 2
    fall, drawn = np.array([_conservative(wet, float(z)) for z in height]).T / wet.mass
    rise, pulled = np.diff(height), (phase[1:] != 2) & (phase[:-1] != 2)
    weight = 0.5 * (fall[1:] + fall[:-1]) * rise
    capillary = np.where(pulled, 0.5 * (drawn[1:] + drawn[:-1]) * rise, 0.0)
    rest = -np.diff(kinetic) - weight - capillary
    lost = (np.where(pulled, 0.0, rest), np.where(pulled, rest, 0.0), capillary, weight)
    energies = [np.append(0.0, np.cumsum(loss)) for loss in lost]
    ends = {PHASES[n - 1]: float(time[phase == n][-1]) for n in range(1, 5) if (phase == n).any()}
    return Path(time, np.vstack([rows, *energies]), phase, ends, stuck)


def _conservative(wet: Wet, height: float) -> tuple[float, float]:
    """Weight of the sphere and of the liquid that it lifts, and capillary pull [N]."""
    toroid, above = toroid_of(wet), max(height, wet.radius)
    lifted = wet.liquid_density * volume(toroid, above) if height > wet.radius + wet.film > wet.radius else 0.0
    return (wet.mass + lifted) * wet.gravity, pull(toroid, wet.surface_tension, above) if wet.film > 0.0 else 0.0
