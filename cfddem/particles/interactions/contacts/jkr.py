"""Adhesive contact of elastic spheres: Johnson, Kendall and Roberts, with Mindlin's spring and Tsuji's dashpot."""

from __future__ import annotations

from dataclasses import replace

from cfddem.particles.interactions.contact_law import register
from cfddem.particles.interactions.contacts.hertz import HERTZ
from closures.cohesion import jkr_contact_radius, jkr_force, jkr_pull_off, jkr_stretch

LEAST = 1e-100
"""Least work of adhesion [J/m2] and overlap [m]: zero would be divided by, and smaller values vanish when squared."""


def contact_radius(gap: float, work_of_adhesion: float, reduced_radius: float, contact_modulus: float) -> float:
    """Radius of the contact [m]."""
    return jkr_contact_radius(-gap, max(work_of_adhesion, LEAST), reduced_radius, contact_modulus)


def force(contact_radius: float, work_of_adhesion: float, reduced_radius: float, contact_modulus: float) -> float:
    r"""Adhesive contact of two elastic spheres without a film, with Mindlin's spring and Tsuji's dashpot.

    .. math:: F = \frac{4 E^* a^3}{3 R^*} - \sqrt{8\pi w E^* a^3}

    contact_radius    a, of the overlap [m]
    work_of_adhesion  w, twice the surface energy of two like solids [J/m2]
    reduced_radius    R* [m]
    contact_modulus   E* [Pa]
    returns           F, negative where adhesion pulls [N]

    Range: dry solids. A contact that has formed lasts until the solids are a small gap apart.
    """
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
    reference="Johnson, Kendall and Roberts, Proc. R. Soc. A 324 (1971) 301",
    derived={**HERTZ.derived, "contact_radius": contact_radius},
    force=force,
    overlap=overlap,
    pull_off=pull_off,
    reach=reach,
    energy=None,
)
register(JKR)
