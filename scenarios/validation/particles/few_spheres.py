r"""One sphere with a known motion, and the exact resistance of two that move across their line of centres.

The recurrences of Jeffrey & Onishi, J. Fluid Mech. 139 (1984) 261, with the corrections of Townsend (2018),
arXiv:1802.08226. A resistance function is a series in x = 2/s = (R1 + R2)/r whose coefficients tend to those of its
singular terms, which are summed in closed form.
"""

from __future__ import annotations

import math
from functools import cache
from math import comb
from typing import NamedTuple

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.interactions.contacts.linear import LINEAR
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures import contact

TERMS = 120
"""Terms of each series."""

_CHOOSE = np.array([[float(comb(n + s, n + 1)) for s in range(TERMS + 2)] for n in range(TERMS + 2)])


class Resistance(NamedTuple):
    """Resistance functions of two spheres, all over those of the first sphere alone; lambda = R2/R1.

    Signs are such that each is positive where the film acts alone: a force or couple on the first sphere against
    a motion.
    """

    force_by_own: float  # Y^A_11, over 6 pi eta R1
    force_by_other: float  # -Y^A_12
    couple_by_own: float  # -Y^B_11, over 4 pi eta R1^2
    couple_by_other: float  # Y^B_12
    turn_by_own: float  # Y^C_11, over 8 pi eta R1^3
    turn_by_other: float  # Y^C_12


def leading(ratio: float) -> Resistance:
    """Coefficients of ln(1/xi) in these functions, J&O (4.16), (5.6) and (7.10)."""
    force = 4.0 / 15.0 * ratio * (2.0 + ratio + 2.0 * ratio**2) / (1.0 + ratio) ** 3
    couple = 0.2 * ratio * (4.0 + ratio) / (1.0 + ratio) ** 2
    return Resistance(force, force, couple, couple, 0.4 * ratio / (1.0 + ratio), 0.1 * ratio**2 / (1.0 + ratio))


def following(ratio: float) -> Resistance:
    """Coefficients of xi ln(1/xi), J&O (4.16), (5.6) and (7.10), the last as corrected by Townsend (30)."""
    powers = ratio ** np.arange(5)
    force = 2.0 / 375.0 * float(powers @ [16, -45, 58, -45, 16]) / (1.0 + ratio) ** 3
    couple = float(powers @ [32, -33, 83, 43, 0]) / (250.0 * (1.0 + ratio) ** 2)
    own = float(powers @ [8, 6, 33, 0, 0]) / (125.0 * (1.0 + ratio))
    other = ratio * float(powers @ [43, -24, 43, 0, 0]) / (500.0 * (1.0 + ratio))
    return Resistance(force, force, couple, couple, own, other)


def resistance(gap: float, ratio: float = 1.0) -> Resistance:
    """Exact resistance functions.

    gap    xi, surface to surface over the mean radius [-]
    ratio  lambda, radius of the second sphere over that of the first [-]
    """
    x = 2.0 / (2.0 + gap)
    series = _series(ratio)
    odd = (False, True, True, False, False, True)
    return Resistance(*(
        _summed(terms, x, is_odd, first, second)
        for terms, is_odd, first, second in zip(series, odd, leading(ratio), following(ratio))
    ))  # fmt: skip


def _summed(terms: np.ndarray, x: float, odd: bool, first: float, second: float) -> float:
    """Sum of the odd or even terms, singular parts in closed form."""
    m = np.arange(1 if odd else 2, TERMS, 2)
    own = 2.0 / m
    next_own = own - np.where(m > 2, 2.0 / np.maximum(m - 2, 1), 0.0)
    rest = terms[m] - first * own - second * next_own
    logarithm = np.log((1.0 + x) / (1.0 - x)) if odd else -np.log(1.0 - x * x)
    singular = (first + second * (1.0 - x * x)) * logarithm
    return float((0.0 if odd else terms[0]) + singular + rest @ x**m)


