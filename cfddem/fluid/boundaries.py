"""Boundary conditions on the six sides of the box: known faces, unknown faces, values of ghosts.

Each side, named `x_low` to `z_high`, has a condition or a list of conditions. The first of a list covers the whole
side; if it selects a region by `where`, a wall covers the rest. Each later condition holds in the region that its
`where` selects and replaces the earlier ones there. A floor with jets reads

    z_low=[NoSlip(), Inlet(2.0, where=discs([(0.05, 0.05)], diameter=0.01))]

A condition sets the normal velocity on the boundary face, or leaves it free, and gives a rule for the ghosts beyond.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.compile import serial
from cfddem.backend.errors import InputError
from cfddem.fluid.conditions import SIDES, Condition, FreeSlip, Inlet, NoSlip, Outlet, Periodic
from cfddem.fluid.cut_cells import cut_cells
from cfddem.fluid.grid import HIGH, LOW, Array, Grid, layers
from cfddem.fluid.halo import Halo, place


class Faces(NamedTuple):
    """Kinds of faces, padded arrays (3, nz, ny, nx)."""

    solved: Array  # 1 where the velocity is an unknown
    buried: Array  # 1 where both cells are solid
    blocked: np.ndarray  # true where one of the two cells is solid


class Boundaries:
    """The conditions on all six sides of a grid.

    Sides not named are no-slip walls, or free-slip walls where the box is one cell thick.

    cut       shares of cells and faces that smooth walls leave open
    halo      fills ghosts from the cells themselves, or from those of other ranks
    box       the conditions on the whole box; others if the grid is the block of a rank
    sides     sides that the grid touches
    periodic  (3,) whether x, y, z are periodic
    driving   (3,) mean fall of the pressure along x, y, z [Pa/m]
    """

    def __init__(self, grid: Grid, conditions: Mapping[str, Condition | Sequence[Condition]] | None = None) -> None:
        self.grid, self.box = grid, self
        if grid.whole is not grid:
            self._cut_out_of(Boundaries(grid.whole, conditions))
            return
        by_side = dict(conditions or {})
        for name in by_side:
            if name not in SIDES:
                raise InputError(f"boundaries.{name}", None, "one of " + ", ".join(SIDES))
        self.periodic, self.driving = np.zeros(3, dtype=bool), np.zeros(3)
        self.sides: list[Side] = []
        for axis in range(3):
            plain: Condition = FreeSlip() if grid.cells[axis] == 1 else NoSlip()
            pair = []
            for high in (False, True):
                name = SIDES[2 * axis + high]
                listed = by_side.get(name, plain)
                several = [listed] if isinstance(listed, Condition) else list(listed)
                if not several:
                    raise InputError(f"boundaries.{name}", None, "a condition or a list of at least one")
                if getattr(several[0], "where", None) is not None:
                    several.insert(0, plain)
                pair.append(Side(name, axis, high, several))
            self._pair_up(axis, pair)
        self.halo = Halo(grid.cells, self.periodic)
        self.cut = cut_cells(grid, self.halo)
        for side in self.sides:
            self._lay_out(side)
        self.has_outlet = any(bool(side.outlet.any()) for side in self.sides)

    def _cut_out_of(self, box: Boundaries) -> None:
        """Take over the conditions on the whole box, where the grid touches its sides."""
        grid, self.box = self.grid, box
        self.periodic, self.driving, self.has_outlet = box.periodic, box.driving, box.has_outlet
        self.halo = Halo(grid.cells, self.periodic, borders=grid.borders(self.periodic))
        self.cut = cut_cells(grid, self.halo)
        here = [slice(first, first + n) for first, n in zip(grid.first, grid.cells)][::-1]
        self.sides = [side.cut(here) for side in box.sides if grid.touches(side.axis, side.high)]

    def _pair_up(self, axis: int, pair: list[Side]) -> None:
        """Keep the two sides of an axis, or make the axis periodic; refuse a periodic side without its opposite."""
        wrapped = [any(isinstance(c, Periodic) for c in side.conditions) for side in pair]
        if not any(wrapped):
            self.sides += pair
            return
        fall = {c.pressure_gradient for side in pair for c in side.conditions if isinstance(c, Periodic)}
        if not all(wrapped) or any(len(side.conditions) > 1 for side in pair) or len(fall) > 1:
            raise InputError(
                f"boundaries.{pair[wrapped.index(True)].name}",
                None,
                "periodic as a whole together with the opposite side, with one pressure gradient",
            )
        self.periodic[axis], self.driving[axis] = True, fall.pop()

    def _lay_out(self, side: Side) -> None:
        """Compute the arrays of a side from its conditions."""
        grid, points = self.grid, self._points(side)
        inner = points[0].shape
        side.owner = np.zeros(inner, dtype=np.int64)
        for number, condition in enumerate(side.conditions):
            if not isinstance(condition, Condition):
                raise InputError(f"boundaries.{side.name}", condition, "a condition such as NoSlip() or Inlet(0.1)")
            if condition.where is not None:
                side.owner[np.broadcast_to(condition.where(*points), inner)] = number
            elif number > 0:
                raise InputError(f"boundaries.{side.name}", None, "a list whose later conditions say `where` they hold")
        solid = ~side.layer(grid.open, -1 if side.high else 0)
        mirror, wall = np.zeros(inner), np.zeros((3, *inner))
        outlet, pressure = np.zeros(inner, dtype=bool), np.zeros(inner)
        for number, condition in enumerate(side.conditions):
            here = side.owner == number
            mirror[here] = -1.0 if isinstance(condition, (NoSlip, Inlet)) else 1.0
            if isinstance(condition, Inlet):
                self._refuse_blocked(side, here, solid)
                side.inlets.append(number)
            elif isinstance(condition, NoSlip):
                velocity = np.asarray(condition.velocity, dtype=float)
                if velocity.shape != (3,) or not np.isfinite(velocity).all() or velocity[side.axis] != 0.0:
                    raise InputError(
                        f"boundaries.{side.name}.velocity", condition.velocity, "a vector in the plane of the wall"
                    )
                wall[:, here] = velocity[:, None]
            elif isinstance(condition, Outlet):
                if not np.isfinite(condition.pressure):
                    raise InputError(f"boundaries.{side.name}.pressure", condition.pressure, "a number, in Pa")
                outlet |= here & ~solid
                pressure[here] = condition.pressure
        side.mirror, side.wall = self.halo.extended(mirror, side.axis), self.halo.extended(wall, side.axis)
        side.outlet, side.pressure = self.halo.extended(outlet, side.axis), self.halo.extended(pressure, side.axis)

    def _refuse_blocked(self, side: Side, here: Any, solid: Any) -> None:
        """Raise `InputError` for an inlet that covers no face, or the face of a solid cell; smooth walls cut inlets."""
        if not here.any():
            raise InputError(f"boundaries.{side.name}", None, "an inlet that covers the centre of some cell")
        blocked = int((here & solid).sum())
        if blocked and not (self.grid.walls and (here & ~solid).any()):
            raise InputError(
                f"boundaries.{side.name}", None, "an inlet whose cells are all open",
                f"{blocked} of its {int(here.sum())} cells are solid; narrow it with `where`",
            )  # fmt: skip

    def _points(self, side: Side) -> tuple[Array, Array, Array]:
        """Centres x, y, z of the boundary faces of a side, full arrays over its plane [m]."""
        coordinates = np.broadcast_arrays(*self.grid.faces(side.axis))
        index = -1 if side.high else 0
        x, y, z = (np.array(side.layer(c, index)) for c in coordinates)
        return x, y, z

    def open_share(self, side: Side) -> Any:
        """Share of the faces of a side that smooth walls leave open, over its plane without ghosts."""
        if not self.grid.walls:
            return 1.0
        faces: Any = self.grid.inner_faces(self.cut.of_faces(side.axis), side.axis)  # type: ignore[arg-type]
        return side.layer(faces, -1 if side.high else 0)

    # ------------------------------------------------------------ every step

    def set_inlets(self, time: float, voidage: Array) -> None:
        """Set the wall velocities of inlets from their superficial velocities.

        time     [s]
        voidage  padded, at that time
        """
        for side in self.sides:
            for number in side.inlets:
                here = side.owner == number
                superficial = self.superficial(side, number, here, time)
                inside = side.layer(self.grid.inner(voidage), -1 if side.high else 0)[here]
                wall = side.wall[:, LOW:-HIGH, LOW:-HIGH].copy()
                wall[:, here] = superficial.T / inside
                side.wall = self.halo.extended(wall, side.axis)

    def superficial(self, side: Side, number: int, here: np.ndarray, time: float, steady: bool = False) -> Array:
        """Superficial velocity of an inlet (n, 3) [m/s].

        number  index of the inlet among the conditions of the side
        here    (plane) which n faces it covers
        steady  whether to leave out the factor of time
        """
        inlet = side.conditions[number]
        assert isinstance(inlet, Inlet)
        if not here.any():
            return np.zeros((0, 3))  # of a block beside the inlet
        count, by_function = int(here.sum()), callable(inlet.velocity)  # local: faces of this rank
        velocity = inlet.velocity
        if callable(velocity):
            x, y, z = (c[here] for c in self._points(side))
            velocity = velocity(x, y, z, time)
        values, vector = np.asarray(velocity, dtype=float), np.zeros((count, 3))
        if values.ndim == 0 or (by_function and values.shape == (count,)):
            vector[:, side.axis] = side.inward * values
        elif values.shape == (count, 3) or (not by_function and values.shape == (3,)):
            vector[:] = values
        else:
            wanted = f"of shape ({count},) or ({count}, 3) for {count} faces" if by_function else "a speed or a vector"
            raise InputError(f"boundaries.{side.name}.velocity", values.shape, wanted)
        if inlet.in_time is not None and not steady:
            vector *= float(inlet.in_time(time))
        bad = ~np.isfinite(vector).all(axis=1)
        if bad.any():
            place = ", ".join(f"{c[here][np.argmax(bad)]:g}" for c in self._points(side))
            raise InputError(
                f"boundaries.{side.name}.velocity", None, "finite everywhere",
                f"it is not at x, y, z = {place} m, t = {time:g} s",
            )  # fmt: skip
        return vector

    @property
    def outlets(self) -> np.ndarray:
        """Whether a side of the box normal to x, y, z has an outlet (3,)."""
        return np.array([any(s.axis == d and bool(s.outlet.any()) for s in self.box.sides) for d in range(3)])

    def pressure_gradient(self, pressure: Array) -> Array:
        """grad p' on the faces (3, ...) of a padded pressure [Pa/m], with the mean gradient of periodic directions."""
        gradient = np.empty((3, *pressure.shape))
        self.fill_pressure(pressure)
        values = pressure.reshape(-1)
        for d, rise in enumerate(gradient.reshape(3, -1)):
            before = pressure.strides[2 - d] // pressure.itemsize  # distance of the cell before in the flat array
            np.subtract(values[before:], values[:-before], out=rise[before:])
            rise[:before] = 0.0  # outermost ghosts
            rise *= 1.0 / self.grid.spacing[d]
            rise -= self.driving[d]
        return gradient

    def varies_along(self, axis: int) -> bool:
        """Whether the flow can vary along an axis; false for one cell between planes of symmetry or periodic sides."""
        sides = [side for side in self.box.sides if side.axis == axis]
        return self.grid.whole.cells[axis] > 1 or any((side.mirror < 0.0).any() or side.outlet.any() for side in sides)

    def owned_faces(self, axis: int) -> int:
        """Number of layers of faces normal to an axis that the grid owns: one more than cells where the box ends.

        The last layer of a periodic box is the first one again; that of a block belongs to the rank above.
        """
        return int(self.grid.cells[axis]) + int(self.halo.ends[axis, 1])

    def faces(self) -> Faces:
        """Kinds of all faces of the grid."""
        grid = self.grid
        fluid = self.halo.padded(grid.open, outside=0.0)
        solid = self.halo.padded(~grid.open)
        solved = np.zeros((3, *grid.padded_shape))
        buried, blocked = np.zeros_like(solved), np.zeros(solved.shape, bool)
        for d in range(3):
            both = fluid * np.roll(fluid, 1, axis=2 - d)
            grid.inner_faces(solved[d], d)[:] = grid.inner_faces(both, d)
            across = np.roll(solid, 1, axis=2 - d)
            buried[d], blocked[d] = solid * across, solid + across > 0.0
        for side in self.sides:
            face = side.face(grid)
            inside = side.layer(fluid, face - 1 if side.high else face)
            side.layer(solved[side.axis], face)[:] = side.outlet * inside
        self.halo.fill_borders(solved)
        self.cut.close(solved, blocked)
        return Faces(solved, buried, blocked)

    # ------------------------------------------------------------ ghosts

    def fill_pressure(self, pressure: Array, correction: bool = False) -> None:
        """Fill the ghosts of a pressure: no gradient at walls, a given value on the faces of outlets.

        correction  whether this is a correction, zero on outlets
        """
        self.halo.fill(pressure)
        for side in self.sides:
            if side.outlet.any():
                n = self.grid.cells[side.axis]
                inside, ghost = (n + LOW - 1, n + LOW) if side.high else (LOW, LOW - 1)
                twice_at_face = 0.0 if correction else 2.0 * side.pressure
                value = twice_at_face - side.layer(pressure, inside)
                side.layer(pressure, ghost)[side.outlet] = value[side.outlet]

    def fill_velocity(self, velocity: Array) -> None:
        """Set the boundary faces and ghosts of a velocity (3, nz, ny, nx)."""
        self.halo.fill_faces(velocity)
        for side in self.sides:
            cells = self.grid.cells[side.axis]
            fill_side(velocity, side.axis, side.high, cells, side.wall, side.mirror, side.outlet)

    def set_faces(self, velocity: Array) -> None:
        """Set the boundary faces of a velocity (3, nz, ny, nx), as `fill_velocity`, and no ghosts beyond the sides."""
        self.halo.fill_faces(velocity)
        for side in self.sides:
            normal = side.layer(velocity[side.axis], side.face(self.grid))
            np.copyto(normal, side.wall[side.axis], where=~side.outlet)


