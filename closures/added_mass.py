"""Fluid that an accelerating sphere must take along, as a fraction of the fluid it displaces."""

from __future__ import annotations

from closures.law import law


@law("added_mass", "Lamb, Hydrodynamics (1932), art. 92")
def constant(voidage: float) -> float:
    r"""Added-mass coefficient of a sphere alone.

    .. math:: C_m = 1/2

    voidage  eps, not used [-]
    returns  C_m [-]

    >>> constant(0.5)
    0.5
    """
    return 0.5


@law("added_mass", "Zuber, Chem. Eng. Sci. 19 (1964) 897")
def zuber(voidage: float) -> float:
    r"""Added-mass coefficient of a sphere among others.

    .. math:: C_m = \tfrac12\,\frac{1+2\phi}{1-\phi},\qquad \phi = 1 - \varepsilon

    voidage  eps, > 0 [-]
    returns  C_m [-]

    >>> zuber(1.0), zuber(0.5)
    (0.5, 2.0)
    """
    return 0.5 * (3.0 - 2.0 * voidage) / voidage
