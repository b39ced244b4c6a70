r"""Extra drag of particles beside walls, by the laws of :mod:`closures.wall_drag`.

.. math:: F = 6\pi\eta R\,\sum_w\left[(\lambda_n-1)\,nn + (\lambda_t-1)(1-nn)\right]\cdot(u-v)

over the nearest wall or all walls, with n the normal of the wall, less what the films of the particle solver apply.
Every flat or round face is a wall: a capped cylinder has three. The sum over walls is an approximation. At finite Re it
is added to the drag of the drag law: creeping flow near the wall, which is too much far from it.

It is implicit in every direction (:mod:`cfddem.coupling.resistance_by_direction`). In a step in which a film takes
over, the drag towards the wall has the part R/h for as long as the film does not act.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, threaded
from cfddem.backend.errors import InputError
from cfddem.coupling.terms import ForceTerms
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles
from cfddem.particles.vectors import dot, flat, of_row
from cfddem.particles.walls.arrays import wall_arrays
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.nearest_point import nearest
from cfddem.particles.walls.wall import Wall
from closures.wall_drag import along_wall, film_along_wall, towards_wall

CLOSEST = 1e-4
"""Gap over the radius, at least; what grows further is in the films."""


SEEN = Field(
    "wall_drag_flow", "m/s", 3, "memory", np.nan, meaning="fluid velocity at the particle before the last fluid step"
)
"""NaN in inserted particles, which have seen none."""


class WallTerms(NamedTuple):
    """Extra drag beside walls."""

    conductance: Array  # the largest in any direction (N,) [kg/s]
    lacks: Array  # what the resistance lacks of it, by direction (N, 3, 3) [kg/s]


class WallDrag(FluidForce):
    """Extra drag beside walls.

    walls   at rest; no meshes
    which   "nearest" or "all"
    film    whether films resist approach, which takes R/h out of the drag
    shear   whether they resist sliding
    """

    name, lines, fields = "wall_drag", ("drag",), (SEEN,)

    def __init__(
        self, walls: Sequence[Wall], which: Literal["nearest", "all"], *, film: bool, shear: bool = False
    ) -> None:
        for wall in walls:
            if isinstance(wall, Mesh) or wall.sweep() != 0.0:
                raise InputError("wall_drag", type(wall).__name__, "walls at rest that are no meshes")
        flat_walls = flat(wall_arrays(walls))
        self._surfaces, self._options = (flat_walls.kind, flat_walls.shape), (which == "all", film, shear)

    def act(self, terms: ForceTerms) -> None:
        """Resist the slip, by direction; the fluid is foreseen to change as much as in the last step."""
        beside, flow, before = self.terms(terms.particles, terms.step), _flow(terms), terms.particles[SEEN.name]
        terms.resist("drag", beside.conductance, beside.lacks)
        if terms.last_step > 0.0:
            change = (terms.step / terms.last_step) * (flow - before)
            terms.foreseen = np.where(np.isnan(before), 0.0, 0.5 * change)  # drag sees the mean over the step

    def end(self, terms: ForceTerms) -> None:
        """Store the fluid velocity before the step."""
        terms.particles[SEEN.name][:] = _flow(terms)

    def terms(self, particles: Particles, step: float = 0.0) -> WallTerms:
        """Extra resistance of every particle over a step [s]."""
        terms, way = WallTerms(np.empty(particles.count), np.empty((particles.count, 3, 3))), step * particles.velocity
        _beside(particles.position, particles.radius, particles.viscosity, way, self._surfaces, self._options, terms)
        return terms


def _flow(terms: ForceTerms) -> Array:
    """Velocity of the fluid at the particles before the step (N, 3) [m/s]."""
    return np.asarray(terms.flow.slip + terms.particles.velocity)


@inline
def _factors(gap, rise, film, shear):
    """What a wall adds to the drag factor towards it and along it, over a step in which the gap rises so much."""
    beyond = 1.0 if gap >= 1.0 else 0.0  # the share of the step in which no film acts
    if rise != 0.0:
        beyond = min(max((max(gap, gap + rise) - 1.0) / abs(rise), 0.0), 1.0)
    across = towards_wall(gap) - 1.0 + (beyond / max(gap, 1.0) if film else 1.0 / gap)
    along = along_wall(gap) - 1.0
    if shear:
        along -= film_along_wall(gap)
    return across, along


@inline
def _beside_one(place, radius, viscosity, way, surfaces, options, n, terms):
    kind, shape = surfaces
    stokes, closest = 6.0 * math.pi * viscosity * radius, math.inf
    largest, lacks = 0.0, terms.lacks[n]
    lacks[:] = 0.0
    for w in range(len(kind)):
        normal, distance, _, _, _, _ = nearest(kind, shape, w, place)
        gap = max(distance / radius - 1.0, CLOSEST)
        if not options[0] and gap >= closest:
            continue
        closest = gap
        across, along = _factors(gap, dot(way, normal) / radius, options[1], options[2])
        most = max(across, along)
        largest = most + (largest if options[0] else 0.0)
        for d in range(3):
            for e in range(3):
                lack = (most - along) * (d == e) + (along - across) * normal[d] * normal[e]
                lacks[d, e] = stokes * lack + (lacks[d, e] if options[0] else 0.0)
    terms.conductance[n] = stokes * largest


@threaded
def _beside(position, radius, viscosity, way, surfaces, options, terms):
    """Resistance of every particle on its way over a step [m]."""
    for n in prange(len(radius)):
        _beside_one(of_row(position, n), radius[n], viscosity[n], of_row(way, n), surfaces, options, n, terms)
