r"""Evaporation of the liquid of particles, and of drops, into humid air of one state.

.. math:: m c\,\dot T = \pi d k\,Nu\,(T_g - T) - L\,\dot m, \qquad
          \dot m = s\,\pi d\,Sh\,\rho D\,\ln\frac{1-Y}{1-Y_s(T)}

`[heat]` exchanges heat with the gas first. At a constant rate of evaporation in a gas of one temperature the particle
is then colder by :math:`L \dot m (1 - e^{-x}) / b`, with the conductance b and x = b h / (m c): exact. The rate is that
of the new temperature, so that a step that is far too long ends at the wet-bulb temperature. Where every cell of the
fluid has a temperature, the latent heat of a step cools the particle, and the cells warm it in the next.

With `[vapour]` the cells take the vapour, implicitly: the rate falls as they fill. What a cell takes from a surface is
what the particle loses, with its latent heat.
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
from cfddem.features.liquid import LiquidOnParticles
from cfddem.features.vapour import Vapour
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
        self.diffusivity = keys.diffusivity_in(case)
        self.fraction = vapour_fraction(keys.partial_pressure(case), keys.pressure)
        self.gains = Vapour.is_in(case)
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
        is_drop, diameter, flow = self.drops[particles.material], 2.0 * particles.radius, simulation.terms.flow
        on_films = particles.liquid if "liquid" in particles else np.zeros(len(diameter))
        smallest = particles.density * (4.0 / 3.0 * math.pi * SMALLEST**3)
        drops, begin = np.maximum(particles.mass - smallest, 0.0), particles.temperature.copy()
        vapour = simulation.feature(Vapour) if self.gains else None
        surfaces = Surfaces(
            temperature=particles.temperature.copy(),
            diameter=diameter,
            sherwood=heat.law.numbers(flow, particles.viscosity / (self.fluid.density * self.diffusivity)),
            gas=heat.around,
            fraction=vapour.around(simulation) if vapour else np.full(len(diameter), self.fraction),
            film=np.where(is_drop, np.inf, on_films),
            response=heat.response,
            mass=np.where(is_drop, drops, on_films * keys.liquid_density),
            heat=np.zeros(len(diameter)),
            saturated=np.zeros(len(diameter)),
        )
        there = surfaces.mass.copy()
        air = Air(keys.pressure, self.fluid.density, self.diffusivity, keys.rate == "stefan", keys.full_thickness)
        evaporate(surfaces, air, step)
        if vapour:
            _give(simulation, vapour, surfaces, begin, there, step)
        lost = surfaces.mass
        particles.temperature[...] = surfaces.temperature
        self._remove(particles, lost, is_drop)
        self.mass += float(self.communicator.sum(lost))
        self.heat += float(self.communicator.sum(surfaces.heat))
        if "liquid" in particles:
            volume = np.where(is_drop, 0.0, lost / keys.liquid_density)
            simulation.feature(LiquidOnParticles).evaporated += float(self.communicator.sum(volume))

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


def _give(
    simulation: Any, vapour: Vapour, surfaces: Surfaces, begin: np.ndarray, there: np.ndarray, step: float
) -> None:
    """Give the vapour to the cells, which take it implicitly; surfaces then have what the cells took.

    begin  temperature of the surfaces before [K]
    there  liquid that can evaporate [kg]
    """
    difference = surfaces.saturated - surfaces.fraction
    differs = np.abs(difference) > 1e-12
    conductance = np.where(differs, surfaces.mass / step / np.where(differs, difference, 1.0), 0.0)
    most = there / (step * np.maximum(surfaces.saturated, 1e-300))  # no more than there is, also into dry air
    conductance = np.maximum(np.minimum(conductance, most), 0.0)
    latent = surfaces.heat / np.where(surfaces.mass == 0.0, 1.0, surfaces.mass)
    surfaces.mass[...] = -vapour.exchange(simulation, conductance, surfaces.saturated, step)
    surfaces.heat[...] = latent * surfaces.mass
    surfaces.temperature[...] = begin - surfaces.response * surfaces.heat / step


def evaporated_mass(simulation: Any) -> float:
    """Mass of liquid that has evaporated, less what condensed."""
    return float(simulation.feature(EvaporationOfLiquid).mass)


def latent_heat_taken(simulation: Any) -> float:
    """Latent heat of the liquid that has evaporated."""
    return float(simulation.feature(EvaporationOfLiquid).heat)
