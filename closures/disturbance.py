r"""The flow that a particle itself makes where it is looked for, when its force is spread over a kernel."""

from __future__ import annotations

import math

from closures.law import law


@law("disturbance", "Oseen's equation with a Gaussian force, integrated over wave numbers")
def oseen_share(reynolds: float) -> float:
    r"""What is left of the creeping mobility where the force moves through the fluid.

    .. math:: \Psi = \frac{3}{\sqrt\pi}\int_0^1 (1-\mu^2)\left[\frac{\sqrt\pi}{2} - \frac{\pi}{2} R\mu\,
              e^{R^2\mu^2}\mathrm{erfc}(R\mu)\right]d\mu,\qquad R = \rho U s/\eta

    reynolds  R, on the width of the kernel [-]
    returns   Psi, from 1 at rest to 4/(3 R) far above 1 [-]

    The integral is known: with E = exp(R^2) erfc(R) and G = (E - 1 + 2R/sqrt(pi))/(2 R^2),
    the second part is G/R^2 + 2/(3 sqrt(pi) R) - 1/(2 R^2).

    Range: disturbances that are small against U, as those of kernels wider than the sphere are.

    >>> round(oseen_share(0.0), 12), round(oseen_share(1.0), 4)
    (1.0, 0.5903)
    """
    if reynolds < 0.05:
        # the closed form loses digits; series of its integrand
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
def left_behind(reynolds: float) -> float:
    r"""Rate at which a moving particle leaves its own wind, over nu/s^2.

    .. math:: b = \frac{3}{8}\,\frac{R^2}{R + 2.6},\qquad R = \rho U s/\eta

    reynolds  R, on the width of the kernel [-]
    returns   b [-]

    Range: any. With winds that build up at the rates y_k of a creeping kernel and fade at y_k + b, the steady sum is
    near the Oseen share; what is left is scaled away. Far above R = 1, b is 3/8 R.

    >>> round(left_behind(1.0), 4)
    0.1042
    """
    return 0.375 * reynolds * reynolds / (reynolds + 2.6)
