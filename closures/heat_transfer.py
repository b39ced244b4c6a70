"""Heat between a sphere and the fluid around it."""

from __future__ import annotations

import math

from closures.registry import law

_RANZ_MARSHALL = "Ranz & Marshall, Chem. Eng. Prog. 48 (1952) 141-146 and 173-180"


@law("heat_transfer", _RANZ_MARSHALL, reynolds=(0.0, 200.0), prandtl=(0.6, 400.0))
def ranz_marshall(reynolds: float, prandtl: float) -> float:
    r"""Nusselt number of a single sphere in a stream.

    .. math:: Nu = \frac{h d}{k} = 2 + 0.6\,Re^{1/2}\,Pr^{1/3}

    reynolds  Re = rho |u - v| d / eta, of the slip [-]
    prandtl   Pr = eta c / k of the fluid [-]
    returns   Nu [-]

    Range: 0 < Re < 200, 0.6 < Pr < 400; often used far beyond. The range is from memory and has not been compared with
    the paper. Heat conduction into a fluid at rest gives the 2.

    A sphere of 3.6 mm at 6 m/s in the air of the convection test of MFIX (Re and Pr of its inputs):

    >>> round(ranz_marshall(1376.0, 0.358), 2), ranz_marshall(0.0, 1.0)
    (17.8, 2.0)
    """
    return float(2.0 + 0.6 * math.sqrt(reynolds) * prandtl ** (1.0 / 3.0))
