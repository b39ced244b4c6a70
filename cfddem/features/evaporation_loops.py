"""Evaporation from every particle over a step, in one compiled loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import inline, serial
from closures.evaporation import dilute_drive, latent_heat, saturation_pressure, stefan_drive, vapour_fraction

CLOSEST = 1e-9
"""Difference up to which the temperature is known [K]."""


class Surfaces(NamedTuple):
    """Wet surfaces."""

    temperature: np.ndarray  # after the exchange of heat with the gas alone (n,); written [K]
    transport: np.ndarray  # wet share, times pi d Sh rho D (n,) [kg/s]
    slowness: np.ndarray  # temperature by which a loss of 1 W cools over the step (n,) [K/W]
    mass: (
        np.ndarray
    )  # of liquid that is there (n,); what evaporates is written, negative for vapour that condenses [kg]


class Air(NamedTuple):
    """State of the gas."""

    temperature: float  # [K]
    pressure: float  # [Pa]
    partial: float  # pressure of the vapour [Pa]
    fraction: float  # mass fraction of the vapour [-]
    density: float  # [kg/m3]
    stefan: bool  # the vapour flows by itself


@inline
def drive(temperature, air):
    """Driving force at the temperature of a surface [-]."""
    saturation = min(saturation_pressure(temperature), 0.999 * air.pressure)
    if air.stefan:
        return stefan_drive(vapour_fraction(saturation, air.pressure), air.fraction)
    return dilute_drive(saturation, air.partial, air.temperature, air.density)


@serial
def evaporate(surfaces, air, step):
    """Let every surface evaporate over a step [s], at the temperature that it comes to: implicit.

    The new temperature solves T = T' - s L(T) m(T), where m falls with T: the root is between T' and what m(T') gives.
    """
    for i in range(len(surfaces.mass)):
        there, begin, transport = surfaces.mass[i], surfaces.temperature[i], surfaces.transport[i]
        surfaces.mass[i] = 0.0
        if transport <= 0.0:
            continue
        scale = surfaces.slowness[i] * transport
        low = begin
        at_low = scale * latent_heat(begin) * drive(begin, air)  # of T - T' + s L m
        high = max(begin - at_low, 200.0)
        at_high = high - begin + scale * latent_heat(high) * drive(high, air)
        middle = begin
        for _ in range(100):
            if abs(high - low) <= CLOSEST or at_low == at_high:
                break
            middle = high - at_high * (high - low) / (at_high - at_low)  # regula falsi, as in Illinois
            value = middle - begin + scale * latent_heat(middle) * drive(middle, air)
            if abs(value) <= CLOSEST:
                break
            if value * at_high <= 0.0:
                low, at_low = high, at_high
            else:
                at_low *= 0.5
            high, at_high = middle, value
        mass = step * transport * drive(middle, air)
        if mass > there:
            mass = there
            middle = begin - surfaces.slowness[i] * latent_heat(begin) * mass / step
        surfaces.mass[i], surfaces.temperature[i] = mass, middle
