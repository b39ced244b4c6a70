"""The energy ledger: stored energy, energy gained and lost, and the remainder.

Gains and losses are the work of each force, counted as the force acts. Stored energy is computed from the state,
independently. The remainder is the change of the stored energy that gains and losses do not explain.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cfddem.case.schema import Case
from cfddem.coupling.coupling import Coupling
from cfddem.coupling.terms import LINES, CouplingTerms
from cfddem.features.case_feature import CaseFeature
from cfddem.fluid import budgets
from cfddem.fluid.grid import Array
from cfddem.io.quantities import Quantity
from cfddem.model.fields import Field
from cfddem.particles.energy_count import EVERY_CHANNEL, Energies
from cfddem.particles.state import Particles, added_mass_energy, kinetic_energy

STORED = {
    "kinetic": "of the particles' motion",
    "potential": "of the particles' weight, less buoyancy",
    "normal_springs": "of normal springs",
    "tangential_springs": "of tangential springs",
    "bridges": "of the pull of liquid bridges, from contact",
    "bonds": "of solid bonds",
    "fluid_kinetic": "of the fluid's motion",
    "added_mass": "of the fluid that moves with the particles, the added mass",
    "deferred_momentum": "that the pressure has given to particles and the fluid loses in the next two steps",
}
"""Forms of stored energy; a line of the ledger is the change since the start."""

GAINED = {
    "inflow": "brought in at inlets and outlets",
    "driving": "by the mean pressure gradient of periodic sides",
    "walls": "by moving walls",
    "stiffening": "by tangential springs whose stiffness changes with the overlap",
    "bridges_formed": "where liquid bridges form at a gap",
    "fed": "by inserted particles, less that of removed ones",
    "external": "by forces from outside, and of a user",
    "agitation": "by the fluctuating forces of the flow around neighbours, which moves particles at random",
    "model_b": "by the pressure on the volume of the particles, which model B gives to the fluid",
}
"""Energy gained; a negative line is a loss."""

LOST = {
    "drag": "by drag, at the slip of the particles, wall drag included",
    "history": "to the fluid by the history force",
    "drag_in_cells": "by drag, in velocity differences within the kernel and the cell",
    "pressure_in_cells": "where the pressure gradient at the particles differs from that of the cells",
    "implicit_drag": "by the implicit drag step",
    "viscous": "by viscous stress",
    "convection": "by the convection scheme",
    "lift_and_added_mass": "by lift, viscous stress and added mass, between the phases",
    "torque": "by the torque of the fluid on spin",
    "film": "by films",
    "film_shear": "by films to sliding and rolling",
    "bridge": "by the resistance of liquid bridges",
    "bridges_broken": "where liquid bridges break",
    "bridges_dried": "as liquid bridges dry",
    "bond_damping": "by the dashpots of solid bonds",
    "bonds_broken": "where solid bonds break",
    "contact_damping": "by the dashpots of contacts",
    "hysteresis": "by the contact law, to plastic deformation",
    "friction": "by sliding",
    "rolling": "by rolling resistance",
}
"""Energy lost."""

PASSED = {
    "drag_from_fluid": "by the fluid to drag",
    "drag_to_particles": "by drag to the particles",
    "pressure_from_fluid": "by the pressure of the fluid that moves the volume of particles",
    "pressure_to_particles": "by the pressure to the particles",
}
"""Energy that passes between the phases; the difference of two lines is lost."""

_OF_FLUID = {
    "fluid_kinetic", "added_mass", "deferred_momentum", "inflow", "driving", "agitation", "model_b", "drag", "history",
    "drag_in_cells", "pressure_in_cells", "implicit_drag", "viscous", "convection", "lift_and_added_mass", "torque",
    *PASSED,
}  # fmt: skip
"""Lines of runs with a fluid. `hysteresis` and `history` are lines of runs that have them."""

FIELDS = {
    **{f"energy_{name}": ("J", f"energy {text}, since the start") for name, text in STORED.items()},
    **{f"energy_{name}": ("J", f"energy gained {text}") for name, text in GAINED.items()},
    **{f"energy_{name}": ("J", f"energy lost {text}") for name, text in LOST.items()},
    **{f"energy_{name}": ("J", f"energy given {text}") for name, text in PASSED.items()},
    "energy_put_in": ("J", "energy at the start in motion and springs, gained since then, and lost by falling"),
    "energy_remainder": ("J", "change of the stored energy that gains and losses do not explain"),
}
"""Columns of history."""


_GROUPS = {
    f"energy_{name}": group
    for group, names in {"stored": STORED, "gained": GAINED, "lost": LOST, "exchanged": PASSED}.items()
    for name in names
}


class EnergyLedger(CaseFeature):
    """Sums the energy of a simulation: every force returns its work, and the ledger adds it to a line."""

    name = "energies"

    def __init__(self, case: Case, simulation: Any) -> None:
        self.simulation, self.particle_solver = simulation, simulation.particle_solver
        self._count: Energies = self.particle_solver.feature(Energies)
        self._acted_on = simulation.is_acted_on  # whether the line of forces from outside is shown
        particles, has_fluid = self.particle_solver.particles, simulation.has_fluid
        self._work = CouplingWork(particles, simulation.coupling) if has_fluid else None
        self._recent = (0.0, 0.0)  # work of the pressure on the displaced volume in the last two fluid steps [J]
        self.sums = dict.fromkeys([*GAINED, *LOST, *PASSED, "fallen"], 0.0)
        self.start = self._stored()

    @classmethod
    def is_in(cls, case: Case) -> bool:
        """Whether the case asks for the budget."""
        return case.run.energy_budget

    @classmethod
    def columns(cls, case: Case) -> Mapping[str, Quantity]:
        """A column for each line of the ledger."""
        return {
            name: Quantity(unit, meaning, f"energy: {_GROUPS.get(name, 'balance')}")
            for name, (unit, meaning) in FIELDS.items()
        }

    def values(self, simulation: Any) -> Mapping[str, float]:
        """The ledger now [J]."""
        return self.row()

    def before(self, simulation: Any, step: float) -> None:
        """Add the work on the fluid, which has made its step."""
        if self._work is not None:
            self.after_fluid_step(simulation.terms)

    def after(self, simulation: Any) -> None:
        """Add the work of the fluid on the particles, which have made their steps."""
        self.after_particle_steps()

    def after_fluid_step(self, terms: CouplingTerms) -> None:
        """Add the work on the fluid, after `Coupling.apply` and before the particles move."""
        assert self._work is not None
        fluid, sums = self.simulation.fluid, self.sums
        done = budgets.works(fluid)
        sums["inflow"] += done.inflow + done.inlet_drag
        sums["driving"] += done.driving
        sums["model_b"] += done.model_b + (done.solids if fluid.model == "B" else 0.0)
        sums["viscous"] -= done.viscous
        sums["convection"] -= done.convection
        sums["implicit_drag"] -= done.implicit
        sums["drag_in_cells"] -= done.drag - done.inlet_drag
        sums["lift_and_added_mass"] -= done.source
        sums["torque"] -= terms.spin_work
        sums["drag_from_fluid"] -= done.drag - done.inlet_drag + done.implicit
        sums["pressure_from_fluid"] -= done.solids
        self._work.begin(terms)

    def after_particle_steps(self) -> None:
        """Add the work of the fluid on the particles."""
        sums, owned = self.sums, self.particle_solver.particles.without_ghosts()
        if self._work is None:
            sums["external"] += self.particle_solver.communicator.sum(owned.applied * owned.work_displacement)
            return
        done, on_fluid = self._work.end(owned), self._work.on_fluid
        work = done.of_line
        sums["external"] += work["external"] + on_fluid.external
        agitation = done.fluctuating - on_fluid.of_fluctuation
        sums["agitation"] += agitation + work["agitation"]
        sums["drag"] += on_fluid.drag + on_fluid.explicit_drag - work["drag"] + agitation
        sums["drag_from_fluid"] += on_fluid.explicit_history + on_fluid.explicit_drag
        sums["drag_to_particles"] += work["drag"] + work["history"]
        sums["drag_in_cells"] -= on_fluid.drag + on_fluid.history
        sums["history"] += on_fluid.history + on_fluid.explicit_history - work["history"]
        sums["lift_and_added_mass"] -= work["explicit"] + done.added
        sums["lift_and_added_mass"] -= on_fluid.explicit_history + on_fluid.explicit_drag
        sums["lift_and_added_mass"] += on_fluid.external  # not between the phases
        sums["fallen"] += done.weight
        sums["driving"] += done.driving
        sums["pressure_to_particles"] += done.pressure
        sums["pressure_in_cells"] += done.displaced - done.pressure
        self._recent = (done.displaced, self._recent[0])

    def row(self) -> dict[str, float]:
        """The ledger now: a value for each column of `FIELDS` that applies to the run [J]."""
        stored, sums = self._stored(), self._totals()
        lines = {name: stored[name] - self.start[name] for name in stored}
        absent = set() if self.simulation.has_fluid else set(_OF_FLUID)
        if not self._acted_on() and sums["external"] == 0.0:
            absent.add("external")
        if self.particle_solver.laws.contact_law.lost is None:
            absent.add("hysteresis")
        absent |= {*EVERY_CHANNEL} - {*self._count.channels}
        absent |= {"history"} - {*self.simulation.forces.lines}
        names = [name for name in [*GAINED, *LOST, *PASSED] if name not in absent]
        lines |= {name: sums[name] for name in names}
        put_in = self.start["kinetic"] + self.start["normal_springs"] + self.start["tangential_springs"]
        put_in += self.start.get("bridges", 0.0) + self.start.get("bonds", 0.0)
        put_in += self.start.get("fluid_kinetic", 0.0) + max(-lines["potential"], 0.0)
        put_in += sum(max(lines[name], 0.0) for name in GAINED if name in lines)
        explained = sum(lines[name] for name in GAINED if name in lines)
        explained -= sum(lines[name] for name in LOST if name in lines)
        lines["put_in"] = put_in
        lines["remainder"] = sum(lines[name] for name in stored) - explained
        return {f"energy_{name}": value for name, value in lines.items()}

    def checkpoint(self) -> dict[str, Any]:
        """Sums so far, stored energy at the start, and recent pressure work."""
        return {
            "sums": dict(self.sums),
            "start": dict(self.start),
            "recent": list(self._recent),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.sums = {name: float(value) for name, value in state["sums"].items()}
        self.start = {name: float(value) for name, value in state["start"].items()}
        self._recent = (float(state["recent"][0]), float(state["recent"][1]))

    def _totals(self) -> dict[str, float]:
        """All sums, those of the particle solver included."""
        count, sums = self._count, dict(self.sums)
        for name, total in zip(count.channels, count.totals):
            if name in sums:
                sums[name] += float(total)
        sums["fed"] += count.fed
        return sums

    def _stored(self) -> dict[str, float]:
        """Stored energy now [J]; the potential energy is relative to the start."""
        particle_solver, count = self.particle_solver, self._count
        particles = particle_solver.particles
        forms = count.stored(particle_solver)
        fallen = self.sums["fallen"] + float(count.totals[count.channels.index("fall")])
        stored = {
            "kinetic": kinetic_energy(particles, particle_solver.communicator),
            "potential": -fallen,
            **forms,
        }
        if not self.simulation.has_fluid:
            return stored
        return stored | {
            "fluid_kinetic": budgets.kinetic_energy(self.simulation.fluid),
            "added_mass": added_mass_energy(particles, particle_solver.communicator),
            # the fluid has used the voidage before the last step and a half
            "deferred_momentum": -(self._recent[0] + 0.5 * self._recent[1]),
        }


# ---------------------------------------------------------------- work of the forces of the fluid
#
# Work of the fluid's forces on the particles over a fluid step.
#
# The forces are constant while the particles move. The work of each one is the force times the displacement of its
# particle, which the particle solver counts (`energies=True`).


FORCES = {
    line: Field(f"force_of_{line}", "N", 3, "scratch", meaning=f"force on the particle: {meaning}")
    for line, meaning in LINES.items()
}
FLUCTUATING = Field("force_of_fluctuation", "N", 3, "scratch", meaning="drag of the fluctuation of the fluid velocity")
PRESSURE = Field("pressure_before", "Pa", role="scratch", meaning="fluid pressure before the particles moved")


class ImplicitWork(NamedTuple):
    """Work of drag and history force in a fluid step at the velocity with which the fluid acts on every particle."""

    drag: float  # [J]
    fluctuating: Array  # drag of the fluctuation of the fluid velocity (N, 3) [N]
    of_fluctuation: float  # work of that part of the drag [J]
    history: float  # of the implicit part of the history force [J]
    explicit_history: float  # of the rest [J]
    explicit_drag: float  # of drag and its pressure, of which the fluid receives nothing in the step [J]
    external: float  # of forces from outside on the fluid [J]


class ParticleWork(NamedTuple):
    """Work on the particles in a fluid step [J]."""

    of_line: dict[str, float]  # of each line of `LINES`, without those that follow
    fluctuating: float  # part of the drag by the fluctuation of the fluid velocity
    added: float  # kinetic energy that a change of the added mass has given to the particles
    weight: float  # less buoyancy
    driving: float  # mean pressure gradient of periodic sides
    pressure: float  # all other pressure
    displaced: float  # of the cells' pressure on the volume that the particles displace


class CouplingWork:
    """Counts the work of the forces of a coupling.

    particles  get the fields that the count stores within a step
    coupling   the coupling
    on_fluid   work on the fluid in the last fluid step
    """

    def __init__(self, particles: Particles, coupling: Coupling) -> None:
        self.coupling = coupling
        for field in (*FORCES.values(), FLUCTUATING, PRESSURE):
            particles.declare(field)
        self.on_fluid = ImplicitWork(0.0, np.zeros(0), 0.0, 0.0, 0.0, 0.0, 0.0)
        self._added = 0.0
        self._pressure = np.zeros(0)  # of the cells (1, nz, ny, nx) [Pa]

    def begin(self, terms: CouplingTerms) -> None:
        """After `Coupling.apply`, before the particles move."""
        particles = terms.particles
        total = self.coupling.fluid.communicator.sum
        self._pressure = self.coupling.fluid.pressure[None].copy()
        self.on_fluid = self._implicit_work(particles, terms)
        particles[FLUCTUATING.name][:] = self.on_fluid.fluctuating
        self._added = total(0.5 * terms.added[:, None] * particles.velocity**2)
        for line, field in FORCES.items():
            particles[field.name][:] = terms.force(line)
        particles.pressure_before = self._pressure_at(particles)

    def end(self, particles: Particles) -> ParticleWork:
        """After the particles have moved."""
        fluid, total = self.coupling.fluid, self.coupling.fluid.communicator.sum
        model_a = float(fluid.model == "A")

        def work(line: str) -> float:
            return float(total(particles[FORCES[line].name] * particles.work_displacement))

        driving = model_a * particles.volume[:, None] * fluid.boundaries.driving
        rise = self._pressure_at(particles) - particles.pressure_before
        return ParticleWork(
            of_line={line: work(line) for line in LINES if line not in ("pressure", "weight")},
            fluctuating=total(particles[FLUCTUATING.name] * particles.work_displacement),
            added=self._added,
            weight=total(particles[FORCES["weight"].name] * particles.displacement),
            driving=total(driving * particles.work_displacement),
            pressure=total((particles[FORCES["pressure"].name] - driving) * particles.work_displacement),
            displaced=-total(model_a * particles.volume * rise),
        )

    def _implicit_work(self, particles: Particles, terms: CouplingTerms) -> ImplicitWork:
        """Work of drag and history force on the fluid, and of forces from outside."""
        kernel, fluid, received = self.coupling.kernel, self.coupling.fluid, particles.drag_impulse / terms.step
        cell_map, weight = terms.cell_map, np.moveaxis(fluid.drag_response()[0], -1, 0)
        gathered = kernel.sample(cell_map.stencil, cell_map.radius, weight)
        conductance = gathered * terms.implicit.implicit
        acting = terms.implicit.target + received / np.maximum(conductance, 1e-300)

        def work(force: Array) -> float:
            return terms.step * float(fluid.communicator.sum(force * acting))

        none = np.zeros_like(received)
        fluctuations = sum((terms.fluctuation_in_all(line) for line in terms.fluctuations), none)
        fluctuating = gathered * terms.implicit_force_at(fluctuations)
        return ImplicitWork(
            work(terms.implicit_force["drag"]), fluctuating, work(fluctuating),
            work(terms.implicit_force.get("history", none)), work(terms.explicit.get("history", none)),
            work(terms.explicit.get("drag", none)),
            self._external_work(terms),
        )  # fmt: skip

    def _external_work(self, terms: CouplingTerms) -> float:
        """Work of forces from outside on the fluid, at the mean of its velocity before and after the step."""
        if "external" not in terms.on_fluid:
            return 0.0
        kernel, fluid = self.coupling.kernel, self.coupling.fluid
        cell_map, mean = terms.cell_map, np.moveaxis(fluid.mean_velocity, -1, 0)
        velocity = kernel.sample(cell_map.stencil, cell_map.radius, mean)
        return terms.step * float(fluid.communicator.sum(terms.on_fluid["external"] * velocity))

    def _pressure_at(self, particles: Particles) -> Array:
        """Pressure at every particle, by the weights of the deposit (N,) [Pa]."""
        kernel, radius = self.coupling.kernel, particles.radius
        return kernel.sample(kernel.stencil(particles.position, radius), radius, self._pressure)[:, 0]
