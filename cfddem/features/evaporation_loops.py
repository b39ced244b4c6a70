"""Evaporation from every particle over a step, in one compiled loop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, serial
from cfddem.backend.law_set import Slot
from cfddem.particles.pair_graph import geometry
from closures.bond import neck_area
from closures.evaporation import (
    dilute_drive,
    latent_heat,
    saturation_pressure,
    stefan_drive,
    vapour_fraction,
    vapour_pressure,
)

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
