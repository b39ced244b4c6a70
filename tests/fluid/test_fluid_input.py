"""What cannot be started is refused in one clear line."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.backend.errors import InputError, RunFailed
from cfddem.coupling.kernel import FilterKernel
from cfddem.fluid.conditions import FreeSlip, Inlet, NoSlip, Outlet, Periodic, discs, ramp, rectangle
from cfddem.fluid.grid import Grid, outside_cylinder
from cfddem.fluid.solver import FluidSolver, Scheme

BOX = Grid((6, 6, 8), (0.01,) * 3)
AIR = {"density": 1.2, "viscosity": 1.8e-5}
THROUGH = {"z_low": Inlet(1.0), "z_high": Outlet()}


def started(sides=None, grid=BOX, **changes):
    return FluidSolver(grid, sides, **{**AIR, **changes})


def stepped(*fields, **more):
    return started(THROUGH).step(1e-3, *fields, **more)


def nan_inlet(x, y, z, t):
    return np.where(t > 0.0015, np.nan, 1.0) + 0 * x


def run_into_nan():
    fluid = started({"z_low": Inlet(nan_inlet), "z_high": Outlet()})
    for _ in range(3):
        fluid.step(1e-3)


REFUSED = {
    "cells that do not fit": (
        lambda: Grid.of_size((0.1, 0.1, 0.1), 0.03), r"grid.cell = 0.03: must be .*0.1 m along x"),
    "no size": (lambda: Grid.of_size((0.1, 0.0, 0.1), 0.01), "grid.size"),
    "no cells": (lambda: Grid((0, 4, 4), (0.1,) * 3), "grid.cells"),
    "negative spacing": (lambda: Grid((4, 4, 4), (0.1, -0.1, 0.1)), "grid.spacing"),
    "mask of another shape": (lambda: Grid((4, 4, 4), (0.1,) * 3, solid=np.zeros((4, 4), bool)), "grid.solid"),
    "all solid": (lambda: Grid((2, 2, 2), (0.1,) * 3, solid=np.ones((2, 2, 2), bool)), "fills the whole box"),
    "inlet into a solid mask": (
        lambda: started(THROUGH, BOX.with_solid(outside_cylinder((0.03, 0.03, 0.0), 0.025))),
        r"boundaries.z_low: must be an inlet whose cells are all open; \d+ of its 36 cells are solid",
    ),
    "inflow without outlet": (
        lambda: started({"z_low": Inlet(1.0)}), "0.0036 m3/s enter and no side is an outlet; add Outlet"),
    "inflow in time without outlet": (
        lambda: started({"z_low": Inlet(1.0, in_time=ramp(1, 2))}), "no side is an outlet"),
    "inlet beside every cell centre": (
        lambda: started({"z_low": [NoSlip(), Inlet(1.0, where=discs([(0.5, 0.5)], 0.01))], "z_high": Outlet()}),
        "covers the centre of some cell",
    ),
    "unknown side": (lambda: started({"top": Outlet()}), "boundaries.top: must be one of x_low"),
    "no condition": (lambda: started({"z_low": ["wall"]}), "boundaries.z_low = 'wall': must be a condition"),
    "second condition for the whole side": (
        lambda: started({"z_low": [NoSlip(), Outlet()]}), "later conditions say `where`"),
    "empty list": (lambda: started({"z_low": []}), "boundaries.z_low: must be a condition or a list"),
    "checkpoint of another grid": (
        lambda: started().restore(started(grid=Grid((4, 4, 4), (0.01,) * 3)).checkpoint()), "checkpoint.velocity"),
    "half periodic": (lambda: started({"x_low": Periodic()}), "boundaries.x_low: must be periodic .* opposite side"),
    "two gradients": (lambda: started({"x_low": Periodic(1.0), "x_high": Periodic(2.0)}), "one pressure gradient"),
    "wall that moves out of its plane": (lambda: started({"z_low": NoSlip((0, 0, 1.0))}), "in the plane of the wall"),
    "outlet pressure": (lambda: started({"z_low": Outlet(np.inf)}), "boundaries.z_low.pressure"),
    "NaN from an inlet function": (run_into_nan, r"boundaries.z_low.velocity: must be finite .*t = 0.002 s"),
    "inlet function of another shape": (
        lambda: started({"z_low": Inlet(lambda x, y, z, t: np.ones(5)), "z_high": Outlet()}), "for 36 faces"),
    "density": (lambda: started(density=0.0), "fluid.density"),
    "viscosity": (lambda: started(viscosity=-1.0), "fluid.viscosity"),
    "model": (lambda: Scheme(model="C"), '"A" or "B"'),
    "convection": (lambda: Scheme(convection="upwind"), '"limited" or "central"'),
    "tolerance": (lambda: Scheme(tolerance=1.0), "fluid.tolerance"),
    "voidage above one": (lambda: stepped(np.full(BOX.shape, 1.1)), "voidage = 1.1: must be above 0 and at most 1"),
    "voidage NaN": (lambda: stepped(np.full(BOX.shape, np.nan)), "voidage"),
    "voidage of another shape": (lambda: stepped(np.ones((6, 6, 6))), r"of shape \(nz, ny, nx\)"),
    "negative drag": (
        lambda: stepped(None, np.full(BOX.shape, -1.0)), "drag_coefficient = -1.0: must be zero or positive"),
    "drag NaN": (lambda: stepped(None, np.full(BOX.shape, np.nan)), "drag_coefficient: must be finite everywhere"),
    "drag momentum of another shape": (lambda: stepped(None, None, np.ones(BOX.shape)), "drag_momentum"),
    "source NaN": (lambda: stepped(source=np.full((*BOX.shape, 3), np.nan)), "source: must be finite everywhere"),
    "no step": (lambda: started().step(0.0), "step = 0.0: must be a positive time"),
    "voidage of a closed box that loses fluid": (
        lambda: started().step(1e-3, np.full(BOX.shape, 0.99)), "change of voidage cancel where there is no outlet"),
    "points": (lambda: started().velocity_at(np.zeros(3)), r"points = \(3,\): must be of shape \(N, 3\)"),
}  # fmt: skip


@pytest.mark.parametrize("bad, message", REFUSED.values(), ids=REFUSED)
def test_bad_input_is_refused_in_one_line(bad, message):
    """The line names the field, the number and the remedy."""
    with pytest.raises(InputError, match=message) as refusal:
        bad()
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 250


def test_a_diverging_flow_stops_and_its_place_is_named():
    """A step far above the limit."""
    fluid = started({"z_low": Inlet(10.0), "z_high": Outlet()}, viscosity=1.0)
    with pytest.raises(RunFailed, match=r"fluid|pressure") as failure:
        for _ in range(400):
            fluid.step(1.0)
    assert "\n" not in str(failure.value)


def test_solid_cells_take_the_viscosity_of_the_fluid_beside_them():
    """What is given for solid cells does not matter; a point beside the wall of a pipe sees the fluid's."""
    grid = Grid.of_size((0.8, 0.8, 0.2), 0.1, solid=outside_cylinder((0.4, 0.4, 0.0), 0.4))
    field = np.where(grid.open, 2.0 + 0.0 * grid.centres()[2], np.nan)
    fluid = FluidSolver(grid, density=1.0, viscosity=field)
    places = np.array([[0.4, 0.4, 0.1], [0.4, 0.79, 0.1], [0.14, 0.14, 0.1]])
    kernel = FilterKernel(grid, (False, False, False))
    assert kernel.between_centres(fluid.viscosity, places).tolist() == [2.0] * 3
    with pytest.raises(InputError, match="positive everywhere, or zero everywhere"):
        fluid.set_viscosity(np.where(grid.centres()[2] < 0.1, 1.0, 0.0) + 0.0 * field)
    with pytest.raises(InputError, match="a number, or one of every cell"):
        fluid.set_viscosity("thick")


