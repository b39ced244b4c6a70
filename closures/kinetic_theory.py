"""Kinetic theory of granular flow: pressure and viscosity of particles from velocity fluctuations and collisions.

The granular temperature T is the mean square of one component of the velocity fluctuation [m2/s2].
"""

from __future__ import annotations

import math

from closures.registry import law

CLOSE_PACKING = 0.64
"""Solid fraction of random close packing of equal spheres [-]."""

LEAST_ROOM = 1e-3
"""Lower limit of 1 - (phi / 0.64)^3; it holds the radial distribution constant above phi = 0.6398."""


@law("kinetic_theory", "Ma & Ahmadi, Powder Technol. 56 (1988) 191", solid_fraction=(0.0, 0.63))
def radial_distribution(solid_fraction: float) -> float:
    r"""Radial distribution function at contact: collision frequency of spheres over that of points.

    .. math:: \chi = \frac{1 + 2.5\phi + 4.51\phi^2 + 4.52\phi^3}{\bigl(1 - (\phi/0.64)^3\bigr)^{0.68}}

    solid_fraction  phi [-]
    returns         chi [-]

    Range: phi < 0.63; the equation diverges at 0.64, and chi is held constant above 0.6398. The second coefficient
    differs between authors (2.5, or 4.59/1.8); the difference is below 1 % up to phi = 0.5.

    >>> radial_distribution(0.0), round(radial_distribution(0.36), 3)
    (1.0, 3.08)
    """
    phi, ratio = solid_fraction, solid_fraction / CLOSE_PACKING
    series = 1.0 + phi * (2.5 + phi * (4.51 + phi * 4.52))
    return float(series / max(1.0 - ratio * ratio * ratio, LEAST_ROOM) ** 0.68)


@law("kinetic_theory", "Lun et al., J. Fluid Mech. 140 (1984) 223, eq. (4.9)", solid_fraction=(0.0, 0.63))
def solids_pressure(solid_fraction: float, density: float, granular_temperature: float, restitution: float) -> float:
    r"""Solids pressure, kinetic and collisional.

    .. math:: P_s = \rho_s\,\phi\,T\,\bigl[1 + 2(1+e)\,\phi\,\chi(\phi)\bigr]

    solid_fraction        phi [-]
    density               rho_s, of the solid [kg/m3]
    granular_temperature  T [m2/s2]
    restitution           e [-]
    returns               P_s [Pa]

    Range: phi < 0.63.

    >>> round(solids_pressure(0.01, 1000.0, 1e-3, 1.0) / (1000.0 * 0.01 * 1e-3), 3)    # 1 + 4 phi for a dilute gas
    1.041
    """
    collisions = 2.0 * (1.0 + restitution) * solid_fraction * radial_distribution(solid_fraction)
    return float(density * solid_fraction * granular_temperature * (1.0 + collisions))


@law(
    "kinetic_theory",
    "Gidaspow, Multiphase Flow and Fluidization (1994), eqs (9.249), (9.250)",
    solid_fraction=(1e-3, 0.63),
)
def longitudinal_viscosity(
    solid_fraction: float, density: float, diameter: float, granular_temperature: float, restitution: float
) -> float:
    r"""Solids viscosity for compression in one direction: 4/3 of the shear viscosity plus the bulk viscosity.

    .. math:: \mu_l = \tfrac43\,(\mu_k + \mu_c) + \tfrac53\,\mu_c,\qquad
              \mu_c = \tfrac45\,\phi^2 \rho_s d\,\chi\,(1+e)\sqrt{T/\pi},\quad
              \mu_k = \frac{10\,\rho_s d\sqrt{\pi T}}{96\,(1+e)\,\chi}\,\bigl[1 + \tfrac45\,\phi\,\chi\,(1+e)\bigr]^2

    solid_fraction        phi, > 0 [-]
    density               rho_s, of the solid [kg/m3]
    diameter              d [m]
    granular_temperature  T [m2/s2]
    restitution           e [-]
    returns               mu_l [Pa s]

    Range: 0.001 < phi < 0.63. The bulk viscosity is 5/3 of the collisional part of the shear viscosity.

    >>> round(longitudinal_viscosity(0.36, 3586.0, 3.087e-3, 1.5e-3, 0.9), 2)
    0.57
    """
    chi = radial_distribution(solid_fraction)
    speed = density * diameter * math.sqrt(granular_temperature)
    collisional = 0.8 * solid_fraction**2 * speed * chi * (1.0 + restitution) / math.sqrt(math.pi)
    free = 1.0 + 0.8 * solid_fraction * chi * (1.0 + restitution)
    kinetic = 10.0 * speed * math.sqrt(math.pi) / (96.0 * (1.0 + restitution) * chi) * free**2
    return float(4.0 / 3.0 * (kinetic + collisional) + 5.0 / 3.0 * collisional)
