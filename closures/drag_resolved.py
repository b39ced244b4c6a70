"""Drag factors fitted to particle-resolved simulations; normal form as in drag.py."""

from __future__ import annotations

import math

from closures.drag_single import dallavalle, schiller_naumann
from closures.registry import law


@law("drag", "Hill, Koch & Ladd, J. Fluid Mech. 448 (2001) 213 and 243; Koch & Hill (2001)", voidage=(0.36, 1.0))
def koch_hill(reynolds: float, voidage: float) -> float:
    r"""Drag factor of Hill, Koch and Ladd, linear form for moderate Re.

    .. math:: F = \varepsilon\,(F_0 + \tfrac12 F_3 Re),\quad F_3 = 0.0673 + 0.212\phi + 0.0232/\varepsilon^5

    reynolds  Re, on the superficial slip and the diameter (the source uses the radius, hence 1/2) [-]
    voidage   eps = 1 - phi [-]
    returns   F [-]

    F_0 = (1 + 3 sqrt(phi/2) + 135/64 phi ln phi + 16.14 phi) / (1 + 0.681 phi - 8.48 phi^2 + 8.16 phi^3) up to
    phi = 0.4 and 10 phi/eps^3 above, where it is 1 % higher. F_0 refers to the total force, hence the leading eps.
    Coefficients as in CFDEMcoupling; MFIX has 17.14 and a blend after Benyahia et al. (2006).

    Range: phi < 0.64; the low-Re branch of isolated spheres is not included.

    >>> round(koch_hill(0.0, 0.5), 3)      # 10 phi / eps^2
    20.0
    """
    solids = max(1.0 - voidage, 0.0)
    if solids > 0.4:
        creeping = 10.0 * solids / (voidage * voidage * voidage)
    elif solids > 0.0:
        top = 1.0 + 3.0 * math.sqrt(0.5 * solids) + 135.0 / 64.0 * solids * math.log(solids) + 16.14 * solids
        creeping = top / (1.0 + solids * (0.681 + solids * (-8.48 + 8.16 * solids)))
    else:
        creeping = 1.0
    inertial = 0.0673 + 0.212 * solids + 0.0232 * voidage**-5.0
    return float(voidage * (creeping + 0.5 * inertial * reynolds))


@law("drag", "van der Hoef, Beetstra & Kuipers, J. Fluid Mech. 528 (2005) 233", voidage=(0.4, 1.0), reynolds=(0.0, 0.1))
def van_der_hoef(reynolds: float, voidage: float) -> float:
    r"""Drag factor of van der Hoef, Beetstra and Kuipers for equal spheres in creeping flow.

    .. math:: F = \frac{10\phi}{\varepsilon^2} + \varepsilon^2(1+1.5\sqrt\phi)

    reynolds  Re, not used [-]
    voidage   eps = 1 - phi [-]
    returns   F [-]

    Range: Re < 0.1, phi < 0.6; too low above. Published in this normal form.

    >>> round(van_der_hoef(0.0, 0.6), 2)
    11.81
    """
    solids = max(1.0 - voidage, 0.0)
    return 10.0 * solids / voidage**2 + voidage**2 * (1.0 + 1.5 * math.sqrt(solids))


@law("drag", "Beetstra, van der Hoef & Kuipers, AIChE J. 53 (2007) 489, doi:10.1002/aic.11065", voidage=(0.4, 1.0))
def beetstra(reynolds: float, voidage: float) -> float:
    r"""Drag factor of Beetstra, van der Hoef and Kuipers for equal spheres.

    .. math:: F = \frac{10\phi}{\varepsilon^2} + \varepsilon^2(1+1.5\sqrt\phi) + \frac{0.413 Re}{24\varepsilon^2}
              \frac{1/\varepsilon + 3\varepsilon\phi + 8.4 Re^{-0.343}}{1 + 10^{3\phi}Re^{-(1+4\phi)/2}}

    reynolds  Re, on the superficial slip [-]
    voidage   eps = 1 - phi [-]
    returns   F [-]

    Range: Re < 1000, phi < 0.6. Published in this normal form; coefficients as in MFIX.

    >>> round(beetstra(0.0, 0.6), 2)
    11.81
    """
    solids = max(1.0 - voidage, 0.0)
    square = voidage * voidage
    creeping = van_der_hoef(reynolds, voidage)
    power = reynolds ** (0.5 + 2.0 * solids)
    top = (1.0 / voidage + 3.0 * voidage * solids) * reynolds + 8.4 * reynolds**0.657
    return float(creeping + 0.413 / (24.0 * square) * top * power / (power + 10.0 ** (3.0 * solids)))


@law(
    "drag",
    "Tang, Peters, Kuipers, Kriebitzsch & van der Hoef, AIChE J. 61 (2015) 688, eq. (21), doi:10.1002/aic.14645",
    voidage=(0.4, 1.0),
    reynolds=(0.0, 1e3),
)
def tang(reynolds: float, voidage: float) -> float:
    r"""Drag factor of Tang, Peters, Kuipers, Kriebitzsch and van der Hoef.

    .. math:: F = \frac{10\phi}{\varepsilon^2} + \varepsilon^2(1+1.5\sqrt\phi)
              + \left[0.11\phi(1+\phi) - \frac{0.00456}{\varepsilon^4}
              + \left(0.169\varepsilon + \frac{0.0644}{\varepsilon^4}\right)Re^{-0.343}\right]Re

    reynolds  Re, on the superficial slip [-]
    voidage   eps = 1 - phi [-]
    returns   F [-]

    Range: Re < 1000, phi < 0.6. Published in this normal form; coefficients as in waLBerla.

    >>> round(tang(0.0, 0.6), 2)
    11.81
    """
    solids = max(1.0 - voidage, 0.0)
    square = voidage * voidage
    creeping = van_der_hoef(reynolds, voidage)
    linear = 0.11 * solids * (1.0 + solids) - 0.00456 / (square * square)
    return float(creeping + linear * reynolds + (0.169 * voidage + 0.0644 / (square * square)) * reynolds**0.657)


