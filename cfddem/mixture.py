"""What the drag law says of several species in one stream, mixed evenly: how it carries them, and who sinks."""

from __future__ import annotations

import math
from functools import wraps

from cfddem.case import Case
from closures.balance import Drag
from closures.drag import ergun


def bed_drag(case: Case) -> Drag:
    """The drag law of the case, or Ergun's where it has none or one of spheres alone.

    Of a mixture: the mean over its volume, as the drag factor of spheres of its Sauter mean diameter.
    """
    law = case.laws.drag_function()
    if law is None or law(1.0, 0.42) == law(1.0, 1.0):
        return ergun
    if not case.bed.species:
        return law
    return drag_of_mixture(case)


def drag_of_mixture(case: Case) -> Drag:
    r"""Drag factor of the spheres of mean size that the stream feels a mixture to be.

    .. math:: F = \sum_i x_i\,F_i / y_i^2,\qquad Re_i = y_i Re

    with x the share of the volume and y the diameter over the Sauter mean.
    """
    whole, parts = sum(case.volumes.values()), []
    for name, each in case.species.items():
        ratio = each.sauter / case.bed.diameter
        law = case.laws.drag_function(ratio)
        assert law is not None
        parts.append((case.volumes[name] / whole, ratio, law))

    @wraps(parts[0][2])
    def mean(reynolds: float, voidage: float) -> float:
        return sum(share / ratio**2 * law(ratio * reynolds, voidage) for share, ratio, law in parts)

    return mean


def sinking(case: Case, inlet: float, voidage: float) -> dict[str, float]:
    """Force downward on each species while the bed is mixed evenly, over its own buoyant weight [-].

    inlet    superficial velocity [m/s]
    voidage  at which the stream carries the mixture [-]
    returns  by name; above 0 the species sinks, below 0 it rises, or floats; nothing where there is no drag

    The weight of a sphere is carried by its own drag and by the pressure gradient, which is the weight of the mixture.
    """
    fluid, gravity = case.fluid, math.hypot(*case.laws.gravity)
    found: dict[str, float] = {}
    if fluid is None or fluid.viscosity == 0.0 or gravity == 0.0:
        return found
    bulk = (1.0 - voidage) * (case.solid_density - fluid.density)
    for name, each in case.species.items():
        law, diameter = case.laws.drag_function(each.sauter / case.bed.diameter), each.sauter
        excess = case.material_of(each).density - fluid.density
        if law is not None and excess != 0.0:
            reynolds = fluid.density * inlet * diameter / fluid.viscosity
            drag = 18.0 * fluid.viscosity * inlet * law(reynolds, voidage) / (diameter**2 * gravity)
            found[name] = (excess - bulk - drag) / abs(excess)
    return found
