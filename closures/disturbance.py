r"""Flow that a particle causes at its own position when its force is distributed by a kernel."""

from __future__ import annotations

import math

from closures.registry import law


@law("disturbance", "Oseen's equation with a Gaussian force, integrated over wave numbers")
def oseen_share(reynolds: float) -> float:
    r"""Self-induced velocity of a moving force over its value in creeping flow.

    .. math:: \Psi = \frac{3}{\sqrt\pi}\int_0^1 (1-\mu^2)\left[\frac{\sqrt\pi}{2} - \frac{\pi}{2} R\mu\,
              e^{R^2\mu^2}\mathrm{erfc}(R\mu)\right]d\mu,\qquad R = \rho U s/\eta

    reynolds  R, with the width s of the kernel as length [-]
    returns   Psi [-]; 1 at rest, 4/(3 R) for R >> 1

    With E = exp(R^2) erfc(R) and G = (E - 1 + 2R/sqrt(pi))/(2 R^2), the integral of the second term is
    G/R^2 + 2/(3 sqrt(pi) R) - 1/(2 R^2).

    Range: disturbances small compared with U, which holds for kernels wider than the sphere.

    >>> round(oseen_share(0.0), 12), round(oseen_share(1.0), 4)
    (1.0, 0.5903)
    """
    if reynolds < 0.05:
        # series of the integrand: the closed form loses digits here
        second = 0.25 - 4.0 * reynolds / (15.0 * math.sqrt(math.pi)) + reynolds * reynolds / 12.0
    else:
        if reynolds < 20.0:
            scaled = math.exp(reynolds * reynolds) * math.erfc(reynolds)
        else:
            scaled = (1.0 - 0.5 / (reynolds * reynolds)) / (reynolds * math.sqrt(math.pi))
        square = reynolds * reynolds
        growth = (scaled - 1.0 + 2.0 * reynolds / math.sqrt(math.pi)) / (2.0 * square)
        second = growth / square + 2.0 / (3.0 * math.sqrt(math.pi) * reynolds) - 0.5 / square
    return 3.0 / math.sqrt(math.pi) * (math.sqrt(math.pi) / 3.0 - 0.5 * math.pi * reynolds * second)


@law("disturbance", "fitted to the Oseen share of a Gaussian kernel, R = 0.03 ... 100")
def wake_decay(reynolds: float) -> float:
    r"""Decay rate of the self-induced velocity as the particle moves away from its wake, over nu/s^2.

    .. math:: b = \frac{3}{8}\,\frac{R^2}{R + 2.6},\qquad R = \rho U s/\eta

    reynolds  R, with the width s of the kernel as length [-]
    returns   b [-]

    Range: any; b = 3/8 R for R >> 1. Modes that build up at the rates y_k of the creeping kernel and decay at y_k + b
    have a steady sum close to :func:`oseen_share`; a scale factor removes the remaining difference.

    >>> round(wake_decay(1.0), 4)
    0.1042
    """
    return 0.375 * reynolds * reynolds / (reynolds + 2.6)
