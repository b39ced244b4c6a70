"""Golden runs of particles that are inserted and removed, and of runs that continue others."""

from __future__ import annotations

import numpy as np

from cfddem.features.feeds import Feed, ParticleOutlet
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.walls.shapes import Plane
from golden.building import particles, stirred_dense_bed
from golden.many_particles import after, swarm
from golden.registry import State, golden
from golden.states import different, particle_state
from golden.two_particles import BEAD, RADIUS


@golden
def feeding_and_removing() -> State:
    run = swarm(solid=0.55)
    run.advance(1e-6, 20)
    gone = run.remove(run.particles.id % 7 == 3)
    run.advance(1e-6, 10)
    ids = run.insert(gone)
    run.advance(1e-6, 10)
    return particle_state(run) | {"given": np.asarray(ids)}


@golden
def feed_and_outlet() -> State:
    run = particles([[0.0, 0.0, 0.02]], RADIUS, [BEAD], gravity=(0.0, 0.0, -9.81), walls=[Plane(point=(0, 0, 0.01))])
    sizes = np.random.default_rng(5)
    corner, size = (0.0, 0.0, 0.02), (3e-3, 3e-3, 1e-3)
    feed = Feed(
        1e5,
        corner,
        size,
        lambda n, _: sizes.uniform(0.7e-3, 1.2e-3, n),
        BEAD.density,
        velocity=(0.0, 0.0, -1.0),
        seed=1,
    )
    outlet = ParticleOutlet(low=(-np.inf, -np.inf, 0.0195))
    for _ in range(12):
        feed(run)
        run.advance(2e-6, 50)
        outlet(run)
    return particle_state(run) | {"moved": np.array([feed.entered, len(feed.waiting), outlet.left, outlet.mass])}


@golden
def followed_by_another_run() -> State:
    """A run over the particles of an earlier one, whose pairs it remembers."""
    first = swarm()
    first.advance(1e-6, 30)
    places = first.particles
    run = ParticleSolver(
        places,
        first.table,
        laws=Laws(),
        gravity=(0.0, 0.0, -9.81),
        box=tuple(first.box),
        settings=SolverSettings(after=first),
    )
    return after(run)


@golden
def resumed_particles() -> State:
    """Many wet spheres, stopped and gone on with: the same bits as those that were not stopped."""
    straight, stopped, again = (stirred_dense_bed(True) for _ in range(3))
    straight.advance(1e-5, 20)
    stopped.advance(1e-5, 10)
    again.restore(stopped.checkpoint())
    again.advance(1e-5, 10)
    return different(particle_state(again), particle_state(straight))
