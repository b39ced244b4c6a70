"""A case in time: the one place where particles, fluid and what lies between them are put together."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cfddem.assembly import assemble
from cfddem.case import Case
from cfddem.coupling.clocks import COURANT, MOST_SUBSTEPS, crossing_rate
from cfddem.errors import RunFailed
from cfddem.particles.clocks import check_step
from cfddem.particles.state import Bodies
from cfddem.record.energy import EnergyLedger

CLOCKS_EVERY = 20
"""Fluid steps between two readings of the particles' clocks."""

SLACK = 1e-6
"""By how much a step may be longer than its limit, relatively. Time is summed with rounding; without slack the number
of fluid steps up to a row of history would change by one now and then."""


class Simulation:
    """A run of a case.

    case      what is to be run
    progress  is told, in a line, what is being prepared
    """

    def __init__(self, case: Case, progress: Callable[[str], None] = lambda _: None) -> None:
        self.case = case
        parts = assemble(case, progress)
        self.particles, self.fluid, self.exchange = parts.particles, parts.fluid, parts.exchange
        self.gravity = np.array(case.laws.gravity)
        self.energy = self._ledger()
        self.steps = 0
        self.binding = ""
        self.wall = self.particles.wall
        self._particle_step = self._longest_particle_step()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.particles.time

    def step(self, until: float = math.inf) -> None:
        """Make one fluid step, with as many particle steps as it takes; `until` [s] is met exactly."""
        wall = self.wall
        wall.start()
        step, substeps = self._choose_steps(until)
        wall.lap("time steps")
        particles, bodies = self.particles, self.particles.bodies
        if self.fluid is not None and self.exchange is not None:
            offer = self.exchange.offer(bodies, step)
            wall.lap("voidage and drag")
            self.fluid.step(step, *offer.fields)
            wall.lap("fluid")
            self.exchange.answer(bodies, offer, self.gravity)
            wall.lap("forces of the fluid")
            if self.energy is not None:
                self.energy.fluid_has_moved(offer)
                wall.lap("energies")
        particles.advance(step / substeps, substeps)
        if self.energy is not None:
            self.energy.particles_have_moved()
        self.steps += 1

    def until(self, time: float) -> None:
        """Go on until a time [s]."""
        while self.time < time * (1.0 - 1e-12):
            self.step(time)

    # ------------------------------------------------------------ to stop, and to go on

    def checkpoint(self) -> dict[str, Any]:
        """Everything the next step depends on, to be kept and handed to `restored`."""
        parts: dict[str, Any] = {
            "steps": self.steps,
            "particle_step": self._particle_step,
            "particles": self.particles.checkpoint(),
        }
        if self.fluid is not None and self.exchange is not None:
            parts |= {"fluid": self.fluid.checkpoint(), "exchange": self.exchange.checkpoint()}
        if self.energy is not None:
            parts |= {"energy": self.energy.checkpoint()}
        return parts

    @classmethod
    def restored(cls, case: Case, state: dict[str, Any]) -> Simulation:
        """The simulation of a case as it was at a `checkpoint()`; it goes on to the same bits."""
        simulation = cls.__new__(cls)
        simulation.case, simulation.gravity = case, np.array(case.laws.gravity)
        parts = assemble(
            case, bodies=Bodies(**{name: np.array(each) for name, each in state["particles"]["bodies"].items()})
        )
        simulation.particles, simulation.fluid, simulation.exchange = parts.particles, parts.fluid, parts.exchange
        simulation.particles.restore(state["particles"])
        if simulation.fluid is not None and simulation.exchange is not None:
            simulation.fluid.restore(state["fluid"])
            simulation.exchange.restore(state["exchange"])
        simulation.energy = simulation._ledger()
        if simulation.energy is not None:
            simulation.energy.restore(state["energy"])
        simulation.steps, simulation._particle_step = int(state["steps"]), float(state["particle_step"])
        simulation.binding, simulation.wall = "", simulation.particles.wall
        return simulation

    def _ledger(self) -> EnergyLedger | None:
        """The energy ledger, where the case asks for one."""
        if not self.case.run.energy:
            return None
        return EnergyLedger(self.particles, self.fluid, self.exchange, self.gravity)

    # ------------------------------------------------------------ time steps

    def _longest_particle_step(self) -> float:
        """Step of the particles: given, or what their clocks recommend [s]."""
        if not (self.particles.bodies.inverse_mass > 0.0).any():
            return math.inf
        read = self.particles.clocks(self.case.reference_speed)
        step = self.case.run.step or read.recommended
        check_step(step, read)
        return step

    def _choose_steps(self, until: float) -> tuple[float, int]:
        """Length of the next fluid step [s], and how many particle steps it holds."""
        if self.steps % CLOCKS_EVERY == 0 and self.steps > 0:
            self._particle_step = min(self._longest_particle_step(), self._particle_step)
        limits = {"collision": MOST_SUBSTEPS * self._particle_step}
        if self.case.run.fluid_step is not None:
            limits["given"] = self.case.run.fluid_step
        if self.fluid is not None:
            fluid = self.fluid.largest_step(COURANT)
            limits[fluid.clock] = fluid.step
            limits["inlet Courant"] = COURANT * min(self.fluid.grid.spacing) / max(self.case.bed.inlet_speed, 1e-300)
            crossing = crossing_rate(self.particles.bodies.velocity, self.fluid.grid.spacing)
            limits["particle Courant"] = COURANT / max(crossing, 1e-300)
        self.binding = min(limits, key=limits.__getitem__)
        largest = limits[self.binding]
        left = until - self.time
        step = largest if math.isinf(left) else left / max(1, math.ceil(left / largest * (1.0 - SLACK)))
        if not step > 1e-12 * self.time:
            raise RunFailed(
                f"the fluid step has fallen to {step:.3g} s at t = {self.time:.6g} s ({self.binding}): the run has "
                "diverged; take larger cells, a smaller run.fluid_step, or a wider laws.smoothing"
            )
        return step, max(1, math.ceil(step / self._particle_step * (1.0 - 2.0 * SLACK)))
