"""Cut cells: how much of every cell and face a smooth wall leaves to the fluid.

The fluid has a share of every cell, its volume, and of every face, its aperture. Both come from the distance of the
wall at the corners of a fine lattice, between which it is linear. A face belongs to both of its cells, so that what
flows out of one flows into the other. The wall in a cell has the area that is missing among its faces: the sum of all
area vectors of a cell is zero.

A velocity is the mean over the open part of its face. Sections also carry the mean distance of this part from the
wall, and that of its square, from which `cfddem.fluid.near_walls` takes gradients.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from cfddem.backend.errors import InputError
from cfddem.fluid.grid import HIGH, LOW, Array, Grid
from cfddem.fluid.halo import Halo
from cfddem.fluid.surfaces import Surface
from cfddem.fluid.thin_walls import parted, refuse_across_periodic_sides

SMALLEST_VOLUME = 1e-6
"""Share of a cell below which it is solid [-]."""

SMALLEST_APERTURE = 1e-5
"""Share of a face below which it is closed [-]."""

PARTS = 4
"""Parts of an edge in the lattice of a section, and sections of a cell."""

REACH = 1.5
"""Sections are cut within this distance of the wall, in diagonals of a cell; farther away they are whole."""

AT_ONCE = 20_000
"""Sections that are cut together, to save memory."""


class Section(NamedTuple):
    """Sections of the fluid by rectangles, arrays of any shape."""

    share: Array  # of the rectangle that is open [-]
    distance: Array  # mean over the open part, from the wall [m]
    square: Array  # mean of the square of the distance [m2]
    sliding: Array  # mean velocity of the nearest wall along the normal of the rectangle [m/s]


def within(grid: Grid, surface: Surface) -> Grid:
    """The grid with a smooth wall: cells that it cuts hold fluid on its side, cells beyond it are solid.

    errors  InputError where no fluid is left, or where the wall separates fluid within a cell
    """
    if grid.solid is not None:
        remedy = "draw the solid cells as walls, or all walls as solid cells"
        raise InputError("walls", None, "in a grid without solid cells", remedy)
    volume = volumes(surface, grid.spacing, *_full_centres(grid))
    solid = volume < SMALLEST_VOLUME
    if solid.all():
        raise InputError("walls", None, "around some of the fluid", "no cell holds fluid; check centre and radius")
    cut_grid: Any = replace(grid, solid=solid, walls=surface)
    _refuse_hidden_walls(cut_grid, surface)
    return cut_grid  # type: ignore[no-any-return]


@lru_cache(maxsize=8)
def open_share(grid: Grid) -> Array | NDArray[np.bool_]:
    """Share of every cell that holds fluid (nz, ny, nx); kept, as measures ask for it in every row."""
    share = np.array(grid.open)
    if grid.walls:
        share = np.asarray(volumes(grid.walls, grid.spacing, *_full_centres(grid)) * grid.open)
    share.flags.writeable = False
    return share


def _refuse_hidden_walls(grid: Grid, surface: Surface) -> None:
    """Raise `InputError` where two cells with fluid have a common face that is closed."""
    is_open, parted, centres = grid.open, np.ones((3, *grid.shape), bool), _full_centres(grid)
    for d in range(3):
        if grid.cells[d] == 1:
            continue
        low = [slice(None)] * 3
        high = [slice(None)] * 3
        low[2 - d], high[2 - d] = slice(None, -1), slice(1, None)
        both = is_open[tuple(low)] & is_open[tuple(high)]
        points = [c[tuple(high)] - 0.5 * grid.spacing[d] * (n == d) for n, c in enumerate(centres)]
        share = _share(surface, points, d, grid.spacing)
        parted[d][tuple(high)] = ~(both & (share > SMALLEST_APERTURE))
    # regions that faces join, and those that touch
    joined, touching = _regions(is_open, parted), label(is_open)[1]
    if joined > touching:
        raise InputError(
            "walls", None, "thicker than a cell, or such that no cell holds fluid on both sides",
            f"{joined - touching} parts of the fluid are cut off within a cell; take smaller cells",
        )  # fmt: skip


def _full_centres(grid: Grid) -> list[Array]:
    return list(np.broadcast_arrays(*grid.centres()))


def _regions(is_open: NDArray[np.bool_], parted: NDArray[np.bool_]) -> int:
    """Number of regions of open cells that are connected through open faces."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    number = np.arange(is_open.size).reshape(is_open.shape)
    pairs = []
    for d in range(3):
        here = ~parted[d]
        pairs.append((number[here], np.roll(number, 1, axis=2 - d)[here]))
    low, high = (np.concatenate(numbers) for numbers in zip(*pairs))
    graph = coo_array((np.ones(low.size), (low, high)), shape=(is_open.size, is_open.size))
    count = connected_components(graph, directed=False)[0]
    return int(count - (~is_open).sum())


