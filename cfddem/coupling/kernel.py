r"""The filter kernel: particles deposit on cells and gather from them.

A particle deposits its volume, drag and momentum on cells with weights that add up to one, and gathers fields of the
cells with the same weights. The two operations are adjoint, so that one side receives what the other gives. The kernel
has two stages: the weights of the particle (`mapping`), then a diffusion of the cell field until the whole kernel has
the given standard deviation, for any cell size:

.. math:: \varphi_c V = \sum_c' S_{cc'} \sum_p w_{c'p} V_p, \qquad S = (1 + a \nabla_h^2)^n, \qquad
          \sigma^2 = h^2/6 + 2 n a h^2

S is symmetric, keeps sums, and does not pass walls or solid cells. What the first stage puts behind a wall is put into
the nearest open cell.

Particles of unequal sizes have kernels of unequal widths: each deposits and gathers with the second stage of its own
size, so that small particles among large ones exchange with their own surroundings. Deposit and gather of each size
are adjoint, and so are those of all together.

Where several ranks share the grid, each deposits its own particles on the cells around them
(:class:`cfddem.coupling.kernel_cells.GhostDeposit`), which are then added to those of their owners; a gather takes
them from there. Deposit and gather stay adjoint.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.compile import get_num_threads
from cfddem.backend.errors import InputError, nearest
from cfddem.backend.exact_sums import unit_of
from cfddem.coupling import kernel_loops as loops
from cfddem.coupling.kernel_cells import GhostDeposit, merged_cells, sides_of
from cfddem.fluid.grid import AT_CENTRES, HIGH, LOW, Array, Grid, sample
from cfddem.fluid.halo import Halo
from cfddem.particles.ghosts import SingleDomain
from cfddem.particles.state import sphere_volume

MAPPINGS = ("linear", "centroid", "divided")
"""First stage: a cube as large as a cell around the centre; the cell of the centre; equal pieces of the sphere, each in
the cell of its centre."""

PIECES = 32
"""Number of pieces of the divided mapping."""

SLAB = 4
"""Least number of cell layers that one thread fills at a time."""


class Stencil(NamedTuple):
    """Cells on which particles deposit: for each of their equal pieces a cell and the seven beside, above and behind.

    A layer of cells around the grid takes part, see :class:`cfddem.coupling.kernel_cells.GhostOwners`.
    """

    first: np.ndarray  # (N, pieces) uint32, flat index of the lowest of the eight cells
    shares: Array  # (N, pieces, 3) in the next cell along x, y, z


class ParticleCellMap(NamedTuple):
    """Positions of particles among the cells at one time."""

    position: Array  # (N, 3) [m]
    radius: Array  # (N,) [m]
    volume: Array  # (N,) [m3]
    order: np.ndarray  # rows of the particles, sorted by slab
    start: np.ndarray  # (slabs + 1,) first place of each slab in `order`
    stencil: Stencil
    number: int  # of particles on all ranks
    of_kinds: tuple[tuple[np.ndarray, np.ndarray], ...] = ()  # order and start of each kind of kernel, if unequal


def _over(fields: Array, volume: Array | float) -> Array:
    """Fields per volume [m3], one for all or one of each."""
    return fields if np.ndim(volume) == 0 and volume == 1.0 else fields / np.reshape(volume, (-1, 1, 1, 1))


class FilterKernel:
    """Deposits values of particles on the cells of a grid, and gathers fields of the cells.

    grid          cells, some of them solid
    periodic      whether x, y, z are periodic
    mapping       "linear", "centroid" or "divided", see `MAPPINGS`
    smoothing     standard deviation of the whole kernel [m]; 0 for the mapping alone
    sizes         radius and standard deviation of each size of particles, ascending [m]; a particle between two has the
                  kernel of the nearer one, by its logarithm. Empty where all have the same
    twice         whether this is that of a deposit and a gather together, both with the mapping
    parts         into how many the cells of the fluid are divided along x, y, z
    owners        which rank owns which particles; as the cells if None
    """

    def __init__(
        self,
        grid: Grid,
        periodic: Sequence[bool] | np.ndarray,
        *,
        mapping: str = "linear",
        smoothing: float = 0.0,
        sizes: Sequence[tuple[float, float]] = (),
        twice: bool = False,
        parts: Sequence[int] = (1, 1, 1),
        owners: SingleDomain | None = None,
    ) -> None:
        if mapping not in MAPPINGS:
            raise InputError("laws.mapping", mapping, nearest(mapping, MAPPINGS))
        if not (np.isfinite(smoothing) and smoothing >= 0.0):
            raise InputError("kernel width", smoothing, "zero or positive, in m")
        self.grid, self.mapping, self.smoothing = grid, mapping, float(smoothing)
        self.communicator, self.twice = grid.communicator, twice
        self.periodic = np.array(periodic, bool)
        self._linear = 1.0 if mapping == "linear" else 0.0
        self._offsets = _pieces(PIECES) if mapping == "divided" else np.zeros((1, 3))
        self._merged = merged_cells(grid, self.periodic)
        self.owners, self._parts = owners or SingleDomain(), parts
        self._take_reach()
        self.halo = Halo(grid.cells, periodic, 1, 1, grid.borders(periodic))
        self._buffers: dict[int, list[tuple[Array, Array]]] = {}
        self._gates = self._merged.gates(self.halo)
        self.sizes = tuple(sizes)
        radii = np.array([radius for radius, _ in self.sizes])
        self._edges = np.sqrt(radii[1:] * radii[:-1])
        self.widths = np.array([width for _, width in self.sizes] or [self.smoothing])
        self.stages = [self._diffusion(width) for width in self.widths]
        self.sweeps, self.strength = self._diffusion(self.smoothing)

    def _take_reach(self) -> None:
        """Find the cells that particles reach by the present division of space."""
        self.reach = GhostDeposit(self._merged.grid, self.periodic, self._parts, self.owners.division)
        self._axes = self.reach.axes()
        self._sides = sides_of(self.grid.whole, self._merged.grid.whole, self.reach, self._axes)
        self._homes = self._sides.homes
        _, ny, nx = self.reach.shape
        self._layer = (ny + 2) * (nx + 2)
        planes = self._homes.of_layered.reshape(-1, self._layer) // (ny * nx)
        self._lowest_homes, self._highest_homes = planes.min(axis=1), planes.max(axis=1)  # local: of a layer
        corners = [(c * (ny + 2) + b) * (nx + 2) + a for c in (0, 1) for b in (0, 1) for a in (0, 1)]
        self.corners = np.array(corners, np.uint32)

    def _diffusion(self, width: float) -> tuple[int, Array]:
        """Number of sweeps, and strength of each along x, y, z, that widen the mapping to a standard deviation."""
        spacing = np.array(self.grid.spacing)
        own = spacing**2 / 6.0  # mean variance of the linear mapping, twice that of a point within its cell
        own *= 1.0 + self.twice
        missing = np.maximum(width**2 - own, 0.0) * (np.array(self.grid.cells) > 1)
        total = missing / (2.0 * spacing**2)
        sweeps = math.ceil(2.0 * float(total.sum()) - 1e-9)  # local: three directions
        return sweeps, total / max(sweeps, 1)

    # ------------------------------------------------------------ particles of unequal sizes

    @property
    def unequal(self) -> bool:
        """Whether particles have kernels of several widths."""
        return len(self.stages) > 1

    def kinds(self, radius: Array) -> np.ndarray:
        """Place of every particle's kernel among `stages` (N,)."""
        return np.searchsorted(self._edges, radius)

    def width(self, radius: Array) -> Array:
        """Standard deviation of the kernel of every particle (N,) [m]."""
        widths: Array = self.widths[self.kinds(radius)]
        return widths

    def of_each_kind(self, radius: Array) -> Iterator[tuple[int, Any]]:
        """Each kind of kernel, and the rows of its particles; all rows, as a slice, where there is one kind."""
        if not self.unequal:
            yield 0, slice(None)
            return
        kinds = self.kinds(radius)
        for kind in range(len(self.stages)):
            yield kind, np.flatnonzero(kinds == kind)  # none too: all ranks pass the second stage together

    def spread(self, cell_map: ParticleCellMap, values: Array, volume: Array | float = 1.0) -> Array:
        """Both stages: sum over particles of weight times value, values (N, m) to fields (m, nz, ny, nx).

        volume  by which deposits are divided before the second stage, one or of each of the values [m3]
        """
        if not self.unequal:
            return self.smooth(_over(self.deposit(cell_map, values), volume))
        spread = np.zeros((values.shape[1], *self.grid.shape))
        for places, stage in zip(cell_map.of_kinds, self.stages):
            spread += self._smoothed(_over(self.deposit(cell_map, values, places), volume), stage)
        return spread

    def sample(self, stencil: Stencil, radius: Array, fields: Array, plain: Array | None = None) -> Array:
        """Both stages: weighted mean of fields (m, nz, ny, nx) around every particle (N, m); the adjoint of `spread`.

        plain  fields that have passed the second stage (k, nz, ny, nx); their means follow (N, m + k)
        """
        more = () if plain is None else (plain,)
        smoothed = [np.concatenate([self._smoothed(fields, stage), *more]) for stage in self.stages]
        if not self.unequal:
            return self.gather(stencil, smoothed[0])
        values = np.empty((len(radius), len(smoothed[0])))
        around = self.layered(np.concatenate(smoothed), stencil)
        loops.gather_of_kinds(self.kinds(radius), *stencil, self.corners, around, values)
        return values

    def sample_over_steps(self, earlier: Stencil, last: Stencil, now: Stencil, radius: Array, fields: Array) -> Array:
        """As `sample`, the mean of particles at the places of three steps, with the weights 1/4, 1/2 and 1/4."""
        if not self.unequal:
            return self.gather_over_steps(earlier, last, now, self.smooth(fields))
        smoothed = np.concatenate([self._smoothed(fields, stage) for stage in self.stages])
        gathered, kinds = self.gather_over_steps(earlier, last, now, smoothed), self.kinds(radius)
        values, count = gathered[:, : len(fields)].copy(), len(fields)
        for kind in range(1, len(self.stages)):
            np.copyto(values, gathered[:, kind * count : (kind + 1) * count], where=(kinds == kind)[:, None])
        return values

    def solids_with_slope(self, cell_map: ParticleCellMap) -> Array:
        """Solid fraction around every particle, and its derivatives along x, y, z (N, 4) [-], [1/m]."""
        deposited, values = self.deposit(cell_map, cell_map.volume[:, None]), np.empty((len(cell_map.volume), 4))
        for kind, rows in self.of_each_kind(cell_map.radius):
            solid = self.smooth(deposited, self.stages[kind])[0] / self.grid.cell_volume
            values[rows] = self.gather_with_slope(cell_map.stencil, solid)[rows]
        return values

    def _smoothed(self, fields: Array, stage: tuple[int, Array]) -> Array:
        """As `smooth`; the fields themselves where the stage does nothing."""
        return self.smooth(fields, stage) if stage[0] else fields

    # ------------------------------------------------------------ particles to cells

    def map_particles(self, position: Array, radius: Array) -> ParticleCellMap:
        """Map of particles at positions (N, 3) [m] with radii (N,) [m]."""
        stencil = self.stencil(position, radius)
        layers = self._layers_of_a_slab(radius)
        slabs = max(self.reach.shape[0] // layers, 1)
        order, start = np.empty(len(position), np.int64), np.zeros(slabs + 1, np.int64)
        low = self._axes.origin[2] + self._axes.first[2] * self.grid.spacing[2]
        loops.sort_into_slabs(position, low, self._axes.inverse[2], layers, order, start)
        number, places = int(self.communicator.sum([len(position)])), []
        for kind in range(len(self.stages) if self.unequal else 0):
            own = self.kinds(radius)[order] == kind
            places.append((order[own], np.append(0, np.cumsum(own))[start]))
        volume = sphere_volume(radius)
        return ParticleCellMap(position.copy(), radius, volume, order, start, stencil, number, tuple(places))

    def _layers_of_a_slab(self, radius: Array) -> int:
        """So many that no two slabs of even number, nor of odd number, deposit on the same cells."""
        reach = np.max(radius, initial=0.0) * self._offsets[:, 2].max()  # local: own particles
        beyond = math.ceil(reach * self._axes.inverse[2])
        return max(SLAB, 2 * beyond + 2)

    def wrapped(self, position: Array) -> Array:
        """Positions (N, 3) [m], moved into the grid along periodic directions."""
        if not any(self.periodic):
            return position.copy()
        size, origin = np.array(self.grid.whole.size), np.array(self.grid.whole.origin)
        inside: Array = position - self.periodic * size * np.floor((position - origin) / size)
        return inside

    def nearest(self, way: Array) -> Array:
        """The shortest of the ways that are equal along periodic directions (N, 3) [m]."""
        size = np.array(self.grid.whole.size)
        shortest: Array = way - self.periodic * size * np.round(way / size)
        return shortest

    def stencil(self, position: Array, radius: Array) -> Stencil:
        """Cells and weights of particles at positions (N, 3) [m] with radii (N,) [m]."""
        if self.owners.division is not self.reach.division:  # space has been cut anew
            self._take_reach()
        shape = len(position), len(self._offsets)
        stencil = Stencil(np.empty(shape, np.uint32), np.empty((*shape, 3)))
        self.reach.refuse_beyond(position, radius if len(self._offsets) > 1 else None)
        loops.stencils(position, radius, self._offsets, self._linear, self._axes, *stencil)
        self._sides.choose(position, stencil.first)
        return stencil

    def deposit(
        self, cell_map: ParticleCellMap, values: Array, places: tuple[np.ndarray, np.ndarray] | None = None
    ) -> Array:
        """Sum over particles of weight times value: values (N, m) to fields (m, nz, ny, nx).

        Whole numbers are summed, so that the bits depend neither on threads nor on ranks; NaN where a value is NaN.

        places  order and start of some of the particles; of all if None
        """
        values, homes, shape = np.ascontiguousarray(values), self._homes, self.reach.shape
        unit = self._unit(cell_map, values)
        deposits = np.zeros((len(homes.of_layered), values.shape[1]), np.int64)
        slabs = places or (cell_map.order, cell_map.start)
        loops.deposit(slabs, values, unit, *cell_map.stencil, self.corners, get_num_threads(), deposits)
        fields, planes = np.zeros((values.shape[1], *shape), np.int64), self._planes_below(cell_map.stencil)
        cells = planes.start * shape[1] * shape[2], planes.stop * shape[1] * shape[2]
        loops.collect(homes.order, homes.begins, cells, deposits, fields.reshape(len(fields), -1))
        collected = self.reach.collected(fields)
        if collected is not fields or np.isnan(unit).any():  # local: every rank has the same
            planes = slice(0, len(collected[0]))
        sums = np.zeros(collected.shape)
        np.divide(collected[:, planes], unit[:, None, None, None], out=sums[:, planes])
        return self._merged.share(sums)

    def _layers(self, *stencils: Stencil) -> slice:
        """The layers of cells that particles touch, among those of the grid and of the layer around it."""
        if not stencils[0].first.size:
            return slice(0, 0)
        ends = [int(end) for stencil in stencils for end in (stencil.first.min(), stencil.first.max())]  # local: own
        return slice(min(ends) // self._layer, max(ends) // self._layer + 2)

    def _planes_below(self, stencil: Stencil) -> slice:
        """The planes of the grid with all cells that take what particles deposit."""
        layers = self._layers(stencil)
        if layers.stop == 0:
            return layers
        return slice(int(self._lowest_homes[layers].min()), int(self._highest_homes[layers].max()) + 1)  # local: own

    def _unit(self, cell_map: ParticleCellMap, values: Array) -> Array:
        """Whole numbers in 1 of each of the values (m,), so many that no sum in a cell is too large; NaN for NaN."""
        largest = np.zeros((2, values.shape[1]))
        loops.largest_deposits(values, cell_map.volume, self.grid.cell_volume, largest)
        of_one, of_crowd = self.communicator.largest(largest, axis=())
        most = np.minimum(cell_map.number * of_one, of_crowd)
        return np.array([math.nan if math.isnan(limit) else unit_of(limit, 62) for limit in most.tolist()])

    def gather(self, stencil: Stencil, fields: Array) -> Array:
        """Weighted mean of fields (m, nz, ny, nx) around every particle (N, m); the adjoint of `deposit`."""
        values = np.empty((len(stencil.first), len(fields)))
        loops.gather(*stencil, self.corners, self.layered(fields, stencil), values)
        return values

    def gather_with_slope(self, stencil: Stencil, field: Array) -> Array:
        """As `gather`, of one field (nz, ny, nx), and the derivatives of this value along x, y, z (N, 4)."""
        values = np.empty((len(stencil.first), 4))
        around = self.layered(field[None], stencil)
        loops.gather_with_slope(*stencil, self.corners, around, self._axes.inverse, values)
        return values

    def gather_over_steps(self, earlier: Stencil, last: Stencil, now: Stencil, fields: Array) -> Array:
        """As `gather`, the mean of particles at the places of three steps, with the weights 1/4, 1/2 and 1/4."""
        values = np.empty((len(now.first), len(fields)))
        around = self.layered(fields, earlier, last, now)
        loops.gather_over_steps(earlier, last, now, self.corners, around, values)
        return values

    def between_centres(self, field: Array, position: Array) -> Array:
        """Values of a field (nz, ny, nx) at the places (N, 3) [m] of particles, tri-linear between centres (N,)."""
        least, most = self.communicator.smallest(field), self.communicator.largest(field)
        if least == most:
            return np.full(len(position), most)  # free of the rounding of an interpolation
        around = self.reach.spread(field[None])[0]
        for axis in range(3):
            widths = [(LOW, HIGH) if axis == 2 - d else (0, 0) for d in range(3)]
            around = np.pad(around, widths, "wrap" if self.reach.wraps[axis] else "edge")
        values, (origin, inverse, _, first, _) = np.empty((len(position), 1)), self._axes
        sample(around[None], AT_CENTRES, np.ascontiguousarray(position), origin, first, inverse, values)
        return np.asarray(values[:, 0])

    def layered(self, fields: Array, *stencils: Stencil) -> Array:
        """Fields (m, nz, ny, nx) in the cells and the layer around them (n, m).

        stencils  of the particles that alone will read these values; of any if there are none
        """
        layered = np.empty((len(self._homes.of_layered), len(fields)))
        around = self.reach.spread(self._merged.equalise(fields))
        layers = self._layers(*stencils) if stencils else slice(0, len(self._lowest_homes))
        ends = layers.start * self._layer, layers.stop * self._layer
        loops.spread(self._homes.of_layered, ends, around.reshape(len(fields), -1), layered)
        return layered

    def of_deposits(self, deposits: Array) -> Array:
        """Fields (m, nz, ny, nx) of what lies on the cells, per open share of their groups."""
        return self._merged.share(np.array(deposits, float, order="C"))

    def of_large_cells(self, fields: Array) -> Array:
        """Fields (m, nz, ny, nx) with the value of the large cell in all cells of a group."""
        return self._merged.copy(np.array(fields, float, order="C"))

    def smooth(self, fields: Array, stage: tuple[int, Array] | None = None) -> Array:
        """Second stage for fields (m, nz, ny, nx): keeps sums and is its own adjoint.

        stage  one of `stages`; that of the widest kernel if None
        """
        sweeps, strength = (self.sweeps, self.strength) if stage is None else stage
        if sweeps == 0:
            return np.array(self._merged.equalise(fields), float, order="C")
        (now, inside), (other, inside_other) = self._scratch(len(fields))
        fields = self._merged.equalise(fields)
        low, high = planes = self._planes(fields, sweeps)
        for padded in (now, other):  # beside the planes that are swept
            padded[:, low - 1] = padded[:, high + 1] = 0.0
        swept, smoothed = np.s_[:, low - 1 : high], np.zeros(fields.shape)
        inside[swept] = fields[swept]
        for _ in range(sweeps):
            self.halo.fill(now, extend=False)  # gates are closed at sides
            loops.sweep(now, other, planes, strength, *self._gates, self._merged.shares)
            now, inside, other, inside_other = other, inside_other, now, inside
        smoothed[swept] = inside[swept]
        return self._merged.copy(smoothed)

    def _planes(self, fields: Array, sweeps: int) -> tuple[int, int]:
        """First and last plane, of padded fields, that so many sweeps reach: all of a grid that others go on."""
        count = self.grid.shape[0]
        if self.periodic[2] or self.grid.communicator.size > 1:
            return 1, count
        first, last = loops.ends_of(fields)
        return (max(first + 1 - sweeps, 1), min(last + 1 + sweeps, count)) if first <= last else (1, 0)

    def _scratch(self, count: int) -> list[tuple[Array, Array]]:
        """Two arrays for so many padded fields, each with a view without its ghosts; the same in every call."""
        if count not in self._buffers:
            padded = np.zeros((2, count, *(n + 2 for n in self.grid.shape)))
            self._buffers[count] = [(fields, self.halo.inner(fields)) for fields in padded]
        return self._buffers[count]

    def solid_fraction(self, cell_map: ParticleCellMap) -> Array:
        """Solid fraction of the cells (nz, ny, nx) [-]."""
        solid: Array = self.spread(cell_map, cell_map.volume[:, None])[0] / self.grid.cell_volume
        return solid

    # ------------------------------------------------------------ flux

    def solid_flux(self, old: ParticleCellMap, new: ParticleCellMap, step: float) -> list[Array]:
        r"""Volume flux of particles through every face between two maps.

        .. math:: (\varphi^{new} - \varphi^{old})/\Delta t + \nabla\cdot q = 0

        holds to round-off, because the flux follows each particle along its path with the weights of its volume. A
        particle may move by less than a cell.

        old, new  maps of the same particles in the same order
        step      time between them [s]
        returns   along x, y, z: (nz, ny, nx+1), (nz, ny+1, nx), (nz+1, ny, nx) [m/s]
        errors    InputError for solid cells, or a particle that moves by a cell or more
        """
        grid, size = self.grid, np.array(self.grid.whole.size)
        moved = new.position - old.position
        moved -= self.periodic * size * np.rint(moved / size)
        farthest = self.communicator.largest(np.abs(moved * self._axes.inverse), default=0.0)
        if farthest >= 1.0:
            raise InputError(
                "distance moved by the fastest particle", farthest, "below one cell", "take a smaller fluid step"
            )
        if grid.whole.solid is not None or grid.walls:
            raise InputError("solid_flux", None, "computed on a grid without solid cells")
        if self.unequal:
            raise InputError("solid_flux", None, "computed for particles with one width of the kernel")
        volume = new.volume
        flux = self._carried(old, moved, volume)
        change = self.halo.padded(self.deposit(new, volume[:, None]) - self.deposit(old, volume[:, None]))
        other, passed = np.empty_like(change), np.zeros_like(change)
        for _ in range(self.sweeps):
            passed += change
            loops.sweep(change, other, (1, grid.shape[0]), self.strength, *self._gates, self._merged.shares)
            self.halo.fill(other)
            change, other = other, change
        for axis in range(3):
            self._add_diffused(flux[axis], passed[0], axis)
            flux[axis] /= grid.face_area(axis) * step
        return flux

    def _carried(self, old: ParticleCellMap, moved: Array, volume: Array) -> list[Array]:
        """Volume that the particles of all ranks carry through the faces of this grid, without the second stage [m3].

        moved, volume  displacement (N, 3) [m] and volume (N,) [m3] of the particles
        """
        whole, first, cells = self.grid.whole, self.grid.first, self.grid.cells
        most = old.number * self.communicator.largest(volume, default=0.0)
        unit, fields = unit_of(most, 62), list[Array]()
        carried = [
            np.zeros(tuple(n + (2 - axis == d) for d, n in enumerate(whole.shape)), np.int64) for axis in range(3)
        ]
        paths = loops.Paths(old.position, moved, old.radius, volume)
        loops.carry_all(paths, unit, self._offsets, self._linear, self._axes, self.periodic, tuple(carried))
        for axis, own in enumerate(carried):
            total = np.asarray(self.communicator.sum(own, axis=()))
            ends = np.moveaxis(total, 2 - axis, 0)
            if self.periodic[axis]:
                ends[-1] = ends[0]
            here = [slice(low, low + n + (axis == d)) for d, (low, n) in enumerate(zip(first, cells))]
            fields.append(total[*here[::-1]] / unit)
        return fields

    def _add_diffused(self, flux: Array, passed: Array, axis: int) -> None:
        """Add the flux of the second stage through the faces normal to an axis: strength times difference.

        passed  sum of the padded fields before each sweep (nz, ny, nx)
        """
        at = 2 - axis
        through = self.strength[axis] * self._gates[axis] * (np.roll(passed, 1, axis=at) - passed)
        here = [slice(1, n + 1) for n in self.grid.shape]
        here[at] = slice(1, self.grid.shape[at] + 2)  # the last face is closed, or in a layer of ghosts
        flux += through[*here]


def _pieces(count: int) -> Array:
    """Centres of equal pieces of a unit sphere: in shells of equal volume, at the golden angle (count, 3)."""
    number = np.arange(count) + 0.5
    radius = np.cbrt((np.arange(count) * 0.6180339887498949) % 1.0)
    height, angle = 1.0 - 2.0 * number / count, number * math.pi * (3.0 - math.sqrt(5.0))
    ring = np.sqrt(1.0 - height**2)
    points = radius[:, None] * np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    return np.ascontiguousarray(points - points.mean(axis=0))  # local: pieces of one sphere
