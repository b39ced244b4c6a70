"""Exact solutions against which the smoothed particles are tested: a layer at rest, and decaying vortices."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from scenarios.references.isph import points
from scenarios.references.isph.liquid import SmoothedLiquid


class AtRest(NamedTuple):
    """Errors of a layer of water at rest."""

    plate_force: float  # relative [-]
    bottom_pressure: float  # of the lowest layer of particles, relative [-]
    largest_speed: float  # of any particle, in the whole time [m/s]


def layer_at_rest(layers: int, steps: int = 200) -> AtRest:
    """A layer of water of 0.09 mm per particle, from the start on.

    layers   of particles
    steps    of 0.2 ms; pressure and force are those of the third
    """
    dx, density, gravity = 0.09e-3, 1000.0, 9.81
    pool = SmoothedLiquid((8, 8, layers), dx, density, 1e-3, gravity)
    for _ in range(3):
        pool.step(1e-5)
    weight = density * gravity * layers * dx
    force = pool.plate_force / (weight * 4.0 * (8.0 * dx) ** 2) - 1.0
    lowest = float(pool.pressure[::layers].mean()) / (weight * (layers - 0.5) / layers) - 1.0
    fastest = 0.0
    for _ in range(steps):
        pool.step(2e-4)
        fastest = max(fastest, float(np.abs(pool.velocity).max()))
    return AtRest(force, lowest, fastest)


def taylor_green(side: int, until: float = 0.2, viscosity: float = 0.05) -> float:
    """Relative error of the speed of a Taylor-Green vortex, which decays as exp(-2 pi^2 nu t).

    side       particles along the unit square
    until      time over that of a crossing [-]
    viscosity  over speed and side [-]
    """
    box = SmoothedLiquid((side, side, 3), 1.0 / side, 1.0, viscosity, 0.0, None, False)
    x, y = box.place[:, :2].T
    box.velocity[:, 0] = np.sin(np.pi * x) * np.cos(np.pi * y)
    box.velocity[:, 1] = -np.cos(np.pi * x) * np.sin(np.pi * y)
    begin, time = box.kinetic_energy(), 0.0
    dt = min(0.25 / side, 0.2 / (viscosity * side**2))
    while time < until:
        box.step(dt)
        box.place = points.reflected(box.place, box.size)
        time += dt
    return math.sqrt(box.kinetic_energy() / begin) * math.exp(2.0 * math.pi**2 * viscosity * time) - 1.0
