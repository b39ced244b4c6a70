"""Kinematics and properties of one pair, for compiled loops.

Walls supply the same quantities as a second particle does: separation, velocity of the surface, rate at which the
normal turns, and the part of the contact that belongs to a triangle.
"""

from __future__ import annotations

from typing import NamedTuple

from cfddem.backend.compile import inline
from cfddem.particles.pair_graph import geometry
from cfddem.particles.vectors import at, minus, plus, times
from cfddem.particles.walls.nearest_point import SURFACE, TURN, touched


class PairKinematics(NamedTuple):
    """Two particles at one instant, seen from the first; or a particle and a wall."""

    separation: tuple[float, float, float]  # from the second body to the first [m]
    distance: float  # of the centres, or from a wall [m]
    gap: float  # [m]
    velocity: tuple[float, float, float]  # of the first centre relative to the second [m/s]
    surface_spin: tuple[float, float, float]  # sum of spin times radius [m/s]
    reduced_radius: float  # R* [m]
    inverse_sum: float  # 1 / (R_i + R_j); 1 / R_i at a wall [1/m]
    inverse_mass: float  # 1 / m* [1/kg]
    turn: tuple[float, float, float]  # rate at which motion turns the normal [1/s]
    relative_spin: tuple[float, float, float]  # of the first body relative to the second [rad/s]
    inverse_inertia: float  # sum over both particles, each about its centre [1/(kg m2)]


@inline
def sphere_kinematics(k, apart, system):
    """Kinematics of two spheres.

    apart  separation from the second to the first, its length, and the sum of the radii
    """
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    radius, spin, inverse_mass = particles.radius, particles.spin, particles.inverse_mass
    free = system.parameters.free
    separation, distance, radii = apart
    inverse_sum = 1.0 / radii
    relative = minus(at(particles.velocity, i), at(particles.velocity, j))
    rate = 1.0 / distance
    return PairKinematics(
        separation,
        distance,
        distance - radii,
        relative,
        plus(times(radius[i], at(spin, i)), times(radius[j], at(spin, j))),
        radius[i] * radius[j] * inverse_sum,
        inverse_sum,
        inverse_mass[i] + inverse_mass[j],
        (rate * free[0] * relative[0], rate * free[1] * relative[1], rate * free[2] * relative[2]),
        minus(at(spin, i), at(spin, j)),
        2.5 * (inverse_mass[i] / radius[i] ** 2 + inverse_mass[j] / radius[j] ** 2),
    )


@inline
def wall_kinematics(k, system):
    """Kinematics of a sphere and a wall; the wall is flat, of infinite mass."""
    particles, edges, walls = system.particles, system.edges, system.walls
    i = edges.first[k]
    separation, distance, gap = geometry(k, system)
    radius = particles.radius[i]
    return PairKinematics(
        separation,
        distance,
        gap,
        relative_velocity(k, system),
        times(radius, at(particles.spin, i)),
        radius,
        1.0 / radius,
        particles.inverse_mass[i],
        touched(edges, k, TURN),
        minus(at(particles.spin, i), at(walls.spin, walls.wall[edges.second[k]])),
        2.5 * particles.inverse_mass[i] / radius**2,
    )


@inline
def pair_mass_and_radius(k, system):
    """Reduced radius and inverse of the reduced mass; those of the particle itself at a wall."""
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        radius = particles.radius[i] * particles.radius[j] / (particles.radius[i] + particles.radius[j])
        return radius, particles.inverse_mass[i] + particles.inverse_mass[j]
    return particles.radius[i], particles.inverse_mass[i]


@inline
def relative_velocity(k, system):
    """Velocity of the first centre relative to the second, or to the surface of a wall."""
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    other = at(particles.velocity, j) if k < edges.between_particles else touched(edges, k, SURFACE)
    return minus(at(particles.velocity, i), other)


@inline
def pair_row(k, system):
    """Row of the pair table for the two materials."""
    particles, edges, walls, table = system.particles, system.edges, system.walls, system.table
    i, j = edges.first[k], edges.second[k]
    other = particles.material[j] if k < edges.between_particles else walls.material[j]
    return table[particles.material[i], other]


@inline
def pair_viscosity(k, system):
    """Viscosity of the fluid in the gap [Pa s]."""
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        return 0.5 * (particles.viscosity[i] + particles.viscosity[j])
    return particles.viscosity[i]
