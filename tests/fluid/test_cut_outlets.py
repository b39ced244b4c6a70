"""Outlets whose faces a smooth wall cuts."""

from __future__ import annotations

import numpy as np

from cfddem.fluid.conditions import Inlet, Outlet
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver
from cfddem.fluid.surfaces import cylinder


def test_a_disturbed_flow_calms_down_at_an_outlet_with_thin_faces():
    """From 10 m/s at random, above an inlet of 1 m/s. Where convection acted on more fluid than the growth of the fluid
    beyond the outlet, thin faces had 17 to 33 m/s after 0.02 s, and a spouted bed diverged."""
    for seed in range(2):
        grid = within(Grid((8, 8, 5), (0.01, 0.01, 0.01)), cylinder((0.04, 0.04, 0.0), 0.04))
        fluid = FluidSolver(grid, {"z_low": Inlet(1.0), "z_high": Outlet()}, density=1.2, viscosity=1.8e-5)
        rng = np.random.default_rng(seed)
        fluid.set_velocity([10.0 * rng.normal(size=fluid.face_velocity(d).shape) for d in range(3)])
        fluid.run_until(0.02, largest=1e-3)
        assert np.abs(fluid.face_velocity(2)[-1]).max() < 9.0
