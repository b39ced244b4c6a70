"""Elastic contact of two spheres: Hertz, Mindlin, linear springs, damping for a given restitution.

And the share of a load that the contact of wet spheres carries.
"""

from __future__ import annotations

import math

from closures.registry import law


@law("contact", "Hertz (1882); Johnson, Contact Mechanics (1985) ch. 4")
def reduced(first: float, second: float) -> float:
    r"""Reduced radius or mass of two particles.

    .. math:: x^* = \frac{x_i x_j}{x_i + x_j}

    first    x_i, radius [m] or mass [kg]
    second   x_j, of the other body [m] or [kg]; infinite for a flat or fixed wall
    returns  x* [m] or [kg]

    Range: any.

    >>> reduced(6.35e-3, 6.35e-3), reduced(6.35e-3, math.inf)
    (0.003175, 0.00635)
    """
    return first / (1.0 + first / second)


@law("contact", "Johnson, Contact Mechanics (1985) eq. (4.25)")
def reduced_modulus(modulus_i: float, poisson_i: float, modulus_j: float, poisson_j: float) -> float:
    r"""Reduced Young's modulus of two solids.

    .. math:: 1/E^* = (1-\nu_i^2)/E_i + (1-\nu_j^2)/E_j

    modulus_i, modulus_j  E, Young's modulus [Pa]
    poisson_i, poisson_j  nu, Poisson's ratio [-]
    returns               E* [Pa]

    Range: any; one modulus may be infinite.

    >>> round(reduced_modulus(10e6, 0.25, 10e6, 0.25))
    5333333
    """
    return 1.0 / ((1.0 - poisson_i**2) / modulus_i + (1.0 - poisson_j**2) / modulus_j)


@law("contact", "Mindlin & Deresiewicz, J. Appl. Mech. 20 (1953) 327; Di Renzo & Di Maio (2004)")
def reduced_shear_modulus(modulus_i: float, poisson_i: float, modulus_j: float, poisson_j: float) -> float:
    r"""Reduced shear modulus of two solids, used in Mindlin's tangential stiffness.

    .. math:: 1/G^* = (2-\nu_i)/G_i + (2-\nu_j)/G_j, \qquad G = E/(2(1+\nu))

    modulus_i, modulus_j  E, Young's modulus [Pa]
    poisson_i, poisson_j  nu, Poisson's ratio [-]
    returns               G* [Pa]

    Range: any; one modulus may be infinite.

    >>> round(reduced_shear_modulus(10e6, 0.25, 10e6, 0.25))
    1142857
    """
    shear_i = modulus_i / (2.0 * (1.0 + poisson_i))
    shear_j = modulus_j / (2.0 * (1.0 + poisson_j))
    return 1.0 / ((2.0 - poisson_i) / shear_i + (2.0 - poisson_j) / shear_j)


@law("contact", "Johnson, Contact Mechanics (1985) eq. (4.22)")
def hertz_stiffness(reduced_modulus: float, reduced_radius: float) -> float:
    r"""Stiffness k of a Hertz contact, F = k delta^(3/2).

    .. math:: k = \tfrac43 E^*\sqrt{R^*}

    reduced_modulus  E* [Pa]
    reduced_radius   R* [m]
    returns          k [N/m^1.5]

    Range: any.

    >>> round(hertz_stiffness(1e9, 0.01) * 1e-6)
    133
    """
    return 4.0 / 3.0 * reduced_modulus * math.sqrt(reduced_radius)


@law("contact", "Johnson, Contact Mechanics (1985) eq. (4.22)")
def hertz_force(stiffness: float, overlap: float) -> float:
    r"""Elastic normal force of a Hertz contact.

    .. math:: F = k\,\delta^{3/2}

    stiffness  k, from :func:`hertz_stiffness` [N/m^1.5]
    overlap    delta, >= 0 [m]
    returns    F, repulsive [N]

    Range: overlap << R*, elastic solids.

    Two glass spheres of 10 mm radius at 20 m/s reach 10 697 N at 274.11 um (Chung & Ooi 2011, test 1).

    >>> k = hertz_stiffness(reduced_modulus(48e9, 0.2, 48e9, 0.2), 5e-3)
    >>> round(hertz_force(k, 274.11e-6))
    10697
    """
    return stiffness * overlap * math.sqrt(overlap)


