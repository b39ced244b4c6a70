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
from typing import Any, NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, serial
from cfddem.backend.law_set import Slot, bind_arguments, specialise
from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.evaporation_keys import Evaporation
from cfddem.features.heat import HeatExchange
from cfddem.features.heat_keys import Heat
from cfddem.features.liquid import LiquidOnParticles
from cfddem.features.vapour import Vapour
from cfddem.particles.energy_of_bridges import DRIED
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.pair_graph import geometry
from cfddem.particles.system import BridgeSystem
from closures.bond import neck_area
from closures.evaporation import (
    dilute_drive,
    latent_heat,
    saturation_pressure,
    stefan_drive,
    vapour_fraction,
    vapour_pressure,
)
from closures.kinds import DRYING_ARGUMENTS

drying_share = Slot("drying_share")
"""Rate of a particle over that of a wet surface: (volume, area, full_thickness, diameter, sherwood)."""

CLOSEST = 1e-9
"""Difference up to which the temperature is known [K]."""


class Surfaces(NamedTuple):
    """Wet surfaces of n particles."""

    begin: np.ndarray  # temperature after the exchange of heat with the gas alone [K]
    diameter: np.ndarray  # [m]
    sherwood: np.ndarray  # [-]
    gas: np.ndarray  # temperature of the gas around [K]
    fraction: np.ndarray  # mass fraction of the vapour in the gas around [-]
    film: np.ndarray  # volume of liquid on the surface; infinite for a drop [m3]
    menisci: np.ndarray  # area of the particle's part of its bridges [m2]
    response: np.ndarray  # cooling by a loss of 1 W over the step [K/W]
    there: np.ndarray  # mass of liquid that can evaporate [kg]
    in_bridges: np.ndarray  # the same in the particle's part of its bridges [kg]
    # all below is found
    temperature: np.ndarray  # [K]
    mass: np.ndarray  # that evaporates, negative for vapour that condenses [kg]
    bridged: np.ndarray  # the same of bridges [kg]
    heat: np.ndarray  # latent heat of what evaporates [J]
    saturated: np.ndarray  # mass fraction of the vapour at the surface [-]
    conductance: np.ndarray  # that gives the cells what evaporates, at most what is there [kg/s]
    latent: np.ndarray  # heat [J/kg]


FOUND = 7
"""Number of what is found."""


class Air(NamedTuple):
    """State of the gas, and how a film covers a surface."""

    pressure: float  # [Pa]
    density: float  # [kg/m3]
    diffusivity: float  # of the vapour [m2/s]
    stefan: bool  # the vapour flows by itself
    full_thickness: float  # of a film that covers all [m]


@inline
def saturated(temperature, air):
    """Pressure of the vapour at a surface [Pa]."""
    return min(saturation_pressure(temperature), 0.999 * air.pressure)


@inline
def drive(temperature, gas, fraction, air):
    """Driving force at the temperature of a surface, in a gas of a temperature and a mass fraction, and the mass
    fraction at the surface [-]."""
    saturation = saturated(temperature, air)
    at_surface = vapour_fraction(saturation, air.pressure)
    if air.stefan:
        return stefan_drive(at_surface, fraction), at_surface
    return dilute_drive(saturation, vapour_pressure(fraction, air.pressure), gas, air.density), at_surface


@serial
def menisci(rows, density, system, body, parts, masses, area, mass):
    """Parts of bridges, the first of all, then the second: particle, meniscus [m2] and liquid [kg], written to `body`,
    `parts` and `masses` (2 n,); and their sums of every owned particle, to `area` and `mass` (count,).

    rows  of the edges that have a bridge (n,); those at walls have one part
    """
    n, edges, radius, count = len(rows), system.edges, system.particles.radius, len(area)
    for k in range(n):
        row = rows[k]
        i, pair = np.int64(edges.first[row]), row < edges.between_particles
        other, one, volume = np.int64(edges.second[row]) if pair else i, radius[i], system.memory.bridge_volume[row]
        reduced = one * radius[other] / (one + radius[other]) if pair else one
        _, _, gap = geometry(row, system)
        share, free = 0.5 if pair else 1.0, neck_area(volume, gap, reduced)
        body[k], body[n + k] = i, other if pair else count  # beyond the owned particles: not ours
        parts[k], parts[n + k] = share * free, (1.0 - share) * free
        masses[k], masses[n + k] = share * (volume * density), (1.0 - share) * (volume * density)
    for k in range(2 * n):
        if body[k] < count:
            area[body[k]] += parts[k]
            mass[body[k]] += masses[k]


