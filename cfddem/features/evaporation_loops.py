"""Evaporation from every particle over a step, in one compiled loop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, serial
from cfddem.backend.law_set import Slot
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

    temperature: np.ndarray  # after the exchange of heat with the gas alone; written [K]
    diameter: np.ndarray  # [m]
    sherwood: np.ndarray  # [-]
    gas: np.ndarray  # temperature of the gas around [K]
    fraction: np.ndarray  # mass fraction of the vapour in the gas around [-]
    film: np.ndarray  # volume of liquid on the surface; infinite for a drop [m3]
    menisci: np.ndarray  # area of the particle's part of its bridges [m2]
    response: np.ndarray  # cooling by a loss of 1 W over the step [K/W]
    mass: np.ndarray  # of liquid that is there; what evaporates is written, negative for vapour that condenses [kg]
    bridged: np.ndarray  # the same of the particle's part of its bridges [kg]
    heat: np.ndarray  # latent heat of what evaporates; written [J]
    saturated: np.ndarray  # mass fraction of the vapour at the surface; written [-]


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
    """Driving force at the temperature of a surface [-], in a gas of a temperature and a mass fraction."""
    saturation = saturated(temperature, air)
    if air.stefan:
        return stefan_drive(vapour_fraction(saturation, air.pressure), fraction)
    return dilute_drive(saturation, vapour_pressure(fraction, air.pressure), gas, air.density)


@serial
def meniscus_areas(volume, gap, reduced_radius, areas):
    """Area of the free surface of every bridge, written (n,) [m2]."""
    for k in range(len(areas)):
        areas[k] = neck_area(volume[k], gap[k], reduced_radius[k])


@serial
def evaporate(surfaces, air, step):
    """Let every surface evaporate over a step [s], at the temperature that it comes to: implicit. Films and bridges of
    a particle are at its temperature, with the same transport per area.

    The new temperature solves T = T' - s L(T) m(T), where m falls with T: the root is between T' and what m(T') gives.
    """
    for i in range(len(surfaces.mass)):
        there, begin, diameter = surfaces.mass[i], surfaces.temperature[i], surfaces.diameter[i]
        in_bridges, sherwood, film = surfaces.bridged[i], surfaces.sherwood[i], surfaces.film[i]
        surfaces.mass[i] = surfaces.bridged[i] = surfaces.heat[i] = 0.0
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
        low = begin
        at_low = scale * latent_heat(begin) * drive(begin, gas, fraction, air)  # of T - T' + s L m
        high = max(begin - at_low, 200.0)
        at_high = high - begin + scale * latent_heat(high) * drive(high, gas, fraction, air)
        middle = begin
        for _ in range(100):
            if abs(high - low) <= CLOSEST or at_low == at_high:
                break
            middle = high - at_high * (high - low) / (at_high - at_low)  # regula falsi, as in Illinois
            value = middle - begin + scale * latent_heat(middle) * drive(middle, gas, fraction, air)
            if abs(value) <= CLOSEST:
                break
            if value * at_high <= 0.0:
                low, at_low = high, at_high
            else:
                at_low *= 0.5
            high, at_high = middle, value
        passing = step * drive(middle, gas, fraction, air)
        surfaces.mass[i] = min(passing * of_film, there)
        surfaces.bridged[i] = min(passing * of_bridges, in_bridges)
        mass = surfaces.mass[i] + surfaces.bridged[i]
        if mass < passing * transport:
            middle = begin - slowness * latent_heat(begin) * mass / step
        surfaces.temperature[i] = middle
        surfaces.heat[i] = mass * latent_heat(middle)
        surfaces.saturated[i] = vapour_fraction(saturated(middle, air), air.pressure)
