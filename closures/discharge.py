r"""Discharge of particles through an orifice below a hopper."""

from __future__ import annotations

import math

from closures.registry import law

CONSTANT, EMPTY_RIM = 0.58, 1.4
"""C and k of Beverloo's law for spheres [-]."""

STEEP = -0.35
"""Exponent of the correction for the angle of a cone [-]."""


@law("discharge", "Beverloo, Leniger & van de Velde, Chem. Eng. Sci. 15 (1961) 260")
def beverloo(bulk_density: float, orifice: float, diameter: float, gravity: float) -> float:
    r"""Discharge through a round orifice in a flat bottom.

    .. math:: W = C\,\rho_b\,\sqrt g\,(D - k d)^{5/2},\qquad C = 0.58,\quad k = 1.4

    bulk_density  rho_b, of the bed above the orifice [kg/m3]
    orifice       D, its diameter, > k d [m]
    diameter      d, of the spheres [m]
    gravity       g [m/s2]
    returns       W [kg/s]

    Range: D > 6 d, W = 0 for D <= k d; depth of the bed of more than D; C and k for spheres.

    >>> round(beverloo(1450.0, 0.01, 1e-3, 9.81), 4)
    0.0181
    """
    return float(CONSTANT * bulk_density * math.sqrt(gravity) * max(orifice - EMPTY_RIM * diameter, 0.0) ** 2.5)


@law("discharge", "Rose & Tanaka, The Engineer 208 (1959) 465; exponent and source from memory")
def cone_factor(slope: float) -> float:
    r"""Discharge of a steep cone over that of a flat bottom.

    .. math:: \frac{W}{W_0} = (\tan\theta\,\tan\varphi)^{-0.35},\qquad \varphi = 45^\circ

    slope    tan(theta), theta between axis and wall of the cone [-]
    returns  W/W0 [-]

    Range: theta below 45 degrees, where all particles move; 1 for wider cones. The angle of the stagnant zone phi
    depends on the material; 45 degrees is a usual value.

    >>> cone_factor(1.0)
    1.0
    """
    return float(min(slope, 1.0) ** STEEP)


@law("discharge", "Crewdson, Ormond & Nedderman, Powder Technol. 16 (1977) 197; form and source from memory")
def air_factor(gradient: float) -> float:
    r"""Discharge with a pressure gradient of the gas in the orifice over that without.

    .. math:: \frac{W}{W_0} = \sqrt{1 + \frac{1}{\rho_b\,g}\frac{dp}{dz}}

    gradient  dp/dz over rho_b g, positive where the gas pushes the particles out [-]
    returns   W/W0 [-]

    Range: a gradient that acts as more or less gravity on the particles in the orifice; 0 where it carries them.

    >>> air_factor(0.44)
    1.2
    """
    return math.sqrt(max(1.0 + gradient, 0.0))
