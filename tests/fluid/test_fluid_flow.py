"""Single-phase flows with a known solution."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from cfddem.fluid.conditions import FreeSlip, Inlet, NoSlip, Outlet, Periodic, ramp
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver, Scheme
from scenarios.references.flows import ALL_PERIODIC, cavity, duct, ghia, order, pipe, rms, sound, taylor_green


def test_taylor_green_vortices_decay_to_second_order():
    """Velocity and pressure in space and time together, unlimited scheme: order >= 1.9 in L2."""
    velocity, pressure = zip(*(taylor_green(n, n // 4, "central") for n in (16, 32, 64)))
    assert min(order(velocity)) > 1.9
    assert min(order(pressure)) > 1.9


def test_the_limited_scheme_has_order_above_1_8_on_smooth_vortices():
    """Clipping at extrema costs some of the order; it stays above 1.8 for the velocity."""
    velocity, _ = zip(*(taylor_green(n, n // 4, "limited") for n in (16, 32, 64)))
    assert min(order(velocity)) > 1.8


def test_order_in_time_is_two_for_velocity_and_pressure():
    """Differences between runs that halve the step on one grid fall by four."""
    results = []
    for steps in (4, 8, 16, 32):
        n = 24
        width = 2 * np.pi / n
        fluid = FluidSolver(
            Grid((n, 1, n), (width, width, width)),
            ALL_PERIODIC,
            density=1.0,
            viscosity=0.05,
            scheme=Scheme(convection="central"),
        )
        fluid.set_velocity((lambda x, y, z: np.sin(x) * np.cos(z) + 1, 0.0, lambda x, y, z: -np.cos(x) * np.sin(z)))
        for _ in range(steps):
            fluid.step(0.5 / steps)
        results.append(fluid.face_velocity(0).copy())
    assert min(order([rms(a - b) for a, b in pairwise(results)])) > 1.9


@pytest.mark.parametrize(("voidage", "model"), [(1.0, "A"), (0.37, "A"), (0.37, "B")])
def test_poiseuille_flow_between_plates(voidage, model):
    """u = G/(2 mu) z (H - z): the parabola is met to second order, exactly so but for the wall half-cell term."""
    errors = []
    for n in (8, 16):
        height, mu, fall = 1.0, 0.5, 2.0
        sides = {"x_low": Periodic(fall), "x_high": Periodic(fall), "y_low": Periodic(), "y_high": Periodic()}
        fluid = FluidSolver(
            Grid((1, 1, n), (height / n,) * 3),
            sides,
            density=1.0,
            viscosity=mu,
            voidage=voidage,
            scheme=Scheme(model=model),
        )
        fluid.run_until(2.5)
        _, _, z = fluid.grid.faces(0)
        # In model B the driving gradient acts on the fluid alone.
        exact = fall / (2 * mu) * z * (height - z) / (voidage if model == "B" else 1.0)
        errors.append(np.abs(fluid.face_velocity(0) - exact).max() / exact.max())
        # Backwards: the gradient that the measured flux needs, 12 mu Q/H^3, is the one applied (2/n^2 off).
        flux = float(fluid.volume_flux(0)[:, 0, 0].mean()) * height
        needed = 12 * mu * flux / height**3 / (1.0 if model == "B" else voidage)
        assert needed == pytest.approx(fall, rel=2.1 / n**2)
    assert errors[1] < 0.004
    assert order(errors)[0] > 1.9


def test_shear_flow_of_a_layered_fluid():
    """The stress is the same at all heights: u = U ln(mu(z)/mu_0)/ln(mu_1/mu_0) where mu grows linearly."""
    errors = []
    for n in (8, 16):
        sides = {side: Periodic() for side in ("x_low", "x_high", "y_low", "y_high")}
        sides |= {"z_low": NoSlip(), "z_high": NoSlip((1.0, 0.0, 0.0))}
        grid = Grid((1, 1, n), (1.0 / n,) * 3)
        thickness = np.broadcast_to(1.0 + 4.0 * grid.centres()[2], grid.shape)
        fluid = FluidSolver(grid, sides, density=1.0, viscosity=thickness)
        fluid.run_until(0.5)
        z = grid.faces(0)[2]
        errors.append(np.abs(fluid.face_velocity(0) - np.log(1.0 + 4.0 * z) / np.log(5.0)).max())
    assert errors[1] < 0.02
    assert errors[0] / errors[1] > 1.8  # of first order: beside a wall the fluid has the viscosity of its cell


def test_poiseuille_flow_in_a_square_duct():
    """Against the series solution: second order in L2."""
    errors = [duct(n) for n in (8, 16)]
    assert errors[1] < 0.006
    assert order(errors)[0] > 1.9


@pytest.mark.parametrize(("finest", "limit"), [(16, 0.07), pytest.param(32, 0.05, marks=pytest.mark.slow)])
def test_pipe_flow_in_a_masked_cylinder_converges(finest: int, limit: float) -> None:
    """Hagen-Poiseuille flux as the staircase of the mask gets finer."""
    errors = [abs(pipe(n) - 1.0) for n in (8, 16, 32) if n <= finest]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < limit


def test_periodic_channel_flux_is_driven_backwards_by_a_negative_gradient():
    """Reversing the driving gradient reverses the flow to the last bit."""
    fluxes = []
    for fall in (2.0, -2.0):
        sides = {"x_low": Periodic(fall), "x_high": Periodic(fall)}
        fluid = FluidSolver(Grid((4, 1, 8), (0.125,) * 3), sides, density=1.0, viscosity=0.1)
        fluid.run_until(0.5, largest=0.01)
        fluxes.append(fluid.volume_flux(0))
    assert np.array_equal(fluxes[0], -fluxes[1])
    assert fluxes[0].min() > 0.0


def test_lid_driven_cavity_at_re_100_on_a_coarse_grid():
    """Ghia, Ghia & Shin (1982): within 2 % of the lid speed on 33 x 33."""
    profiles = cavity(100, 33, 12.0)
    for line, profile in profiles.items():
        assert np.abs(profile - ghia(line, 100)["velocity"]).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("reynolds, until", [(100, 10.0), (400, 35.0), (1000, 50.0)])
def test_lid_driven_cavity_against_ghia(reynolds, until):
    """Ghia, Ghia & Shin (1982): within 1 % of the lid speed on 129 x 129, but for entries that are wrong themselves;
    for Re 1000 every point of both lines within 1 % of the spectral solution."""
    profiles = cavity(reynolds, 129, until)
    for line, profile in profiles.items():
        table, kept = ghia(line, reynolds), sound(line, reynolds)
        assert np.abs(profile - table["velocity"])[kept].max() < 0.01
        if reynolds == 1000:
            assert np.abs(profile - table["spectral"]).max() < 0.01
            assert (np.abs(table["velocity"] - table["spectral"])[~kept] > 0.0135).all()


def test_outflow_equals_the_inflow_of_a_ramped_inlet():
    """Volume through the outlet equals the ramped inflow at every moment."""
    sides = {"x_low": Inlet(2.0, in_time=ramp(0.0, 0.1)), "x_high": Outlet()}
    fluid = FluidSolver(Grid((16, 1, 8), (0.1,) * 3), sides, density=1.0, viscosity=0.01)
    for _ in range(12):
        fluid.step(0.01)
        inflow, outflow = (float(fluid.volume_flux(0)[:, :, n].sum()) for n in (0, -1))
        assert inflow == pytest.approx(8 * 2.0 * min(fluid.time / 0.1, 1.0), rel=1e-12)
        assert outflow == pytest.approx(inflow, rel=1e-7)


@pytest.mark.parametrize("axis", [0, 1])
def test_flow_above_a_varying_inlet_is_translation_invariant_along_a_periodic_direction(axis):
    """A jet moved along a periodic direction, also across the boundary of the box, moves the flow with it."""
    cells, moved = [1, 1, 6], 3
    cells[axis] = 8
    across = {0: ("x_low", "x_high"), 1: ("y_low", "y_high")}[axis]

    def flow(shift):
        def jet(*coordinates_and_time):
            place = (np.floor(coordinates_and_time[axis] / 0.1) - shift) % 8
            return 0.1 + 0.2 * (place == 4) + 0.1 * (place == 5)

        sides = {**dict.fromkeys(across, Periodic()), "z_low": Inlet(jet), "z_high": Outlet()}
        fluid = FluidSolver(
            Grid(tuple(cells), (0.1,) * 3), sides, density=1.0, viscosity=0.01, scheme=Scheme(tolerance=1e-12)
        )
        for _ in range(5):
            fluid.step(0.05)
        return fluid

    first, second = flow(0), flow(moved)
    rolled = np.roll(first.velocity, moved, axis=2 - axis)
    assert np.abs(rolled - second.velocity).max() < 1e-6 * np.abs(rolled).max()
    pressure = np.roll(first.pressure, moved, axis=2 - axis)
    assert np.abs(pressure - second.pressure).max() < 1e-6 * np.abs(pressure).max()


def test_backflow_through_an_outlet_stays_bounded():
    """A vortex pushed through the outlet makes fluid flow back in; energy does not grow."""
    n = 32
    sides = {"x_low": Inlet(1.0), "x_high": Outlet(), "z_low": FreeSlip(), "z_high": FreeSlip()}
    fluid = FluidSolver(Grid((n, 1, n), (1.0 / n,) * 3), sides, density=1.0, viscosity=1e-4)

    def around(x, z):
        return 60 * np.exp(-(((x - 0.6) ** 2 + (z - 0.5) ** 2) / 0.1**2))

    fluid.set_velocity((lambda x, y, z: 1 - (z - 0.5) * around(x, z), 0.0, lambda x, y, z: (x - 0.6) * around(x, z)))
    start = float((fluid.velocity**2).sum())
    seen_backflow = False
    while fluid.time < 1.5:
        fluid.step(min(fluid.largest_step(0.5).step, 0.01))
        seen_backflow |= bool(fluid.face_velocity(0)[:, :, -1].min() < 0.0)
        assert float((fluid.velocity**2).sum()) < 1.05 * start
    assert seen_backflow
    assert np.abs(fluid.face_velocity(0) - 1.0).max() < 0.2


def test_a_shear_layer_is_convected_without_overshoot():
    """The limited scheme keeps a sharp shear layer between its bounds; the unlimited one does not."""
    spans = {}
    for convection in ("limited", "central"):
        n = 32
        fluid = FluidSolver(
            Grid((n, n, 1), (1.0 / n,) * 3),
            {**ALL_PERIODIC},
            density=1.0,
            viscosity=0.0,
            scheme=Scheme(convection=convection),
        )
        fluid.set_velocity((1.0, 0.0, lambda x, y, z: np.where((x > 0.25) & (x < 0.75), 1.0, 0.0) + 0 * y))
        for _ in range(40):
            fluid.step(0.4 / n)
        w = fluid.face_velocity(2)
        spans[convection] = max(w.max() - 1.0, -w.min())
    assert spans["limited"] < 1e-12
    assert spans["central"] > 0.05


def test_smagorinsky_viscosity_of_a_uniform_shear():
    """mu_t = rho (C Delta)^2 |du/dz| in plane shear, so that the wall stress grows by it."""
    n, c, shear = 8, 0.2, 3.0
    h = 1.0 / n
    sides = {"z_low": NoSlip(), "z_high": NoSlip((shear, 0.0, 0.0))}
    for side in ("x_low", "x_high", "y_low", "y_high"):
        sides[side] = Periodic()
    fluid = FluidSolver(Grid((4, 4, n), (h, h, h)), sides, density=2.0, viscosity=0.01, scheme=Scheme(smagorinsky=c))
    fluid.set_velocity((lambda x, y, z: shear * z + 0 * x + 0 * y, 0.0, 0.0))
    limit = fluid.largest_step()
    expected = 0.01 + 2.0 * (c * h) ** 2 * shear
    assert limit.criterion == "Courant"
    viscous = 0.8 / (2 * expected / 2.0 * 3 / h**2)
    assert 0.8 / fluid.rates().viscous == pytest.approx(viscous, rel=1e-10)


@pytest.mark.parametrize(
    "speed, viscosity, criterion", [(1.0, 1e-4, "Courant"), (1.0, 1.0, "viscous"), (0.0, 0.0, "none")]
)
def test_the_limiting_criterion_of_the_step_is_named(speed, viscosity, criterion):
    """Courant or viscous, whichever is shorter."""
    fluid = FluidSolver(Grid((8, 8, 8), (0.1,) * 3), ALL_PERIODIC, density=1.0, viscosity=viscosity)
    fluid.set_velocity((speed, 0.0, 0.0))
    assert fluid.largest_step().criterion == criterion


def test_a_run_counts_the_criteria_of_its_steps():
    """At rest: viscous steps, a given largest step, and two equal last ones."""
    fluid = FluidSolver(Grid((8, 8, 8), (0.1,) * 3), ALL_PERIODIC, density=1.0, viscosity=0.1)
    viscous = fluid.largest_step().step
    assert set(fluid.run_until(5.5 * viscous)) == {"viscous", "end"}
    assert fluid.time == pytest.approx(5.5 * viscous)
    assert fluid.run_until(10 * viscous, largest=0.5 * viscous)["given"] >= 7


@pytest.mark.parametrize("courant", [0.5, 1.0])
def test_kinetic_energy_does_not_grow_at_the_largest_step(courant):
    """Random velocities, steps at the limit: kinetic energy falls in every step."""
    rng = np.random.default_rng(3)
    fluid = FluidSolver(Grid((16, 16, 16), (0.1,) * 3), ALL_PERIODIC, density=1.0, viscosity=1e-3)
    fluid.set_velocity([rng.standard_normal(fluid.face_velocity(d).shape) for d in range(3)])
    energy = [float((fluid.fields.velocity[:, 2:-3, 2:-3, 2:-3] ** 2).sum())]
    for _ in range(30):
        fluid.step(fluid.largest_step(courant).step)
        energy.append(float((fluid.fields.velocity[:, 2:-3, 2:-3, 2:-3] ** 2).sum()))
    assert all(b < a for a, b in pairwise(energy))


@pytest.mark.parametrize("viscosity", [0.5, 50.0])
def test_kinetic_energy_decays_at_the_viscous_limit_in_a_rough_voidage(viscosity):
    """Random velocities and voidage in 0.35 ... 1, steps at the viscous limit: energy decays."""
    rng = np.random.default_rng(4)
    voidage = rng.uniform(0.35, 1.0, (16, 16, 16))
    fluid = FluidSolver(
        Grid((16, 16, 16), (0.1,) * 3), {"z_low": NoSlip(), "z_high": NoSlip()},
        density=1.0, viscosity=viscosity, voidage=voidage,
    )  # fmt: skip
    fluid.set_velocity([1e-3 * rng.standard_normal(fluid.face_velocity(d).shape) for d in range(3)])
    start = float((fluid.velocity**2).sum())
    for _ in range(40):
        fluid.step(fluid.largest_step().step)
    assert float((fluid.velocity**2).sum()) < 0.5 * start
