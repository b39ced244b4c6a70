"""An independent second solution of a wet impact on a wall, for comparison.

The equations are those of Buck et al. (2018), eqs (5) to (43), with the signs of Goldman, Cox & Brenner (1967). The gap
is height less radius. The capillary force acts in phases I, III and IV. The length of the bridge counts from the
surface of the layer. Nothing of `closures` is used. The state is height, velocity, tangential velocity, spin and
tangential displacement.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from scipy.integrate import solve_ivp

from scenarios.references.ode import event

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


class SecondSolution:
    """The constants of an impact and its equations; symbols are those of the paper."""

    def __init__(self, sphere: str, liquid: str, film: float, phi: float, mu: float) -> None:
        self.R, rho, E, nu, e = SPHERES[sphere]
        self.rho_l, self.eta, self.sigma = LIQUIDS[liquid]
        self.film, self.mu, self.phi, self.theta = film, mu, math.radians(phi), math.radians(15.0)
        self.beta = self.phi + self.theta
        self.m = rho * 4.0 / 3.0 * math.pi * self.R**3
        E_star = 1.0 / ((1.0 - nu**2) / E + (1.0 - 0.23**2) / 63e9)
        G, G_wall = E / (2.0 * (1.0 + nu)), 63e9 / (2.0 * 1.23)
        self.G_star = 1.0 / ((2.0 - nu) / G + (2.0 - 0.23) / G_wall)
        self.k = 4.0 / 3.0 * E_star * math.sqrt(self.R)
        self.alpha = -math.log(e) * math.sqrt(5.0 / (math.log(e) ** 2 + math.pi**2))
        self.r_c = self.R * math.sin(self.phi)

    def toroid(self, y: float) -> tuple[float, float, float]:
        """Length, radius of the arc and radius of the neck of the bridge."""
        z = y - self.R * math.cos(self.phi) - self.film
        r_m = z / (1.0 + math.cos(self.beta))
        return z, r_m, self.r_c + r_m * (math.sin(self.beta) - 1.0)

    def bridge_volume(self, y: float) -> float:
        """Volume of liquid in the bridge."""
        z, r_m, r_a = self.toroid(y)
        beta, c = self.beta, math.pi - self.beta
        v1 = math.pi * (r_a + r_m) ** 2 * z
        v2 = r_m**2 / 2 * c * 2 * math.pi * (r_a + r_m - 4 * r_m * math.sin(c / 2) ** 2 / (3 * c))
        v3 = r_m**2 / 2 * math.sin(beta) * math.cos(beta) * 2 * math.pi * (self.r_c + 2 / 3 * r_m * math.sin(beta))
        cap = self.R * (1.0 - math.cos(self.phi))
        return v1 - v2 - v3 - math.pi / 3.0 * cap**2 * (3.0 * self.R - cap)

    def liquid_forces(self, y: float, v: float) -> float:
        """Drag or film, surface tension, and capillary pressure."""
        r_c, R = self.r_c, self.R
        Re = 2.0 * r_c * abs(v) * self.rho_l / self.eta
        drag = 6.0 * math.pi * self.eta * r_c * v * (1.0 + Re / (4.0 * (1.0 + math.sqrt(Re))) + Re / 60.0)
        wall = 6.0 * math.pi * self.eta * R**2 * v / max(y - R, 0.5e-6)
        _, r_m, r_a = self.toroid(max(y, R))
        tension = 2.0 * math.pi * self.sigma * r_c * math.sin(self.beta)
        return -max(drag, wall, key=abs) - tension - math.pi * r_c**2 * self.sigma * (1.0 / r_m - 1.0 / r_a)

    def outside(self, t: float, s: Any) -> list[float]:
        """Rates of change while the solids are apart."""
        y, v, vt, w, _ = s
        R, eta, m = self.R, self.eta, self.m
        mass = m + (self.rho_l * self.bridge_volume(y) if y > R + self.film else 0.0)
        normal = self.liquid_forces(y, v) - mass * 9.81
        force = moment = 0.0
        if y <= R + self.film:
            ln = math.log(R / max(y - R, 0.5e-6))
            force = -6 * math.pi * eta * R * ((8 / 15 * ln + 0.9588) * vt + (2 / 15 * ln - 0.2526) * w * R)
            moment = -8 * math.pi * eta * R**2 * ((ln / 10 - 0.1895) * vt + (2 / 5 * ln + 0.3817) * w * R)
        return [v, normal / m, force / m, moment / (0.4 * m * R**2), 0.0]

    def inside(self, t: float, s: Any) -> list[float]:
        """Rates of change while the solids touch."""
        y, v, vt, w, slid = s
        R, m = self.R, self.m
        d = max(R - y, 0.0)
        gamma = self.alpha * math.sqrt(m * self.k) * d**0.25
        normal = self.k * d**1.5 - gamma * v
        force = -(8.0 * self.G_star * math.sqrt(R * d) * slid + gamma * (vt + w * R))
        if abs(force) > self.mu * abs(normal):
            force = self.mu * normal * math.copysign(1.0, force)
        return [v, normal / m - 9.81, force / m, force * R / (0.4 * m * R**2), vt + w * R]

    def length_left(self, s: Any) -> float:
        """Length by which the bridge can still be stretched."""
        stretched = (1.0 + self.theta / 2.0) * (1.0 + math.sqrt(self.eta * max(s[1], 0.0) / self.sigma))
        return float(stretched * self.bridge_volume(s[0]) ** (1.0 / 3.0) - (s[0] - self.R - self.film))


def independent(
    sphere: str, liquid: str, film: float, phi: float, v0: float, angle: float, omega: float, mu: float
) -> tuple[float, float, float]:
    """Restitution, tangential restitution and spin; solved by DOP853 to 1e-12, phase by phase."""
    impact = SecondSolution(sphere, liquid, film, phi, mu)
    R = impact.R

    def stop(distance: Callable[[Any], float], direction: int) -> Any:
        return event(lambda _, state: distance(state), direction)

    s = [R + film, -v0, v0 * math.tan(math.radians(angle)), omega, 0.0]
    stages = [
        (impact.outside, stop(lambda s: s[0] - R, -1)),
        (impact.inside, stop(lambda s: s[0] - R, 1)),
        (impact.outside, stop(lambda s: s[0] - R - film, 1)),
        (impact.outside, stop(impact.length_left, -1)),
    ]
    for part, (rate, end) in enumerate(stages):
        events = [end] if part < 2 else [end, stop(lambda s: s[1], -1)]
        run = solve_ivp(rate, (0.0, 1.0), s, "DOP853", rtol=1e-12, atol=1e-14, events=events, first_step=1e-10)
        s = run.y[:, -1]
        if not len(run.t_events[0]):
            return 0.0, math.nan, math.nan
        s[0] = {0: R, 1: R, 2: R + film}.get(part, s[0]) + (1e-16 if part == 2 else 0.0)
    return s[1] / v0, s[2] / (v0 * math.tan(math.radians(angle))) if angle else math.nan, s[3]