def test_sides_left_out_are_walls_or_planes_of_symmetry():
    """No-slip, but free-slip where the box is one cell thick."""
    fluid = FluidSolver(Grid((8, 1, 8), (0.1,) * 3), density=1.0, viscosity=0.1)
    kinds = {side.name: type(side.conditions[0]) for side in fluid.boundaries.sides}
    assert kinds["x_low"] is NoSlip and kinds["y_low"] is FreeSlip


def test_time_functions_and_regions_have_their_values():
    """Ramp; discs and rectangles of a distributor."""
    assert [ramp(1.0, 3.0)(t) for t in (0.0, 2.0, 4.0)] == [0.0, 0.5, 1.0]
    x, y = np.meshgrid([0.1, 0.3], [0.1, 0.3])
    assert discs([(0.1, 0.1), (0.3, 0.3)], 0.05)(x, y, 0 * x).tolist() == [[True, False], [False, True]]
    assert rectangle((0, 0, -1), (0.2, 1, 1))(x, y, 0 * x).tolist() == [[True, False], [True, False]]


def test_jets_of_a_distributor_carry_the_given_flux():
    """Two holes in a floor: the inflow is the speed times the faces they cover, whatever the voidage there."""
    jets = Inlet(2.0, where=discs([(0.015, 0.015), (0.045, 0.045)], 0.015))
    fluid = started({"z_low": [NoSlip(), jets], "z_high": Outlet()}, voidage=0.5)
    fluid.step(1e-4)
    covered = int((fluid.volume_flux(2)[0] > 0).sum())
    assert covered == 2
    assert fluid.volume_flux(2)[0].sum() == pytest.approx(covered * 2.0, rel=1e-12)
    assert fluid.volume_flux(2)[-1].sum() == pytest.approx(covered * 2.0, rel=1e-6)


def test_an_inlet_alone_in_its_list_leaves_a_wall_around_it():
    """`Inlet(..., where=...)` on a side: the rest of the side is a wall."""
    fluid = started({"z_low": Inlet(2.0, where=rectangle((0, 0, -1), (0.02, 0.06, 1))), "z_high": Outlet()})
    fluid.step(1e-4)
    assert fluid.volume_flux(2)[0][:, :2] == pytest.approx(2.0)
    assert not fluid.volume_flux(2)[0][:, 2:].any()


def test_inlet_profile_as_a_vector_function():
    """A profile with a tangential part enters as given, divided by the voidage."""

    def swirl(x, y, z, t):
        return np.stack([0.1 + 0 * x, 0.0 * x, 1.0 + x], axis=1)

    fluid = started({"z_low": Inlet(swirl), "z_high": Outlet()}, voidage=0.5)
    fluid.step(1e-4)
    x, _, _ = BOX.centres()
    assert fluid.face_velocity(2)[0] == pytest.approx(np.broadcast_to((1.0 + x[0]) / 0.5, (6, 6)), rel=1e-12)
    below = fluid.velocity_at(np.array([[0.03, 0.03, 0.0]]))
    assert below[0, 0] == pytest.approx(0.2, rel=1e-9)
