"""What is measured on one instant of a bed: heights, pressure drop, profiles, granular temperature, flux.

Pure functions of arrays, without state. Cell fields have the shape (nz, ny, nx), vectors at cells (nz, ny, nx, 3),
particles (N, 3) with columns x, y, z; z points up. `open_cells` is true where a cell holds fluid, `spacing` is
(hx, hy, hz) and `origin` the lowest corner of the box, as in :class:`cfddem.fluid.Grid`. Places without a value, an
empty cell or an empty slab, are NaN. How two kinds of particles mix is measured in :mod:`cfddem.record.mixing`,
bubbles in :mod:`cfddem.record.bubbles`, series in time in :mod:`cfddem.record.series`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from cfddem.errors import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
ALONG = {"x": 0, "y": 1, "z": 2}


def bed_height(position: Array, radius: Array, share: float = 0.99) -> float:
    """Height below which a share of the volume of all particles lies; spheres are cut, not counted by their centres.

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
    centre, volume = np.asarray(position)[:, 2], _volume(radius)
    order = np.argsort(centre)
    below = np.cumsum(volume[order])
    wanted = share * below[-1]
    guess, reach = centre[order[np.searchsorted(below, wanted)]], float(np.max(radius))
    near = np.abs(centre - guess) <= 3.0 * reach  # the rest lies wholly below or above whatever is tried
    surely = volume[centre < guess - 3.0 * reach].sum()

    def excess(height: float) -> float:
        return float(surely + _volume_below(height, centre[near], radius[near]).sum() - wanted)

    if excess(guess + 2.0 * reach) <= 0.0:  # whole spheres add up to the share, but for its last bits
        lower = centre <= guess
        return float((centre[lower] + radius[lower]).max())
    return float(brentq(excess, guess - 2.0 * reach, guess + 2.0 * reach, xtol=1e-12 * reach, rtol=1e-15))


def _volume(radius: ArrayLike) -> Array:
    return np.asarray(4.0 / 3.0 * np.pi * np.asarray(radius, float) ** 3)


def _volume_below(height: float, centre: Array, radius: Array) -> Array:
    depth = np.clip(height - centre + radius, 0.0, 2.0 * radius)
    return np.pi / 3.0 * depth * depth * (3.0 * radius - depth)


def profile(field: Array, along: str = "z", open_cells: Mask | None = None, weight: Array | None = None) -> Array:
    """Mean of a cell field over the cells of each layer.

    field       (nz, ny, nx) or (nz, ny, nx, 3), any unit
    along       direction that is kept: "x", "y" or "z"
    open_cells  cells that count; all if None
    weight      (nz, ny, nx), of a cell in the mean; 1 if None
    returns     (n,) or (n, 3), same unit; NaN where no cell of a layer counts

    >>> profile(np.arange(8.0).reshape(2, 2, 2)).tolist()
    [1.5, 5.5]
    """
    for name, given in (("open_cells", open_cells), ("weight", weight)):
        if given is not None and given.shape != field.shape[:3]:
            raise InputError(f"{name}.shape", given.shape, f"that of the field, {field.shape[:3]}")
    share = np.ones(field.shape[:3]) if weight is None else np.asarray(weight, float)
    if open_cells is not None:
        share = np.where(open_cells, share, 0.0)
    gone = tuple(axis for axis in range(3) if axis != 2 - ALONG[along])
    total = share.sum(axis=gone)
    by_cell = share[..., None] if field.ndim == 4 else share
    summed = np.where(by_cell > 0.0, field * by_cell, 0.0).sum(axis=gone)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(summed / (total[:, None] if field.ndim == 4 else total))


def voidage_profile(voidage: Array, open_cells: Mask | None = None) -> Array:
    """Voidage against height.

    voidage     (nz, ny, nx) [-]
    open_cells  cells that count; all if None
    returns     (nz,) [-]
    """
    return profile(voidage, "z", open_cells)


class FluidVelocity(NamedTuple):
    """Velocity of the fluid layer by layer, each (n, 3) [m/s]."""

    between: Array  # between the particles, weighted by the voidage
    superficial: Array


