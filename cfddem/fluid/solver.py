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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.budgets import FluidBudgets
from cfddem.fluid.checks import checked_field, checked_voidage, refuse_trapped_inflow
from cfddem.fluid.conditions import Condition
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.momentum import predict, transport
from cfddem.fluid.pressure.projection import Projection
from cfddem.fluid.stability import FlowRates
from cfddem.fluid.state import FluidProperties
from cfddem.fluid.step_limit import Rates, StepLimit, step_limit

LOOSE = 1e-6
"""Pressure tolerance of the first stage: it only shapes the convecting flux of the second."""

ROUND_OFF = 1e-6
"""Relative change of the voidage that counts as round-off, over the tolerance of 1e-9 [-]."""

STIFF = 1.0
"""beta h/(eps rho) above which the second stage may be repeated, until the velocity moves by less than SETTLED."""

SETTLED = 0.01
"""Change of the velocity between two passes, over the largest velocity, that ends the repetition."""


@dataclass(frozen=True)
class StepReport:
    """What a step cost: pressure iterations of each solve, and how often the second stage was run."""

    pressure_iterations: tuple[int, ...]
    passes: int


class FluidSolver(FluidBudgets):
    """Volume-averaged incompressible flow on a grid.

    grid          Grid
    boundaries    side name -> condition or list of conditions (see `cfddem.fluid.boundaries`)
    density       rho [kg/m3]
    viscosity     mu, dynamic: a number, or of every cell (nz, ny, nx) [Pa s]
    gravity       g (x, y, z) [m/s2]; enters only the static pressure, see `cfddem.fluid.momentum`
    model         "A" or "B"
    convection    "limited" (upwind with the MC limiter, bounded) or "central" (unlimited, for smooth fields)
    smagorinsky   constant C of the sub-grid viscosity rho (C Delta)^2 |S|, about 0.1; 0 for none
    voidage       (nz, ny, nx) at the start, or a number
    tolerance     largest continuity residual of a cell over the largest flux through a face
    passes        most runs of the second stage where drag is stiff
    communicator  path to sums, extremes and decisions over all ranks
    """

    def __init__(
        self,
        grid: Grid,
        boundaries: Mapping[str, Condition | Sequence[Condition]] | Boundaries | None = None,
        *,
        density: float,
        viscosity: Array | float,
        gravity: Sequence[float] = (0.0, 0.0, 0.0),
        model: str = "A",
        convection: str = "limited",
        smagorinsky: float = 0.0,
        voidage: Array | float = 1.0,
        tolerance: float = 1e-9,
        passes: int = 3,
        communicator: Communicator = SERIAL,
    ) -> None:
        if not (np.isfinite(density) and density > 0.0):
            raise InputError("fluid.density", density, "a positive number, in kg/m3")
        if model not in ("A", "B"):
            raise InputError("fluid.model", model, '"A" or "B"')
        if convection not in ("limited", "central"):
            raise InputError("fluid.convection", convection, '"limited" or "central"')
        if not 1e-13 <= tolerance <= 1e-3:
            raise InputError("fluid.tolerance", tolerance, "between 1e-13 and 1e-3")
        sides = boundaries if isinstance(boundaries, Boundaries) else Boundaries(grid, boundaries)
        refuse_trapped_inflow(grid, sides)
        super().__init__(grid, sides, FluidProperties(density, gravity, model, smagorinsky), communicator)
        self.tolerance, self.passes = float(tolerance), int(passes)
        self._central = float(convection == "central")
        self._project, self._rates = Projection(self).correct, FlowRates(self)
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
        drag_coefficient  beta (nz, ny, nx) of the model chosen [kg/m3/s]; None is zero
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
        self._find_explicit_force(fields.velocity, fields.mean_voidage, fields.start_force)
        self._predict(fields.stage_velocity, step, weight=0.0)
        scale = self._flux_scale(step)
        loose = max(LOOSE, self.tolerance)
        iterations = [self._project(fields.stage_velocity, fields.other_voidage, loose * scale, scale, fresh=True)]

        # Second stage: the average of start and end; again while drag is stiff and the end still moves.
        np.copyto(fields.stored_voidage, fields.mean_voidage)
        tight = self.tolerance * scale
        for passes in range(1, self.passes + 1):
            self._find_explicit_force(fields.stage_velocity, fields.other_voidage, fields.stage_force)
            self._predict(fields.other_velocity, step, weight=0.5)
            iterations.append(self._project(fields.other_velocity, fields.other_voidage, tight, scale, fresh=False))
            if passes == self.passes or not self._still_moves(step):
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
        if coefficient is None:
            fields.drag.fill(0.0)
        else:
            given = checked_field("drag_coefficient", coefficient, shape, self.communicator, negative=False)
            self._set_cells(fields.drag, given)
        for name, field, target in (
            ("drag_momentum", momentum, fields.drag_momentum),
            ("source", source, fields.source),
        ):
            if field is None:
                target.fill(0.0)
            else:
                given = checked_field(name, field, (*shape, 3), self.communicator)
                self._set_cells(target, np.moveaxis(given, -1, 0))

    def _set_cells(self, padded: Array, cells: Array) -> None:
        """Write the cells of a padded field, and fill its ghosts."""
        self.grid.inner(padded)[:] = cells
        self.boundaries.halo.fill(padded)

    def _find_explicit_force(self, velocity: Array, voidage: Array, force: Array) -> None:
        """Write convection and viscous stress on the faces [N/m3]."""
        fields = self.fields
        self._effective.update(velocity, voidage, fields.viscosity, fields.effective_viscosity)
        transport(
            velocity, voidage, fields.effective_viscosity, self.faces.buried, self.density, self.inverse_spacing,
            self._central, fields.flux, fields.expansion, force,
        )  # fmt: skip

    def _predict(self, new: Array, step: float, weight: float) -> None:
        """Write the velocity after the step with the pressure as it is; the second explicit force has this weight."""
        fields = self.fields
        self.boundaries.fill_pressure(fields.pressure)
        predict(
            fields.velocity, fields.start_force, fields.stage_force, weight, fields.pressure, fields.stored_voidage,
            fields.centred_voidage, fields.other_voidage, fields.drag, fields.drag_momentum, fields.source,
            self.boundaries.driving, self.faces.solved, self.density, step, self.inverse_spacing, self.model_b,
            new, fields.mobility,
        )  # fmt: skip
        self.boundaries.set_faces(new)

    def _flux_scale(self, step: float) -> float:
        """Largest volume flux [m3/s]: through a face, of the old velocity or a hundredth of the predicted one, or
        displaced by the change of voidage in a cell."""
        fields, rate = self.fields, self.fields.owned("new_voidage_rate")
        old = self._rates.of(fields.velocity, fields.mean_voidage).flux
        predicted = self._rates.of(fields.stage_velocity, fields.other_voidage).flux
        fastest = max(self.communicator.largest(rate), -self.communicator.smallest(rate))
        displaced = self.grid.cell_volume * fastest
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
        self.time += step
        self.last_step = step

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
        return self._rates.of(fields.velocity, fields.mean_voidage)

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
        self.voidage[:] = checked_voidage(self.grid, voidage, self.communicator)

    def set_velocity(self, velocity: Sequence[Any]) -> None:
        """Start from a velocity, corrected by the smallest potential flow that makes it satisfy continuity.

        velocity  three components: numbers, arrays on the faces, or functions of x, y, z [m/s]
        """
        fields = self.fields
        for d in range(3):
            given = velocity[d](*self.grid.faces(d)) if callable(velocity[d]) else velocity[d]
            self.face_velocity(d)[:] = given
        fields.velocity[self.faces.blocked] = 0.0
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
