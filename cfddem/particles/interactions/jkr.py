"""Adhesive contact of elastic spheres: Johnson, Kendall and Roberts, with Mindlin's spring and Tsuji's dashpot."""

from __future__ import annotations

from dataclasses import replace

from cfddem.particles.interactions.hertz import HERTZ
from closures.cohesion import jkr_contact_radius, jkr_force, jkr_pull_off, jkr_stretch

LEAST = 1e-300


def contact_radius(gap: float, work_of_adhesion: float, reduced_radius: float, contact_modulus: float) -> float:
    """Radius of the contact [m]."""
    return jkr_contact_radius(-gap, max(work_of_adhesion, LEAST), reduced_radius, contact_modulus)


def force(contact_radius: float, work_of_adhesion: float, reduced_radius: float, contact_modulus: float) -> float:
    """Normal force; negative where adhesion pulls [N]."""
    return jkr_force(contact_radius, max(work_of_adhesion, LEAST), reduced_radius, contact_modulus)


def overlap(contact_radius: float, reduced_radius: float) -> float:
    """Overlap of Hertz' contact of the same radius [m]."""
    return max(contact_radius * contact_radius / reduced_radius, LEAST)


def pull_off(work_of_adhesion: float, reduced_radius: float) -> float:
    """Largest pull [N]."""
    return jkr_pull_off(max(work_of_adhesion, LEAST), reduced_radius)


def reach(work_of_adhesion: float, reduced_radius: float, contact_modulus: float) -> float:
    """Gap up to which a contact that has formed can be stretched [m]."""
    return jkr_stretch(work_of_adhesion, reduced_radius, contact_modulus)


JKR = replace(
    HERTZ,
    name="jkr",
    derived={**HERTZ.derived, "contact_radius": contact_radius},
    force=force,
    overlap=overlap,
    pull_off=pull_off,
    reach=reach,
    energy=None,
)
