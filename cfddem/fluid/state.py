"""The state of a fluid: its fields on the grid, and their values in cells and at points.

`FluidState` holds the fields of a solver and answers questions about them; it does not advance them. Its methods
return plain arrays in the index order of `cfddem.fluid.grid`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.checks import checked_viscosity
from cfddem.fluid.fields import FLUID_FIELDS, CellFields
from cfddem.fluid.grid import AT_CENTRES, AT_FACES, Array, Grid, sample
from cfddem.fluid.momentum import drag_seen, in_cells, transport
from cfddem.fluid.viscosity import EffectiveViscosity


class FluidProperties(NamedTuple):
    """What a fluid is, apart from its fields."""

    density: float  # rho [kg/m3]
    gravity: Sequence[float]  # g (x, y, z) [m/s2]
    model: str  # "A" or "B"
    smagorinsky: float  # constant of the sub-grid viscosity [-]


class FluidState:
    """Fields of a fluid on a grid.

    grid          Grid
    boundaries    conditions on its sides
    properties    density, gravity, model and sub-grid viscosity
    communicator  path to sums, extremes and decisions over all ranks

    Attributes: `fields`, padded arrays by name (see `cfddem.fluid.fields`); `faces`, kinds of faces; `face_areas`,
    area of a face normal to x, y, z [m2]; `open_cells` (nz, ny, nx), 1 where a cell is open, 0 where it is solid;
    `time` [s]; `last_step`, length of the step just made [s].
    """

    def __init__(
        self, grid: Grid, boundaries: Boundaries, properties: FluidProperties, communicator: Communicator
    ) -> None:
        self.grid, self.boundaries, self.communicator = grid, boundaries, communicator
        self.density, self.model = float(properties.density), properties.model
        self.gravity = np.asarray(properties.gravity, dtype=float)
        self.time, self.last_step = 0.0, 0.0
        self.fields, self.faces = CellFields(grid, FLUID_FIELDS), boundaries.faces()
        self.model_b = float(self.model == "B")
        self.inverse_spacing = 1.0 / np.array(grid.spacing)
        self.face_areas = np.array([grid.face_area(d) for d in range(3)])
        self.open_cells = grid.open.astype(float)
        self._every_face = np.ones_like(self.faces.solved)
        self._effective = EffectiveViscosity(grid, boundaries.halo, self.density, float(properties.smagorinsky))

    # ------------------------------------------------------------ fields

    @property
    def pressure(self) -> Array:
        """p' = p - rho g.x at cell centres (nz, ny, nx) [Pa], a view; zero in solid cells."""
        return self.fields.owned("pressure")

    @property
    def static_pressure(self) -> Array:
        """p = p' + rho g.x (nz, ny, nx) [Pa]."""
        x, y, z = self.grid.centres()
        head: Array = self.density * (self.gravity[0] * x + self.gravity[1] * y + self.gravity[2] * z)
        return self.pressure + head

    @property
    def velocity(self) -> Array:
        """Velocity at cell centres (nz, ny, nx, 3) [m/s], mean of the two faces of each component."""
        return np.moveaxis(self._in_cells(self.fields.velocity, self._every_face), 0, -1)

    @property
    def mean_velocity(self) -> Array:
        """Mean of the velocities before and after the last step at cell centres (nz, ny, nx, 3) [m/s]."""
        mean = 0.5 * (self.fields.other_velocity + self.fields.velocity)
        return np.moveaxis(self._in_cells(mean, self._every_face), 0, -1)

    @property
    def voidage(self) -> Array:
        """Voidage at the end of the last step (nz, ny, nx), a view."""
        return self.fields.owned("voidage")

    @property
    def mean_voidage(self) -> Array:
        """Voidage in the middle of the last step (nz, ny, nx), the one stored with the velocity, a view."""
        return self.fields.owned("mean_voidage")

    @property
    def viscosity(self) -> Array:
        """mu of every cell, without the sub-grid viscosity (nz, ny, nx) [Pa s], a view; see `set_viscosity`."""
        return self.fields.owned("viscosity")

    @property
    def viscous(self) -> bool:
        """Whether the viscosity is above zero."""
        return bool(self.communicator.largest(self.viscosity) > 0.0)

    def whole(self, name: str) -> Array:
        """A cell field of this class in the cells of all ranks: (nz, ny, nx), or (nz, ny, nx, 3).

        name  "pressure", "velocity", "voidage", "mean_voidage", "viscosity", "static_pressure"
        """
        values = getattr(self, name)
        if values.ndim == 3:
            return self.grid.joined(values)
        joined: Array = np.moveaxis(self.grid.joined(np.moveaxis(values, -1, 0)), 0, -1)
        return joined

    def set_viscosity(self, viscosity: Array | float) -> None:
        """Viscosity from now on: of every cell (nz, ny, nx), or a number [Pa s]; all positive, or all zero."""
        self.viscosity[:] = checked_viscosity(self.grid, viscosity, self.communicator)
        self.boundaries.halo.fill(self.fields.viscosity)

    def face_velocity(self, axis: int) -> Array:
        """Component `axis` on its faces [m/s], both boundaries included, a view: (nz, ny, nx+1) for x."""
        return self.grid.inner_faces(self.fields.velocity[axis], axis)

    def volume_flux(self, axis: int) -> Array:
        """eps u through the faces normal to `axis`, per area [m/s]; shape as `face_velocity`."""
        voidage = on_faces(self.fields.mean_voidage, axis)
        return self.face_velocity(axis) * self.grid.inner_faces(voidage, axis)

    def continuity_residual(self) -> Array:
        """V d(eps)/dt + outflow of every open cell (nz, ny, nx) [m3/s], summed face by face, not by the solver."""
        total: Array = self.fields.owned("voidage_rate") * self.grid.cell_volume
        for d in range(3):
            total = total + np.diff(self.volume_flux(d), axis=2 - d) * self.face_areas[d]
        residual: Array = total * self.open_cells
        return residual

    # ------------------------------------------------------------ checkpoint

    def checkpoint(self) -> dict[str, Any]:
        """Time, and copies of all fields that the next step depends on, over the whole grid without ghosts."""
        return {"time": np.array(self.time)} | self.fields.checkpoint()

    def restore(self, stored: Mapping[str, Any]) -> None:
        """Go on from a `checkpoint()` of a fluid with the same grid and boundaries, on any number of ranks; gives the
        same bits on the same number of ranks."""
        self.fields.restore(stored)
        self.time = float(stored["time"])
        fields, halo = self.fields, self.boundaries.halo
        for cells in (fields.mean_voidage, fields.viscosity):
            halo.fill(cells)
        self.boundaries.fill_pressure(fields.pressure)
        self.boundaries.set_inlets(self.time, fields.mean_voidage)
        self.boundaries.fill_velocity(fields.velocity)

    # ------------------------------------------------------------ values in cells

    def cell_pressure_gradient(self) -> Array:
        """grad p' of every cell, mean of its two faces as the momentum balance sees them (3, nz, ny, nx) [Pa/m].

        Add rho g for the gradient of the static pressure.
        """
        return self._in_cells(self._pressure_gradient(), self.faces.solved)

    def cell_viscous_force(self) -> Array:
        """div tau of every cell, the stress of the fluid between the particles (not times eps), mean of its two faces
        (3, nz, ny, nx) [N/m3]."""
        return self._in_cells(self._stress_between_particles(), self.faces.solved)

    def drag_response(self) -> tuple[Array, Array]:
        """How the implicit drag of the last step saw the fluid, cell by cell.

        returns  W (nz, ny, nx, 3) weight, 1 where the voidage is uniform [-]; u_d (nz, ny, nx, 3) the velocity
                 the implicit drag has seen [m/s]
        """
        fields = self.fields
        weight, seen = np.empty((2, *fields.velocity.shape))
        drag_seen(
            fields.other_velocity, fields.velocity, fields.centred_voidage, fields.drag, self.faces.solved,
            self.density, self.last_step, self.model_b, weight, seen,
        )  # fmt: skip
        return np.moveaxis(self.grid.inner(weight), 0, -1), np.moveaxis(self.grid.inner(seen), 0, -1)

    def _in_cells(self, faces: Array, counted: Array) -> Array:
        """Mean over the two faces of every cell (3, nz, ny, nx).

        counted  1 for faces that count, 0 for those that take the value of the other one
        """
        cells = np.empty_like(faces)
        in_cells(faces, counted, cells)
        return self.grid.inner(cells)

    def _pressure_gradient(self) -> Array:
        """grad p' on the faces (3, ...) [Pa/m], with the mean gradient of periodic directions."""
        pressure, gradient = self.fields.pressure, np.empty_like(self.fields.velocity)
        self.boundaries.fill_pressure(pressure)
        values = pressure.reshape(-1)
        for d, rise in enumerate(gradient.reshape(3, -1)):
            before = pressure.strides[2 - d] // pressure.itemsize  # distance of the cell before in the flat array
            np.subtract(values[before:], values[:-before], out=rise[before:])
            rise[:before] = 0.0  # outermost ghosts
            rise *= self.inverse_spacing[d]
            rise -= self.boundaries.driving[d]
        return gradient

    def viscous_force(self, velocity: Array, voidage: Array) -> Array:
        """div(eps tau) on the faces (3, ...) of a padded velocity with a padded voidage [N/m3]."""
        fields, force = self.fields, np.zeros_like(velocity)
        self._effective.update(velocity, voidage, fields.viscosity, fields.effective_viscosity)
        no_density, limited = 0.0, 0.0  # without density no convection is left
        transport(
            velocity, voidage, fields.effective_viscosity, self.faces.buried, no_density, self.inverse_spacing, limited,
            fields.flux, fields.expansion, force,
        )  # fmt: skip
        return force

    def _stress_between_particles(self) -> Array:
        """div tau on the faces (3, ...) [N/m3]."""
        velocity = self.fields.velocity
        return self.viscous_force(velocity, np.ones_like(velocity[0]))

    # ------------------------------------------------------------ values at points

    def velocity_at(self, points: Array) -> Array:
        """Velocity at points (N, 3) [m], tri-linear between faces: (N, 3) [m/s]."""
        return self._at(self.fields.velocity, AT_FACES, points)

    def viscosity_at(self, points: Array) -> Array:
        """mu at points (N, 3) [m], tri-linear between centres: (N,) [Pa s]."""
        viscosity = self.fields.viscosity
        least, most = self.communicator.smallest(viscosity), self.communicator.largest(viscosity)
        if least == most:
            return np.full(len(points), most)  # free of the rounding of an interpolation
        return self._at(viscosity[None], AT_CENTRES, points)[:, 0]

    def _at(self, fields: Array, place: Array, points: Array) -> Array:
        points = np.ascontiguousarray(points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError("points", points.shape, "of shape (N, 3)")
        values = np.empty((len(points), len(fields)))
        sample(fields, place, points, np.array(self.grid.origin), self.inverse_spacing, values)
        return values


def on_faces(cells: Array, axis: int) -> Array:
    """Mean of the two cells on both sides of every face normal to `axis`, of a padded cell field."""
    return np.asarray(0.5 * (cells + np.roll(cells, 1, axis=2 - axis)))
