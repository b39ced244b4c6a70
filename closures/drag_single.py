r"""Drag of an isolated sphere, as the factor F over Stokes drag.

.. math:: F_d = 3\pi\eta d\,U\,F(Re),\qquad F = C_D\,Re/24

Every law takes the voidage as well, without using it, so that it can replace a drag law of a bed.
"""

from __future__ import annotations

import math

from closures.registry import law


@law("drag", "Stokes, Trans. Camb. Phil. Soc. 9 (1851) 8", reynolds=(0.0, 0.1))
def stokes(reynolds: float, voidage: float) -> float:
    r"""Drag factor of a sphere in creeping flow (Stokes).

    .. math:: F = 1

    reynolds  Re = rho U d / eta, not used [-]
    voidage   eps, not used [-]
    returns   F [-]

    Range: Re < 0.1; too low above.

    >>> stokes(0.01, 1.0)
    1.0
    """
    return 1.0


@law("drag", "Schiller & Naumann, Z. Ver. Dtsch. Ing. 77 (1933) 318; 0.44 above Re = 1000", reynolds=(0.0, 2e5))
def schiller_naumann(reynolds: float, voidage: float) -> float:
    r"""Drag factor of a sphere up to the drag crisis (Schiller and Naumann).

    .. math:: F = 1 + 0.15\,Re^{0.687}\ (Re\le1000),\qquad 0.44\,Re/24\ (Re>1000)

    reynolds  Re = rho U d / eta [-]
    voidage   eps, not used [-]
    returns   F [-]

    Range: Re < 2e5; the two branches differ by 0.4 % at Re = 1000. From C_D = 24/Re (1 + 0.15 Re^0.687).

    >>> round(24 / 100 * schiller_naumann(100.0, 1.0), 2)      # C_D at Re = 100
    1.09
    """
    if reynolds > 1000.0:
        return 0.44 * reynolds / 24.0
    return float(1.0 + 0.15 * reynolds**0.687)


@law("drag", "Dallavalle, Micromeritics (1948)", reynolds=(0.01, 3e3))
def dallavalle(reynolds: float, voidage: float) -> float:
    r"""Drag factor of a sphere (Dallavalle); the isolated sphere of Di Felice's law.

    .. math:: F = (4.8 + 0.63\sqrt{Re})^2/24

    reynolds  Re = rho U d / eta [-]
    voidage   eps, not used [-]
    returns   F [-]; 0.96 at Re = 0, 4 % below Stokes as published

    Range: 0.01 < Re < 3000; 14 % above the standard drag curve at Re = 100, 30 % at 1000. From C_D = (0.63 +
    4.8/sqrt(Re))^2.

    >>> round(24 / 100 * dallavalle(100.0, 1.0), 4)
    1.2321
    """
    root = 4.8 + 0.63 * math.sqrt(reynolds)
    return root * root / 24.0


@law("drag", "Abraham, Phys. Fluids 13 (1970) 2194, doi:10.1063/1.1693218", reynolds=(0.0, 5e3))
def abraham(reynolds: float, voidage: float) -> float:
    r"""Drag factor of a sphere from its boundary-layer thickness (Abraham).

    .. math:: F = (1 + \sqrt{Re}/9.06)^2

    reynolds  Re = rho U d / eta [-]
    voidage   eps, not used [-]
    returns   F [-]

    Range: Re < 5000. From C_D = 24/9.06^2 (1 + 9.06/sqrt(Re))^2.

    >>> round(24 / 100 * abraham(100.0, 1.0), 2)
    1.06
    """
    root = 1.0 + math.sqrt(reynolds) / 9.06
    return root * root


@law("drag", "Brown & Lawler, J. Environ. Eng. 129 (2003) 222", reynolds=(0.0, 2e5))
def brown_lawler(reynolds: float, voidage: float) -> float:
    r"""Drag factor of a sphere, fitted to experiments corrected for wall effects (Brown and Lawler).

    .. math:: F = 1 + 0.15\,Re^{0.681} + \frac{0.407\,Re^2}{24\,(Re + 8710)}

    reynolds  Re = rho U d / eta [-]
    voidage   eps, not used [-]
    returns   F [-]

    Range: Re < 2e5. From C_D = 24/Re (1 + 0.150 Re^0.681) + 0.407/(1 + 8710/Re).

    >>> round(24 / 100 * brown_lawler(100.0, 1.0), 3)
    1.073
    """
    return float(1.0 + 0.15 * reynolds**0.681 + 0.407 * reynolds * reynolds / (24.0 * (reynolds + 8710.0)))


@law("drag", "Clift, Grace & Weber, Bubbles, Drops, and Particles (1978), table 5.2", reynolds=(0.0, 1e6))
def clift(reynolds: float, voidage: float) -> float:
    r"""Drag factor of a sphere on the standard drag curve, including the drag crisis (Clift, Grace and Weber).

    .. math:: F = 1 + 0.1315\,Re^{0.82 - 0.05 w}\ (Re<20),\qquad 1 + 0.1935\,Re^{0.6305}\ (Re<260),\qquad
              C_D = 10^{P(w)}\ (Re<3.38\cdot10^5),\qquad w = \log_{10}Re,\quad F = C_D Re/24

    reynolds  Re = rho U d / eta [-]
    voidage   eps, not used [-]
    returns   F [-]

    Range: Re < 1e6. The pieces meet within 0.8 %, except at Re = 4e5 in the drag crisis, where C_D drops by 21 %. P(w)
    is 1.6435 - 1.1242 w + 0.1558 w^2 below Re = 1500, then -2.4571 + 2.5558 w - 0.9295 w^2 + 0.1049 w^3 below 12 000,
    -1.9181 + 0.6370 w - 0.0636 w^2 below 44 000, -4.3390 + 1.5809 w - 0.1546 w^2 below 338 000; in the drag crisis C_D
    = 29.78 - 5.3 w below 4e5, 0.1 w - 0.49 below 1e6 and 0.19 - 8e4/Re above.

    >>> round(24 / 200 * clift(200.0, 1.0), 4)      # C_D at Re = 200, equal to the library `fluids`
    0.7756
    """
    if reynolds < 0.01:
        return 1.0 + reynolds / 128.0
    w = math.log10(reynolds)
    if reynolds < 20.0:
        return float(1.0 + 0.1315 * reynolds ** (0.82 - 0.05 * w))
    if reynolds < 260.0:
        return float(1.0 + 0.1935 * reynolds**0.6305)
    if reynolds < 1500.0:
        coefficient = 10.0 ** (1.6435 + w * (-1.1242 + 0.1558 * w))
    elif reynolds < 1.2e4:
        coefficient = 10.0 ** (-2.4571 + w * (2.5558 + w * (-0.9295 + 0.1049 * w)))
    elif reynolds < 4.4e4:
        coefficient = 10.0 ** (-1.9181 + w * (0.6370 - 0.0636 * w))
    elif reynolds < 3.38e5:
        coefficient = 10.0 ** (-4.3390 + w * (1.5809 - 0.1546 * w))
    elif reynolds < 4e5:
        coefficient = 29.78 - 5.3 * w
    elif reynolds < 1e6:
        coefficient = 0.1 * w - 0.49
    else:
        coefficient = 0.19 - 8e4 / reynolds
    return float(coefficient * reynolds / 24.0)
