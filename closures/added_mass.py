"""Added mass of an accelerating sphere, as a fraction of the mass of the displaced fluid."""

from __future__ import annotations

from closures.registry import law


@law("added_mass", "Lamb, Hydrodynamics (1932), art. 92")
def constant(voidage: float) -> float:
    r"""Added-mass coefficient of an isolated sphere.

    .. math:: C_m = 1/2

    voidage  eps, not used [-]
    returns  C_m [-]

    Range: isolated spheres; too low in a suspension.

    >>> constant(0.5)
    0.5
    """
    return 0.5


@law("added_mass", "Zuber, Chem. Eng. Sci. 19 (1964) 897")
def zuber(voidage: float) -> float:
    r"""Added-mass coefficient of a sphere in a suspension.

    .. math:: C_m = \tfrac12\,\frac{1+2\phi}{1-\phi},\qquad \phi = 1 - \varepsilon

    voidage  eps, > 0 [-]
    returns  C_m [-]

    Range: eps > 0; derived for a sphere in a concentric cell of fluid.

    >>> zuber(1.0), zuber(0.5)
    (0.5, 2.0)
    """
    return 0.5 * (3.0 - 2.0 * voidage) / voidage


IMAGES = 50
"""Images of the sphere that are summed beside a wall, at most; what is left out is largest at contact, 3e-4."""

SMALLEST_IMAGE = 1e-9
"""Strength of an image below which the sum ends."""


@law("added_mass_near_wall", "Lamb, Hydrodynamics (1932), art. 98 and 99: method of images (Hicks 1880)")
def near_wall(distance: float, radius: float) -> float:
    r"""Added-mass coefficient of a sphere that moves towards or away from a plane wall.

    .. math:: C_m = \tfrac32\sum_k m_k - 1,\qquad m_0 = 1,\quad m_{k+1} = m_k\left(\frac R{D_k}\right)^3,\quad
              D_k = 2z - x_k,\quad x_{k+1} = \frac{R^2}{D_k},\quad x_0 = 0

    distance  z, of the centre from the wall, at least R [m]
    radius    R [m]
    returns   C_m [-]

    Range: potential flow. Far from the wall C_m tends to (1 + 3/8 (R/z)^3)/2, at contact to 3/2 zeta(3) - 1 = 0.8031.

    >>> round(near_wall(1.0, 1.0), 4), round(near_wall(10.0, 1.0) - 0.5 * (1.0 + 3.0 / 8.0 * 1e-3), 6)
    (0.8028, 0.0)
    """
    strength, total, place = 1.0, 0.0, 0.0
    for _ in range(IMAGES):
        total += strength
        away = 2.0 * distance - place
        strength *= (radius / away) ** 3
        place = radius * radius / away
        if strength < SMALLEST_IMAGE:
            break
    return 1.5 * total - 1.0
