"""Added mass of the film in the particle solver: the film is reversed with the bodies as they part after contact."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures.restitution import davis_sitison
from scenarios.collisions.film_impact.materials import GLASS, LIQUIDS, laws_of

RESOLVED = {  # diameter, liquid, film, velocity: restitution of the resolved impact with 20 cells in the film
    (8e-3, "water", 0.4e-3, 1.0): 0.856,
    (4e-3, "water", 0.4e-3, 0.5): 0.746,
    (2.8e-3, "water", 0.4e-3, 1.5): 0.717,
    (5.5e-3, "m5", 0.45e-3, 0.5): 0.739,
}


def rebound(diameter: float, liquid: str, film: float, velocity: float, density: float) -> float:
    """Restitution of a dry sphere on a plate with a film, in the particle solver; speeds where the film begins."""
    sphere = make_particles([(0.0, 0.0, 0.5 * diameter + 1.001 * film)], 0.5 * diameter, GLASS.density,
                            velocity=np.array([(0.0, 0.0, -velocity)]))  # fmt: skip
    laws = BridgeLaws(
        viscosity=LIQUIDS[liquid].viscosity, film="deforming", pull="none", rupture="film", minimum_gap=1e-6,
        wall_share=1.0, wall_film=film, wall_patch=4.0 * diameter, film_density=density,
    )  # fmt: skip
    coat(sphere, 0.0)
    run = ParticleSolver(
        sphere, pair_table([GLASS]), laws=Laws(bridge=laws), walls=[Plane()], settings=SolverSettings(skin=diameter)
    )
    for _ in range(400):
        run.advance(1e-7, 200)
        if run.particles.position[0, 2] > 0.5 * diameter + film:
            break
    return float(run.particles.velocity[0, 2]) / velocity


@pytest.mark.slow
@pytest.mark.parametrize("impact", RESOLVED)
def test_the_added_mass_closes_the_gap_to_the_resolved_impact(impact: tuple[float, str, float, float]) -> None:
    """Within 0.05 of the resolved restitution, and 0.01 of the law; without inertia it is 0.1 and more above."""
    diameter, liquid, film, velocity = impact
    law = laws_of(diameter, LIQUIDS[liquid], film, velocity)
    heavy = rebound(*impact, LIQUIDS[liquid].density)
    assert heavy == pytest.approx(law["deforming bridge and added mass"], abs=0.01)
    assert heavy == pytest.approx(RESOLVED[impact], abs=0.05)
    light = rebound(*impact, 1e-6)
    assert light == pytest.approx(law["deforming bridge"], abs=0.01)
    assert light > RESOLVED[impact] + 0.1


@pytest.mark.slow
def test_a_film_without_inertia_is_that_of_davis_and_sitison() -> None:
    """Hard rebound at the minimum gap, St of 34 and 343: within 0.01."""
    diameter, film = 5.5e-3, 0.45e-3
    for velocity in (0.1, 1.0):
        stokes = GLASS.density * diameter * velocity / (9.0 * LIQUIDS["m5"].viscosity)
        exact = davis_sitison(stokes, GLASS.restitution, 1e-6 / film)
        assert rebound(diameter, "m5", film, velocity, 1e-6) == pytest.approx(exact, abs=0.01)


def test_inertia_needs_a_film() -> None:
    with pytest.raises(InputError, match=r"film_density = 998.0: must be 0 without a film"):
        BridgeLaws(film_density=998.0).check()
