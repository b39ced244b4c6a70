"""Liquid that comes after the start: neighbour lists follow films that grow, and dry bodies form no bridges."""

from __future__ import annotations

import numpy as np
from wet_spheres import FILM, GRAIN, RADIUS, THIN, bridged

from cfddem.particles.interactions.bridge import LIQUID, coat
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures.liquid_film import film_volume


def test_spheres_wetted_after_the_start_form_their_bridge() -> None:
    """At rest, with a gap far beyond the list that was made for dry spheres."""
    places = np.array([[0.0, 0.0, 0.0], [2.0 * RADIUS + 1.6 * FILM, 0.0, 0.0]])
    run, bridges = bridged(make_particles(places, RADIUS, GRAIN.density), THIN, 0.0, skin=0.1 * FILM)
    run.advance(1e-6, 10)
    assert bridges.count == 0
    run.particles.liquid[:] = film_volume(run.particles.radius, FILM)
    run.advance(1e-6, 2)
    assert bridges.count == bridges.formed == 1


def test_dry_solids_that_overlap_form_no_bridge() -> None:
    """Two spheres, and a sphere on a wall."""
    places = np.array([[0.0, 0.0, 0.999 * RADIUS], [1.999 * RADIUS, 0.0, 0.999 * RADIUS]])
    spheres = make_particles(places, RADIUS, GRAIN.density)
    run, bridges = bridged(spheres, THIN, 0.0, walls=[Plane()])
    run.advance(1e-6, 20)
    assert bridges.formed == bridges.broken == bridges.count == 0


def test_inserted_and_removed_liquid_is_counted() -> None:
    wet = make_particles(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), RADIUS, GRAIN.density)
    run, bridges = bridged(wet, THIN)
    fresh = make_particles(np.array([[2.0, 0.0, 0.0]]), RADIUS, GRAIN.density)
    coat(fresh, FILM)
    start, each = bridges.liquid, float(fresh[LIQUID.name][0])
    run.insert(fresh)
    assert bridges.fed == each and np.isclose(bridges.liquid, start + each, rtol=1e-14)
    run.remove(run.particles.id == 0)
    assert np.isclose(bridges.fed, 0.0, atol=1e-12 * each)
    other = ParticleSolver(run.particles.copy(), pair_table([GRAIN]), laws=Laws(bridge=THIN))
    other.restore(run.checkpoint())
    assert other.bridges is not None and other.bridges.fed == bridges.fed
