"""Agitation: fluctuations of the fluid velocity and of the drag force in a suspension of spheres.

An unresolved simulation gives all particles at one position the same mean force. In a real suspension neighbours
disturb the flow, and the force differs between particles. This file has two published descriptions: the velocity
fluctuation of the fluid (pseudo-turbulence), and a fluctuating force. Re_m = (1 - phi) rho |w| d / eta, with the local
mean slip velocity w.
"""

from __future__ import annotations

import math

from closures.kinetic_theory import radial_distribution
from closures.registry import law

_SOURCE = "Mehrabadi, Tenneti, Garg & Subramaniam, J. Fluid Mech. 770 (2015) 210"


@law("agitation", _SOURCE, solid_fraction=(0.1, 0.4), reynolds=(0.01, 300.0))
def pseudo_turbulence(solid_fraction: float, reynolds: float) -> float:
    r"""Kinetic energy of the fluid velocity fluctuation over that of the mean slip velocity.

    .. math:: \frac{k_f}{w^2/2} = 2\phi + 2.5\,\phi\,(1-\phi)^3\,e^{-\phi\sqrt{Re_m}}

    solid_fraction  phi [-]
    reynolds        Re_m, of the mean slip [-]
    returns         k_f / (w^2 / 2) [-]

    Range: 0.1 < phi < 0.4, 0.01 < Re_m < 300, fixed spheres; an extrapolation above Re_m = 300. The coefficients are
    from open-source code that cites the paper and have not been compared with the paper.

    >>> pseudo_turbulence(0.0, 100.0), round(pseudo_turbulence(0.36, 100.0), 3)
    (0.0, 0.726)
    """
    still = (1.0 - solid_fraction) ** 3 * math.exp(-solid_fraction * math.sqrt(reynolds))
    return float(2.0 * solid_fraction + 2.5 * solid_fraction * still)


@law("agitation", _SOURCE, solid_fraction=(0.1, 0.4), reynolds=(0.01, 300.0))
def anisotropy(solid_fraction: float, reynolds: float) -> float:
    r"""Anisotropy of the fluid velocity fluctuation along the mean slip velocity; across it, minus half of this value.

    .. math:: b_\parallel = \frac{0.523}{1 + 0.305\,e^{-0.114\,Re_m}}
              \exp\!\left(\frac{-3.511\,\phi}{1 + 1.801\,e^{-0.005\,Re_m}}\right),\qquad
              R_\parallel = 2 k_f\,(b_\parallel + \tfrac13)

    solid_fraction  phi [-]
    reynolds        Re_m, of the mean slip [-]
    returns         b_par [-]

    Range: 0.1 < phi < 0.4, 0.01 < Re_m < 300, fixed spheres. Coefficients from open-source code, as for
    :func:`pseudo_turbulence`.

    >>> round(anisotropy(0.36, 100.0), 3)
    0.286
    """
    dilute = 0.523 / (1.0 + 0.305 * math.exp(-0.114 * reynolds))
    return float(dilute * math.exp(-3.511 * solid_fraction / (1.0 + 1.801 * math.exp(-0.005 * reynolds))))


@law(
    "agitation",
    "Lattanzi, Tavanashad, Subramaniam & Capecelatro, Phys. Rev. Fluids 7 (2022) 014301",
    solid_fraction=(0.1, 0.4),
)
def force_deviation(solid_fraction: float) -> float:
    r"""Standard deviation of the force on fixed spheres over the drag of an isolated sphere at the mean slip velocity.

    .. math:: \frac{\sigma_F}{3\pi\eta d\,(1 + 0.15\,Re_m^{0.687})\,(1-\phi)\,|w|} =
              6.52\,\phi - 22.56\,\phi^2 + 49.90\,\phi^3

    solid_fraction  phi [-]
    returns         sigma_F over the drag of an isolated sphere [-]

    Range: 0.1 < phi < 0.4. The deviation is along the slip velocity; Osnes et al. (2023) found 0.44 to 0.83 of it
    across.

    >>> round(force_deviation(0.1), 3), round(force_deviation(0.36), 2)
    (0.476, 1.75)
    """
    phi = solid_fraction
    return 6.52 * phi - 22.56 * phi**2 + 49.90 * phi**3


@law(
    "agitation",
    "Lattanzi, Tavanashad, Subramaniam & Capecelatro, Phys. Rev. Fluids 7 (2022) 014301",
    solid_fraction=(0.0, 0.63),
)
def force_rate(solid_fraction: float, diameter: float, granular_temperature: float) -> float:
    r"""Decorrelation rate of a fluctuating force: the collision frequency of a particle by kinetic theory.

    .. math:: \frac{1}{\tau_F} = \frac{24\,\phi\,\chi}{d}\sqrt{T/\pi}

    solid_fraction        phi [-]
    diameter              d [m]
    granular_temperature  T [m2/s2]
    returns               1 / tau_F [1/s]

    Range: phi < 0.63.

    >>> round(force_rate(0.36, 3.087e-3, 1e-3), 1)
    153.8
    """
    rate = 24.0 * solid_fraction * radial_distribution(solid_fraction) / diameter
    return float(rate * math.sqrt(granular_temperature / math.pi))