@cache
def _series(ratio: float) -> tuple[np.ndarray, ...]:
    """Coefficients of x^m of the six functions, each (TERMS,)."""
    m = np.arange(TERMS)
    of_force, _ = _coefficients(False)
    _, of_force_turn = _coefficients(False)
    _, of_turn = _coefficients(True)
    weights = np.array([[ratio**q / (1.0 + ratio) ** k if q <= k else 0.0 for q in m] for k in m])
    force = np.array([of_force[k - m[: k + 1], m[: k + 1]] @ weights[k, : k + 1] for k in m])
    couple = np.array([2.0 * of_force_turn[k - m[: k + 1], m[: k + 1]] @ weights[k, : k + 1] for k in m])
    turn = np.array([of_turn[k - m[: k + 1], m[: k + 1]] @ weights[k, : k + 1] * ratio ** (k % 2) for k in m])
    return force, force, -couple, -couple, turn, turn


@cache
def _coefficients(turning: bool) -> tuple[np.ndarray, np.ndarray]:
    """P_1pq and Q_1pq, J&O (4.6) to (4.11) and (7.3) to (7.5), V as Townsend (18) (TERMS, TERMS).

    turning  a sphere turns; else it moves
    """
    # the last places of each axis stay empty: negative indices find zeros there
    p_, v_, q_ = (np.zeros((TERMS + 4,) * 3) for _ in range(3))
    for k in range(TERMS):
        for p in range(k + 1):
            _fill(p_, v_, q_, p, k - p, turning)
    return p_[1, :TERMS, :TERMS], q_[1, :TERMS, :TERMS]


def _fill(p_: np.ndarray, v_: np.ndarray, q_: np.ndarray, p: int, q: int, turning: bool) -> None:
    """Find P, V and Q of all n at p and q from those of smaller p + q."""
    if p + q == 0:
        q_[1, 0, 0] = float(turning)
        p_[1, 0, 0] = v_[1, 0, 0] = float(not turning)
        return
    n, s = np.arange(1.0, p + 2)[:, None], np.arange(1.0, q + 1)[None, :]
    m, t = n.astype(int), s.astype(int)
    choose = _CHOOSE[m, t]
    near, next_near = p_[t, q - t, p - m + 1], p_[t, q - t, p - m - 1]
    first = (2 * n + 1) / (2 * (n + 1)) * (3 * (n + s) - (n * s + 1) * (2 * n * s - s - n + 2))
    terms = first / (s * (n + s) * (2 * s - 1)) * near + n * (2 * n - 1) / (2 * (n + 1)) * next_near
    terms += n * (4 * n**2 - 1) / (2 * (n + 1) * (2 * s + 1)) * v_[t, q - t - 2, p - m + 1]
    terms -= 2 * (4 * n**2 - 1) / (3 * (n + 1)) * q_[t, q - t - 1, p - m + 1]
    sums = (choose * terms).sum(axis=1)
    rest = (choose * next_near).sum(axis=1)
    turned = choose * (s / (n + 1) * q_[t, q - t - 1, p - m] - 3 / (2 * n * s * (n + 1)) * p_[t, q - t, p - m])
    p_[m[:, 0], p, q] = sums
    v_[m[:, 0], p, q] = sums + 2 * n[:, 0] / ((n[:, 0] + 1) * (2 * n[:, 0] + 3)) * rest
    q_[m[:, 0], p, q] = turned.sum(axis=1)


# ---------------------------------------------------------------- one sphere


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
        settings=SolverSettings(skin=3.0 * DROP_HEIGHT),
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
    numbers = {"time": run.time * friction * GRAVITY / speed}
    for when, steps in (("end of sliding", 0), ("rolling", max(1, int(keep / step)))):
        run.advance(step, steps)
        numbers[f"speed, {when}"] = float(run.particles.velocity[0, 0]) / speed
        numbers[f"spin, {when}"] = float(run.particles.spin[0, 1]) * radius / speed
    return numbers


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
    run = ParticleSolver(sphere, table, walls=[Plane(material=1)], laws=laws, settings=SolverSettings(skin=radius))
    step = run.time_scales(down).hertz
    while not (run.time > 10 * step and run.gap[0] > 0.0):
        run.advance(step)
    x, _, z = run.particles.velocity[0]
    return {
        "e_t": float(x) / along,
        "omega_out [rad/s]": float(run.particles.spin[0, 1]),
        "com_rebound_angle [deg]": math.degrees(math.atan2(x, z)),
    }
