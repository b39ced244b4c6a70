"""Solid bond between two spheres, left by a liquid with solids when it dries: neck, stiffness, stresses."""

from __future__ import annotations

import math

from closures.registry import law

_POTYONDY = "Potyondy & Cundall, Int. J. Rock Mech. Min. Sci. 41 (2004) 1329, doi:10.1016/j.ijrmms.2004.09.011"


@law("bond", "volume of a small ring between two paraboloids")
def neck_radius(volume: float, gap: float, reduced_radius: float) -> float:
    r"""Radius of a small bridge or bond that fills the gap of two spheres up to a cylinder.

    .. math:: V = \pi b^2 h + \frac{\pi b^4}{4 R^*}

    volume          V [m3]
    gap             h; negative values count as 0 [m]
    reduced_radius  R* [m]
    returns         b [m]

    Range: b well below the radii, where spheres are paraboloids.

    >>> round(neck_radius(math.pi * 1e-16 / 1e-3, 0.0, 0.25e-3) * 1e6, 9)  # 2 R = 1 mm: b^4 = V / (pi / 1 mm)
    100.0
    """
    height = max(gap, 0.0)
    square = math.sqrt(height * height + volume / (math.pi * reduced_radius)) - height
    return math.sqrt(2.0 * reduced_radius * max(square, 0.0))


@law("bond", "cylinder between two paraboloids")
def neck_area(volume: float, gap: float, reduced_radius: float) -> float:
    r"""Area of the free surface of a small bridge, as that of a cylinder.

    .. math:: A = 2\pi b\left(h + \frac{b^2}{2 R^*}\right)

    volume          of the bridge, which gives b, see :func:`neck_radius` [m3]
    gap             h; negative values count as 0 [m]
    reduced_radius  R* [m]
    returns         A [m2]

    Range: as of the neck. A meniscus that is hollow by half a circle has up to 1.57 of it.

    >>> round(neck_area(math.pi * 1e-13, 0.0, 0.25e-3) * 1e9, 3)
    12.566
    """
    neck = neck_radius(volume, gap, reduced_radius)
    return 2.0 * math.pi * neck * (max(gap, 0.0) + neck * neck / (2.0 * reduced_radius))


@law("bond", _POTYONDY)
def bond_tension(per_area: float, stretch: float, bend: float, neck: float) -> float:
    r"""Largest tensile stress in a bond: of its stretch, and of its bending at its edge.

    .. math:: \sigma = k_n\,(s + b\,\varphi)

    per_area  k_n = E / (R_1 + R_2), stiffness per area [Pa/m]
    stretch   s, of the bond; negative where it is pressed [m]
    bend      phi, angle by which it is bent [rad]
    neck      b, radius of its neck [m]
    returns   sigma [Pa]

    Range: elastic, small angles. The equation is from memory; the paper was not read.

    >>> bond_tension(1e10, 1e-7, 1e-3, 1e-4)
    2000.0
    """
    return per_area * (stretch + neck * bend)


@law("bond", _POTYONDY)
def bond_shear(per_area: float, slip: float, twist: float, neck: float) -> float:
    r"""Largest shear stress in a bond: of its slip, and of its twist at its edge.

    .. math:: \tau = k_s\,(|t| + b\,|\psi|)

    per_area  k_s, stiffness to sliding per area [Pa/m]
    slip      t, displacement of its ends across the line of centres [m]
    twist     psi, angle by which it is twisted [rad]
    neck      b, radius of its neck [m]
    returns   tau [Pa]

    Range: elastic, small angles. The equation is from memory; the paper was not read.

    >>> bond_shear(1e10, 1e-7, -1e-3, 1e-4)
    2000.0
    """
    return per_area * (abs(slip) + neck * abs(twist))
