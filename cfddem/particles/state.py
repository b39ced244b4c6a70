"""The particles: plain arrays in SI units, one row for each particle; ids name particles, rows do not.

Where several processes share a run, each owns some of the particles. The rows of a process are [owned | ghosts]: ghosts
are copies of particles that other processes own, as far as the owned ones may meet them. Loops over particles run over
the owned rows; loops over pairs run over all pairs with an owned member.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError
from cfddem.backend.named import named_arrays
from cfddem.model.fields import Field, Phase, Table

PARTICLE_FIELDS = (
    Field("position", "m", 3, halo=("start", "motion"), snapshot=True, meaning="position of the centre"),
    Field(
        "velocity",
        "m/s",
        3,
        halo=("start", "film", "bridge", "motion", "work"),
        snapshot=True,
        meaning="velocity",
    ),
    Field(
        "spin",
        "rad/s",
        3,
        halo=("start", "film", "bridge", "motion", "work"),
        snapshot=True,
        meaning="angular velocity",
    ),
    Field("radius", "m", halo=("start",), snapshot=True, meaning="radius"),
    Field("density", "kg/m3", meaning="density"),
    Field("inverse_mass", "1/kg", halo=("start",), meaning="1/(m + added mass), 0 for a particle that nothing moves"),
    Field("inverse_inertia", "1/(kg m2)", meaning="1/I, 0 for a particle that nothing moves"),
    Field("material", "1", dtype=np.int32, halo=("start",), meaning="row of the pair table"),
    Field("id", "1", dtype=np.int64, snapshot=True, meaning="name of the particle, which never changes"),
    Field("viscosity", "Pa s", halo=("start",), meaning="viscosity of the fluid around the particle, for its films"),
    Field("applied", "N", 3, meaning="external force; gravity of the particle solver is added to it"),
    Field("force", "N", 3, halo=("work",), snapshot=True, meaning="sum of all forces at the last step"),
    Field("torque", "N m", 3, halo=("work",), meaning="sum of all torques at the last step"),
)
"""Fields of every particle; laws and users may declare more.

With a fluid the coupling sets `applied` in every fluid step, weight and buoyancy included, and the particle solver has
no gravity of its own. Without a fluid it is the user's.
"""


class Particles(Table):
    """The particles: one array for each declared field, one row for each particle; ids name particles, rows do not."""

    _ghosts = 0

    @property
    def count(self) -> int:
        """Number of rows: of the particles that this process owns, and of its ghosts."""
        return self.rows

    @property
    def owned(self) -> int:
        """Number of particles that this process owns; their rows come first."""
        return self.rows - self._ghosts

    def add_ghosts(self, copies: Particles) -> None:
        """Append copies of particles that other processes own."""
        self.append(copies)
        self.set_ghosts(self._ghosts + copies.rows)

    def set_ghosts(self, number: int) -> None:
        """Declare that the last rows are ghosts."""
        object.__setattr__(self, "_ghosts", number)

    def drop_ghosts(self) -> None:
        """Remove the rows of all ghosts."""
        if self._ghosts:
            self.keep(slice(self.owned))
            self.set_ghosts(0)

    def without_ghosts(self) -> Particles:
        """The rows that this process owns, as a table over the same arrays."""
        if not self._ghosts:
            return self
        owned = Particles.__new__(Particles)
        owned._set(self.fields, {name: array[: self.owned] for name, array in self.arrays.items()}, self.owned)
        return owned

    def halo_fields(self, phase: Phase) -> list[str]:
        """Names of the fields that ghosts receive in a phase of the step."""
        return [name for name, field in self.fields.items() if phase in field.halo]

    @property
    def view(self) -> Any:
        """The arrays of `PARTICLE_FIELDS` as loops take them: vectors one after the other; nothing is copied."""
        return self.view_with(())

    def view_with(self, fields: Iterable[Field]) -> Any:
        """The arrays of `PARTICLE_FIELDS` and of more declared fields, as loops take them, and the number `owned`."""
        names = (*(field.name for field in PARTICLE_FIELDS), *(field.name for field in fields))
        structure = named_arrays("Particles", (*names, "owned"))
        return structure(*(self[name].reshape(-1) for name in names), owned=self.owned)

    def by_id(self, values: np.ndarray) -> np.ndarray:
        """Rows of the particles (N, ...) in the order of their ids; zero for ids that are gone."""
        most = int(self.id.max(initial=-1))  # local: rows of this rank
        placed = np.zeros((most + 1, *values.shape[1:]), values.dtype)
        placed[self.id] = values
        return placed

    @property
    def volume(self) -> np.ndarray:
        """Volume of each particle (N,) [m3]."""
        return sphere_volume(self.radius)

    @property
    def mass(self) -> np.ndarray:
        """Mass of each particle (N,) [kg]."""
        mass: np.ndarray = self.density * (4.0 / 3.0) * np.pi * self.radius**3
        return mass


def sphere_volume(radius: np.ndarray) -> np.ndarray:
    """Volume of spheres (N,) [m3]."""
    return np.asarray((4.0 / 3.0) * np.pi * (radius * radius * radius))  # faster than the power


def rows_of(ids: np.ndarray, among: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Row in `among` (N,) of each of these ids; -1 for those that are not in it (n,) int32.

    order  rows in the order of their ids (N,)
    """
    rows_of_ids = np.full(len(ids), -1, np.int32)
    place = np.searchsorted(among, ids, sorter=order)
    inside = np.flatnonzero(place < len(order))
    rows = order[place[inside]]
    same = among[rows] == ids[inside]
    rows_of_ids[inside[same]] = rows[same]
    return rows_of_ids


