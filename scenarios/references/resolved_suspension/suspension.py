r"""Free spheres and the flow around them: the resolved flow, and contacts and films by the particle engine.

In one step the flow first exchanges momentum with every sphere (implicitly, :mod:`.spheres`). The particle engine then
moves the spheres with their contacts and films in smaller steps. The impulses of contacts and films enter the next
exchange. Gravity acts on the excess mass of the spheres alone, and a uniform force on all cells balances it. The
mixture has no mean acceleration, its total momentum stays zero, and the mean slip follows from the balance of forces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from closures.drag_resolved import tenneti
from scenarios.references.resolved_suspension.film import GRID_GAP, new_impacts, unresolved_film
from scenarios.references.resolved_suspension.flow import Flow, sphere_volume
from scenarios.references.resolved_suspension.spheres import exchange

OVERLAP = 0.005
"""Overlap of a head-on contact at the mean slip, over the diameter: sets the contact modulus."""


@dataclass(frozen=True)
class Point:
    """A suspension, by its dimensionless numbers and its resolution."""

    density_ratio: float
    solid_fraction: float
    reynolds: float  # Re_m = (1 - phi) w d / nu that the drag law of Tenneti et al. would give
    seed: int = 1
    diameter: int = 12  # [cells]
    box: float = 5.0  # side [d]
    slip: float = 0.05  # w that the same law would give [cells/step]
    restitution: float = 0.97
    friction: float = 0.1
    roughness: float = 1e-3  # least gap of a film [d]

    @property
    def cells(self) -> int:
        """Cells along each side of the box."""
        return round(self.box * self.diameter)

    @property
    def count(self) -> int:
        """Number of spheres."""
        return round(self.solid_fraction * self.cells**3 / sphere_volume(self.diameter))

    @property
    def viscosity(self) -> float:
        """Kinematic viscosity of the lattice [cells2/step]."""
        return (1.0 - self.solid_fraction) * self.slip * self.diameter / self.reynolds

    @property
    def weight(self) -> float:
        """Buoyant weight of a sphere, (rho_p - rho_f) V g, that gives this slip by the drag law of Tenneti et al."""
        factor = tenneti(self.reynolds, 1.0 - self.solid_fraction)
        return 3.0 * math.pi * self.viscosity * self.diameter * factor * self.slip


class Contacts(NamedTuple):
    """Contacts of spheres."""

    speed: float  # largest speed of approach to be expected; sets stiffness and steps
    restitution: float = 0.97
    friction: float = 0.1
    roughness: float = 1e-3  # least gap of a film [d]


class Suspension:
    """Free spheres in a resolved flow, in lattice units.

    flow        the fluid
    positions   of the centres (spheres, 3) [cells]
    diameter    [cells]
    density_ratio  of spheres over fluid, above 1
    weight      force on every sphere besides those of fluid and contacts (3,); a buoyant weight
    contacts    of the spheres, and the steps in time that they need
    walls       walls of the particle engine
    box         lengths in which the particle engine is periodic; None along open axes
    """

    def __init__(
        self,
        flow: Flow,
        positions: np.ndarray,
        diameter: float,
        density_ratio: float,
        weight: tuple[float, float, float],
        contacts: Contacts,
        *,
        walls: tuple[Any, ...] = (),
        box: tuple[float | None, float | None, float | None] | None = None,
    ) -> None:
        self.flow, self.diameter = flow, diameter
        fluid_mass = sphere_volume(diameter)
        self.mass, self.excess_mass = density_ratio * fluid_mass, (density_ratio - 1.0) * fluid_mass
        self.inertia, self.excess_inertia = (0.1 * mass * diameter**2 for mass in (self.mass, self.excess_mass))
        self.weight = np.array(weight, float)
        solid = _solid(density_ratio, diameter, contacts)
        particles = make_particles(positions, 0.5 * diameter, density_ratio, viscosity=flow.viscosity)
        self.solver = ParticleSolver(
            particles,
            pair_table([solid]),
            walls=walls,
            laws=Laws(film=True, cutoff_ratio=GRID_GAP / (0.25 * diameter), lubrication=unresolved_film),
            box=tuple(float(n) for n in flow.shape) if box is None else box,  # type: ignore[arg-type]
        )
        self.substeps = math.ceil(1.0 / self.solver.recommended_step(contacts.speed))
        count = len(positions)
        self.velocity, self.spin = np.zeros((count, 3)), np.zeros((count, 3))
        self.contact_impulse = np.zeros((count, 6))
        self.force = np.zeros((count, 3))
        self.touching = np.zeros(0, np.int64)
        self.impacts = np.zeros(0)
        self.steps = 0

    def step(self) -> None:
        """One step of the lattice."""
        particles = self.solver.particles
        self.flow.place(particles.position, 0.5 * self.diameter)
        impulse = self.contact_impulse.copy()
        impulse[:, :3] += self.weight
        sums = self.flow.sums()
        velocity, spin = exchange(sums, self.velocity, self.spin, self.excess_mass, self.excess_inertia, impulse)
        self.force = self.mass * (velocity - self.velocity) - impulse[:, :3]
        self.flow.advance(velocity, spin)
        self.velocity, self.spin = velocity, spin
        particles.velocity[:], particles.spin[:] = velocity, spin
        self.solver.refresh()
        self.solver.advance(1.0 / self.substeps, self.substeps)
        particles = self.solver.particles
        self.contact_impulse[:, :3] = self.mass * (particles.velocity - velocity)
        self.contact_impulse[:, 3:] = self.inertia * (particles.spin - spin)
        self.touching, self.impacts = new_impacts(self.solver, self.velocity, self.touching)
        self.steps += 1

    @property
    def momentum(self) -> np.ndarray:
        """Momentum of fluid and spheres, impulses not yet exchanged included (3,)."""
        spheres = self.excess_mass * self.velocity + self.contact_impulse[:, :3]
        return np.asarray(self.flow.momentum() + spheres.sum(axis=0))

    def mean_slip(self) -> np.ndarray:
        """Mean velocity of the fluid between the spheres against that of the spheres, w (3,)."""
        cells = math.prod(self.flow.shape)
        inside = sphere_volume(self.diameter) * self.velocity.sum(axis=0)
        outside = cells - len(self.velocity) * sphere_volume(self.diameter)
        return np.asarray((self.flow.momentum() - inside) / outside - self.velocity.mean(axis=0))


def _solid(density: float, diameter: float, contacts: Contacts) -> Material:
    """The solid whose head-on contact at the largest speed overlaps by OVERLAP diameters."""
    reduced_mass, reduced_radius = 0.5 * density * sphere_volume(diameter), 0.25 * diameter
    reduced = 15.0 / 16.0 * reduced_mass * contacts.speed**2 / (math.sqrt(reduced_radius) * (OVERLAP * diameter) ** 2.5)
    modulus = 2.0 * reduced * (1.0 - 0.25**2)
    return Material(
        density=density, youngs_modulus=1e9 * modulus, contact_modulus=modulus, poisson=0.25,
        restitution=contacts.restitution, friction=contacts.friction, roughness=contacts.roughness * diameter,
    )  # fmt: skip


def prepare(point: Point) -> Suspension:
    """The suspension of a point at rest: spheres stirred without fluid into a random arrangement."""
    n = point.cells
    force = point.count * point.weight / n**3
    flow = Flow((n, n, n), point.viscosity, force=(0.0, 0.0, force))
    return Suspension(
        flow, random_arrangement(point), point.diameter, point.density_ratio, (0.0, 0.0, -point.weight),
        Contacts(point.slip, point.restitution, point.friction, point.roughness),
    )  # fmt: skip


def random_arrangement(point: Point) -> np.ndarray:
    """Centres of spheres that do not overlap: a lattice with vacancies, stirred as an elastic gas."""
    random = np.random.default_rng(point.seed)
    n, d, count = point.cells, float(point.diameter), point.count
    sites = math.ceil(max(count ** (1.0 / 3.0), 1.0))
    grid = (np.stack(np.meshgrid(*[np.arange(sites)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) * n / sites
    centres = grid[random.permutation(len(grid))[:count]]
    solid = Material(density=1.0, youngs_modulus=1e9, poisson=0.25, restitution=1.0)
    particles = make_particles(centres, 0.5 * d * 1.02, 1.0, velocity=random.normal(0.0, d, (count, 3)))
    gas = ParticleSolver(particles, pair_table([solid]), box=(float(n),) * 3)
    step = gas.recommended_step(4.0 * d)
    gas.advance(step, math.ceil(2.0 / step))
    order = np.argsort(gas.particles.id)
    return np.ascontiguousarray(gas.particles.position[order])