# ---------------------------------------------------------------- one side


@dataclass
class Side:
    """A side as arrays over its plane, ghost rows included, in the order of the two remaining array axes."""

    name: str
    axis: int
    high: bool
    conditions: list[Condition]

    def __post_init__(self) -> None:
        self.owner = np.zeros(0, dtype=np.int64)  # index of the condition that holds, without ghost rows
        self.mirror = np.zeros(0)  # of tangential velocities: ghost = mirror * inside + 2 wall at no-slip walls
        self.wall = np.zeros(0)  # (3, plane) velocity given on the face [m/s]
        self.outlet = np.zeros(0, dtype=bool)
        self.pressure = np.zeros(0)  # given on outlets [Pa]
        self.inlets: list[int] = []  # indices of the conditions that are inlets

    def cut(self, here: Sequence[slice]) -> Side:
        """The part of the side that belongs to a block of cells.

        here  which cells of the whole grid the block has along z, y, x
        """
        part = Side(self.name, self.axis, self.high, self.conditions)
        across = tuple(cells for n, cells in enumerate(here) if n != 2 - self.axis)
        padded: Any = (Ellipsis, *(slice(cells.start, cells.stop + LOW + HIGH) for cells in across))
        part.owner, part.inlets = self.owner[across], self.inlets
        part.mirror, part.wall = self.mirror[padded].copy(), self.wall[padded].copy()
        part.outlet, part.pressure = self.outlet[padded].copy(), self.pressure[padded].copy()
        return part

    @property
    def inward(self) -> float:
        """Sign of a normal velocity that points into the box."""
        return -1.0 if self.high else 1.0

    def face(self, grid: Grid) -> int:
        """Index of the layer of faces on the side, in padded velocities."""
        return LOW + grid.cells[self.axis] if self.high else LOW

    def layer(self, array: Any, index: int) -> Any:
        """View of one layer of cells parallel to the side."""
        return array[layers(self.axis, index)]


