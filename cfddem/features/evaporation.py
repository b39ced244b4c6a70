r"""Evaporation of the liquid of particles, and of drops, into humid air of one state.

.. math:: m c\,\dot T = \pi d k\,Nu\,(T_g - T) - L\,\dot m, \qquad
          \dot m = s\,\pi d\,Sh\,\rho D\,\ln\frac{1-Y}{1-Y_s(T)}

`[heat]` exchanges heat with the gas first. At a constant rate of evaporation in a gas of one temperature the particle
is then colder by :math:`L \dot m (1 - e^{-x}) / b`, with the conductance b and x = b h / (m c): exact. The rate is that
of the new temperature, so that a step that is far too long ends at the wet-bulb temperature. Where every cell of the
fluid has a temperature, the latent heat of a step cools the particle, and the cells warm it in the next.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.evaporation_keys import Evaporation
from cfddem.features.evaporation_loops import Air, Surfaces, evaporate
from cfddem.features.heat import HeatExchange
from cfddem.features.heat import fluid_temperature as temperature_of_gas
from cfddem.features.liquid import LiquidOnParticles
from closures.evaporation import vapour_fraction

SMALLEST = 1e-6
"""Radius of a drop that has evaporated [m]."""


class EvaporationOfLiquid(CaseFeature):
    """Water that leaves particles as vapour.

    mass  evaporated so far, less what condensed [kg]
    heat  latent heat taken so far [J]
    """

    name = "evaporation"

    def __init__(self, case: Case, simulation: Any) -> None:
        keys = Evaporation.of(case)
        assert keys
        self.keys, self.fluid, self.communicator = keys, case.required_fluid, simulation.communicator
        self.partial, self.diffusivity = keys.partial_pressure(case), keys.diffusivity_in(case)
        self.fraction = vapour_fraction(self.partial, keys.pressure)
        self.drops = np.array([name in keys.drops for name in case.material])
        self.mass, self.heat = 0.0, 0.0

    @classmethod
    def is_in(cls, case: Case) -> bool:
        """Whether the case has the table."""
        return bool(Evaporation.of(case))

    @classmethod
    def measures(cls, case: Case) -> tuple[Measured, ...]:
        """What evaporated, and the heat that it took."""
        return (Measured("kg", "recorded", evaporated_mass), Measured("J", "recorded", latent_heat_taken))

    def before(self, simulation: Any, step: float) -> None:
        """Evaporate over the step [s], after the exchange of heat with the gas."""
        particles, heat, keys = simulation.owned, simulation.feature(HeatExchange), self.keys
        gas, is_drop = temperature_of_gas(simulation), self.drops[particles.material]
        diameter = 2.0 * particles.radius
        density = self.fluid.density
        on_films = particles.liquid if "liquid" in particles else np.zeros(len(diameter))
        smallest = particles.density * (4.0 / 3.0 * math.pi * SMALLEST**3)
        drops = np.maximum(particles.mass - smallest, 0.0)
        surfaces = Surfaces(
            temperature=particles.temperature.copy(),
            diameter=diameter,
            sherwood=heat.law.numbers(simulation.terms.flow, particles.viscosity / (density * self.diffusivity)),
            film=np.where(is_drop, np.inf, on_films),
            conductance=np.zeros(len(diameter)) if heat.cells else heat.conductance(simulation.terms),
            capacity=heat.capacity(particles),
            mass=np.where(is_drop, drops, on_films * keys.liquid_density),
            heat=np.zeros(len(diameter)),
        )
        evaporate(surfaces, self._air(gas, density), step)
        lost = surfaces.mass
        particles.temperature[...] = surfaces.temperature
        self._remove(particles, lost, is_drop)
        self.mass += float(self.communicator.sum(lost))
        self.heat += float(self.communicator.sum(surfaces.heat))
        if "liquid" in particles:
            volume = np.where(is_drop, 0.0, lost / keys.liquid_density)
            simulation.feature(LiquidOnParticles).evaporated += float(self.communicator.sum(volume))

    def _air(self, temperature: float, density: float) -> Air:
        """The gas at a temperature [K] and density [kg/m3]."""
        return Air(
            temperature=temperature,
            pressure=self.keys.pressure,
            partial=self.partial,
            fraction=self.fraction,
            density=density,
            diffusivity=self.diffusivity,
            stefan=self.keys.rate == "stefan",
            full_thickness=self.keys.full_thickness,
        )

    def _remove(self, particles: Any, lost: np.ndarray, is_drop: np.ndarray) -> None:
        """Take the mass [kg] from films, and from drops, which shrink."""
        if "liquid" in particles:
            left = particles.liquid - np.where(is_drop, 0.0, lost / self.keys.liquid_density)
            particles.liquid[...] = np.where(left > 1e-12 * particles.liquid, left, 0.0)
        if is_drop.any():  # local: every rank has its own drops
            ratio = np.where(is_drop, 1.0 - lost / particles.mass, 1.0)
            particles.radius[...] *= np.cbrt(ratio)
            particles.inverse_mass[...] /= ratio
            particles.inverse_inertia[...] /= ratio ** (5.0 / 3.0)

    def checkpoint(self) -> dict[str, Any]:
        """What evaporated, and its heat."""
        return {"mass": self.mass, "heat": self.heat}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.mass, self.heat = float(state["mass"]), float(state["heat"])


def evaporated_mass(simulation: Any) -> float:
    """Mass of liquid that has evaporated, less what condensed."""
    return float(simulation.feature(EvaporationOfLiquid).mass)


def latent_heat_taken(simulation: Any) -> float:
    """Latent heat of the liquid that has evaporated."""
    return float(simulation.feature(EvaporationOfLiquid).heat)
