"""Drag on a homogeneous mixture of several species, and which species sinks in it."""

from __future__ import annotations

import math
from functools import wraps

from cfddem.case.schema import Case
from closures.balance import Drag
from closures.drag import ergun


def bed_drag(case: Case) -> Drag:
    """Drag law for estimates of the bed.

    The drag law of the case; for a mixture, its mean over the species (:func:`mean_drag`). Ergun's law replaces
    it where the case has no drag, or a law for single spheres that ignores voidage.
    """
    law = case.laws.drag_function()
    if law is None or law(1.0, 0.42) == law(1.0, 1.0):
        return ergun
    if not case.bed.species:
        return law
    return mean_drag(case)


def mean_drag(case: Case) -> Drag:
    r"""Drag factor of equal spheres of the Sauter mean diameter with the same total drag as the mixture.

    .. math:: F = \sum_i x_i\,F_i / y_i^2,\qquad Re_i = y_i Re

    x is the volume share of a species and y its diameter over the Sauter mean.
    """
    total, parts = sum(case.volumes.values()), []
    for name, each in case.species.items():
        ratio = each.sauter_diameter / case.bed.diameter
        law = case.laws.drag_function(ratio)
        assert law is not None
        parts.append((case.volumes[name] / total, ratio, law))

    @wraps(parts[0][2])
    def mean(reynolds: float, voidage: float) -> float:
        return sum(share / ratio**2 * law(ratio * reynolds, voidage) for share, ratio, law in parts)

    return mean


def net_downward_forces(case: Case, inlet: float, voidage: float) -> dict[str, float]:
    """Net downward force on each species in the homogeneous mixture, over its own buoyant weight [-].

    The weight of a sphere is carried by its own drag and by the pressure gradient, which carries the weight of
    the mixture.

    inlet    superficial velocity [m/s]
    voidage  at which the flow carries the mixture [-]
    returns  by name: above 0 the species sinks, below 0 it rises; empty without drag
    """
    fluid, gravity = case.fluid, math.hypot(*case.laws.gravity)
    forces: dict[str, float] = {}
    if fluid is None or fluid.viscosity == 0.0 or gravity == 0.0:
        return forces
    bulk = (1.0 - voidage) * (case.solid_density - fluid.density)
    for name, each in case.species.items():
        diameter = each.sauter_diameter
        law = case.laws.drag_function(diameter / case.bed.diameter)
        excess = case.material_of(each).density - fluid.density
        if law is not None and excess != 0.0:
            reynolds = fluid.density * inlet * diameter / fluid.viscosity
            drag = 18.0 * fluid.viscosity * inlet * law(reynolds, voidage) / (diameter**2 * gravity)
            forces[name] = (excess - bulk - drag) / abs(excess)
    return forces