# ---------------------------------------------------------------- sections


def section(surface: Surface, points: Sequence[Array], axis: int, spacing: Sequence[float]) -> Section:
    """Sections by rectangles of the size of a face.

    points   x, y, z of their centres, arrays of one shape [m]
    axis     0, 1, 2: the rectangles are normal to x, y, z
    spacing  hx, hy, hz [m]
    """
    centre = surface.distance(*points)
    whole = (centre > 0.0).astype(float), centre.copy(), centre**2, np.array(surface.velocity(*points)[axis])
    return Section(*_with_cuts(whole, centre, REACH * float(np.linalg.norm(spacing)), surface, points, axis, spacing))


def _share(surface: Surface, points: Sequence[Array], axis: int, spacing: Sequence[float]) -> Array:
    """Open share of sections; those farther from the wall than their corners are whole."""
    centre = surface.distance(*points)
    corner = 0.5 * float(np.linalg.norm([h for d, h in enumerate(spacing) if d != axis]))
    whole = ((centre > 0.0).astype(float),)
    return _with_cuts(whole, centre, 1.001 * corner, surface, points, axis, spacing)[0]


def _with_cuts(
    whole: tuple[Array, ...], centre: Array, reach: float,
    surface: Surface, points: Sequence[Array], axis: int, spacing: Sequence[float],
) -> tuple[Array, ...]:  # fmt: skip
    """Fields of sections, of which those whose centre lies within reach of the wall are cut."""
    near = np.flatnonzero(np.abs(centre) < reach)
    flat = [np.ravel(coordinate) for coordinate in points]
    for begin in range(0, near.size, AT_ONCE):
        here = near[begin : begin + AT_ONCE]
        cut = _cut(surface, [coordinate[here] for coordinate in flat], axis, spacing)
        for values, of_these in zip(whole, cut):
            values.ravel()[here] = of_these
    return whole


def _cut(surface: Surface, points: Sequence[Array], axis: int, spacing: Sequence[float]) -> Section:
    """Sections by rectangles around points (n,), each of a lattice of triangles."""
    lattice = np.linspace(-0.5, 0.5, PARTS + 1)
    first, second = (d for d in range(3) if d != axis)
    at: list[Array] = [coordinate[:, None, None] for coordinate in points]
    at[first] = at[first] + spacing[first] * lattice[:, None]
    at[second] = at[second] + spacing[second] * lattice
    shape = (points[0].size, PARTS + 1, PARTS + 1)
    at = list(np.broadcast_arrays(*at))
    distance = np.broadcast_to(surface.distance(*at), shape)
    open_somewhere = (distance > 0.0).any(axis=(1, 2))
    at = [coordinate[open_somewhere] for coordinate in at]
    distance = distance[open_somewhere]
    fields = np.stack([distance, np.broadcast_to(surface.velocity(*at)[axis], distance.shape)])
    a, b, c, e = fields[..., :-1, :-1], fields[..., 1:, :-1], fields[..., :-1, 1:], fields[..., 1:, 1:]
    halves = [_triangle(a, b, e), _triangle(a, c, e)]
    share, mean, square, sliding = (0.5 * (p + q).mean(axis=(1, 2)) for p, q in zip(*halves))
    some = np.maximum(share, 1e-300)
    share = np.where(share > 1.0 - 1e-12, 1.0, np.where(share < SMALLEST_APERTURE, 0.0, share))
    result = np.zeros((4, points[0].size))
    result[:, open_somewhere] = share, mean / some, square / some, sliding / some
    return Section(*result)


