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
