r"""From particles to cells and back: who spreads what over which cells.

A particle spreads its volume, drag and momentum over cells with weights that add up to one; what cells hold
comes back to the particle with the same weights. The pair is adjoint, so what the one side gives the other
receives. Spreading has two stages: weights at the particle (`mapping`), then a diffusion of the cell field until
the whole kernel has the wanted standard deviation, whatever the cell:

.. math:: \varphi_c V = \sum_c' S_{cc'} \sum_p w_{c'p} V_p, \qquad S = (1 + a \nabla_h^2)^n, \qquad
          \sigma^2 = h^2/6 + 2 n a h^2

S is symmetric, keeps sums, and never passes a wall or a solid cell: what would lie behind a wall lies in the
cell before it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt

from cfddem.coupling import spreading_loops as loops
from cfddem.errors import InputError, nearest
from cfddem.fluid.grid import Array, Grid

MAPPINGS = ("linear", "centroid", "divided")
"""A cloud as large as a cell; all in the cell of the centre; the sphere cut into equal pieces, each in its cell."""

PIECES = 32
SLAB = 4
"""Layers of cells that one thread fills at a time, at least; slabs that are filled together never touch."""


class Footprint(NamedTuple):
    """Over which cells particles are spread, and by which weights."""

    cells: np.ndarray  # (N, m) uint32, cells counted through the whole grid
    weights: Array  # (N, m), the sum of a row is 1


class Placement(NamedTuple):
    """Particles among the cells at one instant."""

    position: Array  # (N, 3) [m]
    radius: Array  # (N,) [m]
    volume: Array  # (N,) [m3]
    order: np.ndarray  # rows sorted by slab
    start: np.ndarray  # (slabs + 1,) where the rows of a slab begin in `order`
    footprint: Footprint


class Spreading:
    """Spreads what particles carry over the cells of a grid, and gathers what cells hold for particles.

    grid       cells, some of them solid
    periodic   directions (x, y, z) that repeat
    mapping    "linear", "centroid" or "divided"
    smoothing  standard deviation of the whole kernel [m]; 0 leaves the mapping as it is
    """

    def __init__(
        self, grid: Grid, periodic: Sequence[bool], *, mapping: str = "linear", smoothing: float = 0.0
    ) -> None:
        if mapping not in MAPPINGS:
            raise InputError("laws.mapping", mapping, nearest(mapping, MAPPINGS))
        if not (np.isfinite(smoothing) and smoothing >= 0.0):
            raise InputError("laws.smoothing", smoothing, "zero or positive, in m")
        self.grid, self.mapping, self.smoothing = grid, mapping, float(smoothing)
        self._periodic = np.array(periodic, bool)
        self._linear = 1.0 if mapping == "linear" else 0.0
        self._offsets = _pieces(PIECES) if mapping == "divided" else np.zeros((1, 3))
        self._origin, self._inverse = np.array(grid.origin), 1.0 / np.array(grid.spacing)
        self._home = _homes(grid, self._periodic)
        self._gates = _gates(grid, self._periodic)
        self.sweeps, self.strength = self._diffusion()

    def _diffusion(self) -> tuple[int, Array]:
        """How many sweeps, and how strong each is in each direction, to widen the mapping's kernel to the wanted."""
        spacing = np.array(self.grid.spacing)
        own = spacing**2 / 6.0  # mean variance of the linear mapping, and of a point's place in its cell twice over
        missing = np.maximum(self.smoothing**2 - own, 0.0) * (np.array(self.grid.cells) > 1)
        total = missing / (2.0 * spacing**2)
        sweeps = math.ceil(2.0 * float(total.sum()) - 1e-9)
        return sweeps, total / max(sweeps, 1)

    # ------------------------------------------------------------ particles to cells

    def place(self, position: Array, radius: Array) -> Placement:
        """Where particles stand among the cells."""
        order, start = np.empty(len(position), np.int64), np.zeros(max(self.grid.cells[2] // SLAB, 1) + 1, np.int64)
        loops.sort_into_slabs(position, self._origin[2], self._inverse[2], SLAB, order, start)
        volume = (4.0 / 3.0) * math.pi * radius**3
        return Placement(position.copy(), radius, volume, order, start, self.footprint(position, radius))

    def wrapped(self, position: Array) -> Array:
        """Places (N, 3) [m] brought back into the grid along periodic directions."""
        size = np.array(self.grid.size)
        inside: Array = position - self._periodic * size * np.floor((position - self._origin) / size)
        return inside

    def footprint(self, position: Array, radius: Array) -> Footprint:
        """Cells and weights of particles at places (N, 3) [m]."""
        shape = len(position), 8 * len(self._offsets)
        footprint = Footprint(np.empty(shape, np.uint32), np.empty(shape))
        loops.footprints(
            position, radius, self._offsets, self._linear, self._origin, self._inverse, self._home, *footprint
        )
        return footprint

    def deposit(self, place: Placement, values: Array) -> Array:
        """Sum over particles of weight times value: values (N, m) give fields (m, nz, ny, nx)."""
        fields = np.zeros((math.prod(self.grid.cells), values.shape[1]))
        loops.deposit(place.order, place.start, np.ascontiguousarray(values), *place.footprint, fields)
        return np.ascontiguousarray(fields.T).reshape(-1, *self.grid.shape)

    def gather(self, footprint: Footprint, fields: Array) -> Array:
        """Weighted mean of fields (m, nz, ny, nx) around every particle: (N, m). The adjoint of `deposit`."""
        count = len(fields)
        values = np.empty((len(footprint.cells), count))
        by_cell = np.zeros((math.prod(self.grid.cells), -(-count // loops.FOUR) * loops.FOUR))
        by_cell[:, :count] = fields.reshape(count, -1).T
        loops.gather(*footprint, by_cell, values)
        return values

    def smooth(self, fields: Array) -> Array:
        """Diffuse fields (m, nz, ny, nx) to the wanted width; sums stay, and the operation is its own adjoint."""
        now = np.array(fields, float)
        other = np.empty_like(now)
        for _ in range(self.sweeps):
            loops.sweep(now, other, self.strength, *self._gates)
            now, other = other, now
        return now

    def solid_fraction(self, place: Placement) -> Array:
        """Volume of particles over volume of cell (nz, ny, nx) [-]."""
        solid: Array = self.smooth(self.deposit(place, place.volume[:, None]))[0] / self.grid.cell_volume
        return solid

    # ------------------------------------------------------------ flux

    def solid_flux(self, old: Placement, new: Placement, step: float) -> list[Array]:
        r"""Volume of particles through every face per area and time, while they moved from one place to the next.

        .. math:: (\varphi^{new} - \varphi^{old})/\Delta t + \nabla\cdot q = 0

        to round-off, because the flux follows each particle along its path and is spread as its volume is. A
        particle may move by less than a cell.

        old, new  placements of the same particles, in the same order
        step      time between them [s]
        returns   along x, y, z: (nz, ny, nx+1), (nz, ny+1, nx), (nz+1, ny, nx) [m/s]
        """
        grid = self.grid
        moved = new.position - old.position
        moved -= self._periodic * np.array(grid.size) * np.rint(moved / np.array(grid.size))
        farthest = np.abs(moved * self._inverse)
        if len(moved) and farthest.max() >= 1.0:
            row = int(np.argmax(farthest.max(axis=1)))
            raise InputError(
                f"way of particle row {row} in cells",
                float(farthest[row].max()),
                "below 1",
                "take a smaller fluid step",
            )
        if grid.solid is not None:
            raise InputError("solid_flux", None, "asked for on a grid without solid cells")
        flux = [np.zeros(tuple(n + (2 - axis == d) for d, n in enumerate(grid.shape))) for axis in range(3)]
        volume = new.volume
        loops.carry_all(
            old.position, moved, new.radius, volume, self._offsets, self._linear, self._origin, self._inverse,
            self._periodic, *flux,
        )  # fmt: skip
        change = self.deposit(new, volume[:, None]) - self.deposit(old, volume[:, None])
        passed = np.zeros_like(change)
        for _ in range(self.sweeps):
            passed += change
            other = np.empty_like(change)
            loops.sweep(change, other, self.strength, *self._gates)
            change = other
        for axis in range(3):
            self._add_diffused(flux[axis], passed[0], axis)
            flux[axis] /= grid.face_area(axis) * step
        return flux

    def _add_diffused(self, flux: Array, passed: Array, axis: int) -> None:
        """What diffusion has carried through the faces normal to an axis: the fall of the field times strength."""
        at, gate = 2 - axis, np.moveaxis(self._gates[axis], 2 - axis, 0)
        field, out = np.moveaxis(passed, at, 0), np.moveaxis(flux, at, 0)
        fall = np.roll(field, 1, axis=0) - field
        out[:-1] += self.strength[axis] * gate * fall
        out[-1] = out[0] if self._periodic[axis] else out[-1]


def _pieces(count: int) -> Array:
    """Centres of equal pieces of a unit sphere: shells of equal volume, spread evenly by the golden angle."""
    number = np.arange(count) + 0.5
    radius = np.cbrt((np.arange(count) * 0.6180339887498949) % 1.0)
    height, angle = 1.0 - 2.0 * number / count, number * math.pi * (3.0 - math.sqrt(5.0))
    ring = np.sqrt(1.0 - height**2)
    points = radius[:, None] * np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    return np.ascontiguousarray(points - points.mean(axis=0))


def _homes(grid: Grid, periodic: np.ndarray) -> np.ndarray:
    """For every cell and a rim of ghosts, where what is put there goes: itself, its image, or the nearest open cell."""
    inside = np.pad(grid.open, [(0, 0) if periodic[2 - d] else (1, 1) for d in range(3)])
    nearest_open = distance_transform_edt(~inside, sampling=grid.spacing[::-1], return_indices=True)[1]
    flat = np.zeros(inside.shape, np.int64)
    for d in range(3):
        low = 0 if periodic[2 - d] else 1
        flat = flat * grid.shape[d] + nearest_open[d] - low
    wrapped = np.pad(flat, [(1, 1) if periodic[2 - d] else (0, 0) for d in range(3)], mode="wrap")
    return np.ascontiguousarray(wrapped)


def _gates(grid: Grid, periodic: np.ndarray) -> tuple[Array, Array, Array]:
    """1 on the low face of every cell through which diffusion may pass, 0 at walls and solid cells."""
    gates = []
    for axis in range(3):
        at = 2 - axis
        gate = (grid.open & np.roll(grid.open, 1, axis=at)).astype(float)
        if not periodic[axis]:
            np.moveaxis(gate, at, 0)[0] = 0.0
        gates.append(gate)
    return gates[0], gates[1], gates[2]
