"""Programs that tests run on several ranks under MPI, and in one process."""

from __future__ import annotations

from typing import Any

import numpy as np
from solver_options import grouped
from test_ghosts import DRY, GLASS, STEEL, WET, state

from cfddem.backend.communicator import Communicator
from cfddem.model.fields import Field
from cfddem.particles.bricks import Bricks
from cfddem.particles.ghosts import DividedDomain
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles, make_particles
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.shapes import Box

KINDS = ("dry", "film", "polydisperse", "moving_mesh")
DIAMETER, STEP = 1e-3, 2e-6


def spheres_of(kind: str, count: int) -> tuple[Particles, np.ndarray]:
    """Spheres of two sizes and materials in motion, and the edges of their box; a user's field with their ids."""
    draw = np.random.default_rng(4)
    ratio = 0.25 if kind == "polydisperse" else 0.7
    large = draw.uniform(size=count) < (0.02 if kind == "polydisperse" else 0.5)
    diameters = DIAMETER * np.where(large, 1.0, ratio)
    centres, box = random_packing(diameters, 0.5, seed=3, shape=(2.0, 1.0, 1.0))
    spheres = make_particles(
        centres, 0.5 * diameters, np.where(large, GLASS.density, STEEL.density), material=(~large).astype(int),
        velocity=draw.normal(0.0, 1.0, (count, 3)), spin=draw.normal(0.0, 300.0, (count, 3)),
        viscosity=draw.uniform(0.5e-3, 2e-3, count) if kind == "film" else 0.0,
    )  # fmt: skip
    spheres.declare(Field("badge", components=2, role="memory"), np.stack([spheres.id, draw.uniform(size=count)], 1))
    return spheres, box


def rising_floor(size: np.ndarray) -> Mesh:
    """A wavy floor of triangles that rises and slides."""
    x, y = (np.linspace(-0.2 * each, 1.2 * each, 13) for each in size[:2])
    corners = np.array([[a, b, 0.2 * DIAMETER * np.sin(2e3 * a) * np.cos(2e3 * b)] for a in x for b in y])
    cells = [13 * i + j for i in range(12) for j in range(12)]
    triangles = [t for c in cells for t in ((c, c + 13, c + 1), (c + 13, c + 14, c + 1))]
    return Mesh(vertices=corners, triangles=np.array(triangles), velocity=(0.1, 0.05, 0.2))


def bed(communicator: Communicator, kind: str, count: int, steps: int, without: str = "") -> dict[str, Any]:
    """A periodic box, or a box with a floor of triangles that moves, divided into equal slabs across x.

    without  leave out "film" (the exchange between kick and film impulses) or "memory" (of the pairs of particles that
             change rank)
    returns  state of the owned particles and their pairs, and how many particles came from other ranks
    """
    spheres, box = spheres_of(kind, count)
    given: dict[str, Any] = {"laws": WET if kind == "film" else DRY, "gravity": (0.0, 0.0, -9.81)}
    if kind == "moving_mesh":
        low = (-0.1 * DIAMETER, -0.1 * DIAMETER, -DIAMETER)
        given["walls"] = [Box(low=low, high=tuple(box + 0.1 * DIAMETER)), rising_floor(box)]
    else:
        given["box"] = tuple(box)
    if communicator.size > 1:
        planes = [box[0] * n / communicator.size for n in range(1, communicator.size)]
        given |= {"communicator": communicator, "division": Bricks.slabs(0, planes)}
    run = ParticleSolver(spheres, pair_table([GLASS, STEEL]), **grouped(check_steps=False, **given))
    leave_out(run.lists.ghosts, without)
    arrived, parts = 0, 10
    for _ in range(parts):
        before = set(run.particles.id[: run.particles.owned].tolist())
        run.advance(STEP, steps // parts)
        arrived += len(set(run.particles.id[: run.particles.owned].tolist()) - before)
    return {"state": state(run), "arrived": arrived, "lists": run.lists.made}


def leave_out(ghosts: Any, what: str) -> None:
    """Break the exchange between ranks, to see whether a test notices."""
    if isinstance(ghosts, DividedDomain) and what == "memory":
        ghosts.recall = lambda edges: None  # type: ignore[method-assign]
    if isinstance(ghosts, DividedDomain) and what == "film":
        refresh = ghosts.refresh
        ghosts.refresh = lambda phase: None if phase == "film" else refresh(phase)  # type: ignore[method-assign]
