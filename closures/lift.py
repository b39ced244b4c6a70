"""Lift on a sphere in shear or with spin, and the fluid torque against its spin."""

from __future__ import annotations

import math

from closures.registry import law


@law("lift", "Saffman, J. Fluid Mech. 22 (1965) 385; Mei, Int. J. Multiphase Flow 18 (1992) 145", reynolds=(0.0, 100.0))
def saffman_mei(reynolds: float, shear_reynolds: float) -> float:
    r"""Shear lift over Stokes drag 3 pi eta d U (Saffman, with Mei's correction).

    .. math:: \frac{F_L}{3\pi\eta dU} = \frac{1.615\sqrt{Re_s}}{3\pi}f,\quad
              f = (1-0.3314\sqrt\beta)e^{-Re/10} + 0.3314\sqrt\beta\ (Re\le40),\ 0.0524\sqrt{\beta Re}\ (Re>40)

    reynolds        Re, on the slip, >= 0 [-]
    shear_reynolds  Re_s = rho d^2 omega / eta, with the vorticity omega, >= 0; beta = Re_s / (2 Re) [-]
    returns         lift factor [-]

    Range: Re < 100, 0.005 < beta < 0.4; drops by 14 % at Re = 40 for beta = 0.1. Coefficients as in OpenFOAM.

    >>> round(saffman_mei(1e-9, 1e-12) * 3 * math.pi / 1e-6, 3)
    1.615
    """
    reynolds = max(reynolds, 1e-30)
    beta = 0.5 * shear_reynolds / reynolds
    if reynolds <= 40.0:
        gone = -math.expm1(-0.1 * reynolds)
        correction = 1.0 - gone + 0.3314 * math.sqrt(beta) * gone
    else:
        correction = 0.0524 * math.sqrt(beta * reynolds)
    return 1.615 * math.sqrt(shear_reynolds) * correction / (3.0 * math.pi)


@law("lift", "Rubinow & Keller, J. Fluid Mech. 11 (1961) 447; Lun & Liu, Int. J. Multiphase Flow 23 (1997) 575")
def magnus(reynolds: float) -> float:
    r"""Spin (Magnus) lift over that of Rubinow and Keller, pi/8 rho d^3 omega U.

    .. math:: 1\ (Re\le1),\qquad 0.178 + 0.822 Re^{-0.522}\ (Re>1)

    reynolds  Re, on the slip [-]
    returns   lift factor [-]

    Range: Re < 1000; continuous at Re = 1. omega is the spin relative to half the vorticity of the fluid.

    >>> magnus(0.5), round(magnus(1.0000001), 6)
    (1.0, 1.0)
    """
    if reynolds <= 1.0:
        return 1.0
    return float(0.178 + 0.822 * reynolds**-0.522)


@law("lift", "Dennis, Singh & Ingham, J. Fluid Mech. 101 (1980) 257", spin_reynolds=(0.0, 1e3))
def torque(spin_reynolds: float) -> float:
    r"""Fluid torque against spin over its creeping value pi eta d^3 omega.

    .. math:: 1\ (Re_r\le32),\qquad (12.9\sqrt{Re_r} + 128.4)/(64\pi)\ (Re_r>32)

    spin_reynolds  Re_r = rho d^2 omega / eta [-]
    returns        torque factor [-]

    Range: Re_r < 1000; jumps up by 0.2 % at 32. omega is the spin relative to half the vorticity of the fluid.
    Published as C = 64 pi / Re_r and 12.9 / sqrt(Re_r) + 128.4 / Re_r over rho/2 (d/2)^5 omega^2; coefficients as in
    Kratos.

    >>> torque(1.0)
    1.0
    """
    if spin_reynolds <= 32.0:
        return 1.0
    return (12.9 * math.sqrt(spin_reynolds) + 128.4) / (64.0 * math.pi)
