"""The same impacts by laws of thin films, without a resolved flow: those of the particle solver, and others."""

from __future__ import annotations

from collections.abc import Callable

from closures.bridge import deforming_potential, static_potential
from closures.film_impact import film_added_mass, reduced_impact, reversal_restitution
from closures.restitution import immersed, singh
from scenarios.collisions.film_impact.materials import GLASS, Liquid


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
