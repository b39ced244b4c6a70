"""The arrays of the walls, and the pieces of walls near each particle.

Triangles are sorted into cells in the frame of their mesh, so that a moving mesh is sorted once. All other pieces
are few, and every particle checks each of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.compile import inline, serial
from cfddem.backend.errors import InputError
from cfddem.particles.state import Particles
from cfddem.particles.vectors import at, flat
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.nearest_point import NUMBERS, TRIANGLE, Walls, in_frame, nearest
from cfddem.particles.walls.wall import Wall


def wall_arrays(walls: Sequence[Wall] = ()) -> Walls:
    """Arrays of the given walls."""
    owner, kind, shape, corner = _pieces(walls)
    low, width, number = _cells_of_meshes(walls)
    cells = np.prod(number, axis=1)
    arrays = Walls(
        kind=kind,
        shape=shape,
        corner=corner,
        material=np.array([walls[m].material for m in owner], np.int32),
        wall=owner,
        velocity=_vectors([wall.velocity for wall in walls]),
        spin=_vectors([wall.spin for wall in walls]),
        centre=_vectors([wall.middle() for wall in walls]),
        shift=np.zeros((len(walls), 3)),
        turned=np.tile(np.eye(3).reshape(-1), (len(walls), 1)),
        sweep=np.array([wall.sweep() for wall in walls], float),
        travel=np.zeros(len(walls)),
        single=np.flatnonzero(kind != TRIANGLE).astype(np.int32),
        cell_low=low,
        cell_width=width,
        cell_number=number,
        cell_offset=np.cumsum(cells) - cells,
        cell_start=np.zeros(int(cells.sum()) + 1, np.int64),
        cell_member=np.zeros(0, np.int32),
        patch_count=np.zeros(1, np.int64),
        patch_thickest=np.zeros(1),
    )
    return _with_cells(arrays) if len(arrays.single) < len(kind) else arrays


def checkpoint_walls(walls: Walls) -> dict[str, np.ndarray]:
    """Copies of all arrays by name."""
    return {name: array.copy() for name, array in walls._asdict().items()}


def restored_walls(kept: Mapping[str, np.ndarray]) -> Walls:
    """The walls of a `checkpoint_walls()`."""
    return Walls(**{name: np.array(array) for name, array in kept.items()})


def _pieces(walls: Sequence[Wall]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Wall, kind, numbers, and corners if a triangle, of each piece (n,), (n,), (n, NUMBERS), (n, 3)."""
    pieces = [(number, *piece) for number, wall in enumerate(walls) for piece in wall.pieces()]
    owner = np.array([number for number, _, _ in pieces], np.int32)
    kind = np.array([kind for _, kind, _ in pieces], np.int8)
    shape = np.zeros((len(pieces), NUMBERS))
    for row, (_, _, numbers) in zip(shape, pieces):
        row[: len(numbers)] = numbers
    corner = np.full((len(pieces), 3), -1, np.int32)
    for m, wall in enumerate(walls):
        if isinstance(wall, Mesh):
            corner[owner == m] = wall.triangles
    return owner, kind, shape, corner