def _triangle(a: Array, b: Array, c: Array) -> tuple[Array, Array, Array, Array]:
    """Part of triangles where a linear function is positive: its share, and the integrals over it of the function, of
    its square and of another linear function. Corners are (2, ...), with both functions; areas are 1."""
    corners = np.stack([a, b, c])
    order = np.argsort(corners[:, 0], axis=0)
    (low, other_low), (middle, other_middle), (high, other_high) = np.take_along_axis(corners, order[:, None], axis=0)
    mean, other = (low + middle + high) / 3.0, (other_low + other_middle + other_high) / 3.0
    square = (low * low + middle * middle + high * high + low * middle + low * high + middle * high) / 6.0
    with np.errstate(all="ignore"):
        to_low, to_middle = high / (high - low), high / (high - middle)
        tip = to_low * to_middle
        other_tip = other_high + (to_low * (other_low - other_high) + to_middle * (other_middle - other_high)) / 3.0
        to_high, to_middle = low / (low - high), low / (low - middle)
        missing = to_high * to_middle
        other_missing = other_low + (to_high * (other_high - other_low) + to_middle * (other_middle - other_low)) / 3.0
    kinds = [low > 0.0, middle > 0.0, high > 0.0]
    return (
        np.select(kinds, [np.ones_like(mean), 1.0 - missing, tip], 0.0),
        np.select(kinds, [mean, mean - missing * low / 3.0, tip * high / 3.0], 0.0),
        np.select(kinds, [square, square - missing * low * low / 6.0, tip * high * high / 6.0], 0.0),
        np.select(kinds, [other, other - missing * other_missing, tip * other_tip], 0.0),
    )


def volumes(surface: Surface, spacing: Sequence[float], *centres: Array) -> Array:
    """Share of cells that is open, around centres x, y, z of one shape [m]."""
    total = np.zeros(centres[0].shape)
    for here, points, axis in _sections_of_cells(surface, spacing, centres):
        total[here] += _share(surface, points, axis, spacing) / PARTS
    return np.where(total > 1.0 - 1e-12, 1.0, total)


def contents(surface: Surface, spacing: Sequence[float], *centres: Array) -> tuple[Array, Array]:
    """Share of cells that is open, around centres x, y, z of one shape [m], and its mean distance from the wall [m]."""
    total, distance = np.zeros((2, *centres[0].shape))
    for here, points, axis in _sections_of_cells(surface, spacing, centres):
        cut = section(surface, points, axis, spacing)
        total[here] += cut.share / PARTS
        distance[here] += cut.share * cut.distance / PARTS
    return np.where(total > 1.0 - 1e-12, 1.0, total), distance / np.maximum(total, 1e-300)


def _sections_of_cells(
    surface: Surface, spacing: Sequence[float], centres: Sequence[Array]
) -> Iterator[tuple[NDArray[np.bool_], list[Array], int]]:
    """Several sections of every cell, along the axis that the wall is most parallel to: cells, centres, axis."""
    x, y, z = centres
    step = 1e-3 * min(spacing)
    slope = np.stack([
        np.abs(surface.distance(x + step * (d == 0), y + step * (d == 1), z + step * (d == 2))
               - surface.distance(x - step * (d == 0), y - step * (d == 1), z - step * (d == 2)))
        for d in range(3)
    ])  # fmt: skip
    along = np.argmin(slope, axis=0)
    for d in range(3):
        here = along == d
        for part in range(PARTS):
            points = [coordinate[here] for coordinate in centres]
            points[d] = points[d] + spacing[d] * ((part + 0.5) / PARTS - 0.5)
            yield here, points, d


# ---------------------------------------------------------------- the geometry that a solver uses


class WholeCells:
    """Of a grid without smooth walls: all cells and faces are whole.

    shares  apertures and volumes for compiled loops; none here
    """

    volume: Any = 1.0
    aperture: Any = 1.0
    beyond: Any = 0.0
    shares: tuple[Array, ...] = ()

    def close(self, solved: Array, blocked: NDArray[np.bool_]) -> None:
        """Mark the faces that walls close, as of :class:`cfddem.fluid.boundaries.Faces`."""

    def of_faces(self, d: int) -> Array | float:
        """Apertures of the faces normal to d, padded."""
        return 1.0

    def momentum_share(self, d: int) -> Array | float:
        """Share of the momentum cells of component d that is open, padded."""
        return 1.0

    def own_volume(self) -> Array | float:
        """Share of the cells without ghosts that is open (nz, ny, nx)."""
        return 1.0


def cut_cells(grid: Grid, halo: Halo) -> WholeCells:
    """The cut cells of a grid with smooth walls, or its whole cells."""
    if not grid.walls:
        return WholeCells()
    if grid.whole is grid:
        return cut_cells_of_box(grid, tuple(bool(periodic) for periodic in halo.periodic))
    return CutCells(grid, halo)


