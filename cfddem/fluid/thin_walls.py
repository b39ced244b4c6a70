"""Walls without thickness, with fluid on both sides: a draft tube, a baffle.

    tube = thin_wall(corners)                                     # triangles (T, 3, 3) [m]
    grid = within(Grid.of_size((0.1, 0.1, 0.3), 0.005), divided(tube, vessel))  # of cfddem.fluid.cut_cells

A face of the grid is closed where the line between the centres of its two cells crosses the wall: no fluid passes, and
the wall has steps, half a cell away from the triangles at most. Fluid sticks to both sides of a closed face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.fluid.grid import Array
from cfddem.fluid.surfaces import Surface
from cfddem.fluid.triangles import normals_of, sorted_into_boxes, with_area
from cfddem.model.triangles import edges_of

FAR = 1e6
"""Distance of a wall that is not there [m]."""

ASIDE = np.array([0.618e-7, 0.414e-7, 0.732e-7])
"""Cells by which centres are shifted, so that none lies on a wall: the same for all [-]."""


class ThinWall:
    """A wall without thickness, of triangles; made by :func:`thin_wall`.

    corners  of the triangles (T, 3, 3) [m]
    """

    def __init__(self, corners: Array, names: NDArray[np.int64]) -> None:
        order, self._tree = sorted_into_boxes(corners)
        self.corners = np.ascontiguousarray(corners[order])
        self._normals = normals_of(self.corners, names[order])

    def between(self, begin: Array, end: Array) -> NDArray[np.bool_]:
        """Whether the wall crosses the straight lines between places (N, 3) [m] (N,)."""
        from cfddem.fluid.triangles_loops import crossings  # compiled, for few cases

        crossed = np.zeros(len(begin), bool)
        crossings(np.ascontiguousarray(begin), np.ascontiguousarray(end), self.corners, self._tree, crossed)
        return crossed

    def side(self, places: Array) -> Array:
        """Distance of places (N, 3) [m] from the wall, negative on the side of its normals (N,) [m]."""
        from cfddem.fluid.triangles_loops import signed_distances

        distance = np.empty(len(places))
        signed_distances(np.ascontiguousarray(places), self.corners, self._normals, self._tree, distance)
        return distance


@dataclass(frozen=True, eq=False)
class TwoSided:
    """Fluid within a wall, divided by thin walls.

    wall  around the fluid; None in a box
    thin  all thin walls
    """

    wall: Surface | None
    thin: ThinWall

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """See :meth:`cfddem.fluid.surfaces.Surface.distance`: that of the wall around the fluid."""
        if self.wall is not None:
            return self.wall.distance(x, y, z)
        return np.full(np.broadcast_shapes(np.shape(x), np.shape(y), np.shape(z)), FAR)

    def velocity(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """See :meth:`cfddem.fluid.surfaces.Surface.velocity`."""
        if self.wall is not None:
            return self.wall.velocity(x, y, z)
        still = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y), np.shape(z)))
        return still, still, still


def thin_wall(*surfaces: Array) -> ThinWall:
    """A thin wall of surfaces, each of triangles (T, 3, 3) [m].

    errors  InputError for triangles beside each other with opposite normals
    """
    corners = with_area(np.concatenate([np.asarray(surface, float) for surface in surfaces]))
    if not len(corners):
        raise InputError("thin wall", None, "of at least one triangle with an area")
    names, _, count = edges_of(corners)
    if ((count == 2).any(axis=1) & (count == 0).any(axis=1)).any():
        remedy = "orient them alike before you export it"
        raise InputError("thin wall", None, "of triangles that all have their normals on one side", remedy)
    return ThinWall(corners, names)


def divided(thin: ThinWall, wall: Surface | None = None) -> Surface:
    """The fluid within a wall, or in a box, on both sides of thin walls."""
    return TwoSided(wall, thin)


def parted(surface: Surface, centres: list[Array], spacing: tuple[float, ...], d: int) -> NDArray[np.bool_]:
    """Whether a thin wall closes the face between each cell and the one before it along d.

    centres  x, y, z of the cells, arrays of one shape [m]
    spacing  hx, hy, hz [m]
    """
    if not isinstance(surface, TwoSided):
        return np.zeros(centres[0].shape, bool)
    here = np.stack([np.ravel(coordinate) for coordinate in centres], axis=-1) + ASIDE * np.array(spacing)
    return surface.thin.between(here - np.eye(3)[d] * spacing[d], here).reshape(centres[0].shape)


def refuse_across_periodic_sides(surface: Surface, centres: list[Array], spacing: tuple[float, ...], d: int) -> None:
    """Raise InputError for a thin wall between the first or last cells along a periodic d and their images.

    centres  x, y, z of the cells, which broadcast [m]
    """
    first, last = ([*centres[:d], at, *centres[d + 1 :]] for at in (centres[d].min(), centres[d].max() + spacing[d]))
    for border in (first, last):
        if parted(surface, list(np.broadcast_arrays(*border)), spacing, d).any():
            remedy = "move it by a cell, or take another condition for these sides"
            raise InputError("thin wall", None, f"away from the periodic sides along {'xyz'[d]}", remedy)
