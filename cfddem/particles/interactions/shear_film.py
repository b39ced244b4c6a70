"""Films that resist sliding, rolling and twisting: their resistance, and what they remember.

Slip s and rolling rate q of a pair meet the force K_ss s + K_sr q and the couple K_sr s + K_rr q. Their impulses follow
with those of the normal films (`cfddem.particles.interactions.joint_solution`).
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline
from cfddem.data.fields import Field
from cfddem.particles.vectors import LEAST, at, put
from closures.tangential_lubrication import (
    roll_resistance,
    shear_resistance,
    shear_roll_resistance,
    twist_resistance,
)

FIELDS = (
    Field("shear_resistance", "kg/s", role="memory", meaning="resistance of the film to sliding; 0 out of its reach"),
    Field(
        "shear_impulse",
        "1",
        9,
        "memory",
        meaning="impulse of the film against sliding, on the first body [N s]; its angular impulses on the first and "
        "on the second body [N m s]",
    ),
)
"""What pairs remember of the films between them that resist sliding."""

_1, _2, _3 = np.uint64(1), np.uint64(2), np.uint64(3)

_MANTISSA = np.int64(52)
_ROOT_HALF = np.int64(0x3FE6A09E667F3BCD)
"""Bits of sqrt(1/2), where the mantissa of the logarithm begins."""


@inline
def logarithm(x):
    """ln x of a number above 0, to 1e-15, in arithmetic alone: loops work on several pairs at once."""
    bits = np.float64(x).view(np.int64)
    power = (bits - _ROOT_HALF) >> _MANTISSA
    mantissa = np.int64(bits - (power << _MANTISSA)).view(np.float64)
    t = (mantissa - 1.0) / (mantissa + 1.0)
    s = t * t
    series = 1.0 / 15.0 + s * (1.0 / 17.0 + s * (1.0 / 19.0 + s * (1.0 / 21.0)))
    series = 1.0 / 7.0 + s * (1.0 / 9.0 + s * (1.0 / 11.0 + s * (1.0 / 13.0 + s * series)))
    series = 1.0 + s * (1.0 / 3.0 + s * (1.0 / 5.0 + s * series))
    return power * 0.6931471805599453 + 2.0 * t * series


@inline
def edge_asymmetry(k, system):
    """Difference of the radii of edge k over their sum; -1 at a wall."""
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        return (particles.radius[i] - particles.radius[j]) / (particles.radius[i] + particles.radius[j])
    return -1.0


@inline
def renew_shear(k, gap, viscosity, reduced_radius, asymmetry, share, memory):
    """Resistance to sliding of the film of edge k, whose normal resistance is known.

    share  part of the film that belongs to this edge: below 1 where triangles of a mesh share one
    """
    # the smaller radius; at a wall, where the asymmetry is -1, that of the sphere
    smaller = 2.0 * reduced_radius / (1.0 + abs(asymmetry))
    minimum_gap = memory.minimum_gap[k]
    lever = min(max(gap, 0.0) / minimum_gap, 1.0)
    size = max(logarithm(smaller / max(gap, minimum_gap)), 0.0)
    resistance = share * lever * size * shear_resistance(viscosity, reduced_radius, asymmetry)
    memory.shear_resistance[k] = resistance if memory.resistance[k] > 0.0 else 0.0


@inline
def sliding_ratios(reduced_radius, asymmetry):
    """Resistances of slip and roll together, and to rolling, over the resistance to sliding [m, m2]."""
    per_slip = 1.0 / shear_resistance(1.0, reduced_radius, asymmetry)
    both = per_slip * shear_roll_resistance(1.0, reduced_radius, asymmetry)
    return both, per_slip * roll_resistance(1.0, reduced_radius)


@inline
def twist_strength(gap, minimum_gap, resistance, viscosity, reduced_radius, asymmetry, share):
    """Resistance to twisting; 0 where there is none to sliding.

    resistance  to sliding [kg/s]
    share       part of the film that belongs to this edge
    """
    lever = share * min(max(gap, 0.0) / minimum_gap, 1.0)
    whole = resistance / (shear_resistance(viscosity, reduced_radius, asymmetry) * max(lever, LEAST))
    strength = lever * twist_resistance(viscosity, max(gap, minimum_gap), reduced_radius, whole)
    return strength if resistance > 0.0 else 0.0


@inline
def write_impulse(k, memory, impulse, first, second):
    """Write what the film of edge k does in this step: impulse, and angular impulses on the first and second body."""
    row = _3 * np.uint64(k)
    put(memory.shear_impulse, row, impulse)
    put(memory.shear_impulse, row + _1, first)
    put(memory.shear_impulse, row + _2, second)


@inline
def impulses_of(k, memory):
    """What `write_impulse` has written."""
    row = _3 * np.uint64(k)
    return at(memory.shear_impulse, row), at(memory.shear_impulse, row + _1), at(memory.shear_impulse, row + _2)