@lru_cache(maxsize=2)
def cut_cells_of_box(grid: Grid, periodic: tuple[bool, ...]) -> CutCells:
    """The cut cells of a whole grid with smooth walls: made once for the fluid and for the kernel of its particles.

    periodic  whether x, y, z are periodic
    errors    InputError for a thin wall at periodic sides
    """
    for d in np.flatnonzero(periodic):
        refuse_across_periodic_sides(grid.walls, list(grid.centres()), grid.spacing, int(d))
    return CutCells(grid, Halo(grid.cells, np.array(periodic)))


class CutCells(WholeCells):
    """Volumes, apertures and distances of a grid with smooth walls; padded arrays.

    volume    share of a cell that is open, 0 in solid cells
    aperture  (3, ...) share of a face that is open, 0 beside solid cells
    distance  (3, ...) mean distance from the wall over the open part of a face, 0 on closed faces [m]
    shift     (3, ...) that distance less the one of the centre of the face [m]
    depth     (3, ...) mean square of the distance over its mean [m]
    sliding   (3, ...) mean velocity of the nearest wall over the open part, the component normal to the face [m/s]
    thin      (3, ...) share of a face that thin walls close besides
    beyond    (3, ...) velocity of closed faces, which is that of the wall near by [m/s]
    swerve    (3, ...) that velocity less the one at the centre of the face [m/s]
    """

    def __init__(self, grid: Grid, halo: Halo) -> None:
        surface, h = grid.walls, grid.spacing
        self.grid, self.surface = grid, surface
        shape = grid.padded_shape
        is_open = halo.padded(grid.open)
        self.volume = volumes(surface, h, *self.points((0.5, 0.5, 0.5))) * is_open
        self.aperture, self.distance, self.shift, self.depth, self.sliding, self.swerve, self.thin = np.zeros(
            (7, 3, *shape)
        )
        centres = self.points((0.5, 0.5, 0.5))
        for d in range(3):
            offset = [0.5, 0.5, 0.5]
            offset[d] = 0.0
            points = self.points(offset)
            cut, centre = section(surface, points, d, h), surface.distance(*points)
            share = cut.share * is_open * np.roll(is_open, 1, axis=2 - d)
            some, whole = share > SMALLEST_APERTURE, share == 1.0
            closed = parted(surface, centres, h, d)
            self.thin[d] = np.where(some & closed, share, 0.0)
            self.aperture[d] = np.where(some & ~closed, share, 0.0)
            self.distance[d] = np.where(some, np.where(whole, centre, cut.distance), 0.0)
            self.shift[d] = np.where(whole, 0.0, self.distance[d] - centre)
            self.depth[d] = np.where(some, cut.square / np.where(some, self.distance[d], 1.0), 0.0)
            at_centre = np.where(closed, 0.0, surface.velocity(*points)[d])
            self.sliding[d] = np.where(some & ~whole & ~closed, cut.sliding, at_centre)
            self.swerve[d] = self.sliding[d] - at_centre
        near = self.distance - self.shift > -REACH * float(np.linalg.norm(h))
        self.beyond = np.where(near, self.sliding, 0.0)
        halo.fill(self.volume, extend=False)
        fields = self.aperture, self.distance, self.shift, self.depth, self.sliding, self.swerve, self.thin, self.beyond
        for field in fields:
            halo.fill_faces(field)
        self.shares = self.aperture, self.volume

    def points(self, offset: Sequence[float]) -> list[Array]:
        """Coordinates x, y, z at a place in every padded cell, full arrays [m]."""
        grid = self.grid
        lines = [
            x0 + h * (np.arange(first - LOW, first + n + HIGH, dtype=float) + o)
            for x0, h, first, n, o in zip(grid.whole.origin, grid.spacing, grid.first, grid.cells, offset)
        ]
        return list(np.broadcast_arrays(lines[0][None, None, :], lines[1][None, :, None], lines[2][:, None, None]))

    def close(self, solved: Array, blocked: NDArray[np.bool_]) -> None:
        """See `WholeCells.close`."""
        closed = self.aperture == 0.0
        solved[closed] = 0.0
        blocked |= closed

    def of_faces(self, d: int) -> Array:
        """See `WholeCells.of_faces`."""
        return np.asarray(self.aperture[d])

    def momentum_share(self, d: int) -> Array:
        """See `WholeCells.momentum_share`: half of both cells."""
        return np.asarray(0.5 * (self.volume + np.roll(self.volume, 1, axis=2 - d)))

    def own_volume(self) -> Array:
        """See `WholeCells.own_volume`."""
        return self.grid.inner(self.volume)
