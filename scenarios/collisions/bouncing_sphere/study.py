"""A steel sphere falls onto a wall in silicone oil and bounces: the measured motions at St = 27 and St = 152.

What you'll learn: how to follow a collision with a wall in a fluid at rest, beyond the film.

Gondret, Lance & Petit, Phys. Fluids 14 (2002) 643. The sphere feels its weight less buoyancy, the film and the wall,
and the fluid around it: drag, added mass, history force, and the extra drag beside the wall. Each can be left out.

>>> time, gap = bounce(surroundings=())                # film, wall and weight alone
>>> round(float(gap[time > 0].max()) * 1e3, 1)         # apex [mm]; 2.0 was measured
2.3

`python -m scenarios.collisions.bouncing_sphere.study OUTPUT.png` computes the collisions and draws them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cfddem.case.materials import Material
from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, label, legend, panels, save
from closures.added_mass import near_wall
from scenarios.collisions.immersed_pair.study import Collision, collide
from scenarios.validation.table import numbers

GRAVITY = 9.81

ALL = ("drag", "added_mass", "history", "wall_drag")
"""Forces of the fluid around the sphere."""

ROUGHNESS = 1e-4
"""Height of the asperities of the spheres over their radius, as later work quotes it."""


class Fall(NamedTuple):
    """A sphere of steel that falls in oil."""

    radius: float  # [m]
    speed: float  # of the fall [m/s]
    fluid_density: float  # [kg/m3]
    density_ratio: float  # of sphere and oil
    kinematic_viscosity: float  # of the oil [m2/s]
    approach: float  # time from the edge of the film to contact, at most [s]
    windows: tuple[tuple[float, float], ...] = ()  # times after contact between which the mean speed was measured [s]
    measured: tuple[float, ...] = ()  # these speeds, over that of the fall

    @property
    def viscosity(self) -> float:
        """Dynamic viscosity of the oil [Pa s]."""
        return self.fluid_density * self.kinematic_viscosity

    def steel(self, roughness: float = ROUGHNESS) -> Material:
        """The sphere; its roughness is over its radius."""
        return Material(
            density=self.density_ratio * self.fluid_density, youngs_modulus=190e9, poisson=0.27, restitution=0.97,
            friction=0.11, roughness=roughness * self.radius,
        )  # fmt: skip


SLOW = Fall(
    3e-3, 0.518, 965.0, 8.083, 1.036e-4, 0.0115,
    ((0.63e-3, 2.69e-3), (2.69e-3, 4.75e-3), (4.75e-3, 6.82e-3), (6.82e-3, 10.94e-3)), (0.429, 0.339, 0.287, 0.189),
)  # fmt: skip
"""St = 27, Re = 30."""

FAST = Fall(
    1.5e-3, 0.585, 935.0, 8.342, 0.01 / 935.0, 0.003,
    ((0.4e-3, 2.4e-3), (2.4e-3, 4.4e-3), (4.4e-3, 6.4e-3), (6.4e-3, 8.4e-3)), (0.810, 0.724, 0.625, 0.559),
)  # fmt: skip
"""St = 152, Re = 164."""


def collision(
    until: float = 0.045, surroundings: Sequence[str] = ALL, fall: Fall = SLOW, roughness: float = ROUGHNESS
) -> Collision:
    """The sphere arrives with its measured speed at the edge of the film; its path with all forces.

    until         end, counted from contact [s]
    surroundings  those of the forces `ALL` that act
    fall          `SLOW`, St = 27, or `FAST`, St = 152
    roughness     of the sphere, over its radius [-]
    """
    return collide(
        fall.steel(roughness),
        diameter=2.0 * fall.radius,
        against="wall",
        velocity=fall.speed,
        viscosity=fall.viscosity,
        surroundings=surroundings,
        fluid_density=fall.fluid_density,
        gravity=GRAVITY,
        until=fall.approach + until,
    )


def bounce(
    until: float = 0.045, surroundings: Sequence[str] = ALL, fall: Fall = SLOW, roughness: float = ROUGHNESS
) -> tuple[np.ndarray, np.ndarray]:
    """Let the sphere bounce; returns time since contact [s] and gap between sphere and wall [m].

    until, surroundings, fall, roughness  as of :func:`collision`
    """
    path = collision(until, surroundings, fall, roughness)
    return path.time - contact_time(path), path.gap


def contact_time(path: Collision) -> float:
    """Time at which the sphere comes as close to the wall as its film lets it [s]."""
    return float(path.time[int(np.argmax(path.gap < path.minimum_gap))])


def mean_speeds(time: np.ndarray, gap: np.ndarray, fall: Fall) -> list[float]:
    """Mean speeds in the times in which they were measured, over the speed of the fall [-]."""
    return [speed_after_contact(time, gap, *window) / fall.speed for window in fall.windows]


def shares_of_loss(path: Collision, fall: Fall = SLOW) -> dict[str, float]:
    """Share of each force in the energy that the sphere has lost at its apex after the bounce.

    The energy at the edge of the film is that of its motion and of its weight over the apex, with the displaced fluid
    that moves with it. What no force of the fluid takes is taken by the film and the contact.

    fall  of which the path is
    """
    contact = int(path.gap.argmin())
    apex = contact + int(path.gap[contact:].argmax())
    along, lasting = path.history["velocity"][:, 0, 0], np.diff(path.time[: apex + 1])
    middle = 0.5 * (along[:apex] + along[1 : apex + 1])

    def taken(name: str) -> float:
        return -float((path.history[f"force_{name}"][1 : apex + 1, 0] * middle * lasting).sum())

    volume = 4.0 / 3.0 * np.pi * fall.radius**3
    mass, displaced = fall.density_ratio * fall.fluid_density * volume, fall.fluid_density * volume
    added = near_wall(path.gap[0] + fall.radius, fall.radius) * displaced if "force_weight" in path.history else 0.0
    whole = 0.5 * (mass + added) * fall.speed**2 - taken("weight")
    shares = {name: taken(name) / whole for name in ("drag", "history")}
    return shares | {"film and contact": 1.0 - sum(shares.values())}


def speed_after_contact(time: np.ndarray, gap: np.ndarray, first: float, second: float) -> float:
    """Mean speed away from the wall between two times after contact, as read off a measured trajectory [m/s]."""
    return float(np.interp(second, time, gap) - np.interp(first, time, gap)) / (second - first)


# ---------------------------------------------------------------- figure of the bouncing sphere


FORCES = (
    ((), "film alone", ORANGE, "--"),
    (("drag", "added_mass"), "with drag and added mass", GREEN, "-."),
    (ALL, "with all forces of the fluid", BLUE, "-"),
)
"""Forces of the fluid beyond the film, their names, colours and lines."""


def figure(path: Path) -> None:
    """Gap between sphere and wall against time."""
    drawn, axes = panels(width=6.5, height=4.2)
    for forces, text, colour, line in FORCES:
        time, gap = bounce(surroundings=forces)
        axes.plot(1e3 * time, 1e3 * gap, color=colour, ls=line, label=text)
    measured = numbers("gondret2002_st27_trajectory")
    axes.plot(
        1e3 * measured["t"], 1e3 * measured["gap"], "o", color=GREY, ms=5, label="measured, Gondret et al. (2002)"
    )
    axes.set_xlim(-4.0, 44.0)
    axes.set_ylim(0.0, 3.2)
    label(axes, "time after contact", "ms", "gap between sphere and wall", "mm")
    legend(axes, loc="upper right")
    save(drawn, path)


if __name__ == "__main__":
    figure(Path(sys.argv[1] if len(sys.argv) > 1 else "bouncing_sphere.png"))