def fluid_velocity_profile(
    velocity: Array, voidage: Array, along: str = "z", open_cells: Mask | None = None
) -> FluidVelocity:
    """Velocity of the fluid layer by layer, between the particles and superficial.

    velocity    (nz, ny, nx, 3), of the fluid between the particles [m/s]
    voidage     (nz, ny, nx) [-]
    along       direction that is kept: "x", "y" or "z"
    open_cells  cells that count; all if None
    returns     FluidVelocity, two arrays (n, 3) [m/s]
    """
    superficial = profile(velocity * voidage[..., None], along, open_cells)
    return FluidVelocity(profile(velocity, along, open_cells, weight=voidage), superficial)


def pressure_drop(
    pressure: Array,
    spacing: Sequence[float],
    low: float,
    high: float,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    open_cells: Mask | None = None,
) -> float:
    """Pressure at one height less that at another above, without hydrostatic head.

    pressure    (nz, ny, nx), p' = p - rho g.x [Pa]
    spacing     hx, hy, hz of a cell [m]
    low, high   heights z [m], anywhere in the box
    origin      lowest corner of the box [m]
    open_cells  cells that count; all if None
    returns     mean p' at `low` minus mean p' at `high` [Pa]

    Linear between the centres of layers, and beyond the first and the last.

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


def voidage_by_pressure(
    pressure: Array,
    spacing: Sequence[float],
    weight: float,
    low: float,
    high: float,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    open_cells: Mask | None = None,
) -> float:
    r"""Mean voidage of a bed that the flow carries, from the slope of the pressure within it.

    .. math:: -\frac{dp'}{dz} = (1-\varepsilon)(\rho_p-\rho)g

    pressure    (nz, ny, nx), p' = p - rho g.x [Pa]
    spacing     hx, hy, hz of a cell [m]
    weight      (rho_p - rho) g, buoyant, of the volume of the particles [N/m3]
    low, high   heights z between which a line is fitted to the means of layers [m]
    origin      lowest corner of the box [m]
    open_cells  cells that count; all if None
    returns     eps [-]; NaN where fewer than three layers have their centres in between

    >>> pressure = 1000.0 - 100.0 * np.array([0.5, 1.5, 2.5, 3.5]).reshape(4, 1, 1)
    >>> round(voidage_by_pressure(pressure, (1.0, 1.0, 1.0), 250.0, 0.0, 4.0), 12)
    0.6
    """
    layers = profile(pressure, "z", open_cells)
    centre = origin[2] + (np.arange(len(layers)) + 0.5) * spacing[2]
    inside = (centre >= low) & (centre <= high) & np.isfinite(layers)
    if inside.sum() < 3 or weight == 0.0:
        return float("nan")
    return float(1.0 + np.polyfit(centre[inside], layers[inside], 1)[0] / weight)


def entrance_rise(flux: Array, voidage: Array, density: float, open_cells: Mask | None = None) -> float:
    r"""Pressure that the fluid loses at the floor because the particles above it leave it less room.

    .. math:: \left\langle\rho U^2(1/\varepsilon - 1)\right\rangle

    flux        U, superficial, through the floor (ny, nx) [m/s]
    voidage     eps of the lowest layer (ny, nx) [-]
    density     rho, of the fluid [kg/m3]
    open_cells  (ny, nx) cells that count; all if None
    returns     [Pa]

    Below the floor the fluid has all the room; it enters the bed at U/eps. The pressure drop from below the floor,
    where it is measured, is that over the bed and this: together they carry the weight of the bed.

    >>> round(entrance_rise(np.full((1, 1), 0.1), np.full((1, 1), 0.5), 1000.0), 9)
    10.0
    """
    loss = density * flux**2 * (1.0 / voidage - 1.0)
    return float(loss[... if open_cells is None else open_cells].mean())


def particle_profile(values: Array, position: Array, radius: Array, edges: Array, along: str = "z") -> Array:
    """Mean over the particles whose centres lie in each slab, weighted by their volume.

    values    (N,) or (N, 3), any unit: velocities make a velocity profile
    position  (N, 3) [m]
    radius    (N,) [m]
    edges     (n + 1,) rising, of the slabs [m]
    along     direction of the profile: "x", "y" or "z"
    returns   (n,) or (n, 3), same unit; NaN where a slab is empty
    """
    slab, inside = _slabs(position, edges, along)
    volume = _volume(radius)[inside]
    columns = np.asarray(values, float)[inside].reshape(len(volume), -1 if len(volume) else np.ndim(values) * 2 - 1)
    total = np.bincount(slab, volume, len(edges) - 1)
    summed = np.column_stack([np.bincount(slab, volume * column, len(edges) - 1) for column in columns.T])
    with np.errstate(invalid="ignore", divide="ignore"):
        means = summed / total[:, None]
    return np.asarray(means if np.ndim(values) == 2 else means[:, 0])


def _slabs(position: Array, edges: Array, along: str) -> tuple[NDArray[np.intp], Mask]:
    place = np.asarray(position)[:, ALONG[along]]
    inside = (place >= edges[0]) & (place < edges[-1])
    return np.searchsorted(edges, place[inside], side="right") - 1, inside


class Flux(NamedTuple):
    """Flux of solids through slabs: what rises, what sinks (>= 0), and the net, each (n,) [kg/(m2 s)]."""

    up: Array
    down: Array
    net: Array


def solids_flux(position: Array, velocity: Array, mass: Array, edges: Array, area: float, along: str = "z") -> Flux:
    r"""Mass that particles carry through the cross-section, slab by slab.

    .. math:: G = \frac{1}{A\,\Delta z}\sum_{i\ \mathrm{in\ slab}} m_i v_i

    position  (N, 3) [m]
    velocity  (N, 3) [m/s]
    mass      (N,) [kg]
    edges     (n + 1,) rising, of the slabs [m]
    area      A, of the cross-section [m2]
    along     direction of the flux: "x", "y" or "z"
    returns   Flux of three arrays (n,) [kg/(m2 s)]
    """
    slab, inside = _slabs(position, edges, along)
    carried = (np.asarray(mass) * np.asarray(velocity)[:, ALONG[along]])[inside]
    scale = 1.0 / (area * np.diff(edges))
    up = scale * np.bincount(slab, np.maximum(carried, 0.0), len(edges) - 1)
    down = scale * np.bincount(slab, np.maximum(-carried, 0.0), len(edges) - 1)
    return Flux(up, down, up - down)


class Cells(NamedTuple):
    """Which cell each particle is in."""

    cell: NDArray[np.intp]  # (M,) flat index of those inside the box
    inside: Mask  # (N,)
    shape: tuple[int, int, int]  # (nz, ny, nx)


def cells_of(
    position: Array, shape: tuple[int, int, int], spacing: Sequence[float], origin: Sequence[float] = (0.0, 0.0, 0.0)
) -> Cells:
    """The cell in which the centre of each particle lies.

    position  (N, 3) [m]
    shape     (nz, ny, nx) of the box of cells, which need not be the fluid's
    spacing   hx, hy, hz [m]
    origin    lowest corner [m]
    returns   Cells
    """
    place = np.floor((np.asarray(position) - np.asarray(origin)) / np.asarray(spacing)).astype(np.intp)
    inside = ((place >= 0) & (place < np.array(shape[::-1]))).all(axis=1)
    i, j, k = place[inside].T
    return Cells((k * shape[1] + j) * shape[2] + i, inside, shape)


class GranularTemperature(NamedTuple):
    """Fluctuation of particle velocities, [m2/s2]: in each cell (nz, ny, nx), and of all about their cells' means."""

    cells: Array
    mean: float


def granular_temperature(velocity: Array, cells: Cells) -> GranularTemperature:
    r"""Variance of the particle velocities about the mean of their cell, over three.

    .. math:: \theta_c = \frac{1}{3(n_c-1)}\sum_{i\in c}|v_i-\bar v_c|^2,\qquad
              \theta = \frac{\sum_c\sum_i|v_i-\bar v_c|^2}{3\sum_c(n_c-1)}

    velocity  (N, 3) [m/s]
    cells     from :func:`cells_of`; a mean flow that varies within a cell counts as fluctuation
    returns   GranularTemperature; NaN in cells with fewer than two particles

    With n - 1 and not n, so that a cell of few particles is not colder than one of many.
    """
    count = np.bincount(cells.cell, minlength=int(np.prod(cells.shape)))
    apart = np.zeros(len(count))
    for component in np.asarray(velocity)[cells.inside].T:
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.bincount(cells.cell, component, len(count)) / count
        apart += np.bincount(cells.cell, (component - mean[cells.cell]) ** 2, len(count))
    free = np.maximum(count - 1, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        by_cell = apart / (3.0 * free)
    whole = float(apart.sum() / (3.0 * free.sum())) if free.any() else float("nan")
    return GranularTemperature(by_cell.reshape(cells.shape), whole)
