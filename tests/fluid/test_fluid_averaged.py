"""Volume-averaged flow: voidage that varies and moves, drag, and what both models make of them."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.fluid import budgets
from cfddem.fluid.conditions import SIDES, Inlet, NoSlip, Outlet, Periodic
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver, Scheme
from scenarios.references.flows import ALL_PERIODIC, fixed_bed, still_water

ALL_WALLS = dict.fromkeys(SIDES, NoSlip())


def moving_voidage(grid, t, depth=0.2):
    x, y, z = grid.centres()
    lx, _, lz = grid.size
    return 0.6 + depth * np.sin(2 * np.pi * x / lx - 3 * t) * np.cos(2 * np.pi * z / lz) + 0 * y


def test_continuity_holds_in_every_cell():
    """V d(eps)/dt + outflow, summed face by face from the velocities, below 1e-8 of the flux through an inlet face."""
    rng = np.random.default_rng(1)
    sides = {"z_low": Inlet(0.4), "z_high": Outlet()}
    grid = Grid((12, 6, 24), (0.01, 0.02, 0.015))
    fluid = FluidSolver(grid, sides, density=1.2, viscosity=1.8e-5, voidage=moving_voidage(grid, 0.0))
    worst = 0.0
    for k in range(1, 11):
        t = 2e-3 * k
        voidage = moving_voidage(grid, t) * (1 - 1e-3 * rng.random(grid.shape))
        fluid.step(2e-3, voidage, np.full(grid.shape, 50.0))
        worst = max(worst, float(np.abs(budgets.continuity_residual(fluid)).max()))
    assert worst < 1e-8 * 0.4 * grid.face_area(2)


def test_moving_voidage_displaces_a_fluid_at_rest():
    """No inlet, no drag: the flux that the change of voidage asks for appears in the first step, and only that."""
    grid = Grid((16, 1, 1), (0.01,) * 3)
    fluid = FluidSolver(grid, density=1000.0, viscosity=1e-3, voidage=moving_voidage(grid, 0.0))
    step = 1e-3
    fluid.step(step, moving_voidage(grid, step))
    displaced = -np.cumsum(moving_voidage(grid, step) - moving_voidage(grid, 0.0), axis=2) * 0.01 / step
    assert fluid.volume_flux(0)[:, :, 1:] == pytest.approx(displaced, abs=1e-8 * np.abs(displaced).max())


def momentum(fluid):
    """rho eps u over all faces of a box, as the sum of its cells and their periodic faces."""
    total = np.zeros(3)
    for d in range(3):
        flux = fluid.volume_flux(d)
        faces = np.moveaxis(flux, 2 - d, 0)
        inner = faces[:-1] if fluid.boundaries.periodic[d] else faces[1:-1]
        total[d] = fluid.density * inner.sum() * fluid.grid.cell_volume
    return total


def pressure_on_particles(fluid, voidage):
    """Sum over cells of p times the difference of the face voidages: the part of -eps grad p that leaves the fluid."""
    total = np.zeros(3)
    for d in range(3):
        axis = 2 - d
        face_high = 0.5 * (voidage + np.roll(voidage, -1, axis))
        face_low = 0.5 * (voidage + np.roll(voidage, 1, axis))
        total[d] = (fluid.pressure * (face_high - face_low)).sum() * fluid.grid.face_area(d)
    return total


@pytest.mark.parametrize("convection", ["limited", "central"])
def test_ledgers_of_volume_and_momentum_close_in_a_periodic_box(convection):
    """Moving voidage, drag and a source: volume to 1e-12, momentum to 1e-12 of what passed through the ledger."""
    rng = np.random.default_rng(2)
    grid = Grid((10, 7, 12), (0.01, 0.02, 0.015))
    fluid = FluidSolver(
        grid,
        ALL_PERIODIC,
        density=2.0,
        viscosity=1e-3,
        scheme=Scheme(convection=convection),
        voidage=moving_voidage(grid, 0.0),
    )
    fluid.set_velocity([rng.standard_normal(fluid.face_velocity(d).shape) for d in range(3)])
    step = 5e-4
    for k in range(1, 6):
        old_voidage, old_momentum = fluid.voidage.copy(), momentum(fluid)
        previous_mean = fluid.mean_voidage.copy()
        voidage = moving_voidage(grid, step * k)
        beta = 300 * rng.random(grid.shape)
        source = rng.standard_normal((*grid.shape, 3))
        fluid.step(step, voidage, beta, beta[..., None] * rng.standard_normal((*grid.shape, 3)), source)
        outflow = budgets.continuity_residual(fluid) - (voidage - old_voidage) / step * grid.cell_volume
        assert abs(outflow.sum()) < 1e-12 * np.abs(outflow).sum()
        assert abs((fluid.voidage - old_voidage).sum()) < 1e-12 * np.abs(fluid.voidage - old_voidage).sum()
        drag = budgets.drag_exchange(fluid)
        parts = [
            step * source.sum(axis=(0, 1, 2)) * grid.cell_volume,
            drag.sum(axis=(0, 1, 2)),
            step * pressure_on_particles(fluid, 0.5 * (previous_mean + fluid.mean_voidage)),
        ]
        remainder = momentum(fluid) - old_momentum - sum(parts)
        turnover = sum(np.abs(p) for p in parts) + np.abs(old_momentum) + np.abs(drag).sum()
        assert np.abs(remainder).max() < 1e-12 * turnover.max()
        ledger = budgets.momentum_ledger(fluid)
        assert np.abs(ledger["change"] - momentum(fluid) + old_momentum).max() < 1e-12 * turnover.max()
        assert np.abs(ledger["particles"] - parts[2]).max() < 1e-12 * turnover.max()
        assert np.abs(ledger["boundaries"]).max() < 1e-12 * turnover.max()


def test_momentum_ledger_closes_in_a_closed_box():
    """Walls all round, one of them moving: what the fluid gains equals what walls, drag and source gave, to 1e-12.

    Independent route: the forces of the walls are taken on their own planes only, from the velocities and the
    pressure next to them (Heun: the mean of start and first stage for stress and convection).
    """
    rng = np.random.default_rng(5)
    n, h, step, rho, mu, eps = 8, 0.1, 2e-3, 1.5, 0.3, 0.7
    grid = Grid((n, n, n), (h, h, h))
    fluid = FluidSolver(
        grid,
        {**ALL_WALLS, "z_high": NoSlip((1.0, 0.5, 0.0))},
        density=rho,
        viscosity=mu,
        scheme=Scheme(convection="central"),
        voidage=eps,
    )
    fluid.set_velocity([rng.standard_normal(fluid.face_velocity(d).shape) for d in range(3)])
    beta = np.full(grid.shape, 40.0)
    before, start = momentum(fluid), [fluid.face_velocity(d).copy() for d in range(3)]
    lid = (1.0, 0.5)
    fluid.step(step, None, beta, np.zeros((*grid.shape, 3)))
    stage = [fluid.grid.inner_faces(fluid.fields.stage_velocity[d], d).copy() for d in range(3)]
    gained = momentum(fluid) - before

    def wall_force(u):
        """Shear of the walls, and normal stress and momentum flux through the planes of the first cell centres."""
        total = np.zeros(3)
        dilatation = sum(np.diff(u[d], axis=2 - d) for d in range(3)) / h
        for d in range(3):
            spread = 2 / 3 * mu * eps * np.moveaxis(dilatation, 2 - d, 0)
            for e in range(3):
                # Faces of component d, first and last row along e, without the boundary faces of d.
                rows = np.moveaxis(u[d], (2 - d, 2 - e), (0, 1)) if e != d else np.moveaxis(u[d], 2 - d, 0)
                if e == d:
                    low, high = rows[1], rows[-2]
                    stretch = 2 * mu * eps / h
                    total[d] += (spread[0] - stretch * low + rho * eps * 0.25 * low * low).sum() * h * h
                    total[d] -= (spread[-1] + stretch * high + rho * eps * 0.25 * high * high).sum() * h * h
                else:
                    speed = lid[d] if e == 2 and d < 2 else 0.0
                    inner = rows[1:-1]
                    total[d] += (mu * eps * (0.0 - inner[:, 0]) / (h / 2)).sum() * h * h
                    total[d] += (mu * eps * (speed - inner[:, -1]) / (h / 2)).sum() * h * h
        return total

    pressure = np.zeros(3)
    for d in range(3):
        layers = np.moveaxis(fluid.pressure, 2 - d, 0)
        pressure[d] = eps * (layers[0] - layers[-1]).sum() * h * h
    theta = (1 + 40 * step / (rho * eps)) / (2 + 40 * step / (rho * eps))
    drag = np.zeros(3)
    for d in range(3):
        seen = theta * fluid.face_velocity(d) + (1 - theta) * start[d]
        drag[d] = -40.0 * np.moveaxis(seen, 2 - d, 0)[1:-1].sum() * h**3
    walls = 0.5 * wall_force(start) + 0.5 * wall_force(stage)
    assert np.abs(walls).min() > 1e-3 and np.abs(pressure).min() > 1e-3
    assert np.abs(gained - step * (walls + pressure + drag)).max() < 1e-12 * step * np.abs(walls).max()
    held = budgets.momentum_ledger(fluid)["boundaries"] + budgets.momentum_ledger(fluid)["drag"]
    assert np.abs(held - step * (walls + pressure + drag)).max() < 1e-12 * step * np.abs(walls).max()


@pytest.mark.parametrize("convection", ["limited", "central"])
def test_a_uniform_velocity_stays_uniform_in_a_moving_voidage(convection):
    """Steep voidage sweeps past a uniform transverse velocity: storage and convection agree, nothing changes."""
    n, speed = 16, 0.8
    grid = Grid((n, 1, n), (1.0 / n,) * 3)
    step = 1.0 / n / speed / 4

    def voidage(t):
        x, _, z = grid.centres()
        return 0.65 + 0.3 * np.tanh(3 * np.sin(2 * np.pi * (x - speed * t))) * np.cos(2 * np.pi * z)

    fluid = FluidSolver(grid, ALL_PERIODIC, density=1.0, viscosity=0.0, scheme=Scheme(convection=convection))
    fluid.set_voidage(voidage(step / 2), voidage(-step / 2), step)
    fluid.set_velocity((0.0, 0.5, 0.0))
    for k in range(1, 4 * n + 1):
        fluid.step(step, voidage((k + 0.5) * step))
    assert np.ptp(fluid.face_velocity(0)) > 0.1  # the flow that moves the voidage is not uniform
    assert np.abs(fluid.face_velocity(1) - 0.5).max() < 1e-6


@pytest.mark.parametrize("voidage", [0.3, 0.65])
def test_models_a_and_b_give_the_single_phase_flow_in_a_uniform_voidage(voidage):
    """Same velocities as without particles; p_B = eps p_A = eps p of the single phase."""
    flows = {}
    for model, eps in (("A", 1.0), ("A", voidage), ("B", voidage)):
        h = 1 / 16
        fluid = FluidSolver(
            Grid((16, 1, 16), (h, h, h)), {"z_high": NoSlip((1.0, 0.0, 0.0))},
            density=1.0, viscosity=0.01, voidage=eps, scheme=Scheme(model=model, tolerance=1e-12),
        )  # fmt: skip
        for _ in range(60):
            fluid.step(0.02)
        flows[model, eps] = (fluid.velocity, fluid.pressure - fluid.pressure.mean())
    (u, p), (u_a, p_a), (u_b, p_b) = flows.values()
    assert np.abs(u_a - u).max() < 1e-10 and np.abs(u_b - u).max() < 1e-10
    assert np.abs(p_a - p).max() < 1e-9 * np.abs(p).max()
    assert np.abs(p_b - voidage * p_a).max() < 1e-9 * np.abs(p).max()


@pytest.mark.parametrize("model", ["A", "B"])
def test_a_fluid_at_rest_stays_at_rest_at_a_voidage_jump(model):
    """Water, voidage 0.4 to 1 in one cell, particles at rest, a wrong pressure to begin with:
    below 1e-10 sqrt(g H)."""
    fluid, beta = still_water(model)
    grid = fluid.grid
    limit = 1e-10 * np.sqrt(9.81 * 0.32)
    for _ in range(5):
        fluid.step(1e-3, None, beta)
    assert np.abs(fluid.velocity).max() < limit
    depth = grid.size[2] - grid.centres()[2]
    head = fluid.static_pressure - fluid.static_pressure[-1:, :, :] - 1000 * 9.81 * (depth - depth[-1])
    assert np.abs(head).max() < 1e-9 * 1000 * 9.81 * 0.32
    # From a pressure that is wrong by its own hydrostatic head the fluid comes to rest in one step.
    fluid.pressure[:] = 1000 * 9.81 * depth
    fluid.step(1e-3, None, beta)
    fluid.step(1e-3, None, beta)
    assert np.abs(fluid.velocity).max() < limit


@pytest.mark.parametrize("model", ["A", "B"])
@pytest.mark.parametrize("speed", [0.01, 0.5])
@pytest.mark.parametrize("cells", [(10, 20), (12, 16, 12)])
def test_pressure_drop_of_a_fixed_bed_is_erguns(model, speed, cells):
    """Open inlet length, one or two beds of different voidage, open top; 10 to 12 cells each: within 0.5 %."""
    assert fixed_bed(model, speed, cells) == pytest.approx(1.0, rel=5e-3)


@pytest.mark.parametrize("stiffness", [1e-2, 1.0, 1e2, 1e4, 1e6])
@pytest.mark.parametrize("model", ["A", "B"])
def test_stiff_drag_relaxes_the_fluid_to_the_particle_velocity(stiffness, model):
    """beta h/(eps rho) up to 1e6: the velocity relaxes by 1/(1 + z + z^2/2) a step and never overshoots."""
    grid = Grid((8, 8, 8), (0.01,) * 3)
    eps, rho, step = 0.5, 1.2, 1e-3
    fluid = FluidSolver(grid, ALL_PERIODIC, density=rho, viscosity=1.8e-5, voidage=eps, scheme=Scheme(model=model))
    beta = np.full(grid.shape, stiffness * eps * rho / step)
    target = np.array([0.3, -0.2, 0.1])
    left = 1.0
    for _ in range(3):
        fluid.step(step, None, beta, beta[..., None] * target)
        left /= 1 + stiffness + 0.5 * stiffness**2
        assert fluid.velocity == pytest.approx(np.broadcast_to((1 - left) * target, (*grid.shape, 3)), rel=1e-9)


def test_each_axis_has_its_own_drag():
    """The velocity along an axis relaxes as if its drag were that of all axes, to the same bits."""

    def relaxed(beta):
        fluid = FluidSolver(Grid((4, 4, 4), (0.01,) * 3), ALL_PERIODIC, density=1.2, viscosity=1.8e-5, voidage=0.5)
        coefficient = np.broadcast_to(beta, (4, 4, 4, 3))
        for _ in range(3):
            fluid.step(1e-3, None, coefficient, coefficient * [0.3, -0.2, 0.1])
        ledger = budgets.momentum_ledger(fluid)
        assert ledger["change"] == pytest.approx(ledger["drag"], rel=1e-9)
        worked = budgets.works(fluid)
        assert worked.kinetic == pytest.approx(worked.drag + worked.implicit, rel=1e-9)
        return fluid.velocity

    by_axis = relaxed([10.0, 600.0, 1e5])
    for axis, beta in enumerate((10.0, 600.0, 1e5)):
        assert (by_axis[..., axis] == relaxed(beta)[..., axis]).all()


def test_stiff_drag_in_a_packed_block_is_stable():
    """A block of voidage 0.5 at rest, sharp edges, z = 1e6, in a stream: the fluid in it stops."""
    grid = Grid((20, 20, 20), (0.01,) * 3)
    x, y, z = grid.centres()

    def block(half):
        return (abs(x - 0.1) < half) & (abs(y - 0.1) < half) & (abs(z - 0.1) < half)

    voidage, step = np.where(block(0.05), 0.5, 1.0), 1e-3
    beta = np.where(block(0.05), 1e6 * 0.5 * 1000 / step, 0.0)
    fluid = FluidSolver(
        grid, {"z_low": Inlet(0.2), "z_high": Outlet()}, density=1000.0, viscosity=1e-3, voidage=voidage
    )
    for _ in range(40):
        fluid.step(step, None, beta)
    assert np.abs(fluid.velocity[block(0.04)]).max() < 1e-5
    assert 0.2 < np.abs(fluid.velocity).max() < 0.8


@pytest.mark.parametrize("model", ["A", "B"])
def test_drag_impulses_of_cells_add_up_to_the_change_of_momentum(model):
    """Cell impulses add up to the change of momentum; particles moving with the fluid receive nothing."""
    rng = np.random.default_rng(7)
    grid = Grid((8, 6, 10), (0.01, 0.02, 0.01))
    voidage = rng.uniform(0.4, 1.0, grid.shape)
    fluid = FluidSolver(grid, ALL_PERIODIC, density=1000.0, viscosity=0.0, voidage=voidage, scheme=Scheme(model=model))
    beta = rng.uniform(0, 1e5, grid.shape)
    before = momentum(fluid)
    fluid.step(1e-3, None, beta, beta[..., None] * np.array([0.1, 0.0, -0.2]))
    (weight, seen), impulse = fluid.drag_response(), budgets.drag_exchange(fluid)
    given = impulse.sum(axis=(0, 1, 2))
    kept = 1e-3 * pressure_on_particles(fluid, voidage) if model == "A" else 0.0
    assert np.abs(momentum(fluid) - before - given - kept).max() < 1e-12 * np.abs(impulse).sum()
    # share of one particle of many in a cell: weight * b * (v - u_d)
    direct = 1e-3 * grid.cell_volume * weight * beta[..., None] * (np.array([0.1, 0.0, -0.2]) - seen)
    assert np.abs(direct - impulse).max() < 1e-12 * np.abs(impulse).max()

    together = FluidSolver(grid, ALL_PERIODIC, density=1000.0, viscosity=0.0, voidage=0.7, scheme=Scheme(model=model))
    together.set_velocity((0.1, 0.0, -0.2))
    together.step(1e-3, None, beta, beta[..., None] * np.array([0.1, 0.0, -0.2]))
    assert np.abs(budgets.drag_exchange(together)).max() < 1e-12 * beta.max() * 1e-3 * grid.cell_volume


def test_a_restored_fluid_goes_on_to_the_same_bits():
    """Six steps in one go, or three, a checkpoint into a new solver, and three more."""
    grid = Grid((10, 6, 12), (0.01,) * 3)
    sides = {
        "z_low": Inlet(0.3, in_time=lambda t: 1 + t),
        "z_high": Outlet(),
        "x_low": Periodic(),
        "x_high": Periodic(),
    }

    def fresh():
        return FluidSolver(
            grid,
            sides,
            density=1.2,
            viscosity=1.8e-5,
            scheme=Scheme(smagorinsky=0.1),
            voidage=moving_voidage(grid, 0.0),
        )

    def advance(fluid, steps):
        for _ in range(steps):
            t = fluid.time + 1e-3
            fluid.step(1e-3, moving_voidage(grid, t), 100 * moving_voidage(grid, t))

    whole, first, second = fresh(), fresh(), fresh()
    advance(whole, 6)
    advance(first, 3)
    second.restore(first.checkpoint())
    advance(second, 3)
    assert whole.time == second.time
    assert all(np.array_equal(a, b) for a, b in zip(whole.checkpoint().values(), second.checkpoint().values()))
