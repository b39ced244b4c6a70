"""Choice of the time steps of a run: the fluid step, and the particle steps within it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import RunFailed
from cfddem.fluid.solver import FluidSolver
from cfddem.fluid.step_limit import COURANT, courant_step, crossing_rate, fluid_step_limits
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.time_scales import check_step

CHECK_EVERY = 20
"""Fluid steps between two evaluations of the particles' time scales."""

SLACK = 1e-6
"""Part by which a step may exceed its limit. Time is summed with rounding; without slack the number of fluid steps
up to a row of history would occasionally change by one."""


@dataclass(frozen=True)
class StepSettings:
    """What limits the steps of a run beside its present state.

    reference_speed  highest collision speed to expect [m/s]
    particle_step    of the particles; recommended by their time scales if None [s]
    fluid_step       longest fluid step; None for no limit of this kind [s]
    fastest_inflow   highest inlet velocity to come [m/s]
    """

    reference_speed: float
    particle_step: float | None = None
    fluid_step: float | None = None
    fastest_inflow: float = 0.0


class TimeSteps:
    """Chooses every step of a run.

    settings         what limits the steps
    particle_solver  its stiffness and speeds limit the particle step
    fluid            limits the fluid step; None without a fluid
    particle_step    of an earlier part of the run; evaluated if None [s]
    communicator     path to sums, extremes and decisions over all ranks
    features         gives the longest steps that features allow, by criterion [s]

    limiting  criterion of the last fluid step
    """

    def __init__(
        self,
        settings: StepSettings,
        particle_solver: ParticleSolver,
        fluid: FluidSolver | None,
        particle_step: float | None = None,
        communicator: Communicator = SERIAL,
        features: Callable[[], dict[str, float]] = dict,
    ) -> None:
        self.features = features
        self.settings, self.particle_solver, self.fluid = settings, particle_solver, fluid
        self.communicator = communicator
        self.particle_step = self._largest_particle_step() if particle_step is None else particle_step
        self.limiting = ""

    def choose(self, until: float, steps: int) -> tuple[float, int]:
        """Length of the next fluid step [s], and the number of particle steps in it.

        until  output time that must coincide with the end of a step [s]
        steps  number of fluid steps made so far
        """
        if steps % CHECK_EVERY == 0 and steps > 0:
            self.particle_step = min(self._largest_particle_step(), self.particle_step)
        limits = fluid_step_limits(self.particle_step, self.settings.fluid_step, self._flow_limits())
        self.limiting = min(limits, key=limits.__getitem__)
        largest, time = limits[self.limiting], self.particle_solver.time
        left = until - time
        step = largest if math.isinf(left) else left / max(1, math.ceil(left / largest * (1.0 - SLACK)))
        if not step > 1e-12 * time:
            raise RunFailed(
                f"the fluid step has fallen to {step:.3g} s at t = {time:.6g} s ({self.limiting}): the run has "
                "diverged; take larger cells, a smaller run.fluid_step, or a wider laws.kernel_width"
            )
        return step, max(1, math.ceil(step / self.particle_step * (1.0 - 2.0 * SLACK)))

    def _largest_particle_step(self) -> float:
        """Step of the particles: given, or recommended by their time scales [s]; infinite where none can move."""
        if not self.communicator.any(self.particle_solver.particles.inverse_mass > 0.0):
            return math.inf
        scales = self.particle_solver.time_scales(self.settings.reference_speed)
        step = self.settings.particle_step or scales.recommended
        check_step(step, scales)
        return step

    def _flow_limits(self) -> dict[str, float]:
        """Limits of the fluid step by fluid, inlet and moving particles [s]."""
        limits = self.features()
        if self.fluid is None:
            return limits
        spacing, flow = self.fluid.grid.spacing, self.fluid.largest_step(COURANT)
        crossing = crossing_rate(self.particle_solver.particles.velocity, spacing, self.communicator)
        return limits | {
            flow.criterion: flow.step,
            "inlet Courant": courant_step(self.settings.fastest_inflow, spacing),
            "particle Courant": COURANT / max(crossing, 1e-300),
        }
