"""Contact by linear springs and a dashpot."""

from __future__ import annotations

from cfddem.particles.interactions.contact_law import ContactLaw, register
from cfddem.particles.step_criteria import stiffness_steps
from closures.contact import linear_damping, spring_energy


def force(overlap: float, normal_stiffness: float) -> float:
    r"""Contact by linear springs of given stiffnesses, with a dashpot for the restitution of the materials.

    .. math:: F = k_n\,\delta

    overlap           delta [m]
    normal_stiffness  k_n [N/m]
    returns           F [N]

    Range: any; the moduli of the materials are not used.
    """
    return normal_stiffness * overlap


def damping(linear_damping_ratio: float, reduced_mass: float, normal_stiffness: float) -> float:
    """Resistance of the dashpot [kg/s]."""
    return linear_damping(linear_damping_ratio, reduced_mass, normal_stiffness)


def stiffness(normal_stiffness: float) -> float:
    """Stiffness of the normal spring [N/m]."""
    return normal_stiffness


def spring_stiffness(tangential_stiffness: float) -> float:
    """Stiffness of the tangential spring [N/m]."""
    return tangential_stiffness


def energy(overlap: float, minimum_gap: float, normal_stiffness: float) -> float:
    """Energy of the normal spring [J]."""
    return spring_energy(normal_stiffness, 1.0, overlap, minimum_gap)


def impact(reduced_mass: float, normal_stiffness: float, tangential_stiffness: float) -> tuple[float, float]:
    """Default step and stability limit of an impact [s]."""
    return stiffness_steps(reduced_mass, max(normal_stiffness, tangential_stiffness))


LINEAR = ContactLaw(
    name="linear",
    reference="Cundall and Strack, Geotechnique 29 (1979) 47",
    parameters={"normal_stiffness": 0.0, "tangential_stiffness": 0.0},
    force=force,
    damping=damping,
    stiffness=stiffness,
    secant_stiffness=stiffness,
    tangential_stiffness=spring_stiffness,
    energy=energy,
    impact=impact,
)
register(LINEAR)
