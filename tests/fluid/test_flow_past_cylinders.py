"""Smooth walls in flows with published figures: cylinders in a stream and in a channel, and a pipe that leans.

References: Schaefer & Turek, Notes on Numerical Fluid Mechanics 52 (1996) 547, test case 2D-1: drag 5.57 to 5.59, lift
0.0104 to 0.0110, wake 0.0842 to 0.0852 m. In a stream without bounds: Taira & Colonius, J. Comput. Phys. 225 (2007)
2118, doi:10.1016/j.jcp.2007.03.005, table 3, who collect drags of 2.05 to 2.06 and wakes of 0.92 to 0.94 diameters at
Re 20, 1.52 to 1.54 and 2.27 to 2.35 at Re 40, of computations.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cfddem.fluid.conditions import FreeSlip, Inlet, Outlet
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.solver import FluidSolver, Scheme
from cfddem.fluid.surfaces import cylinder
from cfddem.fluid.wall_force import force_on_walls, pressure_on_walls


def force(fluid: FluidSolver) -> Array:
    """Force on the walls, per length along z [N/m]."""
    total = force_on_walls(fluid)[1].sum(axis=0) + pressure_on_walls(fluid)[1].sum(axis=0)
    return np.asarray(total / fluid.grid.spacing[2])


def end_of_wake(x: Array, velocity: Array, begin: float) -> float:
    """Where a velocity along x turns positive behind a place."""
    k = int(np.flatnonzero((x[:-1] > begin) & (velocity[:-1] < 0.0) & (velocity[1:] >= 0.0))[0])
    return float(x[k] - velocity[k] * (x[k + 1] - x[k]) / (velocity[k + 1] - velocity[k]))


def channel(cells: int, until: float = 8.0) -> tuple[float, float, float]:
    """Drag and lift coefficient, and length of the wake [m], of the test case 2D-1, with so many cells across."""
    height, length, diameter, mean = 0.41, 2.2, 0.1, 0.2
    h = height / cells

    def profile(y: Array) -> Array:
        return 6.0 * mean * y * (height - y) / height**2

    grid = within(Grid((round(length / h), cells, 1), (h, h, h)), cylinder((0.2, 0.2, 0.0), 0.05, inside=False))
    sides = {"x_low": Inlet(lambda x, y, z, t: profile(y)), "x_high": Outlet()}
    fluid = FluidSolver(grid, sides, density=1.0, viscosity=1e-3, scheme=Scheme(convection="central"))
    fluid.set_velocity((lambda x, y, z: profile(y) + 0.0 * x, 0.0, 0.0))
    fluid.run_until(until, courant=0.8)
    drag, lift, _ = force(fluid) / (0.5 * mean**2 * diameter)
    x = np.arange(grid.cells[0] + 1) * h
    points = np.stack([x, np.full(x.size, 0.2), np.full(x.size, 0.5 * h)], axis=-1)
    return float(drag), float(lift), end_of_wake(x, fluid.velocity_at(points)[:, 0], 0.25) - 0.25


@pytest.mark.slow
def test_drag_lift_and_wake_of_a_cylinder_in_a_channel_are_met_at_20_cells_a_diameter():
    drag, lift, wake = channel(82)
    assert drag == pytest.approx(5.5795, rel=0.02)
    assert lift == pytest.approx(0.0106, rel=0.05)
    assert wake == pytest.approx(0.0846, rel=0.02)


BEFORE, BEHIND, BESIDE = 20, 25, 20
"""How far the sides are away from the axis, in diameters."""


def in_stream(reynolds: float, stages: tuple[tuple[int, float], ...]) -> tuple[float, float]:
    """Drag coefficient, and wake in diameters, of a cylinder in a stream, in half of the symmetric flow.

    stages  cells a diameter, and times, in diameters over the speed; each begins with the flow of the one before
    """
    start: Any = (1.0, 0.0, 0.0)
    for cells, until in stages:
        h = 1.0 / cells
        half = Grid(((BEFORE + BEHIND) * cells, BESIDE * cells, 1), (h, h, h))
        grid = within(half, cylinder((BEFORE, 0.0, 0.0), 0.5, inside=False))
        sides = {"x_low": Inlet(1.0), "x_high": Outlet(), "y_low": FreeSlip(), "y_high": FreeSlip()}
        fluid = FluidSolver(grid, sides, density=1.0, viscosity=1.0 / reynolds, scheme=Scheme(convection="central"))
        fluid.set_velocity(start)
        fluid.run_until(until, courant=0.8, largest=0.8 * h)
        start = tuple(finer(fluid, axis) for axis in range(3))
    row = fluid.face_velocity(0)[0]
    x = np.arange(grid.cells[0] + 1) * h - BEFORE
    wake = end_of_wake(x, (9.0 * row[0] - row[1]) / 8.0, 0.5) - 0.5  # of an even profile, at its middle
    return float(force(fluid)[0] / (0.5 * 0.5)), wake  # of half of the cylinder


def finer(fluid: FluidSolver, axis: int) -> Any:
    """A component of the velocity at any point."""

    def velocity(x: Array, y: Array, z: Array) -> Array:
        x, y, z = np.broadcast_arrays(x, y, z)
        middle = np.full(x.size, 0.5 * fluid.grid.spacing[2])
        return fluid.velocity_at(np.stack([x.ravel(), y.ravel(), middle], axis=-1))[:, axis].reshape(x.shape)

    return velocity


@pytest.mark.slow
@pytest.mark.parametrize(("reynolds", "drag", "wake"), [(20.0, 2.05, 0.93), (40.0, 1.54, 2.27)])
def test_drag_and_wake_of_a_cylinder_in_a_stream_are_met_at_16_cells_a_diameter(reynolds, drag, wake):
    found = in_stream(reynolds, ((4, 40.0), (8, 12.0), (16, 8.0)))
    assert found[0] == pytest.approx(drag, rel=0.03)
    assert found[1] == pytest.approx(wake, rel=0.05)


# ---------------------------------------------------------------- a pipe that leans against the grid


class Leaning:
    """The inside of a pipe of radius 0.5 around an axis through a point."""

    def __init__(self, point: tuple[float, float, float], along: tuple[float, float, float]) -> None:
        self.point, self.along = np.array(point), np.array(along) / np.linalg.norm(along)

    def places(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        """Along the axis, and away from it."""
        off = [each - p for each, p in zip((x, y, z), self.point)]
        place = sum(o * a for o, a in zip(off, self.along))
        away = np.sqrt(sum((o - place * a) ** 2 for o, a in zip(off, self.along)))
        return np.asarray(place), np.asarray(away)

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """As of every surface."""
        return np.asarray(0.5 - self.places(x, y, z)[1])

    def velocity(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """It rests."""
        rest = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y), np.shape(z)))
        return rest, rest, rest


def leaning_pipe(cells: int, lean: float) -> float:
    """Error of the pressure gradient in a pipe with a given flow, over 8 mu U/R^2, at so many cells across.

    The fluid enters with the profile of Hagen and Poiseuille. The pressure is that along the middle half of the pipe.
    """
    h, height, viscosity = 1.0 / cells, 3.0, 1.0
    cosine, sine = math.cos(lean), math.sin(lean)
    across = math.ceil((1.0 / cosine + height * sine / cosine) * cells) + 2
    pipe = Leaning((0.5 / cosine + 0.9 * h, (0.5 * cells + 1.2) * h, 0.0), (sine, 0.0, cosine))
    grid = within(Grid((across, cells + 2, round(height * cells)), (h, h, h)), pipe)

    def profile(x: Array, y: Array, z: Array) -> Array:
        return np.maximum(2.0 * (1.0 - 4.0 * pipe.places(x, y, z)[1] ** 2), 0.0)

    inlet = Inlet(lambda x, y, z, t: profile(x, y, z)[:, None] * pipe.along)
    fluid = FluidSolver(grid, {"z_low": inlet, "z_high": Outlet()}, density=1.0, viscosity=viscosity)
    fluid.set_velocity([lambda x, y, z, a=a: a * profile(x, y, z) for a in pipe.along])
    fluid.run_until(0.1)
    x, y, z = np.broadcast_arrays(*grid.centres())
    place, away = pipe.places(x, y, z)
    total = height / cosine
    middle = (away < 0.4) & (np.abs(place - 0.5 * total) < 0.25 * total)
    slope = np.polyfit(place[middle], fluid.pressure[middle], 1)[0]
    flow = fluid.volume_flux(2)[0].sum() * h * h / (math.pi * 0.25)
    return abs(float(-slope / (8.0 * viscosity * flow / 0.25)) - 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [10.0, 30.0])
def test_the_pressure_gradient_of_a_pipe_that_leans_is_met_within_half_a_percent_at_16_cells(degrees):
    assert leaning_pipe(16, math.radians(degrees)) < 0.005
