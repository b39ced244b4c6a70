"""What the fluid is at any point and in any cell: velocity, pressure gradient, viscous force, beside walls too."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.sampled_flow import velocity_gradient
from cfddem.fluid.conditions import SIDES, FreeSlip, Inlet, NoSlip, Outlet, Periodic
from cfddem.fluid.grid import Grid, outside_cone, outside_cylinder
from cfddem.fluid.solver import FluidSolver


def linear(a, b, c, d):
    return lambda x, y, z: a + b * x + c * y + d * z


def test_velocity_at_points_is_exact_for_linear_fields():
    """Tri-linear between faces, up to the walls."""
    grid = Grid((6, 5, 7), (0.1, 0.2, 0.15), origin=(-0.3, 0.2, 1.0))
    fluid = FluidSolver(grid, dict.fromkeys(SIDES, Outlet()), density=1.0, viscosity=0.1)
    parts = (linear(1, 2, 3, 4), linear(0, -1, 1, 2), linear(2, 1, 1, -3))
    fluid.set_velocity(parts)
    points = np.random.default_rng(0).uniform((-0.2, 0.4, 1.15), (0.2, 1.0, 1.9), (40, 3))
    expected = np.stack([f(*points.T) for f in parts], axis=1)
    assert fluid.velocity_at(points) == pytest.approx(expected, abs=1e-7)


def test_pressure_gradient_and_viscous_force_in_cells_of_plane_poiseuille_flow():
    """The force on a parcel anywhere: mu u'' = dp/dx = -G, also in the cells beside the walls."""
    fall, mu, n = 2.0, 0.5, 16
    sides = {"x_low": Periodic(fall), "x_high": Periodic(fall)}
    fluid = FluidSolver(Grid((4, 1, n), (1 / n,) * 3), sides, density=1.0, viscosity=mu, voidage=0.6)
    fluid.run_until(4.0)
    assert fluid.cell_pressure_gradient()[0] == pytest.approx(-fall, rel=1e-9)
    assert fluid.cell_viscous_force()[0] == pytest.approx(-fall, rel=1e-6)
    assert np.abs(fluid.cell_viscous_force()[1:]).max() < 1e-6


def test_pressure_gradient_in_cells_beside_inlet_outlet_and_mask():
    """Drag of a uniform bed in a masked cylinder: the gradient is that of the bed in every cell of it."""
    grid = Grid((10, 10, 12), (0.01,) * 3).with_solid(outside_cylinder((0.05, 0.05, 0), 0.045))
    fluid = FluidSolver(
        grid, {"z_low": [FreeSlip(), Inlet(0.3, where=lambda x, y, z: (x - 0.05) ** 2 + (y - 0.05) ** 2 < 0.045**2)],
               "z_high": Outlet()}, density=1.0, viscosity=0.0, voidage=0.5,
    )  # fmt: skip
    beta = 1e4 * grid.open
    for _ in range(5):
        fluid.step(1.0, None, beta)
    gradient = fluid.cell_pressure_gradient()[:, grid.open]
    assert gradient[2] == pytest.approx(-1e4 * 0.6 / 0.5, rel=1e-5)
    assert np.abs(gradient[:2]).max() < 1e-4 * 1.2e4


def test_a_viscosity_is_interpolated_between_centres():
    """Tri-linear between centres; the nearest cell beyond the last centre."""
    grid = Grid((4, 3, 5), (0.1, 0.2, 0.1))
    x, y, z = grid.centres()
    field = 1 + x + 2 * y - z
    found = FilterKernel(grid, (False, False, False)).between_centres(
        field, np.array([[0.2, 0.3, 0.25], [0.0, 0.0, 0.0]])
    )
    assert found == pytest.approx([1 + 0.2 + 0.6 - 0.25, field[0, 0, 0]])


def test_flow_through_a_cone_keeps_its_flux():
    """Volume of a frustum of masked cells within 2 %, and a flow through it keeps its flux from bottom to top."""
    grid = Grid.of_size((0.2, 0.2, 0.3), 0.01, solid=outside_cone((0.1, 0.1, 0), (0.05, 0.25), (0.03, 0.09)))
    h = 0.2
    frustum = np.pi * h / 3 * (0.03**2 + 0.03 * 0.09 + 0.09**2) + np.pi * 0.05 * (0.03**2 + 0.09**2)
    assert grid.open.sum() * grid.cell_volume == pytest.approx(frustum, rel=0.02)
    sides = {"z_low": [NoSlip(), Inlet(1.0, where=lambda x, y, z: (x - 0.1) ** 2 + (y - 0.1) ** 2 < 0.029**2)]}
    fluid = FluidSolver(grid, {**sides, "z_high": Outlet()}, density=1.0, viscosity=1e-3)
    for _ in range(3):
        fluid.step(2e-3)
    flux = fluid.volume_flux(2).sum(axis=(1, 2))
    assert flux == pytest.approx(flux[0], rel=1e-6)
    assert not fluid.velocity[grid.solid].any()


def test_velocity_gradient_has_no_seam_at_periodic_sides() -> None:
    """A shear wave: the gradient is the same sine everywhere; beside a wall it is one-sided, zero along one cell."""
    count, height = 24, 0.024
    grid = Grid((4, 1, count), (1e-3, 1e-3, height / count))
    fluid = FluidSolver(grid, {"x_low": Periodic(), "x_high": Periodic(), "z_low": Periodic(), "z_high": Periodic()},
                        density=1000.0, viscosity=0.0)  # fmt: skip
    number = 2.0 * np.pi / height
    fluid.set_velocity((lambda x, y, z: np.sin(number * z) + 0.0 * x * y, 0.0, 0.0))
    slope = velocity_gradient(fluid, FilterKernel(grid, (True, False, True)))
    z = grid.centres()[2]
    expected = np.cos(number * z) * np.sin(number * grid.spacing[2]) / grid.spacing[2] + 0.0 * slope[0, 2]
    assert slope[0, 2] == pytest.approx(expected, abs=1e-9 * number)
    slope[0, 2] = 0.0
    assert np.abs(slope).max() < 1e-9 * number
    walls = velocity_gradient(fluid, FilterKernel(grid, (True, False, False)))[0, 2, :, 0, 0]
    velocity = fluid.velocity[:, 0, 0, 0]
    assert walls == pytest.approx(np.gradient(velocity, grid.spacing[2]), rel=1e-12)
