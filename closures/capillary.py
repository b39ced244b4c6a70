r"""Liquid bridges: capillary force, liquid volume and rupture length.

phi is the half-filling angle: at the centre of the sphere, from its lowest point to the contact line. theta is the
contact angle of the liquid. Attractive forces are positive.
"""

from __future__ import annotations

import math

from closures.registry import law

_TOROID = "Kralchevsky & Nagayama (2001) in Buck et al., Chem. Eng. Sci. (2018)"


@law("capillary", f"{_TOROID}, eq. (35)")
def meridional_radius(contact_line_height: float, half_filling_angle: float, contact_angle: float) -> float:
    r"""Meridional radius of a toroidal bridge between a sphere and a liquid surface.

    .. math:: r_m = \frac{z}{1+\cos(\varphi+\theta)},\qquad z = y - R\cos\varphi - \delta_l

    contact_line_height  z, height of the contact line above the liquid surface [m]
    half_filling_angle   phi [rad]
    contact_angle        theta [rad]
    returns              r_m [m]; <= 0 if the contact line lies inside the layer, where there is no toroid

    Range: phi + theta < 180 degrees.

    >>> round(meridional_radius(1.6e-4, math.radians(35), math.radians(15)) * 1e6, 1)
    97.4
    """
    return contact_line_height / (1.0 + math.cos(half_filling_angle + contact_angle))


@law("capillary", f"{_TOROID}, eq. (34)")
def azimuthal_radius(
    contact_line_radius: float, meridional_radius: float, half_filling_angle: float, contact_angle: float
) -> float:
    r"""Azimuthal (neck) radius of a toroidal bridge.

    .. math:: r_a = r_c + r_m[\sin(\varphi+\theta)-1]\ (\varphi+\theta<90^\circ),\qquad r_c\ \text{otherwise}

    contact_line_radius  r_c = R sin(phi) [m]
    meridional_radius    r_m [m]
    half_filling_angle   phi [rad]
    contact_angle        theta [rad]
    returns              r_a [m]

    Range: phi + theta < 180 degrees.

    >>> azimuthal_radius(5e-4, 1e-4, math.radians(80), math.radians(15))
    0.0005
    """
    angle = half_filling_angle + contact_angle
    if angle < 0.5 * math.pi:
        return contact_line_radius + meridional_radius * (math.sin(angle) - 1.0)
    return contact_line_radius


@law("capillary", f"{_TOROID}, eqs (31) to (33)")
def toroid_pull(
    surface_tension: float,
    contact_line_radius: float,
    meridional_radius: float,
    azimuthal_radius: float,
    half_filling_angle: float,
    contact_angle: float,
) -> float:
    r"""Capillary force of a toroidal bridge on a sphere: surface tension on the contact line plus capillary pressure.

    .. math:: F = 2\pi\sigma r_c\sin(\varphi+\theta) + \pi r_c^2\,\sigma\left(\frac1{r_m}-\frac1{r_a}\right)

    surface_tension      sigma [N/m]
    contact_line_radius  r_c = R sin(phi) [m]
    meridional_radius    r_m, from :func:`meridional_radius`, > 0 [m]
    azimuthal_radius     r_a, from :func:`azimuthal_radius`, > 0 [m]
    half_filling_angle   phi [rad]
    contact_angle        theta [rad]
    returns              F, towards the liquid [N]

    Range: r_m > 0 and r_a > 0. With equal radii the capillary pressure is zero:

    >>> round(toroid_pull(0.0728, 5e-4, 1e-4, 1e-4, math.radians(35), math.radians(15)) * 1e6, 1)
    175.2
    """
    suction = surface_tension * (1.0 / meridional_radius - 1.0 / azimuthal_radius)
    tension = 2.0 * math.pi * surface_tension * contact_line_radius * math.sin(half_filling_angle + contact_angle)
    return tension + math.pi * contact_line_radius * contact_line_radius * suction


@law("capillary", "Buck et al., Chem. Eng. Sci. (2018), eqs (39) to (43)")
def toroid_volume(
    radius: float,
    meridional_radius: float,
    azimuthal_radius: float,
    contact_line_height: float,
    half_filling_angle: float,
    contact_angle: float,
) -> float:
    r"""Liquid volume of a toroidal bridge between a sphere and a liquid surface.

    .. math:: V_b = V_1 - V_2 - V_3 - V_4

    V_1 is the cylinder of radius r_a + r_m and height z; V_2 and V_3 are the solids of revolution of the sector of the
    arc and of the triangle above it; V_4 is the cap of the sphere:

    .. math:: V_2 = \pi r_m^2\chi\left[r_a+r_m-\frac{4r_m\sin^2(\chi/2)}{3\chi}\right],\quad
              V_3 = \pi r_m^2\sin\beta\cos\beta\left[r_c+\tfrac23r_m\sin\beta\right],\quad
              \beta=\varphi+\theta,\ \chi=\pi-\beta

    radius               R, of the sphere [m]
    meridional_radius    r_m [m]
    azimuthal_radius     r_a [m]
    contact_line_height  z, above the liquid surface [m]
    half_filling_angle   phi [rad]
    contact_angle        theta [rad]
    returns              V_b [m3]

    Range: r_m >= 0. With phi = 90 degrees and r_m = 0, the volume is that of the cylinder around a hemisphere less the
    hemisphere:

    >>> volume = toroid_volume(1.0, 0.0, 1.0, 1.0, 0.5 * math.pi, 0.0)
    >>> round(volume / (math.pi - 2.0 / 3.0 * math.pi), 12)
    1.0
    """
    angle = half_filling_angle + contact_angle
    sector = math.pi - angle
    outer = azimuthal_radius + meridional_radius
    square = math.pi * meridional_radius * meridional_radius
    half = math.sin(0.5 * sector)
    cylinder = math.pi * outer * outer * contact_line_height
    turned_sector = square * (outer * sector - 4.0 / 3.0 * meridional_radius * half * half)
    lever = radius * math.sin(half_filling_angle) + 2.0 / 3.0 * meridional_radius * math.sin(angle)
    turned_triangle = square * math.sin(angle) * math.cos(angle) * lever
    depth = radius * (1.0 - math.cos(half_filling_angle))
    cap = math.pi / 3.0 * depth * depth * (3.0 * radius - depth)
    return cylinder - turned_sector - turned_triangle - cap


