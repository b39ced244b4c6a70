"""Minimum gap: the gap at which the solids begin to carry load."""

from __future__ import annotations

import math

from closures.registry import law


@law("minimum_gap", "Nijssen et al., Powder Technol. (2023), eq. (3), doi:10.1016/j.powtec.2022.118017")
def asperities(roughness_i: float, roughness_j: float) -> float:
    r"""Gap at which the asperities of two rigid surfaces touch.

    .. math:: h_\sigma = (\sigma_i + \sigma_j)/2

    roughness_i, roughness_j  sigma, height of the asperities of each body [m]
    returns                   h_sigma [m]

    Range: any.

    >>> asperities(24e-9, 134e-9) * 1e9
    79.0
    """
    return 0.5 * (roughness_i + roughness_j)


@law(
    "minimum_gap",
    "Davis, Serayssol & Hinch, J. Fluid Mech. 163 (1986) 479; Nijssen et al. (2023), eq. (5), with the fifth root",
)
def elastohydrodynamic(viscosity: float, approach_speed: float, reduced_modulus: float, reduced_radius: float) -> float:
    r"""Gap at which the film pressure deforms two smooth elastic spheres enough to make them rebound.

    .. math:: h_\varepsilon = 0.37\,(\eta v / E^*)^{2/5}\,R^{*\,3/5}

    viscosity        eta, dynamic, of the film [Pa s]
    approach_speed   v, largest normal approach speed of this collision, >= 0 [m/s]
    reduced_modulus  E*, of the real solids, not the softened contact modulus [Pa]
    reduced_radius   R* [m]
    returns          h_eps [m]; 0 at rest

    Range: smooth spheres, h_eps << R*. The printed equation is a length only with the fifth root.

    >>> round(elastohydrodynamic(1e-3, 0.0253, 1.6e9, 3.175e-3) * 1e9)   # Delrin in water, St = 100
    35
    """
    return float(0.37 * (viscosity * approach_speed / reduced_modulus) ** 0.4 * reduced_radius**0.6)


@law("minimum_gap", "inverse of Davis, Serayssol & Hinch (1986)")
def elastohydrodynamic_speed(gap: float, viscosity: float, reduced_modulus: float, reduced_radius: float) -> float:
    r"""Approach speed above which two smooth elastic spheres rebound before they reach a given gap.

    .. math:: v = \frac{E^*R^*}{\eta}\left(\frac{h}{0.37\,R^*}\right)^{5/2}

    gap              h [m]
    viscosity        eta, dynamic, of the film [Pa s]
    reduced_modulus  E*, of the real solids, not the softened contact modulus [Pa]
    reduced_radius   R* [m]
    returns          v, the speed at which :func:`elastohydrodynamic` is h [m/s]

    Range: smooth spheres, h << R*.

    >>> v = elastohydrodynamic_speed(35e-9, 1e-3, 1.6e9, 3.175e-3)
    >>> round(elastohydrodynamic(1e-3, v, 1.6e9, 3.175e-3) * 1e9, 9)
    35.0
    """
    part = gap / (0.37 * reduced_radius)
    return reduced_modulus * reduced_radius * part * part * math.sqrt(part) / viscosity


@law(
    "minimum_gap",
    "Donahue et al., J. Fluid Mech. 650 (2010) 479; Punch et al., AIChE J. 69 (2023) e17989, eq. (14)",
)
def glass_transition(
    viscosity: float, approach_speed: float, transition_pressure: float, reduced_radius: float, film: float
) -> float:
    r"""Gap at which the film pressure turns a viscous liquid to glass, from which the particles rebound.

    .. math:: h_g = \min\left(\sqrt{3\eta R^* v / P_g},\ d\right)

    viscosity            eta, dynamic, of the film [Pa s]
    approach_speed       v, normal approach speed where the films touch, >= 0 [m/s]
    transition_pressure  P_g, glass transition pressure of the liquid [Pa]
    reduced_radius       R* [m]
    film                 d, thickness of the liquid on both particles together; upper limit of h_g [m]
    returns              h_g [m]

    Range: very viscous liquids; P_g is fitted to head-on collisions, 2 to 23 MPa for silicone oil of 10 Pa s.

    >>> round(glass_transition(10.0, 0.3564, 23e6, 6.35e-3, 270e-6) * 1e6)       # steel spheres of 25.4 mm, St = 1.6
    54
    """
    return min(math.sqrt(3.0 * viscosity * reduced_radius * approach_speed / transition_pressure), film)
