r"""Liquid bridges: the pull of surface tension, the liquid in a bridge, and the length at which it breaks.

Angles: phi, the half-filling angle, seen from the centre of the sphere between its lowest point and the line where
the liquid ends on it; theta, the contact angle of the liquid. A pull is positive where the bodies attract each other.
"""

from __future__ import annotations

import math

from closures.law import law

_TOROID = "Kralchevsky & Nagayama (2001) in Buck et al., Chem. Eng. Sci. (2018)"


@law("capillary", f"{_TOROID}, eq. (35)")
def meridional_radius(contact_line_height: float, half_filling_angle: float, contact_angle: float) -> float:
    r"""Radius of the arc that a bridge between a sphere and a liquid surface shows from the side.

    .. math:: r_m = \frac{z}{1+\cos(\varphi+\theta)},\qquad z = y - R\cos\varphi - \delta_l

    contact_line_height  z, height of the line where the liquid ends on the sphere, above the liquid surface [m]
    half_filling_angle   phi [rad]
    contact_angle        theta [rad]
    returns              r_m [m]; at or below 0, where the line lies in the layer, there is no toroid

    >>> round(meridional_radius(1.6e-4, math.radians(35), math.radians(15)) * 1e6, 1)
    97.4
    """
    return contact_line_height / (1.0 + math.cos(half_filling_angle + contact_angle))


@law("capillary", f"{_TOROID}, eq. (34)")
def azimuthal_radius(
    contact_line_radius: float, meridional_radius: float, half_filling_angle: float, contact_angle: float
) -> float:
    r"""Radius of the neck of a toroid bridge.

    .. math:: r_a = r_c + r_m[\sin(\varphi+\theta)-1]\ (\varphi+\theta<90^\circ),\qquad r_c\ \text{otherwise}

    contact_line_radius  r_c = R sin(phi) [m]
    meridional_radius    r_m [m]
    half_filling_angle   phi [rad]
    contact_angle        theta [rad]
    returns              r_a [m]

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
    r"""Pull of a toroid bridge on a sphere: surface tension along the contact line, and suction inside it.

    .. math:: F = 2\pi\sigma r_c\sin(\varphi+\theta) + \pi r_c^2\,\sigma\left(\frac1{r_m}-\frac1{r_a}\right)

    surface_tension      sigma [N/m]
    contact_line_radius  r_c = R sin(phi) [m]
    meridional_radius    r_m, from :func:`meridional_radius`, > 0 [m]
    azimuthal_radius     r_a, from :func:`azimuthal_radius`, > 0 [m]
    half_filling_angle   phi [rad]
    contact_angle        theta [rad]
    returns              pull towards the liquid [N]

    A bridge whose two radii are equal does not suck:

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
    r"""Liquid in a toroid bridge between a sphere and a liquid surface.

    .. math:: V_b = V_1 - V_2 - V_3 - V_4

    V_1 is the cylinder of the bridge's largest radius r_a + r_m and height z, V_2 the sector of the arc and V_3 the
    triangle above it turned about the axis, V_4 the cap of the sphere:

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

    The liquid between a hemisphere that touches the surface and the cylinder around it, where phi is 90 degrees and
    the arc a point, is that cylinder less half a sphere:

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
    r"""Length at which a bridge breaks, longer when it is stretched fast.

    .. math:: l = \left(1+\tfrac{\theta}2\right)\left(1+\sqrt{Ca}\right)V^{1/3}

    capillary_number  Ca, on the speed of separation, >= 0 [-]
    contact_angle     theta [rad]
    volume            V, of the liquid in the bridge, >= 0 [m3]
    returns           l [m]

    >>> round(rupture_length(0.0, 0.0, 1e-9), 9), round(rupture_length(0.25, 0.0, 1e-9), 9)
    (0.001, 0.0015)
    """
    return float((1.0 + 0.5 * contact_angle) * (1.0 + math.sqrt(capillary_number)) * volume ** (1.0 / 3.0))


@law("capillary", "Pitois, Moucheront & Chateau, J. Colloid Interface Sci. 231 (2000) 26; Derjaguin's mean radius")
def pendular_pull(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Pull of a small bridge of constant volume between two spheres, or a sphere and a wall.

    .. math:: F = 4\pi R^*\sigma\cos\theta\left[1-\left(1+\frac{V}{\pi R^*h^2}\right)^{-1/2}\right]

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V, of the liquid in the bridge, > 0 [m3]
    gap              h; spheres that overlap count as touching [m]
    returns          pull towards each other [N]

    Range: V/R*^3 small against 1.

    >>> round(pendular_pull(0.073, 0.0, 0.25e-3, 1e-12, 0.0) * 1e6, 1)       # 2 pi R sigma of two spheres of 0.5 mm
    229.3
    """
    apart = max(gap, 0.0)
    reach = math.sqrt(volume / (math.pi * reduced_radius))
    share = 1.0 - apart / math.sqrt(apart * apart + reach * reach)
    return 4.0 * math.pi * reduced_radius * surface_tension * math.cos(contact_angle) * share


@law("capillary", "integral of the pull of a pendular bridge over the gap")
def pendular_energy(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Work that a pendular bridge does on two bodies while they close in from a gap to contact.

    .. math:: W = 4\pi R^*\sigma\cos\theta\left[h + \ell - \sqrt{h^2+\ell^2}\right],\qquad \ell^2 = \frac{V}{\pi R^*}

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V [m3]
    gap              h, >= 0 [m]
    returns          W [J]

    Two bodies that part must bring up this work, up to the length at which the bridge breaks.

    >>> pendular_energy(0.073, 0.0, 0.25e-3, 1e-12, 0.0)
    0.0
    """
    reach = math.sqrt(volume / (math.pi * reduced_radius))
    # (h + l) - sqrt(h^2 + l^2), without the difference of near numbers
    way = 2.0 * gap * reach / (gap + reach + math.sqrt(gap * gap + reach * reach))
    return 4.0 * math.pi * reduced_radius * surface_tension * math.cos(contact_angle) * way


@law("capillary", "Shi & McCarthy, Powder Technol. 184 (2008) 64: the cap in the other sphere's shadow")
def liquid_share(radius: float, other_radius: float) -> float:
    r"""Share of a sphere's liquid that flows into a bridge with another sphere.

    .. math:: \frac{V_i}{L_i} = \tfrac12\left(1-\sqrt{1-\frac{R_j^2}{(R_i+R_j)^2}}\right)

    radius        R_i [m]
    other_radius  R_j, > 0 [m]
    returns       V_i/L_i [-]

    >>> round(liquid_share(1.0, 1.0), 4)
    0.067
    """
    sine = other_radius / (radius + other_radius)
    square = sine * sine
    return 0.5 * square / (1.0 + math.sqrt(1.0 - square))
