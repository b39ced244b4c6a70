"""A steel sphere falls onto a wall in silicone oil and bounces: the measured trajectory at St = 27.

What you'll learn: how to follow a collision with a wall in a fluid at rest, beyond the film.

Gondret, Lance & Petit, Phys. Fluids 14 (2002) 643. The sphere feels its weight less buoyancy, the film and the wall,
and the fluid around it: drag, added mass, history force, and the extra drag beside the wall. Each can be left out.

>>> time, gap = bounce(surroundings=())                # film, wall and weight alone
>>> round(float(gap[time > 0].max()) * 1e3, 1)         # apex [mm]; 2.0 was measured
2.3
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfddem.case.materials import Material
from closures.added_mass import near_wall
from scenarios.collisions.immersed_pair.study import Collision, collide

RADIUS, SPEED = 3e-3, 0.518
FLUID_DENSITY, DENSITY_RATIO, KINEMATIC_VISCOSITY = 965.0, 8.083, 1.036e-4
VISCOSITY = FLUID_DENSITY * KINEMATIC_VISCOSITY
STEEL = Material(
    density=DENSITY_RATIO * FLUID_DENSITY, youngs_modulus=190e9, poisson=0.27, restitution=0.97, friction=0.11,
    roughness=1e-4 * RADIUS,
)  # fmt: skip
GRAVITY = 9.81
APPROACH = 0.0115
"""Time from the edge of the film to contact, at most [s]."""

ALL = ("drag", "added_mass", "history", "wall_drag")
"""Forces of the fluid around the sphere."""


def collision(until: float = 0.045, surroundings: Sequence[str] = ALL) -> Collision:
    """The sphere arrives with its measured speed at the edge of the film; its path with all forces.

    until         end, counted from contact [s]
    surroundings  those of the forces `ALL` that act
    """
    return collide(
        STEEL,
        diameter=2.0 * RADIUS,
        against="wall",
        velocity=SPEED,
        viscosity=VISCOSITY,
        surroundings=surroundings,
        fluid_density=FLUID_DENSITY,
        gravity=GRAVITY,
        until=APPROACH + until,
    )


def bounce(until: float = 0.045, surroundings: Sequence[str] = ALL) -> tuple[np.ndarray, np.ndarray]:
    """Let the sphere bounce; returns time since contact [s] and gap between sphere and wall [m].

    until, surroundings  as of :func:`collision`
    """
    path = collision(until, surroundings)
    touch = path.time[int(np.argmax(path.gap < STEEL.roughness))]
    return path.time - touch, path.gap


def shares_of_loss(path: Collision) -> dict[str, float]:
    """Share of each force in the energy that the sphere has lost at its apex after the bounce.

    The energy at the edge of the film is that of its motion and of its weight over the apex, with the displaced fluid
    that moves with it. What no force of the fluid takes is taken by the film and the contact.
    """
    contact = int(path.gap.argmin())
    apex = contact + int(path.gap[contact:].argmax())
    along, lasting = path.history["velocity"][:, 0, 0], np.diff(path.time[: apex + 1])
    middle = 0.5 * (along[:apex] + along[1 : apex + 1])

    def taken(name: str) -> float:
        return -float((path.history[f"force_{name}"][1 : apex + 1, 0] * middle * lasting).sum())

    volume = 4.0 / 3.0 * np.pi * RADIUS**3
    mass, displaced = STEEL.density * volume, FLUID_DENSITY * volume
    added = near_wall(path.gap[0] + RADIUS, RADIUS) * displaced if "force_weight" in path.history else 0.0
    whole = 0.5 * (mass + added) * SPEED**2 - taken("weight")
    shares = {name: taken(name) / whole for name in ("drag", "history")}
    return shares | {"film and contact": 1.0 - sum(shares.values())}


def speed_after_contact(time: np.ndarray, gap: np.ndarray, first: float, second: float) -> float:
    """Mean speed away from the wall between two times after contact, as read off a measured trajectory [m/s]."""
    return float(np.interp(second, time, gap) - np.interp(first, time, gap)) / (second - first)
