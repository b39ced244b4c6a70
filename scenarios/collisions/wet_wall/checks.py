"""An independent second solution of a wet impact, for comparison."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from scipy.integrate import solve_ivp

from scenarios.collisions.ode import event

SPHERES = {  # radius, density, E, nu, e
    "glass_1.74": (0.87e-3, 2500.0, 63e9, 0.23, 0.96),
    "glass_0.91": (0.455e-3, 2500.0, 63e9, 0.23, 0.96),
    "alumina_1.74": (0.87e-3, 1040.0, 14.5e9, 0.25, 0.76),
}
LIQUIDS = {  # density, viscosity, surface tension
    "water": (998.0, 1e-3, 72.8e-3),
    "tween": (998.0, 1e-3, 37.3e-3),
    "glycerol_35": (1086.0, 3e-3, 69.61e-3),
    "glycerol_51": (1130.0, 6.7e-3, 68.2e-3),
}


def independent(
    sphere: str, liquid: str, film: float, phi: float, v0: float, angle: float, omega: float, mu: float
) -> tuple[float, float, float]:
    """Restitution, tangential restitution and spin, from an independent implementation of the equations.

    Buck et al. (2018), eqs (5) to (43), with the signs of Goldman, Cox & Brenner (1967), the gap as height less
    radius, capillary force in phases I, III and IV, and the length of the bridge from the surface of the layer.
    Solved by DOP853 to 1e-12, phase by phase; the package takes LSODA and the laws of `closures`.
    """
    R, rho, E, nu, e = SPHERES[sphere]
    rho_l, eta, sigma = LIQUIDS[liquid]
    phi, theta = math.radians(phi), math.radians(15.0)
    m, beta = rho * 4.0 / 3.0 * math.pi * R**3, phi + theta
    E_star = 1.0 / ((1.0 - nu**2) / E + (1.0 - 0.23**2) / 63e9)
    G, G_wall = E / (2.0 * (1.0 + nu)), 63e9 / (2.0 * 1.23)
    G_star = 1.0 / ((2.0 - nu) / G + (2.0 - 0.23) / G_wall)
    k = 4.0 / 3.0 * E_star * math.sqrt(R)
    alpha = -math.log(e) * math.sqrt(5.0 / (math.log(e) ** 2 + math.pi**2))
    r_c = R * math.sin(phi)

    def toroid(y: float) -> tuple[float, float, float]:
        z = y - R * math.cos(phi) - film
        r_m = z / (1.0 + math.cos(beta))
        return z, r_m, r_c + r_m * (math.sin(beta) - 1.0)

    def bridge_volume(y: float) -> float:
        z, r_m, r_a = toroid(y)
        c = math.pi - beta
        v1 = math.pi * (r_a + r_m) ** 2 * z
        v2 = r_m**2 / 2 * c * 2 * math.pi * (r_a + r_m - 4 * r_m * math.sin(c / 2) ** 2 / (3 * c))
        v3 = r_m**2 / 2 * math.sin(beta) * math.cos(beta) * 2 * math.pi * (r_c + 2 / 3 * r_m * math.sin(beta))
        cap = R * (1.0 - math.cos(phi))
        return v1 - v2 - v3 - math.pi / 3.0 * cap**2 * (3.0 * R - cap)

    def liquid_forces(y: float, v: float) -> float:
        Re = 2.0 * r_c * abs(v) * rho_l / eta
        drag = 6.0 * math.pi * eta * r_c * v * (1.0 + Re / (4.0 * (1.0 + math.sqrt(Re))) + Re / 60.0)
        wall = 6.0 * math.pi * eta * R**2 * v / max(y - R, 0.5e-6)
        _, r_m, r_a = toroid(max(y, R))
        tension = 2.0 * math.pi * sigma * r_c * math.sin(beta)
        return -max(drag, wall, key=abs) - tension - math.pi * r_c**2 * sigma * (1.0 / r_m - 1.0 / r_a)

    def outside(t: float, s: Any) -> list[float]:
        y, v, vt, w, _ = s
        mass = m + (rho_l * bridge_volume(y) if y > R + film else 0.0)
        normal = liquid_forces(y, v) - mass * 9.81
        force = moment = 0.0
        if y <= R + film:
            ln = math.log(R / max(y - R, 0.5e-6))
            force = -6 * math.pi * eta * R * ((8 / 15 * ln + 0.9588) * vt + (2 / 15 * ln - 0.2526) * w * R)
            moment = -8 * math.pi * eta * R**2 * ((ln / 10 - 0.1895) * vt + (2 / 5 * ln + 0.3817) * w * R)
        return [v, normal / m, force / m, moment / (0.4 * m * R**2), 0.0]

    def inside(t: float, s: Any) -> list[float]:
        y, v, vt, w, slid = s
        d = max(R - y, 0.0)
        gamma = alpha * math.sqrt(m * k) * d**0.25
        normal = k * d**1.5 - gamma * v
        force = -(8.0 * G_star * math.sqrt(R * d) * slid + gamma * (vt + w * R))
        if abs(force) > mu * abs(normal):
            force = mu * normal * math.copysign(1.0, force)
        return [v, normal / m - 9.81, force / m, force * R / (0.4 * m * R**2), vt + w * R]

    def stop(distance: Callable[[Any], float], direction: int) -> Any:
        return event(lambda _, state: distance(state), direction)

    def length_left(s: Any) -> float:
        stretched = (1.0 + theta / 2.0) * (1.0 + math.sqrt(eta * max(s[1], 0.0) / sigma))
        return float(stretched * bridge_volume(s[0]) ** (1.0 / 3.0) - (s[0] - R - film))

    s = [R + film, -v0, v0 * math.tan(math.radians(angle)), omega, 0.0]
    stages = [
        (outside, stop(lambda s: s[0] - R, -1)),
        (inside, stop(lambda s: s[0] - R, 1)),
        (outside, stop(lambda s: s[0] - R - film, 1)),
        (outside, stop(length_left, -1)),
    ]
    for part, (rate, end) in enumerate(stages):
        events = [end] if part < 2 else [end, stop(lambda s: s[1], -1)]
        run = solve_ivp(rate, (0.0, 1.0), s, "DOP853", rtol=1e-12, atol=1e-14, events=events, first_step=1e-10)
        s = run.y[:, -1]
        if not len(run.t_events[0]):
            return 0.0, math.nan, math.nan
        s[0] = {0: R, 1: R, 2: R + film}.get(part, s[0]) + (1e-16 if part == 2 else 0.0)
    return s[1] / v0, s[2] / (v0 * math.tan(math.radians(angle))) if angle else math.nan, s[3]
