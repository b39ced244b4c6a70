"""Two wet spheres in the particle engine: Cartesian coordinates, its contact model, and a liquid bridge."""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.errors import RunFailed
from cfddem.case.materials import Material
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from closures import timescales
from closures.contact import hertz_stiffness
from scenarios.references.wet_pair import Motion, Pair

FILM_STEP = 1e-3
"""Step where the solids are apart, over the time in which the pair crosses the film at its present speed."""

SLOWEST = 0.02
"""Speed over that of impact below which the step in the film no longer grows."""

IMPACT_STEP = 0.01
"""Step in contact over the Hertz time."""

MOST_STEPS = 2_000_000


def integrate(pair: Pair, liquid: BridgeLaws, solid: Material, angle: float, duration: float) -> Motion:
    """Integrate in the particle engine until the bridge has ruptured or the time is over.

    liquid    laws of the bridge
    angle     between velocity and line of centres at impact [deg]
    duration  [s]
    """
    apart = 2.0 * pair.radius + pair.film * (1.0 - 1e-9)
    velocity = [[pair.speed, -pair.speed * math.tan(math.radians(angle)), 0.0], [0.0, 0.0, 0.0]]
    two = make_particles(
        np.array([[0.0, 0.0, 0.0], [apart, 0.0, 0.0]]), pair.radius, solid.density, velocity=np.array(velocity)
    )
    coat(two, 0.5 * pair.film)
    # the steps are chosen here: they follow the film, whose resistance changes as it opens and closes
    run = ParticleSolver(two, pair_table([solid]), laws=Laws(bridge=liquid), check_steps=False)
    bridges = run.feature(Bridges)
    stiffness = hertz_stiffness(pair.modulus, 0.5 * pair.radius)
    short = IMPACT_STEP * timescales.hertz_time(0.5 * pair.mass, stiffness, pair.speed)
    times, rows = [0.0], [_look(run)]
    while bridges.count and run.time < duration:
        gap, _, approach, *_ = rows[-1]
        long = FILM_STEP * pair.film / max(abs(approach), SLOWEST * pair.speed)
        run.advance(short if gap < 2.0 * long * abs(approach) else long)
        times.append(run.time)
        rows.append(_look(run))
        if run.steps > MOST_STEPS:
            raise RunFailed(f"the pair is still in its film after {MOST_STEPS} steps, at t = {run.time:.6g} s")
    return Motion(bridges.count == 0, np.array(times), *np.array(rows).T)


def _look(run: ParticleSolver) -> tuple[float, float, float, float, float]:
    """Gap [m], angle turned [rad], approach speed [m/s], rate of turning and spin [rad/s] of the pair."""
    body = run.particles
    x, y, _ = body.position[1] - body.position[0]
    u, v, _ = body.velocity[1] - body.velocity[0]
    distance = math.hypot(x, y)
    gap = distance - float(body.radius.sum())
    return gap, math.atan2(y, x), -(x * u + y * v) / distance, (x * v - y * u) / distance**2, float(body.spin[0, 2])
