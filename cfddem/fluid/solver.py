"""The fluid solver: one step is predict - pressure - correct, twice.

    solver = FluidSolver(Grid.of_size((0.1, 0.1, 0.4), 0.005), {"z_low": Inlet(0.3), "z_high": Outlet()},
                         density=1.2, viscosity=1.8e-5)
    solver.step(1e-3, voidage, drag_coefficient, drag_momentum)

Times. A step takes the velocity from `time` to `time + step` and the voidage from one field to the next. The
change of voidage over the step *is* the outflow of the new velocity (continuity holds to the pressure tolerance
for exactly these two fields), so the velocity belongs to the middle of the interval over which its voidage
moved: hand over the voidage half a step ahead of the velocity and everything is second order in time; hand it
over at `time + step` and a moving voidage is first order. A voidage at rest is second order either way. The
pressure belongs to the middle of the step.

Order. The two stages are Heun's: the first, with a loose pressure tolerance, gives the end velocity whose
convection and stress are averaged with those of the start. Mass flux and storage agree in each stage, so that a
uniform velocity stays uniform through a moving voidage, and momentum is conserved by construction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.errors import InputError, RunFailed
from cfddem.fluid.boundaries import Boundaries, Condition
from cfddem.fluid.grid import LOW, Array, Grid
from cfddem.fluid.momentum import clocks, correct, gather, predict, transport
from cfddem.fluid.pressure import PressureEquation

LOOSE = 1e-6
"""Pressure tolerance of the first stage: it only shapes the convecting flux of the second."""

STIFF = 1.0
"""beta h/(eps rho) above which the second stage may be repeated."""


@dataclass(frozen=True)
class StepLimit:
    """The largest stable step [s] and the clock that sets it: "Courant", "viscous" or "none"."""

    step: float
    clock: str


@dataclass(frozen=True)
class StepReport:
    """What a step cost: pressure iterations of each solve, and times the second stage was run."""

    pressure_iterations: tuple[int, ...]
    stages: int


class FluidSolver:
    """Volume-averaged incompressible flow on a grid.

    grid         Grid
    boundaries   side name -> condition or list of conditions (see `cfddem.fluid.boundaries`)
    density      rho [kg/m3]
    viscosity    mu, dynamic [Pa s]
    gravity      g (x, y, z) [m/s2]; enters only the static pressure, see `cfddem.fluid.momentum`
    model        "A" or "B"
    convection   "limited" (upwind, MC limiter) or "central" (unlimited, for smooth fields)
    smagorinsky  constant of the sub-grid viscosity rho (C Delta)^2 |S|; 0 switches it off
    voidage      (nz, ny, nx) at the start, or a number
    tolerance    largest continuity residual of a cell over the largest flux through a face
    repeats      times the second stage may be run where drag is stiff
    """

    def __init__(
        self,
        grid: Grid,
        boundaries: Mapping[str, Condition | Sequence[Condition]] | Boundaries | None = None,
        *,
        density: float,
        viscosity: float,
        gravity: Sequence[float] = (0.0, 0.0, 0.0),
        model: str = "A",
        convection: str = "limited",
        smagorinsky: float = 0.0,
        voidage: Array | float = 1.0,
        tolerance: float = 1e-9,
        repeats: int = 3,
    ) -> None:
        for name, value in (("density", density), ("viscosity", viscosity)):
            if not (np.isfinite(value) and value > 0.0 or name == "viscosity" and value == 0.0):
                raise InputError(f"fluid.{name}", value, "a positive number")
        if model not in ("A", "B"):
            raise InputError("fluid.model", model, '"A" or "B"')
        if convection not in ("limited", "central"):
            raise InputError("fluid.convection", convection, '"limited" or "central"')
        self.grid = grid
        self.boundaries = boundaries if isinstance(boundaries, Boundaries) else Boundaries(grid, boundaries)
        self.density, self.viscosity = float(density), float(viscosity)
        self.gravity = np.asarray(gravity, dtype=float)
        self.model, self.smagorinsky = model, float(smagorinsky)
        self.tolerance, self.repeats = float(tolerance), int(repeats)
        self.time = 0.0
        self._model_b, self._central = float(model == "B"), float(convection == "central")
        self._inverse = 1.0 / np.array(grid.spacing)
        self._areas = np.array([grid.face_area(d) for d in range(3)])
        self._allocate()
        self._equation = PressureEquation(grid, self._closed_regions())
        self.voidage[:] = self._checked_voidage(voidage)
        self._mean_voidage[:] = self._pad(self.voidage)
        self.set_velocity((0.0, 0.0, 0.0))
        self._refuse_trapped_inflow()

    def _allocate(self) -> None:
        grid = self.grid
        shape, vector = grid.padded_shape, (3, *grid.padded_shape)
        self.voidage = np.ones(grid.shape)
        self._rate = np.zeros(grid.shape)  # d eps/dt of the interval the velocity belongs to
        self._mean_voidage, self._new_mean, self._stored = (np.ones(shape) for _ in range(3))
        self._old, self._stage, self._new = (np.zeros(vector) for _ in range(3))
        self._rate_a, self._rate_b, self._flux, self._mobility = (np.zeros(vector) for _ in range(4))
        self._drag_momentum, self._source = np.zeros(vector), np.zeros(vector)
        self._pressure, self._correction, self._dilatation = (np.zeros(shape) for _ in range(3))
        self._drag, self._thickness = np.zeros(shape), np.zeros(shape)
        self._b = np.zeros(grid.shape)
        self._open = grid.open.astype(float)
        self._solved, self._buried = self.boundaries.mark_unknowns()
        self._by_plane = np.zeros((3, grid.shape[0]))
        self._last_step = 0.0

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
            raise InputError("step", step, "a positive time in s")
        new_voidage = self.voidage if voidage is None else self._checked_voidage(voidage)
        new_rate = (new_voidage - self.voidage) / step * self._open
        self._take_drag(drag_coefficient, drag_momentum, source)
        self._new_mean[:] = self._pad(0.5 * (self.voidage + new_voidage))
        self.boundaries.set_inlets(self.time + step, self._new_mean)

        # Stage one: storage that agrees with the flux of the old velocity, which carries it.
        self._stored[:] = self._pad(self.grid.inner(self._new_mean) - step * self._rate)
        self._transport(self._old, self._mean_voidage, self._rate_a)
        self._predict(0.0, step, self._stage)
        scale = self._flux_scale()
        iterations = [self._project(self._stage, new_rate, scale, max(LOOSE, self.tolerance), fresh=True)]

        # Stage two: the average of start and end; again while drag is stiff and the end still moves.
        np.copyto(self._stored, self._mean_voidage)
        stages = 0
        while True:
            self._transport(self._stage, self._new_mean, self._rate_b)
            self._predict(0.5, step, self._new)
            iterations.append(self._project(self._new, new_rate, scale, self.tolerance, fresh=False))
            stages += 1
            if stages >= self.repeats or not self._still_moving(step):
                break
            self._stage, self._new = self._new, self._stage

        self._old, self._new = self._new, self._old
        self._mean_voidage, self._new_mean = self._new_mean, self._mean_voidage
        self.voidage[:], self._rate[:] = new_voidage, new_rate
        self.time += step
        self._last_step = step
        return StepReport(tuple(iterations), stages)

    def _transport(self, velocity: Array, voidage: Array, rate: Array) -> None:
        self._thicken(voidage)
        transport(
            velocity, voidage, self._thickness, self._buried, self.density, self._inverse, self._central,
            self._flux, self._dilatation, rate,
        )  # fmt: skip

    def _thicken(self, voidage: Array) -> None:
        """eps mu of every cell."""
        np.multiply(voidage, self.viscosity, out=self._thickness)

    def _predict(self, weight_b: float, step: float, new: Array) -> None:
        self.boundaries.fill_pressure(self._pressure)
        predict(
            self._old, self._rate_a, self._rate_b, weight_b, self._pressure, self._stored, self._new_mean,
            self._drag, self._drag_momentum, self._source, self.boundaries.driving, self._solved,
            self.density, step, self._inverse, self._model_b, new, self._mobility,
        )  # fmt: skip
        self.boundaries.fill_velocity(new)

    def _flux_scale(self) -> float:
        """Largest volume flux through a face [m3/s]: of the old velocity, or a hundredth of the predicted one."""
        area = float(self._areas.max())
        old = self._clocks(self._old, self._mean_voidage)[2]
        predicted = self._clocks(self._stage, self._new_mean)[2]
        return area * max(old, 0.01 * predicted)

    def _project(self, velocity: Array, rate: Array, scale: float, tolerance: float, fresh: bool) -> int:
        """Find the pressure with which the velocity satisfies continuity."""
        finest = self._equation.finest
        gather(
            velocity, self._mobility, self._new_mean, rate * self.grid.cell_volume, fresh, self.boundaries.periodic,
            self._areas, self._inverse, finest.ax, finest.ay, finest.az, finest.anchor, self._b,
        )  # fmt: skip
        self._b *= self._open
        if fresh:
            self._equation.prepare()
        self._refuse_nonsense(velocity)
        self._refuse_imbalance(scale)
        correction, iterations = self._equation.solve(self._b, tolerance * scale)
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
        change = np.abs(self._new - self._stage).max()
        return bool(change > 0.01 * np.abs(self._new).max())

    # ------------------------------------------------------------ step size

    def _clocks(self, velocity: Array, voidage: Array) -> tuple[float, float, float]:
        clocks(velocity, voidage, self._thickness, self._open, self.density, self._inverse, *self._by_plane)
        advection, diffusion, fastest = self._by_plane.max(axis=1)
        return float(advection), float(diffusion), float(fastest)

    def largest_step(self, courant: float = 0.5) -> StepLimit:
        """The largest step that is stable now, and why.

        .. math:: h \\le C / \\sum_d |u_d|/h_d, \\qquad h \\le 0.8 / (2\\nu \\sum_d h_d^{-2})

        courant  C; Heun's scheme with the limiter is bounded up to 1
        returns  StepLimit; infinite with the clock "none" where nothing moves and nothing is viscous
        """
        self._thicken(self._mean_voidage)
        advection, diffusion, _ = self._clocks(self._old, self._mean_voidage)
        limits = {
            "Courant": courant / advection if advection > 0.0 else np.inf,
            "viscous": 0.8 / diffusion if diffusion > 0.0 else np.inf,
        }
        clock = min(limits, key=limits.__getitem__)
        return StepLimit(limits[clock], clock if np.isfinite(limits[clock]) else "none")

    def run_until(self, time: float, *, courant: float = 0.5, largest: float = np.inf, **fields: Any) -> dict[str, int]:
        """Step to `time` [s] with the largest stable steps; returns how often each clock set the step.

        largest  a step never to exceed [s], counted as "given"; fields are handed to every `step`
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

    # ------------------------------------------------------------ state

    @property
    def pressure(self) -> Array:
        """p' = p - rho g.x at cell centres (nz, ny, nx) [Pa], a view; zero in solid cells."""
        return self.grid.inner(self._pressure)

    @property
    def static_pressure(self) -> Array:
        """p = p' + rho g.x (nz, ny, nx) [Pa]."""
        x, y, z = self.grid.centres()
        return self.pressure + self.density * (self.gravity[0] * x + self.gravity[1] * y + self.gravity[2] * z)

    @property
    def velocity(self) -> Array:
        """Velocity at cell centres (nz, ny, nx, 3) [m/s], mean of the two faces of each component."""
        means = []
        for d in range(3):
            faces = np.moveaxis(self.face_velocity(d), 2 - d, 0)
            means.append(np.moveaxis(0.5 * (faces[1:] + faces[:-1]), 0, 2 - d))
        return np.stack(means, axis=-1)

    def face_velocity(self, axis: int) -> Array:
        """Component `axis` on its faces [m/s], both boundaries included, a view: (nz, ny, nx+1) for x."""
        return self.grid.inner_faces(self._old[axis], axis)

    def volume_flux(self, axis: int) -> Array:
        """eps u through the faces normal to `axis`, per area [m/s]."""
        shifted = np.roll(self._mean_voidage, 1, axis=2 - axis)
        return self.face_velocity(axis) * self.grid.inner_faces(0.5 * (self._mean_voidage + shifted), axis)

    def continuity_residual(self) -> Array:
        """V d(eps)/dt + outflow of every open cell (nz, ny, nx) [m3/s], summed face by face, not by the solver."""
        total = self._rate * self.grid.cell_volume
        for d in range(3):
            total = total + np.diff(self.volume_flux(d), axis=2 - d) * self._areas[d]
        return total * self._open

    def set_velocity(self, velocity: Sequence[Any], voidage_rate: Array | None = None) -> None:
        """Start from a velocity, made to satisfy continuity by the smallest potential flow.

        velocity      three components: numbers, arrays on the faces, or functions of x, y, z [m/s]
        voidage_rate  d(eps)/dt (nz, ny, nx) the velocity belongs to [1/s]; None is zero
        """
        if voidage_rate is not None:
            self._rate[:] = voidage_rate * self._open
        for d in range(3):
            given = velocity[d](*self.grid.faces(d)) if callable(velocity[d]) else velocity[d]
            self.face_velocity(d)[:] = given
        self._old *= np.where(self._buried > 0.0, 0.0, 1.0)
        self._block_masked_faces()
        self.boundaries.set_inlets(self.time, self._mean_voidage)
        self.boundaries.fill_velocity(self._old)
        self._new_mean[:] = self._mean_voidage
        share = self._mean_voidage if self._model_b == 0.0 else np.ones_like(self._mean_voidage)
        self._mobility[:] = self._solved * share / self.density
        kept = self.pressure.copy()
        scale = float(self._areas.max()) * self._clocks(self._old, self._mean_voidage)[2]
        self._project(self._old, self._rate, scale, self.tolerance, fresh=True)
        self.pressure[:] = kept

    def _block_masked_faces(self) -> None:
        """No flow through faces between an open and a solid cell."""
        if self.grid.solid is None:
            return
        solid = np.zeros(self.grid.padded_shape)
        self.grid.inner(solid)[:] = self.grid.solid
        self.boundaries.fill_cells(solid)
        for d in range(3):
            touching = np.maximum(solid, np.roll(solid, 1, axis=2 - d))
            self._old[d][touching > 0.0] = 0.0

    # ------------------------------------------------------------ checks

    def _pad(self, cells: Array) -> Array:
        padded = np.ones(self.grid.padded_shape)
        self.grid.inner(padded)[:] = cells
        self.boundaries.fill_cells(padded)
        return padded

    def _checked_voidage(self, voidage: Array | float) -> Array:
        given = np.where(self.grid.open, np.asarray(voidage, dtype=float), 1.0)
        if given.shape != self.grid.shape:
            raise InputError("voidage", np.shape(voidage), f"of shape (nz, ny, nx) = {self.grid.shape}")
        bad = ~((given > 0.0) & (given <= 1.0 + 1e-12))
        if bad.any():
            k, j, i = np.argwhere(bad)[0]
            raise InputError("voidage", float(given[k, j, i]), f"above 0 and at most 1; it is not in cell {(k, j, i)}")
        return given

    def _take_drag(self, coefficient: Array | None, momentum: Array | None, source: Array | None) -> None:
        """Copy the fields of the step into padded arrays."""
        grid = self.grid
        for name, field, target in (
            ("drag_coefficient", coefficient, self._drag),
            ("drag_momentum", momentum, self._drag_momentum),
            ("source", source, self._source),
        ):
            if field is None:
                if target.any():
                    target.fill(0.0)
                continue
            expected = grid.shape if target.ndim == 3 else (*grid.shape, 3)
            if np.shape(field) != expected:
                raise InputError(name, np.shape(field), f"of shape {expected}")
            if not np.isfinite(field).all() or name == "drag_coefficient" and np.min(field) < 0.0:
                raise InputError(name, None, "a number everywhere" + (", not negative" if target.ndim == 3 else ""))
            grid.inner(target)[:] = field if target.ndim == 3 else np.moveaxis(field, -1, 0)
            self.boundaries.fill_cells(target)

    def _closed_regions(self) -> np.ndarray | None:
        """Connected regions of open cells that no outlet touches, numbered from 1; None if there are none."""
        from scipy.ndimage import label

        grid = self.grid
        region, count = label(grid.open)
        links = np.arange(count + 1)

        def root(n: int) -> int:
            while links[n] != n:
                n = links[n]
            return n

        for axis in range(3):
            if self.boundaries.periodic[axis]:
                first, last = np.take(region, 0, 2 - axis), np.take(region, -1, 2 - axis)
                for a, b in {(int(a), int(b)) for a, b in zip(first.ravel(), last.ravel()) if a and b}:
                    links[root(a)] = root(b)
        region = np.array([root(n) for n in range(count + 1)])[region]
        for side in self.boundaries.sides:
            if side.outlet.any():
                touched = side.layer(region, -1 if side.high else 0)[side.outlet[LOW:-3, LOW:-3]]
                region[np.isin(region, touched)] = 0
        return region.astype(np.int64) if region.any() else None

    def _refuse_trapped_inflow(self) -> None:
        """Inflow needs somewhere to go."""
        net, gross = 0.0, 0.0
        for side in self.boundaries.sides:
            for number in side.moving_inlets:
                here = side.owner == number
                speed = self.boundaries.superficial(side, number, here, self.time, steady=True)[:, side.axis]
                net += float((speed * side.inward).sum() * self._areas[side.axis])
                gross += float(np.abs(speed).sum() * self._areas[side.axis])
        if not self.boundaries.has_outlet and abs(net) > 1e-9 * gross:
            raise InputError(
                "boundaries", None, "such that what flows in can leave",
                f"{net:.3g} m3/s enter and no side is an outlet; add Outlet() to one",
            )  # fmt: skip

    def _refuse_imbalance(self, scale: float) -> None:
        region = self._equation.closed_regions
        if region is None:
            return
        excess = np.bincount(region.ravel(), self._b.ravel())[1:]
        size = np.bincount(region.ravel(), np.abs(self._b).ravel())[1:]
        bad = np.abs(excess) > 1e-9 * size + 1e-9 * scale
        if bad.any():
            amount = float(excess[np.argmax(bad)])
            raise InputError(
                "boundaries", None, "such that inflow and change of voidage balance where no outlet is",
                f"{amount:.3g} m3/s too {'little' if amount > 0 else 'much'} fluid at t = {self.time:g} s; add Outlet()",
            )  # fmt: skip

    def _refuse_nonsense(self, velocity: Array) -> None:
        if np.isfinite(self._b.sum()):
            return
        bad = np.argwhere(~np.isfinite(self._b))
        k, j, i = bad[0] if bad.size else (0, 0, 0)
        x, y, z = (float(c.ravel()[n]) for c, n in zip(self.grid.centres(), (i, j, k)))
        raise RunFailed(
            f"fluid: velocity is no number at x, y, z = {x:g}, {y:g}, {z:g} m, t = {self.time:g} s; "
            f"the largest stable step here was {self.largest_step().step:.3g} s"
        )
