r"""Drag of a sphere in a suspension or bed, as the factor F over Stokes drag; all laws in one normal form.

.. math:: F_d = 3\pi\eta d\,U\,F(Re,\varepsilon),\qquad U = \varepsilon|u-v|,\qquad Re = \rho U d/\eta

F_d excludes the force of the mean pressure gradient; the total fluid force is F_d / eps. The exchange coefficient of
model A is 18 eta eps (1 - eps) F / d^2. Laws fitted to particle-resolved simulations are in drag_resolved.py.
"""

from __future__ import annotations

import math

from closures.drag_single import dallavalle, schiller_naumann
from closures.registry import law


@law("drag", "Wen & Yu, Chem. Eng. Prog. Symp. Ser. 62 (1966) 100", voidage=(0.4, 1.0), reynolds=(0.0, 1e3))
def wen_yu(reynolds: float, voidage: float) -> float:
    r"""Drag factor of Wen and Yu, in the form given by Gidaspow.

    .. math:: F = \varepsilon^{-3.65}\,(1 + 0.15\,Re^{0.687})

    reynolds  Re, on the superficial slip [-]
    voidage   eps [-]
    returns   F [-]

    Range: eps > 0.8 in gas, eps > 0.4 in liquid; C_D = 0.44 above Re = 1000. The exchange coefficient is 3/4 C_D eps
    (1-eps) rho |u-v| eps^-2.65 / d with C_D = 24 F_1/Re; the superficial slip takes one more factor eps. Wen and Yu's
    own total force scales as eps^-4.7, which gives eps^-3.7 here. MFIX and OpenFOAM use the form of Gidaspow as well.

    >>> wen_yu(0.0, 0.5) == 0.5**-3.65
    True
    """
    return float(schiller_naumann(reynolds, 1.0) * voidage**-3.65)


@law("drag", "Ergun, Chem. Eng. Prog. 48 (1952) 89", voidage=(0.36, 0.8))
def ergun(reynolds: float, voidage: float) -> float:
    r"""Drag factor of a packed bed (Ergun).

    .. math:: F = \frac{150\,(1-\varepsilon)}{18\,\varepsilon^2} + \frac{1.75\,Re}{18\,\varepsilon^2}

    reynolds  Re, on the superficial slip [-]
    voidage   eps [-]
    returns   F [-]

    Range: 0.36 < eps < 0.8; F tends to 0 instead of 1 for dilute suspensions. From dp/dx = 18 eta (1-eps) F U / (eps
    d^2).

    >>> round(18 * ergun(100.0, 0.5), 6)      # 150 + 1.75 * 100 * 2, times 2
    1000.0
    """
    return (150.0 * (1.0 - voidage) + 1.75 * reynolds) / (18.0 * voidage * voidage)


@law("drag", "Gidaspow, Multiphase Flow and Fluidization (1994)", voidage=(0.36, 1.0))
def gidaspow(reynolds: float, voidage: float) -> float:
    r"""Drag factor of Gidaspow: Ergun for eps <= 0.8, Wen and Yu above.

    .. math:: F = F_{Ergun}\ (\varepsilon\le0.8),\qquad F_{WenYu}\ (\varepsilon>0.8)

    reynolds  Re, on the superficial slip [-]
    voidage   eps [-]
    returns   F [-]

    Range: eps > 0.36. F jumps at eps = 0.8: Wen and Yu over Ergun is 0.87 at Re = 0 and 0.58 at Re = 100.

    >>> round(gidaspow(0.0, 0.8), 3), round(gidaspow(0.0, 0.8000001), 3)
    (2.604, 2.258)
    """
    if voidage > 0.8:
        return wen_yu(reynolds, voidage)
    return ergun(reynolds, voidage)


@law("drag", "Huilin & Gidaspow, Chem. Eng. Sci. 58 (2003) 3777", voidage=(0.36, 1.0))
def gidaspow_smooth(reynolds: float, voidage: float) -> float:
    r"""Drag factor of Gidaspow with a smooth transition.

    .. math:: F = (1-\varphi)F_{Ergun} + \varphi F_{WenYu},\quad
              \varphi = \tfrac12 + \arctan(262.5\,(\varepsilon - 0.8))/\pi

    reynolds  Re, on the superficial slip [-]
    voidage   eps [-]
    returns   F [-]

    Range: eps > 0.36; equal shares at eps = 0.8. At eps = 1 and Re = 0, F is 0.6 % too low: the share that Ergun still
    has.

    >>> round(gidaspow_smooth(0.0, 0.8), 3)
    2.431
    """
    share = 0.5 + math.atan(262.5 * (voidage - 0.8)) / math.pi
    return (1.0 - share) * ergun(reynolds, voidage) + share * wen_yu(reynolds, voidage)


@law("drag", "Di Felice, Int. J. Multiphase Flow 20 (1994) 153, doi:10.1016/0301-9322(94)90011-6", voidage=(0.4, 1.0))
def di_felice(reynolds: float, voidage: float) -> float:
    r"""Drag factor of Di Felice, from packed beds to isolated spheres.

    .. math:: F = F_{Dallavalle}\,\varepsilon^{-\chi},\quad \chi = 3.7 - 0.65\exp[-(1.5-\log_{10}Re)^2/2]

    reynolds  Re, on the superficial slip [-]
    voidage   eps [-]
    returns   F [-]; 0.96 at Re = 0, eps = 1

    Range: 0.01 < Re < 1e4. A bed expands with a Richardson-Zaki exponent of 4.7 at low Re.

    >>> round(di_felice(10**1.5, 0.5) / di_felice(10**1.5, 1.0), 3)      # chi = 3.05
    8.282
    """
    distance = 1.5 - math.log10(max(reynolds, 1e-12))
    chi = 3.7 - 0.65 * math.exp(-0.5 * distance * distance)
    return float(dallavalle(reynolds, 1.0) * voidage**-chi)
