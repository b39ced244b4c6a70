"""Measures of a bed at one instant: height, profiles, pressure drop, solids flux, granular temperature.

Pure functions of whole arrays: files are read whole, and a run joins the particles of all ranks before it calls them
(:meth:`cfddem.run.simulation.Simulation.whole`). Cell fields have the shape (nz, ny, nx), vectors at cells
(nz, ny, nx, 3), particles (N, 3) with columns x, y, z; z points up. `open_cells` is true where a cell holds fluid,
`spacing` is (hx, hy, hz) and `origin` the lowest corner of the box, as in :class:`cfddem.fluid.grid.Grid`. Values that
do not exist, in an empty cell or slab, are NaN. Mixing indices are in :mod:`cfddem.analysis.measures`, bubbles in
:mod:`cfddem.analysis.bubbles`, statistics of time series in :mod:`cfddem.analysis.series`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from cfddem.backend.errors import InputError
from cfddem.particles.state import sphere_volume

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
ALONG = {"x": 0, "y": 1, "z": 2}


OF_THE_BED = 0.99
"""Share of the particle volume that lies below the height of a bed."""


def bed_height(position: Array, radius: Array, share: float = OF_THE_BED) -> float:
    """Height below which a share of the particle volume lies. Spheres are cut at the height, not counted by centre.

    position  (N, 3) [m]
    radius    (N,) [m]
    share     of the volume, between 0 and 1 [-]
    returns   z [m]; NaN without particles

    >>> round(bed_height(np.array([[0.0, 0.0, 1.0]]), np.array([0.5]), share=0.5), 9)
    1.0
    """
    if not 0.0 < share < 1.0:
        raise InputError("share", share, "between 0 and 1")
    if len(radius) == 0:
        return float("nan")
    centre, volume = np.asarray(position)[:, 2], sphere_volume(np.asarray(radius, float))
    order = np.argsort(centre)
    below = np.cumsum(volume[order])
    wanted = share * below[-1]
    guess, reach = centre[order[np.searchsorted(below, wanted)]], float(np.max(radius))
    near = np.abs(centre - guess) <= 3.0 * reach  # all others lie wholly below or above every trial height
    certain = volume[centre < guess - 3.0 * reach].sum()

    def excess(height: float) -> float:
        return float(certain + _volume_below(height, centre[near], radius[near]).sum() - wanted)

    if excess(guess + 2.0 * reach) <= 0.0:  # whole spheres add up to the share within rounding
        lower = centre <= guess
        return float((centre[lower] + radius[lower]).max())
    return float(brentq(excess, guess - 2.0 * reach, guess + 2.0 * reach, xtol=1e-12 * reach, rtol=1e-15))


def _volume_below(height: float, centre: Array, radius: Array) -> Array:
    depth = np.clip(height - centre + radius, 0.0, 2.0 * radius)
    return np.pi / 3.0 * depth * depth * (3.0 * radius - depth)


def layer_solid_fraction(position: Array, radius: Array, edges: Array, area: float | Array) -> Array:
    """Solid fraction of horizontal layers. Spheres are cut at the edges of the layers.

    position  (N, 3) [m]
    radius    (N,) [m]
    edges     (n + 1,) of the layers, evenly spaced, ascending [m]
    area      of the cross-section, one for all layers or (n,) [m2]
    returns   (n,) [-]

    >>> layer_solid_fraction(np.array([[0.0, 0.0, 1.0]]), np.array([0.5]), np.array([0.0, 1.0, 2.0]), np.pi / 6.0)
    array([0.5, 0.5])
    """
    centre, radius, edges = np.asarray(position)[:, 2], np.asarray(radius, float), np.asarray(edges, float)
    step, count = edges[1] - edges[0], len(edges) - 1
    first = np.floor((centre - radius - edges[0]) / step).astype(np.intp)
    reached = int(np.ceil(2.0 * float(np.max(radius, initial=0.0)) / step)) + 1  # layers that a sphere can touch
    volume = np.zeros(count)
    for place in range(reached):
        layer = first + place
        lower = edges[0] + layer * step
        part = _volume_below(lower + step, centre, radius) - _volume_below(lower, centre, radius)
        inside = (layer >= 0) & (layer < count)
        volume += np.bincount(layer[inside], part[inside], count)
    return np.asarray(volume / (area * step))


def profile(field: Array, along: str = "z", open_cells: Mask | None = None, weight: Array | None = None) -> Array:
    """Mean of a cell field over each layer of cells.

    field       (nz, ny, nx) or (nz, ny, nx, 3), any unit
    along       direction of the profile: "x", "y" or "z"
    open_cells  cells to include; all if None
    weight      (nz, ny, nx) of each cell in the mean; 1 if None
    returns     (n,) or (n, 3), same unit; NaN in a layer without included cells

    >>> profile(np.arange(8.0).reshape(2, 2, 2)).tolist()
    [1.5, 5.5]
    """
    for name, shares in (("open_cells", open_cells), ("weight", weight)):
        if shares is not None and shares.shape != field.shape[:3]:
            raise InputError(f"{name}.shape", shares.shape, f"that of the field, {field.shape[:3]}")
    share = np.ones(field.shape[:3]) if weight is None else np.asarray(weight, float)
    if open_cells is not None:
        share = np.where(open_cells, share, 0.0)
    gone = tuple(axis for axis in range(3) if axis != 2 - ALONG[along])
    total = share.sum(axis=gone)
    by_cell = share[..., None] if field.ndim == 4 else share
    summed = np.where(by_cell > 0.0, field * by_cell, 0.0).sum(axis=gone)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(summed / (total[:, None] if field.ndim == 4 else total))


def pressure_drop(
    pressure: Array,
    spacing: Sequence[float],
    low: float,
    high: float,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    open_cells: Mask | None = None,
) -> float:
    """Pressure at a lower height minus that at an upper height, without the hydrostatic part.

    pressure    (nz, ny, nx), p' = p - rho g.x [Pa]
    spacing     hx, hy, hz of a cell [m]
    low, high   heights z [m], within the box
    origin      lowest corner of the box [m]
    open_cells  cells to include; all if None
    returns     mean p' at `low` minus mean p' at `high` [Pa]

    Interpolates linearly between layer centres and extrapolates beyond the first and the last.

    >>> pressure = 100.0 - 10.0 * np.array([0.5, 1.5, 2.5]).reshape(3, 1, 1)
    >>> pressure_drop(pressure, (1.0, 1.0, 1.0), 0.0, 3.0)
    30.0
    """
    layers = profile(pressure, "z", open_cells)
    bottom, top = origin[2], origin[2] + len(layers) * spacing[2]
    for name, height in (("low", low), ("high", high)):
        if not bottom - 1e-9 * spacing[2] <= height <= top + 1e-9 * spacing[2]:
            raise InputError(name, height, f"a height in the box, {bottom:g} to {top:g} m")
    if len(layers) == 1:
        raise InputError("pressure", pressure.shape, "of at least two layers of cells")
    at = (np.array([low, high]) - bottom) / spacing[2] - 0.5
    below = np.clip(np.floor(at).astype(int), 0, len(layers) - 2)
    values = layers[below] + (at - below) * (layers[below + 1] - layers[below])
    return float(values[0] - values[1])


def voidage_from_pressure(
    pressure: Array,
    spacing: Sequence[float],
    weight: float,
    low: float,
    high: float,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    open_cells: Mask | None = None,
) -> float:
    r"""Mean voidage of a fluidised bed from its pressure gradient.

    .. math:: -\frac{dp'}{dz} = (1-\varepsilon)(\rho_p-\rho)g

    pressure    (nz, ny, nx), p' = p - rho g.x [Pa]
    spacing     hx, hy, hz of a cell [m]
    weight      (rho_p - rho) g, buoyant weight per particle volume [N/m3]
    low, high   heights z between which a line is fitted to the layer means [m]
    origin      lowest corner of the box [m]
    open_cells  cells to include; all if None
    returns     eps [-]; NaN if fewer than three layer centres lie between

    >>> pressure = 1000.0 - 100.0 * np.array([0.5, 1.5, 2.5, 3.5]).reshape(4, 1, 1)
    >>> round(voidage_from_pressure(pressure, (1.0, 1.0, 1.0), 250.0, 0.0, 4.0), 12)
    0.6
    """
    layers = profile(pressure, "z", open_cells)
    centre = origin[2] + (np.arange(len(layers)) + 0.5) * spacing[2]
    inside = (centre >= low) & (centre <= high) & np.isfinite(layers)
    if inside.sum() < 3 or weight == 0.0:
        return float("nan")
    return float(1.0 + np.polyfit(centre[inside], layers[inside], 1)[0] / weight)


def entrance_pressure_drop(flux: Array, voidage: Array, density: float, open_cells: Mask | None = None) -> float:
    r"""Pressure drop at the floor, where the fluid accelerates into the voids of the bed.

    .. math:: \left\langle\rho U^2(1/\varepsilon - 1)\right\rangle

    flux        U, superficial velocity through the floor (ny, nx) [m/s]
    voidage     eps of the lowest layer of cells (ny, nx) [-]
    density     rho of the fluid [kg/m3]
    open_cells  (ny, nx) cells to include; all if None
    returns     [Pa]

    Below the floor the fluid moves at U, inside the bed at U/eps. The pressure drop measured from below the floor is
    the drop over the bed plus this value; together they carry the weight of the bed.

    >>> round(entrance_pressure_drop(np.full((1, 1), 0.1), np.full((1, 1), 0.5), 1000.0), 9)
    10.0
    """
    loss = density * flux**2 * (1.0 / voidage - 1.0)
    return float(loss[... if open_cells is None else open_cells].mean())


def _slabs(position: Array, edges: Array, along: str) -> tuple[NDArray[np.intp], Mask]:
    place = np.asarray(position)[:, ALONG[along]]
    inside = (place >= edges[0]) & (place < edges[-1])
    return np.searchsorted(edges, place[inside], side="right") - 1, inside


class Flux(NamedTuple):
    """Flux through slabs: upward, downward (>= 0) and net, each (n,), unit of the amount times m/s per m3."""

    up: Array
    down: Array
    net: Array


def solids_flux(position: Array, velocity: Array, amount: Array, edges: Array, area: float, along: str = "z") -> Flux:
    r"""What particles carry through the cross-section, in slabs.

    .. math:: G = \frac{1}{A\,\Delta z}\sum_{i\ \mathrm{in\ slab}} m_i v_i

    position  (N, 3) [m]
    velocity  (N, 3) [m/s]
    amount    m (N,), mass [kg] for a mass flux, volume [m3] for a superficial velocity of the solids
    edges     (n + 1,) ascending, of the slabs [m]
    area      A of the cross-section [m2]
    along     direction of the flux: "x", "y" or "z"
    returns   Flux of three arrays (n,) [kg/(m2 s)] or [m/s]
    """
    slab, inside = _slabs(position, edges, along)
    carried = (np.asarray(amount) * np.asarray(velocity)[:, ALONG[along]])[inside]
    scale = 1.0 / (area * np.diff(edges))
    up = scale * np.bincount(slab, np.maximum(carried, 0.0), len(edges) - 1)
    down = scale * np.bincount(slab, np.maximum(-carried, 0.0), len(edges) - 1)
    return Flux(up, down, up - down)


class Cells(NamedTuple):
    """The cell of each particle."""

    cell: NDArray[np.intp]  # (M,) flat index, of the particles inside the box
    inside: Mask  # (N,)
    shape: tuple[int, int, int]  # (nz, ny, nx)


def cells_of(
    position: Array, shape: tuple[int, int, int], spacing: Sequence[float], origin: Sequence[float] = (0.0, 0.0, 0.0)
) -> Cells:
    """The cell that contains the centre of each particle.

    position  (N, 3) [m]
    shape     (nz, ny, nx) of the cells, which may differ from the fluid's
    spacing   hx, hy, hz [m]
    origin    lowest corner [m]
    returns   Cells
    """
    place = np.floor((np.asarray(position) - np.asarray(origin)) / np.asarray(spacing)).astype(np.intp)
    inside = ((place >= 0) & (place < np.array(shape[::-1]))).all(axis=1)
    i, j, k = place[inside].T
    return Cells((k * shape[1] + j) * shape[2] + i, inside, shape)


class GranularTemperature(NamedTuple):
    """Granular temperature [m2/s2]."""

    cells: Array  # (nz, ny, nx), of each cell
    freedoms: Array  # (nz, ny, nx), particles of each cell less one; weights of the mean
    mean: float
    components: Array  # (3,) mean square of the fluctuation along x, y, z; their mean is `mean`
    layers: Array  # (nz, 3) the same for each layer of cells; NaN where no cell has two particles


def granular_temperature(velocity: Array, cells: Cells) -> GranularTemperature:
    r"""A third of the variance of particle velocities about the mean of their cell.

    .. math:: \theta_c = \frac{1}{3(n_c-1)}\sum_{i\in c}|v_i-\bar v_c|^2,\qquad
              \theta = \frac{\sum_c\sum_i|v_i-\bar v_c|^2}{3\sum_c(n_c-1)}

    velocity  (N, 3) [m/s]
    cells     from :func:`cells_of`; variation of the mean flow within a cell counts as fluctuation
    returns   GranularTemperature; NaN for cells with fewer than two particles

    The divisor n - 1 makes the value independent of the number of particles per cell.
    """
    count = np.bincount(cells.cell, minlength=int(np.prod(cells.shape)))
    squares = np.zeros((3, len(count)))
    for square, component in zip(squares, np.asarray(velocity)[cells.inside].T):
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.bincount(cells.cell, component, len(count)) / count
        square[:] = np.bincount(cells.cell, (component - mean[cells.cell]) ** 2, len(count))
    free = np.maximum(count - 1, 0)
    apart, total = squares[0] + squares[1] + squares[2], free.sum()
    by_layer = free.reshape(cells.shape[0], -1).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        by_cell = apart / (3.0 * free)
        layers = squares.reshape(3, cells.shape[0], -1).sum(axis=2).T / by_layer[:, None]
        components = squares.sum(axis=1) / total
    whole = float(apart.sum() / (3.0 * total)) if free.any() else float("nan")
    return GranularTemperature(by_cell.reshape(cells.shape), free.reshape(cells.shape), whole, components, layers)


# ---------------------------------------------------------------- mixing of species


def lacey_index(marked: Mask, cells: Cells) -> float:
    r"""Mixing index of Lacey: how evenly marked particles are distributed over cells.

    .. math:: M = \frac{\sigma_0^2-\sigma^2}{\sigma_0^2-\sigma_r^2},\qquad \sigma_0^2 = p(1-p),\qquad
              \sigma_r^2 = p(1-p)\frac{C-1}{N-1}

    marked   (N,) true for particles of one species
    cells    from :func:`cfddem.analysis.measures.cells_of`; a cell should hold about ten particles or more
    returns  M [-]: 0 segregated, 1 randomly mixed on average; NaN with one species only, or one particle per cell

    sigma^2 is the variance of the marked fraction over the C occupied cells, weighted by their particle numbers;
    sigma_r^2 is its value in a random mixture. Lacey, J. Appl. Chem. 4 (1954) 257.
    """
    kinds = np.asarray(marked, float)[cells.inside]
    count = np.bincount(cells.cell)
    occupied, total, share = count > 0, len(kinds), float(kinds.mean()) if len(kinds) else 0.0
    segregated = share * (1.0 - share)
    if segregated == 0.0 or occupied.sum() == total:
        return float("nan")
    local = np.bincount(cells.cell, kinds)[occupied] / count[occupied]
    variance = float((count[occupied] * (local - share) ** 2).sum() / total)
    random = segregated * (int(occupied.sum()) - 1) / (total - 1)
    return (segregated - variance) / (segregated - random)


def neighbour_mixing_index(species: NDArray[np.integer], position: Array, neighbours: int = 12) -> float:
    r"""Mixing index of nearest neighbours: fraction of neighbours of another species, over that of a random mixture.

    .. math:: M = \frac{\langle\mathrm{fraction\ of\ unlike\ neighbours}\rangle}
              {1-\sum_s N_s(N_s-1)/[N(N-1)]}

    species     (N,) number of the species of each particle
    position    (N, 3) [m]
    neighbours  number of nearest neighbours of each particle
    returns     M [-]: 0 segregated, 1 randomly mixed, above 1 in an ordered mixture; NaN with one species only

    Needs no cells. Neighbours across periodic sides are not found.
    """
    kinds, total = np.asarray(species), len(species)
    counts = np.unique(kinds, return_counts=True)[1].astype(float)
    if len(counts) < 2 or total <= neighbours:
        return float("nan")
    _, near = cKDTree(position).query(position, neighbours + 1)
    unlike = kinds[near] != kinds[:, None]  # each particle is among its own neighbours, and never unlike
    random = 1.0 - float((counts * (counts - 1.0)).sum()) / (total * (total - 1.0))
    return float(unlike.sum() / (total * neighbours) / random)
