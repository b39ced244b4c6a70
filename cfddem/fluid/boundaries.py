"""The six sides of the box as the solver sees them: known faces, unknown faces, ghost values.

Each side, named `x_low` to `z_high`, has a condition or a list of them. The first of a list covers the whole
side (a wall, if it says `where` it holds); each later one covers the region its `where` selects and wins there, so
that a floor with jets reads

    z_low=[NoSlip(), Inlet(2.0, where=discs([(0.05, 0.05)], diameter=0.01))]

A condition becomes a fixed or free normal velocity on the boundary face and a rule for the ghosts beyond it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.errors import InputError
from cfddem.fluid.conditions import SIDES, Condition, FreeSlip, Inlet, NoSlip, Outlet, Periodic
from cfddem.fluid.ghosts import continue_cells, fill_side
from cfddem.fluid.grid import HIGH, LOW, Array, Grid, layers


@dataclass
class Side:
    """A side as arrays over its plane, ghost rows included, in the order of the two remaining array axes."""

    name: str
    axis: int
    high: bool
    conditions: list[Condition]

    def __post_init__(self) -> None:
        self.owner = np.zeros(0, dtype=np.int64)  # which condition holds, without ghost rows
        self.mirror = np.zeros(0)  # of tangential velocities: ghost = mirror * inside + 2 wall where it sticks
        self.wall = np.zeros(0)  # (3, plane) velocity given on the face [m/s]
        self.outlet = np.zeros(0, dtype=bool)
        self.pressure = np.zeros(0)  # given on outlets [Pa]
        self.inlets: list[int] = []  # which conditions are inlets

    @property
    def inward(self) -> float:
        """Sign of a normal velocity that points into the box."""
        return -1.0 if self.high else 1.0

    def layer(self, array: Any, index: int) -> Any:
        """View of one layer of cells parallel to the side."""
        return array[layers(self.axis, index)]


class Boundaries:
    """All six sides of a grid; fills ghost cells.

    Sides not named are no-slip walls, or free-slip where the box is one cell thick.
    """

    def __init__(self, grid: Grid, conditions: Mapping[str, Condition | Sequence[Condition]] | None = None) -> None:
        given = dict(conditions or {})
        for name in given:
            if name not in SIDES:
                raise InputError(f"boundaries.{name}", None, "one of " + ", ".join(SIDES))
        self.grid = grid
        self.periodic, self.driving = np.zeros(3, dtype=bool), np.zeros(3)
        self._cells = np.array(grid.cells)
        self.sides: list[Side] = []
        for axis in range(3):
            plain: Condition = FreeSlip() if grid.cells[axis] == 1 else NoSlip()
            pair = []
            for high in (False, True):
                name = SIDES[2 * axis + high]
                listed = given.get(name, plain)
                several = [listed] if isinstance(listed, Condition) else list(listed)
                if not several:
                    raise InputError(f"boundaries.{name}", None, "a condition or a list of at least one")
                if getattr(several[0], "where", None) is not None:
                    several.insert(0, plain)
                pair.append(Side(name, axis, high, several))
            self._pair_up(axis, pair)
        for side in self.sides:
            self._lay_out(side)
        self.has_outlet = any(bool(side.outlet.any()) for side in self.sides)

    def _pair_up(self, axis: int, pair: list[Side]) -> None:
        """A periodic direction needs both its sides; others are kept as sides."""
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
        """Turn the conditions of a side into its arrays."""
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
        side.mirror, side.wall = self._extend(mirror), self._extend(wall)
        side.outlet, side.pressure = self._extend(outlet), self._extend(pressure)

    @staticmethod
    def _refuse_blocked(side: Side, here: Any, solid: Any) -> None:
        """An inlet needs open cells behind all its faces, and some face."""
        if not here.any():
            raise InputError(f"boundaries.{side.name}", None, "an inlet that covers the centre of some cell")
        blocked = int((here & solid).sum())
        if blocked:
            raise InputError(
                f"boundaries.{side.name}", None, "an inlet whose cells are all open",
                f"{blocked} of its {int(here.sum())} cells are solid; narrow it with `where`",
            )  # fmt: skip

    def _points(self, side: Side) -> tuple[Array, Array, Array]:
        """Centres of the boundary faces of a side, x, y, z as full arrays over its plane."""
        coordinates = np.broadcast_arrays(*self.grid.faces(side.axis))
        index = -1 if side.high else 0
        x, y, z = (np.array(side.layer(c, index)) for c in coordinates)
        return x, y, z

    @staticmethod
    def _extend(plane: Array) -> Array:
        """A plane continued into the ghost rows around it."""
        around = [(0, 0)] * (plane.ndim - 2) + [(LOW, HIGH)] * 2
        return np.pad(plane, around, mode="edge")

    # ------------------------------------------------------------ every step

    def set_inlets(self, time: float, voidage: Array) -> None:
        """Take the inlet velocities of this time; voidage is padded and holds its ghosts."""
        for side in self.sides:
            for number in side.inlets:
                here = side.owner == number
                superficial = self.superficial(side, number, here, time)
                inside = side.layer(self.grid.inner(voidage), -1 if side.high else 0)[here]
                wall = side.wall[:, LOW:-HIGH, LOW:-HIGH].copy()
                wall[:, here] = superficial.T / inside
                side.wall = self._extend(wall)

    def superficial(self, side: Side, number: int, here: np.ndarray, time: float, steady: bool = False) -> Array:
        """Superficial velocity (n, 3) on the n faces of an inlet [m/s]; steady leaves its time factor out."""
        inlet = side.conditions[number]
        assert isinstance(inlet, Inlet)
        x, y, z = (c[here] for c in self._points(side))
        by_function = callable(inlet.velocity)
        given = np.asarray(inlet.velocity(x, y, z, time) if callable(inlet.velocity) else inlet.velocity, dtype=float)
        vector = np.zeros((x.size, 3))
        if given.ndim == 0 or (by_function and given.shape == (x.size,)):
            vector[:, side.axis] = side.inward * given
        elif given.shape == (x.size, 3) or (not by_function and given.shape == (3,)):
            vector[:] = given
        else:
            wanted = (
                f"of shape ({x.size},) or ({x.size}, 3) for {x.size} faces" if by_function else "a speed or a vector"
            )
            raise InputError(f"boundaries.{side.name}.velocity", given.shape, wanted)
        if inlet.in_time is not None and not steady:
            vector *= float(inlet.in_time(time))
        bad = ~np.isfinite(vector).all(axis=1)
        if bad.any():
            n = int(np.argmax(bad))
            raise InputError(
                f"boundaries.{side.name}.velocity", None, "a number everywhere",
                f"it is not at x, y, z = {x[n]:g}, {y[n]:g}, {z[n]:g} m, t = {time:g} s",
            )  # fmt: skip
        return vector

    def varies_along(self, axis: int) -> bool:
        """Whether the flow can vary along an axis: not if it is one cell thick between planes of symmetry."""
        sides = [side for side in self.sides if side.axis == axis]
        return self.grid.cells[axis] > 1 or any((side.mirror < 0.0).any() or side.outlet.any() for side in sides)

    def mark_unknowns(self) -> tuple[Array, Array]:
        """Which faces carry an unknown velocity, and which are buried in solid: two (3, ...) arrays of 0 and 1."""
        grid = self.grid
        fluid = np.zeros(grid.padded_shape)
        grid.inner(fluid)[:] = grid.open
        self.wrap(fluid)
        solid = np.zeros(grid.padded_shape)
        grid.inner(solid)[:] = ~grid.open
        self.fill_cells(solid)
        solved, buried = np.zeros((3, *grid.padded_shape)), np.zeros((3, *grid.padded_shape))
        for d in range(3):
            both = fluid * np.roll(fluid, 1, axis=2 - d)
            grid.inner_faces(solved[d], d)[:] = grid.inner_faces(both, d)
            buried[d] = solid * np.roll(solid, 1, axis=2 - d)
        for side in self.sides:
            face = LOW + self.grid.cells[side.axis] if side.high else LOW
            inside = side.layer(fluid, face - 1 if side.high else face)
            side.layer(solved[side.axis], face)[:] = side.outlet * inside
        return solved, buried

    def blocked_faces(self) -> np.ndarray:
        """(3, ...) true on faces of which a solid cell is one side."""
        solid = np.zeros(self.grid.padded_shape)
        self.grid.inner(solid)[:] = ~self.grid.open
        self.fill_cells(solid)
        return np.stack([(solid + np.roll(solid, 1, axis=2 - d)) > 0.0 for d in range(3)])

    # ------------------------------------------------------------ ghost cells

    def wrap(self, array: Array) -> None:
        """Copy periodic ghost layers of a padded field."""
        for axis in range(3):
            if self.periodic[axis]:
                self._wrap_axis(array, axis)

    def _wrap_axis(self, array: Array, axis: int) -> None:
        n = self.grid.cells[axis]
        for ghost in (0, 1, n + LOW, n + LOW + 1, n + LOW + 2):
            array[layers(axis, ghost)] = array[layers(axis, LOW + (ghost - LOW) % n)]

    def fill_cells(self, array: Array) -> None:
        """Ghosts of a cell field (nz, ny, nx), or of several: periodic, or the value of the nearest cell."""
        continue_cells(array[None] if array.ndim == 3 else array, self._cells, self.periodic)

    def fill_pressure(self, pressure: Array, correction: bool = False) -> None:
        """First ghost layer of a pressure: given on outlets (zero for a correction), no gradient at walls."""
        self.fill_cells(pressure)
        for side in self.sides:
            if side.outlet.any():
                n = self.grid.cells[side.axis]
                inside, ghost = (n + LOW - 1, n + LOW) if side.high else (LOW, LOW - 1)
                held = 0.0 if correction else 2.0 * side.pressure
                value = held - side.layer(pressure, inside)
                side.layer(pressure, ghost)[side.outlet] = value[side.outlet]

    def fill_faces(self, vector: Array) -> None:
        """Ghosts of a face field (3, ...): periodic, or the value of the nearest face."""
        for axis in range(3):
            if self.periodic[axis]:
                self._wrap_axis(vector, axis)
                continue
            n = self.grid.cells[axis]
            for component in range(3):
                field, last = vector[component], n + LOW if component == axis else n + LOW - 1
                field[layers(axis, slice(LOW))] = field[layers(axis, slice(LOW, LOW + 1))]
                field[layers(axis, slice(last + 1, None))] = field[layers(axis, slice(last, last + 1))]

    def fill_velocity(self, velocity: Array) -> None:
        """Boundary faces and ghosts of a velocity (3, ...)."""
        for axis in range(3):
            if self.periodic[axis]:
                self._wrap_axis(velocity, axis)
            else:
                for side in self.sides:
                    if side.axis == axis:
                        fill_side(velocity, axis, side.high, self.grid.cells[axis], side.wall, side.mirror, side.outlet)
