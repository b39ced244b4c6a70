"""Why the surface of a liquid bed is too dense: weight and drag alone, in one dimension, seen through the kernel.

Near the surface the kernel mixes bed and clear liquid. Particles there feel the drag of a looser bed and sink, until
the solid fraction *seen* balances the weight up to the last layer. Only a layer near the random packing above a gap
does that. Contacts, films and agitation are not part of this model; the runs show the same layer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

SPACING = 0.2
"""Of the layers [d]."""

TIME = 110.0
"""Until the profile is steady [d/U]."""


class Profile(NamedTuple):
    """A steady bed in one dimension."""

    height: np.ndarray  # of the layers [d]
    solid_fraction: np.ndarray
    voidage: float  # mean, from the height below which 99 % of the particles lie


def settled(
    kernel_width: float,
    *,
    cell: float = 2.5,
    balance: float = 0.616,
    exponent: float = 3.3,
    height: float = 21.0,
    packed: float = 0.62,
    dispersion: float = 0.05,
) -> Profile:
    r"""The bed that settles from a uniform one with a sharp surface.

    .. math:: \partial_t\varphi + \partial_z(\varphi v) = D\,\partial_z^2\varphi,\qquad
              v/U = S\frac{1}{1-S\varphi} - \frac{(1 - S\varphi)^{n-1}}{\varepsilon_b^n}

    kernel_width  of the case [d]
    cell          edge of the cells, which widen what a particle sees [d]
    balance       voidage eps_b at which weight and drag balance [-]
    exponent      n of Richardson and Zaki [-]
    height        of the bed at the balance [d]
    packed        largest solid fraction [-]
    dispersion    D/(U d) [-]
    """
    count = round(1.5 * height / SPACING)
    places = (np.arange(count) + 0.5) * SPACING
    own = cell**2 / 6.0
    smooth = _smoothing(places, math.sqrt(max(kernel_width**2, own) + own))
    above = 1.0 - smooth.sum(axis=1)  # weight of the clear liquid above the layers
    solids = np.where(places < height, 1.0 - balance, 0.0)
    step = 0.06 * SPACING
    for _ in range(round(TIME / step)):
        seen = 1.0 - smooth @ solids
        speed = smooth @ (1.0 / seen) + above - seen ** (exponent - 1.0) / balance**exponent
        between = 0.5 * (speed[1:] + speed[:-1])
        flux = between * np.where(between > 0.0, solids[:-1], solids[1:]) - dispersion * np.diff(solids) / SPACING
        flux[np.where(flux > 0.0, solids[1:], solids[:-1]) >= packed] = 0.0
        solids -= step / SPACING * np.diff(flux, prepend=0.0, append=0.0)
    total = solids.sum() * SPACING
    top = float(np.interp(0.99 * total, np.cumsum(solids) * SPACING, places + 0.5 * SPACING))
    return Profile(places, solids, 1.0 - 0.99 * total / top)


def _smoothing(places: np.ndarray, width: float) -> np.ndarray:
    """Weights of a Gaussian mean over layers, mirrored at the floor; rows add up to less than one near the top."""
    apart, mirrored = places[:, None] - places, places[:, None] + places
    weights = np.exp(-0.5 * (apart / width) ** 2) + np.exp(-0.5 * (mirrored / width) ** 2)
    return np.asarray(weights * SPACING / (width * math.sqrt(2.0 * math.pi)))
