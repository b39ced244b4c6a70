"""Sliding, rolling and twisting friction, and the choice between dry and lubricated friction."""

from __future__ import annotations

import math

from closures.registry import law


@law("friction", "Coulomb (1785)")
def coulomb_limit(friction: float, normal_force: float) -> float:
    r"""Largest tangential force of a contact before it slides (Coulomb).

    .. math:: |F_t| \le \mu\,|F_n|

    friction      mu [-]
    normal_force  F_n, of the solid contact [N]
    returns       largest |F_t| [N]

    Range: any.

    >>> coulomb_limit(0.5, -2.0)
    1.0
    """
    return friction * abs(normal_force)


@law(
    "friction",
    "Nijssen, Ottens & Padding, Powder Technol. (2023), eq. (10), doi:10.1016/j.powtec.2022.118017",
)
def dry_or_lubricated(minimum_gap: float, roughness_gap: float, dry: float, lubricated: float) -> float:
    r"""Friction coefficient of an immersed contact: dry if asperities touch, lubricated if a film separates the solids.

    .. math:: \mu = \mu_{dry}\ \text{if}\ h_\sigma \ge h_\varepsilon,\quad \mu_{lub}\ \text{otherwise}

    minimum_gap    h_min, the larger of the two gaps h_sigma and h_eps [m]
    roughness_gap  h_sigma [m]
    dry            mu_dry [-]
    lubricated     mu_lub [-]
    returns        mu [-]

    Range: any; no mixed lubrication between the two values.

    Steel bearing balls (roughness 24 nm) in 80 wt% glycerol collide on a film of 47 nm with friction 0.02, in water
    with 0.11:

    >>> dry_or_lubricated(47e-9, 24e-9, 0.11, 0.02), dry_or_lubricated(24e-9, 24e-9, 0.11, 0.02)
    (0.02, 0.11)
    """
    return lubricated if minimum_gap > roughness_gap else dry


@law("friction", "Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269, model A, doi:10.1016/j.powtec.2010.09.030")
def rolling_limit(rolling_friction: float, reduced_radius: float, normal_force: float) -> float:
    r"""Largest rolling resistance torque of a contact.

    .. math:: M_{max} = \mu_r\,R^*\,|F_n|

    rolling_friction  mu_r [-]
    reduced_radius    R*; the radius of the sphere on a wall [m]
    normal_force      F_n, of the solid contact [N]
    returns           M_max [N m]

    Range: any. A constant torque of this size decelerates a sphere that rolls on a floor by 5/7 mu_r g.

    >>> rolling_limit(0.1, 2.0, -5.0)
    1.0
    """
    return rolling_friction * reduced_radius * abs(normal_force)


@law("friction", "Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269, model C, doi:10.1016/j.powtec.2010.09.030")
def rolling_stiffness(normal_stiffness: float, rolling_friction: float, reduced_radius: float) -> float:
    r"""Stiffness of the rolling spring below its yield torque.

    .. math:: k_r = 2.25\,k_n\,\mu_r^2\,R^{*\,2}

    normal_stiffness  k_n, normal force over overlap [N/m]
    rolling_friction  mu_r [-]
    reduced_radius    R* [m]
    returns           k_r, torque per angle [N m/rad]

    Range: spheres, for which the factor is 2.25.

    >>> rolling_stiffness(16.0, 0.5, 1.0)
    9.0
    """
    return 2.25 * normal_stiffness * (rolling_friction * reduced_radius) ** 2


@law("friction", "Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269, model C, doi:10.1016/j.powtec.2010.09.030")
def rolling_damping(damping_ratio: float, inertia: float, stiffness: float) -> float:
    r"""Damping coefficient of the rolling dashpot.

    .. math:: C_r = 2\,\eta_r\sqrt{I_r k_r}

    damping_ratio  eta_r; 1 is critical damping [-]
    inertia        I_r, reduced moment of inertia of both spheres about the contact point [kg m2]
    stiffness      k_r, from :func:`rolling_stiffness` [N m/rad]
    returns        C_r, torque per rate of the angle [N m s]

    Range: any.

    >>> rolling_damping(0.5, 4.0, 9.0)
    6.0
    """
    return 2.0 * damping_ratio * math.sqrt(inertia * stiffness)


@law("friction", "Coulomb's limit integrated over Hertz' pressure; Johnson, Contact Mechanics (1985) ch. 4")
def twisting_limit(friction: float, contact_radius: float, normal_force: float) -> float:
    r"""Largest twisting torque of a contact about its normal.

    .. math:: M_{max} = \tfrac{3\pi}{16}\,\mu\,a\,|F_n|

    friction        mu [-]
    contact_radius  a = sqrt(R* delta) [m]
    normal_force    F_n, of the solid contact [N]
    returns         M_max [N m]

    Range: Hertz contacts, full slip.

    >>> round(twisting_limit(16.0, 1.0, 1.0) / math.pi, 12)
    3.0
    """
    return 3.0 * math.pi / 16.0 * friction * contact_radius * abs(normal_force)
