r"""A sphere in a liquid layer on a wall: drag on the wetted part, lubrication forces and torques along the wall.

Spin is positive if it moves the lowest point of the sphere in the direction of the velocity.
"""

from __future__ import annotations

import math

from closures.registry import law

_ALONG = "Goldman, Cox & Brenner, Chem. Eng. Sci. 22 (1967) 637"


@law("layer", "White, Viscous Fluid Flow; in Buck et al. (2018), eq. (25)", reynolds=(0.0, 2e5))
def white(reynolds: float) -> float:
    r"""Drag factor of a sphere over Stokes drag (White).

    .. math:: F = 1 + \frac{Re}{4(1+\sqrt{Re})} + \frac{Re}{60}

    reynolds  Re = rho v D / eta; in a layer D = 2 R sin(phi) is the width of the wetted part [-]
    returns   F [-]

    Range: Re < 2e5. From C_D = 24/Re + 6/(1 + sqrt(Re)) + 0.4.

    >>> round(24 / 100 * white(100.0), 3), round(24 / 100 + 6 / 11 + 0.4, 3)
    (1.185, 1.185)
    """
    return 1.0 + reynolds / (4.0 * (1.0 + math.sqrt(reynolds))) + reynolds / 60.0


@law("layer", f"{_ALONG}, translation")
def sliding_force(gap_ratio: float) -> float:
    r"""Force on a sphere that slides along a nearby wall, over 6 pi eta R v_t.

    .. math:: \tfrac{8}{15}\ln(R/h) + 0.9588

    gap_ratio  h/R, > 0 [-]
    returns    factor [-]

    Range: h/R below about 0.1.

    >>> round(sliding_force(0.003202), 3)       # exact solution of the same authors: 4.0223
    4.022
    """
    return 0.9588 - 8.0 / 15.0 * math.log(gap_ratio)


@law("layer", f"{_ALONG}, rotation")
def spin_force(gap_ratio: float) -> float:
    r"""Force on a sphere that spins near a wall, over 6 pi eta R (omega R).

    .. math:: \tfrac{2}{15}\ln(R/h) - 0.2526

    gap_ratio  h/R, > 0 [-]
    returns    factor [-]

    Range: h/R below about 0.1. Buck et al. (2018), eq. (29), have + 0.2526.

    >>> round(spin_force(0.003202), 3)
    0.513
    """
    return -0.2526 - 2.0 / 15.0 * math.log(gap_ratio)


@law("layer", f"{_ALONG}, translation")
def sliding_torque(gap_ratio: float) -> float:
    r"""Torque on a sphere that slides along a nearby wall, over 8 pi eta R^2 v_t.

    .. math:: \tfrac{1}{10}\ln(R/h) - 0.1895

    gap_ratio  h/R, > 0 [-]
    returns    factor [-]; 3/4 of :func:`spin_force`, by reciprocity

    Range: h/R below about 0.1. Buck et al. (2018), eq. (30), have + 0.1895.

    >>> round(sliding_torque(0.003202), 3)
    0.385
    """
    return -0.1895 - 0.1 * math.log(gap_ratio)


@law("layer", f"{_ALONG}, rotation")
def spin_torque(gap_ratio: float) -> float:
    r"""Torque on a sphere that spins near a wall, over 8 pi eta R^2 (omega R).

    .. math:: \tfrac{2}{5}\ln(R/h) + 0.3817

    gap_ratio  h/R, > 0 [-]
    returns    factor [-]

    Range: h/R below about 0.1.

    >>> round(spin_torque(0.003202), 3)
    2.679
    """
    return 0.3817 - 0.4 * math.log(gap_ratio)