def make_particles(
    position: ArrayLike,
    radius: ArrayLike,
    density: ArrayLike,
    *,
    velocity: ArrayLike = 0.0,
    spin: ArrayLike = 0.0,
    material: ArrayLike = 0,
    viscosity: ArrayLike = 0.0,
    fixed: ArrayLike = False,
) -> Particles:
    """Make particles from what distinguishes them.

    position  (N, 3) [m]
    radius    (N,) or one for all [m]
    density   (N,) or one for all [kg/m3]
    velocity, spin  (N, 3) or one for all [m/s, rad/s]
    material  (N,) or one for all, row of the pair table
    viscosity of the fluid around the particles [Pa s]
    fixed     (N,) or one for all: particles that nothing moves

    >>> beads = make_particles([[0.0, 0.0, 0.01], [0.0, 0.0, 0.02]], radius=1e-3, density=2500.0)
    >>> beads.count, round(float(beads.mass[0]) * 1e6, 2)
    (2, 10.47)
    """
    places = np.ascontiguousarray(np.atleast_2d(np.asarray(position, float)))
    count = len(places)

    def scalars(value: ArrayLike, dtype: type = float) -> np.ndarray:
        return np.ascontiguousarray(np.broadcast_to(np.asarray(value, dtype), (count,))).copy()

    def vectors(value: ArrayLike) -> np.ndarray:
        return np.ascontiguousarray(np.broadcast_to(np.asarray(value, float), (count, 3))).copy()

    radii, densities = scalars(radius), scalars(density)
    for field, values in (("radius", radii), ("density", densities)):
        refused = np.flatnonzero(~((values > 0) & np.isfinite(values)))
        if len(refused):
            raise InputError(f"{field} of particle {refused[0]}", float(values[refused[0]]), "above 0")
    mass = densities * (4.0 / 3.0) * np.pi * radii**3
    free = ~scalars(fixed, bool)
    return Particles(
        PARTICLE_FIELDS,
        count,
        {
            "position": places,
            "velocity": vectors(velocity),
            "spin": vectors(spin),
            "radius": radii,
            "density": densities,
            "inverse_mass": free / mass,
            "inverse_inertia": free / (0.4 * mass * radii**2),
            "material": scalars(material, np.int32),
            "id": np.arange(count),
            "viscosity": scalars(viscosity),
        },
    )


def particles_in(kept: Mapping[str, np.ndarray]) -> Particles:
    """Particles with `PARTICLE_FIELDS` from a checkpoint of particles; it may hold more fields, which are left out."""
    particles = Particles(PARTICLE_FIELDS, 0)
    particles.restore({field.name: kept[field.name] for field in PARTICLE_FIELDS})
    return particles


def kinetic_energy(spheres: Particles, communicator: Communicator = SERIAL) -> float:
    """Kinetic energy of all particles, spin included [J]."""
    own = slice(spheres.owned)
    mass, radius = spheres.mass[own, None], spheres.radius[own, None]
    linear = communicator.sum(mass * spheres.velocity[own] ** 2)
    turning = communicator.sum(0.4 * mass * radius**2 * spheres.spin[own] ** 2)
    return 0.5 * float(linear + turning)


def added_mass(spheres: Particles) -> np.ndarray:
    """Inertia of every particle beyond its mass: that of the fluid that moves with it (N,) [kg]; zero if fixed."""
    free = spheres.inverse_mass > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(free, 1.0 / spheres.inverse_mass - spheres.mass, 0.0)


def added_mass_energy(spheres: Particles, communicator: Communicator = SERIAL) -> float:
    """Kinetic energy of the added mass of all particles [J]."""
    own = slice(spheres.owned)
    return 0.5 * float(communicator.sum(added_mass(spheres)[own, None] * spheres.velocity[own] ** 2))
