"""The energy ledger: what is stored, what came in, what was lost, and what is left over.

Work is counted force by force as it is done, stored energy is read from the state; neither knows of the other. What
the ledger does not explain is its remainder.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cfddem.coupling.exchange import Exchange, Offer
from cfddem.fluid.energies import face_volumes, works
from cfddem.fluid.energies import kinetic_energy as fluid_kinetic_energy
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.particles.energies import CHANNELS
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import kinetic_energy

STORED = {
    "kinetic": "of the particles' motion",
    "potential": "of the particles' weight, less buoyancy",
    "normal_springs": "of normal springs",
    "tangential_springs": "of tangential springs",
    "fluid_kinetic": "of the fluid's motion",
    "added_mass": "of the fluid that particles carry along",
    "under_way": "that the pressure has given to particles and the fluid loses when it sees their volume move",
}
"""What can hold energy; a line of the ledger is its change."""

GAINED = {
    "inflow": "brought in at inlets and outlets",
    "driving": "by the mean pressure gradient of periodic sides",
    "walls": "by moving walls",
    "stiffening": "by tangential springs whose stiffness changes with the overlap",
    "fed": "by particles put in, less that of those taken out",
    "model_b": "by the pressure on the volume of the particles, which model B gives to the fluid",
}
"""Where energy comes from; a negative line is a loss."""

LOST = {
    "drag": "by drag, at the slip that particles see",
    "drag_in_cells": "by drag, in the differences of velocity within a kernel and a cell",
    "pressure_in_cells": "where the gradient of the pressure that particles see is not that of its differences",
    "implicit_drag": "by the implicit step of drag",
    "viscous": "by viscous stress",
    "convection": "by the scheme of convection",
    "lift_and_added_mass": "between fluid and particles by lift, viscous stress and added mass",
    "torque": "by the torque of the fluid on spin",
    "film": "by films",
    "contact_damping": "by the dashpots of contacts",
    "friction": "by sliding",
    "rolling": "by rolling resistance",
}
"""Where energy goes."""

PASSED = {
    "drag_from_fluid": "by the fluid to drag",
    "drag_to_particles": "by drag to the particles",
    "pressure_from_fluid": "by the fluid where its pressure moves the volume of particles",
    "pressure_to_particles": "by the pressure to the particles",
}
"""What passes between the phases; lost is what one gives and the other does not get."""

_OF_FLUID = {
    *(
        "fluid_kinetic",
        "added_mass",
        "under_way",
        "inflow",
        "driving",
        "model_b",
        "drag",
        "drag_in_cells",
        "pressure_in_cells",
    ),
    *("implicit_drag", "viscous", "convection", "lift_and_added_mass", "torque"),
    *PASSED,
}

FIELDS = {
    **{f"energy_{name}": ("J", f"energy {text}, since the start") for name, text in STORED.items()},
    **{f"energy_{name}": ("J", f"energy gained {text}") for name, text in GAINED.items()},
    **{f"energy_{name}": ("J", f"energy lost {text}") for name, text in LOST.items()},
    **{f"energy_{name}": ("J", f"energy given {text}") for name, text in PASSED.items()},
    "energy_put_in": ("J", "energy at the start in motion and springs, gained since then, or fallen"),
    "energy_remainder": ("J", "energy that the ledger does not explain"),
}
"""Columns of history."""


class _Pending(NamedTuple):
    """What a fluid step does to particles, by id, until they have moved."""

    step: float  # [s]
    drag: Array  # (n, 3) [N]
    acting: Array  # (n, 3) velocity of the fluid with which the drag acts [m/s]
    weight: Array  # (n, 3) less buoyancy [N]
    aside: Array  # (n, 3) lift, viscous stress and added mass [N]
    driving: Array  # (n, 3) of the mean pressure gradient [N]
    volume: Array  # (n,) that the pressure acts on, none in model B [m3]
    pressure: Array  # (1, nz, ny, nx) smoothed as the particles' volume is [Pa]
    before: Array  # (n,) pressure where the particles were [Pa]


class EnergyLedger:
    """Counts the energy of a simulation.

    particles  solver that counts its own, `energies=True`
    fluid, exchange  of a run with a fluid
    gravity    (3,) [m/s2]
    """

    def __init__(
        self, particles: ParticleSolver, fluid: FluidSolver | None, exchange: Exchange | None, gravity: Array
    ) -> None:
        self.particles, self.fluid, self.exchange, self.gravity = particles, fluid, exchange, gravity
        self._volumes = np.zeros(0) if fluid is None else face_volumes(fluid)
        self._pending: _Pending | None = None
        self._recent = (0.0, 0.0)  # work of the pressure on what particles displaced in the last two fluid steps [J]
        self.sums = dict.fromkeys([*GAINED, *LOST, *PASSED, "fallen"], 0.0)
        self.start = self._stored()

    def fluid_has_moved(self, offer: Offer) -> None:
        """After a fluid step and its answer, before the particles move.

        offer  what the particles brought into the step
        """
        assert self.fluid is not None and self.exchange is not None
        bodies, fluid, sums = self.particles.bodies, self.fluid, self.sums
        done = works(fluid, self._volumes)
        sums["inflow"] += done.inflow + done.held
        sums["driving"] += done.driving
        sums["model_b"] += done.model_b + (done.solids if fluid.model == "B" else 0.0)
        sums["viscous"] -= done.viscous
        sums["convection"] -= done.convection
        sums["implicit_drag"] -= done.implicit
        sums["drag_in_cells"] -= done.drag - done.held
        sums["lift_and_added_mass"] -= done.source
        sums["torque"] -= self.exchange.spin_work
        sums["drag_from_fluid"] -= done.drag - done.held + done.implicit
        sums["pressure_from_fluid"] -= done.solids

        drag = self.exchange.drag_impulse / offer.step
        spreading = self.exchange.spreading
        weight = spreading.gather(offer.place.footprint, spreading.smooth(np.moveaxis(fluid.drag_exchange()[0], -1, 0)))
        acting = offer.target + drag / np.maximum(weight * offer.resistance[:, None], 1e-300)
        volume = bodies.volume[:, None]
        pressure = spreading.smooth(np.ascontiguousarray(fluid.pressure)[None])
        model_a = float(fluid.model == "A")
        self._pending = _Pending(
            step=offer.step,
            drag=bodies.by_id(drag),
            acting=bodies.by_id(acting),
            weight=bodies.by_id((bodies.mass[:, None] - fluid.density * volume) * self.gravity),
            aside=bodies.by_id(offer.explicit),
            driving=bodies.by_id(model_a * volume * fluid.boundaries.driving),
            volume=bodies.by_id(model_a * bodies.volume),
            pressure=pressure,
            before=self._pressure_at(pressure),
        )

    def particles_have_moved(self) -> None:
        """After the particles' steps."""
        count, pending, sums = self.particles.energies, self._pending, self.sums
        assert count is not None
        if pending is None:
            return
        way = count.way
        pressure = self._applied() - pending.drag - pending.weight - pending.aside - pending.driving
        by_drag = float((pending.drag * way).sum())
        carried = pending.step * float((pending.drag * pending.acting).sum())
        aside = float((pending.aside * way).sum())
        driven = float((pending.driving * way).sum())
        sums["drag"] += carried - by_drag
        sums["drag_to_particles"] += by_drag
        sums["drag_in_cells"] -= carried
        sums["lift_and_added_mass"] -= aside
        sums["fallen"] += float((pending.weight * count.path).sum())
        sums["driving"] += driven
        displaced = -float((pending.volume * (self._pressure_at(pending.pressure) - pending.before)).sum())
        by_pressure = float((pressure * way).sum())
        sums["pressure_to_particles"] += by_pressure
        sums["pressure_in_cells"] += displaced - by_pressure
        self._recent = (displaced, self._recent[0])
        self._pending = None

    def row(self) -> dict[str, float]:
        """The ledger now: a line for each column of `FIELDS` that the run can have [J]."""
        stored, sums = self._stored(), self._totals()
        lines = {name: stored[name] - self.start[name] for name in stored}
        names = [name for name in [*GAINED, *LOST, *PASSED] if self.fluid is not None or name not in _OF_FLUID]
        lines |= {name: sums[name] for name in names}
        put_in = self.start["kinetic"] + self.start["normal_springs"] + self.start["tangential_springs"]
        put_in += self.start.get("fluid_kinetic", 0.0) + max(-lines["potential"], 0.0)
        put_in += sum(max(lines[name], 0.0) for name in GAINED if name in lines)
        explained = sum(lines[name] for name in GAINED if name in lines)
        explained -= sum(lines[name] for name in LOST if name in lines)
        lines["put_in"] = put_in
        lines["remainder"] = sum(lines[name] for name in stored) - explained
        return {f"energy_{name}": value for name, value in lines.items()}

    def checkpoint(self) -> dict[str, Any]:
        """What has been counted, what was stored at the start, and what is under way."""
        return {
            "sums": dict(self.sums),
            "start": dict(self.start),
            "recent": list(self._recent),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a `checkpoint()`."""
        self.sums = {name: float(value) for name, value in state["sums"].items()}
        self.start = {name: float(value) for name, value in state["start"].items()}
        self._recent = (float(state["recent"][0]), float(state["recent"][1]))

    def _pressure_at(self, smoothed: Array) -> Array:
        """Pressure at every particle, by the weights with which its volume is spread; by id (n,) [Pa]."""
        assert self.exchange is not None
        spreading, bodies = self.exchange.spreading, self.particles.bodies
        seen = spreading.gather(spreading.footprint(bodies.position, bodies.radius), smoothed)
        return bodies.by_id(seen[:, 0])

    def _applied(self) -> Array:
        bodies = self.particles.bodies
        return bodies.by_id(bodies.applied)

    def _totals(self) -> dict[str, float]:
        """All lines that are counted."""
        count = self.particles.energies
        assert count is not None
        sums = dict(self.sums)
        for name, total in zip(CHANNELS, count.totals):
            if name in sums:
                sums[name] += float(total)
        sums["fed"] += count.fed
        return sums

    def _stored(self) -> dict[str, float]:
        """Energy that is stored now [J]; the potential one since the start."""
        particles, count = self.particles, self.particles.energies
        assert count is not None
        bodies = particles.bodies
        normal, tangential = count.springs(particles)
        fallen = self.sums["fallen"] + float(count.totals[CHANNELS.index("fall")])
        stored = {
            "kinetic": kinetic_energy(bodies),
            "potential": -fallen,
            "normal_springs": normal,
            "tangential_springs": tangential,
        }
        if self.fluid is None or self.exchange is None:
            return stored
        inertia = self.exchange.inertia(bodies)
        added = np.where(np.isfinite(inertia), inertia - bodies.mass, 0.0)
        return stored | {
            "fluid_kinetic": fluid_kinetic_energy(self.fluid, self._volumes),
            "added_mass": 0.5 * float((added[:, None] * bodies.velocity**2).sum()),
            # the voidage that the fluid has felt is that before the last step and a half
            "under_way": -(self._recent[0] + 0.5 * self._recent[1]),
        }
