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

RATE_RATIO = 3.0
"""Each rate of the exponentials over the one before."""

MEI_ADRIAN_SLOWEST = 9e-4
"""Smallest rate of the exponentials of `mei_adrian`, times t_c [-]."""

MEI_ADRIAN_AMPLITUDES = (
    1.117919748356e-06, 7.708203237899e-06, 6.970184630291e-05, 6.017130905299e-04, 4.914016403769e-03,
    3.577661030399e-02, 2.044897080453e-01, 7.584557845298e-01, 1.668662494733e00, 2.807963608812e00,
    4.687906631756e00, 7.946069251683e00, 1.365838222410e01, 2.354355983478e01, 4.073347264465e01,
    7.045832064379e01, 1.220812341743e02, 2.111933876078e02, 3.665121998282e02, 6.314799251931e02,
    1.127778880347e03,
)  # fmt: skip
r"""Amplitudes of the exponentials of :math:`g(x) = x^{-1/2}(1 + x^{3/4})^{-2}`: least squares of the relative error
for 1e-6 < x < 1e3. The integral of the sum from 1e-6 to any x is within 0.02 % of that of g."""

MEI_ADRIAN_MISSING = 4.7e-4
"""Integral of g less that of the exponentials, from 0 to 1e-4: what they lack near 0, where g is singular."""

BASSET_SLOWEST = 2e-5
"""Smallest rate of the exponentials of `basset`, times d^2/nu [-]."""

BASSET_AMPLITUDES = (
    9.170385138065e-03, 1.807977943085e-03, 8.672918179457e-03, 1.446630624668e-02, 2.487737581598e-02,
    4.326995628214e-02, 7.478731622934e-02, 1.296846091602e-01, 2.244744461444e-01, 3.889457286794e-01,
    6.735301936263e-01, 1.166730015465e00, 2.020700052806e00, 3.500073217967e00, 6.062239207221e00,
    1.050001389389e01, 1.818712353003e01, 3.149903534191e01, 5.456417802432e01, 9.448889788524e01,
    1.637168999669e02, 2.833948719276e02, 4.913347018124e02, 8.510429129413e02, 1.249621440754e03,
)  # fmt: skip
r"""Amplitudes of the exponentials of :math:`g(x) = x^{-1/2}`: least squares of the relative error for
1e-6 < x < 1e4, which is 0.04 %."""

BASSET_MISSING = 3.95e-4
"""Integral of g less that of the exponentials, from 0 to 1e-4."""


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
