"""Adhesion of dry solids: the contact of Johnson, Kendall and Roberts (JKR), and van der Waals forces across a gap."""

from __future__ import annotations

import math

from closures.registry import law


@law(
    "cohesion",
    "Johnson, Kendall & Roberts, Proc. R. Soc. A 324 (1971) 301; Johnson, Contact Mechanics (1985) eq. (5.49)",
)
def jkr_pull_off(work_of_adhesion: float, reduced_radius: float) -> float:
    r"""Pull-off force of an adhesive contact of two spheres (JKR).

    .. math:: F_c = \tfrac32\pi\,w\,R^*

    work_of_adhesion  w, per area of contact; twice the surface energy for like solids [J/m2]
    reduced_radius    R* [m]
    returns           F_c, independent of the stiffness [N]

    Range: short-range adhesion of soft solids (large Tabor parameter).

    >>> round(jkr_pull_off(2.0, 1.0) / math.pi, 12)
    3.0
    """
    return 1.5 * math.pi * work_of_adhesion * reduced_radius


@law("cohesion", "from Johnson, Kendall & Roberts (1971); Thornton & Ning, Powder Technol. 99 (1998) 154")
def jkr_stretch(work_of_adhesion: float, reduced_radius: float, reduced_modulus: float) -> float:
    r"""Separation at which an adhesive contact of two spheres breaks (JKR).

    .. math:: \delta_c = \tfrac34\left(\frac{\pi^2 w^2 R^*}{E^{*2}}\right)^{1/3}

    work_of_adhesion  w [J/m2]
    reduced_radius    R* [m]
    reduced_modulus   E* [Pa]
    returns           delta_c, beyond geometric contact [m]

    Range: short-range adhesion of soft solids (large Tabor parameter).

    >>> round(jkr_stretch(8.0 / math.pi, 1.0, 1.0), 12)
    3.0
    """
    return float(0.75 * (math.pi * work_of_adhesion / reduced_modulus) ** (2.0 / 3.0) * reduced_radius ** (1.0 / 3.0))


@law(
    "cohesion",
    "Johnson, Kendall & Roberts (1971), solved for the radius as a quartic by Ferrari's method",
)
def jkr_contact_radius(overlap: float, work_of_adhesion: float, reduced_radius: float, reduced_modulus: float) -> float:
    r"""Contact radius of two adhesive spheres as a function of the overlap (JKR).

    .. math:: \delta = \frac{a^2}{R^*} - \sqrt{\frac{2\pi w a}{E^*}}

    overlap           delta; negative for a stretched contact, down to -delta_c [m]
    work_of_adhesion  w, > 0 [J/m2]
    reduced_radius    R* [m]
    reduced_modulus   E* [Pa]
    returns           a, of the stable branch [m]

    Range: overlap >= -delta_c, from :func:`jkr_stretch`; below it the contact radius at rupture is returned.

    >>> a = jkr_contact_radius(0.3, 0.1, 1.0, 2.0)
    >>> round(a**2 - math.sqrt(2.0 * math.pi * 0.1 * a / 2.0), 12)
    0.3
    """
    pull = math.pi * work_of_adhesion * reduced_radius**2 / reduced_modulus
    unit = (0.5 * pull * pull) ** (1.0 / 3.0)
    # resolvent m^3 - 2 R delta m^2 - pull^2/2 = 0 in units of `unit`, by Newton's method from above
    ratio = 2.0 * reduced_radius * overlap / unit
    root = max(ratio, 0.0) + 1.0
    for _ in range(12):
        root -= (root * root * (root - ratio) - 1.0) / (root * (3.0 * root - 2.0 * ratio))
    root *= unit
    rest = 4.0 * reduced_radius * overlap - 2.0 * root + 4.0 * pull / math.sqrt(2.0 * root)
    return 0.5 * (math.sqrt(2.0 * root) + math.sqrt(max(rest, 0.0)))


@law("cohesion", "Johnson, Kendall & Roberts (1971); Johnson, Contact Mechanics (1985) eq. (5.47)")
def jkr_force(contact_radius: float, work_of_adhesion: float, reduced_radius: float, reduced_modulus: float) -> float:
    r"""Normal force of an adhesive contact of two spheres (JKR).

    .. math:: F = \frac{4E^*a^3}{3R^*} - \sqrt{8\pi w E^* a^3}

    contact_radius    a, from :func:`jkr_contact_radius` [m]
    work_of_adhesion  w [J/m2]
    reduced_radius    R* [m]
    reduced_modulus   E* [Pa]
    returns           F, repulsive if positive [N]

    Range: short-range adhesion of soft solids (large Tabor parameter). At zero overlap F is -8/9 of the pull-off force:

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
    r"""Approach speed below which two elastic adhesive spheres stick (JKR).

    .. math:: v_s = \sqrt{\frac{14.18}{m^*}}\left(\frac{w^5R^{*4}}{E^{*2}}\right)^{1/6}

    reduced_mass      m* [kg]
    work_of_adhesion  w [J/m2]
    reduced_radius    R* [m]
    reduced_modulus   E* [Pa]
    returns           v_s [m/s]

    Range: no other dissipation. The contact forms at zero overlap and breaks at -delta_c; the work done between is
    lost.

    >>> round(jkr_sticking_speed(14.18, 1.0, 1.0, 1.0), 12)
    1.0
    """
    lost = (work_of_adhesion**5 * reduced_radius**4 / reduced_modulus**2) ** (1.0 / 6.0)
    return float(math.sqrt(14.18 / reduced_mass) * lost)


@law("cohesion", "Hamaker, Physica 4 (1937) 1058; Israelachvili, Intermolecular and Surface Forces (2011) ch. 13")
def van_der_waals(gap: float, hamaker: float, reduced_radius: float, minimum_separation: float) -> float:
    r"""Van der Waals force of two spheres across a gap.

    .. math:: F = \frac{A\,R^*}{6\,\max(h, h_0)^2}

    gap                 h [m]
    hamaker             A, Hamaker constant of the two solids and the medium between them [J]
    reduced_radius      R* [m]
    minimum_separation  h_0, atomic contact; about 0.165 nm [m]
    returns             F, attractive [N]

    Range: h << R* and below about 10 nm; too high at larger gaps, where retardation weakens the force.

    >>> van_der_waals(0.5, 6.0, 2.0, 1.0), van_der_waals(2.0, 6.0, 2.0, 1.0)
    (2.0, 0.5)
    """
    distance = max(gap, minimum_separation)
    return hamaker * reduced_radius / (6.0 * distance * distance)
