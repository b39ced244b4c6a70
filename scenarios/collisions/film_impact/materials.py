"""Bead, plate and liquids of Singh, Windows-Yule & Nair (2026), the gap of contact, and laws of thin films."""

from __future__ import annotations

from collections.abc import Callable

from pydantic import Field

from cfddem.backend.errors import InputError, nearest
from cfddem.case.materials import Fluid, Material
from cfddem.particles.material_pairs import pair_table
from closures.bridge import deforming_potential, static_potential
from closures.film_impact import film_added_mass, reduced_impact, reversal_restitution
from closures.minimum_gap import asperities, elastohydrodynamic
from closures.restitution import immersed, singh


class Liquid(Fluid):
    """A liquid with a surface."""

    surface_tension: float = Field(default=0.0, ge=0, description="sigma [N/m]")


LIQUIDS = {
    "water": Liquid(density=998, viscosity=1.0e-3, surface_tension=0.0728),
    "m5": Liquid(density=925, viscosity=4.6e-3, surface_tension=0.0192),
}
"""Liquids of the paper, table 2; m5 is a silicone oil."""

GLASS = Material(density=2580, youngs_modulus=63e9, poisson=0.23, restitution=0.98)
"""Glass of the paper, table 2, with its dry restitution; elastic constants of Buck et al. (2018), table 1."""


def liquid_named(liquid: str | Liquid, viscosity: float | None) -> Liquid:
    """The liquid of a name, with another viscosity if one is given."""
    if isinstance(liquid, str):
        if liquid not in LIQUIDS:
            raise InputError("liquid", liquid, nearest(liquid, LIQUIDS))
        liquid = LIQUIDS[liquid]
    if viscosity is None:
        return liquid
    return liquid.model_copy(update={"viscosity": float(viscosity)})


def touching_gap(
    rule: str, fixed: float, viscosity: float, velocity: float, diameter: float, solids: tuple[Material, Material]
) -> float:
    """Gap at which the solids touch [m].

    rule       "fixed", "roughness" of the solids, or "elastohydrodynamic"; never less than the roughness
    fixed      the gap of the rule "fixed" [m]
    viscosity  dynamic [Pa s]
    velocity   of the impact [m/s]
    diameter   of the bead [m]
    solids     of bead and plate
    """
    if rule == "fixed":
        return fixed
    rough = asperities(solids[0].roughness, solids[1].roughness)
    if rule == "roughness":
        if rough == 0.0:
            raise InputError("gap_rule", rule, "fixed or elastohydrodynamic for smooth solids", "or give a roughness")
        return rough
    if viscosity == 0.0:
        raise InputError("viscosity", 0.0, "above 0 with gap_rule = elastohydrodynamic", "gap_rule = fixed needs none")
    modulus = float(pair_table(list(solids))[0, 1]["contact_modulus"])
    return max(rough, elastohydrodynamic(viscosity, velocity, modulus, 0.5 * diameter))


# ---------------------------------------------------------------- laws of thin films


def laws_of(
    diameter: float, liquid: Liquid, film: float, velocity: float, minimum_gap: float = 1e-6, gravity: float = 9.81
) -> dict[str, float]:
    """Restitution by each law.

    diameter, film  of the bead, and depth of the film [m]
    velocity        where the bead meets the film [m/s]
    minimum_gap     at which the solids touch [m]
    gravity         [m/s2]; only the reduced model has it
    returns         {law: restitution}

    >>> e = laws_of(8e-3, Liquid(density=998, viscosity=1e-3), 0.4e-3, 1.0)
    >>> {name: round(value, 3) for name, value in e.items()}        # doctest: +NORMALIZE_WHITESPACE
    {'fit': 0.849, 'static bridge': 0.976, 'deforming bridge': 0.976, 'immersed film': 0.974,
     'deforming bridge and added mass': 0.867, 'reduced model': 0.849}
    """
    dry, ratio = GLASS.restitution, film / diameter
    stokes = GLASS.density * diameter * velocity / (9.0 * liquid.viscosity)
    density_ratio = liquid.density / GLASS.density
    turned = reversal_restitution(dry, film_added_mass(density_ratio, ratio))

    def by_film(potential: Callable[[float, float], float], turn: float) -> float:
        lost = -potential(minimum_gap, film) / stokes
        return max(0.0, turn * (1.0 - lost) - lost)

    return {
        "fit": singh(stokes, ratio),
        "static bridge": by_film(static_potential, dry),
        "deforming bridge": by_film(deforming_potential, dry),
        "immersed film": immersed(stokes, dry, film, minimum_gap),
        "deforming bridge and added mass": by_film(deforming_potential, turned),
        "reduced model": reduced_impact(
            stokes, ratio, density_ratio, dry, minimum_gap / film, gravity * diameter / velocity**2
        ),
    }
