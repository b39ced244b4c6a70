"""Liquid bridges between the particles of a run, laid over the particle engine from outside.

Every sphere carries a film. Where two films overlap, a pendular bridge forms from the liquid that each sphere has in
the other's shadow; where it is stretched beyond its rupture length it breaks, and half of its liquid goes to each
sphere. The pull acts in kicks before and after a few steps of the engine, whose contacts and viscous films are its own.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from cfddem.kernels import kernel
from cfddem.particles.solver import ParticleSolver
from closures.capillary import liquid_share, pendular_pull, rupture_length
from closures.contact import reduced
from closures.numbers import capillary


class Bridges:
    """All bridges of a run.

    run              spheres in time; its rows must not be re-sorted, see :data:`NEVER`
    film             (N,) thickness of each sphere's film at the start, by row [m]
    surface_tension  [N/m]
    contact_angle    [rad]
    viscosity        of the liquid; it lengthens bridges that part fast [Pa s]
    """

    def __init__(
        self, run: ParticleSolver, film: np.ndarray, surface_tension: float, contact_angle: float, viscosity: float
    ) -> None:
        self.run = run
        self.surface_tension, self.contact_angle, self.viscosity = surface_tension, contact_angle, viscosity
        radius = run.bodies.radius
        self.free_liquid = 4.0 / 3.0 * np.pi * film * (film * film + 3.0 * radius * (film + radius))
        self.first, self.second = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self.volume, self.gap, self.room = np.zeros(0), np.zeros(0), np.zeros(0)
        self.force = np.zeros_like(run.bodies.position)
        self.formed, self.broken = 0, 0
        self.update()

    @property
    def film(self) -> np.ndarray:
        """Thickness of the film of each sphere, of the liquid that is in no bridge (N,) [m]."""
        radius = self.run.bodies.radius
        swell = 3.0 * self.free_liquid / (4.0 * np.pi * radius**3)
        return radius * np.expm1(np.log1p(swell) / 3.0)

    @property
    def liquid(self) -> float:
        """All the liquid, in films and bridges [m3]."""
        return float(self.free_liquid.sum() + self.volume.sum())

    @property
    def agglomerates(self) -> np.ndarray:
        """Number of the agglomerate that each sphere belongs to: spheres joined by bridges (N,)."""
        count = self.run.bodies.count
        joined = coo_matrix((np.ones(len(self.first)), (self.first, self.second)), shape=(count, count))
        return connected_components(joined, directed=False)[1]  # type: ignore[no-any-return]

    def kick(self, span: float) -> None:
        """Give every sphere the impulse of its bridges over a time [s]."""
        bodies = self.run.bodies
        bodies.velocity[:] += span * bodies.inverse_mass[:, None] * self.force

    def update(self) -> None:
        """Break what is stretched too far, join what overlaps, and find the pulls at the present places."""
        self._survey()
        broken, formed = self._break(), self._form()
        if broken or formed:
            self._survey()

    def _survey(self) -> None:
        """Gap of every bridge, what it can still be stretched, and the sum of pulls on each sphere."""
        bodies = self.run.bodies
        self.gap, self.room = np.empty(len(self.first)), np.empty(len(self.first))
        _pull(
            self.first,
            self.second,
            self.volume,
            bodies.position,
            bodies.velocity,
            bodies.radius,
            self.run.box,
            self.surface_tension,
            self.contact_angle,
            self.viscosity,
            self.force,
            self.gap,
            self.room,
        )

    def _break(self) -> int:
        """Take out bridges beyond their rupture length; half of the liquid goes to each sphere."""
        torn = self.room < 0.0
        if torn.any():
            for end in (self.first, self.second):
                np.add.at(self.free_liquid, end[torn], 0.5 * self.volume[torn])
            self.first, self.second, self.volume = self.first[~torn], self.second[~torn], self.volume[~torn]
            self.broken += int(torn.sum())
        return int(torn.sum())

    def _form(self) -> int:
        """Join spheres whose films overlap."""
        edges, count = self.run.edges, self.run.bodies.count
        pairs = edges.between_particles
        i, j = edges.first[:pairs].astype(np.int64), edges.second[:pairs].astype(np.int64)
        film = self.film
        near = self.run.gap[:pairs] < film[i] + film[j]
        wanted = np.unique(np.minimum(i, j)[near] * count + np.maximum(i, j)[near])
        fresh = np.setdiff1d(wanted, self.first * count + self.second, assume_unique=True)
        volume = np.array([self._draw(int(key // count), int(key % count)) for key in fresh])
        self.first = np.concatenate([self.first, fresh // count])
        self.second = np.concatenate([self.second, fresh % count])
        self.volume = np.concatenate([self.volume, volume])
        self.formed += len(fresh)
        return len(fresh)

    def _draw(self, i: int, j: int) -> float:
        """Liquid that two spheres give to a bridge; it leaves their films."""
        radius, drawn = self.run.bodies.radius, 0.0
        for one, other in ((i, j), (j, i)):
            share = self.free_liquid[one] * liquid_share(float(radius[one]), float(radius[other]))
            self.free_liquid[one] -= share
            drawn += share
        return drawn


NEVER = 1 << 60
"""As `sort_every` of a :class:`cfddem.particles.solver.ParticleSolver`: rows keep their particles."""


@kernel
def _pull(
    first,
    second,
    volume,
    position,
    velocity,
    radius,
    box,
    surface_tension,
    contact_angle,
    viscosity,
    force,
    gap,
    room,
):
    """Pull of every bridge, summed in the order of the list; the nearest image across periodic borders."""
    force[:] = 0.0
    apart = np.empty(3)
    for k in range(len(first)):
        i, j = first[k], second[k]
        square, parting = 0.0, 0.0
        for axis in range(3):
            apart[axis] = position[i, axis] - position[j, axis]
            if np.isfinite(box[axis]):
                apart[axis] -= box[axis] * np.rint(apart[axis] / box[axis])
            square += apart[axis] ** 2
            parting += apart[axis] * (velocity[i, axis] - velocity[j, axis])
        distance = np.sqrt(square)
        gap[k] = distance - radius[i] - radius[j]
        number = capillary(viscosity, max(parting / distance, 0.0), surface_tension)
        room[k] = rupture_length(number, contact_angle, volume[k]) - gap[k]
        pull = pendular_pull(surface_tension, contact_angle, reduced(radius[i], radius[j]), volume[k], gap[k])
        for axis in range(3):
            part = pull * apart[axis] / distance
            force[i, axis] -= part
            force[j, axis] += part
