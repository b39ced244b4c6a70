"""A closed surface of triangles as a wall of the fluid, which is inside.

    vessel = closed_surface(corners)                             # (T, 3, 3), normals point outwards
    grid = within(Grid.of_size((0.1, 0.1, 0.3), 0.005), vessel)  # of cfddem.fluid.cut_cells

The side of a point is that of the normal of what is nearest to it. On an edge this is the sum of the normals of both
triangles, at a corner the sum of those of all, weighted by their angles (Baerentzen & Aanaes, IEEE Transactions on
Visualization and Computer Graphics 11, 243-253, 2005): it is right at every place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.model.triangles import edges_of

Array = NDArray[np.float64]

OF_LEAF = 4
"""Least number of triangles in a box that is not divided."""

LEAST_AREA = 1e-12
"""Area of a triangle over the square of its longest edge, below which it is left out [-]."""


class Tree(NamedTuple):
    """Boxes around triangles, in the order of a walk through the tree."""

    box: Array  # (nodes, 6) lower and upper corner [m]
    skip: NDArray[np.int64]  # the node after all that a node holds
    first: NDArray[np.int64]  # triangles of a last node; none of the others
    last: NDArray[np.int64]


class ClosedSurface:
    """A closed surface of triangles, with the fluid inside; made by :func:`closed_surface`.

    corners  of the triangles (T, 3, 3) [m]; normals point outwards
    names    number of every corner (T, 3)
    tree     of boxes around them
    """

    def __init__(self, corners: Array, names: NDArray[np.int64]) -> None:
        order, self.tree = sorted_into_boxes(corners)
        self.corners, self.names = np.ascontiguousarray(corners[order]), names[order]
        self._normals = normals_of(self.corners, self.names)

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """See :meth:`cfddem.fluid.surfaces.Surface.distance`."""
        from cfddem.fluid.triangles_loops import signed_distances  # compiled, for few cases

        places = np.broadcast_arrays(x, y, z)
        points = np.stack([np.ravel(coordinate) for coordinate in places], axis=-1).astype(float)
        distance = np.empty(len(points))
        signed_distances(points, self.corners, self._normals, self.tree, distance)
        return distance.reshape(places[0].shape)

    def velocity(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """See :meth:`cfddem.fluid.surfaces.Surface.velocity`: it is at rest."""
        still = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y), np.shape(z)))
        return still, still, still


def closed_surface(corners: Array, key: str = "surface", name: str | None = None) -> ClosedSurface:
    """A closed surface with the fluid inside.

    corners  of the triangles (T, 3, 3) [m]; those without an area are left out
    key      of the surface, in errors; name: of its file
    errors   InputError for a surface with holes, with normals that point inwards, or that passes through itself
    """
    from cfddem.fluid.triangles_loops import first_crossing

    corners = with_area(np.asarray(corners, float))
    names, edges, count = edges_of(corners)
    of_hole = edges[count[:, 0] != count[:, 1]]
    alone = np.unique(np.concatenate([of_hole, of_hole[:, ::-1]]), axis=0) if len(of_hole) else of_hole
    if len(alone):
        same = count[count[:, 0] != count[:, 1]].sum(axis=1) == 2
        if same.all():
            raise InputError(key, name, "a surface whose triangles all have their normals outwards",
                             f"{len(same)} edges lie between one that points inwards and one that points outwards; "
                             "orient them alike before you export it")  # fmt: skip
        place = np.zeros((names.max() + 1, 3))
        place[names.ravel()] = corners.reshape(-1, 3)
        at = ", ".join(f"{coordinate:.4g}" for coordinate in place[of_hole[~same][0]].mean(axis=0))
        raise InputError(key, name, "a closed surface, every edge between two triangles",
                         f"{int((~same).sum())} edges have not, one at ({at}) m; close the holes")  # fmt: skip
    parts = [corners[part] for part in _parts(names)]
    around = sum(signed_volume(part) > 0.0 for part in parts)
    if around == 0 or signed_volume(corners) < 0.0:
        remedy = "it is inside out; reverse its triangles before you export it"
        raise InputError(key, name, "a surface whose normals point out of the vessel", remedy)
    if around > 1:
        remedy = f"it has {around} parts with fluid inside; reverse the triangles of what is solid within the vessel"
        raise InputError(key, name, "one vessel", remedy)
    surface = ClosedSurface(corners, names)
    one, two = first_crossing(surface.corners, surface.names, surface.tree)
    if one >= 0:
        at = ", ".join(f"{coordinate:.4g}" for coordinate in surface.corners[two].mean(axis=0))
        raise InputError(key, name, "a surface that does not pass through itself",
                         f"two triangles cross near ({at}) m; unite its parts before you export it")  # fmt: skip
    return surface


def with_area(corners: Array) -> Array:
    """Triangles (T, 3, 3) that have an area."""
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.asarray(corners[area > LEAST_AREA * sides**2])


def signed_volume(corners: Array) -> float:
    """Volume inside a closed surface (T, 3, 3), negative where normals point inwards [m3]."""
    return float(np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6.0


def section_area(corners: Array, height: float) -> float:
    """Area of the section of a closed surface (T, 3, 3) at a height, by the edges that its triangles have there [m2].

    >>> cube = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7]]
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    >>> section_area(corners[cube + [[2, 7, 6], [3, 0, 4], [3, 4, 7]]].astype(float), 0.3)
    1.0
    """
    above = corners[:, :, 2] > height
    cut = corners[above.any(axis=1) & ~above.all(axis=1)]
    along, ends = np.roll(cut, -1, axis=1) - cut, []
    up, after = cut[:, :, 2] > height, np.roll(cut[:, :, 2] > height, -1, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (height - cut[:, :, 2]) / along[:, :, 2]
        points = cut + share[:, :, None] * along
    for crossing in (up & ~after, ~up & after):  # normals outwards: the section goes from the way down to that up
        ends.append(points[np.arange(len(cut)), np.argmax(crossing, axis=1), :2])
    (x0, y0), (x1, y1) = ends[0].T, ends[1].T
    return abs(float(np.sum(x0 * y1 - x1 * y0))) / 2.0


def through_ends(corners: Array, height: float, reach: float) -> Array:
    """A surface (T, 3, 3) whose flat ends at the heights 0 and `height` are moved out by `reach`, along straight walls:
    the fluid then has floor and lid of its box there [m]."""
    near = 1e-6 * max(height, float(np.ptp(corners.reshape(-1, 3), axis=0).max()))
    for level, step in ((0.0, -reach), (height, reach)):
        flat = (np.abs(corners[:, :, 2] - level) < near).all(axis=1)
        if not flat.any():
            continue
        end, moved = corners[flat], corners[flat] + np.array([0.0, 0.0, step])
        names = np.unique(end.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
        begin, after = names.ravel(), np.roll(names, -1, axis=1).ravel()
        edges = set(zip(begin.tolist(), after.tolist()))
        rim = [n for n, (a, b) in enumerate(zip(begin.tolist(), after.tolist())) if (b, a) not in edges]
        a, b = end.reshape(-1, 3)[rim], np.roll(end, -1, axis=1).reshape(-1, 3)[rim]
        a_out, b_out = moved.reshape(-1, 3)[rim], np.roll(moved, -1, axis=1).reshape(-1, 3)[rim]
        sides = [np.stack([a, b, b_out], axis=1), np.stack([a, b_out, a_out], axis=1)]
        corners = np.concatenate([corners[~flat], moved, *sides])
    return corners


def _parts(names: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Triangles of each part of a surface, by the numbers of their corners (T, 3)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = int(names.max()) + 1
    begin, after = names.ravel(), np.roll(names, -1, axis=1).ravel()
    graph = coo_array((np.ones(len(begin)), (begin, after)), shape=(count, count))
    number, part = connected_components(graph, directed=False)
    return [np.flatnonzero(part[names[:, 0]] == piece) for piece in range(number)]


def normals_of(corners: Array, names: NDArray[np.int64]) -> Array:
    """Normals of triangles, of their edges and of their corners (T, 7, 3), see `triangles_loops.signed_distances`."""
    own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    to_next = np.roll(corners, -1, axis=1) - corners
    to_last = np.roll(corners, 1, axis=1) - corners
    cosine = np.einsum("tci,tci->tc", to_next, to_last)
    cosine = cosine / (np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2))
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    at_corner = np.zeros((names.max() + 1, 3))
    np.add.at(at_corner, names.ravel(), (angle[:, :, None] * own[:, None, :]).reshape(-1, 3))
    ordered = np.sort(np.stack([names, np.roll(names, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    which = np.unique(ordered, axis=0, return_inverse=True)[1].reshape(-1)
    on_edge = np.zeros((which.max() + 1, 3))
    np.add.at(on_edge, which, np.repeat(own, 3, axis=0))
    return np.concatenate([own[:, None], on_edge[which].reshape(-1, 3, 3), at_corner[names]], axis=1)


def sorted_into_boxes(corners: Array) -> tuple[NDArray[np.int64], Tree]:
    """An order of the triangles in which those of every box stand together, and the tree of these boxes."""
    count, middle, order = len(corners), corners.mean(axis=1), np.arange(len(corners))
    depth = max(0, int(np.log2(max(count / OF_LEAF, 1.0))))
    begins = [count * np.arange(2**level + 1) // 2**level for level in range(depth + 1)]
    for begin in begins[:-1]:  # halve every box across its longest edge
        node = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
        low, high = (extreme.reduceat(middle[order], begin[:-1]) for extreme in (np.minimum, np.maximum))
        across = np.argmax(high - low, axis=1)[node]
        order = order[np.lexsort((middle[order, across], node))]
    ends = corners[order].min(axis=1), corners[order].max(axis=1)
    box = np.empty((2 ** (depth + 1) - 1, 6))
    skip, first, last = np.zeros((3, len(box)), np.int64)
    for level, begin in enumerate(begins):
        nodes = 2 ** (depth - level + 1) - 1  # nodes that one of this level is, and holds
        at = np.zeros(1, np.int64)
        for above in range(level):
            at = (at[:, None] + 1 + np.array([0, 2 ** (depth - above) - 1])).ravel()
        box[at, :3] = np.minimum.reduceat(ends[0], begin[:-1])
        box[at, 3:] = np.maximum.reduceat(ends[1], begin[:-1])
        skip[at] = at + nodes
        if level == depth:
            first[at], last[at] = begin[:-1], begin[1:]
    return order, Tree(box, skip, first, last)
