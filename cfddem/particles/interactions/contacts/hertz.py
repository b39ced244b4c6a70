"""Contact of elastic spheres: Hertz, Mindlin, and Tsuji's dashpot."""

from __future__ import annotations

import math

from cfddem.particles.interactions.contact_law import ContactLaw, register
from cfddem.particles.step_criteria import hertz_steps
from closures.contact import hertz_damping, hertz_force, hertz_stiffness, mindlin_stiffness, spring_energy
from closures.timescales import overlap_period


def force(overlap: float, stiffness: float) -> float:
    r"""Elastic contact of two spheres, with Mindlin's tangential spring and Tsuji's dashpot.

    .. math:: F = \tfrac43 E^*\sqrt{R^*}\,\delta^{3/2}

    overlap    delta [m]
    stiffness  4/3 E* sqrt(R*), from the moduli of the two materials [N/m^1.5]
    returns    F [N]

    Range: overlaps small against the radius.
    """
    return hertz_force(stiffness, overlap)


def damping(overlap: float, stiffness: float, damping_ratio: float, reduced_mass: float) -> float:
    """Resistance of the dashpot [kg/s]."""
    return hertz_damping(damping_ratio, reduced_mass, stiffness, overlap)


def tangent_stiffness(overlap: float, stiffness: float) -> float:
    """Derivative of the force with the overlap [N/m]."""
    return overlap_period(1.0, stiffness, overlap) ** -2


def secant_stiffness(overlap: float, stiffness: float) -> float:
    """Force over overlap [N/m]."""
    return stiffness * math.sqrt(overlap)


def tangential_stiffness(overlap: float, shear_modulus: float, reduced_radius: float) -> float:
    """Stiffness of the tangential spring [N/m]."""
    return mindlin_stiffness(shear_modulus, reduced_radius, overlap)


def energy(overlap: float, minimum_gap: float, stiffness: float) -> float:
    """Energy of the normal spring [J]."""
    return spring_energy(stiffness, 1.5, overlap, minimum_gap)


def impact(reduced_mass: float, reduced_radius: float, contact_modulus: float, speed: float) -> tuple[float, float]:
    """Default step and stability limit of an impact [s]."""
    if not (speed > 0.0 and contact_modulus > 0.0):
        return math.inf, math.inf
    return hertz_steps(reduced_mass, reduced_radius, contact_modulus, speed)


def hertz_constant(contact_modulus: float, reduced_radius: float) -> float:
    """k of F = k overlap^(3/2) [N/m^1.5]."""
    return hertz_stiffness(contact_modulus, reduced_radius)


HERTZ = ContactLaw(
    name="hertz",
    reference="Hertz (1882); Mindlin and Deresiewicz (1953); Tsuji et al. (1992)",
    derived={"stiffness": hertz_constant},
    force=force,
    damping=damping,
    stiffness=tangent_stiffness,
    secant_stiffness=secant_stiffness,
    tangential_stiffness=tangential_stiffness,
    energy=energy,
    impact=impact,
    damping_mean=0.8,  # the damping grows as the fourth root of the overlap
)
register(HERTZ)