@serial
def taken_from(body, parts, masses, area, lost, taken):
    """What bridges lose, by their areas; what one has not, the others of its particle give: written to `taken` (2 n,).

    lost  of every particle (count,) [kg]
    """
    summed, left = np.zeros(len(lost)), np.zeros(len(lost))
    for k in range(len(body)):
        i = body[k]
        if i < len(lost):
            taken[k] = min(lost[i] * parts[k] / max(area[i], 1e-300), masses[k])
            summed[i] += taken[k]
            left[i] += masses[k] - taken[k]
    for k in range(len(body)):
        i = body[k]
        if i < len(lost):
            missing = lost[i] - summed[i]
            more = min(missing / max(left[i], 1e-300) if missing > 0.0 else 0.0, 1.0)
            taken[k] = min(taken[k] + more * (masses[k] - taken[k]), masses[k])


@serial
def evaporate(surfaces, air, step):
    """Let every surface evaporate over a step [s], at the temperature that it comes to: implicit. Films and bridges of
    a particle are at its temperature, with the same transport per area.

    The new temperature solves T = T' - s L(T) m(T), where m falls with T: the root is between T' and what m(T') gives.
    """
    for i in range(len(surfaces.mass)):
        there, begin, diameter = surfaces.there[i], surfaces.begin[i], surfaces.diameter[i]
        in_bridges, sherwood, film = surfaces.in_bridges[i], surfaces.sherwood[i], surfaces.film[i]
        surfaces.mass[i] = surfaces.bridged[i] = surfaces.heat[i] = surfaces.saturated[i] = 0.0
        surfaces.temperature[i], surfaces.conductance[i], surfaces.latent[i] = begin, 0.0, 0.0
        if not (there > 0.0 or in_bridges > 0.0):
            continue
        area, share = math.pi * diameter**2, 1.0
        if film < math.inf:
            share = drying_share(film, area, air.full_thickness, diameter, sherwood) if film > 0.0 else 0.0
        of_film = max(share, 0.0) * math.pi * diameter * sherwood * air.density * air.diffusivity
        of_bridges = surfaces.menisci[i] / diameter * sherwood * air.density * air.diffusivity
        of_film, of_bridges = of_film if there > 0.0 else 0.0, of_bridges if in_bridges > 0.0 else 0.0
        transport = of_film + of_bridges
        if transport <= 0.0:
            continue
        slowness, gas, fraction = surfaces.response[i], surfaces.gas[i], surfaces.fraction[i]
        scale = slowness * transport
        low = middle = begin
        latent = latent_heat(begin)  # these three at `middle`
        driven, at_surface = drive(begin, gas, fraction, air)
        at_low = scale * latent * driven  # of T - T' + s L m
        high = max(begin - at_low, 200.0)
        at_high = high - begin + scale * latent_heat(high) * drive(high, gas, fraction, air)[0]
        for _ in range(100):
            if abs(high - low) <= CLOSEST or at_low == at_high:
                break
            middle = high - at_high * (high - low) / (at_high - at_low)  # regula falsi, as in Illinois
            latent = latent_heat(middle)
            driven, at_surface = drive(middle, gas, fraction, air)
            value = middle - begin + scale * latent * driven
            if abs(value) <= CLOSEST:
                break
            if value * at_high <= 0.0:
                low, at_low = high, at_high
            else:
                at_low *= 0.5
            high, at_high = middle, value
        passing = step * driven
        surfaces.mass[i] = min(passing * of_film, there)
        surfaces.bridged[i] = min(passing * of_bridges, in_bridges)
        mass = surfaces.mass[i] + surfaces.bridged[i]
        if mass < passing * transport:
            middle = begin - slowness * latent_heat(begin) * mass / step
            latent, at_surface = latent_heat(middle), vapour_fraction(saturated(middle, air), air.pressure)
        surfaces.temperature[i] = middle
        surfaces.heat[i] = mass * latent
        surfaces.saturated[i] = at_surface
        difference, most = at_surface - fraction, (there + in_bridges) / (step * max(at_surface, 1e-300))
        wanted = mass / step / difference if abs(difference) > 1e-12 else 0.0
        surfaces.conductance[i] = max(min(wanted, most), 0.0)
        surfaces.latent[i] = surfaces.heat[i] / mass if mass != 0.0 else surfaces.heat[i]