@serial
def fill_side(velocity, axis, high, n, wall, mirror, outlet):
    """Set the boundary faces and ghosts of a velocity (3, nz, ny, nx) at one side of n cells.

    wall    (3, plane) velocity given on the face [m/s]
    mirror  (plane) of tangential velocities: ghost = mirror * inside + 2 wall at no-slip walls
    outlet  (plane) whether the normal velocity is free
    """
    face, out = (n + LOW, 1) if high else (LOW, -1)
    last = n + LOW - 1 if high else LOW  # the cell at the side
    before = max(last - 1, LOW) if high else min(last + 1, n + LOW - 1)  # the one inward of it
    size = velocity.shape[3 - axis]
    for a in range(mirror.shape[0]):
        for b in range(mirror.shape[1]):
            k, j, i = place(axis, face, a, b)
            kk, jj, ii = place(axis, face - out, a, b)
            at_face = velocity[axis, k, j, i] if outlet[a, b] else wall[axis, a, b]
            # Fluid that flows back through an outlet comes from rest: it brings no momentum.
            leaves = 0.0 if outlet[a, b] and at_face * out < 0.0 else 1.0
            velocity[axis, k, j, i] = at_face
            beyond = at_face * leaves if outlet[a, b] else 2.0 * at_face - velocity[axis, kk, jj, ii]
            for ghost in (face + out, face + 2 * out):
                if 0 <= ghost < size:
                    k, j, i = place(axis, ghost, a, b)
                    velocity[axis, k, j, i] = beyond
            for component in range(3):
                if component == axis:
                    continue
                fixed = 2.0 * wall[component, a, b] if mirror[a, b] < 0.0 else 0.0
                for depth in range(HIGH if high else LOW):
                    k, j, i = place(axis, last + out * (depth + 1), a, b)
                    kk, jj, ii = place(axis, before if depth else last, a, b)
                    velocity[component, k, j, i] = mirror[a, b] * leaves * velocity[component, kk, jj, ii] + fixed


def refuse_trapped_inflow(grid: Grid, boundaries: Boundaries) -> None:
    """Raise `InputError` if the steady inflow has no outlet to leave through."""
    if boundaries.has_outlet:
        return
    grid, boundaries = grid.whole, boundaries.box
    net, gross = 0.0, 0.0
    for side in boundaries.sides:
        for number in side.inlets:
            here = side.owner == number
            speed = boundaries.superficial(side, number, here, 0.0, steady=True)[:, side.axis]
            net += float((speed * side.inward).sum()) * grid.face_area(side.axis)  # local: inlets of the whole box
            gross += float(np.abs(speed).sum()) * grid.face_area(side.axis)  # local: inlets of the whole box
    if abs(net) > 1e-9 * gross:
        raise InputError(
            "boundaries", None, "such that what flows in can leave",
            f"{net:.3g} m3/s enter and no side is an outlet; add Outlet() to one",
        )  # fmt: skip
