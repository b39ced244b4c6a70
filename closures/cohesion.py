"""What pulls two dry solids together: adhesion of their surfaces in contact, and van der Waals forces across a gap."""

from __future__ import annotations

import math

from closures.law import law


@law(
    "cohesion",
    "Johnson, Kendall & Roberts, Proc. R. Soc. A 324 (1971) 301; Johnson, Contact Mechanics (1985) eq. (5.49)",
)
def jkr_pull_off(work_of_adhesion: float, reduced_radius: float) -> float:
    r"""Largest pull that an adhesive contact of two spheres stands.

    .. math:: F_c = \tfrac32\pi\,w\,R^*

    work_of_adhesion  w, to part unit area of contact; twice the surface energy between like solids [J/m2]
    reduced_radius    R* [m]
    returns           F_c, whatever the stiffness [N]

    >>> round(jkr_pull_off(2.0, 1.0) / math.pi, 12)
    3.0
    """
    return 1.5 * math.pi * work_of_adhesion * reduced_radius


@law("cohesion", "from Johnson, Kendall & Roberts (1971); Thornton & Ning, Powder Technol. 99 (1998) 154")
def jkr_stretch(work_of_adhesion: float, reduced_radius: float, reduced_modulus: float) -> float:
    r"""How far two adhesive spheres can be pulled apart before their contact breaks.

    .. math:: \delta_c = \tfrac34\left(\frac{\pi^2 w^2 R^*}{E^{*2}}\right)^{1/3}

    work_of_adhesion  w [J/m2]
    reduced_radius    R* [m]
    reduced_modulus   E* [Pa]
    returns           delta_c, beyond geometric touch [m]

    >>> round(jkr_stretch(8.0 / math.pi, 1.0, 1.0), 12)
    3.0
    """
    return float(0.75 * (math.pi * work_of_adhesion / reduced_modulus) ** (2.0 / 3.0) * reduced_radius ** (1.0 / 3.0))


@law(
    "cohesion",
    "Johnson, Kendall & Roberts (1971), solved for the radius by Ferrari's way, as a quartic whose cubic is short",
)
def jkr_contact_radius(overlap: float, work_of_adhesion: float, reduced_radius: float, reduced_modulus: float) -> float:
    r"""Radius of the contact of two adhesive spheres as a function of their overlap.

    .. math:: \delta = \frac{a^2}{R^*} - \sqrt{\frac{2\pi w a}{E^*}}

    overlap           delta; negative where the contact is stretched, down to -delta_c [m]
    work_of_adhesion  w, > 0 [J/m2]
    reduced_radius    R* [m]
    reduced_modulus   E* [Pa]
    returns           a, of the stable branch [m]

    Range: overlap at least minus :func:`jkr_stretch`; below that the radius at which the contact breaks.

    >>> a = jkr_contact_radius(0.3, 0.1, 1.0, 2.0)
    >>> round(a**2 - math.sqrt(2.0 * math.pi * 0.1 * a / 2.0), 12)
    0.3
    """
    pull = math.pi * work_of_adhesion * reduced_radius**2 / reduced_modulus
    unit = (0.5 * pull * pull) ** (1.0 / 3.0)
    # the resolvent m^3 - 2 R delta m^2 - pull^2/2 = 0 in units of `unit`; Newton from above, so the steps only fall
    ratio = 2.0 * reduced_radius * overlap / unit
    root = max(ratio, 0.0) + 1.0
    for _ in range(12):
        root -= (root * root * (root - ratio) - 1.0) / (root * (3.0 * root - 2.0 * ratio))
    root *= unit
    rest = 4.0 * reduced_radius * overlap - 2.0 * root + 4.0 * pull / math.sqrt(2.0 * root)
    return 0.5 * (math.sqrt(2.0 * root) + math.sqrt(max(rest, 0.0)))


@law("cohesion", "Johnson, Kendall & Roberts (1971); Johnson, Contact Mechanics (1985) eq. (5.47)")
def jkr_force(contact_radius: float, work_of_adhesion: float, reduced_radius: float, reduced_modulus: float) -> float:
    r"""Normal force of two adhesive spheres.

    .. math:: F = \frac{4E^*a^3}{3R^*} - \sqrt{8\pi w E^* a^3}

    contact_radius    a, from :func:`jkr_contact_radius` [m]
    work_of_adhesion  w [J/m2]
    reduced_radius    R* [m]
    reduced_modulus   E* [Pa]
    returns           F, repulsive where positive [N]

    At touch two spheres pull with 8/9 of the largest pull.

    >>> a = jkr_contact_radius(0.0, 0.1, 1.0, 2.0)
    >>> round(jkr_force(a, 0.1, 1.0, 2.0) / jkr_pull_off(0.1, 1.0), 9)
    -0.888888889
    """
    cube = contact_radius * contact_radius * contact_radius
    pull = math.sqrt(8.0 * math.pi * work_of_adhesion * reduced_modulus * cube)
    return 4.0 / 3.0 * reduced_modulus * cube / reduced_radius - pull


@law("cohesion", "Thornton & Ning, Powder Technol. 99 (1998) 154, doi:10.1016/S0032-5910(98)00099-0")
def jkr_sticking_speed(
    reduced_mass: float, work_of_adhesion: float, reduced_radius: float, reduced_modulus: float
) -> float:
    r"""Speed of approach below which two elastic adhesive spheres stick.

    .. math:: v_s = \sqrt{\frac{14.18}{m^*}}\left(\frac{w^5R^{*4}}{E^{*2}}\right)^{1/6}

    reduced_mass      m* [kg]
    work_of_adhesion  w [J/m2]
    reduced_radius    R* [m]
    reduced_modulus   E* [Pa]
    returns           v_s [m/s]

    The contact begins at touch and ends at -delta_c; the work of the pull between the two is lost.

    >>> round(jkr_sticking_speed(14.18, 1.0, 1.0, 1.0), 12)
    1.0
    """
    lost = (work_of_adhesion**5 * reduced_radius**4 / reduced_modulus**2) ** (1.0 / 6.0)
    return float(math.sqrt(14.18 / reduced_mass) * lost)


@law("cohesion", "Hamaker, Physica 4 (1937) 1058; Israelachvili, Intermolecular and Surface Forces (2011) ch. 13")
def van_der_waals(gap: float, hamaker: float, reduced_radius: float, minimum_separation: float) -> float:
    r"""Van der Waals attraction of two spheres across a gap.

    .. math:: F = \frac{A\,R^*}{6\,\max(h, h_0)^2}

    gap                 h [m]
    hamaker             A, Hamaker's constant of the two solids and what is between them [J]
    reduced_radius      R* [m]
    minimum_separation  h_0, at which atoms touch; about 0.165 nm [m]
    returns             F, attractive [N]

    Range: gaps far below R* and below about 10 nm, from where on the force is retarded.

    >>> van_der_waals(0.5, 6.0, 2.0, 1.0), van_der_waals(2.0, 6.0, 2.0, 1.0)
    (2.0, 0.5)
    """
    distance = max(gap, minimum_separation)
    return hamaker * reduced_radius / (6.0 * distance * distance)
