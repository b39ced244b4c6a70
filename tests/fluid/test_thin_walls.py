"""Thin walls: nothing passes through them, fluid sticks to both sides, and particles stay with the cells of a side."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_smooth_walls import assert_mass_is_kept
from test_surfaces_of_triangles import BOX, revolved, turned_by

from cfddem.backend.errors import InputError
from cfddem.coupling.kernel import FilterKernel
from cfddem.fluid.budgets import continuity_residual
from cfddem.fluid.cell_groups import large_cells
from cfddem.fluid.conditions import Inlet, NoSlip, Outlet, Periodic
from cfddem.fluid.cut_cells import open_share, within
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver, Scheme
from cfddem.fluid.surfaces import cylinder
from cfddem.fluid.thin_walls import ASIDE, ThinWall, divided, thin_wall
from cfddem.fluid.wall_force import force_on_walls

MIDDLE = (0.5, 0.5, 0.0)


def tube(radius: float, low: float, high: float, sides: int = 48) -> np.ndarray:
    """An open tube about the middle of the unit box (T, 3, 3)."""
    return np.add(revolved([(low, radius), (high, radius)], sides)[2 * sides : 4 * sides], MIDDLE)


def plate(x: float, *, reach: float = 3.0) -> ThinWall:
    """A plate across the box, normal to x."""
    corners = np.array([[x, -reach, -reach], [x, reach, -reach], [x, reach, reach], [x, -reach, reach]])
    return thin_wall(corners[[[0, 1, 2], [0, 2, 3]]])


# ---------------------------------------------------------------- nothing passes through


def test_nothing_leaves_a_tube_from_the_floor_to_the_lid():
    """Fluid enters inside of it only: each height has that flow within, and none around it, to 1e-12."""
    n = 10
    grid = within(Grid((n, n, n), (1.0 / n,) * 3), divided(thin_wall(tube(0.27, -1.0, 2.0)), cylinder(MIDDLE, 0.47)))
    inside = lambda x, y, z: np.hypot(x - 0.5, y - 0.5) < 0.27  # noqa: E731
    sides = {"z_low": [NoSlip(), Inlet(0.5, where=inside)], "z_high": Outlet()}
    fluid = FluidSolver(grid, sides, density=1.0, viscosity=1e-3, scheme=Scheme(tolerance=1e-13))
    for _ in range(3):
        fluid.step(0.02)
    flux = fluid.volume_flux(2) * grid.face_area(2)
    x, y = (np.broadcast_to(each, flux.shape) for each in grid.faces(2)[:2])
    within_tube = inside(x, y, 0.0)
    entering = flux[0].sum()
    assert entering == pytest.approx(0.5 * within_tube[0].sum() / n**2)
    assert np.abs((flux * within_tube).sum(axis=(1, 2)) / entering - 1.0).max() < 1e-12
    assert np.abs((flux * ~within_tube).sum(axis=(1, 2))).max() < 1e-12 * entering
    assert np.abs(fluid.velocity[~within_tube[:-1]]).max() < 1e-7  # the first of two stages is solved less closely
    assert np.abs(continuity_residual(fluid)).max() < 1e-12 * entering


@pytest.mark.parametrize(("lean", "spin"), [(0.0, 0.0), (0.4, 0.7)])
def test_a_stream_does_not_enter_a_closed_box_of_thin_walls(lean, spin):
    """At any turn against the grid; the fluid in it stays at rest, but for the tolerance of the first stage."""
    corners = np.add(turned_by(0.23 * BOX, lean, spin), [0.48, 0.53, 0.49])
    thin = thin_wall(corners)
    grid = within(Grid((10, 10, 10), (0.1,) * 3), divided(thin))
    fluid = FluidSolver(
        grid, {"z_low": Inlet(0.5), "z_high": Outlet()}, density=1.0, viscosity=1e-2, scheme=Scheme(tolerance=1e-13)
    )
    for _ in range(3):
        fluid.step(0.02)
    cut = fluid.boundaries.cut
    assert all(np.abs(fluid.volume_flux(d))[grid.inner_faces(cut.thin[d], d) > 0.0].max() == 0.0 for d in range(3))
    centres = np.stack([each.ravel() for each in np.broadcast_arrays(*grid.centres())], axis=-1)
    held = (thin.side(centres) > 0.0).reshape(grid.shape)
    assert held.sum() > 20
    assert np.abs(fluid.velocity[held]).max() < 1e-8 and np.abs(fluid.velocity[~held]).max() > 0.5


drawn_as = st.tuples(*3 * (st.floats(0.1, 0.4),), *2 * (st.floats(-0.6, 0.6),), *2 * (st.floats(0.35, 0.65),))


def drawn_walls(a, b, c, lean, spin, x, y):
    """A tube or frustum that leans, and a plate beside it, in a cylinder."""
    frustum = revolved([(-c, a), (c, b)], 12)[24:48]
    sheet = np.array([[0.9, 0.0, 0.1], [0.9, 1.0, 0.1], [0.8, 1.0, 0.7]])[None]
    walls = thin_wall(np.add(turned_by(frustum, lean, spin), [x, y, 0.5]), sheet)
    return [divided(walls, cylinder((0.5, 0.52, 0.0), 0.6))]


@settings(max_examples=4, deadline=None, derandomize=True)
@given(drawn_as)
def test_mass_is_kept_beside_a_few_thin_walls(drawn):
    assert_mass_is_kept(drawn_walls(*drawn))


@pytest.mark.slow
@settings(max_examples=100, deadline=None, derandomize=True)
@given(drawn_as)
def test_mass_is_kept_beside_any_thin_walls(drawn):
    assert_mass_is_kept(drawn_walls(*drawn))


# ---------------------------------------------------------------- fluid sticks to both sides


def test_a_wall_that_slides_drags_the_fluid_up_to_a_plate_and_not_behind_it():
    """Linear in front of the plate, which lies between cells; at rest behind it."""
    n = 8
    grid = within(Grid((n, 2, 2), (1.0 / n,) * 3), divided(plate(0.5)))
    sides = {"x_low": NoSlip((0.0, 0.0, 1.0)), "y_low": Periodic(), "y_high": Periodic()}
    sides |= {"z_low": Periodic(), "z_high": Periodic()}
    fluid = FluidSolver(grid, sides, density=1.0, viscosity=1.0)
    fluid.run_until(1.0, largest=1e-3)
    x = (np.arange(n) + 0.5) / n
    assert np.allclose(fluid.velocity[0, 0, :, 2], np.maximum(1.0 - 2.0 * x, 0.0), atol=1e-9)
    assert len(force_on_walls(fluid)[0]) == 0  # thin walls have no part in it


def test_a_plate_halves_a_channel():
    """The flow of both halves is G H^3/(12 mu) (1 + 2/N^2), with N cells across, as between sides of a box."""
    n, fall = 16, 12.0
    sides = {"y_low": Periodic(), "y_high": Periodic(), "z_low": Periodic(fall), "z_high": Periodic(fall)}
    for place in (0.5, 0.5 + 0.3 / n):  # also a plate that does not lie between cells: a step away at most
        grid = within(Grid((n, 2, 2), (1.0 / n,) * 3), divided(plate(place)))
        fluid = FluidSolver(grid, sides, density=1.0, viscosity=1.0)
        fluid.run_until(0.4, largest=2e-3)  # 16 times the slowest decay
        flux = fluid.volume_flux(2)[0, 0].reshape(2, -1).sum(axis=1) / n
        assert flux == pytest.approx(2 * [0.125 * (1.0 + 2.0 / 8**2)], rel=1e-6)


def flows(n: int, inner: float, shift: float) -> tuple[float, float]:
    """Flow through a thin tube and around it in a pipe of radius 0.5 with n cells across, over the exact ones."""
    h = 1.0 / n
    centre = np.array([(0.5 * (n + 2) + shift) * h, (0.5 * (n + 2) + 0.4 * shift) * h, 0.0])
    thin = thin_wall(np.add(tube(inner, -1.0, 1.0, 96), centre - MIDDLE))
    grid = within(Grid((n + 2, n + 2, 1), (h,) * 3), divided(thin, cylinder(tuple(centre), 0.5)))
    fluid = FluidSolver(grid, {"z_low": Periodic(8.0), "z_high": Periodic(8.0)}, density=1.0, viscosity=1.0)
    fluid.run_until(0.6, largest=0.05 * h)
    flux = fluid.volume_flux(2)[0] * h * h
    x, y, _ = np.broadcast_arrays(*grid.faces(2))
    core = np.hypot(x - centre[0], y - centre[1])[0] < inner
    ratio = (0.25 - inner**2) / math.log(0.5 / inner)
    around = math.pi * ((0.5**4 - inner**4) - (0.25 - inner**2) * ratio)
    return float(flux[core].sum()) / (math.pi * inner**4), float(flux[~core].sum()) / around


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.0, 0.27])
def test_flow_in_a_draft_tube_and_around_it_is_met_within_the_steps_of_its_wall(shift):
    """16 cells across the pipe, 8 across the tube: 1.10 and 1.00 in the middle, 0.95 and 1.07 shifted."""
    in_tube, around = flows(16, 0.25, shift)
    assert in_tube == pytest.approx(1.0, abs=0.12) and around == pytest.approx(1.0, abs=0.08)


# ---------------------------------------------------------------- particles beside a plate


def test_particles_deposit_on_their_side_and_gather_from_it():
    """Beside a plate that lies within cells: all of the volume, on the own side, without jumps; gather is adjoint."""
    n = 8
    place = 0.5 + 0.3 / n
    grid = within(Grid((n, n, n), (1.0 / n,) * 3), divided(plate(place)))
    kernel = FilterKernel(grid, (False, False, False), smoothing=0.2)
    rng = np.random.default_rng(1)
    position = rng.uniform(0.1, 0.9, (400, 3))
    position[:, 0] = place + rng.choice([-1.0, 1.0], 400) * rng.uniform(0.01, 0.2, 400)
    radius, right = np.full(400, 0.01), position[:, 0] > place
    for side in (right, ~right):
        cells = kernel.map_particles(position[side], radius[side])
        fraction = kernel.solid_fraction(cells)
        assert fraction.sum() * grid.cell_volume == pytest.approx(cells.volume.sum(), rel=1e-12)
        own = slice(n // 2, None) if side is right else slice(0, n // 2)
        assert fraction[:, :, own].sum() == pytest.approx(fraction.sum(), rel=1e-12)
    field = rng.uniform(size=(1, *grid.shape))
    every = kernel.map_particles(position, radius)
    value = rng.uniform(size=(400, 1))
    given, taken = kernel.deposit(every, value), kernel.gather(every.stencil, field)
    assert float((given * field).sum()) == pytest.approx(float((value * taken).sum()), rel=1e-9)
    line = np.full((2001, 3), 0.47)
    line[:, 0] = np.linspace(0.2, place - 1e-3, 2001)
    seen = kernel.gather(kernel.stencil(line, np.full(2001, 0.01)), field)[:, 0]
    assert np.abs(np.diff(seen)).max() < 0.01


@pytest.mark.parametrize("turn", [0.3, 0.5, 0.785])
def test_small_cells_of_a_vessel_belong_to_large_ones_on_their_side_of_a_baffle(turn):
    """From the axis to the wall, and from wall to wall: particles on one side then leave the other one empty."""
    n, radial = 12, np.array([math.cos(turn), math.sin(turn), 0.0])
    for begin in (0.0, -1.0):
        ends = [np.array(MIDDLE) + each * radial for each in (begin, 1.0)]
        corners = np.array([ends[0] - [0, 0, 1], ends[1] - [0, 0, 1], ends[1] + [0, 0, 2], ends[0] + [0, 0, 2]])
        thin = thin_wall(corners[[[0, 1, 2], [0, 2, 3]]])
        grid = within(Grid((n, n, 3), (1.0 / n,) * 3), divided(thin, cylinder(MIDDLE, 0.47)))
        share = np.asarray(open_share(grid))
        small, home = large_cells(grid, share)
        places = np.stack([each.ravel() for each in np.broadcast_arrays(*grid.centres())], axis=-1) + ASIDE / n
        held = np.flatnonzero((share > 0.0) & (share < 0.5))
        assert len(held) == 3 * 24 and small.ravel()[held].all() and not small.ravel()[home[held]].any()
        assert not thin.between(places[held], places[home[held]]).any()
    rng = np.random.default_rng(2)
    away, angle = 0.45 * np.sqrt(rng.uniform(0, 1, 300)), turn + rng.uniform(0.0, math.pi, 300)
    position = np.stack([0.5 + away * np.cos(angle), 0.5 + away * np.sin(angle), rng.uniform(0.02, 0.2, 300)], axis=-1)
    kernel = FilterKernel(grid, (False, False, False), smoothing=0.2)
    cells = kernel.map_particles(position, np.full(300, 0.01))
    volume = (kernel.solid_fraction(cells) * share).ravel() * grid.cell_volume
    own = np.sign(thin.side(position))[0] == np.sign(thin.side(places))
    assert volume[~own].sum() == 0.0 and volume[own].sum() == pytest.approx(cells.volume.sum(), rel=1e-12)


def test_a_small_cell_without_a_large_one_on_its_side_has_a_group_of_its_own():
    """Within a closed tube of one cell, whose only cell is said to be a tenth open."""
    thin = thin_wall(np.add(0.06 * BOX, [0.55, 0.45, 0.5]))
    grid = within(Grid((10, 10, 1), (0.1, 0.1, 1.0)), divided(thin))
    share = np.ones(grid.shape)
    share[0, 4, 5] = share[0, 1, 1] = 0.1
    small, home = large_cells(grid, share)
    assert home[45] == 45 and not small[0, 4, 5] and small.sum() == 1 and home[11] != 11


@pytest.mark.parametrize("place", [0.0, 1.0])
def test_a_plate_in_periodic_sides_is_refused_and_one_beside_them_closes_faces(place):
    sides = {"x_low": Periodic(), "x_high": Periodic()}
    with pytest.raises(InputError, match="thin wall: must be away from the periodic sides along x; move it by a cell"):
        FluidSolver(within(Grid((4, 4, 4), (0.25,) * 3), divided(plate(place))), sides, density=1.0, viscosity=1.0)
    grid = within(Grid((4, 4, 4), (0.25,) * 3), divided(plate(0.25 + 0.5 * place)))
    cut = FluidSolver(grid, sides, density=1.0, viscosity=1.0).boundaries.cut
    assert (grid.inner(cut.thin[0]) > 0.0).sum() == 16


def test_thin_walls_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="at least one triangle with an area"):
        thin_wall(np.zeros((1, 3, 3)))
    with pytest.raises(InputError, match="all have their normals on one side; orient them alike"):
        thin_wall(np.concatenate([tube(0.2, 0.0, 1.0)[:1, ::-1], tube(0.2, 0.0, 1.0)[1:]]))
