"""Agitation: fluctuations of the fluid velocity and of the drag force in a suspension of spheres.

An unresolved simulation gives all particles at one position the same mean force. In a real suspension neighbours
disturb the flow, and the force differs between particles. This file has two published descriptions, the velocity
fluctuation of the fluid (`pseudo_turbulence`) and a fluctuating force (`force_deviation`, `force_rate`); a fit to this
project's resolved simulations (`free_spheres`); and an estimate of the resulting motion (`agitated_temperature`).
Re_m = (1 - phi) rho |w| d / eta, with the local mean slip velocity w. A case chooses a law of the kind `agitation`;
laws of the kind `fluctuation` are its parts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from closures.kinetic_theory import radial_distribution
from closures.registry import law

_SOURCE = "Mehrabadi, Tenneti, Garg & Subramaniam, J. Fluid Mech. 770 (2015) 210"
_LATTANZI = "Lattanzi, Tavanashad, Subramaniam & Capecelatro, Phys. Rev. Fluids 7 (2022) 014301"

_RESOLVED = "resolved simulations of free spheres, scenarios/references/resolved_suspension"

INERTIA_SHARE = 0.0
"""Part of the force by the acceleration of the fluctuation; the resolved simulations show none."""

SHARES = {"pseudo_turbulence": (0.45, 0.65), "lattanzi": (1.0, 0.6)}
"""Part of the fluctuation of a law that acts on free spheres, along and across the mean slip; 1 for other laws.

The numbers of pseudo-turbulence are fitted to resolved simulations of free spheres. The ratio of the force of Lattanzi
et al. is the middle of the range of Osnes et al. (2023).
"""

TIMES = {"pseudo_turbulence": 1.29, "free_spheres": 1.27}
"""Correlation time over d/w, fitted to the same simulations; 1 for other laws. It is the sum of the process's two."""


class AgitationFactors(NamedTuple):
    """Factors of a law of agitation."""

    along: float = 1.0  # part of the fluctuation along the mean slip that enters the drag [-]
    across: float = 1.0  # the same across it [-]
    inertia: float = INERTIA_SHARE  # part of the response to du''/dt, an average over eddies as small as a particle [-]
    time: float = 1.0  # of the correlation time, d/w [-]


SHORT = 0.2
"""Shorter of the two correlation times of the fluctuation that a particle sees, over their sum [-]."""


@law("agitation", _RESOLVED, solid_fraction=(0.2, 0.45), reynolds=(25.0, 130.0), density_ratio=(1.03, 7.0))
def free_spheres(solid_fraction: float, reynolds: float, along: float, density_ratio: float) -> float:
    r"""Variance of one component of the fluid velocity that a free sphere sees, over the square of the mean slip.

    .. math:: \frac{R}{w^2} = \left(0.09\cos^2\theta + 0.055\sin^2\theta\right)\min(\phi/0.2,\,1)

    solid_fraction  phi [-]
    reynolds        Re_m, of the mean slip; for the range only [-]
    along           squared cosine of the angle between component and mean slip: 1 along it, 0 across [-]
    density_ratio   of sphere over fluid; for the range only [-]
    returns         R / w^2 [-]

    Range: 0.2 < phi < 0.45, 25 < Re_m < 130, density ratio 1.03 to 7. Fitted up to Re_m = 52, where the variance does
    not depend on them beyond its scatter of 15 %. Two points above were not fitted: at Re_m = 80 the variance along is
    0.15, at 121 0.10. Below phi = 0.2 a proportional decrease is assumed.

    >>> [free_spheres(0.36, 40.0, along, 2.5) for along in (1.0, 0.0)], free_spheres(0.0, 40.0, 1.0, 2.5)
    ([0.09, 0.055], 0.0)
    """
    return min(5.0 * solid_fraction, 1.0) * (0.055 + 0.035 * along)


