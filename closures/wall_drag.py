r"""Drag of a single sphere beside a plane wall in creeping flow, over Stokes' drag 6 pi eta R v of the sphere alone.

The exact resistance grows as the gap closes: as R/h towards the wall, and as (8/15) ln(R/h) along it. A lubrication
film applies these singular parts. The laws here are the rest, which stays finite, so that film and drag together are
the exact resistance and nothing is counted twice.
"""

from __future__ import annotations

import math

from closures.registry import law

SHEAR = 8.0 / 15.0
"""Factor of the logarithm of the resistance along the wall."""


@law(
    "wall_drag",
    "fit to the series of Brenner, Chem. Eng. Sci. 16 (1961) 242; limit of Cox & Brenner, ibid. 22 (1967) 1753",
)
def towards_wall(gap: float) -> float:
    r"""Drag factor of a sphere that moves towards or away from a wall, less the part R/h of the film.

    .. math:: \lambda_n - \frac Rh = 1 + \tfrac15\ln\left(1 + \frac1x\right) - \frac{0.0287}{1+14x}
              - \frac{0.052\,x}{(1+x)^2},\qquad x = h/R

    gap      x, gap over the radius, > 0 [-]
    returns  [-]

    Range: any gap, Re << 1. With R/h it is within 0.15 % of Brenner's series for 1e-4 < x < 10; at small x it tends to
    0.9713 - 1/5 ln x, far away to 1 + 1/8 /x.

    >>> round(1.0 / 0.01 + towards_wall(0.01), 1), round(1.0 + towards_wall(1.0), 3)    # Brenner: 101.9, 2.126
    (101.9, 2.124)
    """
    return 1.0 + 0.2 * math.log(1.0 + 1.0 / gap) - 0.0287 / (1.0 + 14.0 * gap) - 0.052 * gap / (1.0 + gap) ** 2


@law("wall_drag", "fit to Goldman, Cox & Brenner, Chem. Eng. Sci. 22 (1967) 637, with the far field of Faxen (1923)")
def along_wall(gap: float) -> float:
    r"""Drag factor of a sphere that moves along a wall without spin.

    .. math:: \lambda_t = 1 + \tfrac8{15}\ln\left(1 + \frac1x\right) - \frac{0.0412}{1+10x} + \frac{0.06\,x}{(1+x)^2},
              \qquad x = h/R

    gap      x, gap over the radius, > 0 [-]
    returns  [-]

    Range: any gap, Re << 1. Within 0.4 % of the tabulated values; at small x it tends to 0.9588 - 8/15 ln x, far away
    to 1 + 0.59/x (Faxen: 9/16).

    >>> [round(along_wall(x), 2) for x in (0.003202, 0.1276, 2.7622)]    # exact: 4.0223, 2.1514, 1.1738
    [4.03, 2.15, 1.18]
    """
    return 1.0 + SHEAR * math.log(1.0 + 1.0 / gap) - 0.0412 / (1.0 + 10.0 * gap) + 0.06 * gap / (1.0 + gap) ** 2


@law("wall_drag", "singular part of Goldman, Cox & Brenner (1967)")
def film_along_wall(gap: float) -> float:
    r"""Part of the drag factor along a wall that a film against sliding applies.

    .. math:: \tfrac8{15}\ln\frac1x\ (x<1),\qquad x = h/R

    gap      x, gap over the radius, > 0 [-]
    returns  [-]; 0 beyond the reach of films, x = 1

    Range: any gap; the part of a film alone is too small where x is not.

    >>> round(film_along_wall(math.exp(-15.0 / 8.0)), 12), film_along_wall(2.0)
    (1.0, 0.0)
    """
    return max(-SHEAR * math.log(gap), 0.0)
