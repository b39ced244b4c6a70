"""Declared fields of the fluid: arrays of cells and faces, each with unit, place, role and initial value.

Every array is padded with ghost cells, see `cfddem.fluid.grid` and `cfddem.fluid.halo`. Allocation, checkpoints and
restarts are written here once, for all fields. A checkpoint holds no ghosts: they follow from the cells and the
boundary conditions. Here, too: checks of what is handed to a fluid, and where its fields have fluid.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError, RunFailed
from cfddem.backend.portions import Portions
from cfddem.fluid.block import in_portions
from cfddem.fluid.grid import HIGH, LOW, Array, Grid
from cfddem.model.fields import Role


@dataclass(frozen=True)
class CellField:
    """One field of a fluid.

    name     attribute of the fields, name in checkpoints
    unit     SI
    meaning  long name
    place    "cells" for a number in every cell, "vectors" for three of them, "faces" for a vector whose component d
             sits on the faces normal to d
    role     "state" is part of a checkpoint, "scratch" is valid within a step
    initial  value before the first step
    """

    name: str
    unit: str
    meaning: str
    place: Literal["cells", "vectors", "faces"] = "cells"
    role: Role = "scratch"
    initial: float = 0.0


FLUID_FIELDS = (
    CellField("velocity", "m/s", "velocity of the fluid between the particles", "faces", "state"),
    CellField("pressure", "Pa", "pressure less that of the fluid at rest", "cells", "state"),
    CellField("voidage", "1", "volume fraction of the fluid at the end of the last step", "cells", "state", 1.0),
    CellField("mean_voidage", "1", "voidage in the middle of the last step, that of `velocity`", "cells", "state", 1.0),
    CellField("voidage_rate", "1/s", "rate of change of the voidage in the last step", "cells", "state"),
    CellField("viscosity", "Pa s", "dynamic viscosity without the sub-grid viscosity", "cells", "state"),
    CellField("drag", "kg/m3/s", "coefficient of the drag along each axis", "vectors", "state"),
    CellField("drag_momentum", "N/m3", "coefficient of the drag times velocity of the particles", "vectors", "state"),
    CellField("source", "N/m3", "other forces on the fluid", "vectors", "state"),
    CellField("new_voidage_rate", "1/s", "rate of change of the voidage in the step being made"),
    CellField("other_voidage", "1", "mean voidage at the other end: new within a step, old after it", initial=1.0),
    CellField("centred_voidage", "1", "mean of old and new mean voidage", initial=1.0),
    CellField("stored_voidage", "1", "voidage stored with the old velocity", initial=1.0),
    CellField("stage_velocity", "m/s", "end velocity of the stage before", "faces"),
    CellField("other_velocity", "m/s", "velocity at the other end: new within a step, old after it", "faces"),
    CellField("start_force", "N/m3", "convection and viscous stress at the start of the step", "faces"),
    CellField("stage_force", "N/m3", "convection and viscous stress at the end of the stage before", "faces"),
    CellField("flux", "m/s", "volume flux, voidage times velocity", "faces"),
    CellField("mobility", "m2 s/kg", "velocity lost per pressure gradient", "faces"),
    CellField("correction", "Pa", "correction of the pressure"),
    CellField("expansion", "Pa", "isotropic part of the viscous stress"),
    CellField("effective_viscosity", "Pa s", "voidage times viscosity, the sub-grid viscosity included"),
)
"""Fields of every fluid."""


class CellFields:
    """Padded arrays of declared fields; each is an attribute.

    grid    gives their shapes
    fields  to allocate

    >>> fields = CellFields(Grid((2, 3, 4), (1.0, 1.0, 1.0)), FLUID_FIELDS)
    >>> fields.pressure.shape, fields.velocity.shape
    ((9, 8, 7), (3, 9, 8, 7))
    """

    def __init__(self, grid: Grid, fields: Iterable[CellField]) -> None:
        self.grid = grid
        self.fields = {field.name: field for field in fields}
        self.arrays: dict[str, Array] = {}
        for name, field in self.fields.items():
            components = () if field.place == "cells" else (3,)
            self.arrays[name] = np.full((*components, *grid.padded_shape), field.initial)

    def __getattr__(self, name: str) -> Array:
        try:
            return self.__dict__["arrays"][name]  # type: ignore[no-any-return]
        except KeyError:
            raise AttributeError(f"the fluid has no field {name!r}") from None

    def owned(self, name: str) -> Array:
        """View of a field without ghosts: (nz, ny, nx), or (3, nz + 1, ny + 1, nx + 1) on faces."""
        array, faces = self.arrays[name], self.fields[name].place == "faces"
        nz, ny, nx = (LOW + n + faces for n in self.grid.shape)
        return array[..., LOW:nz, LOW:ny, LOW:nx]

    def swap(self, first: str, second: str) -> None:
        """Exchange the arrays of two fields."""
        self.arrays[first], self.arrays[second] = self.arrays[second], self.arrays[first]

    def checkpoint(self) -> dict[str, Array | Portions]:
        """Copies of all fields that the next step depends on, over the whole grid, without ghosts."""
        lasting = {name: self.owned(name) for name, field in self.fields.items() if field.role != "scratch"}
        return {
            name: in_portions(self.grid, array, array.ndim - 3, self.fields[name].place == "faces")
            for name, array in lasting.items()
        }

    def restore(self, stored: Mapping[str, Array]) -> None:
        """Take over the values of a `checkpoint()` on the same grid; ghosts remain to be filled."""
        for name, field in self.fields.items():
            if field.role == "scratch":
                continue
            faces = field.place == "faces"
            shape = (*self.owned(name).shape[:-3], *(n + faces for n in self.grid.whole.shape))
            if np.shape(stored[name]) != shape:
                raise InputError(f"checkpoint.{name}", np.shape(stored[name]), f"of shape {shape}, as on this grid")
            self.owned(name)[:] = self.grid.part(stored[name], faces)


# ---------------------------------------------------------------- checks


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


# ---------------------------------------------------------------- where fields have fluid


WORTH = 40
"""So many places without fluid take as long as another stretch."""


class Stretches(NamedTuple):
    """Parts of the planes of padded fields that are laid out flat. A plane of a box has one: a long loop is faster than
    short ones over its rows, and what it writes between them is not used."""

    first: Any  # (planes + 1,) number of the first stretch of each plane
    at: Any  # (m,) where each begins
    count: Any  # (m,) places in it

    @classmethod
    def over(cls, wanted: Any) -> Stretches:
        """The stretches that have all wanted places of a padded field (nz, ny, nx)."""
        at, size = np.flatnonzero(wanted), wanted[0].size
        apart, planes = np.diff(at, prepend=0), np.diff(at // size, prepend=-1)
        begins = np.flatnonzero((apart > WORTH) | (planes > 0))
        ends = np.append(begins, at.size)[1:] - 1
        first = np.searchsorted(at[begins], np.arange(len(wanted) + 1) * size)
        return cls(first, at[begins], at[ends] + 1 - at[begins])


class FluidStretches(NamedTuple):
    """The stretches of the faces of a fluid."""

    solved: Stretches  # with an unknown velocity
    whole: Stretches  # of these, those whose convection and stress are not of walls
    around: Stretches  # solved ones and all beside them

    @classmethod
    def of(cls, solved: Array, near_walls: Any) -> FluidStretches:
        """Those of a fluid.

        solved      1 where a face has an unknown velocity, padded (3, nz, ny, nx)
        near_walls  true where walls give convection and stress, padded (3, nz, ny, nx)
        """
        own, n = np.zeros(solved.shape, bool), HIGH - 1
        own[:, LOW:-n, LOW:-n, LOW:-n] = solved[:, LOW:-n, LOW:-n, LOW:-n] > 0.0  # others are ghosts
        faces, whole = own.any(axis=0), (own & ~near_walls).any(axis=0)  # local: three components
        beside = binary_dilation(faces, np.ones((3, 3, 3), bool))
        return cls(*(Stretches.over(wanted) for wanted in (faces, whole, beside)))