@law("agitation", _SOURCE, solid_fraction=(0.1, 0.4), reynolds=(0.01, 300.0))
def pseudo_turbulence(solid_fraction: float, reynolds: float, along: float) -> float:
    r"""Variance of one component of the fluid velocity fluctuation over the square of the mean slip velocity.

    .. math:: \frac{R}{w^2} = \frac{k_f}{w^2/2}\left(b + \tfrac13\right),\qquad
              b = b_\parallel\left(\tfrac32\cos^2\theta - \tfrac12\right)

    solid_fraction  phi [-]
    reynolds        Re_m, of the mean slip [-]
    along           squared cosine of the angle between component and mean slip: 1 along it, 0 across [-]
    returns         R / w^2 [-]

    with :func:`fluctuation_energy` and the anisotropy b_par of :func:`anisotropy`.

    Range: 0.1 < phi < 0.4, 0.01 < Re_m < 300, fixed spheres; an extrapolation above Re_m = 300.

    >>> round(pseudo_turbulence(0.36, 100.0, 1.0), 3), round(pseudo_turbulence(0.36, 100.0, 0.0), 3)
    (0.45, 0.138)
    """
    uneven = anisotropy(solid_fraction, reynolds) * (1.5 * along - 0.5)
    return float(fluctuation_energy(solid_fraction, reynolds) * (uneven + 1.0 / 3.0))


@law("fluctuation", _SOURCE, solid_fraction=(0.1, 0.4), reynolds=(0.01, 300.0))
def fluctuation_energy(solid_fraction: float, reynolds: float) -> float:
    r"""Kinetic energy of the fluid velocity fluctuation over that of the mean slip velocity.

    .. math:: \frac{k_f}{w^2/2} = 2\phi + 2.5\,\phi\,(1-\phi)^3\,e^{-\phi\sqrt{Re_m}}

    solid_fraction  phi [-]
    reynolds        Re_m, of the mean slip [-]
    returns         k_f / (w^2 / 2) [-]

    Range: 0.1 < phi < 0.4, 0.01 < Re_m < 300, fixed spheres; an extrapolation above Re_m = 300. The coefficients are
    from open-source code that cites the paper and have not been compared with the paper.

    >>> fluctuation_energy(0.0, 100.0), round(fluctuation_energy(0.36, 100.0), 3)
    (0.0, 0.726)
    """
    still = (1.0 - solid_fraction) ** 3 * math.exp(-solid_fraction * math.sqrt(reynolds))
    return float(2.0 * solid_fraction + 2.5 * solid_fraction * still)


@law("fluctuation", _SOURCE, solid_fraction=(0.1, 0.4), reynolds=(0.01, 300.0))
def anisotropy(solid_fraction: float, reynolds: float) -> float:
    r"""Anisotropy of the fluid velocity fluctuation along the mean slip velocity; across it, minus half of this value.

    .. math:: b_\parallel = \frac{0.523}{1 + 0.305\,e^{-0.114\,Re_m}}
              \exp\!\left(\frac{-3.511\,\phi}{1 + 1.801\,e^{-0.005\,Re_m}}\right),\qquad
              R_\parallel = 2 k_f\,(b_\parallel + \tfrac13)

    solid_fraction  phi [-]
    reynolds        Re_m, of the mean slip [-]
    returns         b_par [-]

    Range: 0.1 < phi < 0.4, 0.01 < Re_m < 300, fixed spheres. Coefficients from open-source code, as for
    :func:`fluctuation_energy`.

    >>> round(anisotropy(0.36, 100.0), 3)
    0.286
    """
    dilute = 0.523 / (1.0 + 0.305 * math.exp(-0.114 * reynolds))
    return float(dilute * math.exp(-3.511 * solid_fraction / (1.0 + 1.801 * math.exp(-0.005 * reynolds))))


_STEPS = 60
"""Bisections of the logarithm of a granular temperature: it is found to round-off."""


