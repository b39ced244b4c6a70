"""The same two wet spheres in the particle engine: Cartesian coordinates, its contact, a liquid bridge between them.

>>> from scenarios.wet_pair_engine import simulate
>>> run = simulate(stokes=2.0, angle=45.0)
>>> run.parted, round(run.restitution, 2)
(True, 0.53)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from cfddem.errors import RunFailed
from cfddem.materials import Material, pair_table
from cfddem.particles.bridge_loops import BRIDGE_FILMS, CUTS, PULLS, TANGENTIALS, BridgeLaws
from cfddem.particles.bridges import Bridges
from cfddem.particles.forces import Laws
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import bodies
from closures import contact, timescales
from closures.lubrication import film_strength
from scenarios.wet_pair import TRANSITION_PRESSURES

FILM_STEP = 1e-3
"""Step where solids are apart, over the time in which the film is crossed at the present speed."""

SLOWEST = 0.02
"""Speed, over that of impact, below which the step of the film does not grow any more."""

IMPACT_STEP = 0.01
"""Step in contact over the Hertz time."""

MOST_STEPS = 2_000_000


@dataclass(frozen=True)
class EnginePair:
    """What came of two wet spheres in the engine; see :class:`scenarios.wet_pair.WetPair`."""

    parted: bool
    restitution: float  # normal speed of parting over that of impact; 0 where the pair has not parted [-]
    spin: float  # of each sphere [rad/s]
    separation_time: float | None  # [s]
    minimum_gap: float  # [m]
    turned: float  # by the line of centres [deg]
    time: np.ndarray = field(repr=False)  # [s]
    gap: np.ndarray = field(repr=False)  # at these times [m]


def simulate(
    stokes: float,
    angle: float = 0.0,
    bridge: str = "deforming",
    cut: str = "zero",
    tangential: str | None = "davis",
    friction: float = 0.0,
    capillary: bool = False,
    film: float = 270e-6,
    viscosity: float = 10.0,
    radius: float = 12.7e-3,
    density: float = 7960.0,
    youngs_modulus: float = 2.0e11,
    poisson: float = 0.35,
    restitution: float = 0.9,
    surface_tension: float = 0.0205,
    duration: float = 1.0,
) -> EnginePair:
    """Let one wet sphere strike an equal one that rests; arguments as of :func:`scenarios.wet_pair.collide_wet`."""
    mass = density * 4.0 / 3.0 * math.pi * radius**3
    speed = stokes * film_strength(viscosity, 0.5 * radius) / (0.5 * mass)
    steel = Material(
        density=density, youngs_modulus=youngs_modulus, poisson=poisson, restitution=restitution, friction=friction
    )
    liquid = BridgeLaws(
        viscosity=viscosity,
        surface_tension=surface_tension,
        film=BRIDGE_FILMS[bridge],
        cut=CUTS[cut],
        tangential=TANGENTIALS[tangential or "none"],
        pull=PULLS["constant" if capillary else "none"],
        transition_pressure=TRANSITION_PRESSURES[bridge, cut],
    )
    apart = 2.0 * radius + film * (1.0 - 1e-9)
    velocity = [[speed, -speed * math.tan(math.radians(angle)), 0.0], [0.0, 0.0, 0.0]]
    two = bodies(np.array([[0.0, 0.0, 0.0], [apart, 0.0, 0.0]]), radius, density, velocity=np.array(velocity))
    bridges = Bridges(two, 0.5 * film, liquid)
    # steps follow the film, which is stiffer or softer than a contact as it opens and closes
    run = ParticleSolver(two, pair_table([steel]), laws=Laws(), bridges=bridges, check_steps=False)
    return _follow(run, bridges, speed, film, duration)


def _follow(run: ParticleSolver, bridges: Bridges, speed: float, film: float, duration: float) -> EnginePair:
    """March until the bridge has broken or the time is over."""
    stiffness = contact.hertz_stiffness(float(run.table[0, 0]["contact_modulus"]), 0.5 * float(run.bodies.radius[0]))
    short = IMPACT_STEP * timescales.hertz_time(0.5 * float(run.bodies.mass[0]), stiffness, speed)
    minimum_gap = float(bridges.joined.minimum_gap[0])
    times, gaps = [0.0], [film]
    gap, approach, _ = _look(run)
    while bridges.count and run.time < duration:
        long = FILM_STEP * film / max(abs(approach), SLOWEST * speed)
        run.advance(short if gap < 2.0 * long * abs(approach) else long)
        gap, approach, turned = _look(run)
        times.append(run.time)
        gaps.append(gap)
        if run.steps > MOST_STEPS:
            raise RunFailed(f"the pair is still in its film after {MOST_STEPS} steps, at t = {run.time:.6g} s")
    parted = bridges.count == 0
    return EnginePair(
        parted=parted,
        restitution=-approach / speed if parted else 0.0,
        spin=float(run.bodies.spin[0, 2]),
        separation_time=run.time if parted else None,
        minimum_gap=minimum_gap,
        turned=turned,
        time=np.array(times),
        gap=np.array(gaps),
    )


def _look(run: ParticleSolver) -> tuple[float, float, float]:
    """Gap [m], approach speed [m/s] and how far the line of centres has turned [deg]."""
    apart = run.bodies.position[1] - run.bodies.position[0]
    distance = float(np.linalg.norm(apart))
    closing = -float(apart @ (run.bodies.velocity[1] - run.bodies.velocity[0])) / distance
    return distance - float(run.bodies.radius.sum()), closing, math.degrees(math.atan2(apart[1], apart[0]))
