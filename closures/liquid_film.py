r"""The liquid all over a wet sphere: its volume and its thickness."""

from __future__ import annotations

import math

from closures.registry import law


@law("liquid_film", "geometry of a spherical shell")
def film_volume(radius: float, thickness: float) -> float:
    r"""Volume of a layer of even thickness all over a sphere.

    .. math:: V = \tfrac43\pi\left[(R+\delta)^3-R^3\right]

    radius     R, of the solid sphere, > 0 [m]
    thickness  delta, >= 0 [m]
    returns    V [m3]

    Range: exact for a layer of even thickness.

    A film of half the radius has 2.375 times the volume of the sphere:

    >>> round(film_volume(1.0, 0.5) / (4.0 / 3.0 * math.pi), 12)
    2.375
    """
    # written so that a thin film keeps its digits
    return 4.0 / 3.0 * math.pi * thickness * (thickness * thickness + 3.0 * radius * (thickness + radius))


@law("liquid_film", "geometry of a spherical shell")
def film_thickness(radius: float, volume: float) -> float:
    r"""Thickness of a layer of even thickness all over a sphere; the inverse of :func:`film_volume`.

    .. math:: \delta = R\left[\left(1+\frac{3V}{4\pi R^3}\right)^{1/3}-1\right]

    radius   R, of the solid sphere, > 0 [m]
    volume   V, of the liquid, >= 0 [m3]
    returns  delta [m]

    Range: exact for a layer of even thickness.

    >>> round(film_thickness(1.0, film_volume(1.0, 0.5)), 12)
    0.5
    """
    # expm1 and log1p keep the digits of a thin film
    return radius * math.expm1(math.log1p(3.0 * volume / (4.0 * math.pi * radius * radius * radius)) / 3.0)