@law(
    "fluctuation",
    "linear drag after Tchen (1947); collisions by Lun et al., J. Fluid Mech. 140 (1984) 223",
    solid_fraction=(0.0, 0.63),
)
def agitated_temperature(
    variance: float, time: float, relaxation: float, diameter: float, solid_fraction: float, restitution: float
) -> float:
    r"""Granular temperature that a fluctuating velocity of the fluid keeps up in a suspension.

    .. math:: T\left(\frac1{\tau_p} + \omega\right) = \frac{R}{\tau_p^2}\,
              \frac{\tau + p\,\tau_1\tau_2}{(1 + p\tau_1)(1 + p\tau_2)},\qquad
              p = \frac1{\tau_p} + \zeta,\quad
              \zeta = \frac{16\,\phi\chi}{d}\sqrt{T/\pi}\,\frac{1+e}{2},\quad
              \omega = \frac{4\,(1-e^2)\,\phi\chi}{d}\sqrt{T/\pi}

    variance        R, mean over the directions of what enters the drag [m2/s2]
    time            tau, correlation time of the fluctuation [s]
    relaxation      tau_p, inertia of a particle over its drag coefficient [s]
    diameter        d [m]
    solid_fraction  phi [-]
    restitution     e [-]
    returns         T [m2/s2]

    The power of the fluctuation is balanced by drag on the random motion and by inelastic collisions. The fluctuation
    has the correlation times tau_1 = 0.8 tau and tau_2 = 0.2 tau. Collisions change the velocity
    of a particle at the rate zeta, which lowers its correlation with the fluctuation, and so the power.

    Range: phi < 0.63. An estimate: linear drag, no friction, no films, one temperature for all directions.

    >>> round(agitated_temperature(1.0, 1.0, 4.0, 1.0, 0.0, 1.0), 3)       # without collisions
    0.206
    """
    long, short = (1.0 - SHORT) * time, SHORT * time
    crowding = solid_fraction * radial_distribution(solid_fraction) / (diameter * math.sqrt(math.pi))
    low, high = 1e-12 * variance, variance
    for _ in range(_STEPS):
        middle = math.sqrt(low * high)
        speed = math.sqrt(middle)
        rate = 1.0 / relaxation + 8.0 * (1.0 + restitution) * crowding * speed
        memory = (time + rate * long * short) / ((1.0 + rate * long) * (1.0 + rate * short))
        lost = middle * (1.0 / relaxation + 4.0 * (1.0 - restitution**2) * crowding * speed)
        if lost * relaxation**2 < variance * memory:
            low = middle
        else:
            high = middle
    return math.sqrt(low * high)


@law("fluctuation", _LATTANZI, reynolds=(0.0, 1000.0))
def isolated_drag_factor(reynolds: float) -> float:
    r"""Drag factor of the isolated sphere to which `force_deviation` refers.

    .. math:: F = 1 + 0.15\,Re_m^{0.687}

    reynolds  Re_m, of the mean slip [-]
    returns   F [-]

    Range: Re_m < 1000; without the upper branch of :func:`closures.drag_single.schiller_naumann`.

    >>> isolated_drag_factor(1.0)
    1.15
    """
    return float(1.0 + 0.15 * reynolds**0.687)


@law("fluctuation", _LATTANZI, solid_fraction=(0.1, 0.4))
def force_deviation(solid_fraction: float) -> float:
    r"""Standard deviation of the force on fixed spheres over the drag of an isolated sphere at the mean slip velocity.

    .. math:: \frac{\sigma_F}{3\pi\eta d\,(1 + 0.15\,Re_m^{0.687})\,(1-\phi)\,|w|} =
              6.52\,\phi - 22.56\,\phi^2 + 49.90\,\phi^3

    solid_fraction  phi [-]
    returns         sigma_F over the drag of an isolated sphere, whose factor is `isolated_drag_factor` [-]

    Range: 0.1 < phi < 0.4. The deviation is along the slip velocity; Osnes et al. (2023) found 0.44 to 0.83 of it
    across.

    >>> round(force_deviation(0.1), 3), round(force_deviation(0.36), 2)
    (0.476, 1.75)
    """
    phi = solid_fraction
    return 6.52 * phi - 22.56 * phi**2 + 49.90 * phi**3


@law("fluctuation", _LATTANZI, solid_fraction=(0.0, 0.63))
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
