"""Golden runs of a heap of spheres between walls of every kind."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.shapes import Box, Cone, Cylinder, Plane
from cfddem.particles.walls.wall import Wall
from golden.building import particles
from golden.many_particles import after
from golden.registry import State, golden
from golden.two_particles import BEAD, RADIUS, STEEL


def near_walls(walls: Sequence[Wall], film: float = 0.0, steps: int = 60, **options: Any) -> State:
    """A small heap of spheres among walls."""
    draw = np.random.default_rng(3)
    places = (np.indices((4, 4, 4)).reshape(3, -1).T - 1.5) * 2.04 * RADIUS
    places = places + draw.uniform(-0.01, 0.01, places.shape) * RADIUS
    run = particles(
        places, RADIUS, [BEAD, STEEL], velocity=draw.normal(0.0, 0.4, places.shape),
        spin=draw.normal(0.0, 100.0, places.shape), film=film, walls=walls, gravity=(0.0, 0.0, -9.81), **options,
    )  # fmt: skip
    return after(run, steps)


HALF = 4.067 * RADIUS
"""Half of the edge of the heap, with a little room."""


@golden
def walls_planes() -> State:
    floor = Plane(point=(0.0, 0.0, -HALF), velocity=(0.1, 0.0, 0.0), material=1)
    side = Plane(point=(-HALF, 0.0, 0.0), normal=(1.0, 0.0, 0.01))
    return near_walls([floor, side, Plane(point=(0.0, HALF, 0.0), normal=(0.0, -1.0, 0.0), velocity=(0.0, -0.2, 0.0))])


@golden
def walls_box_film() -> State:
    return near_walls([Box(low=(-HALF,) * 3, high=(HALF,) * 3, material=1)], film=1e-3)


@golden
def walls_cylinder() -> State:
    round_ = Cylinder(
        point=(0.0, 0.0, -HALF), radius=5.335 * RADIUS, length=2.0 * HALF, caps=True, spin=(0.0, 0.0, 20.0), material=1
    )
    return near_walls([round_])


@golden
def walls_cylinder_film() -> State:
    tube = Cylinder(point=(0.0, 0.0, -HALF), radius=5.335 * RADIUS, length=1.5 * HALF)
    rod = Cylinder(
        point=(0.0, -0.8 * HALF, 0.0), axis=(0, 1, 0), radius=0.43 * RADIUS, length=1.2 * HALF, caps=True, outside=True
    )
    return near_walls([tube, rod], film=1e-3)


HOPPER = Cone(point=(0.0, 0.0, -7.06 * RADIUS), radius=1.75 * RADIUS, top_radius=13.75 * RADIUS, length=12.0 * RADIUS)


@golden
def walls_cone() -> State:
    return near_walls([HOPPER, Plane(point=(0.0, 0.0, -HALF), material=1)])


@golden
def walls_cone_film() -> State:
    return near_walls([HOPPER], film=1e-3)


def plate(bend: float = 0.1, side: int = 4, half: float = 1.5 * HALF) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a plate below the heap, a little uneven."""
    x, y = np.meshgrid(*(np.linspace(-half, half, side + 1),) * 2, indexing="ij")
    z = -HALF + bend * RADIUS * (np.cos(3.0 * x / half) * np.cos(2.0 * y / half) - 1.0)
    corners = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    a, b, c, d = (each.ravel() for each in (corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), faces


def write_stl(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """A surface as text."""
    lines = ["solid plate"]
    for corners in vertices[triangles]:
        points = [f"vertex {x:.9e} {y:.9e} {z:.9e}" for x, y, z in corners]
        lines += ["facet normal 0 0 1", "outer loop", *points, "endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid plate", ""]))


@golden
def mesh_from_file() -> State:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plate.stl"
        vertices, triangles = plate()
        write_stl(path, 1e3 * vertices, triangles)
        wall = Mesh.from_stl(path, scale=1e-3, material=1)
    return near_walls([wall])


@golden
def mesh_that_moves() -> State:
    vertices, triangles = plate(0.02)
    return near_walls([Mesh(vertices=vertices, triangles=triangles, velocity=(0.0, 0.1, 0.2), spin=(5.0, 3.0, 30.0))])


@golden
def mesh_film() -> State:
    vertices, triangles = plate(0.02)
    return near_walls([Mesh(vertices=vertices, triangles=triangles, velocity=(0.0, 0.0, 0.05))], film=1e-3)
