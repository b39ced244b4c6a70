"""Spheres and liquids of wet impacts, and what was measured for each pair of them."""

from __future__ import annotations

import math
from typing import Any

from pydantic import Field

from cfddem.backend.errors import InputError
from cfddem.case.materials import Checked, Fluid, Material


class Ball(Checked):
    """A sphere of one solid."""

    material: Material
    diameter: float = Field(gt=0, description="d [m]")


class Liquid(Fluid):
    """A liquid with a surface."""

    viscosity: float = Field(gt=0, description="eta, dynamic [Pa s]")
    surface_tension: float = Field(gt=0, description="sigma [N/m]")
    contact_angle: float = Field(default=15.0, ge=0, lt=90, description="theta, on the sphere [deg]")


GLASS = Material(density=2500, youngs_modulus=63e9, poisson=0.23, restitution=0.96)
ALUMINA = Material(density=1040, youngs_modulus=14.5e9, poisson=0.25, restitution=0.76)
"""Solids of Buck et al. (2018), table 1; the wall is of glass."""

BALLS = {
    "glass_0.91": Ball(material=GLASS, diameter=0.91e-3),
    "glass_1.74": Ball(material=GLASS, diameter=1.74e-3),
    "alumina_1.74": Ball(material=ALUMINA, diameter=1.74e-3),
}
LIQUIDS = {
    "water": Liquid(density=998, viscosity=1.0e-3, surface_tension=72.80e-3),
    "tween": Liquid(density=998, viscosity=1.0e-3, surface_tension=37.30e-3),
    "glycerol_35": Liquid(density=1086, viscosity=3.0e-3, surface_tension=69.61e-3),
    "glycerol_51": Liquid(density=1130, viscosity=6.7e-3, surface_tension=68.20e-3),
}
"""Liquids of Buck et al. (2018), table 2; tween is 60 g/L Tween 20 in water, glycerol is by weight per cent."""

HALF_FILLING_ANGLES = {
    "glass_1.74": {
        "water": {100: 35, 200: 45, 400: 55}, "glycerol_35": {400: 53}, "glycerol_51": {400: 51}, "tween": {100: 35},
    },
    "glass_0.91": {"water": {100: 45, 200: 55}},
    "alumina_1.74": {
        "water": {100: 28, 200: 45, 400: 53}, "glycerol_35": {100: 34, 200: 44}, "glycerol_51": {200: 43},
        "tween": {100: 35, 150: 42},
    },
}  # fmt: skip
"""Measured half-filling angles by sphere, liquid and thickness of the layer [deg, um]: Buck et al. (2018), table 5."""

FRICTION = {None: 0.195, "tween": 0.160, "glycerol_35": 0.140}
"""Sliding friction of alumina on glass, dry and under liquids: Buck et al. (2018), table 3."""


def half_filling(particle: Any, liquid: Any, film: float, value: float | None) -> float:
    """The half-filling angle that is given, or was measured for this case."""
    if value is not None:
        return value
    if isinstance(particle, str) and isinstance(liquid, str):
        measured = HALF_FILLING_ANGLES.get(particle, {}).get(liquid, {})
        for thickness, angle in measured.items():
            if math.isclose(thickness * 1e-6, film, rel_tol=1e-6):
                return float(angle)
        listed = ", ".join(f"{thickness} um" for thickness in measured) or "none"
        raise InputError(
            "half_filling_angle",
            None,
            f"given for {particle} and {liquid} under {film * 1e6:g} um",
            f"measured are layers of: {listed}",
        )
    raise InputError("half_filling_angle", None, "given for a user-defined particle or liquid")


def sliding_friction(particle: Any, liquid: Any, value: float | None) -> float:
    """The friction that is given, or was fitted for this case."""
    if value is not None:
        return value
    if particle == "alumina_1.74" and (liquid is None or isinstance(liquid, str)) and liquid in FRICTION:
        return FRICTION[liquid]
    raise InputError("friction", None, "given for an oblique or spinning impact of this particle and liquid")
