"""Pairs of particles for the tests of contacts: one at a time, or many far apart in one run."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from solver_options import grouped

from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles, make_particles
from cfddem.particles.walls.shapes import Plane
from closures import contact, timescales

DATA = Path(__file__).parents[1] / "scenarios" / "data"
STEP = 0.02
"""Default time step, in Hertz times."""

DRY = Laws()


def rows(name: str) -> list[dict[str, str]]:
    """Lines of a data file; its `#` lines say where they are from."""
    with open(DATA / f"{name}.csv", newline="") as source:
        return list(csv.DictReader(line for line in source if not line.startswith("#")))


def rigid(material: Material) -> Material:
    """A wall that does not give: the same solid, a thousand times stiffer."""
    return material.model_copy(update={"youngs_modulus": 1000.0 * material.youngs_modulus})


@dataclass
class Pair:
    """Two spheres on the x axis, or a sphere and the wall x = 0; the first body comes from the left.

    approach  normal speed at which they meet [m/s]
    slide     tangential speed of the first body against the second, along y [m/s]
    gap       at the start [m]
    """

    materials: tuple[Material, Material]
    radii: tuple[float, float]
    approach: float
    slide: float = 0.0
    spin: tuple[tuple[float, float, float], tuple[float, float, float]] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    gap: float = 0.0
    wall: bool = False
    viscosity: float = 0.0
    rows: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.rows = pair_table(self.materials)

    @property
    def masses(self) -> tuple[float, float]:
        """Of both particles [kg]; the wall's is infinite."""
        first, second = (m.density * 4.0 / 3.0 * np.pi * r**3 for m, r in zip(self.materials, self.radii))
        return first, np.inf if self.wall else second

    @property
    def reduced_mass(self) -> float:
        """m* [kg]"""
        return contact.reduced(*self.masses)

    @property
    def reduced_radius(self) -> float:
        """R* [m]"""
        return self.radii[0] if self.wall else contact.reduced(*self.radii)

    @property
    def stiffness(self) -> float:
        """k of Hertz' law [N/m^1.5]"""
        return contact.hertz_stiffness(float(self.rows[0, 1]["contact_modulus"]), self.reduced_radius)

    @property
    def hertz_time(self) -> float:
        """Duration of the undamped impact [s]."""
        return timescales.hertz_time(self.reduced_mass, self.stiffness, self.approach)

    def simulation(self, laws: Laws = DRY, **options: object) -> ParticleSolver:
        """This pair alone; without a wall the centre of mass rests."""
        first, second = self.masses
        velocity = np.array([self.approach, self.slide, 0.0])
        if self.wall:
            made = make_particles(
                [[-self.radii[0] - self.gap, 0.0, 0.0]],
                self.radii[0],
                self.materials[0].density,
                velocity=velocity,
                spin=self.spin[0],
                viscosity=self.viscosity,
            )
            planes = [Plane(normal=(-1.0, 0.0, 0.0), material=1)]
        else:
            made = make_particles(
                [[-self.radii[0] - self.gap, 0.0, 0.0], [self.radii[1], 0.0, 0.0]],
                self.radii,
                [m.density for m in self.materials],
                velocity=[velocity * second / (first + second), -velocity * first / (first + second)],
                spin=self.spin,
                material=[0, 1],
                viscosity=self.viscosity,
            )
            planes = []
        chosen = {"skin": max(self.radii), "check_steps": False} | options  # an impact has a clock of its own
        return ParticleSolver(made, self.rows, walls=planes, laws=laws, **grouped(**chosen))  # type: ignore[arg-type]


def relative_velocity(run: ParticleSolver) -> np.ndarray:
    """Velocity of the first body against the second or the wall [m/s]."""
    velocity = run.particles.velocity
    return velocity[0] - velocity[1] if len(velocity) > 1 else velocity[0]


def normal_speed(run: ParticleSolver) -> float:
    """Rate of the gap [m/s]."""
    if run.particles.count == 1:
        return float(-run.particles.velocity[0, 0])
    apart = run.particles.position[0] - run.particles.position[1]
    return float(relative_velocity(run) @ apart / np.linalg.norm(apart))


def until_apart(run: ParticleSolver, step: float, chunk: int = 10) -> ParticleSolver:
    """Advance until the particles have separated after their contact."""
    for _ in range(2000):
        run.advance(step, chunk)
        if run.gap[0] > 0.0 and normal_speed(run) > 0.0:
            return run
    raise AssertionError("the particles do not separate")


def kinetic_energy(made: Particles) -> np.ndarray:
    """Of motion and spin, of each body [J]."""
    inertia = 0.4 * made.mass * made.radius**2
    return 0.5 * made.mass * np.sum(made.velocity**2, axis=1) + 0.5 * inertia * np.sum(made.spin**2, axis=1)
