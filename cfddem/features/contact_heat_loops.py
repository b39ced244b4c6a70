"""Conductances of pairs of particles, and of particles and walls, in one compiled loop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import serial
from closures.contact_heat import (
    asperity_conductance,
    contact_conductance,
    harmonic_conductivity,
    hertz_radius,
    intersection_radius,
    lens_conductance,
    macro_gap_conductance,
    micro_gap_conductance,
    solid_layer_resistance,
)

NONE, SMOOTH, ROUGH = 0, 1, 2
LENS, RAREFIED = 1, 2


class Pairs(NamedTuple):
    """Pairs of two spheres, or of a sphere and a wall, whose radius is infinite."""

    first: np.ndarray  # radius [m]
    second: np.ndarray  # radius [m]
    gap: np.ndarray  # [m]
    force: np.ndarray  # normal, of the contact; 0 or less without one [N]
    modulus: np.ndarray  # E* of the real solids [Pa]
    first_conductivity: np.ndarray  # [W/m/K]
    second_conductivity: np.ndarray  # [W/m/K]
    hardness: np.ndarray  # harmonic mean of the two [Pa]
    roughness: np.ndarray  # of both surfaces together [m]
    slope: np.ndarray  # of both together [-]


class Choices(NamedTuple):
    """Which conductances act, and the gas."""

    contact: int  # NONE, SMOOTH or ROUGH
    by_force: bool  # the radius of a contact is that of Hertz
    gap: int  # NONE, LENS or RAREFIED
    conductivity: float  # of the gas [W/m/K]
    lens: float  # gap up to which it conducts, over the larger radius [-]
    least_gap: float  # [m]
    jump: float  # gas parameter M [m]


@serial
def conductances(pairs, choices, result):
    """Conductance of each pair, written to `result` (n,) [W/K]."""
    gas = choices.conductivity
    for k in range(len(result)):
        first, second, gap = pairs.first[k], pairs.second[k], pairs.gap[k]
        reduced = first if second == math.inf else first * second / (first + second)
        circle, total = 0.0, 0.0
        if choices.contact != NONE:
            if choices.by_force and pairs.force[k] > 0.0:
                circle = min(hertz_radius(pairs.force[k], pairs.modulus[k], reduced), reduced)
            elif not choices.by_force and gap < 0.0:
                circle = intersection_radius(first, second, -gap)
        if circle > 0.0:
            both = harmonic_conductivity(pairs.first_conductivity[k], pairs.second_conductivity[k])
            total = contact_conductance(both, circle)
            if choices.contact == ROUGH:
                pressure = max(1.5 * pairs.force[k] / (math.pi * circle**2 * pairs.hardness[k]), 1e-12)
                rough = asperity_conductance(both, circle, pressure, pairs.roughness[k], pairs.slope[k])
                if choices.gap != NONE:
                    rough += gas * micro_gap_conductance(circle, pressure, pairs.roughness[k], choices.jump)
                total = 1.0 / (1.0 / total + 1.0 / rough)
        if choices.by_force and gap < 0.0:  # a softened contact overlaps too much
            gap = -(circle**2) / reduced
        if choices.gap == LENS:
            total += gas * lens_conductance(first, second, gap, choices.lens, choices.least_gap)
        elif choices.gap == RAREFIED and gap < choices.lens * (first if second == math.inf else max(first, second)):
            around = gas * macro_gap_conductance(first, second, gap, circle, choices.jump)
            layers = solid_layer_resistance(first, circle, pairs.first_conductivity[k])
            if second != math.inf:
                layers += solid_layer_resistance(second, circle, pairs.second_conductivity[k])
            total += 1.0 / (1.0 / around + layers)
        result[k] = total
