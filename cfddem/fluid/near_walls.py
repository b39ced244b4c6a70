r"""Momentum of the fluid near smooth walls.

The momentum cell of a face has half of both of its cells. Its own faces are sections, too, and its wall is what is
missing among them. Near a wall that moves with w, a velocity is

.. math:: u = w + g\,\delta - c\,\delta^2

with the distance :math:`\delta`. The shear rate g at the wall and the curvature c follow from the velocity of the face
and from that of the next one away from the wall; both are means over open parts, as are :math:`\delta` and
:math:`\delta^2`. The wall pulls by :math:`\mu g`. A gradient between two faces is the difference of their velocities
over the spacing, corrected for the places of their open parts, so that this u has its exact gradient.

The stress is :math:`\varepsilon\mu\nabla u`: its transposed part, whose divergence vanishes at a uniform viscosity, is
left out beside walls. What is stiffer than in a whole cell is implicit, as the drag is: small cells do not limit the
step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.cut_cells import CutCells, section
from cfddem.fluid.fields import CellFields
from cfddem.fluid.grid import Array, Grid, on_faces
from cfddem.fluid.momentum import implicitness
from cfddem.fluid.near_walls_loops import BLOCK, FULL, cut_transport, hold_near_walls, shut

LEAST_RISE = 0.4
"""How much farther from the wall the next face must be, for a curvature to be taken, in cells."""


DIGITS = 11
"""Decimals of weights that are kept, over the largest square of the inverse spacing."""

OF_A_BLOCK = 4
"""What a block of faces takes besides, in faces."""


class Faces(NamedTuple):
    """Faces of one component near walls, in blocks of equally many faces of one plane of the grid; the last block of a
    plane is filled up with copies of its last face. Blocks of one pattern have the same walls around them: the planes
    of an upright column have one pattern each. Flat indices of padded fields are unsigned: none counts from the end.

    Along each direction e of three there are eight weights: of the face before, the face itself and the next ones away
    from the wall of both in the stress below, and of the face itself, the one behind and the next ones in that above.
    Each has the area of its momentum face over the open volume in it.
    """

    axis: int
    steps: Any  # (3,) to the next face along x, y, z
    place: Any  # (blocks, width) the faces, less two planes
    pattern: Any  # (blocks,)
    share: Array  # (patterns, width) of the momentum cell that is open
    weight: Array  # (patterns, 3, 8, width) of velocities in the gradients [1/m2]
    constant: Array  # (patterns, 3, 2, width) the part that walls which slide add [1/m/s]; no patterns if none does
    next: Any  # (patterns, 3, 2, width) next faces away from the wall, less `place`: of the face before, the one behind
    farther: Any  # (patterns, width) the next face away from the wall, less `place`
    pull: Array  # (patterns, 3, width) of the wall: weights of the face and that next one [1/m2], a constant [1/m/s]
    stiff_at: Any  # (m,) less two planes, the faces with a stress that is stiffer than in a whole cell
    stiff: Array  # (m,) how much stiffer, over the own velocity [1/m2]
    inverse: Array  # (3,) 1/spacing [1/m]


class NoWalls:
    """Of a fluid without smooth walls: nothing to do.

    profiles  how the velocity along x, y, z varies away from walls
    """

    profiles: Sequence[Profiles] = ()

    def near(self, grid: Grid) -> Any:
        """Whether `replace` writes a face, padded (3, nz, ny, nx)."""
        return np.zeros((3, *grid.padded_shape), bool)

    def replace(self, velocity: Array, viscosity: Array, density: float, central: float, force: Array) -> None:
        """Write convection and viscous stress near walls."""

    def hold(self, new: Array, density: float, model_b: float, step: float, weight: float) -> None:
        """Take the stiff part of the stress into a predicted velocity and its mobility; the stress of the stage before
        has this weight."""

    def add_held(self, density: float, step: float, force: Array) -> None:
        """Add what was implicit in the last step to the mean stress of its start and end (3, ...) [N/m3]."""


class NearWalls(NoWalls):
    """The faces of a fluid near smooth walls.

    boundaries  of its grid
    fields      of the fluid
    solved      1 where a face has an unknown velocity
    """

    def __init__(self, boundaries: Boundaries, fields: CellFields, solved: Array) -> None:
        self.fields, cut = fields, boundaries.cut
        assert isinstance(cut, CutCells)
        self.profiles = [_profiles(cut, d) for d in range(3)]
        outlets = [(side.axis, side.face(cut.grid)) for side in boundaries.sides if side.outlet.any()]
        self.components = [_faces_of(cut, d, solved[d] > 0.0, self.profiles[d], outlets) for d in range(3)]
        self._resistance = [np.zeros(faces.stiff.size) for faces in self.components]
        self._cut = [_cut_faces(cut.aperture[e], e, self.components) for e in range(3)]

    def near(self, grid: Grid) -> Any:
        """See `NoWalls.near`."""
        faces = super().near(grid)
        for near, of_component in zip(faces.reshape(3, -1), self.components):
            near[of_component.place.astype(np.int64) + 2 * of_component.steps[2]] = True
        return faces

    def replace(self, velocity: Array, viscosity: Array, density: float, central: float, force: Array) -> None:
        """See `NoWalls.replace`; `fields.flux`, that of the velocity, becomes that through the open parts of faces."""
        flux, u, rate = (field.reshape(3, -1) for field in (self.fields.flux, velocity, force))
        for e, (at, share) in enumerate(self._cut):
            shut(at, share, flux[e])
        for d, faces in enumerate(self.components):
            cut_transport(faces, u[d], flux, viscosity.reshape(-1), density, central, rate[d])

    def hold(self, new: Array, density: float, model_b: float, step: float, weight: float) -> None:
        """See `NoWalls.hold`."""
        fields = self.fields
        # the first stage writes where the second one reads
        of_stage = fields.velocity if weight == 0.0 else fields.stage_velocity
        old, stage, after, mobility = (
            field.reshape(3, -1) for field in (fields.velocity, of_stage, new, fields.mobility)
        )
        viscosity, voidage = fields.effective_viscosity.reshape(-1), fields.centred_voidage.reshape(-1)
        for d, (faces, resistance) in enumerate(zip(self.components, self._resistance)):
            velocities = old[d], stage[d], after[d]
            hold_near_walls(
                faces, viscosity, voidage, velocities, mobility[d], resistance, (density, model_b), (step, weight)
            )

    def add_held(self, density: float, step: float, force: Array) -> None:
        """See `NoWalls.add_held`."""
        fields = self.fields
        for d, (faces, resistance) in enumerate(zip(self.components, self._resistance)):
            at = faces.stiff_at.astype(np.int64) + 2 * fields.source.shape[2] * fields.source.shape[3]
            old, stage, new = (
                field[d].ravel()[at] for field in (fields.other_velocity, fields.stage_velocity, fields.velocity)
            )
            theta = implicitness.py_func(
                resistance * step / (density * on_faces(fields.centred_voidage, d).ravel()[at])
            )
            force[d].reshape(-1)[at] += resistance * (0.5 * (old + stage) - theta * new - (1.0 - theta) * old)


def near_walls(boundaries: Boundaries, fields: CellFields, solved: Array) -> NoWalls:
    """The faces near smooth walls, if there are any."""
    return NearWalls(boundaries, fields, solved) if boundaries.grid.walls else NoWalls()


# ---------------------------------------------------------------- gradients as weights of velocities


def _faces_of(cut: CutCells, d: int, solved: Any, profiles: Profiles, outlets: Sequence[tuple[int, int]]) -> Faces:
    """The faces of a component near walls, and the weights of their gradients.

    outlets  axes, and layers of faces normal to them, in which there are outlets
    """
    spacing, shape = cut.grid.spacing, cut.volume.shape
    steps = (1, shape[2], shape[1] * shape[2])
    inverse = 1.0 / np.array(spacing)
    sections, edges = [_sections(cut, d, e) for e in range(3)], [_closed_edges(cut, d, e) for e in range(3)]
    aperture = cut.aperture[d]
    share = cut.momentum_share(d)
    near, missing = (aperture < 1.0) | (share < 1.0), np.zeros((3, *shape))
    for e in range(3):
        for side in range(2):
            near |= np.roll(aperture, 1 - 2 * side, 2 - e) < 1.0
            near |= (sections[e][side].share < 1.0) | (edges[e][side] > 0.0)
        missing[e] = (sections[e][0].share - sections[e][1].share) * inverse[e]
    own = np.zeros(shape, bool)
    cut.grid.inner_faces(own, d)[:] = True
    at = np.flatnonzero(near & solved & own)
    open_share = share.ravel()[at]
    wall_area = np.linalg.norm(missing.reshape(3, -1)[:, at], axis=0) / open_share

    weight, constant, stiff = np.zeros((3, 8, at.size)), np.zeros((3, 2, at.size)), np.zeros(at.size)
    further, place = np.zeros((3, 2, at.size), np.uint32), at - 2 * steps[2]
    for e in range(3):
        for side in range(2):
            high, cross = at + side * steps[e], sections[e][side]
            area = cross.share.ravel()[at] * inverse[e] / open_share
            closed = edges[e][side].ravel()[at]
            weights, of_walls = _gradient(profiles, high - steps[e], high, cross.distance.ravel()[at], inverse[e])
            weights, of_walls = (1.0 - closed) * weights, (1.0 - closed) * of_walls
            weights[1 - side] += (2.0 - 4.0 * side) * inverse[e] * closed  # it sticks to a thin wall half a cell away
            weight[e, 4 * side : 4 * side + 4], constant[e, side] = area * weights, area * of_walls
            stiff += weight[e, 1] if side == 0 else -weight[e, 4]
        further[e] = profiles.next[at - steps[e]] - place, profiles.next[at + steps[e]] - place
    stiff -= 2.0 * float(np.sum(inverse**2))
    farther, pull = profiles.next[at], np.zeros((3, at.size))
    pull[:2] = profiles.shear[:, at] * wall_area
    pull[2] = -(pull[:2] * profiles.sliding[[at, farther]]).sum(axis=0)
    square = inverse.max() ** 2
    stiff = square * _rounded((stiff + pull[0]) / square)
    is_stiff = stiff > 0.0
    # beyond an outlet the fluid is not continuous: convection and growth there act on equally much fluid, or u grows
    at_outlet = np.isin(at // steps[d] % shape[2 - d], [layer for axis, layer in outlets if axis == d])
    acting = _rounded(np.where(at_outlet, np.maximum(open_share, FULL), open_share))
    fill = _in_blocks(at // steps[2])
    beside: Any = (farther - place).astype(np.uint32)
    weight, constant, pull = square * _rounded(weight / square), _rounded(constant), square * _rounded(pull / square)
    pattern, first = _patterns([weight, constant, pull, acting, further, beside], fill)

    def of_patterns(values: Any) -> Any:
        return np.ascontiguousarray(np.moveaxis(values[..., fill[first]], -2, 0))

    return Faces(
        d, np.array(steps), place.astype(np.uint32)[fill], pattern, of_patterns(acting), of_patterns(weight),
        of_patterns(constant) if constant.any() else np.zeros((0, 3, 2, fill.shape[1])), of_patterns(further),
        of_patterns(beside), of_patterns(pull), place[is_stiff].astype(np.uint32), stiff[is_stiff], inverse,
    )  # fmt: skip


def _in_blocks(planes: Any) -> Any:
    """Numbers of faces in blocks (blocks, width), each of one plane, of the width that leaves the fewest to fill up."""
    begins = np.flatnonzero(np.diff(planes, prepend=-1))
    counts = np.diff(begins, append=planes.size)
    widths = np.arange(8, BLOCK + 1, 8)
    work = [(-(-counts // width)).sum() * (width + OF_A_BLOCK) for width in widths]
    width = int(widths[np.argmin(work)])
    blocks = [
        np.minimum(np.arange(begin, begin - (-count // width) * width), begin + count - 1).reshape(-1, width)
        for begin, count in zip(begins, counts)
    ]
    return np.concatenate(blocks) if blocks else np.zeros((0, width), np.int64)


def _rounded(values: Array) -> Array:
    """Values of order 1 without their last digits, in which the planes of an upright column differ: ranks that begin at
    different planes then have the same."""
    return np.asarray(np.round(values, DIGITS) + 0.0)


def _patterns(values: Sequence[Any], fill: Any) -> tuple[Any, Any]:
    """Which blocks have equal values: the pattern of each block, and the first block of each."""
    patterns: dict[bytes, int] = {}
    number = []
    for block in fill:
        key = b"".join(array[..., block].tobytes() for array in values)
        number.append(patterns.setdefault(key, len(patterns)))
    pattern = np.array(number, np.int64)
    return pattern, np.unique(pattern, return_index=True)[1]


def _cut_faces(aperture: Array, e: int, components: Sequence[Faces]) -> tuple[Any, Array]:
    """Faces normal to e that walls cut and momentum cells near them use: flat indices, and open shares."""
    plane, row = aperture.shape[1] * aperture.shape[2], aperture.shape[2]
    used = []
    for faces in components:
        at, before = faces.place.ravel().astype(np.int64) + 2 * plane, (1, row, plane)[faces.axis]
        used += [at, at - before, at + (1, row, plane)[e], at + (1, row, plane)[e] - before]
    here, share = np.unique(np.concatenate(used)), aperture.ravel()
    here = here[share[here] < 1.0]
    return here.astype(np.uint32), share[here]


def _sections(cut: CutCells, d: int, e: int) -> list[Any]:
    """Sections below and above the momentum cells of component d along e."""
    offset = [0.5, 0.5, 0.5]
    if e != d:
        offset[d] = offset[e] = 0.0
    middle = section(cut.surface, cut.points(offset), e, cut.grid.spacing)
    moved = type(middle)(*(np.roll(field, 1 if e == d else -1, 2 - e) for field in middle))
    return [moved, middle] if e == d else [middle, moved]


def _closed_edges(cut: CutCells, d: int, e: int) -> list[Array]:
    """Share of the momentum faces below and above the momentum cells of component d along e that thin walls close."""
    if e == d:
        return [np.zeros(cut.volume.shape)] * 2
    closed = (cut.thin[e] > 0.0).astype(float)
    low = 0.5 * (closed + np.roll(closed, 1, 2 - d))
    return [low, np.roll(low, -1, 2 - e)]


class Profiles(NamedTuple):
    """How the velocity of every face of a component varies away from the wall; flat arrays."""

    is_open: Any
    distance: Array
    shift: Array
    sliding: Array
    swerve: Array
    next: Any  # flat index of the next face away from the wall
    shear: Array  # (2, ...) weights of both in the shear rate at the wall [1/m]
    curvature: Array  # (2, ...) weights in the curvature [1/m2]


def _profiles(cut: CutCells, d: int) -> Profiles:
    """Profiles of all faces of a component."""
    distance, depth = cut.distance[d], cut.depth[d]
    centre, spacing = distance - cut.shift[d], cut.grid.spacing
    rise = np.stack([(np.roll(centre, -1, 2 - e) - np.roll(centre, 1, 2 - e)) / spacing[e] for e in range(3)])
    steepest = np.argmax(np.abs(rise), axis=0)
    upward = np.take_along_axis(rise, steepest[None], axis=0)[0] > 0.0
    shape = cut.volume.shape
    step = np.array((1, shape[2], shape[1] * shape[2]))[steepest]
    edges = np.stack([_closed_edges(cut, d, e) for e in range(3)])
    low, high = (np.take_along_axis(edges[:, side], steepest[None], axis=0)[0] for side in range(2))
    whole = (np.where(upward, high, low) == 0.0).ravel()  # no thin wall lies before the next face
    farther = np.clip(np.arange(distance.size) + np.where(upward, step, -step).ravel(), 0, distance.size - 1)
    near_d, far_d = distance.ravel(), distance.ravel()[farther]
    near_e, far_e = depth.ravel(), depth.ravel()[farther]
    is_open = (cut.aperture[d] > 0.0).ravel()
    has_farther = (
        is_open & is_open[farther] & whole & (far_e - near_e > LEAST_RISE * np.array(spacing)[steepest].ravel())
    )
    k = np.where(has_farther, 1.0 / np.where(has_farther, far_e - near_e, 1.0), 0.0)
    own = np.where(is_open, 1.0 / np.where(is_open, near_d, 1.0), 0.0)
    other = np.where(has_farther, 1.0 / np.where(has_farther, far_d, 1.0), 0.0)
    shear = np.stack([(1.0 + k * near_e) * own, -k * near_e * other])
    curvature = np.stack([k * own, -k * other])
    return Profiles(
        is_open, near_d, cut.shift[d].ravel(), cut.sliding[d].ravel(), cut.swerve[d].ravel(),
        np.where(has_farther, farther, np.arange(near_d.size)), shear, curvature,
    )  # fmt: skip


def _gradient(of: Profiles, low: Any, high: Any, distance: Array, inverse: float) -> tuple[Array, Array]:
    """Weights of velocities, and a constant, that make the gradient between faces: (4, n) of the low and high one and
    the next ones away from the wall of both, and (n,).

    low, high  flat indices of the faces
    distance   mean, of the open part between them [m]
    inverse    1/spacing [1/m]
    """
    both = of.distance[low] + of.distance[high]
    some = both > 0.0
    shift = of.shift[high] - of.shift[low]
    rise = (of.distance[high] - of.distance[low]) - shift
    bend = shift * both + rise * (both - 2.0 * distance)
    index = np.stack([low, high, of.next[low], of.next[high]])
    weight, sliding = np.zeros(index.shape), of.sliding[index]
    for place, face in enumerate((low, high)):
        trust = np.where(some, of.distance[face] / np.where(some, both, 1.0), 0.0)
        for own, row in ((0, place), (1, place + 2)):
            weight[row] += trust * (bend * of.curvature[own][face] - shift * of.shear[own][face])
    constant = -(weight * sliding).sum(axis=0) - (of.swerve[high] - of.swerve[low])
    for row, sign in ((0, -1.0), (1, 1.0)):
        is_open = of.is_open[index[row]]
        weight[row] += np.where(is_open, sign, 0.0)
        constant += np.where(is_open, 0.0, sign * sliding[row])
    return weight * inverse, constant * inverse