@serial
def settle(surfaces, taken, step, density, temperature, liquid, sums):
    """Give particles the temperature (N,) [K] and the liquid of their films (N,) [m3] after evaporation.

    taken    mass that cells took from every surface [kg], which films and bridges then lose by their rates, as far as
             there is liquid; empty where the vapour goes nowhere
    density  of the liquid [kg/m3]
    sums     mass [kg], latent heat [J] and volume of films and bridges [m3] that every particle loses; written (3, N)
    """
    for i in range(len(temperature)):
        if len(taken):
            mass = surfaces.mass[i] + surfaces.bridged[i]
            of_bridges = taken[i] * (surfaces.bridged[i] / mass if mass != 0.0 else 0.0)
            of_bridges = min(max(of_bridges, taken[i] - surfaces.there[i]), max(surfaces.in_bridges[i], 0.0))
            surfaces.bridged[i], surfaces.mass[i] = of_bridges, taken[i] - of_bridges
            surfaces.heat[i] = surfaces.latent[i] * taken[i]
            surfaces.temperature[i] = surfaces.begin[i] - surfaces.response[i] * surfaces.heat[i] / step
        of_film = surfaces.mass[i] / density if surfaces.film[i] < math.inf else 0.0
        left = liquid[i] - of_film
        liquid[i] = left if left > 1e-12 * liquid[i] else 0.0
        temperature[i] = surfaces.temperature[i]
        sums[0, i], sums[1, i] = surfaces.mass[i] + surfaces.bridged[i], surfaces.heat[i]
        sums[2, i] = of_film + surfaces.bridged[i] / density


SMALLEST = 1e-6
"""Radius of a drop that has evaporated [m]."""

_NONE, _NOTHING = np.zeros(0, np.int64), np.zeros(0)


def dries_walls(case: Case) -> bool:
    """Whether liquid on walls evaporates."""
    keys = Evaporation.of(case)
    return keys is not None and keys.wall_coefficient > 0.0


class EvaporationOfLiquid(CaseFeature):
    """Water that leaves particles as vapour.

    mass  evaporated so far, less what condensed [kg]
    heat  latent heat taken so far [J]
    """

    name, table, kept = "evaporation", "evaporation", ("mass", "heat")
    measures = (
        Measured("evaporated_mass", "kg", "recorded", "mass of liquid that has evaporated, less what condensed",
                 lambda evaporation, _: evaporation.mass),
        Measured("latent_heat_taken", "J", "recorded",
                 "latent heat of the liquid that has evaporated, from the particles",
                 lambda evaporation, _: evaporation.heat),
        Measured("latent_heat_of_walls", "J", "recorded",
                 "latent heat of the liquid that has evaporated from walls, from the walls",
                 lambda evaporation, _: evaporation.walls.heat, dries_walls),
    )  # fmt: skip

    def __init__(self, case: Case, simulation: Any) -> None:
        keys = Evaporation.of(case)
        assert keys
        self.keys, self.fluid, self.communicator = keys, case.required_fluid, simulation.communicator
        self.diffusivity = keys.diffusivity_in(case)
        self.fraction = vapour_fraction(keys.partial_pressure(case), keys.pressure)
        self.gains = Vapour.is_in(case)
        law = case.laws.drying_law
        assert law is not None
        share = bind_arguments(law.function, ", ".join(DRYING_ARGUMENTS), {name: name for name in DRYING_ARGUMENTS})
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
        return super().checkpoint() | ({"walls": self.walls.checkpoint()} if self.walls else {})

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        super().restore(state)
        if self.walls:
            self.walls.restore(state["walls"])


# ---------------------------------------------------------------- liquid on walls
#
# Liquid on walls that evaporates: by a coefficient of mass transfer and a temperature of the wall, which gives the
# latent heat. No particle is cooled, and no vapour condenses on walls.


