"""Contact by linear springs and a dashpot."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from cfddem.particles.interactions.contact_law import ContactLaw
from cfddem.particles.step_limits import linear_steps
from closures.contact import linear_damping, spring_energy


def force(overlap: float, normal_stiffness: float) -> float:
    """Normal force [N]."""
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


@lru_cache(maxsize=16)
def linear(normal_stiffness: float, tangential_stiffness: float) -> ContactLaw:
    """The contact by linear springs of these stiffnesses [N/m]."""

    def impact(reduced_mass: float, reduced_radius: float, row: Any, speed: float) -> tuple[float, float]:
        return linear_steps(reduced_mass, normal_stiffness, tangential_stiffness)

    return ContactLaw(
        name="linear",
        parameters={"normal_stiffness": normal_stiffness, "tangential_stiffness": tangential_stiffness},
        force=force,
        damping=damping,
        stiffness=stiffness,
        secant_stiffness=stiffness,
        tangential_stiffness=spring_stiffness,
        energy=energy,
        impact=impact,
    )
