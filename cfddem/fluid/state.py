"""The fluid as it is: fields on the grid, and what they are at any point.

`FluidState` holds the arrays of a solver with their ghost cells and answers questions about them; it does not
advance them. Everything it returns is a plain array, in the index order of `cfddem.fluid.grid`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cfddem.errors import InputError
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.checks import checked_viscosity
from cfddem.fluid.grid import AT_CENTRES, AT_FACES, Array, Grid, sample
from cfddem.fluid.momentum import drag_seen, transport
from cfddem.fluid.viscosity import eddy_viscosity, rim

_REMEMBERED = {
    "time": "time",
    "velocity": "_velocity",
    "viscosity": "_viscosity",
    "pressure": "_pressure",
    "voidage": "voidage",
    "mean_voidage": "_mean_voidage",
    "voidage_rate": "_voidage_rate",
}
"""What a checkpoint holds, and where the fluid keeps it."""


class FluidState:
    """Fields of a fluid on a grid, and their values at points."""

    def __init__(
        self,
        grid: Grid,
        boundaries: Boundaries,
        density: float,
        viscosity: Array | float,
        gravity: Sequence[float],
        smagorinsky: float,
        model_b: float,
    ) -> None:
        self.grid, self.boundaries = grid, boundaries
        self.density, self.smagorinsky = float(density), float(smagorinsky)
        self.gravity = np.asarray(gravity, dtype=float)
        self.time, self._last_step, self._model_b = 0.0, 0.0, model_b
        self.voidage = np.ones(grid.shape)
        self._inverse = 1.0 / np.array(grid.spacing)
        self._areas = np.array([grid.face_area(d) for d in range(3)])
        self._open = grid.open.astype(float)
        self._solved, self._buried = boundaries.mark_unknowns()
        self._blocked, self._rim = boundaries.blocked_faces(), rim(grid, boundaries)

        cells, vector = grid.padded_shape, (3, *grid.padded_shape)
        self._voidage_rate = np.zeros(grid.shape)  # of the interval the velocity belongs to
        self._mean_voidage, self._other_mean, self._centred, self._stored = (np.ones(cells) for _ in range(4))
        self._velocity, self._stage, self._other = (np.zeros(vector) for _ in range(3))
        self._rate_a, self._rate_b, self._flux, self._mobility = (np.zeros(vector) for _ in range(4))
        self._drag_momentum, self._source = np.zeros(vector), np.zeros(vector)
        self._pressure, self._correction, self._expansion = (np.zeros(cells) for _ in range(3))
        self._drag, self._thickness, self._viscosity = (np.zeros(cells) for _ in range(3))
        self.set_viscosity(viscosity)

    # ------------------------------------------------------------ fields

    @property
    def pressure(self) -> Array:
        """p' = p - rho g.x at cell centres (nz, ny, nx) [Pa], a view; zero in solid cells."""
        return self.grid.inner(self._pressure)

    @property
    def static_pressure(self) -> Array:
        """p = p' + rho g.x (nz, ny, nx) [Pa]."""
        x, y, z = self.grid.centres()
        head: Array = self.density * (self.gravity[0] * x + self.gravity[1] * y + self.gravity[2] * z)
        return self.pressure + head

    @property
    def velocity(self) -> Array:
        """Velocity at cell centres (nz, ny, nx, 3) [m/s], mean of the two faces of each component."""
        means = []
        for d in range(3):
            faces = np.moveaxis(self.face_velocity(d), 2 - d, 0)
            means.append(np.moveaxis(0.5 * (faces[1:] + faces[:-1]), 0, 2 - d))
        return np.stack(means, axis=-1)

    @property
    def mean_voidage(self) -> Array:
        """Voidage in the middle of the last step of the voidage, the one stored with the velocity, a view."""
        return self.grid.inner(self._mean_voidage)

    @property
    def viscosity(self) -> Array:
        """mu of every cell, without the sub-grid viscosity (nz, ny, nx) [Pa s], a view; see `set_viscosity`."""
        return self.grid.inner(self._viscosity)

    @property
    def viscous(self) -> bool:
        """Is this a viscous fluid?"""
        return bool(self._viscosity.max() > 0.0)

    def set_viscosity(self, viscosity: Array | float) -> None:
        """Viscosity from now on: of every cell (nz, ny, nx), or a number [Pa s]; all positive, or all zero."""
        self.viscosity[:] = checked_viscosity(self.grid, viscosity)
        self.boundaries.fill_cells(self._viscosity)

    def face_velocity(self, axis: int) -> Array:
        """Component `axis` on its faces [m/s], both boundaries included, a view: (nz, ny, nx+1) for x."""
        return self.grid.inner_faces(self._velocity[axis], axis)

    def volume_flux(self, axis: int) -> Array:
        """eps u through the faces normal to `axis`, per area [m/s]; shape as `face_velocity`."""
        shifted = np.roll(self._mean_voidage, 1, axis=2 - axis)
        return self.face_velocity(axis) * self.grid.inner_faces(0.5 * (self._mean_voidage + shifted), axis)

    def continuity_residual(self) -> Array:
        """V d(eps)/dt + outflow of every open cell (nz, ny, nx) [m3/s], summed face by face, not by the solver."""
        total: Array = self._voidage_rate * self.grid.cell_volume
        for d in range(3):
            total = total + np.diff(self.volume_flux(d), axis=2 - d) * self._areas[d]
        residual: Array = total * self._open
        return residual

    # ------------------------------------------------------------ checkpoint

    def checkpoint(self) -> dict[str, Array]:
        """Copies of everything the next step depends on, ghosts included: arrays to store as they are."""
        return {name: np.array(getattr(self, attribute)) for name, attribute in _REMEMBERED.items()}

    def restore(self, stored: Mapping[str, Array]) -> None:
        """Go on from a `checkpoint()` of a fluid with the same grid and boundaries, to the same bits."""
        for name, attribute in _REMEMBERED.items():
            own = np.asarray(getattr(self, attribute))
            if np.shape(stored[name]) != own.shape:
                raise InputError(f"checkpoint.{name}", np.shape(stored[name]), f"of shape {own.shape}, as on this grid")
            if own.ndim:
                own[:] = stored[name]
        self.time = float(stored["time"])

    # ------------------------------------------------------------ at points

    def velocity_at(self, points: Array) -> Array:
        """Velocity at points (N, 3) [m], tri-linear between faces: (N, 3) [m/s]."""
        return self._at(self._velocity, AT_FACES, points)

    def pressure_gradient_at(self, points: Array) -> Array:
        """grad p' at points (N, 3) [m]: (N, 3) [Pa/m]. Add rho g for the gradient of the static pressure."""
        self.boundaries.fill_pressure(self._pressure)
        gradient = np.empty_like(self._velocity)
        for d in range(3):
            gradient[d] = (self._pressure - np.roll(self._pressure, 1, axis=2 - d)) * self._inverse[d]
            gradient[d] -= self.boundaries.driving[d]
        return self._at(self._continued(gradient), AT_FACES, points)

    def cell_pressure_gradient(self) -> Array:
        """grad p' of every cell, mean of its two faces as the momentum balance sees them (3, nz, ny, nx) [Pa/m]."""
        self.boundaries.fill_pressure(self._pressure)
        gradient = np.empty_like(self._velocity)
        for d in range(3):
            gradient[d] = (self._pressure - np.roll(self._pressure, 1, axis=2 - d)) * self._inverse[d]
            gradient[d] -= self.boundaries.driving[d]
        return self._in_cells(gradient)

    def cell_viscous_force(self) -> Array:
        """div tau of every cell, mean of its two faces (3, nz, ny, nx) [N/m3]."""
        return self._in_cells(self._viscous_force())

    def _in_cells(self, faces: Array) -> Array:
        """Mean of the two faces of every cell; next to a face that is held the other stands for both."""
        cells = np.empty((3, *self.grid.shape))
        inner = self.grid.inner
        for d in range(3):
            balanced = faces[d] * self._solved[d]
            low, high = inner(balanced), inner(np.roll(balanced, -1, axis=2 - d))
            number = inner(self._solved[d]) + inner(np.roll(self._solved[d], -1, axis=2 - d))
            cells[d] = (low + high) / np.maximum(number, 1.0)
        return cells

    def viscosity_at(self, points: Array) -> Array:
        """mu at points (N, 3) [m], tri-linear between centres: (N,) [Pa s]."""
        least, most = float(self._viscosity.min()), float(self._viscosity.max())
        if least == most:
            return np.full(len(points), most)  # free of the rounding of an interpolation
        return self._at(self._viscosity[None], AT_CENTRES, points)[:, 0]

    def viscous_force_at(self, points: Array) -> Array:
        """div tau, the stress of the fluid between the particles (not times eps), at points (N, 3): (N, 3) [N/m3]."""
        return self._at(self._continued(self._viscous_force()), AT_FACES, points)

    def _viscous_force(self) -> Array:
        """div tau on the faces (3, ...) [N/m3]."""
        self._thicken(self._velocity, np.ones_like(self._mean_voidage))
        force = np.zeros_like(self._velocity)  # what lies outside of the box is asked for, and dropped
        transport(
            self._velocity, self._mean_voidage, self._thickness, self._buried, 0.0, self._inverse, 0.0,
            self._flux, self._expansion, force,
        )  # fmt: skip
        return force

    def cell_value_at(self, field: Array, points: Array) -> Array:
        """A cell field (nz, ny, nx) at points (N, 3) [m], tri-linear between centres: (N,)."""
        padded = np.zeros((1, *self.grid.padded_shape))
        self.grid.inner(padded[0])[:] = field
        self.boundaries.fill_cells(padded)
        return self._at(padded, AT_CENTRES, points)[:, 0]

    def _at(self, fields: Array, place: Array, points: Array) -> Array:
        points = np.ascontiguousarray(points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError("points", points.shape, "of shape (N, 3)")
        values = np.empty((len(points), len(fields)))
        sample(fields, place, points, np.array(self.grid.origin), self._inverse, values)
        return values

    def _continued(self, vector: Array) -> Array:
        """Values on the faces of the momentum balance, carried on to faces without one (walls, inlets)."""
        for d in range(3):
            known, axis = self._solved[d] > 0.0, 2 - d
            above, below = np.roll(known, -1, axis), np.roll(known, 1, axis)
            nearest = np.where(above, np.roll(vector[d], -1, axis), np.where(below, np.roll(vector[d], 1, axis), 0.0))
            vector[d] = np.where(known, vector[d], nearest)
        self.boundaries.fill_faces(vector)
        return vector

    # ------------------------------------------------------------ drag that was exchanged

    def drag_exchange(self) -> tuple[Array, Array, Array]:
        r"""What drag did to the fluid over the last step, cell by cell.

        .. math:: \Delta m = h V\, W\,(\beta v - \beta u_d)

        returns  W (nz, ny, nx, 3) weight, 1 where the voidage is uniform [-]; u_d (nz, ny, nx, 3) the velocity
                 the implicit drag has seen [m/s]; the momentum given to the fluid (nz, ny, nx, 3) [N s]

        A particle with its own coefficient b [kg/s], of which beta V is the sum, received the impulse
        h W b (u_d - v): summed over the particles of a cell this is the opposite of the third array to round-off.
        h is the step just made, V the cell. Half the drag of a cell acts on each of its two faces; where a face is a
        wall or an inlet that half is taken by what holds the face, and is counted here too.
        """
        weight, seen = np.empty((*self.grid.shape, 3)), np.empty((*self.grid.shape, 3))
        drag_seen(
            self._other, self._velocity, self._centred, self._drag, self._solved, self.density, self._last_step,
            self._model_b, weight, seen,
        )  # fmt: skip
        inner = self.grid.inner
        push = np.moveaxis(inner(self._drag_momentum), 0, -1) - inner(self._drag)[..., None] * seen
        return weight, seen, self._last_step * self.grid.cell_volume * weight * push

    # ------------------------------------------------------------ ledger

    def momentum(self) -> Array:
        """Momentum of the fluid, sum of rho eps u V over all faces with an unknown velocity (3,) [N s]."""
        return self._momentum(self._velocity, self._mean_voidage)

    def momentum_ledger(self) -> dict[str, Array]:
        r"""Where the momentum of the last step came from, each (3,) [N s].

        change      of `momentum()`
        drag        sum of `drag_exchange()`
        particles   :math:`h \sum V p\,\nabla\varepsilon`, what model A takes from the fluid and gives to the particles
        source      of the user
        driving     of the mean pressure gradient of periodic sides
        boundaries  the rest: pressure, stress and flow at walls, inlets and outlets; zero in a periodic box
        """
        h, volume, inner = self._last_step, self.grid.cell_volume, self.grid.inner
        lines = {
            "change": self.momentum() - self._momentum(self._other, self._other_mean),
            "drag": self.drag_exchange()[2].sum(axis=(0, 1, 2)),
            "particles": np.zeros(3),
            "source": h * volume * inner(self._source).sum(axis=(1, 2, 3)),
        }
        share = self._open if self._model_b else self._open * inner(self._centred)
        lines["driving"] = h * volume * float(share.sum()) * self.boundaries.driving
        for d in range(3) if not self._model_b else ():
            own, axis = self._centred, 2 - d
            low = np.where(self._solved[d] > 0.0, 0.5 * (own + np.roll(own, 1, axis)), own)
            high = np.where(np.roll(self._solved[d], -1, axis) > 0.0, 0.5 * (own + np.roll(own, -1, axis)), own)
            lines["particles"][d] = h * self._areas[d] * float((self.pressure * inner(high - low)).sum())
        lines["boundaries"] = lines["change"] - sum(lines[name] for name in lines if name != "change")
        return lines

    def _momentum(self, velocity: Array, voidage: Array) -> Array:
        total = np.zeros(3)
        for d in range(3):
            stored = 0.5 * (voidage + np.roll(voidage, 1, 2 - d)) * velocity[d] * self._solved[d]
            faces = self.grid.inner_faces(stored, d)
            # The last face of a periodic direction is the first one again.
            unique = np.moveaxis(faces, 2 - d, 0)[: self.grid.cells[d] if self.boundaries.periodic[d] else None]
            total[d] = self.density * self.grid.cell_volume * float(unique.sum())
        return total

    # ------------------------------------------------------------ viscosity

    def _thicken(self, velocity: Array, voidage: Array) -> None:
        """eps mu of every cell and its ghosts, with the sub-grid viscosity; a solid cell takes that of its open
        neighbours, so that the stress on a wall is that of the fluid before it."""
        if self.smagorinsky > 0.0:
            resolved = [h for h, n in zip(self.grid.spacing, self.grid.cells) if n > 1] or [0.0]
            width = float(np.prod(resolved)) ** (1.0 / len(resolved))
            eddy_viscosity(velocity, self.density * (self.smagorinsky * width) ** 2, self._inverse, self._thickness)
            self._thickness += self._viscosity
            self.boundaries.fill_cells(self._thickness)
            self._thickness *= voidage
        else:
            np.multiply(voidage, self._viscosity, out=self._thickness)
        if self._rim is not None:
            cells, neighbours, shares = self._rim
            flat = self._thickness.ravel()
            flat[cells] = (flat[neighbours] * shares).sum(axis=1)
            self.boundaries.fill_cells(self._thickness)
