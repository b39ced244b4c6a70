"""The particles: plain arrays in SI units, one row a particle; ids name particles, rows do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.errors import InputError


class Bodies(NamedTuple):
    """The arrays of N particles, as compiled loops take them."""

    position: np.ndarray  # (N, 3) [m]
    velocity: np.ndarray  # (N, 3) [m/s]
    spin: np.ndarray  # (N, 3) [rad/s]
    radius: np.ndarray  # (N,) [m]
    density: np.ndarray  # (N,) [kg/m3]
    inverse_mass: np.ndarray  # (N,) [1/kg], 0 for a body that nothing moves
    inverse_inertia: np.ndarray  # (N,) [1/(kg m2)]
    material: np.ndarray  # (N,) int32, row of the pair table
    id: np.ndarray  # (N,) int64, never changes
    viscosity: np.ndarray  # (N,) of the fluid around the particle, for its films [Pa s]
    applied: np.ndarray  # (N, 3) force from outside: gravity, fluid, a hand [N]
    force: np.ndarray  # (N, 3) sum of all forces at the last step [N]
    torque: np.ndarray  # (N, 3) [N m]
    film_rate: np.ndarray  # (N,) resistance of all the particle's films over its mass [1/s]

    @property
    def count(self) -> int:  # type: ignore[override]
        """Number of particles."""
        return len(self.radius)

    def reorder(self, order: np.ndarray) -> None:
        """Put the particles into another order, in place; their ids go with them."""
        for array in self:
            array[:] = array[order]

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
        return self.density * (4.0 / 3.0) * np.pi * self.radius**3


def bodies(
    position: np.ndarray,
    radius: np.ndarray | float,
    density: np.ndarray | float,
    *,
    velocity: np.ndarray | float = 0.0,
    spin: np.ndarray | float = 0.0,
    material: np.ndarray | int = 0,
    viscosity: np.ndarray | float = 0.0,
    fixed: np.ndarray | bool = False,
) -> Bodies:
    """Make particles from what distinguishes them.

    position  (N, 3) [m]
    radius    (N,) or one for all [m]
    density   (N,) or one for all [kg/m3]
    velocity, spin  (N, 3) or one for all [m/s, rad/s]
    material  (N,) or one for all, row of the pair table
    viscosity of the fluid around the particles [Pa s]
    fixed     (N,) or one for all: bodies that nothing moves
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
    return Bodies(
        position=position.copy(),
        velocity=vectors(velocity),
        spin=vectors(spin),
        radius=radius,
        density=density,
        inverse_mass=free / mass,
        inverse_inertia=free / (0.4 * mass * radius**2),
        material=scalars(material, np.int32),  # type: ignore[arg-type]
        id=np.arange(count, dtype=np.int64),
        viscosity=scalars(viscosity),
        applied=vectors(0.0),
        force=vectors(0.0),
        torque=vectors(0.0),
        film_rate=scalars(0.0),
    )


def kinetic_energy(spheres: Bodies) -> float:
    """Kinetic energy of all particles, spin included [J]."""
    mass = spheres.mass
    linear = np.sum(mass[:, None] * spheres.velocity**2)
    turning = np.sum(0.4 * mass[:, None] * spheres.radius[:, None] ** 2 * spheres.spin**2)
    return 0.5 * float(linear + turning)
