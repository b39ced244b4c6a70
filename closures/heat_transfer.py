r"""Heat between a sphere and the fluid around it, and the conductivity of the fluid between spheres.

A law gives the Nusselt number h d/k. By the analogy of heat and mass it also gives the Sherwood number, with the
Schmidt number :math:`Sc = \eta/(\rho D)` in the place of the Prandtl number. Reynolds numbers are those of the
superficial slip, :math:`Re = \rho\,\varepsilon|u-v|\,d/\eta`, as in the laws of drag.
"""

from __future__ import annotations

import math

from closures.registry import law

_RANZ_MARSHALL = "Ranz & Marshall, Chem. Eng. Prog. 48 (1952) 141-146 and 173-180"
_GUNN = "Gunn, Int. J. Heat Mass Transfer 21 (1978) 467-476, doi:10.1016/0017-9310(78)90080-7"
_WAKAO = "Wakao & Kaguei, Heat and Mass Transfer in Packed Beds, Gordon and Breach (1982)"
_ZEHNER = "Zehner & Schluender, Chem. Ing. Tech. 42 (1970) 933-941, doi:10.1002/cite.330421408"


@law("heat_transfer", _RANZ_MARSHALL, reynolds=(0.0, 200.0), prandtl=(0.6, 400.0))
def ranz_marshall(reynolds: float, prandtl: float, voidage: float = 1.0) -> float:
    r"""Nusselt number of a single sphere in a stream.

    .. math:: Nu = \frac{h d}{k} = 2 + 0.6\,(Re/\varepsilon)^{1/2}\,Pr^{1/3}

    reynolds  Re = rho eps |u - v| d / eta, of the superficial slip [-]
    prandtl   Pr = eta c / k of the fluid; Sc for mass [-]
    voidage   eps, which gives the slip of the fluid between the particles [-]
    returns   Nu, or Sh [-]

    Range: 0 < Re < 200, 0.6 < Pr < 400; often used far beyond. The range is from memory and has not been compared with
    the paper. Heat conduction into a fluid at rest gives the 2. In a dense bed the law is too low.

    A sphere of 3.6 mm at 6 m/s in the air of the convection test of MFIX (Re and Pr of its inputs):

    >>> round(ranz_marshall(1376.0, 0.358), 2), ranz_marshall(0.0, 1.0)
    (17.8, 2.0)
    """
    return float(2.0 + 0.6 * math.sqrt(reynolds / voidage) * prandtl ** (1.0 / 3.0))


@law("heat_transfer", _GUNN, reynolds=(0.0, 1e5), voidage=(0.35, 1.0))
def gunn(reynolds: float, prandtl: float, voidage: float) -> float:
    r"""Nusselt number of a particle in a packed or fluidised bed, or alone.

    .. math:: Nu = (7 - 10\varepsilon + 5\varepsilon^2)(1 + 0.7\,Re^{0.2}Pr^{1/3})
              + (1.33 - 2.4\varepsilon + 1.2\varepsilon^2)\,Re^{0.7}Pr^{1/3}

    reynolds  Re = rho eps |u - v| d / eta, of the superficial slip [-]
    prandtl   Pr = eta c / k of the fluid; Sc for mass [-]
    voidage   eps [-]
    returns   Nu, or Sh [-]

    Range: Re < 10^5, 0.35 < eps < 1, by memory. The constants agree with those in two open codes; the paper was not
    read. A sphere alone in a fluid at rest has the exact 2.

    >>> gunn(0.0, 0.7, 1.0), round(gunn(100.0, 0.7, 0.4), 2)
    (2.0, 22.27)
    """
    analogue = prandtl ** (1.0 / 3.0)
    slow = (7.0 + voidage * (5.0 * voidage - 10.0)) * (1.0 + 0.7 * reynolds**0.2 * analogue)
    return float(slow + (1.33 + voidage * (1.2 * voidage - 2.4)) * reynolds**0.7 * analogue)


@law("heat_transfer", _WAKAO, reynolds=(15.0, 8500.0))
def wakao_kaguei(reynolds: float, prandtl: float) -> float:
    r"""Nusselt number of a particle in a packed bed.

    .. math:: Nu = 2 + 1.1\,Re^{0.6}\,Pr^{1/3}

    reynolds  Re = rho eps |u - v| d / eta, of the superficial slip [-]
    prandtl   Pr = eta c / k of the fluid; Sc for mass [-]
    returns   Nu, or Sh [-]

    Range: 15 < Re < 8500, by memory; packed beds only. The equation was compared with that of the library ht of C.
    Bell, from which the number below is; its notes name a fit from Re = 3 to 3000.

    >>> round(wakao_kaguei(2000.0, 0.7), 6)
    95.406413
    """
    return float(2.0 + 1.1 * reynolds**0.6 * prandtl ** (1.0 / 3.0))


@law("fluid_conductivity", _ZEHNER, voidage=(0.3, 1.0))
def zehner_schluender(voidage: float) -> float:
    r"""Conductivity of the fluid between particles, over that of the fluid alone.

    .. math:: k_e/k = 1 - \sqrt{1-\varepsilon}

    voidage  eps [-]
    returns  k_e/k [-]

    Range: 0.3 < eps < 1, by memory. This is the part of their equation that does not pass through particles, as
    two-fluid models use it (Syamlal & Gidaspow, AIChE J. 31 (1985) 127-135) and CFDEMcoupling codes it. What passes
    through particles belongs to their contacts. The same share holds for the diffusion of a species.

    >>> round(zehner_schluender(0.36), 12), zehner_schluender(1.0)
    (0.2, 1.0)
    """
    return float(1.0 - math.sqrt(max(1.0 - voidage, 0.0)))