@law("contact", "integral of Johnson, Contact Mechanics (1985) eq. (4.22), with Nijssen et al. (2023), eq. (9)")
def spring_energy(stiffness: float, power: float, overlap: float, minimum_gap: float) -> float:
    r"""Elastic energy of the normal spring, including the load sharing of a lubricated contact.

    .. math:: U = \int_0^\delta \min(x/h_{min}, 1)\,k x^p\,dx
              = \frac{k\,\delta^{p+2}}{(p+2)\,h_{min}}\ (\delta<h_{min}),\quad
              \frac{k}{p+1}\left(\delta^{p+1} - \frac{h_{min}^{p+1}}{p+2}\right)\ (\delta\ge h_{min})

    stiffness    k of F = k delta^p [N/m^p]
    power        p: 3/2 for Hertz, 1 for a linear spring [-]
    overlap      delta = h_min - h, >= 0 [m]
    minimum_gap  h_min; 0 for a dry contact [m]
    returns      U [J]

    Range: overlap << R*, elastic solids.

    Two glass spheres of 10 mm radius at 20 m/s stop at 274.11 um (Chung & Ooi 2011, test 1); all their energy is
    elastic.

    >>> k = hertz_stiffness(reduced_modulus(48e9, 0.2, 48e9, 0.2), 5e-3)
    >>> kinetic = 0.5 * (0.5 * 2800 * 4 / 3 * math.pi * 0.01**3) * 20.0**2
    >>> round(spring_energy(k, 1.5, 274.11e-6, 0.0) / kinetic, 4)
    1.0
    """
    if overlap < minimum_gap:
        return float(stiffness * overlap ** (power + 2.0) / ((power + 2.0) * minimum_gap))
    return float(stiffness / (power + 1.0) * (overlap ** (power + 1.0) - minimum_gap ** (power + 1.0) / (power + 2.0)))


@law("contact", "Johnson, Contact Mechanics (1985) eq. (11.22)")
def hertz_largest_overlap(reduced_mass: float, stiffness: float, speed: float) -> float:
    r"""Largest overlap of an undamped Hertz impact.

    .. math:: \delta_{max} = \left(\frac{5 m^* v^2}{4 k}\right)^{2/5}

    reduced_mass  m* [kg]
    stiffness     k, from :func:`hertz_stiffness` [N/m^1.5]
    speed         v, normal approach speed [m/s]
    returns       delta_max [m]

    Range: overlap << R*, elastic solids.

    >>> k = hertz_stiffness(reduced_modulus(48e9, 0.2, 48e9, 0.2), 5e-3)     # Chung & Ooi (2011), test 1
    >>> round(hertz_largest_overlap(0.5 * 2800 * 4 / 3 * math.pi * 0.01**3, k, 20.0) * 1e6, 2)
    274.11
    """
    return float((1.25 * reduced_mass * speed**2 / stiffness) ** 0.4)


@law("contact", "Tsuji, Tanaka & Ishida, Powder Technol. 71 (1992) 239; Antypov & Elliott, EPL 94 (2011) 50004")
def damping_ratio(restitution: float) -> float:
    r"""Damping factor alpha of Tsuji's dashpot for a given restitution of a dry Hertz impact.

    .. math:: \alpha = \frac{-\sqrt5\,\ln e}{\sqrt{\ln^2 e + \pi^2}}

    restitution  e, dry normal coefficient of restitution, 0 < e <= 1 [-]
    returns      alpha [-]

    Range: 0 < e <= 1. Exact at any impact speed if the small attractive force at the end of the contact is kept.

    >>> round(damping_ratio(0.97), 5), damping_ratio(1.0)
    (0.02168, -0.0)
    """
    logarithm = math.log(restitution)
    return -math.sqrt(5.0) * logarithm / math.sqrt(logarithm**2 + math.pi**2)


