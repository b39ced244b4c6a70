"""The viscous force of a fluid on its smooth walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfddem.fluid.cut_cells import CutCells
from cfddem.fluid.grid import Array, layers
from cfddem.fluid.solver import FluidSolver


def force_on_walls(fluid: FluidSolver) -> tuple[Array, Array]:
    r"""Viscous force of the fluid on the smooth wall of every cut cell: places (n, 3) [m], and forces (n, 3) [N].

    .. math:: \tau\cdot n = \varepsilon\mu\,(g - w\cdot\nabla n)

    with the shear rate g at the wall, the normal n into the fluid and the velocity w with which the wall slides along
    itself: the transposed part of the stress is :math:`n_j\partial_d w_j = -w_j\partial_d n_j`. The place is the
    point of the wall nearest to the centre of the cell. The pressure is not in the force.
    """
    cut, grid = fluid.boundaries.cut, fluid.grid
    if not isinstance(cut, CutCells):
        return np.zeros((0, 3)), np.zeros((0, 3))
    area = np.array([np.diff(grid.inner_faces(cut.aperture[d], d), axis=2 - d) * grid.face_area(d) for d in range(3)])
    wetted = np.linalg.norm(area, axis=0) * grid.open
    here = np.flatnonzero(wetted)
    place = _on_wall(cut, [np.ravel(each)[here] for each in np.broadcast_arrays(*grid.centres())])
    fluid.rates()  # brings the effective viscosity up to date
    pull = (wetted * grid.inner(fluid.fields.effective_viscosity)).ravel()[here]
    shear = np.stack([_shear(fluid, cut, d).ravel()[here] for d in range(3)], axis=-1)
    return place, pull[:, None] * (shear - _turning(cut, list(place.T)))


def _shear(fluid: FluidSolver, cut: CutCells, d: int) -> Array:
    """Shear rate of component d at the wall (nz, ny, nx) [1/s]: of both faces, the more the farther from the wall."""
    profiles = fluid.walls.profiles[d]
    relative = fluid.fields.velocity[d].ravel() - profiles.sliding
    rate = profiles.shear[0] * relative + profiles.shear[1] * relative[profiles.next]
    moments = profiles.distance, profiles.distance * rate
    weight, moment = (fluid.grid.inner_faces(each.reshape(cut.volume.shape), d) for each in moments)
    low, high = layers(d, slice(None, -1)), layers(d, slice(1, None))
    return np.asarray((moment[low] + moment[high]) / np.maximum(weight[low] + weight[high], 1e-300))


def _turning(cut: CutCells, points: list[Array]) -> Array:
    """Change of the normal along the velocity of the wall, w.grad n at its points (n, 3) [1/s]."""
    sliding, step = cut.surface.velocity(*points), 1e-2 * min(cut.grid.spacing)
    speed = np.sqrt(sliding[0] ** 2 + sliding[1] ** 2 + sliding[2] ** 2)
    along = [each / np.maximum(speed, 1e-300) for each in sliding]
    ahead, behind = (_slopes(cut, [x + side * step * n for x, n in zip(points, along)]) for side in (1.0, -1.0))
    return np.asarray((speed * (np.array(ahead) - np.array(behind)) / (2.0 * step)).T)


def _slopes(cut: CutCells, points: Sequence[Array]) -> list[Array]:
    """Gradient of the distance, which is the normal into the fluid."""
    step = 1e-3 * min(cut.grid.spacing)
    made = []
    for d in range(3):
        high, low = ([x + side * step * (e == d) for e, x in enumerate(points)] for side in (1.0, -1.0))
        made.append((cut.surface.distance(*high) - cut.surface.distance(*low)) / (2.0 * step))
    return made


def _on_wall(cut: CutCells, points: Sequence[Array]) -> Array:
    """The points of the wall nearest to these (n, 3)."""
    away = cut.surface.distance(*points)
    return np.stack([x - away * n for x, n in zip(points, _slopes(cut, points))], axis=-1)