def _cells_of_meshes(walls: Sequence[Wall]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lower corner, width and number of the cells of each wall (m, 3), (m,), (m, 3); no cells but of a mesh."""
    low, width, number = np.zeros((len(walls), 3)), np.ones(len(walls)), np.zeros((len(walls), 3), np.int64)
    for m, wall in enumerate(walls):
        if isinstance(wall, Mesh):
            low[m], width[m], number[m] = _cells(wall)
    return low, width, number


def _cells(mesh: Mesh) -> tuple[np.ndarray, float, np.ndarray]:
    """Lower corner, width and number of the cells of a mesh: about as wide as its triangles, and not too many."""
    corners = mesh.vertices[mesh.triangles]
    size = float((corners.max(axis=1) - corners.min(axis=1)).max(axis=1).mean())
    low = mesh.vertices.min(axis=0)
    span = mesh.vertices.max(axis=0) - low
    width = max(size, float(np.prod(span) / (8.0 * len(corners))) ** (1.0 / 3.0), float(span.max()) / 256.0)
    return low, width, np.floor(span / width).astype(np.int64) + 1


def _with_cells(walls: Walls) -> Walls:
    """The same walls with their triangles sorted into cells."""
    count = np.zeros(len(walls.cell_start) - 1, np.int64)
    bin_triangles(flat(walls), count, walls.cell_member, False)
    walls.cell_start[1:] = np.cumsum(count)
    member = np.empty(walls.cell_start[-1], np.int32)
    bin_triangles(flat(walls), walls.cell_start[:-1].copy(), member, True)
    return walls._replace(cell_member=member)


def _vectors(rows: Sequence[Any]) -> np.ndarray:
    return np.array(rows, float).reshape(-1, 3)


def check_walls(walls: Sequence[Wall], box: np.ndarray, materials: int) -> None:
    """Refuse walls that a run cannot have: of unknown material, or not periodic where the box is.

    box        (3,) length of the periodic box, infinite along open axes [m]
    materials  number of rows of the pair table
    """
    periodic = np.isfinite(box)
    for number, wall in enumerate(walls):
        if wall.material >= materials:
            raise InputError(f"material of wall {number}", wall.material, f"below {materials}, the rows of the table")
        if periodic.any() and not wall.repeats(periodic):
            raise InputError(f"walls[{number}]", type(wall).__name__, "the same all along the periodic axes of the box")


class NearPieces(NamedTuple):
    """Pieces of walls near particles, as loops write them."""

    number: np.ndarray  # (N,) how many are near each particle, or where the next of its pieces is written
    first: np.ndarray  # (n,) row of the particle
    second: np.ndarray  # (n,) piece


def near_walls(particles: Particles, walls: Walls, cutoff_ratio: float, skin: float) -> tuple[np.ndarray, np.ndarray]:
    """Particles and pieces of walls that are closer than the reach of the film plus a skin (n,), (n,) uint32.

    Sorted by row of the particle, then by piece: by wall, and triangle of a mesh.
    """
    nothing = np.zeros(0, np.uint32)
    if len(walls.kind) == 0:
        return nothing, nothing
    count = np.zeros(particles.count, np.int64)
    _list_pieces(particles, walls, cutoff_ratio, skin, NearPieces(count, nothing, nothing), False)
    begin = np.cumsum(count) - count
    end = begin.copy()
    first, second = (np.empty(int(count.sum()), np.uint32) for _ in range(2))
    _list_pieces(particles, walls, cutoff_ratio, skin, NearPieces(end, first, second), True)
    if len(walls.cell_member):
        _sort_rows(second, begin, end)
    return first, second


def _list_pieces(
    particles: Particles,
    walls: Walls,
    cutoff_ratio: float,
    skin: float,
    pieces: NearPieces,
    fill: bool,
) -> None:
    """Count the pieces near each particle, or write them from `pieces.number` on."""
    _list_single(particles.view, flat(walls), cutoff_ratio, skin, pieces, fill)
    if len(walls.cell_member):  # the search in cells is compiled only where there are meshes
        _list_meshes(particles.view, flat(walls), cutoff_ratio, skin, pieces, fill)


@serial
def _list_single(particles, walls, cutoff_ratio, skin, pieces, fill):
    """Count or write the pieces near each particle that are no triangles."""
    for i in range(particles.owned):
        if particles.inverse_mass[i] > 0.0:
            reach = (1.0 + cutoff_ratio) * particles.radius[i] + skin
            for w in walls.single:
                _list(i, w, walls.wall[w], particles, walls, reach, pieces, fill)


@serial
def _list_meshes(particles, walls, cutoff_ratio, skin, pieces, fill):
    """Count or write the triangles near each particle."""
    for i in range(particles.owned):
        if particles.inverse_mass[i] > 0.0:
            reach = (1.0 + cutoff_ratio) * particles.radius[i] + skin
            for m in range(len(walls.sweep)):
                if walls.cell_number[3 * m] > 0:
                    _list_triangles(i, m, particles, walls, reach, pieces, fill)


@serial
def _sort_rows(values, begins, ends):
    """Sort parts of an array in place."""
    for begin, end in zip(begins, ends):
        for last in range(begin + 1, end):
            value, place = values[last], last
            while place > begin and values[place - 1] > value:
                values[place] = values[place - 1]
                place -= 1
            values[place] = value


@inline
def _list(i, w, m, particles, walls, reach, pieces, fill):
    """List piece w of wall m if it is within reach of particle i."""
    if nearest(walls.kind, walls.shape, w, in_frame(walls, m, at(particles.position, i)))[1] < reach:
        if fill:
            pieces.first[pieces.number[i]], pieces.second[pieces.number[i]] = i, w
        pieces.number[i] += 1


@serial
def _list_triangles(i, m, particles, walls, reach, pieces, fill):
    """List the triangles of mesh m within reach of particle i, each once: in the first cell within reach."""
    place = in_frame(walls, m, at(particles.position, i))
    low, high = _span(walls, m, place, place, reach)
    for x in range(max(low[0], 0), min(high[0], walls.cell_number[3 * m] - 1) + 1):
        for y in range(max(low[1], 0), min(high[1], walls.cell_number[3 * m + 1] - 1) + 1):
            for z in range(max(low[2], 0), min(high[2], walls.cell_number[3 * m + 2] - 1) + 1):
                cell = _cell(walls, m, x, y, z)
                for slot in range(walls.cell_start[cell], walls.cell_start[cell + 1]):
                    w = walls.cell_member[slot]
                    begin, _ = _triangle_span(walls, m, w)
                    if (
                        x == max(low[0], begin[0], 0)
                        and y == max(low[1], begin[1], 0)
                        and z == max(low[2], begin[2], 0)
                    ):
                        _list(i, w, m, particles, walls, reach, pieces, fill)


@inline
def _span(walls, m, low, high, reach):
    """Cells of mesh m between two corners, widened by a reach."""
    corner, width = at(walls.cell_low, m), walls.cell_width[m]
    return (
        (
            math.floor((low[0] - reach - corner[0]) / width),
            math.floor((low[1] - reach - corner[1]) / width),
            math.floor((low[2] - reach - corner[2]) / width),
        ),
        (
            math.floor((high[0] + reach - corner[0]) / width),
            math.floor((high[1] + reach - corner[1]) / width),
            math.floor((high[2] + reach - corner[2]) / width),
        ),
    )


@inline
def _triangle_span(walls, m, w):
    """Cells of mesh m that the box around triangle w touches."""
    a, b, c = at(walls.shape, 4 * w), at(walls.shape, 4 * w + 1), at(walls.shape, 4 * w + 2)
    low = (min(a[0], b[0], c[0]), min(a[1], b[1], c[1]), min(a[2], b[2], c[2]))
    high = (max(a[0], b[0], c[0]), max(a[1], b[1], c[1]), max(a[2], b[2], c[2]))
    return _span(walls, m, low, high, 0.0)


@inline
def _cell(walls, m, x, y, z):
    return walls.cell_offset[m] + (x * walls.cell_number[3 * m + 1] + y) * walls.cell_number[3 * m + 2] + z


@serial
def bin_triangles(walls, count, member, fill):
    """Count the triangles of each cell, or write them from `count` on."""
    for w in range(len(walls.kind)):
        if walls.kind[w] != TRIANGLE:
            continue
        m = walls.wall[w]
        low, high = _triangle_span(walls, m, w)
        for x in range(low[0], high[0] + 1):
            for y in range(low[1], high[1] + 1):
                for z in range(low[2], high[2] + 1):
                    cell = _cell(walls, m, x, y, z)
                    if fill:
                        member[count[cell]] = w
                    count[cell] += 1
