r"""Rupture of a liquid bridge: the gap at which it breaks, and which sphere keeps how much of its liquid."""

from __future__ import annotations

import math

from closures.registry import law


@law("rupture", "Lian, Thornton & Adams, J. Colloid Interface Sci. 161 (1993) 138, doi:10.1006/jcis.1993.1452")
def lian_rupture(contact_angle: float, reduced_radius: float, volume: float) -> float:
    r"""Gap at which a slowly stretched bridge breaks.

    .. math:: S_c = \left(1+\tfrac{\theta}2\right)V^{1/3}

    contact_angle   theta [rad]
    reduced_radius  R*; has no influence [m]
    volume          V, of the whole bridge, >= 0 [m3]
    returns         S_c, surface to surface [m]

    Range: theta below 40 degrees, V < 0.1 R^3 with R = 2 R* (stated from memory); slow separation.
    :func:`closures.capillary.rupture_length` adds the speed of separation.

    >>> round(lian_rupture(0.5, 1e-3, 1e-9), 9)
    0.00125
    """
    return float((1.0 + 0.5 * contact_angle) * volume ** (1.0 / 3.0))


@law(
    "rupture",
    "Willett, Adams, Johnson & Seville, Langmuir 16 (2000) 9396, eq. (15), as in YADE 2023.02a",
)
def willett_rupture(contact_angle: float, reduced_radius: float, volume: float) -> float:
    r"""Gap at which a slowly stretched bridge between equal spheres breaks, with the next order in the volume.

    .. math:: S_c = R\left(1+\tfrac{\theta}2\right)\left(\hat V^{1/3}+0.1\,\hat V^{2/3}\right),\qquad
              \hat V = V/R^3,\quad R = 2R^*

    contact_angle   theta [rad]
    reduced_radius  R* [m]
    volume          V, of the whole bridge, >= 0 [m3]
    returns         S_c, surface to surface [m]

    Range: V < 0.1 R^3. Derived for equal spheres; the mean radius stands for unequal ones. Ten per cent above
    :func:`lian_rupture` at V = R^3:

    >>> round(willett_rupture(0.0, 0.5e-3, 1e-9) / lian_rupture(0.0, 0.5e-3, 1e-9), 12)
    1.1
    """
    radius = 2.0 * reduced_radius
    scaled = volume ** (1.0 / 3.0) / radius
    return float(radius * (1.0 + 0.5 * contact_angle) * scaled * (1.0 + 0.1 * scaled))


@law("redistribution", "no derivation: the share of the radii, a choice of the user")
def share_by_radius(radius: float, other_radius: float) -> float:
    r"""Share of the liquid of a broken bridge that stays on the first sphere, in proportion to the radii.

    .. math:: x_i = \frac{R_i}{R_i+R_j}

    radius        R_i [m]
    other_radius  R_j [m]
    returns       x_i [-]; the other sphere keeps 1 - x_i

    Range: any. Equal spheres keep one half each.

    >>> share_by_radius(3.0, 1.0), share_by_radius(1.0, 1.0)
    (0.75, 0.5)
    """
    return radius / (radius + other_radius)


@law("redistribution", "derived here: neck of a circular meridian between two flats of different wetting")
def share_by_contact_angle(contact_angle: float, other_contact_angle: float) -> float:
    r"""Share of the liquid of a broken bridge that stays on the first body, in favour of the one that is wetted better.

    .. math:: x_i = \frac{\max(\cos\theta_i, 0)}{\max(\cos\theta_i, 0)+\max(\cos\theta_j, 0)}

    The meridian of radius r meets the bodies at theta_i and theta_j. Its neck, where the bridge breaks, lies
    r cos(theta) from either of them, so that the heights on the two sides are as the cosines.

    contact_angle        theta_i [rad]
    other_contact_angle  theta_j [rad]
    returns              x_i [-]; the other body keeps 1 - x_i

    Range: leading order, a bridge much wider than its height. One half each where neither is wetted.

    >>> round(share_by_contact_angle(0.0, math.pi / 3.0), 12)
    0.666666666667
    >>> share_by_contact_angle(2.0, 3.0)
    0.5
    """
    first, second = max(math.cos(contact_angle), 0.0), max(math.cos(other_contact_angle), 0.0)
    return first / (first + second) if first + second > 0.0 else 0.5
