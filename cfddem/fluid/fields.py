"""Declared fields of the fluid: arrays of cells and faces, each with unit, place, role and initial value.

Every array is padded with ghost cells, see `cfddem.fluid.grid` and `cfddem.fluid.halo`. Allocation, checkpoints and
restarts are written here once, for all fields. A checkpoint holds no ghosts: they follow from the cells and the
boundary conditions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.backend.portions import Portions
from cfddem.fluid.block import in_portions
from cfddem.fluid.grid import LOW, Array, Grid
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
    CellField("drag", "kg/m3/s", "coefficient of the drag"),
    CellField("drag_momentum", "N/m3", "coefficient of the drag times velocity of the particles", "vectors"),
    CellField("source", "N/m3", "other forces on the fluid", "vectors"),
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