@law("contact", "Tsuji, Tanaka & Ishida, Powder Technol. 71 (1992) 239, eq. (16)")
def hertz_damping(damping_ratio: float, reduced_mass: float, stiffness: float, overlap: float) -> float:
    r"""Damping coefficient of Tsuji's dashpot in a Hertz contact.

    .. math:: \gamma = \alpha\sqrt{m^* k}\,\delta^{1/4}

    damping_ratio  alpha, from :func:`damping_ratio` [-]
    reduced_mass   m* [kg]
    stiffness      k, from :func:`hertz_stiffness` [N/m^1.5]
    overlap        delta, >= 0 [m]
    returns        gamma, force per speed [kg/s]

    Range: any.

    >>> hertz_damping(1.0, 4.0, 9.0, 16.0)
    12.0
    """
    return damping_ratio * math.sqrt(reduced_mass * stiffness * math.sqrt(overlap))


@law("contact", "Mindlin & Deresiewicz (1953); Di Renzo & Di Maio, Chem. Eng. Sci. 59 (2004) 525, eq. (10)")
def mindlin_stiffness(reduced_shear_modulus: float, reduced_radius: float, overlap: float) -> float:
    r"""Tangential stiffness of a Hertz contact without slip.

    .. math:: k_t = 8\,G^*\sqrt{R^*\delta}

    reduced_shear_modulus  G* [Pa]
    reduced_radius         R* [m]
    overlap                delta, >= 0 [m]
    returns                k_t [N/m]

    Range: overlap << R*, no slip in the contact.

    >>> mindlin_stiffness(1e6, 1e-2, 1e-6)
    800.0
    """
    return 8.0 * reduced_shear_modulus * math.sqrt(reduced_radius) * math.sqrt(overlap)


@law("contact", "Schwager & Poeschel, Granul. Matter 9 (2007) 465; Garg et al., Powder Technol. 220 (2012) 122")
def linear_damping_ratio(restitution: float) -> float:
    r"""Damping ratio zeta of a linear spring and dashpot for a given restitution.

    .. math:: \zeta = \frac{-\ln e}{\sqrt{\ln^2 e + \pi^2}}

    restitution  e, 0 < e <= 1 [-]
    returns      zeta [-]

    Range: 0 < e <= 1.

    >>> round(linear_damping_ratio(0.9), 5)
    0.03352
    """
    logarithm = math.log(restitution)
    return -logarithm / math.sqrt(logarithm**2 + math.pi**2)


@law("contact", "Cundall & Strack, Geotechnique 29 (1979) 47; Garg et al., Powder Technol. 220 (2012) 122, eq. (12)")
def linear_damping(damping_ratio: float, reduced_mass: float, stiffness: float) -> float:
    r"""Damping coefficient of a linear spring and dashpot.

    .. math:: \gamma = 2\zeta\sqrt{m^* k}

    damping_ratio  zeta, from :func:`linear_damping_ratio` [-]
    reduced_mass   m* [kg]
    stiffness      k, linear [N/m]
    returns        gamma [kg/s]

    Range: any.

    >>> linear_damping(0.5, 4.0, 9.0)
    6.0
    """
    return 2.0 * damping_ratio * math.sqrt(reduced_mass * stiffness)


@law("blend", "Nijssen, Ottens & Padding, Powder Technol. (2023), eq. (9), doi:10.1016/j.powtec.2022.118017")
def contact_share(gap: float, minimum_gap: float) -> float:
    r"""Share of the normal load carried by the solid contact; the film carries the rest.

    .. math:: s = 1 - h/h_{min}\ \text{between } h = 0 \text{ and } h = h_{min}

    gap          h, surface to surface [m]
    minimum_gap  h_min; 0 for a dry contact [m]
    returns      s: 0 above h_min, 1 at geometric overlap [-]

    Range: any.

    >>> contact_share(0.25, 1.0), contact_share(2.0, 1.0), contact_share(-0.1, 0.0)
    (0.75, 0.0, 1.0)
    """
    if gap <= 0.0:
        return 1.0
    if gap >= minimum_gap:
        return 0.0
    return 1.0 - gap / minimum_gap
