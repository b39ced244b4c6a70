r"""Solid bonds of dried bridges: what pairs remember of them, and their elastic forces and moments.

A bond is a parallel bond of Potyondy & Cundall (2004): a cylinder of the radius b between two spheres, made at their
distance and orientation at that moment, without stress. Its stiffness per area is :math:`k_n = E / (R_1 + R_2)` along
the line of centres and a share of that across it. Stretch, slip, bending and twist give

.. math:: F_n = k_n \pi b^2 s,\quad F_t = k_s \pi b^2 t,\quad M_b = k_n \frac{\pi b^4}{4} \varphi,\quad
          M_t = k_s \frac{\pi b^4}{2} \psi

The bond breaks where its largest tensile or shear stress reaches its strength. A dashpot acts along and across the line
of centres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange
from cfddem.backend.errors import InputError
from cfddem.model.fields import Field
from cfddem.particles.interactions.kinematics import pair_mass_and_radius
from cfddem.particles.interactions.slots import BOND
from cfddem.particles.pair_graph import geometry
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, minus, plus, put, times
from closures.bond import bond_shear, bond_tension, neck_radius

FIELDS = (
    Field("bridge_solid", "m3", role="memory", meaning="volume of the solids in the liquid of the bridge"),
    Field("bond_radius", "m", role="memory", meaning="radius of the neck of the bond; 0 without one"),
    Field("bond_length", "m", role="memory", meaning="distance of the centres when the bond formed"),
    Field("bond_slip", "m", 3, "memory", meaning="displacement of the first body across the line of centres"),
    Field("bond_bend", "rad", 3, "memory", meaning="angle by which the bond is bent"),
    Field("bond_twist", "rad", role="memory", meaning="angle by which the bond is twisted"),
    Field("bond_force", "N", 3, "memory", meaning="force of the bond on the first body"),
    Field("bond_couple", "N", 3, "memory", meaning="torque of this force per radius, the same on both bodies"),
    Field("bond_moment", "N m", 3, "memory", meaning="moment of the bond on the first body"),
)
"""What pairs remember of their bonds."""

PARTICLE_FIELDS = (Field("bonds_formed", dtype=np.int64, meaning="bonds that have formed, counted by the lower id"),)
"""What particles remember of their bonds."""

SMALLEST_GAP = 1e-9
"""Gap below which the resistance of a bridge is cut if nothing else limits it; thinner films form no bridge [m]."""

SWING = 3.5
"""A force across a contact of spheres accelerates it by this times as much as one along it."""


class BondNumbers(NamedTuple):
    """Numbers of the bonds, as compiled loops take them."""

    solid_fraction: float  # [-]
    youngs_modulus: float  # [Pa]
    shear_ratio: float  # [-]
    tensile_strength: float  # [Pa]
    shear_strength: float  # [Pa]
    damping: float  # over critical [-]


@dataclass(frozen=True)
class BondLaw:
    """Bonds that dried bridges leave, an argument of :class:`~cfddem.particles.interactions.bridge_law.BridgeLaws`.

    solid_fraction    volume of solids in the liquid over the volume of the liquid when a bridge forms [-]
    youngs_modulus    E of the bond [Pa]
    tensile_strength  [Pa]
    shear_strength    [Pa]
    shear_ratio       stiffness across over that along the line of centres [-]
    damping           of the dashpots, over critical [-]
    """

    solid_fraction: float
    youngs_modulus: float
    tensile_strength: float
    shear_strength: float
    shear_ratio: float = 0.4
    damping: float = 0.1

    def check(self) -> None:
        """Refuse values that no bond has."""
        for name in ("youngs_modulus", "tensile_strength", "shear_strength", "shear_ratio"):
            if not 0.0 < (value := getattr(self, name)) < math.inf:
                raise InputError(f"bond.{name}", value, "above 0 and finite")
        for name in ("solid_fraction", "damping"):
            if not 0.0 <= (value := getattr(self, name)) < 1.0:
                raise InputError(f"bond.{name}", value, "at least 0 and below 1")

    @property
    def numbers(self) -> BondNumbers:
        """The numbers of the law."""
        return BondNumbers(**{name: float(getattr(self, name)) for name in BondNumbers._fields})


@inline
def forms_bond(k, system):
    """Whether the bridge of edge k, which breaks in this step, leaves a bond."""
    memory, pair = system.memory, k < system.edges.between_particles
    reduced_radius, _ = pair_mass_and_radius(k, system)
    dry = memory.bridge_change[k] < 0 and dried(k, reduced_radius, memory)
    return pair and dry and memory.bridge_solid[k] > 0.0 and memory.bond_radius[k] == 0.0


@part
def form_bonds(system):
    """Let dry bridges that break in this step leave bonds."""
    for k in prange(system.edges.between_particles):
        if forms_bond(k, system):
            _form(k, system)


@inline
def _form(k, system):
    memory = system.memory
    _, distance, gap = geometry(k, system)
    reduced_radius, _ = pair_mass_and_radius(k, system)
    clear_bond(k, memory)
    memory.bond_radius[k] = neck_radius(memory.bridge_solid[k], gap, reduced_radius)
    memory.bond_length[k] = distance


@inline
def clear_bond(k, memory):
    """Forget the bond of edge k."""
    memory.bond_radius[k] = 0.0
    memory.bond_twist[k] = 0.0
    put(memory.bond_slip, k, NOTHING)
    put(memory.bond_bend, k, NOTHING)
    put(memory.bond_force, k, NOTHING)
    put(memory.bond_couple, k, NOTHING)
    put(memory.bond_moment, k, NOTHING)


@inline
def bond_stiffness(k, neck, system):
    """Stiffness of a bond of edge k: to stretch, slip, bending and twist [N/m], [N/m], [N m], [N m].

    neck  radius of its neck [m]
    """
    particles, edges, n = system.particles, system.edges, system.parameters.bond
    per_area = n.youngs_modulus / (particles.radius[edges.first[k]] + particles.radius[edges.second[k]])
    square = neck * neck
    along = per_area * math.pi * square
    across_it = n.shear_ratio * along
    return along, across_it, 0.25 * square * along, 0.5 * square * across_it


@inline
def bond_loads(k, system):
    """Elastic force on the first body, torque per radius on both, moment on the first body, and the stored energy."""
    particles, edges, memory = system.particles, system.edges, system.memory
    separation, distance, _ = geometry(k, system)
    normal = times(1.0 / distance, separation)
    lever = distance / (particles.radius[edges.first[k]] + particles.radius[edges.second[k]])
    along, sideways, bending, twisting = bond_stiffness(k, memory.bond_radius[k], system)
    stretch, slip = distance - memory.bond_length[k], at(memory.bond_slip, k)
    bend, twist = at(memory.bond_bend, k), memory.bond_twist[k]
    shear = times(-sideways, slip)
    force = plus(times(-along * stretch, normal), shear)
    couple = times(-lever, cross(normal, shear))
    moment = minus(times(-bending, bend), times(twisting * twist, normal))
    energy = along * stretch * stretch + sideways * dot(slip, slip) + bending * dot(bend, bend)
    return force, couple, moment, 0.5 * (energy + twisting * twist * twist)


@inline
def _turned(a, normal, halfway, turned):
    """A vector across the old line of centres, turned with it and about it.

    halfway  between the old and the new normal, of unit length
    turned   tangent of half the angle about the normal
    """
    a = minus(a, times(dot(a, normal) / dot(halfway, normal), halfway))
    share = 1.0 / (1.0 + turned * turned)
    return plus(times((1.0 - turned * turned) * share, a), times(2.0 * turned * share, cross(normal, a)))


@inline
def _strain(k, system, step):
    """Let slip, bending and twist of the bond of edge k follow the motion of the step; returns rates for the dashpots:
    along the line of centres, and across it."""
    particles, edges, memory, free = system.particles, system.edges, system.memory, system.parameters.free
    i, j = edges.first[k], edges.second[k]
    separation, distance, _ = geometry(k, system)
    normal = times(1.0 / distance, separation)
    lever = distance / (particles.radius[i] + particles.radius[j])
    spin, other = at(particles.spin, i), at(particles.spin, j)
    velocity = minus(at(particles.velocity, i), at(particles.velocity, j))
    velocity = (free[0] * velocity[0], free[1] * velocity[1], free[2] * velocity[2])
    halfway = minus(normal, times(0.5 * step / distance, velocity))
    halfway = times(1.5 - 0.5 * dot(halfway, halfway), halfway)  # unit length, to second order of the turn
    rolled = plus(times(particles.radius[i], spin), times(particles.radius[j], other))
    slip = minus(across(velocity, halfway), times(lever, cross(rolled, halfway)))
    about = minus(spin, other)
    turned = 0.25 * step * dot(plus(spin, other), normal)
    put(memory.bond_slip, k, _turned(plus(at(memory.bond_slip, k), times(step, slip)), normal, halfway, turned))
    bend = plus(at(memory.bond_bend, k), times(step, across(about, halfway)))
    put(memory.bond_bend, k, _turned(bend, normal, halfway, turned))
    memory.bond_twist[k] += step * dot(about, halfway)
    return dot(velocity, normal), across(slip, normal)


@inline
def _breaks(k, system):
    """Whether a stress in the bond of edge k has reached its strength."""
    memory, n = system.memory, system.parameters.bond
    _, distance, _ = geometry(k, system)
    neck, particles, edges = memory.bond_radius[k], system.particles, system.edges
    per_area = n.youngs_modulus / (particles.radius[edges.first[k]] + particles.radius[edges.second[k]])
    slip, bend = at(memory.bond_slip, k), at(memory.bond_bend, k)
    tension = bond_tension(per_area, distance - memory.bond_length[k], math.sqrt(dot(bend, bend)), neck)
    shear = bond_shear(n.shear_ratio * per_area, math.sqrt(dot(slip, slip)), memory.bond_twist[k], neck)
    return tension >= n.tensile_strength or shear >= n.shear_strength


@inline
def _bond(k, system, step):
    """Force and moment of the bond of edge k, or its end."""
    particles, edges, memory, n = system.particles, system.edges, system.memory, system.parameters.bond
    _, begin, _ = geometry(k, system)
    fresh = memory.bridge_change[k] < 0 and begin == memory.bond_length[k]  # made in this step, at its end
    speed, slip = _strain(k, system, 0.0 if fresh else step)
    if _breaks(k, system):
        clear_bond(k, memory)
        return
    force, couple, moment, _ = bond_loads(k, system)
    if n.damping > 0.0 and step > 0.0:
        separation, distance, _ = geometry(k, system)
        normal = times(1.0 / distance, separation)
        lever = distance / (particles.radius[edges.first[k]] + particles.radius[edges.second[k]])
        _, inverse_mass = pair_mass_and_radius(k, system)
        along, sideways, _, _ = bond_stiffness(k, memory.bond_radius[k], system)
        mass = 1.0 / inverse_mass if inverse_mass > 0.0 else 0.0
        drag = times(-2.0 * n.damping * math.sqrt(sideways * mass / SWING), slip)
        pull = times(-2.0 * n.damping * math.sqrt(along * mass) * speed, normal)
        force = plus(force, plus(pull, drag))
        couple = minus(couple, times(lever, cross(normal, drag)))
    put(memory.bond_force, k, force)
    put(memory.bond_couple, k, couple)
    put(memory.bond_moment, k, moment)


@part
def bond_forces(system, step):
    """Forces and moments of all bonds; those break whose stress has reached the strength.

    step  by which they have been strained since the last forces; 0 at the start [s]
    """
    memory, number = system.memory, system.edges.between_particles
    for chunk in prange(CHUNKS):
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            if memory.bond_radius[k] > 0.0:
                _bond(k, system, step)


@inline
def stiffness_for_step(k, system):
    """Stiffness by which the bond of edge k, or the one that its bridge may leave, limits the step [N/m]."""
    memory = system.memory
    reduced_radius, _ = pair_mass_and_radius(k, system)
    neck = max(memory.bond_radius[k], neck_radius(memory.bridge_solid[k], 0.0, reduced_radius))
    along, sideways, _, _ = bond_stiffness(k, neck, system)
    return max(along, SWING * sideways)


@inline
def asperity_volume(reduced_radius, minimum_gap):
    """Volume of a bridge that lies between the asperities alone: its pull reaches no farther than h_min [m3]."""
    return math.pi * reduced_radius * minimum_gap * minimum_gap


@inline
def thinnest_film(reduced_radius, minimum_gap):
    """Thickness of both films together below which none of their bridges is larger than `asperity_volume` [m]."""
    return 2.0 * minimum_gap * minimum_gap / reduced_radius


@inline
def dried(k, reduced_radius, memory):
    """Whether the bridge of edge k has no water left, but for what asperities hold."""
    left = asperity_volume(reduced_radius, max(memory.bridge_gap[k], SMALLEST_GAP))
    if BOND:
        left = max(left, memory.bridge_solid[k])
    return memory.bridge_volume[k] <= left
