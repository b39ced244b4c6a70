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
from cfddem.fluid.grid import Array
from cfddem.fluid.near_walls_loops import FULL, cut_transport, hold_near_walls

LEAST_RISE = 0.4
"""How much farther from the wall the next face must be, for a curvature to be taken, in cells."""


class Faces(NamedTuple):
    """Faces of one component near walls; flat indices of padded fields."""

    axis: int
    at: Any  # (n,) the faces
    share: Array  # (n,) of the momentum cell that is open
    area: Array  # (n, 6) of its faces below and above along x, y, z, per open volume [1/m]
    index: Any  # (n, 6, 4) velocities that make the gradient there
    weight: Array  # (n, 6, 4) of each [1/m]
    constant: Array  # (n, 6) the part that walls which slide add [1/s]
    wall_index: Any  # (n, 2) velocities that make the pull of the wall
    wall_weight: Array  # (n, 2) [1/m2]
    wall_constant: Array  # (n,) [1/m/s]
    stiff: Array  # (n,) weight of the own velocity in the stress, over that in a whole cell [1/m2]
    aperture: Array  # (3, ...) of all faces
    inverse: Array  # (3,) 1/spacing [1/m]


class NoWalls:
    """Of a fluid without smooth walls: nothing to do.

    profiles  how the velocity along x, y, z varies away from walls
    """

    profiles: Sequence[Profiles] = ()

    def replace(self, velocity: Array, viscosity: Array, density: float, central: float, force: Array) -> None:
        """Write convection and viscous stress near walls."""

    def hold(self, new: Array, density: float, model_b: float, step: float, weight: float) -> None:
        """Take the stiff part of the stress into a predicted velocity and its mobility; the stress of the stage before
        has this weight."""


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
        self._resistance = [np.zeros(0)] * 3
        outlets = [(side.axis, side.face(cut.grid)) for side in boundaries.sides if side.outlet.any()]
        self.components = [_faces_of(cut, d, solved[d] > 0.0, self.profiles[d], outlets) for d in range(3)]

    def replace(self, velocity: Array, viscosity: Array, density: float, central: float, force: Array) -> None:
        """See `NoWalls.replace`; `fields.flux` is that of the velocity."""
        for d, faces in enumerate(self.components):
            cut_transport(faces, velocity[d], self.fields.flux, viscosity, density, central, force[d])

    def hold(self, new: Array, density: float, model_b: float, step: float, weight: float) -> None:
        """See `NoWalls.hold`."""
        fields = self.fields
        for d, faces in enumerate(self.components):
            if weight == 0.0:  # both stages have the same mobility, and with it the same pressure equation
                self._resistance[d] = faces.stiff * _on_faces(fields.effective_viscosity, faces)
            voidage, old = _on_faces(fields.centred_voidage, faces), fields.velocity[d]
            inertia = np.stack([density * voidage, voidage + model_b * (1.0 - voidage)])
            explicit = (1.0 - weight) * old + weight * fields.stage_velocity[d] if weight else old
            hold_near_walls(faces, old, explicit, inertia, self._resistance[d], step, new[d], fields.mobility[d])


