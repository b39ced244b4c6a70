"""Wet spheres for tests of liquid bridges."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from solver_options import grouped

from cfddem.case.materials import Material
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles, make_particles
from closures import capillary

RADIUS, FILM, TENSION, ANGLE = 0.5e-3, 25e-6, 0.07, 0.26
GRAIN = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=1.0, friction=0.3)
LIQUID = 2.0 * capillary.liquid_share(RADIUS, RADIUS) * 4.0 / 3.0 * math.pi * ((RADIUS + FILM) ** 3 - RADIUS**3)
"""In a bridge of two spheres whose films were untouched."""


def bridged(
    spheres: Particles, laws: BridgeLaws, film: np.ndarray | float = FILM, **options: Any
) -> tuple[ParticleSolver, Bridges]:
    """A run of dry spheres with liquid on them."""
    coat(spheres, film)
    run = ParticleSolver(spheres, pair_table([GRAIN]), laws=Laws(bridge=laws), **grouped(**options))
    assert run.bridges is not None
    return run, run.bridges


SYRUP = BridgeLaws(
    viscosity=5.0,
    surface_tension=TENSION,
    contact_angle=ANGLE,
    film="deforming",
    cut="constant",
    tangential="davis",
    minimum_gap=1e-6,
)


def swarm(
    count: int, laws: BridgeLaws = SYRUP, speed: float = 0.1, solid: float = 0.45, **options: Any
) -> tuple[ParticleSolver, Bridges]:
    """Unequal wet spheres that move in all directions in a periodic box, with their films close to each other."""
    draw = np.random.default_rng(1)
    size = RADIUS * draw.uniform(0.8, 1.2, count)
    places, box = random_packing(2.0 * (size + 0.3 * FILM), solid, 1)
    velocity = draw.normal(0.0, speed, places.shape)
    spheres = make_particles(places, size, GRAIN.density, velocity=velocity, spin=draw.normal(0.0, 50.0, places.shape))
    return bridged(spheres, laws, **{"box": tuple(box)} | options)


THIN = BridgeLaws(
    viscosity=0.05, surface_tension=TENSION, film="deforming", cut="constant", tangential="davis", minimum_gap=1e-6
)
CLOSED = replace(THIN, viscosity=1.0, minimum_gap=0.8 * FILM)
"""Bridges that are closed in a `swarm`, whose solids do not touch."""
