"""The fluid solver: a step predicts the velocity, solves for the pressure and corrects the velocity, twice.

    solver = FluidSolver(Grid.of_size((0.1, 0.1, 0.4), 0.005), {"z_low": Inlet(0.3), "z_high": Outlet()},
                         density=1.2, viscosity=1.8e-5)
    solver.step(1e-3, voidage, drag_coefficient, drag_momentum)

**Times.** A step takes the velocity from `time` to `time + step` and the voidage from one field to the next. The
change of voidage over the step *is* the outflow of the new velocity: continuity holds to the pressure tolerance for
exactly these two fields. The velocity therefore belongs to the middle of the interval over which its voidage moved.
Pass the voidage half a step ahead of the velocity, and everything is second order in time; pass it at `time + step`,
and the effect of a moving voidage is first order. A voidage at rest is second order either way. The pressure belongs
to the middle of the step.

**Order.** The two stages are Heun's. The first has a looser pressure tolerance; its end velocity gives the convection
and stress that are averaged with those of the start. Mass flux and storage agree in each stage, so that a uniform
velocity stays uniform in a moving voidage, and momentum is conserved by construction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError
from cfddem.fluid.boundaries import Boundaries, refuse_trapped_inflow
from cfddem.fluid.conditions import Condition
from cfddem.fluid.fields import (
    FLUID_FIELDS,
    CellFields,
    FluidStretches,
    checked_field,
    checked_viscosity,
    checked_voidage,
)
from cfddem.fluid.grid import Array, Grid, at_points, on_faces
from cfddem.fluid.momentum import Balance, FlowRates, Medium, drag_seen, in_cells, predict, transport
from cfddem.fluid.near_walls import near_walls
from cfddem.fluid.pressure.projection import Projection
from cfddem.fluid.step_limit import Rates, StepLimit, step_limit
from cfddem.fluid.viscosity import EffectiveViscosity

LOOSE = 1e-6
"""Pressure tolerance of the first stage: it only shapes the convecting flux of the second."""

ROUND_OFF = 1e-6
"""Relative change of the voidage that counts as round-off, over the tolerance of 1e-9 [-]."""

STIFF = 1.0
"""beta h/(eps rho) above which the second stage may be repeated, until the velocity moves by less than SETTLED."""

SETTLED = 0.01
"""Change of the velocity between two passes, over the largest velocity, that ends the repetition."""

PASSES = 3
"""Most runs of the second stage where drag is stiff."""


@dataclass(frozen=True)
class StepReport:
    """What a step cost: pressure iterations of each solve, and how often the second stage was run."""

    pressure_iterations: tuple[int, ...]
    passes: int


@dataclass(frozen=True)
class Scheme:
    """How the equations of the fluid are written and solved.

    model        "A" or "B"
    convection   "limited" (upwind with the MC limiter, bounded) or "central" (unlimited, for smooth fields)
    smagorinsky  constant C of the sub-grid viscosity rho (C Delta)^2 |S|, about 0.1; 0 for none
    tolerance    largest continuity residual of a cell over the largest flux through a face
    """

    model: str = "A"
    convection: str = "limited"
    smagorinsky: float = 0.0
    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        if self.model not in ("A", "B"):
            raise InputError("fluid.model", self.model, '"A" or "B"')
        if self.convection not in ("limited", "central"):
            raise InputError("fluid.convection", self.convection, '"limited" or "central"')
        if not 1e-13 <= self.tolerance <= 1e-3:
            raise InputError("fluid.tolerance", self.tolerance, "between 1e-13 and 1e-3")


class FluidSolver:
    """Volume-averaged incompressible flow on a grid.

    grid          Grid
    boundaries    side name -> condition or list of conditions (see `cfddem.fluid.boundaries`)
    density       rho [kg/m3]
    viscosity     mu, dynamic: a number, or of every cell (nz, ny, nx) [Pa s]
    gravity       g (x, y, z) [m/s2]; enters only the static pressure, see `cfddem.fluid.momentum`
    voidage       (nz, ny, nx) at the start, or a number
    scheme        model A or B, convection, sub-grid viscosity and tolerance
    communicator  path to sums, extremes and decisions over all ranks

    Attributes: `fields`, padded arrays by name (see `cfddem.fluid.fields`); `faces`, kinds of faces; `face_areas`,
    area of a face normal to x, y, z [m2]; `open_cells` (nz, ny, nx), 1 where a cell is open, 0 where it is solid;
    `time`, `last_step`, length of the step just made [s]; `followers`, told by `displaced` before the voidage changes
    without a flow; `body_forces`, more sources. Methods return plain arrays in the order of `cfddem.fluid.grid`.
    """

    def __init__(
        self,
        grid: Grid,
        boundaries: Mapping[str, Condition | Sequence[Condition]] | Boundaries | None = None,
        *,
        density: float,
        viscosity: Array | float,
        gravity: Sequence[float] = (0.0, 0.0, 0.0),
        voidage: Array | float = 1.0,
        scheme: Scheme = Scheme(),
        communicator: Communicator = SERIAL,
    ) -> None:
        if not (np.isfinite(density) and density > 0.0):
            raise InputError("fluid.density", density, "a positive number, in kg/m3")
        sides = boundaries if isinstance(boundaries, Boundaries) else Boundaries(grid, boundaries)
        refuse_trapped_inflow(grid, sides)
        self.grid, self.boundaries, self.communicator = grid, sides, communicator
        self.density, self.model, self.gravity = float(density), scheme.model, np.asarray(gravity, dtype=float)
        self.tolerance = float(scheme.tolerance)
        self.time, self.last_step = 0.0, 0.0
        self.followers: list[Any] = []
        self.body_forces: list[Callable[[], Array]] = []
        self.fields, self.faces = CellFields(grid, FLUID_FIELDS), sides.faces()
        self.model_b, self.inverse_spacing = float(self.model == "B"), 1.0 / np.array(grid.spacing)
        central = float(scheme.convection == "central")
        self._medium = Medium(self.density, self.inverse_spacing, central, self.model_b)
        self.face_areas = np.array([grid.face_area(d) for d in range(3)])
        self.open_cells = grid.open.astype(float)
        self._every_face = np.ones_like(self.faces.solved)
        self._effective = EffectiveViscosity(grid, sides.halo, self.density, float(scheme.smagorinsky))
        self.walls = near_walls(sides, self.fields, self.faces.solved)
        self._stretches = FluidStretches.of(self.faces.solved, self.walls.near(grid))
        self._projection = Projection(sides, self.fields, self._stretches.solved, communicator)
        self._rates = FlowRates(sides, self.density, communicator)
        self.set_viscosity(viscosity)
        self.set_voidage(voidage)
        self.set_velocity((0.0, 0.0, 0.0))

    # ------------------------------------------------------------ one step

    def step(
        self,
        step: float,
        voidage: Array | None = None,
        drag_coefficient: Array | None = None,
        drag_momentum: Array | None = None,
        source: Array | None = None,
    ) -> StepReport:
        """Advance the fluid by `step` [s].

        voidage           (nz, ny, nx) at the end of the step; None leaves it as it is
        drag_coefficient  beta of the model chosen (nz, ny, nx), or by axis (nz, ny, nx, 3) [kg/m3/s]; None is zero
        drag_momentum     beta v (nz, ny, nx, 3), v the velocity of the particles [N/m3]; None is zero
        source            (nz, ny, nx, 3) force on the fluid per volume of the cell [N/m3]; None is zero
        returns           StepReport
        errors            InputError for fields of a wrong shape or range, RunFailed if the flow diverges
        """
        if not (np.isfinite(step) and step > 0.0):
            raise InputError("step", step, "a positive time, in s")
        fields = self.fields
        new_voidage = self._take_voidage(voidage, step)
        self._take_exchange(drag_coefficient, drag_momentum, source)
        self.boundaries.set_inlets(self.time + step, fields.other_voidage)

        # First stage: carried by the old flux, and stored with the voidage that agrees with that flux.
        self._set_cells(fields.stored_voidage, fields.owned("other_voidage") - step * fields.owned("voidage_rate"))
        self._find_explicit_force(fields.velocity, fields.mean_voidage, fields.start_force, self._medium)
        self._predict(fields.stage_velocity, step, weight=0.0)
        scale = self._flux_scale(step)
        loose = max(LOOSE, self.tolerance)
        iterations = [self._project(fields.stage_velocity, fields.other_voidage, loose * scale, scale, fresh=True)]

        # Second stage: the average of start and end; again while drag is stiff and the end still moves.
        np.copyto(fields.stored_voidage, fields.mean_voidage)
        tight = self.tolerance * scale
        for passes in range(1, PASSES + 1):
            self._find_explicit_force(fields.stage_velocity, fields.other_voidage, fields.stage_force, self._medium)
            self._predict(fields.other_velocity, step, weight=0.5)
            iterations.append(self._project(fields.other_velocity, fields.other_voidage, tight, scale, fresh=False))
            if passes == PASSES or not self._still_moves(step):
                break
            fields.swap("stage_velocity", "other_velocity")

        self._accept(new_voidage, step)
        return StepReport(tuple(iterations), passes)

    def _take_voidage(self, voidage: Array | None, step: float) -> Array:
        """Rate of change, mean and centre of the voidage of this step; returns the voidage at its end (nz, ny, nx)."""
        fields, old = self.fields, self.voidage
        new = old if voidage is None else checked_voidage(self.grid, voidage, self.communicator)
        fields.owned("new_voidage_rate")[:] = (new - old) / step * self.open_cells
        self._set_cells(fields.other_voidage, 0.5 * (old + new))
        np.add(fields.mean_voidage, fields.other_voidage, out=fields.centred_voidage)
        np.multiply(fields.centred_voidage, 0.5, out=fields.centred_voidage)
        return new

    def _take_exchange(self, coefficient: Array | None, momentum: Array | None, source: Array | None) -> None:
        """Check and copy what the particles do to the fluid in this step."""
        fields, shape = self.fields, self.grid.shape
        for force in self.body_forces:
            source = force() if source is None else source + force()
        if coefficient is None:
            fields.drag.fill(0.0)
        else:
            wanted = (*shape, 3) if np.ndim(coefficient) == 4 else shape
            values = checked_field("drag_coefficient", coefficient, wanted, self.communicator, negative=False)
            self._set_cells(fields.drag, values)
        for name, field in (("drag_momentum", momentum), ("source", source)):
            if field is None:
                getattr(fields, name).fill(0.0)
            else:
                self._set_cells(getattr(fields, name), checked_field(name, field, (*shape, 3), self.communicator))

    def _set_cells(self, padded: Array, cells: Array) -> None:
        """Write the cells of a padded field, (nz, ny, nx) or vectors (nz, ny, nx, 3), and fill its ghosts."""
        self.grid.inner(padded)[:] = np.moveaxis(cells, -1, 0) if np.ndim(cells) == 4 else cells
        self.boundaries.halo.fill(padded)

    def _find_explicit_force(self, velocity: Array, voidage: Array, force: Array, medium: Medium) -> None:
        """Write convection and viscous stress on the faces [N/m3]."""
        fields = self.fields
        self._effective.update(velocity, voidage, fields.viscosity, fields.effective_viscosity)
        transport(
            self._stretches, velocity, (voidage, fields.effective_viscosity), self.faces.buried, medium, fields.flux,
            fields.expansion, force,
        )  # fmt: skip
        self.walls.replace(velocity, fields.effective_viscosity, medium.density, medium.central, force)

    def _project(self, velocity: Array, voidage: Array, limit: float, scale: float, fresh: bool) -> int:
        """Correct a velocity and the pressure so that continuity holds; returns the iterations it took."""
        return self._projection.correct(velocity, voidage, limit, scale, fresh, self.time)

    def _predict(self, new: Array, step: float, weight: float) -> None:
        """Write the velocity after the step with the pressure as it is; the second explicit force has this weight."""
        self.boundaries.fill_pressure(self.fields.pressure)
        old, mobility = self.fields.velocity, self.fields.mobility
        predict(self._stretches, self._balance(old), self._medium, step, weight, new, mobility)
        self.walls.hold(new, self.density, self.model_b, step, weight)
        self.boundaries.set_faces(new)

    def _balance(self, old: Array) -> Balance:
        """What a step is made of, from its old velocity on."""
        fields = self.fields
        return Balance(
            old, fields.start_force, fields.stage_force, fields.pressure, fields.stored_voidage,
            fields.centred_voidage, fields.other_voidage, fields.drag, fields.drag_momentum, fields.source,
            self.boundaries.driving, self.faces.solved,
        )  # fmt: skip

    def _flux_scale(self, step: float) -> float:
        """Largest volume flux [m3/s]: through a face, of the old velocity or a hundredth of the predicted one, or
        displaced by the change of voidage in a cell."""
        fields, rate = self.fields, self.fields.owned("new_voidage_rate")
        old = self._rates.of(fields.velocity, fields.mean_voidage, fields.effective_viscosity).flux
        predicted = self._rates.of(fields.stage_velocity, fields.other_voidage, fields.effective_viscosity).flux
        displaced = self.grid.cell_volume * max(self.communicator.largest(rate), -self.communicator.smallest(rate))
        # a voidage is known to its last digits only, and so is its rate
        displaced = max(displaced, ROUND_OFF * self.grid.cell_volume * math.prod(self.grid.whole.cells) ** 0.5 / step)
        return max(float(max(self.face_areas)) * max(old, 0.01 * predicted), displaced)

    def _still_moves(self, step: float) -> bool:
        """Whether drag is stiff and the last pass has changed the velocity."""
        largest, fields = self.communicator.largest, self.fields
        stiffness = step * largest(fields.drag) / (self.density * self.communicator.smallest(self.voidage))
        if stiffness < STIFF:
            return False
        moved = largest(np.abs(fields.other_velocity - fields.stage_velocity))
        return bool(moved > SETTLED * largest(np.abs(fields.other_velocity)))

    def _accept(self, voidage: Array, step: float) -> None:
        """Make the new velocity and voidage those of the fluid."""
        fields = self.fields
        fields.swap("velocity", "other_velocity")
        fields.swap("mean_voidage", "other_voidage")
        fields.swap("voidage_rate", "new_voidage_rate")
        self.voidage[:] = voidage
        self.time, self.last_step = self.time + step, step

    # ------------------------------------------------------------ step size

    def largest_step(self, courant: float = 0.5) -> StepLimit:
        """The largest step that is stable now, and why; infinite with the criterion "none" where nothing limits it.

        courant  C of :func:`cfddem.fluid.step_limit.step_limit`; Heun's scheme with the limiter is bounded up to 1. A
                 direction one cell thick without walls that stick does not count
        """
        return step_limit(self.rates(), courant)

    def rates(self) -> Rates:
        """Largest rates of the flow as it is."""
        fields = self.fields
        self._effective.update(fields.velocity, fields.mean_voidage, fields.viscosity, fields.effective_viscosity)
        return self._rates.of(fields.velocity, fields.mean_voidage, fields.effective_viscosity)

    def run_until(self, time: float, *, courant: float = 0.5, largest: float = np.inf, **fields: Any) -> dict[str, int]:
        """Step to `time` [s] with the largest stable steps; returns how often each criterion set the step.

        largest  a step never to exceed [s], counted as "given"; needed where the fluid starts at rest
        fields   voidage, drag_coefficient, drag_momentum, source: handed to every step
        """
        limiting: dict[str, int] = {}
        while self.time < time * (1.0 - 1e-12):
            limit = self.largest_step(courant)
            size, criterion = min((limit.step, limit.criterion), (float(largest), "given"))
            left = time - self.time
            if size >= left:
                size, criterion = left, "end"
            elif size > 0.5 * left:
                size = 0.5 * left  # two equal last steps instead of a tiny one
            self.step(size, **fields)
            limiting[criterion] = limiting.get(criterion, 0) + 1
        return limiting

    # ------------------------------------------------------------ start

    def set_voidage(self, voidage: Array | float, before: Array | None = None, step: float | None = None) -> None:
        """Set the voidage at the start.

        voidage  (nz, ny, nx), or a number
        before   voidage a step earlier, where it moves; the velocity set next belongs to the middle of that step
        step     time between the two [s]
        """
        new = checked_voidage(self.grid, voidage, self.communicator)
        mean, rate = new, np.zeros(self.grid.shape)
        if before is not None:
            if step is None or not step > 0.0:
                raise InputError("step", step, "the time between the two voidages, in s")
            earlier = checked_voidage(self.grid, before, self.communicator)
            mean = 0.5 * (new + earlier)
            rate = (new - earlier) / step * self.open_cells
        self.voidage[:] = new
        self._set_cells(self.fields.mean_voidage, mean)
        self.fields.owned("voidage_rate")[:] = rate

    def add_voidage(self, change: Array) -> None:
        """Change the voidage now, without a flow: particles that enter take the place of fluid, which leaves with them.

        change  (nz, ny, nx) [-]
        """
        voidage = np.minimum(self.voidage + change, 1.0)  # where all particles leave a cell, up to rounding
        voidage = checked_voidage(self.grid, voidage, self.communicator)
        for follow in self.followers:
            follow.displaced(voidage - self.voidage)
        self.voidage[:] = voidage

    def set_velocity(self, velocity: Sequence[Any]) -> None:
        """Start from a velocity, corrected by the smallest potential flow that makes it satisfy continuity.

        velocity  three components: numbers, arrays on the faces, or functions of x, y, z [m/s]
        """
        fields = self.fields
        for d in range(3):
            self.face_velocity(d)[:] = velocity[d](*self.grid.faces(d)) if callable(velocity[d]) else velocity[d]
        for field in (fields.velocity, fields.other_velocity):
            np.copyto(field, self.boundaries.cut.beyond, where=self.faces.blocked)
        np.copyto(fields.other_voidage, fields.mean_voidage)
        np.copyto(fields.new_voidage_rate, fields.voidage_rate)
        self.boundaries.set_inlets(self.time, fields.mean_voidage)
        self.boundaries.fill_velocity(fields.velocity)
        share = 1.0 if self.model == "B" else fields.mean_voidage
        np.multiply(self.faces.solved, share / self.density, out=fields.mobility)
        kept = self.pressure.copy()
        np.copyto(fields.stage_velocity, fields.velocity)
        scale = self._flux_scale(np.inf)
        self._project(fields.velocity, fields.mean_voidage, self.tolerance * scale, scale, fresh=True)
        self.pressure[:] = kept

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
        return np.moveaxis(in_cells(self.grid, self.fields.velocity, self._every_face), 0, -1)

    @property
    def mean_velocity(self) -> Array:
        """Mean of the velocities before and after the last step at cell centres (nz, ny, nx, 3) [m/s]."""
        other, now = self.fields.other_velocity, self.fields.velocity
        return np.moveaxis(in_cells(self.grid, 0.5 * (other + now), self._every_face), 0, -1)

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
        return np.asarray(np.moveaxis(self.grid.joined(np.moveaxis(values, -1, 0)), 0, -1))

    def set_viscosity(self, viscosity: Array | float) -> None:
        """Viscosity from now on: of every cell (nz, ny, nx), or a number [Pa s]; all positive, or all zero."""
        self.viscosity[:] = checked_viscosity(self.grid, viscosity, self.communicator)
        self.boundaries.halo.fill(self.fields.viscosity)

    def face_velocity(self, axis: int) -> Array:
        """Component `axis` on its faces [m/s], both boundaries included, a view: (nz, ny, nx+1) for x."""
        return self.grid.inner_faces(self.fields.velocity[axis], axis)

    def volume_flux(self, axis: int) -> Array:
        """eps u through the faces normal to `axis`, per area of a whole face [m/s]; shape as `face_velocity`."""
        flux = on_faces(self.fields.mean_voidage, axis) * self.boundaries.cut.of_faces(axis)
        return self.face_velocity(axis) * self.grid.inner_faces(flux, axis)

    # ------------------------------------------------------------ checkpoint

    def checkpoint(self) -> dict[str, Any]:
        """Time, and copies of all fields that the next step depends on, over the whole grid without ghosts."""
        return {"time": np.array(self.time)} | self.fields.checkpoint()

    def restore(self, stored: Mapping[str, Any]) -> None:
        """Go on from a `checkpoint()` of a fluid with the same grid and boundaries, on any number of ranks; gives the
        same bits on the same number of ranks."""
        self.fields.restore(stored)
        self.time, fields, halo = float(stored["time"]), self.fields, self.boundaries.halo
        for cells in (fields.mean_voidage, fields.viscosity, fields.drag, fields.drag_momentum, fields.source):
            halo.fill(cells)
        self.boundaries.fill_pressure(fields.pressure)
        self.boundaries.set_inlets(self.time, fields.mean_voidage)
        self.boundaries.fill_velocity(fields.velocity)

    # ------------------------------------------------------------ values in cells and at points

    def cell_pressure_gradient(self) -> Array:
        """grad p' of every cell, mean of its two faces as the momentum balance sees them (3, nz, ny, nx) [Pa/m].

        Add rho g for the gradient of the static pressure.
        """
        return in_cells(self.grid, self.boundaries.pressure_gradient(self.fields.pressure), self.faces.solved)

    def cell_viscous_force(self) -> Array:
        """div tau of every cell, the stress of the fluid between the particles (not times eps), mean of its two faces
        (3, nz, ny, nx) [N/m3]."""
        velocity = self.fields.velocity
        return in_cells(self.grid, self.viscous_force(velocity, np.ones_like(velocity[0])), self.faces.solved)

    def drag_response(self) -> tuple[Array, Array]:
        """How the implicit drag of the last step saw the fluid, cell by cell.

        returns  W (nz, ny, nx, 3) weight, 1 where the voidage is uniform [-]; u_d (nz, ny, nx, 3) the velocity
                 the implicit drag has seen [m/s]
        """
        fields, (weight, mean) = self.fields, np.empty((2, *self.fields.velocity.shape))
        drag_seen(self._balance(fields.other_velocity), fields.velocity, self._medium, self.last_step, weight, mean)
        return np.moveaxis(self.grid.inner(weight), 0, -1), np.moveaxis(self.grid.inner(mean), 0, -1)

    def viscous_force(self, velocity: Array, voidage: Array) -> Array:
        """div(eps tau) on the faces (3, ...) of a padded velocity with a padded voidage [N/m3]."""
        force, still = np.zeros_like(velocity), self._medium._replace(density=0.0, central=0.0)  # without convection
        self._find_explicit_force(velocity, voidage, force, still)
        return force

    def velocity_at(self, points: Array) -> Array:
        """Velocity at points (N, 3) [m], tri-linear between faces: (N, 3) [m/s]."""
        return at_points(self.grid, self.fields.velocity, points)
