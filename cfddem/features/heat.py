r"""Heat between particles and a fluid of one temperature.

A particle of the temperature T, lumped, exchanges heat with the fluid of the temperature :math:`T_f`:

.. math:: m c\,\dot T = \pi d k\,Nu\,(T_f - T)

Over a step h the solution at a given fluid temperature is exact, with the conductance :math:`b^* = m c (1 - e^{-h
\pi d k Nu / m c}) / h`. Where the fluid has a finite heat capacity, its new temperature stands on the right: implicit,
so that no step passes the common temperature, and what the fluid gives is what the particles receive.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cfddem.case.schema import Case
from cfddem.data.fields import Field
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.heat_keys import Heat
from closures.heat_transfer import ranz_marshall

nusselt_numbers = np.vectorize(ranz_marshall, otypes=[float])


class HeatExchange(CaseFeature):
    """Temperature of the particles, and the heat that the fluid gives them.

    fluid_temperature  now [K]
    given              heat given by the fluid [J]
    scale              heat exchanged, without sign [J]
    other              change of the heat in the particles between exchanges: by feeds, outlets and a user [J]
    last               heat in the particles after the last exchange, from their state [J]
    """

    name = "heat"

    def __init__(self, case: Case, simulation: Any) -> None:
        keys = Heat.of(case)
        assert keys is not None
        self.keys, self.fluid, self.capacities = keys, case.required_fluid, keys.capacities(case)
        self.fluid_temperature, self.given = keys.fluid_temperature, 0.0
        self.communicator = simulation.communicator
        self.start = self.stored(simulation.owned)
        self.scale, self.other, self.last = 0.0, 0.0, self.start

    @classmethod
    def is_in(cls, case: Case) -> bool:
        """Whether the case has the table."""
        return Heat.of(case) is not None

    @classmethod
    def fields_of(cls, case: Case) -> tuple[Field, ...]:
        """The temperature, which snapshots contain."""
        keys = Heat.of(case)
        assert keys is not None
        return (Field("temperature", "K", initial=keys.particle_temperature, snapshot=True, meaning="temperature"),)

    @classmethod
    def measures(cls, case: Case) -> tuple[Measured, ...]:
        """Temperatures and heat."""
        return (
            Measured("K", "measure", mean_temperature),
            Measured("K", "recorded", fluid_temperature),
            Measured("J", "recorded", heat_received),
            Measured("1", "imbalance", heat_imbalance),
        )

    def capacity(self, particles: Any) -> np.ndarray:
        """Heat capacity of every particle (N,) [J/K]."""
        return np.asarray(particles.mass * self.capacities[particles.material])

    def stored(self, particles: Any) -> float:
        """Heat in all particles, above the temperature of new ones [J]."""
        above = particles.temperature - self.keys.particle_temperature
        return float(self.communicator.sum(self.capacity(particles) * above))

    def conductance(self, terms: Any) -> np.ndarray:
        """Conductance between every particle and the fluid (N,) [W/K]."""
        particles, k = terms.particles, self.keys.conductivity
        slip = np.linalg.norm(terms.flow.slip, axis=1)
        reynolds = self.fluid.density * slip * 2.0 * particles.radius / particles.viscosity
        nusselt = nusselt_numbers(reynolds, particles.viscosity * self.keys.fluid_heat_capacity / k)
        return np.asarray(2.0 * math.pi * particles.radius * k * nusselt)

    def before(self, simulation: Any, step: float) -> None:
        """Exchange heat over the step [s], at the slip of the coupling."""
        particles, total = simulation.owned, self.communicator.sum
        capacity = self.capacity(particles)
        share = -np.expm1(-step * self.conductance(simulation.terms) / capacity)
        exchanged, bath = capacity * share, self.keys.fluid_total_capacity
        if bath is not None:
            brought = float(total(exchanged * (particles.temperature - self.fluid_temperature)))
            self.fluid_temperature += brought / (bath + float(total(exchanged)))
        received = exchanged * (self.fluid_temperature - particles.temperature)
        self.given += float(total(received))
        self.scale += float(total(np.abs(received)))
        self.other += self.stored(particles) - self.last
        particles.temperature += share * (self.fluid_temperature - particles.temperature)
        self.last = self.stored(particles)

    def checkpoint(self) -> dict[str, Any]:
        """The fluid's temperature and the balance."""
        return {name: getattr(self, name) for name in _KEPT}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        for name in _KEPT:
            setattr(self, name, float(state[name]))


_KEPT = ("fluid_temperature", "given", "scale", "start", "other", "last")


def mean_temperature(simulation: Any) -> float:
    """Mean temperature of the particles, by heat capacity."""
    heat, particles, total = simulation.feature(HeatExchange), simulation.owned, simulation.communicator.sum
    capacity = heat.capacity(particles)
    return float(total(capacity * particles.temperature)) / max(float(total(capacity)), 1e-300)


def fluid_temperature(simulation: Any) -> float:
    """Temperature of the fluid."""
    return float(simulation.feature(HeatExchange).fluid_temperature)


def heat_received(simulation: Any) -> float:
    """Heat that the particles have received from the fluid."""
    return float(simulation.feature(HeatExchange).given)


def heat_imbalance(simulation: Any) -> float:
    """Change of the heat in the particles that the fluid did not give, over the heat exchanged."""
    heat = simulation.feature(HeatExchange)
    change = heat.last - heat.start - heat.other
    return abs(change - heat.given) / heat.scale if heat.scale > 0.0 else 0.0