@law(
    "drag",
    "Beetstra, van der Hoef & Kuipers, AIChE J. 53 (2007) 489, with its erratum, doi:10.1002/aic.11065",
    voidage=(0.4, 1.0),
    reynolds=(0.0, 1e3),
    diameter_ratio=(0.25, 4.0),
)
def beetstra_polydisperse(reynolds: float, voidage: float, diameter_ratio: float) -> float:
    r"""Drag factor of Beetstra, van der Hoef and Kuipers for a sphere in a mixture of sizes.

    .. math:: F_i = (y_i + 0.064\,y_i^3)\,F(Re_i/y_i,\varepsilon),\qquad y_i = d_i/\langle d\rangle

    reynolds        Re_i, on the superficial slip and the diameter of the sphere [-]
    voidage         eps [-]
    diameter_ratio  y_i, diameter of the sphere over the local Sauter mean, > 0 [-]
    returns         F_i, over the Stokes drag of the sphere [-]

    Range: that of :func:`beetstra`, which is F. The published factor of the total force, eps y + (1 - eps) y^2 + 0.064
    eps y^3, includes the term (1 - eps) y^2 of the pressure gradient; without it this factor remains, as in
    CFDEMcoupling. MFIX omits the cubic term. For equal spheres (y = 1) F is 6.4 % above :func:`beetstra`; use beetstra
    for them.

    >>> round(beetstra_polydisperse(0.0, 0.6, 1.0) / beetstra(0.0, 0.6), 9)
    1.064
    """
    factor = diameter_ratio + 0.064 * diameter_ratio * diameter_ratio * diameter_ratio
    return float(factor * beetstra(reynolds / diameter_ratio, voidage))


@law(
    "drag",
    "Tenneti, Garg & Subramaniam, Int. J. Multiphase Flow 37 (2011) 1072, doi:10.1016/j.ijmultiphaseflow.2011.05.010",
    voidage=(0.5, 1.0),
    reynolds=(0.0, 300.0),
)
def tenneti(reynolds: float, voidage: float) -> float:
    r"""Drag factor of Tenneti, Garg and Subramaniam.

    .. math:: F = \varepsilon\left[\frac{F_1}{\varepsilon^3} + \frac{5.81\phi}{\varepsilon^3}
              + \frac{0.48\phi^{1/3}}{\varepsilon^4}
              + \phi^3 Re\left(0.95 + \frac{0.61\phi^3}{\varepsilon^2}\right)\right]

    reynolds  Re, on the superficial slip [-]
    voidage   eps = 1 - phi [-]
    returns   F [-]

    F_1 is :func:`closures.drag_single.schiller_naumann`. The published sum is the total force, hence the leading eps,
    as in waLBerla.

    Range: 0.01 < Re < 300, 0.1 < phi < 0.5.

    >>> round(tenneti(0.0, 0.6) / 0.6, 2)      # total force, phi = 0.4; Hill, Koch & Ladd: 18.5
    18.12
    """
    solids = max(1.0 - voidage, 0.0)
    cube = voidage * voidage * voidage
    creeping = (schiller_naumann(reynolds, 1.0) + 5.81 * solids) / cube + 0.48 * solids ** (1.0 / 3.0) / (
        cube * voidage
    )
    solids_cubed = solids * solids * solids
    inertial = solids_cubed * reynolds * (0.95 + 0.61 * solids_cubed / (voidage * voidage))
    return float(voidage * (creeping + inertial))


@law(
    "drag",
    "Rong, Dong & Yu, Chem. Eng. Sci. 99 (2013) 44, doi:10.1016/j.ces.2013.05.036",
    voidage=(0.37, 1.0),
    reynolds=(0.01, 3e3),
)
def rong(reynolds: float, voidage: float) -> float:
    r"""Drag factor of Rong, Dong and Yu: the form of Di Felice with an exponent fitted to packed beds of equal spheres.

    .. math:: F = F_{Dallavalle}\,\varepsilon^{-\chi},\quad
              \chi = 2.65(\varepsilon+1) - (5.3 - 3.5\varepsilon)\varepsilon^2\exp[-(1.5-\log_{10}Re)^2/2]

    reynolds  Re, on the superficial slip [-]
    voidage   eps [-]
    returns   F [-]; 0.96 at Re = 0, eps = 1

    Range: 0.37 < eps < 1, 0.01 < Re < 3000. The exponent tends to 5.3 for eps = 1 in creeping flow; coefficients as in
    PhasicFlow.

    >>> round(rong(0.0, 0.4), 2), round(150 * 0.6 / (18 * 0.16), 2)      # compared with Ergun
    (28.75, 31.25)
    """
    distance = 1.5 - math.log10(max(reynolds, 1e-12))
    bump = (5.3 - 3.5 * voidage) * voidage * voidage
    chi = 2.65 * (voidage + 1.0) - bump * math.exp(-0.5 * distance * distance)
    return float(dallavalle(reynolds, 1.0) * voidage**-chi)
