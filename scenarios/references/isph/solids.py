r"""Plate and bead as continuous solids: sums over their particles become integrals over the part within the kernel.

A liquid particle at a distance d from a solid sees it, along the unit normal n that points away from it, through
integrals over the solid within reach, with the part l of each distance s that is along -n:

.. math:: A = \int a\,\mathrm{d}V,\quad B = \int a\,l\,\mathrm{d}V,\quad
          G = \int |W'|\,\frac{l}{s}\,\mathrm{d}V,\quad C = \int |W'|\,\frac{l^2}{s}\,\mathrm{d}V,\quad
          H = \int |W'|\,\frac{s^2 - l^2}{2s}\,\mathrm{d}V

They are the limit of fine particles of the solid: A counts its neighbours, B carries the slope of velocity and pressure
at its surface, G and C the force of the pressure there. H is the share of the neighbours along the surface that the
solid hides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.references.isph.kernel import REACH, SMOOTHING, slope

POINTS, STEPS = 200, 600
"""Entries of the tables over the distance, and steps of the integrals over s."""

CLOSEST = 0.1
"""Least distance of a particle from a solid, in its viscous stress [particle spacings]."""


@dataclass(frozen=True)
class Solid:
    """The integrals as tables over the distance from the surface."""

    distance: np.ndarray  # [m]
    count: np.ndarray  # A [1/m2]
    slope: np.ndarray  # B [1/m]
    push: np.ndarray  # G [1/m]
    lag: np.ndarray  # C [-]
    hidden: np.ndarray  # H [-]

    def at(self, distance: np.ndarray) -> Seen:
        """The integrals for particles at these distances (n,) [m]; zero beyond the reach."""
        tables = (self.count, self.slope, self.push, self.lag, self.hidden)
        return Seen(distance, *(np.interp(distance, self.distance, each, right=0.0) for each in tables))


@dataclass(frozen=True)
class Seen:
    """What each liquid particle sees of a solid."""

    distance: np.ndarray
    count: np.ndarray
    slope: np.ndarray
    push: np.ndarray
    lag: np.ndarray
    hidden: np.ndarray

    def friction(self, dx: float) -> np.ndarray:
        """Sum of the weights of no slip, B/d: the velocity is linear through the surface (n,) [1/m2]."""
        return np.asarray(self.slope / np.maximum(self.distance, CLOSEST * dx))


def solid(dx: float, radius: float = np.inf) -> Solid:
    """A sphere, or a half-space, as particles of a spacing see it.

    dx      [m]
    radius  of the sphere [m]
    """
    h, reach = SMOOTHING * dx, REACH * dx
    distance = np.linspace(0.0, reach, POINTS)
    s = (np.arange(STEPS) + 0.5) * reach / STEPS
    steep = -np.array([slope.py_func(each, h) for each in s])
    if np.isinf(radius):
        cosine = distance[:, None] / s
    else:
        middle = radius + distance[:, None]
        cosine = (middle**2 + s**2 - radius**2) / (2.0 * middle * s)
    low = np.clip(cosine, -1.0, 1.0)
    weight = 2.0 * steep * s / (s**2 + 0.01 * h * h)
    shell = 2.0 * np.pi * s**2 * reach / STEPS
    one, two, three = 1.0 - low, 0.5 * (1.0 - low**2), (1.0 - low**3) / 3.0
    return Solid(
        distance,
        (weight * shell * one).sum(axis=1),
        (weight * s * shell * two).sum(axis=1),
        (steep * shell * two).sum(axis=1),
        (steep * s * shell * three).sum(axis=1),
        (0.5 * steep * s * shell * (one - three)).sum(axis=1),
    )
