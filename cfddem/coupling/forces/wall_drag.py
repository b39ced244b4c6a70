r"""Extra drag of particles beside walls, by the laws of :mod:`closures.wall_drag`.

.. math:: F = 6\pi\eta R\,\sum_w\left[(\lambda_n-1)\,nn + (\lambda_t-1)(1-nn)\right]\cdot(u-v)

over the nearest wall or all walls, with n the normal of the wall, less what the films of the particle solver apply.
Every flat or round face is a wall: a capped cylinder has three. The sum over walls is an approximation. At finite Re it
is added to the drag of the drag law: creeping flow near the wall, which is too much far from it.

The transfer of momentum is implicit with one number per particle, a conductance c: that along the slip, but with the
drag at least two thirds of the resistance b in any direction. The rest of the force acts through it, too, with the slip
at the start of the step. So motion in that direction changes by the factor 1 - h b/m/(1 + theta lambda) in a step, with
lambda = h c/m and theta of :mod:`cfddem.coupling.transfer`. It is above -1/2 in any step.
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
from cfddem.particles.state import Particles
from cfddem.particles.vectors import NOTHING, dot, flat, minus, of_row, plus, times
from cfddem.particles.walls.arrays import wall_arrays
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.nearest_point import nearest
from cfddem.particles.walls.wall import Wall
from closures.wall_drag import along_wall, film_along_wall, towards_wall

CLOSEST = 1e-4
"""Gap over the radius, at least; what grows further is in the films."""


class WallTerms(NamedTuple):
    """Extra drag beside walls."""

    conductance: Array  # (N,) [kg/s]
    force: Array  # the rest (N, 3) [N]


class WallDrag(FluidForce):
    """Extra drag beside walls.

    walls   at rest; no meshes
    which   "nearest" or "all"
    film    whether films resist approach, which takes R/h out of the drag
    shear   whether they resist sliding
    """

    name, lines = "wall_drag", ("drag",)

    def __init__(
        self, walls: Sequence[Wall], which: Literal["nearest", "all"], *, film: bool, shear: bool = False
    ) -> None:
        for wall in walls:
            if isinstance(wall, Mesh) or wall.sweep() != 0.0:
                raise InputError("wall_drag", type(wall).__name__, "walls at rest that are no meshes")
        flat_walls = flat(wall_arrays(walls))
        self._surfaces, self._options = (flat_walls.kind, flat_walls.shape), (which == "all", film, shear)

    def act(self, terms: ForceTerms) -> None:
        """Resist the slip, and turn it."""
        beside = self.terms(terms.particles, terms.flow.slip)
        terms.resist("drag", beside.conductance)
        terms.turn("drag", beside.force)

    def terms(self, particles: Particles, slip: Array) -> WallTerms:
        """Extra drag at the slip u - v (N, 3) [m/s]."""
        terms = WallTerms(np.empty(particles.count), np.empty((particles.count, 3)))
        _beside(
            particles.position, particles.radius, particles.viscosity, slip, self._surfaces, self._options, terms,
        )  # fmt: skip
        return terms


@inline
def _factors(gap, film, shear):
    """What a wall adds to the drag factor towards it and along it."""
    across = towards_wall(gap) - 1.0
    if not film or gap >= 1.0:
        across += 1.0 / gap
    along = along_wall(gap) - 1.0
    if shear:
        along -= film_along_wall(gap)
    return across, along


@inline
def _force(normal, gap, slip, options):
    """Extra force of a wall over Stokes' conductance, and the larger of its factors."""
    across, along = _factors(gap, options[1], options[2])
    return plus(times((across - along) * dot(normal, slip), normal), times(along, slip)), max(across, along)


@inline
def _beside_one(place, radius, viscosity, slip, surfaces, options, n, terms):
    kind, shape = surfaces
    force, largest, closest = NOTHING, 0.0, math.inf
    for w in range(len(kind)):
        normal, distance, _, _, _, _ = nearest(kind, shape, w, place)
        gap = max(distance / radius - 1.0, CLOSEST)
        if not options[0] and gap >= closest:
            continue
        closest = gap
        extra, factor = _force(normal, gap, slip, options)
        force, largest = (plus(force, extra), largest + factor) if options[0] else (extra, factor)
    stokes, square = 6.0 * math.pi * viscosity * radius, dot(slip, slip)
    least = max((2.0 * largest - 1.0) / 3.0, 0.0)  # two thirds of all, of which Stokes' drag is 1
    factor = max(dot(force, slip) / square, least) if square > 0.0 else least
    terms.conductance[n] = stokes * factor
    aside = times(stokes, minus(force, times(factor, slip)))
    terms.force[n, 0], terms.force[n, 1], terms.force[n, 2] = aside


@threaded
def _beside(position, radius, viscosity, slip, surfaces, options, terms):
    """Conductance and the rest of the force of every particle."""
    for n in prange(len(radius)):
        _beside_one(of_row(position, n), radius[n], viscosity[n], of_row(slip, n), surfaces, options, n, terms)
