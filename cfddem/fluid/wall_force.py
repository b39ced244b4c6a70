"""The pressure of a fluid on the sides of its box, and its force on smooth walls and on sides that are walls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cfddem.fluid.boundaries import Side
from cfddem.fluid.cut_cells import CutCells
from cfddem.fluid.grid import HIGH, LOW, Array
from cfddem.fluid.momentum import slip_weight
from cfddem.fluid.solver import FluidSolver

AROUND = 2.5
"""Faces so near a place on a wall give the shear rate there, in cells."""

AT_ONCE = 4_000
"""Places that are fitted together, to save memory."""

SMOOTH = "smooth"
"""Name of all smooth walls together, beside the names of sides."""


def loads_on_walls(fluid: FluidSolver, centre: Any) -> dict[str, tuple[Array, Array]]:
    """Force and torque of the fluid on every side that is a wall at least in part, and on all smooth walls.

    The pressure is p', without the hydrostatic one.

    centre   about which the torques are (3,) [m]
    returns  name of a side, or `SMOOTH` -> force (3,) [N], torque (3,) [N m]
    """
    slope = fluid.cell_pressure_gradient()  # ranks exchange values here, so all of them do, whichever sides they touch
    fluid.rates()  # brings the effective viscosity up to date
    viscosity = fluid.grid.inner(fluid.fields.effective_viscosity)
    parts = {side.name: [_on_side(fluid, side, slope, viscosity)] for side in fluid.boundaries.sides}
    if fluid.grid.walls:
        parts[SMOOTH] = [force_on_walls(fluid), pressure_on_walls(fluid)]
    loads = {}
    for name in (*(side.name for side in fluid.boundaries.box.sides), *([SMOOTH] if fluid.grid.walls else [])):
        rows = np.zeros((0, 6))
        for place, force in parts.get(name, []):
            rows = np.concatenate([rows, np.concatenate([force, np.cross(place - centre, force)], axis=1)])
        total = np.array(fluid.communicator.sum(rows, axis=0))
        loads[name] = total[:3], total[3:]
    return loads


def pressure_fall(fluid: FluidSolver, axis: int) -> float:
    """Mean pressure p' over the open area of the low side of the box, less that of the high side [Pa]; of all ranks.

    axis     0, 1, 2 for x, y, z; a periodic one has the fall that drives its flow
    returns  NaN where a side has no open face
    """
    if fluid.boundaries.periodic[axis]:
        return float(fluid.boundaries.driving[axis] * fluid.grid.whole.size[axis])
    slope = fluid.cell_pressure_gradient()  # of all ranks, as in `loads_on_walls`
    force, area = ({False: np.zeros(0), True: np.zeros(0)} for _ in range(2))
    for side in fluid.boundaries.sides:
        if side.axis == axis:
            area[side.high] = fluid.boundaries.open_share(side) * side.layer(fluid.grid.open, -1 if side.high else 0)
            force[side.high] = area[side.high] * pressure_on_side(fluid, side, slope)
    total = fluid.communicator.sum
    forces, areas = ([float(total(of[high])) for high in (False, True)] for of in (force, area))
    low, high = (f / a if a > 0.0 else math.nan for f, a in zip(forces, areas))
    return low - high


def pressure_on_side(fluid: FluidSolver, side: Side, slope: Array) -> Array:
    r"""Pressure p' on the faces of a side, over its plane without ghosts [Pa].

    Outlets have the one that is given. Elsewhere half a cell lies between the side and the centres of the cells. With
    the gradient g of the cell, and the drag D per volume that acts at the side and at the next face inward, the
    pressure falls there, model A, by

    .. math:: -g\,(1 + \varepsilon_\mathrm{face} - \varepsilon_\mathrm{cell}) + D_\mathrm{side} - D_\mathrm{face}

    per length: the inertia of the next face, what the particles in the cell carry of the gradient, and the drag of the
    half cell. So this pressure, the loads of the particles and the weight of both phases are in balance where a bed
    that lies on the floor ends within the lowest cells, too. A line through the pressures of two cells does not do so.

    slope  gradient of the pressure in cells (3, nz, ny, nx) [Pa/m]
    """
    d, fields, end = side.axis, fluid.fields, -1 if side.high else 0
    face = side.face(fluid.grid)
    cell, inward = (face - 1, -1) if side.high else (face, 1)

    def plane(values: Any, at: int) -> Any:
        return side.layer(values, at)[LOW:-HIGH, LOW:-HIGH]

    def drag(at: int, velocity: Array) -> Array:
        return plane(fields.drag[d], at) * velocity - plane(fields.drag_momentum[d], at)

    here, beyond = (plane(fields.mean_voidage, at) for at in (cell, cell + inward))
    between, normal = 0.5 * (here + beyond), fields.velocity[d]
    at_side = drag(cell, plane(normal, face))
    next_face = [drag(at, plane(normal, face + inward)) for at in (cell, cell + inward)]
    weights = [slip_weight.py_func(between, voidage, fluid.model_b) for voidage in (here, beyond)]
    at_face = 0.5 * (weights[0] * next_face[0] + weights[1] * next_face[1])
    sources = [plane(fields.source[d], at) for at in (cell, cell + inward)]
    steepness = side.layer(slope[d], end)
    more = (
        steepness * (1.0 - fluid.model_b) * (between - here)
        + at_face - at_side
        + 0.5 * (sources[0] - sources[1])
    )  # fmt: skip
    fall = steepness + plane(fluid.faces.solved[d], face + inward) * more
    pressure = side.layer(fluid.pressure, end) - side.inward * 0.5 * fluid.grid.spacing[d] * fall
    return np.where(side.outlet[LOW:-HIGH, LOW:-HIGH], side.pressure[LOW:-HIGH, LOW:-HIGH], pressure)


def _on_side(fluid: FluidSolver, side: Side, slope: Array, viscosity: Array) -> tuple[Array, Array]:
    """Pressure and shear stress on the faces of a side that are walls: places (n, 3) [m], and forces (n, 3) [N].

    slope      gradient of the pressure in cells (3, nz, ny, nx) [Pa/m]
    viscosity  effective one of the fluid in cells (nz, ny, nx) [Pa s]
    """
    grid, d, end = fluid.grid, side.axis, -1 if side.high else 0

    def plane(values: Any) -> Any:
        return values[..., LOW:-HIGH, LOW:-HIGH]

    apertures = np.broadcast_to(fluid.boundaries.cut.of_faces(d), grid.padded_shape)
    share = plane(side.layer(apertures, side.face(grid))) * side.layer(grid.open, end)
    here = (share > 0.0) & ~np.isin(side.owner, side.inlets) & ~plane(side.outlet)
    area, half = grid.face_area(d) * share[here], 0.5 * grid.spacing[d]
    place = np.stack([side.layer(coordinate, end)[here] for coordinate in np.broadcast_arrays(*grid.faces(d))], axis=-1)
    pressure = pressure_on_side(fluid, side, slope)[here]
    at_wall = side.layer(viscosity, end)[here]
    sticks = plane(side.mirror)[here] < 0.0
    velocity = np.moveaxis(fluid.velocity, -1, 0)
    force = np.zeros((len(area), 3))
    for e in range(3):
        slip = side.layer(velocity[e], end)[here] - plane(side.wall)[e][here]
        force[:, e] = -side.inward * pressure * area if e == d else sticks * at_wall * slip / half * area
    return place, force


def force_on_walls(fluid: FluidSolver) -> tuple[Array, Array]:
    r"""Viscous force of the fluid on the smooth wall of every cut cell: places (n, 3) [m], and forces (n, 3) [N].

    .. math:: \tau\cdot n = \varepsilon\mu\,\partial_n (u - W)

    at the wall, whose normal n points into the fluid. W is the velocity of a rigid body that moves as the wall does
    there: the wall's velocity w, and :math:`\delta\,w\cdot\nabla n` more at the distance :math:`\delta`. A rigid
    body has no stress, and what is left of the velocity is small where a wall turns with its fluid. The place is the
    point of the wall nearest to the centre of the cell. The pressure is not in the force: see `pressure_on_walls`.
    """
    cut, grid = fluid.boundaries.cut, fluid.grid
    if not isinstance(cut, CutCells):
        return np.zeros((0, 3)), np.zeros((0, 3))
    wetted = np.linalg.norm(wall_area(cut), axis=0)
    here = np.flatnonzero(wetted)
    place = _places(cut, here)
    fluid.rates()  # brings the effective viscosity up to date
    pull = (wetted * grid.inner(fluid.fields.effective_viscosity)).ravel()[here]
    return place, pull[:, None] * np.stack([_shear(fluid, cut, here, place, d) for d in range(3)], axis=-1)


def pressure_on_walls(fluid: FluidSolver) -> tuple[Array, Array]:
    """Force of the pressure p' on the smooth wall of every cut cell, as `force_on_walls`.

    The pressure of a cell is that at its centre; its gradient there leads to the wall.
    """
    cut, grid = fluid.boundaries.cut, fluid.grid
    if not isinstance(cut, CutCells):
        return np.zeros((0, 3)), np.zeros((0, 3))
    area = wall_area(cut).reshape(3, -1)
    here = np.flatnonzero(area.any(axis=0))
    place = _places(cut, here)
    centre = np.stack([np.ravel(coordinate)[here] for coordinate in np.broadcast_arrays(*grid.centres())], axis=-1)
    slope = fluid.cell_pressure_gradient().reshape(3, -1)[:, here].T
    pressure = fluid.pressure.ravel()[here] + (slope * (place - centre)).sum(axis=1)
    return place, -pressure[:, None] * area[:, here].T


def wall_area(cut: CutCells) -> Array:
    """Area of the wall in every cell, a vector into the fluid (3, nz, ny, nx) [m2]."""
    grid = cut.grid
    whole = cut.aperture + cut.thin  # thin walls have no part in it
    area = [np.diff(grid.inner_faces(whole[d], d), axis=2 - d) * grid.face_area(d) for d in range(3)]
    return np.array(area) * grid.open


def _places(cut: CutCells, here: Any) -> Array:
    """Points of the wall nearest to the centres of some cells (n, 3) [m]."""
    return _on_wall(cut, [np.ravel(coordinate)[here] for coordinate in np.broadcast_arrays(*cut.grid.centres())])


# ---------------------------------------------------------------- shear rates


def _shear(fluid: FluidSolver, cut: CutCells, here: Any, place: Array, d: int) -> Array:
    r"""Shear rate of component d, less that of a rigid body that moves with the wall, at places on it (n,) [1/s]."""
    shape = cut.volume.shape
    k, j, i = (
        offset.ravel() for offset in np.meshgrid(*(np.arange(-2, 3 + (e == d)) for e in (2, 1, 0)), indexing="ij")
    )
    cells = cut.grid.inner(np.arange(cut.volume.size).reshape(shape)).ravel()[here]
    faces = cells[:, None] + (k * shape[1] + j) * shape[2] + i
    at = [np.ravel(coordinate) for coordinate in cut.points([0.5 * (e != d) for e in range(3)])]
    relative = fluid.fields.velocity[d].ravel() - cut.sliding[d].ravel()
    slides = np.unique(faces[(cut.sliding[d].ravel() * cut.distance[d].ravel() != 0.0)[faces]])
    if slides.size:
        wall = _on_wall(cut, [coordinate[slides] for coordinate in at])
        relative[slides] -= cut.distance[d].ravel()[slides] * _turning(cut, list(wall.T))[:, d]
    rate = np.zeros(here.size)
    for begin in range(0, here.size, AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        share = _fit(
            fluid, cut, faces[some], np.stack([coordinate[faces[some]] for coordinate in at], axis=-1), place[some], d
        )
        rate[some] = (share * np.where(share != 0.0, relative[faces[some]], 0.0)).sum(axis=1)
    return rate


def _fit(fluid: FluidSolver, cut: CutCells, faces: Any, at: Array, place: Array, d: int) -> Array:
    r"""Weights of velocities on faces (n, m) in the shear rate g at places on a wall.

    Around a place the velocity over the distance is :math:`g + a\cdot t - c\,\delta`, with t along the wall: a fit of
    least squares to the means on faces, the more the farther from the wall and the nearer to the place.

    at  centres of the faces (n, m, 3) [m]
    """
    distance, depth, scale = cut.distance[d].ravel()[faces], cut.depth[d].ravel()[faces], min(cut.grid.spacing)
    usable = (distance > 0.0) & (fluid.faces.solved[d].ravel()[faces] > 0.0)
    along = at - place[:, None]
    near = 1.0 - ((along / np.array(cut.grid.spacing)) ** 2).sum(axis=-1) / AROUND**2
    weight = usable * (distance * np.maximum(near, 0.0)) ** 2
    normal = np.stack(_slopes(cut, list(place.T)), axis=-1)[:, None]
    along -= (along * normal).sum(axis=-1, keepdims=True) * normal
    model = np.concatenate([np.ones((*faces.shape, 1)), along / scale, depth[..., None] / scale], axis=-1)
    moments = np.einsum("nfa,nf,nfb->nab", model, weight, model)
    inverse = np.linalg.pinv(moments, rcond=1e-6, hermitian=True)  # a place may see no faces to one side
    return np.asarray(np.einsum("na,nfa,nf->nf", inverse[:, 0], model, weight) / np.maximum(distance, 1e-300))


def _turning(cut: CutCells, points: list[Array]) -> Array:
    """Change of the normal along the velocity of the wall, w.grad n at its points (n, 3) [1/s]."""
    sliding, step = cut.surface.velocity(*points), 1e-2 * min(cut.grid.spacing)
    speed = np.sqrt(sliding[0] ** 2 + sliding[1] ** 2 + sliding[2] ** 2)
    along = [component / np.maximum(speed, 1e-300) for component in sliding]
    ahead, behind = (_slopes(cut, [x + side * step * n for x, n in zip(points, along)]) for side in (1.0, -1.0))
    return np.asarray((speed * (np.array(ahead) - np.array(behind)) / (2.0 * step)).T)


def _slopes(cut: CutCells, points: Sequence[Array]) -> list[Array]:
    """Gradient of the distance, which is the normal into the fluid."""
    step = 1e-3 * min(cut.grid.spacing)
    slopes = []
    for d in range(3):
        high, low = ([x + side * step * (e == d) for e, x in enumerate(points)] for side in (1.0, -1.0))
        slopes.append((cut.surface.distance(*high) - cut.surface.distance(*low)) / (2.0 * step))
    return slopes


def _on_wall(cut: CutCells, points: Sequence[Array]) -> Array:
    """The points of the wall nearest to these (n, 3)."""
    away = cut.surface.distance(*points)
    return np.stack([x - away * n for x, n in zip(points, _slopes(cut, points))], axis=-1)
