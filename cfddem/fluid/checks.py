"""What a fluid cannot start from or go on with, each refused in one line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from cfddem.errors import InputError, RunFailed
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import HIGH, LOW, Array, Grid


def checked_voidage(grid: Grid, voidage: Array | float) -> Array:
    """The voidage (nz, ny, nx), 1 in solid cells, if it lies in (0, 1] everywhere."""
    try:
        given = np.where(grid.open, np.asarray(voidage, dtype=float), 1.0)
    except ValueError as refusal:
        raise InputError("voidage", np.shape(voidage), f"of shape (nz, ny, nx) = {grid.shape}") from refusal
    if given.shape != grid.shape:
        raise InputError("voidage", np.shape(voidage), f"of shape (nz, ny, nx) = {grid.shape}")
    bad = ~((given > 0.0) & (given <= 1.0 + 1e-12))
    if bad.any():
        k, j, i = (int(n) for n in np.argwhere(bad)[0])
        raise InputError(
            "voidage", float(given[k, j, i]), "above 0 and at most 1", f"it is not in cell [k, j, i] = {[k, j, i]}"
        )
    return given


def checked_viscosity(grid: Grid, viscosity: Array | float) -> Array:
    """The viscosity (nz, ny, nx), if it is positive everywhere or zero everywhere; in solid cells that of the nearest
    open one."""
    try:
        everywhere = np.broadcast_to(np.asarray(viscosity, dtype=float), grid.shape)
    except (TypeError, ValueError) as refusal:
        limit = f"a number, or one of every cell, (nz, ny, nx) = {grid.shape}, in Pa s"
        raise InputError("fluid.viscosity", np.shape(viscosity) or str(viscosity), limit) from refusal
    asked = everywhere[grid.open]
    if not (np.isfinite(asked).all() and asked.min() >= 0.0):
        bad = float(asked[~(asked >= 0.0) | np.isinf(asked)].flat[0])
        raise InputError("fluid.viscosity", bad, "zero or positive, in Pa s")
    if asked.min() == 0.0 < asked.max():
        raise InputError("fluid.viscosity", 0.0, "positive everywhere, or zero everywhere")
    if grid.solid is None:
        return everywhere
    nearest = distance_transform_edt(~grid.open, sampling=grid.spacing[::-1], return_indices=True)[1]
    filled: Array = everywhere[tuple(nearest)]
    return filled


def checked_field(name: str, field: Array, shape: tuple[int, ...], negative: bool = True) -> Array:
    """A field handed to a step, if it has its shape and numbers everywhere."""
    given = np.asarray(field, dtype=float)
    if given.shape != shape:
        raise InputError(name, given.shape, f"of shape {shape}")
    if not np.isfinite(given).all():
        raise InputError(name, None, "a number everywhere", f"it is not at {np.argwhere(~np.isfinite(given))[0]}")
    if not negative and given.min() < 0.0:
        raise InputError(name, float(given.min()), "zero or positive everywhere")
    return given


def closed_regions(grid: Grid, boundaries: Boundaries) -> NDArray[np.int64] | None:
    """Connected regions of open cells that no outlet touches, numbered from 1 (0 elsewhere); None if there are none."""
    from scipy.ndimage import label

    region, count = label(grid.open)
    links = list(range(count + 1))

    def root(n: int) -> int:
        while links[n] != n:
            n = links[n]
        return n

    for axis in range(3):
        if boundaries.periodic[axis]:
            first, last = np.take(region, 0, 2 - axis).ravel(), np.take(region, -1, 2 - axis).ravel()
            for a, b in {(int(a), int(b)) for a, b in zip(first, last) if a and b}:
                links[root(a)] = root(b)
    region = np.array([root(n) for n in range(count + 1)])[region]
    for side in boundaries.sides:
        touched = side.layer(region, -1 if side.high else 0)[side.outlet[LOW:-HIGH, LOW:-HIGH]]
        region[np.isin(region, touched[touched > 0])] = 0
    return region.astype(np.int64) if region.any() else None


def refuse_trapped_inflow(grid: Grid, boundaries: Boundaries) -> None:
    """Steady inflow needs somewhere to go."""
    if boundaries.has_outlet:
        return
    net, gross = 0.0, 0.0
    for side in boundaries.sides:
        for number in side.inlets:
            here = side.owner == number
            speed = boundaries.superficial(side, number, here, 0.0, steady=True)[:, side.axis]
            net += float((speed * side.inward).sum() * grid.face_area(side.axis))
            gross += float(np.abs(speed).sum() * grid.face_area(side.axis))
    if abs(net) > 1e-9 * gross:
        raise InputError(
            "boundaries", None, "such that what flows in can leave",
            f"{net:.3g} m3/s enter and no side is an outlet; add Outlet() to one",
        )  # fmt: skip


def refuse_imbalance(region: NDArray[np.int64] | None, wanted: Array, scale: float, time: float) -> None:
    """Where no outlet is, inflow and change of voidage must cancel; wanted [m3/s] is what each cell lacks."""
    if region is None:
        return
    excess = np.bincount(region.ravel(), wanted.ravel())[1:]
    size = np.bincount(region.ravel(), np.abs(wanted).ravel())[1:]
    bad = np.abs(excess) > 1e-9 * size + 1e-9 * scale
    if bad.any():
        amount = float(excess[np.argmax(bad)])
        raise InputError(
            "boundaries", None, "such that inflow and change of voidage cancel where there is no outlet",
            f"{abs(amount):.3g} m3/s too {'little' if amount > 0 else 'much'} fluid at t = {time:g} s; add Outlet()",
        )  # fmt: skip


def refuse_nonsense(grid: Grid, wanted: Array, time: float) -> None:
    """A velocity that is no number stops the run and names its place."""
    if np.isfinite(wanted.sum()):
        return
    bad = np.argwhere(~np.isfinite(wanted))
    k, j, i = bad[0] if bad.size else (0, 0, 0)
    x, y, z = (float(c.ravel()[n]) for c, n in zip(grid.centres(), (i, j, k)))
    raise RunFailed(
        f"fluid: the velocity is no number at x, y, z = {x:g}, {y:g}, {z:g} m, t = {time:g} s; "
        "take steps below `largest_step()`, and look at voidage, drag and source there"
    )
