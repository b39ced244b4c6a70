r"""Evaporation of the liquid of particles, of their bridges, and of drops, into humid air.

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

from cfddem.backend.law_set import adapted, specialise
from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.evaporating_bridges import Menisci
from cfddem.features.evaporating_walls import WallFilms
from cfddem.features.evaporation_keys import Evaporation
from cfddem.features.evaporation_loops import FOUND, Air, Surfaces, evaporate, settle
from cfddem.features.heat import HeatExchange
from cfddem.features.heat_keys import Heat
from cfddem.features.liquid import LiquidOnParticles
from cfddem.features.vapour import Vapour
from cfddem.particles.energy_of_bridges import DRIED
from closures.evaporation import vapour_fraction
from closures.kinds import DRYING_ARGUMENTS

SMALLEST = 1e-6
"""Radius of a drop that has evaporated [m]."""

_NONE, _NOTHING = np.zeros(0, np.int64), np.zeros(0)


class EvaporationOfLiquid(CaseFeature):
    """Water that leaves particles as vapour.

    mass  evaporated so far, less what condensed [kg]
    heat  latent heat taken so far [J]
    """

    name, table = "evaporation", "evaporation"

    def __init__(self, case: Case, simulation: Any) -> None:
        keys = Evaporation.of(case)
        assert keys
        self.keys, self.fluid, self.communicator = keys, case.required_fluid, simulation.communicator
        self.diffusivity = keys.diffusivity_in(case)
        self.fraction = vapour_fraction(keys.partial_pressure(case), keys.pressure)
        self.gains = Vapour.is_in(case)
        law = case.laws.drying_law
        assert law is not None
        share = adapted(law.function, ", ".join(DRYING_ARGUMENTS), {name: name for name in DRYING_ARGUMENTS})
        self._evaporate = specialise(evaporate, {"drying_share": share})
        self.drops = np.array([name in keys.drops for name in case.material])
        self.any_drops = bool(self.drops.any())  # local: materials
        self.mass, self.heat = 0.0, 0.0
        self.walls: WallFilms | None = None
        if keys.wall_coefficient > 0.0:
            heat = Heat.of(case)
            assert heat
            temperature = keys.wall_temperature or heat.gas_temperature
            self.walls = WallFilms(simulation, keys.wall_coefficient, temperature, keys.liquid_density)

    @classmethod
    def measures(cls, case: Case) -> tuple[Measured, ...]:
        """What evaporated, and the heat that it took."""
        keys = Evaporation.of(case)
        of_walls = (Measured("J", "recorded", latent_heat_of_walls),) if keys and keys.wall_coefficient > 0.0 else ()
        return (Measured("kg", "recorded", evaporated_mass), Measured("J", "recorded", latent_heat_taken), *of_walls)

    def before(self, simulation: Any, step: float) -> None:
        """Evaporate over the step [s], after the exchange of heat with the gas."""
        particles, heat, keys = simulation.owned, simulation.feature(HeatExchange), self.keys
        count, has_films = particles.count, "liquid" in particles
        films = particles.liquid if has_films else np.zeros(count)
        film, mass, is_drop = self._with_drops(particles, films, films * keys.liquid_density)
        vapour = simulation.feature(Vapour) if self.gains else None
        menisci = Menisci(simulation, keys.liquid_density) if has_films else None
        surfaces = Surfaces(
            particles.temperature,
            2.0 * particles.radius,
            heat.law.numbers(simulation.terms.flow, particles.viscosity / (self.fluid.density * self.diffusivity)),
            heat.around,
            heat.humidity if vapour else np.full(count, self.fraction),
            film,
            menisci.area if menisci else np.zeros(count),
            heat.response,
            mass,
            menisci.mass if menisci else np.zeros(count),
            *np.empty((FOUND, count)),
        )
        air = Air(keys.pressure, self.fluid.density, self.diffusivity, keys.rate == "stefan", keys.full_thickness)
        self._evaporate(surfaces, air, step)
        taken = _NOTHING  # by the cells, which take it implicitly
        if vapour:
            taken = -vapour.exchange(simulation, surfaces.conductance, surfaces.saturated, step)
        terms = np.empty((3, count))
        settle(surfaces, taken, step, keys.liquid_density, particles.temperature, films, terms)
        self._shrink(particles, surfaces.mass, is_drop)
        sums = self.communicator.sum(terms, axis=1)
        self.mass += float(sums[0])
        self.heat += float(sums[1])
        if menisci:
            energy, energies = menisci.lose(surfaces.bridged), simulation.particle_solver.energies
            if energies:
                energies.add(DRIED, energy)
            simulation.feature(LiquidOnParticles).evaporated += float(sums[2])

        if self.walls:
            gone = self.walls.lose(self.fraction, keys.pressure, self.fluid.density, step)
            self.mass += gone * keys.liquid_density
            simulation.feature(LiquidOnParticles).evaporated += gone

    def _with_drops(self, particles: Any, film: Any, mass: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Films [m3] and the mass that can evaporate [kg], with those of drops, and the rows of these: their film is
        infinite, and all can evaporate but the smallest drop."""
        is_drop = np.flatnonzero(self.drops[particles.material]) if self.any_drops else _NONE
        if len(is_drop):
            film, mass = film.copy(), mass.copy()
            film[is_drop] = np.inf
            smallest = particles.density[is_drop] * (4.0 / 3.0 * math.pi * SMALLEST**3)
            mass[is_drop] = np.maximum(particles.mass[is_drop] - smallest, 0.0)
        return film, mass, is_drop

    def _shrink(self, particles: Any, lost: np.ndarray, is_drop: np.ndarray) -> None:
        """Take the mass `lost` [kg] from drops."""
        if len(is_drop):
            ratio = 1.0 - lost[is_drop] / particles.mass[is_drop]
            particles.radius[is_drop] *= np.cbrt(ratio)
            particles.inverse_mass[is_drop] /= ratio
            particles.inverse_inertia[is_drop] /= ratio ** (5.0 / 3.0)

    def checkpoint(self) -> dict[str, Any]:
        """What evaporated, and its heat."""
        kept: dict[str, Any] = {"mass": self.mass, "heat": self.heat}
        return kept | {"walls": self.walls.checkpoint()} if self.walls else kept

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.mass, self.heat = float(state["mass"]), float(state["heat"])
        if self.walls:
            self.walls.restore(state["walls"])


def evaporated_mass(simulation: Any) -> float:
    """Mass of liquid that has evaporated, less what condensed."""
    return float(simulation.feature(EvaporationOfLiquid).mass)


def latent_heat_taken(simulation: Any) -> float:
    """Latent heat of the liquid that has evaporated, from the particles."""
    return float(simulation.feature(EvaporationOfLiquid).heat)


def latent_heat_of_walls(simulation: Any) -> float:
    """Latent heat of the liquid that has evaporated from walls, from the walls."""
    walls = simulation.feature(EvaporationOfLiquid).walls
    return float(walls.heat)
