r"""Heat between particles and the fluid.

A particle of the temperature T, lumped, exchanges heat with the fluid of the temperature :math:`T_f` around it:

.. math:: m c\,\dot T = \pi d k\,Nu\,(T_f - T)

**Cells.** The fluid has a temperature in every cell (:mod:`cfddem.fluid.scalar`). Heat passes between both as momentum
does (:mod:`cfddem.coupling.transfer`): implicit on both sides, equal and opposite to round-off.

**Uniform.** The fluid has one temperature, held or of a bath. Over a step h the solution at a given temperature is
exact, with the conductance :math:`b^* = m c (1 - e^{-h \pi d k Nu / m c}) / h`. The new temperature of a bath stands
on the right: implicit, so that no step passes the common temperature.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cfddem.backend.portions import Portions
from cfddem.case.column_grid import brought_in
from cfddem.case.schema import Case
from cfddem.coupling.transfer import ExchangeLaw, Transfer, memory_of
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.heat_keys import Heat
from cfddem.features.vapour import Vapour
from cfddem.fluid.block import in_portions
from cfddem.fluid.fields import CellField
from cfddem.fluid.scalar import Scalar, ScalarKind
from cfddem.fluid.solver import FluidSolver
from cfddem.model.fields import Field

RECEIVED = ("heat_from_fluid", "J")
"""Name and unit of the field with the heat that a particle received in the last step."""

LEAST = 1e-3
"""Change of the temperature of particles and fluid below which no heat counts as exchanged [K]."""

OF_FLUID = CellField("temperature", "K", "temperature of the fluid")


def mean_temperature(feature: Any, simulation: Any) -> float:
    """Mean temperature of the particles, by their heat capacity [K].

    feature  that has the method `capacity`
    """
    particles, total = simulation.owned, simulation.communicator.sum
    capacity = feature.capacity(particles)
    return float(total(capacity * particles.temperature)) / max(float(total(capacity)), 1e-300)


def in_cells(case: Case) -> bool:
    """Whether the fluid of a case with `[heat]` has a temperature in every cell."""
    keys = Heat.of(case)
    return keys is not None and keys.in_cells(case)


def is_warmed(case: Case) -> bool:
    """Whether drops of a spray have a temperature."""
    keys = Heat.of(case)
    return keys is not None and bool(keys.spray_temperature)


class HeatExchange(CaseFeature):
    """Temperature of the particles and of the fluid, and the heat between them.

    cells              temperature of the fluid in every cell; None if it is uniform
    fluid_temperature  of all the fluid, where it is uniform [K]
    given              heat given to the particles by the fluid [J]
    scale              heat exchanged, without sign [J]
    sprayed            heat that drops of the spray have brought [J]
    other              change of the heat in the particles between exchanges: by feeds, outlets and a user [J]
    last               heat in the particles after the last exchange, from their state [J]
    around             temperature of the fluid around every particle in the last exchange (N,) [K]
    humidity           mass fraction of the vapour there, before its step, in a case with [vapour] (N,) [-]
    response           by how much a sink of 1 W, over the step of the last exchange, cools every particle (N,) [K/W];
                       less than the step over its capacity where the fluid gives heat within the step
    """

    name, table = "heat", "heat"
    kept = ("fluid_temperature", "given", "scale", "start", "other", "last", "sprayed")
    measures = (
        Measured("mean_temperature", "K", "measure", "mean temperature of the particles, by heat capacity",
                 mean_temperature),
        Measured("fluid_temperature", "K", "recorded", "mean temperature of the fluid",
                 lambda heat, _: heat.cells.mean if heat.cells else heat.fluid_temperature),
        Measured("heat_received", "J", "recorded", "heat that the particles have received from the fluid",
                 lambda heat, _: heat.given),
        Measured("outlet_temperature", "K", "measure", "mean temperature of the fluid that leaves",
                 lambda heat, _: heat.cells.leaving, lambda case: in_cells(case) and case.column.ends == "flow"),
        Measured("heat_in", "J", "recorded", "heat that the fluid has brought in, above its temperature at the start",
                 lambda heat, _: heat.cells.sums["inflow"], in_cells),
        Measured("heat_out", "J", "recorded",
                 "heat that the fluid has carried out, above its temperature at the start",
                 lambda heat, _: heat.cells.sums["outflow"], in_cells),
        Measured("heat_from_walls", "J", "recorded", "heat that the fluid has received from walls",
                 lambda heat, _: heat.cells.sums["walls"], in_cells),
        Measured("heat_stored", "J", "recorded", "change of the heat in fluid and particles since the start",
                 lambda heat, simulation: heat.cells.content + heat.stored(simulation.owned) - heat.start, in_cells),
        Measured("heat_from_spray", "J", "recorded",
                 "heat that drops of the spray have brought to the particles, negative where they are colder",
                 lambda heat, _: heat.sprayed, is_warmed),
        Measured("heat_imbalance", "1", "imbalance",
                 "change of heat in the particles that the fluid did not give, or in the fluid that nothing gave, over "
                 "that exchanged", lambda heat, _: heat.imbalance),
        Measured("heat_out_of_range_count", "1", "recorded",
                 "how often the law of heat transfer was evaluated outside of its range so far",
                 lambda heat, _: heat.communicator.sum([heat.law.outside])),
    )  # fmt: skip

    def __init__(self, case: Case, simulation: Any) -> None:
        keys = Heat.of(case)
        law = case.laws.heat_law
        assert keys is not None and law is not None
        self.keys, self.capacities, self.law = keys, keys.capacities(case), ExchangeLaw(law)
        self.fluid_temperature, self.given = keys.fluid_temperature, 0.0
        self.communicator, self.humid = simulation.communicator, Vapour.is_in(case)
        self.cells: Scalar | None = None
        if keys.in_cells(case):
            fluid, kernel = simulation.fluid, simulation.coupling.kernel
            of_volume = fluid.density * keys.fluid_heat_capacity
            kind = ScalarKind(
                OF_FLUID.name, OF_FLUID.unit, OF_FLUID.meaning, keys.fluid_temperature, of_volume, keys.conductivity,
                keys.effective_conductivity,
            )  # fmt: skip
            inflow = brought_in(case, keys.gas_temperature, keys.patch_temperature)
            self.cells = Scalar(fluid, kind, replace(keys.sides_of(case), inflow=inflow))
            self.transfer = Transfer(kernel, "temperature", RECEIVED, lambda particles: self._capacity)
            if keys.buoyancy != "none":
                fluid.body_forces.append(lambda: self.buoyancy(fluid))
        self._capacity = self.capacity(simulation.owned)
        self.start = self.stored(simulation.owned)
        self.scale, self.other, self.last, self.sprayed = 0.0, 0.0, self.start, 0.0
        self.around, self.response = np.full(simulation.owned.count, self.fluid_temperature), np.zeros(0)
        self.humidity = np.zeros(0)

    @classmethod
    def fields_of(cls, case: Case) -> tuple[Field, ...]:
        """The temperature, which snapshots contain."""
        keys = Heat.of(case)
        assert keys is not None
        own = Field("temperature", "K", initial=keys.particle_temperature, snapshot=True, meaning="temperature")
        return (own, *memory_of(own, RECEIVED)) if keys.in_cells(case) else (own,)

    @classmethod
    def cell_fields_of(cls, case: Case) -> tuple[CellField, ...]:
        """The temperature of the fluid."""
        return (OF_FLUID,) if in_cells(case) else ()

    @property
    def imbalance(self) -> float:
        """Change of heat in the particles that the fluid did not give, or in the fluid that nothing gave, over that
        exchanged, at least the heat of a thousandth of a kelvin [-]."""
        wrong, scale = abs(self.last - self.start - self.other - self.given), self.scale
        if self.cells is not None:
            sums = self.cells.sums
            brought = sums["inflow"] - sums["outflow"] + sums["walls"] + sums["displaced"] - self.given
            wrong = max(wrong, abs(self.cells.content - brought))
            scale += abs(sums["inflow"]) + abs(sums["walls"])
        capacity = float(self.communicator.sum(self._capacity)) + (self.cells.capacity if self.cells else 0.0)
        return wrong / max(scale, LEAST * capacity)

    def capacity(self, particles: Any) -> np.ndarray:
        """Heat capacity of every particle (N,) [J/K]."""
        return np.asarray(particles.mass * self.capacities[particles.material])

    def stored(self, particles: Any) -> float:
        """Heat in all particles, above the temperature of new ones [J]."""
        return float(self.communicator.sum(self._above(particles, self.capacity(particles))))

    def _above(self, particles: Any, capacity: np.ndarray) -> np.ndarray:
        """Heat in every particle, above the temperature of new ones (N,) [J]."""
        return np.asarray(capacity * (particles.temperature - self.keys.particle_temperature))

    def buoyancy(self, fluid: FluidSolver) -> np.ndarray:
        """Weight that warm fluid lacks, per volume of the cell (nz, ny, nx, 3) [N/m3]."""
        assert self.cells is not None
        keys, above = self.keys, self.cells.value - self.keys.fluid_temperature
        lighter = fluid.density * keys.expansion_coefficient * above * fluid.voidage * fluid.open_cells
        return np.asarray(-lighter[..., None] * fluid.gravity)

    def mix_in(self, particles: Any, volume: np.ndarray) -> None:
        """Bring every particle to the common temperature of it and of the drops that land on it, volume (N,) [m3].

        Films have no heat capacity of their own: from then on the liquid counts as having that of the particle.
        """
        capacity, brought = self.capacity(particles), volume * self.keys.spray_heat_capacity
        common = brought / (capacity + brought) * ((self.keys.spray_temperature or 0.0) - particles.temperature)
        particles.temperature += common
        self.sprayed += float(self.communicator.sum(capacity * common))

    def conductance(self, terms: Any) -> np.ndarray:
        """Conductance between every particle and the fluid (N,) [W/K]."""
        particles, k = terms.particles, self.keys.conductivity
        numbers = self.law.numbers(terms.flow, particles.viscosity * (self.keys.fluid_heat_capacity / k))
        return np.asarray(2.0 * math.pi * particles.radius * k * numbers)

    def before(self, simulation: Any, step: float) -> None:
        """Exchange heat over the step [s], at the slip of the coupling."""
        particles, total = simulation.owned, self.communicator.sum
        self._capacity = capacity = self.capacity(particles)  # of the whole step
        before = self._above(particles, capacity)
        terms = simulation.terms
        if self.cells is None:
            received = self._from_uniform(particles, capacity, self.conductance(terms), step)
        else:
            received = self._from_cells(self.cells, simulation, step)
            self.response = step / capacity
        particles.temperature += received / capacity
        after = self._above(particles, capacity)
        exchanged, scale, heat_before, heat_after = total([received, np.abs(received), before, after], axis=1).tolist()
        self.given += exchanged
        self.scale += scale
        self.other += heat_before - self.last
        self.last = heat_after

    def _from_uniform(self, particles: Any, capacity: np.ndarray, conductance: np.ndarray, step: float) -> np.ndarray:
        """Heat that every particle receives from a fluid of one temperature (N,) [J]."""
        total, exchanged = self.communicator.sum, capacity * -np.expm1(-step * conductance / capacity)
        if bath := self.keys.fluid_total_capacity:
            brought = float(total(exchanged * (particles.temperature - self.fluid_temperature)))
            self.fluid_temperature += brought / (bath + float(total(exchanged)))
        self.around, self.response = (
            np.full(particles.count, self.fluid_temperature),
            exchanged / capacity / conductance,
        )
        return np.asarray(exchanged * (self.fluid_temperature - particles.temperature))

    def _from_cells(self, cells: Scalar, simulation: Any, step: float) -> np.ndarray:
        """Heat that every particle receives from the cells around (N,) [J]; the cells make their step.

        Other heat of the particles, by contacts or evaporation, has been added to their temperatures before.
        """
        particles, terms = simulation.owned, simulation.terms
        kernel, cell_map = self.transfer.kernel, terms.cell_map
        self.transfer.last_step = 0.0
        sent = self.transfer.prepare(particles, cell_map, self.conductance(terms), step)
        temperatures = cells.step(sent.cell_conductance, sent.cell_product[..., 0])
        humid = [simulation.feature(Vapour).cells.value] if self.humid else []
        fields = np.stack([np.ones_like(temperatures), temperatures, *humid])
        gathered = kernel.sample(cell_map.stencil, cell_map.radius, fields)
        rate = self.transfer.receive(particles, sent, gathered)[:, 0]
        self.around, self.humidity = particles.temperature + rate / sent.implicit[:, 0], gathered[:, -1]
        return np.asarray(step * rate)

    def cells_for_snapshot(self) -> Mapping[str, np.ndarray | Portions]:
        """The temperature of the fluid in the cells of all ranks."""
        return {} if self.cells is None else {OF_FLUID.name: in_portions(self.cells.grid, self.cells.value, 0)}

    def checkpoint(self) -> dict[str, Any]:
        """The temperature of the fluid and the balance."""
        state = super().checkpoint() | {"outside": self.communicator.sum([self.law.outside])}
        return state if self.cells is None else state | {"cells": self.cells.checkpoint()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        super().restore(state)
        self.law.outside = int(state["outside"]) if self.communicator.rank == 0 else 0
        if self.cells is not None:
            self.cells.restore(state["cells"])
