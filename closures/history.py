r"""History force: the memory of the flow around a sphere of its earlier acceleration.

A sphere that accelerates sheds vorticity, which diffuses away from it. The force on it depends on how fast it
accelerated before,

.. math:: F = 3\pi\eta d\int_{-\infty}^t K(t-\tau)\,\frac{d(u-v)}{d\tau}\,d\tau

with a kernel K that decays with the elapsed time. Both kernels here have the form :math:`K = A\,g(s/t_c)`, so that a
sum of exponentials that is fitted to g once holds for every sphere and slip.
"""

from __future__ import annotations

import math

from closures.registry import law

CUBE_ROOT = (4.0 / math.pi) ** (1.0 / 3.0)

RATE_RATIO = 3.5
"""Each rate of the exponentials over the one before."""

MEI_ADRIAN_SLOWEST = 1.2e-2
"""Smallest rate of the exponentials of `mei_adrian`, times t_c [-]."""

MEI_ADRIAN_AMPLITUDES = (
    2.675553643506e-04, 1.731667086739e-03, 2.070191891732e-02, 1.630008580296e-01, 7.932170090181e-01,
    1.972046641442e+00, 3.535972216383e+00, 6.391271902971e+00, 1.173504844851e+01, 2.183729266349e+01,
    4.072828401763e+01, 7.611705632630e+01, 1.424263144743e+02, 2.660552043807e+02, 4.990737755514e+02,
    9.290640947184e+02, 1.723051923709e+03, 4.163222312803e+03,
)  # fmt: skip
r"""Amplitudes of the exponentials of :math:`g(x) = x^{-1/2}(1 + x^{3/4})^{-2}`: least squares of the relative error of
the Laplace transform at the frequencies 2e-4 to 4e6, real and imaginary, all amplitudes positive. The error is at most
0.17 %; that of the second integral, for 1e-6 < x < 1e3, 0.012 %."""

MEI_ADRIAN_MISSING = 0.0001376562
"""Integral of g less that of the exponentials near 0, where g is singular; from the same fit."""

BASSET_SLOWEST = 1e-4
"""Smallest rate of the exponentials of `basset`, times d^2/nu [-]."""

BASSET_AMPLITUDES = (
    1.998207958421e-02, 7.400877460067e-03, 2.608580523052e-02, 4.577495960660e-02, 8.692961165999e-02,
    1.616666099645e-01, 3.033399679696e-01, 5.666324568860e-01, 1.060934394246e+00, 1.983965155646e+00,
    3.712529609030e+00, 6.944607151414e+00, 1.299317368844e+01, 2.430663461077e+01, 4.547615908339e+01,
    8.507110961527e+01, 1.591739847118e+02, 2.977315467882e+02, 5.569509184407e+02, 1.046847936454e+03,
    1.833878505899e+03, 5.253336666822e+03,
)  # fmt: skip
r"""Amplitudes of the exponentials of :math:`g(x) = x^{-1/2}`, fitted in the same way at the frequencies 1e-3 to 4e6;
the error is at most 0.1 %. After 1e4 d^2/nu the sum decays faster than g."""

BASSET_MISSING = 0.0001103348
"""Integral of g less that of the exponentials near 0."""


@law("history", "Basset (1888); e.g. Maxey & Riley, Phys. Fluids 26 (1983) 883")
def basset(elapsed: float, slip: float, diameter: float, kinematic_viscosity: float) -> float:
    r"""Kernel of the history force for creeping flow.

    .. math:: K(s) = \frac{d}{2\sqrt{\pi\nu s}}

    elapsed              s, time since the acceleration, > 0 [s]
    slip                 not used [m/s]
    diameter             d [m]
    kinematic_viscosity  nu [m2/s]
    returns              K [-]

    Range: Re << 1; at finite Re the wake decays faster, see :func:`mei_adrian`.

    >>> round(basset(1.0, 0.0, 1.0, 1.0 / math.pi), 12)
    0.5
    """
    return diameter / (2.0 * math.sqrt(math.pi * kinematic_viscosity * elapsed))


@law("history", "Mei & Adrian, J. Fluid Mech. 237 (1992) 323: time at which both terms of the kernel are equal")
def decay_time(slip: float, diameter: float, kinematic_viscosity: float) -> float:
    r"""Time after which convection carries the memory of the flow away.

    .. math:: t_c = \left(\frac4\pi\right)^{1/3}\frac{\nu f_H^2}{U^2},\qquad f_H = 0.75 + 0.105\,\frac{Ud}{\nu}

    slip                 U, speed of the sphere relative to the fluid, > 0 [m/s]
    diameter             d [m]
    kinematic_viscosity  nu [m2/s]
    returns              t_c [s]

    Range: see :func:`mei_adrian`. It grows beyond all limits as U vanishes.

    >>> round(decay_time(0.07, 5e-4, 1e-6) * 1e3, 2)     # glass bead of 0.5 mm at its terminal velocity in water
    4.33
    """
    fraction = 0.75 + 0.105 * slip * diameter / kinematic_viscosity
    return float(CUBE_ROOT * kinematic_viscosity * (fraction / slip) ** 2)


@law("history", "Mei & Adrian, J. Fluid Mech. 237 (1992) 323")
def mei_adrian(elapsed: float, slip: float, diameter: float, kinematic_viscosity: float) -> float:
    r"""Kernel of the history force at finite Reynolds number.

    .. math:: K(s) = \left\{\left[\frac{4\pi\nu s}{d^2}\right]^{1/4}
              + \left[\frac{\pi U^3s^2}{d\nu f_H^3}\right]^{1/2}\right\}^{-2}
              = \frac{d}{2\sqrt{\pi\nu s}}\,\left(1 + (s/t_c)^{3/4}\right)^{-2}

    elapsed              s, time since the acceleration, > 0 [s]
    slip                 U, speed of the sphere relative to the fluid, >= 0 [m/s]
    diameter             d [m]
    kinematic_viscosity  nu [m2/s]
    returns              K [-]

    with t_c of :func:`decay_time`.

    Range: a single sphere, Re up to about 300, small changes of the slip; used for any change. No kernel is published
    for suspensions.

    >>> s = decay_time(0.1, 1e-3, 1e-6)
    >>> round(mei_adrian(s, 0.1, 1e-3, 1e-6) / basset(s, 0.1, 1e-3, 1e-6), 12)
    0.25
    """
    if slip == 0.0:
        return basset(elapsed, slip, diameter, kinematic_viscosity)
    decay = (1.0 + (elapsed / decay_time(slip, diameter, kinematic_viscosity)) ** 0.75) ** 2
    return float(basset(elapsed, slip, diameter, kinematic_viscosity) / decay)