class WallFilms:
    """The liquid on the walls of a simulation: patches, and the film elsewhere, of one thickness.

    film  thickness where no bridge has drawn or returned liquid so far [m]
    heat  latent heat that the walls have given [J]
    """

    def __init__(self, simulation: Any, coefficient: float, temperature: float, density: float) -> None:
        self.solver, self.coefficient, self.temperature = simulation.particle_solver, coefficient, temperature
        self.density, self.heat, self._known = density, 0.0, int(self.solver.walls.patch_count[0])
        numbers = self.solver.parameters.bridge
        self.film = self._start = float(numbers.wall_film)
        self.area = float(numbers.wall_patch) ** 2

    def lose(self, fraction: float, pressure: float, gas_density: float, step: float) -> float:
        """Evaporate over the step [s] into air of a mass fraction of vapour; returns the volume that leaves patches,
        with what new ones had lost before [m3]."""
        saturated = vapour_fraction(min(saturation_pressure(self.temperature), 0.999 * pressure), pressure)
        rate = max(self.coefficient * gas_density * stefan_drive(saturated, fraction), 0.0) / self.density  # [m/s]
        walls, count = self.solver.walls, int(self.solver.walls.patch_count[0])
        gone = max(count - self._known, 0) * (self._start - self.film) * self.area
        there = walls.patch_liquid[:count]
        lost = np.minimum(there, rate * step * self.area)
        there -= lost
        gone += float(lost.sum())  # local: every rank has all patches
        self._known = count
        self._thin(max(self.film - rate * step, 0.0))
        self.heat += gone * self.density * latent_heat(self.temperature)
        return gone

    def _thin(self, film: float) -> None:
        """Let the film where there are no patches have a thickness [m]."""
        self.film, solver = film, self.solver
        solver.parameters = solver.parameters._replace(bridge=solver.parameters.bridge._replace(wall_film=film))
        solver.system = solver.system._replace(parameters=solver.parameters)

    def checkpoint(self) -> dict[str, float]:
        """The film, the patches that are known, and the heat."""
        return {"film": self.film, "known": self._known, "heat": self.heat}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self._known, self.heat = int(state["known"]), float(state["heat"])
        self._thin(float(state["film"]))


# ---------------------------------------------------------------- bridges
#
# Bridges that evaporate: each of its particles takes a half of the meniscus, and gives the latent heat of its half.
#
# A bridge at a wall is all of its particle. What a bridge loses is found by the owners of its particles, so that ranks
# agree on every bit.


class Menisci:
    """The bridges of a simulation at the beginning of a step.

    area  of the menisci of every particle (N,) [m2]
    mass  of the liquid in its parts of bridges (N,) [kg]
    """

    def __init__(self, simulation: Any, density: float) -> None:
        solver, self.density = simulation.particle_solver, density
        self.solver, self.count = solver, solver.particles.owned
        self.rows, self.known = np.flatnonzero(solver.edges.bridge_film > 0.0), BridgeSystem.of(solver.system)
        # two parts of every bridge, the first of all bridges, then the second; that at a wall has one
        parts = 2 * len(self.rows)
        self.body, self.parts, self.masses = np.empty(parts, np.int64), np.empty(parts), np.empty(parts)
        self.area, self.mass = np.zeros(self.count), np.zeros(self.count)
        if parts:
            menisci(self.rows, density, self.known, self.body, self.parts, self.masses, self.area, self.mass)

    def lose(self, lost: np.ndarray) -> float:
        """Take from the bridges what every particle loses from its parts of them (N,) [kg]; returns the energy of the
        pulls that is gone [J].

        Bridges lose by their areas. What one has not, the others of the particle give.
        """
        if not len(self.rows) and self.solver.communicator.size == 1:
            return 0.0
        taken = np.zeros(len(self.body))
        taken_from(self.body, self.parts, self.masses, self.area, lost, taken)
        halves = self._of_all_owners(taken.reshape(2, -1).T)
        bridges: Bridges = self.solver.feature(Bridges)
        return bridges.dry(self.rows, (halves[:, 0] + halves[:, 1]) / self.density, self.known)

    def _of_all_owners(self, halves: np.ndarray) -> np.ndarray:
        """Both parts of every bridge (n, 2) [kg], also where a particle of another rank has one."""
        communicator, edges = self.solver.communicator, self.solver.edges
        if communicator.size == 1:
            return halves
        names = edges.ends(self.solver.particles.id, self.rows).reshape(-1, 2)
        shared = (self.body.reshape(2, -1) >= self.count).any(axis=0) & (names[:, 1] >= 0)
        sent = communicator.joined(np.column_stack([names[shared].astype(float), halves[shared]]).reshape(-1, 4))
        _, place = np.unique(sent[:, :2], axis=0, return_inverse=True)
        sums = np.zeros((len(sent), 2))
        np.add.at(sums, place.ravel(), sent[:, 2:])  # one of two parts is zero
        portions = {(one, other): sums[row] for (one, other), row in zip(sent[:, :2].tolist(), place.ravel().tolist())}
        halves = halves.copy()
        for row in np.flatnonzero(shared):
            halves[row] = portions[tuple(names[row].astype(float).tolist())]
        return halves
