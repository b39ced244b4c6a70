"""The particles: plain arrays in SI units, one row a particle; ids name particles, rows do not."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.data.fields import Field, Table

PARTICLE_FIELDS = (
    Field("position", "m", 3, halo="motion", snapshot=True, meaning="position of the centre"),
    Field("velocity", "m/s", 3, halo="motion", snapshot=True, meaning="velocity"),
    Field("spin", "rad/s", 3, halo="motion", snapshot=True, meaning="angular velocity"),
    Field("radius", "m", snapshot=True, meaning="radius"),
    Field("density", "kg/m3", meaning="density"),
    Field("inverse_mass", "1/kg", meaning="1/m, 0 for a particle that nothing moves"),
    Field("inverse_inertia", "1/(kg m2)", meaning="1/I, 0 for a particle that nothing moves"),
    Field("material", "1", dtype=np.int32, meaning="row of the pair table"),
    Field("id", "1", dtype=np.int64, snapshot=True, meaning="name of the particle, which never changes"),
    Field("viscosity", "Pa s", meaning="viscosity of the fluid around the particle, for its films"),
    Field("applied", "N", 3, meaning="force from outside: gravity, fluid, a hand"),
    Field("force", "N", 3, snapshot=True, meaning="sum of all forces at the last step"),
    Field("torque", "N m", 3, meaning="sum of all torques at the last step"),
    Field("film_rate", "1/s", halo="film", meaning="resistance of all films of the particle over its mass"),
)
"""Fields of every particle; laws and users may declare more."""

ParticleArrays = namedtuple("ParticleArrays", [field.name for field in PARTICLE_FIELDS])  # type: ignore[misc]
"""The arrays of these fields, as compiled loops take them."""


class Particles(Table):
    """The particles: one array for each declared field, one row for each particle; ids name particles, rows do not."""

    @property
    def count(self) -> int:
        """Number of particles."""
        return self.rows

    @property
    def view(self) -> Any:
        """The arrays of `PARTICLE_FIELDS` as loops take them: vectors one after the other; nothing is copied."""
        return ParticleArrays(*(self.arrays[field.name].reshape(-1) for field in PARTICLE_FIELDS))

    def by_id(self, values: np.ndarray) -> np.ndarray:
        """Rows of the particles (N, ...) in the order of their ids; zero for ids that are gone."""
        placed = np.zeros((int(self.id.max(initial=-1)) + 1, *values.shape[1:]), values.dtype)
        placed[self.id] = values
        return placed

    @property
    def volume(self) -> np.ndarray:
        """Volume of each particle (N,) [m3]."""
        volume: np.ndarray = (4.0 / 3.0) * np.pi * self.radius**3
        return volume

    @property
    def mass(self) -> np.ndarray:
        """Mass of each particle (N,) [kg]."""
        mass: np.ndarray = self.density * (4.0 / 3.0) * np.pi * self.radius**3
        return mass


def make_particles(
    position: np.ndarray,
    radius: np.ndarray | float,
    density: np.ndarray | float,
    *,
    velocity: np.ndarray | float = 0.0,
    spin: np.ndarray | float = 0.0,
    material: np.ndarray | int = 0,
    viscosity: np.ndarray | float = 0.0,
    fixed: np.ndarray | bool = False,
) -> Particles:
    """Make particles from what distinguishes them.

    position  (N, 3) [m]
    radius    (N,) or one for all [m]
    density   (N,) or one for all [kg/m3]
    velocity, spin  (N, 3) or one for all [m/s, rad/s]
    material  (N,) or one for all, row of the pair table
    viscosity of the fluid around the particles [Pa s]
    fixed     (N,) or one for all: particles that nothing moves
    """
    position = np.ascontiguousarray(np.atleast_2d(np.asarray(position, float)))
    count = len(position)

    def scalars(value: np.ndarray | float, dtype: type = float) -> np.ndarray:
        return np.ascontiguousarray(np.broadcast_to(np.asarray(value, dtype), (count,))).copy()

    def vectors(value: np.ndarray | float) -> np.ndarray:
        return np.ascontiguousarray(np.broadcast_to(np.asarray(value, float), (count, 3))).copy()

    radius, density = scalars(radius), scalars(density)
    for field, values in (("radius", radius), ("density", density)):
        bad = ~((values > 0) & np.isfinite(values))
        if bad.any():
            raise InputError(f"{field} of particle {int(np.argmax(bad))}", float(values[bad][0]), "above 0")
    mass = density * (4.0 / 3.0) * np.pi * radius**3
    free = ~scalars(fixed, bool)
    return Particles(
        PARTICLE_FIELDS,
        count,
        {
            "position": position,
            "velocity": vectors(velocity),
            "spin": vectors(spin),
            "radius": radius,
            "density": density,
            "inverse_mass": free / mass,
            "inverse_inertia": free / (0.4 * mass * radius**2),
            "material": scalars(material, np.int32),  # type: ignore[arg-type]
            "id": np.arange(count),
            "viscosity": scalars(viscosity),
        },
    )


def particles_in(kept: Mapping[str, np.ndarray]) -> Particles:
    """Particles with `PARTICLE_FIELDS` from a checkpoint of particles; it may hold more fields, which are left out."""
    particles = Particles(PARTICLE_FIELDS, 0)
    particles.restore({field.name: kept[field.name] for field in PARTICLE_FIELDS})
    return particles


def kinetic_energy(spheres: Particles) -> float:
    """Kinetic energy of all particles, spin included [J]."""
    mass = spheres.mass
    linear = np.sum(mass[:, None] * spheres.velocity**2)
    turning = np.sum(0.4 * mass[:, None] * spheres.radius[:, None] ** 2 * spheres.spin**2)
    return 0.5 * float(linear + turning)
