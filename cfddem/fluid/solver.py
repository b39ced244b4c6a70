"""The fluid solver: one step is predict - pressure - correct, twice.

    solver = FluidSolver(Grid.of_size((0.1, 0.1, 0.4), 0.005), {"z_low": Inlet(0.3), "z_high": Outlet()},
                         density=1.2, viscosity=1.8e-5)
    solver.step(1e-3, voidage, drag_coefficient, drag_momentum)

**Times.** A step takes the velocity from `time` to `time + step` and the voidage from one field to the next. The
change of voidage over the step *is* the outflow of the new velocity (continuity holds to the pressure tolerance
for exactly these two fields), so the velocity belongs to the middle of the interval over which its voidage
moved: hand over the voidage half a step ahead of the velocity and everything is second order in time; hand it
over at `time + step` and what a moving voidage adds is first order. A voidage at rest is second order either
way. The pressure belongs to the middle of the step.

**Order.** The two stages are Heun's: the first, with a looser pressure tolerance, gives the end velocity whose
convection and stress are averaged with those of the start. Mass flux and storage agree in each stage, so that a
uniform velocity stays uniform in a moving voidage, and momentum is conserved by construction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.errors import InputError
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.checks import (
    checked_field,
    checked_voidage,
    closed_regions,
    refuse_imbalance,
    refuse_nonsense,
    refuse_trapped_inflow,
)
from cfddem.fluid.conditions import Condition
from cfddem.fluid.division import VISCOUS
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.momentum import predict, transport
from cfddem.fluid.pressure import PressureEquation
from cfddem.fluid.projection import correct, gather
from cfddem.fluid.stability import StepLimit, clocks
from cfddem.fluid.state import FluidState

LOOSE = 1e-6
"""Pressure tolerance of the first stage: it only shapes the convecting flux of the second."""

ROUND_OFF = 1e-6
"""Times the tolerance of 1e-9: change of voidage that is no change [-]."""

STIFF = 1.0
"""beta h/(eps rho) above which the second stage may be repeated, until the velocity moves by less than SETTLED."""

SETTLED = 0.01
"""Change of the velocity between two passes, over the largest velocity, that ends the repetition."""


@dataclass(frozen=True)
class StepReport:
    """What a step cost: pressure iterations of each solve, and how often the second stage was run."""

    pressure_iterations: tuple[int, ...]
    passes: int


class FluidSolver(FluidState):
    """Volume-averaged incompressible flow on a grid.

    grid         Grid
    boundaries   side name -> condition or list of conditions (see `cfddem.fluid.boundaries`)
    density      rho [kg/m3]
    viscosity    mu, dynamic: a number, or of every cell (nz, ny, nx) [Pa s]
    gravity      g (x, y, z) [m/s2]; enters only the static pressure, see `cfddem.fluid.momentum`
    model        "A" or "B"
    convection   "limited" (upwind with the MC limiter, bounded) or "central" (unlimited, for smooth fields)
    smagorinsky  constant C of the sub-grid viscosity rho (C Delta)^2 |S|, about 0.1; 0 switches it off
    voidage      (nz, ny, nx) at the start, or a number
    tolerance    largest continuity residual of a cell over the largest flux through a face
    passes       most runs of the second stage where drag is stiff
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
        super().__init__(grid, sides, density, viscosity, gravity, smagorinsky, float(model == "B"))
        self.model, self.tolerance, self.passes = model, float(tolerance), int(passes)
        self._central = float(convection == "central")
        self._equation = PressureEquation(grid, closed_regions(grid, sides))
        self._wanted = np.zeros(grid.shape)
        self._clock_inverse = self._inverse * [sides.varies_along(d) for d in range(3)]
        self._by_plane = np.zeros((3, grid.shape[0]))
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
        errors            InputError for fields that are no numbers or cannot be, RunFailed if the flow runs away
        """
        if not (np.isfinite(step) and step > 0.0):
            raise InputError("step", step, "a positive time, in s")
        new_voidage = self.voidage if voidage is None else checked_voidage(self.grid, voidage)
        voidage_rate = (new_voidage - self.voidage) / step * self._open
        self._take(drag_coefficient, drag_momentum, source)
        self._pad(0.5 * (self.voidage + new_voidage), self._other_mean)
        np.add(self._mean_voidage, self._other_mean, out=self._centred)
        self._centred *= 0.5
        self.boundaries.set_inlets(self.time + step, self._other_mean)

        # Stage one: carried by the old flux, and stored with the voidage that agrees with that flux.
        self._pad(self.grid.inner(self._other_mean) - step * self._voidage_rate, self._stored)
        self._transport(self._velocity, self._mean_voidage, self._rate_a)
        self._predict(0.0, step, self._stage)
        scale = self._flux_scale(voidage_rate, step)
        iterations = [self._project(self._stage, voidage_rate, scale, max(LOOSE, self.tolerance), fresh=True)]

        # Stage two: the average of start and end; again while drag is stiff and the end still moves.
        np.copyto(self._stored, self._mean_voidage)
        for passes in range(1, self.passes + 1):
            self._transport(self._stage, self._other_mean, self._rate_b)
            self._predict(0.5, step, self._other)
            iterations.append(self._project(self._other, voidage_rate, scale, self.tolerance, fresh=False))
            if passes == self.passes or not self._still_moving(step):
                break
            self._stage, self._other = self._other, self._stage

        self._velocity, self._other = self._other, self._velocity
        self._mean_voidage, self._other_mean = self._other_mean, self._mean_voidage
        self.voidage[:], self._voidage_rate[:] = new_voidage, voidage_rate
        self.time += step
        self._last_step = step
        return StepReport(tuple(iterations), passes)

    def _take(self, coefficient: Array | None, momentum: Array | None, source: Array | None) -> None:
        """Copy the fields of the step into padded arrays."""
        shape = self.grid.shape
        for name, field, target in (
            ("drag_coefficient", coefficient, self._drag),
            ("drag_momentum", momentum, self._drag_momentum),
            ("source", source, self._source),
        ):
            if field is None:
                target.fill(0.0)
            elif target is self._drag:
                self._pad(checked_field(name, field, shape, negative=False), target)
            else:
                self._pad(np.moveaxis(checked_field(name, field, (*shape, 3)), -1, 0), target)

    def _pad(self, cells: Array, padded: Array) -> None:
        self.grid.inner(padded)[:] = cells
        self.boundaries.fill_cells(padded)

    def _transport(self, velocity: Array, voidage: Array, rate: Array) -> None:
        self._thicken(velocity, voidage)
        transport(
            velocity, voidage, self._thickness, self._buried, self.density, self._inverse, self._central,
            self._flux, self._expansion, rate,
        )  # fmt: skip

    def _predict(self, weight_b: float, step: float, new: Array) -> None:
        self.boundaries.fill_pressure(self._pressure)
        predict(
            self._velocity, self._rate_a, self._rate_b, weight_b, self._pressure, self._stored, self._centred,
            self._other_mean, self._drag, self._drag_momentum, self._source, self.boundaries.driving, self._solved,
            self.density, step, self._inverse, self._model_b, new, self._mobility,
        )  # fmt: skip
        self.boundaries.fill_velocity(new)

    def _flux_scale(self, voidage_rate: Array, step: float) -> float:
        """Largest volume flux [m3/s]: through a face, of the old velocity or a hundredth of the predicted one, or
        displaced by the change of voidage in a cell."""
        old, predicted = self._clocks(self._velocity, self._mean_voidage), self._clocks(self._stage, self._other_mean)
        displaced = self.grid.cell_volume * max(float(voidage_rate.max()), -float(voidage_rate.min()))
        # a voidage is known to its last digits only, and so is its rate
        displaced = max(displaced, ROUND_OFF * self.grid.cell_volume * voidage_rate.size**0.5 / step)
        return max(float(self._areas.max()) * max(old[2], 0.01 * predicted[2]), displaced)

    def _project(self, velocity: Array, voidage_rate: Array, scale: float, tolerance: float, fresh: bool) -> int:
        """Find the pressure with which a velocity satisfies continuity; returns the iterations it took."""
        finest = self._equation.finest
        gather(
            velocity, self._mobility, self._other_mean, voidage_rate, self._open, fresh, self.boundaries.periodic,
            self._areas, self._inverse, finest.ax, finest.ay, finest.az, finest.anchor, self._wanted,
        )  # fmt: skip
        if fresh:
            self._equation.prepare()
        refuse_nonsense(self.grid, self._wanted, self.time)
        refuse_imbalance(self._equation.closed_regions, self._wanted, scale, self.time)
        correction, iterations = self._equation.solve(self._wanted, tolerance * scale)
        if iterations:
            self.grid.inner(self._correction)[:] = correction
            self.boundaries.fill_pressure(self._correction, correction=True)
            correct(velocity, self._mobility, self._correction, self._inverse)
            self.boundaries.fill_velocity(velocity)
            self.pressure[:] += correction
        return iterations

    def _still_moving(self, step: float) -> bool:
        stiffness = step * self._drag.max() / (self.density * self.voidage.min())
        if stiffness < STIFF:
            return False
        moved = np.abs(self._other - self._stage).max()
        return bool(moved > SETTLED * np.abs(self._other).max())

    # ------------------------------------------------------------ step size

    def largest_step(self, courant: float = 0.5) -> StepLimit:
        r"""The largest step that is stable now, and why.

        .. math:: h \le C / \sum_d |u_d|/h_d, \qquad h \le 0.8 / (2\nu \sum_d h_d^{-2})

        courant  C; Heun's scheme with the limiter is bounded up to 1. A direction one cell thick without walls
                 that stick does not count
        returns  StepLimit; infinite with the clock "none" where nothing moves and nothing is viscous
        """
        self._thicken(self._velocity, self._mean_voidage)
        advection, diffusion, _ = self._clocks(self._velocity, self._mean_voidage)
        limits = {
            "Courant": courant / advection if advection > 0.0 else np.inf,
            "viscous": VISCOUS / diffusion if diffusion > 0.0 else np.inf,
        }
        clock = min(limits, key=limits.__getitem__)
        return StepLimit(limits[clock], clock if np.isfinite(limits[clock]) else "none")

    def _clocks(self, velocity: Array, voidage: Array) -> tuple[float, float, float]:
        """Largest |u|/h [1/s], viscous rate [1/s] and eps |u| [m/s]."""
        clocks(velocity, voidage, self._thickness, self._open, self.density, self._clock_inverse, *self._by_plane)
        advection, diffusion, fastest = (float(most) for most in self._by_plane.max(axis=1))
        return advection, diffusion, fastest

    def run_until(self, time: float, *, courant: float = 0.5, largest: float = np.inf, **fields: Any) -> dict[str, int]:
        """Step to `time` [s] with the largest stable steps; returns how often each clock set the step.

        largest  a step never to exceed [s], counted as "given"; needed where the fluid starts at rest
        fields   voidage, drag_coefficient, drag_momentum, source: handed to every step
        """
        binding: dict[str, int] = {}
        while self.time < time * (1.0 - 1e-12):
            limit = self.largest_step(courant)
            size, clock = min((limit.step, limit.clock), (float(largest), "given"))
            left = time - self.time
            if size >= left:
                size, clock = left, "end"
            elif size > 0.5 * left:
                size = 0.5 * left  # two equal last steps instead of a tiny one
            self.step(size, **fields)
            binding[clock] = binding.get(clock, 0) + 1
        return binding

    # ------------------------------------------------------------ start

    def set_voidage(self, voidage: Array | float, before: Array | None = None, step: float | None = None) -> None:
        """Voidage (nz, ny, nx) at the start, or a number; and where it moves, what it was a step [s] before.

        The velocity set next belongs to the middle of that step.
        """
        self.voidage[:] = checked_voidage(self.grid, voidage)
        self._voidage_rate.fill(0.0)
        mean = self.voidage
        if before is not None:
            if step is None or not step > 0.0:
                raise InputError("step", step, "the time between the two voidages, in s")
            earlier = checked_voidage(self.grid, before)
            mean = 0.5 * (self.voidage + earlier)
            self._voidage_rate[:] = (self.voidage - earlier) / step * self._open
        self._pad(mean, self._mean_voidage)

    def set_velocity(self, velocity: Sequence[Any]) -> None:
        """Start from a velocity, made to satisfy continuity by the smallest potential flow.

        velocity  three components: numbers, arrays on the faces, or functions of x, y, z [m/s]
        """
        for d in range(3):
            given = velocity[d](*self.grid.faces(d)) if callable(velocity[d]) else velocity[d]
            self.face_velocity(d)[:] = given
        self._velocity[self._blocked] = 0.0
        np.copyto(self._other_mean, self._mean_voidage)
        self.boundaries.set_inlets(self.time, self._mean_voidage)
        self.boundaries.fill_velocity(self._velocity)
        share = 1.0 if self.model == "B" else self._mean_voidage
        np.multiply(self._solved, share / self.density, out=self._mobility)
        kept = self.pressure.copy()
        np.copyto(self._stage, self._velocity)
        scale = self._flux_scale(self._voidage_rate, np.inf)
        self._project(self._velocity, self._voidage_rate, scale, self.tolerance, fresh=True)
        self.pressure[:] = kept