@law("capillary", "Lian, Thornton & Adams (1993); Pitois, Moucheront & Chateau, Eur. Phys. J. B 23 (2001) 79")
def rupture_length(capillary_number: float, contact_angle: float, volume: float) -> float:
    r"""Rupture length of a bridge; it increases with the speed of separation.

    .. math:: l = \left(1+\tfrac{\theta}2\right)\left(1+\sqrt{Ca}\right)V^{1/3}

    capillary_number  Ca, on the speed of separation, >= 0 [-]
    contact_angle     theta [rad]
    volume            V, of the liquid in the bridge, >= 0 [m3]
    returns           l [m]

    Range: any.

    >>> round(rupture_length(0.0, 0.0, 1e-9), 9), round(rupture_length(0.25, 0.0, 1e-9), 9)
    (0.001, 0.0015)
    """
    return float((1.0 + 0.5 * contact_angle) * (1.0 + math.sqrt(capillary_number)) * volume ** (1.0 / 3.0))


@law("capillary", "Pitois, Moucheront & Chateau, J. Colloid Interface Sci. 231 (2000) 26; Derjaguin's mean radius")
def pendular_pull(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Capillary force of a small bridge of constant volume between two spheres, or a sphere and a wall.

    .. math:: F = 4\pi R^*\sigma\cos\theta\left[1-\left(1+\frac{V}{\pi R^*h^2}\right)^{-1/2}\right]

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V, of the liquid in the bridge [m3]
    gap              h; negative values count as 0 [m]
    returns          F, attractive; 0 without liquid [N]

    Range: V << R*^3; too high for larger volumes.

    >>> round(pendular_pull(0.073, 0.0, 0.25e-3, 1e-12, 0.0) * 1e6, 1)       # 2 pi R sigma of two spheres of 0.5 mm
    229.3
    """
    if volume == 0.0:
        return 0.0
    apart = max(gap, 0.0)
    reach = math.sqrt(volume / (math.pi * reduced_radius))
    share = 1.0 - apart / math.sqrt(apart * apart + reach * reach)
    return 4.0 * math.pi * reduced_radius * surface_tension * math.cos(contact_angle) * share


@law("capillary", "integral of the force of a pendular bridge over the gap")
def pendular_energy(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Work of a pendular bridge on two particles that approach from a gap to contact.

    .. math:: W = 4\pi R^*\sigma\cos\theta\left[h + \ell - \sqrt{h^2+\ell^2}\right],\qquad \ell^2 = \frac{V}{\pi R^*}

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V [m3]
    gap              h, >= 0 [m]
    returns          W [J]

    Range: V << R*^3. Separating the particles up to the rupture length takes the same work.

    >>> pendular_energy(0.073, 0.0, 0.25e-3, 1e-12, 0.0)
    0.0
    """
    if volume == 0.0:
        return 0.0
    reach = math.sqrt(volume / (math.pi * reduced_radius))
    # (h + l) - sqrt(h^2 + l^2), written without cancellation
    way = 2.0 * gap * reach / (gap + reach + math.sqrt(gap * gap + reach * reach))
    return 4.0 * math.pi * reduced_radius * surface_tension * math.cos(contact_angle) * way


@law("capillary", "Shi & McCarthy, Powder Technol. 184 (2008) 64: spherical cap in the shadow of the other sphere")
def liquid_share(radius: float, other_radius: float) -> float:
    r"""Fraction of the liquid on a sphere that flows into a bridge with another sphere.

    .. math:: \frac{V_i}{L_i} = \tfrac12\left(1-\sqrt{1-\frac{R_j^2}{(R_i+R_j)^2}}\right)

    radius        R_i [m]
    other_radius  R_j, > 0 [m]
    returns       V_i/L_i [-]

    Range: any.

    >>> round(liquid_share(1.0, 1.0), 4)
    0.067
    """
    sine = other_radius / (radius + other_radius)
    square = sine * sine
    return 0.5 * square / (1.0 + math.sqrt(1.0 - square))