def _on_faces(cells: Array, faces: Faces) -> Array:
    """Mean of the two cells of every face near walls (n,)."""
    back = (1, cells.shape[2], cells.shape[1] * cells.shape[2])[faces.axis]
    flat = cells.ravel()
    return np.asarray(0.5 * (flat[faces.at] + flat[faces.at - back]))


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
    sections = [_sections(cut, d, e) for e in range(3)]
    aperture = cut.aperture[d]
    share = cut.momentum_share(d)
    near, missing = (aperture < 1.0) | (share < 1.0), np.zeros((3, *shape))
    for e in range(3):
        for side in range(2):
            near |= np.roll(aperture, 1 - 2 * side, 2 - e) < 1.0
            near |= sections[e][side].share < 1.0
        missing[e] = (sections[e][0].share - sections[e][1].share) * inverse[e]
    own = np.zeros(shape, bool)
    cut.grid.inner_faces(own, d)[:] = True
    at = np.flatnonzero(near & solved & own)
    open_share = share.ravel()[at]
    wall_area = np.linalg.norm(missing.reshape(3, -1)[:, at], axis=0) / open_share

    area, weight, constant = np.zeros((at.size, 6)), np.zeros((at.size, 6, 4)), np.zeros((at.size, 6))
    index = np.zeros((at.size, 6, 4), np.int64)
    stiff, whole = np.zeros(at.size), 0.0
    for e in range(3):
        for side in range(2):
            m, high = 2 * e + side, at + side * steps[e]
            cross = sections[e][side]
            area[:, m] = cross.share.ravel()[at] * inverse[e] / open_share
            distance = cross.distance.ravel()[at]
            index[:, m], weight[:, m], constant[:, m] = _gradient(profiles, high - steps[e], high, distance, inverse[e])
            stiff -= (2 * side - 1) * area[:, m] * weight[:, m, 1 - side]
        whole += 2.0 * inverse[e] ** 2
    pull = profiles.shear[:, at].T * wall_area[:, None]
    wall_index = np.stack([at, profiles.next[at]], axis=-1)
    wall_constant = -(pull * profiles.sliding[wall_index]).sum(axis=1)
    stiff = np.maximum(stiff + pull[:, 0] - whole, 0.0)
    # beyond an outlet the fluid is not continuous: convection and growth there act on equally much fluid, or u grows
    at_outlet = np.isin(at // steps[d] % shape[2 - d], [layer for axis, layer in outlets if axis == d])
    acting = np.where(at_outlet, np.maximum(open_share, FULL), open_share)
    return Faces(
        d, at, acting, area, index, weight, constant, wall_index, pull, wall_constant, stiff, cut.aperture,
        inverse,
    )  # fmt: skip


def _sections(cut: CutCells, d: int, e: int) -> list[Any]:
    """Sections below and above the momentum cells of component d along e."""
    offset = [0.5, 0.5, 0.5]
    if e != d:
        offset[d] = offset[e] = 0.0
    made = section(cut.surface, cut.points(offset), e, cut.grid.spacing)
    moved = type(made)(*(np.roll(each, 1 if e == d else -1, 2 - e) for each in made))
    return [moved, made] if e == d else [made, moved]


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
    farther = np.clip(np.arange(distance.size) + np.where(upward, step, -step).ravel(), 0, distance.size - 1)
    near_d, far_d = distance.ravel(), distance.ravel()[farther]
    near_e, far_e = depth.ravel(), depth.ravel()[farther]
    is_open = near_d > 0.0
    known = is_open & (far_d > 0.0) & (far_e - near_e > LEAST_RISE * np.array(spacing)[steepest].ravel())
    k = np.where(known, 1.0 / np.where(known, far_e - near_e, 1.0), 0.0)
    own = np.where(is_open, 1.0 / np.where(is_open, near_d, 1.0), 0.0)
    other = np.where(known, 1.0 / np.where(known, far_d, 1.0), 0.0)
    shear = np.stack([(1.0 + k * near_e) * own, -k * near_e * other])
    curvature = np.stack([k * own, -k * other])
    return Profiles(
        is_open, near_d, cut.shift[d].ravel(), cut.sliding[d].ravel(), cut.swerve[d].ravel(),
        np.where(known, farther, np.arange(near_d.size)), shear, curvature,
    )  # fmt: skip


def _gradient(of: Profiles, low: Any, high: Any, distance: Array, inverse: float) -> tuple[Any, Array, Array]:
    """Velocities, weights and a constant that make the gradient between faces.

    low, high  flat indices of the faces
    distance   mean, of the open part between them [m]
    inverse    1/spacing [1/m]
    """
    both = of.distance[low] + of.distance[high]
    some = both > 0.0
    shift = of.shift[high] - of.shift[low]
    rise = (of.distance[high] - of.distance[low]) - shift
    bend = shift * both + rise * (both - 2.0 * distance)
    index = np.stack([low, high, of.next[low], of.next[high]], axis=-1)
    weight, sliding = np.zeros(index.shape), of.sliding[index]
    for place, face in enumerate((low, high)):
        trust = np.where(some, of.distance[face] / np.where(some, both, 1.0), 0.0)
        for own, column in ((0, place), (1, place + 2)):
            weight[:, column] += trust * (bend * of.curvature[own][face] - shift * of.shear[own][face])
    constant = -(weight * sliding).sum(axis=1) - (of.swerve[high] - of.swerve[low])
    for column, sign in ((0, -1.0), (1, 1.0)):
        is_open = of.is_open[index[:, column]]
        weight[:, column] += np.where(is_open, sign, 0.0)
        constant += np.where(is_open, 0.0, sign * sliding[:, column])
    return index, weight * inverse, constant * inverse
