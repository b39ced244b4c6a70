"""Checks of what a fluid starts from and of the fields handed to its steps."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError, RunFailed
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import Array, Grid


def checked_voidage(grid: Grid, voidage: Array | float, communicator: Communicator) -> Array:
    """The voidage (nz, ny, nx), 1 in solid cells; `InputError` unless it lies in (0, 1] everywhere."""
    try:
        values = np.where(grid.open, np.asarray(voidage, dtype=float), 1.0)
    except ValueError as refusal:
        raise InputError("voidage", np.shape(voidage), f"of shape (nz, ny, nx) = {grid.shape}") from refusal
    if values.shape != grid.shape:
        raise InputError("voidage", np.shape(voidage), f"of shape (nz, ny, nx) = {grid.shape}")
    wrong = _first_place(~((values > 0.0) & (values <= 1.0 + 1e-12)), values, communicator)
    if wrong is not None:
        cell, value = wrong
        raise InputError("voidage", value, "above 0 and at most 1", f"it is not in cell [k, j, i] = {cell}")
    return values


def checked_viscosity(grid: Grid, viscosity: Array | float, communicator: Communicator) -> Array:
    """The viscosity (nz, ny, nx), in a solid cell that of the nearest open one; `InputError` unless it is positive
    everywhere or zero everywhere."""
    try:
        everywhere = np.broadcast_to(np.asarray(viscosity, dtype=float), grid.shape)
    except (TypeError, ValueError) as refusal:
        limit = f"a number, or one of every cell, (nz, ny, nx) = {grid.shape}, in Pa s"
        raise InputError("fluid.viscosity", np.shape(viscosity) or str(viscosity), limit) from refusal
    wrong = _first_place(grid.open & (~(everywhere >= 0.0) | np.isinf(everywhere)), everywhere, communicator)
    if wrong is not None:
        raise InputError("fluid.viscosity", wrong[1], "zero or positive, in Pa s")
    inside = everywhere[grid.open]
    if communicator.smallest(inside) == 0.0 < communicator.largest(inside):
        raise InputError("fluid.viscosity", 0.0, "positive everywhere, or zero everywhere")
    if grid.solid is None or grid.solid.all():  # local: a block of solid cells has no open one to take it from
        return everywhere
    nearest = distance_transform_edt(~grid.open, sampling=grid.spacing[::-1], return_indices=True)[1]
    filled: Array = everywhere[tuple(nearest)]
    return filled


def checked_field(
    name: str, field: Array, shape: tuple[int, ...], communicator: Communicator, *, negative: bool = True
) -> Array:
    """A field handed to a step; `InputError` unless it has its shape and finite values.

    negative  whether values below zero are allowed
    """
    values = np.asarray(field, dtype=float)
    if values.shape != shape:
        raise InputError(name, values.shape, f"of shape {shape}")
    wrong = _first_place(~np.isfinite(values), values, communicator)
    if wrong is not None:
        raise InputError(name, None, "finite everywhere", f"it is not at {wrong[0]}")
    least = np.inf if negative else communicator.smallest(values)
    if least < 0.0:
        raise InputError(name, least, "zero or positive everywhere")
    return values


def _first_place(wrong: np.ndarray, values: Array, communicator: Communicator) -> tuple[list[int], float] | None:
    """Index and value of the first wrong element of an array; None if no element is wrong on any rank."""
    place = None
    if wrong.any():  # local: this rank names the place, the communicator decides
        index = np.unravel_index(np.argmax(wrong), wrong.shape)  # local: first on this rank
        place = [int(n) for n in index], float(values[index])
    return communicator.first(place)


def refuse_trapped_inflow(grid: Grid, boundaries: Boundaries) -> None:
    """Raise `InputError` if the steady inflow has no outlet to leave through."""
    if boundaries.has_outlet:
        return
    grid, boundaries = grid.whole, boundaries.box
    net, gross = 0.0, 0.0
    for side in boundaries.sides:
        for number in side.inlets:
            here = side.owner == number
            speed = boundaries.superficial(side, number, here, 0.0, steady=True)[:, side.axis]
            net += float((speed * side.inward).sum()) * grid.face_area(side.axis)  # local: inlets of the whole box
            gross += float(np.abs(speed).sum()) * grid.face_area(side.axis)  # local: inlets of the whole box
    if abs(net) > 1e-9 * gross:
        raise InputError(
            "boundaries", None, "such that what flows in can leave",
            f"{net:.3g} m3/s enter and no side is an outlet; add Outlet() to one",
        )  # fmt: skip


def refuse_nan(grid: Grid, missing: Array, time: float, communicator: Communicator) -> None:
    """Raise `RunFailed` where the velocity is not finite.

    missing  fluid that each cell lacks (nz, ny, nx) [m3/s]; finite where the velocities of its faces are
    """
    if np.isfinite(communicator.sum(missing)):
        return
    wrong = _first_place(~np.isfinite(missing), missing, communicator)
    k, j, i = (0, 0, 0) if wrong is None else wrong[0]
    x, y, z = (float(c.ravel()[n]) for c, n in zip(grid.centres(), (i, j, k)))
    raise RunFailed(
        f"fluid: the velocity is not finite at x, y, z = {x:g}, {y:g}, {z:g} m, t = {time:g} s; "
        "take steps below `largest_step()`, and look at voidage, drag and source there"
    )
