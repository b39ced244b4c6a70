"""One sphere on a floor or a plate: it falls on a spring, slides until it rolls, and strikes obliquely."""

from __future__ import annotations

import math

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.interactions.contacts.linear import LINEAR
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures import contact

GRAVITY = 9.81
DOWN = (0.0, 0.0, -GRAVITY)

BALL_RADIUS, BALL_DENSITY, DROP_HEIGHT = 0.1, 2600.0, 0.5
"""Sphere of MFIX DEM01 and DEM02, and the height of its centre at the start."""


def drop(stiffness: float, restitution: float, until: float, samples: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Let the sphere of DEM01 and DEM02 fall onto a linear spring.

    stiffness  k_n [N/m]
    until      end of the record [s]
    returns    time [s] and height of the centre [m]
    """
    ball = Material(density=BALL_DENSITY, youngs_modulus=1e9, poisson=0.3, restitution=restitution)
    sphere = make_particles([[0.0, 0.0, DROP_HEIGHT]], BALL_RADIUS, BALL_DENSITY)
    run = ParticleSolver(
        sphere,
        pair_table([ball]),
        walls=[Plane()],
        laws=Laws(contact=LINEAR.with_parameters(normal_stiffness=stiffness, tangential_stiffness=stiffness)),
        gravity=DOWN,
        skin=3.0 * DROP_HEIGHT,
    )
    whole = math.ceil(until / samples / (0.02 * math.pi * math.sqrt(float(sphere.mass[0]) / stiffness)))
    time, height = [0.0], [DROP_HEIGHT]
    for _ in range(samples):
        run.advance(until / samples / whole, whole)
        time.append(run.time)
        height.append(float(run.particles.position[0, 2]))
    return np.array(time), np.array(height)


def drop_exactly(stiffness: float, restitution: float, time: np.ndarray) -> np.ndarray:
    """Height of the same sphere from the solution of its damped oscillator, flight by flight (n,) [m]."""
    mass = BALL_DENSITY * 4.0 / 3.0 * math.pi * BALL_RADIUS**3
    rate = math.sqrt(stiffness / mass)
    ratio = -math.log(restitution) / math.hypot(math.pi, math.log(restitution))
    swing = rate * math.sqrt(1.0 - ratio**2)
    rest = GRAVITY / rate**2
    height = np.empty_like(time)
    begin, start, speed, flying = 0.0, DROP_HEIGHT - BALL_RADIUS, 0.0, True
    while begin <= time[-1]:
        ago = time - begin
        if flying:  # from height `start` above touch, with upward speed
            lasts = (speed + math.sqrt(speed**2 + 2.0 * GRAVITY * start)) / GRAVITY
            path = BALL_RADIUS + start + speed * ago - 0.5 * GRAVITY * ago**2
            speed -= GRAVITY * lasts
        else:
            sine = (-speed - ratio * rate * rest) / swing

            def overlap(t: np.ndarray | float, sine: float = sine) -> np.ndarray:
                decay = np.exp(-ratio * rate * np.asarray(t))
                return rest + decay * (-rest * np.cos(swing * np.asarray(t)) + sine * np.sin(swing * np.asarray(t)))

            path = BALL_RADIUS - overlap(ago)
            fine = np.linspace(1e-6, 3.0 * math.pi / swing, 200_001)
            apart = overlap(fine) <= 0.0
            lasts = float(fine[np.argmax(apart)]) if apart.any() else math.inf
            if not apart.any():
                height[ago >= 0.0] = path[ago >= 0.0]
                break
            speed = float((overlap(lasts - 1e-6 / rate) - overlap(lasts)) / (1e-6 / rate))
            start = 0.0
        here = ago >= 0.0
        height[here] = path[here]
        begin, flying = begin + lasts, not flying
    return height


def slide(friction: float, linear: bool = False, keep: float = 0.05) -> dict[str, float]:
    """MFIX DEM04: a sphere that lies on a floor is pushed to 0.1 m/s, slides, and rolls.

    linear   by linear springs instead of Hertz and Mindlin
    keep     time to follow the rolling sphere [s]
    returns  time at which sliding ends over u0/(mu g), then speed and spin over their first values at the end
             of sliding and after `keep`
    """
    radius, density, speed = 0.5e-3, 1e4, 0.1
    ball = Material(density=density, youngs_modulus=1e9, poisson=0.3, restitution=0.8, friction=friction)
    table = pair_table([ball])
    weight = density * 4.0 / 3.0 * math.pi * radius**3 * GRAVITY
    stiffness = 1e4
    hertz = contact.hertz_stiffness(float(table[0, 0]["contact_modulus"]), radius)
    overlap = weight / stiffness if linear else (weight / hertz) ** (2.0 / 3.0)
    laws = (
        Laws(contact=LINEAR.with_parameters(normal_stiffness=stiffness, tangential_stiffness=stiffness))
        if linear
        else Laws()
    )
    sphere = make_particles([[0.0, 0.0, radius - overlap]], radius, density, velocity=[speed, 0.0, 0.0])
    run = ParticleSolver(sphere, table, walls=[Plane()], laws=laws, gravity=DOWN)
    step = 0.5 * run.time_scales(0.001).recommended
    slid = False
    while True:  # sliding begins where friction reaches Coulomb's limit, and ends where it falls below
        run.advance(step)
        pull, press = float(run.particles.force[0, 0]), float(run.particles.force[0, 2]) + weight
        sliding = abs(pull) > (1.0 - 1e-6) * friction * press
        if slid and not sliding:
            break
        slid = slid or sliding
    found = {"time": run.time * friction * GRAVITY / speed}
    for when, steps in (("end of sliding", 0), ("rolling", max(1, int(keep / step)))):
        run.advance(step, steps)
        found[f"speed, {when}"] = float(run.particles.velocity[0, 0]) / speed
        found[f"spin, {when}"] = float(run.particles.spin[0, 1]) * radius / speed
    return found


def strike(angle: float, linear: bool = False) -> dict[str, float]:
    """Kharaz et al. (2001): 5 mm aluminium oxide at 3.9 m/s on thick glass.

    angle   of impact, from the normal [deg]
    linear  by the linear springs of MFIX DEM05 instead of Hertz and Mindlin
    """
    alumina = Material(density=4000, youngs_modulus=380e9, poisson=0.23, friction=0.092, restitution=0.98)
    glass = Material(density=2500, youngs_modulus=70e9, poisson=0.25, friction=0.092, restitution=0.98)
    radius = 2.5e-3
    down, along = 3.9 * math.cos(math.radians(angle)), 3.9 * math.sin(math.radians(angle))
    table = pair_table([alumina, glass])
    sphere = make_particles([[0.0, 0.0, radius]], radius, alumina.density, velocity=[along, 0.0, -down])
    laws = (
        Laws(contact=LINEAR.with_parameters(normal_stiffness=1.72e7, tangential_stiffness=1.48e7)) if linear else Laws()
    )
    run = ParticleSolver(sphere, table, walls=[Plane(material=1)], laws=laws, skin=radius)
    step = run.time_scales(down).hertz
    while not (run.time > 10 * step and run.gap[0] > 0.0):
        run.advance(step)
    x, _, z = run.particles.velocity[0]
    return {
        "e_t": float(x) / along,
        "omega_out [rad/s]": float(run.particles.spin[0, 1]),
        "com_rebound_angle [deg]": math.degrees(math.atan2(x, z)),
    }
