"""Particles and fluid: what one loses the other gets, whatever the stiffness; and what is deposited is all there is."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.coupling.forces.lift import lift_force, turn_with_fluid
from cfddem.coupling.kernel import MAPPINGS, FilterKernel
from cfddem.fluid import budgets
from cfddem.fluid.grid import Grid, outside_cylinder
from cfddem.particles.state import kinetic_energy, make_particles
from cfddem.run.simulation import Simulation
from closures.drag import wen_yu
from closures.lift import magnus
from scenarios.validation.coupling import STIRRED

SPACING = (0.010, 0.012, 0.009)


def cloud(size: tuple[float, float, float], count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Places and radii of spheres of very different size anywhere in a box."""
    random = np.random.default_rng(3)
    return random.uniform(0.0, 1.0, (count, 3)) * np.array(size), 2e-3 * random.uniform(0.5, 1.5, count)


@pytest.mark.parametrize("mapping", MAPPINGS)
@pytest.mark.parametrize("masked", [False, True])
def test_deposited_volume_is_the_volume_of_the_particles(mapping: str, masked: bool) -> None:
    """Beside walls, masks and periodic borders alike; and nothing lies in a solid cell."""
    grid = Grid((8, 7, 13), SPACING)
    grid = grid.with_solid(outside_cylinder((0.04, 0.042, 0.0), 0.035)) if masked else grid
    kernel = FilterKernel(grid, (False, False, True), mapping=mapping, smoothing=0.012)
    places, radius = cloud(grid.size)
    solid = kernel.solid_fraction(kernel.map_particles(places, radius))
    volume = float((4.0 / 3.0 * math.pi * radius**3).sum())
    assert solid.sum() * grid.cell_volume == pytest.approx(volume, rel=1e-12)
    assert (solid[~grid.open] == 0.0).all()
    assert solid.min() >= 0.0


@pytest.mark.parametrize("mapping", MAPPINGS)
@pytest.mark.parametrize("periodic", [(True, True, True), (False, False, False), (True, False, True)])
def test_voidage_changes_by_the_flux_of_the_particles(mapping: str, periodic: tuple[bool, bool, bool]) -> None:
    """d(eps)/dt = -div(flux) of the fluid's complement, to round-off, smoothing included."""
    grid = Grid((6, 7, 13), SPACING)
    kernel = FilterKernel(grid, periodic, mapping=mapping, smoothing=0.012)
    places, radius = cloud(grid.size)
    way = np.random.default_rng(5).uniform(-0.008, 0.008, places.shape)
    moved = places + way
    for axis, repeats in enumerate(periodic):
        length = grid.size[axis]
        moved[:, axis] = moved[:, axis] % length if repeats else moved[:, axis].clip(0.0, length)
    before, after = kernel.map_particles(places, radius), kernel.map_particles(moved, radius)
    flux = kernel.solid_flux(before, after, 1e-3)
    outflow = sum(np.diff(flux[axis], axis=2 - axis) * grid.face_area(axis) for axis in range(3))
    gained = (kernel.solid_fraction(after) - kernel.solid_fraction(before)) * grid.cell_volume / 1e-3
    assert np.abs(gained + outflow).max() < 1e-12 * np.abs(outflow).max()


def test_gathering_is_the_adjoint_of_spreading() -> None:
    """The sum over particles of what they carry times what they see is that over cells."""
    grid = Grid((8, 7, 13), SPACING).with_solid(outside_cylinder((0.04, 0.042, 0.0), 0.035))
    kernel = FilterKernel(grid, (False, False, True), smoothing=0.02)
    place = kernel.map_particles(*cloud(grid.size))
    random = np.random.default_rng(1)
    carried, field = random.normal(size=(200, 2)), random.normal(size=(2, *grid.shape))
    there = (kernel.smooth(kernel.deposit(place, carried)) * field).sum()
    back = (carried * kernel.gather(place.stencil, kernel.smooth(field))).sum()
    assert there == pytest.approx(back, rel=1e-12)


@pytest.mark.parametrize("mapping", MAPPINGS)
def test_three_steps_are_gathered_together_as_one_by_one(mapping: str) -> None:
    """Particles that stay among the same cells, and particles that do not."""
    grid = Grid((8, 7, 13), SPACING)
    kernel = FilterKernel(grid, (True, False, True), mapping=mapping)
    places, radius = cloud(grid.size)
    random = np.random.default_rng(3)
    moved = [kernel.wrapped(places + random.normal(size=places.shape) * way) for way in (0.01, 1e-4, 0.0)]
    stencils, field = [kernel.stencil(each, radius) for each in moved], random.normal(size=(3, *grid.shape))
    same = (stencils[0].first == stencils[2].first).all(axis=1) & (stencils[1].first == stencils[2].first).all(axis=1)
    assert 0 < same.sum() < len(same)
    one_by_one = sum(share * kernel.gather(each, field) for share, each in zip((0.25, 0.5, 0.25), stencils))
    assert kernel.gather_over_steps(*stencils, field) == pytest.approx(one_by_one, rel=1e-12, abs=1e-14)


def test_width_of_the_kernel_does_not_depend_on_the_cell() -> None:
    """Second moment of the deposited volume of one sphere, averaged over its place in the cell."""
    widths = []
    for cell in (0.5e-3, 1e-3):
        count = round(20e-3 / cell)
        grid = Grid((count, 1, count), (cell, 1e-3, cell))
        kernel = FilterKernel(grid, (True, True, True), smoothing=1.5e-3)
        x, _, z = grid.centres()
        square = []
        for a, b in itertools.product(np.linspace(0.05, 0.95, 7), repeat=2):
            centre = np.array([[10e-3 + a * cell, 0.5e-3, 10e-3 + b * cell]])
            solid = kernel.solid_fraction(kernel.map_particles(centre, np.array([0.3e-3])))
            offset = (x - centre[0, 0]) ** 2 + (z - centre[0, 2]) ** 2
            square.append(float((solid * offset).sum() / solid.sum() / 2.0))
        widths.append(math.sqrt(np.mean(square)))
    assert widths == pytest.approx([1.5e-3, 1.5e-3], rel=0.01)


def suspension(**changes: object) -> Case:
    """Two hundred spheres in a periodic box of water, without weight."""
    values: dict[str, object] = {
        "fluid.density": 1000.0,
        "fluid.viscosity": 1e-3,
        "material.sand": {"density": 2500.0, "youngs_modulus": 1e6, "poisson": 0.25, "friction": 0.3},
        "column": {"width": 0.01, "height": 0.02, "cell": 0.0025, "sides": "periodic", "ends": "periodic"},
        "bed": {"diameter": 1e-3, "count": 1200, "start": "suspended"},
        "laws": {"gravity": (0.0, 0.0, 0.0), "lubrication": "none"},
        "run": {"until": 1.0, "reference_speed": 0.1},
    }
    return Case.from_text("", overrides=values | changes)


def stirred(case: Case) -> Simulation:
    """The case with particles that fly in all directions, and on."""
    simulation = Simulation(case)
    velocity = simulation.particles.velocity
    velocity[:] = np.random.default_rng(7).normal(0.0, 0.02, velocity.shape) + 0.01
    simulation.particle_solver.refresh()
    return simulation


def momentum(simulation: Simulation) -> np.ndarray:
    particles = simulation.particles
    total: np.ndarray = (particles.mass[:, None] * particles.velocity).sum(axis=0) + budgets.momentum(simulation.fluid)
    if simulation.steps and "added_mass" in simulation.forces:
        total += simulation.forces["added_mass"].deferred_momentum(particles).sum(axis=0)
    if "drag_momentum" in particles.fields:
        total -= particles.drag_momentum.sum(axis=0)
    return total


@pytest.mark.parametrize(
    ("model", "viscosity", "added_mass", "surface"),
    [
        ("A", 1e-3, 0.0, "smeared"), ("B", 1.0, 0.0, "smeared"), ("A", 1.0, 0.5, "smeared"),
        ("A", 1e-3, "zuber", "smeared"), ("A", 1.0, 0.5, "sharp"),
    ],
)  # fmt: skip
def test_momentum_of_fluid_and_particles_is_kept(
    model: str, viscosity: float, added_mass: float | str, surface: str
) -> None:
    """In a periodic box, for weak drag and drag that stops a sphere in a step; with lift, stress, added mass or not."""
    forces = added_mass != 0.0
    more = {"laws.added_mass": added_mass, "laws.lift": forces, "laws.viscous_stress": forces, "laws.surface": surface}
    case = suspension(**{"laws.model": model, "fluid.viscosity": viscosity} | more)
    simulation = stirred(case)
    particles = simulation.particles
    scale = float((particles.mass * np.linalg.norm(particles.velocity, axis=1)).sum())
    before = momentum(simulation)
    for _ in range(30):
        simulation.step()
    assert np.abs(momentum(simulation) - before).max() < 1e-12 * scale
    assert np.abs(simulation.particles.velocity).max() < 0.12


def test_rest_stays_rest() -> None:
    """Particles of the fluid's own density, at rest in a closed box under gravity: nothing moves."""
    case = suspension(
        **{
            "column": {"width": 0.01, "height": 0.02, "cell": 0.0025, "ends": "closed"},
            "material.sand.density": 1000.0,
            "laws": {"lubrication": "none"},
        }
    )
    simulation = Simulation(case)
    for _ in range(5):
        simulation.step()
    assert np.abs(simulation.fluid.velocity).max() < 1e-10 * math.sqrt(9.81 * 0.02)
    assert np.abs(simulation.particles.velocity).max() < 1e-10 * math.sqrt(9.81 * 0.02)


@pytest.mark.parametrize("surface", ["smeared", "sharp"])
def test_stiff_drag_is_stable_and_right(surface: str) -> None:
    """50 um spheres in syrup, beta dt/(eps rho) of 1e4: at once at the balance of weight and drag."""
    case = suspension(
        **{
            "fluid.viscosity": 1.0,
            "column": {"width": 0.5e-3, "height": 1e-3, "cell": 0.125e-3, "sides": "periodic", "ends": "periodic"},
            "bed": {"diameter": 50e-6, "count": 1200, "start": "suspended"},
            "laws": {"lubrication": "none", "drag": "wen_yu", "self_disturbance_correction": False, "surface": surface},
            "run": {"until": 1.0, "particle_step": 2e-5, "fluid_step": 1e-3, "reference_speed": 1e-6},
        }
    )
    simulation = Simulation(case)
    fluid = simulation.fluid
    assert fluid is not None
    # a mean fall of pressure carries the weight of the particles in the fluid
    solids = 1.0 - float(fluid.voidage.mean())
    support = solids * (2500.0 - 1000.0) * 9.81
    fluid.boundaries.driving[2] = support
    for _ in range(20):
        simulation.step()
    velocity = simulation.particles.velocity[:, 2].mean()
    fluid_mean = float((fluid.voidage * fluid.velocity[..., 2]).sum() / fluid.voidage.sum())
    voidage = 1.0 - solids
    exchange_coefficient = 18.0 * voidage * solids * wen_yu(0.0, voidage) / (50e-6) ** 2
    assert exchange_coefficient * 1e-3 / (voidage * 1000.0) > 5e3
    assert fluid_mean - velocity == pytest.approx(voidage * support / exchange_coefficient, rel=0.03)


def test_a_resumed_simulation_gives_the_same_bits() -> None:
    """With contacts, films, fluid and an added mass that varies."""
    case = suspension(**{"laws.lubrication": "nijssen", "laws.added_mass": "zuber"})
    simulation = stirred(case)
    for _ in range(6):
        simulation.step()
    kept = simulation.checkpoint()
    for _ in range(6):
        simulation.step()
    again = Simulation.restored(case, kept)
    for _ in range(6):
        again.step()
    assert (simulation.particles.id == again.particles.id).all()
    for name in ("position", "velocity", "spin"):
        assert (getattr(simulation.particles, name) == getattr(again.particles, name)).all(), name
    assert (simulation.fluid.pressure == again.fluid.pressure).all()
    assert (simulation.fluid.velocity == again.fluid.velocity).all()


def test_a_particle_that_crosses_a_cell_in_a_step_is_refused() -> None:
    grid = Grid((6, 7, 13), SPACING)
    kernel = FilterKernel(grid, (True, True, True))
    here = kernel.map_particles(np.array([[0.01, 0.01, 0.01]]), np.array([1e-3]))
    there = kernel.map_particles(np.array([[0.025, 0.01, 0.01]]), np.array([1e-3]))
    with pytest.raises(InputError, match=r"fastest particle = 1\.5.*: must be below one cell; take a smaller"):
        kernel.solid_flux(here, there, 1e-3)


@pytest.mark.parametrize("late", [0.0, 1e-9, -1e-9])
def test_rounding_of_the_time_does_not_change_the_step(late: float) -> None:
    """Five steps of 1 ms to the next row stay five, of fifty steps of the particles each, however time was rounded."""
    run = Simulation(STIRRED.with_(**{"run.particle_step": 2e-5, "run.fluid_step": 1e-3, "run.reference_speed": 1e-3}))
    run.particle_solver.time = 2.0 + late
    lengths = []
    while run.time < 2.005 * (1.0 - 1e-12):
        step, substeps = run.time_steps.choose(2.005, 0)
        lengths.append((step, substeps))
        run.particle_solver.time += step
    assert [substeps for _, substeps in lengths] == [50] * 5
    assert [step for step, _ in lengths] == pytest.approx([1e-3] * 5, rel=2e-6)


def test_the_voidage_is_that_of_the_particles_at_the_end_of_the_step_to_second_order() -> None:
    """Spheres that begin to sink: half the fluid step, a quarter of the error."""
    errors = []
    for step in (4e-4, 2e-4):
        run = Simulation(
            suspension(**{"laws.gravity": (0.0, 0.0, -9.81), "laws.lubrication": "none", "run.fluid_step": step})
        )
        kernel, fluid = run.coupling.kernel, run.fluid
        while run.time < 3.9e-3:
            begun = fluid.voidage.copy()
            run.step()
        spheres = run.particle_solver.particles
        there = kernel.solid_fraction(kernel.map_particles(spheres.position, spheres.radius))
        moved = np.abs(1.0 - begun - there).max()
        errors.append(np.abs(1.0 - fluid.voidage - there).max())
        assert errors[-1] < 0.1 * moved
    assert errors[1] < 0.3 * errors[0]


def test_a_change_of_the_step_is_no_shock_of_pressure() -> None:
    """Particles that sink displace the liquid at their own rate, however the length of the fluid's step changes."""
    case = suspension(
        **{
            "laws.gravity": (0.0, 0.0, -9.81),
            "laws.lubrication": "none",
            "column.ends": "closed",
            "column.height": 0.04,
        }
    )

    def drops(steps: list[float]) -> list[float]:
        """Pressure below less that above after each step [Pa]."""
        run, found = Simulation(case), []
        for step in steps:
            before = run.time
            run.step(before + step)
            assert run.time - before == pytest.approx(step, rel=1e-6)
            found.append(float((run.fluid.pressure[0] - run.fluid.pressure[-1]).mean()))
        return found

    usual = 3e-4
    changes = [0.8, 1.0, 1.2, 1.0, 0.45, 1.0]
    even = drops([usual] * 56)
    assert drops([usual] * 50 + [usual * change for change in changes]) == pytest.approx(even, rel=0.2)


def test_fluid_takes_spin_of_a_lone_sphere() -> None:
    """Spin relative to half the vorticity falls as exp(-t/tau), tau = rho_p d^2/(60 eta), whatever the step."""
    density, diameter, viscosity = 2500.0, 1e-4, 1e-3
    spheres = make_particles(np.zeros((1, 3)), 0.5 * diameter, density, viscosity=viscosity)
    spheres.spin[:] = [30.0, 0.0, -10.0]
    curl, slow = np.array([[0.0, 8.0, 0.0]]), density * diameter**2 / (60.0 * viscosity)
    before = kinetic_energy(spheres)
    gained = sum(turn_with_fluid(spheres, curl, 1000.0, step)[0] for step in (0.1 * slow, 0.4 * slow, slow))
    kept = math.exp(-1.5)
    assert spheres.spin[0] == pytest.approx([30.0 * kept, 4.0 - 4.0 * kept, -10.0 * kept], rel=1e-12)
    assert gained == pytest.approx(kinetic_energy(spheres) - before, rel=1e-9)


def test_lift_points_to_where_it_must() -> None:
    """A sphere that lags behind a shear flow goes to its fast side; one that spins backwards against it is lifted."""
    slip, still = np.array([[0.1, 0.0, 0.0]]), np.zeros((1, 3))
    thick = np.array([1e-1])
    # u_x grows with y: the curl points to -z
    shear = lift_force(slip, np.array([[0.0, 0.0, -10.0]]), np.array([[0.0, 0.0, -5.0]]), np.array([1e-3]), 1e3, thick)
    assert shear[0, 1] > 0.0 and abs(shear[0, 0]) + abs(shear[0, 2]) < 1e-12 * shear[0, 1]
    spun = lift_force(slip, still, np.array([[0.0, 0.0, 30.0]]), np.array([1e-3]), 1e3, thick)
    expected = math.pi / 8.0 * 1e3 * (2e-3) ** 3 * 30.0 * 0.1 * magnus(1e3 * 2e-3 * 0.1 / 1e-1)
    assert spun[0] == pytest.approx([0.0, -expected, 0.0])


def test_drag_and_film_take_the_viscosity_of_the_fluid_where_they_are() -> None:
    """In two layers of liquid, a pair at rest in each: what falls and what keeps from touching differ as they do."""
    height, diameter, pitch = 0.08, 1e-3, 1.05e-3
    case = suspension(
        **{
            "fluid.viscosity": 0.1,
            "fluid.viscosity_profile": ((0.0, 0.4), (0.039, 0.4), (0.041, 0.1), (0.08, 0.1)),
            "column.height": height,
            "column.ends": "closed",
            "column.sides": "free_slip",
            "bed": {
                "diameter": diameter,
                "positions": [(5e-3 + side * pitch, 5e-3, z) for z in (0.02, 0.06) for side in (-0.5, 0.5)],
            },
            "laws": {"gravity": (0.0, 0.0, -9.81), "lubrication": "nijssen", "drag": "stokes"},
        }
    )
    simulation = Simulation(case)
    simulation.until(0.05)
    particles, edges = simulation.particles, simulation.particle_solver.edges
    order = np.argsort(particles.id)
    assert particles.viscosity[order] == pytest.approx([0.4, 0.4, 0.1, 0.1], rel=1e-12)
    falling = particles.velocity[order, 2]
    assert falling[0] / falling[2] == pytest.approx(0.25, rel=0.01)
    resistance = {int(particles.id[edges.first[k]]) // 2: edges.resistance[k] for k in range(edges.between_particles)}
    assert resistance[0] / resistance[1] == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize("density", [1.2, 1000.0])
def test_crowded_particles_that_move_to_and_fro_are_not_mapped_ahead_too_far(density: float) -> None:
    """v' = v - L (v + 2 w k v) - 4 r w k v, of drag and of the pressure that moves the fluid between them, decays."""
    simulation = stirred(suspension(**{"fluid.density": density}))
    particles, coupling, step = simulation.particles, simulation.coupling, 1e-3
    ratio = (density * particles.volume * particles.inverse_mass)[:, None]
    for response, crowding in itertools.product((1.0, 100.0, 1e4), (0.01, 0.5, 1.5, 2.0)):
        particles.response_rate[:], particles.crowding[:] = response, crowding
        ahead, rate = coupling._foresight(particles, step), step * response
        drag = np.minimum(rate * (1.0 + crowding) / (1.0 + rate), 2.0)
        after = 1.0 - drag * (1.0 + 2.0 * ahead * crowding) - 4.0 * ratio * ahead * crowding
        assert (after >= -1.0 - 1e-12).all() and (ahead >= 0.0).all() and (ahead <= 1.0).all()
    particles.response_rate[:], particles.crowding[:] = 1.0, 0.01
    assert coupling._foresight(particles, step) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("surface", ["smeared", "sharp"])
def test_a_sediment_under_its_suspension_stays_at_rest(surface: str) -> None:
    """The sedimentation of the gallery for half of its time, in which a sediment of 0.6 forms on the floor."""
    simulation = Simulation(gallery()["sedimentation"].with_(**{"laws.surface": surface}))
    for time in 0.02 * np.arange(1, 11):
        simulation.until(time)
        assert np.abs(simulation.particles.velocity).max() < 0.06  # a sphere alone falls with 0.073 m/s


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(("mapping", "radius"), [("linear", 0.4), ("divided", 0.4), ("divided", 1.1), ("divided", 2.1)])
def test_slabs_that_are_filled_at_the_same_time_share_no_cells(mapping: str, radius: float, periodic: bool) -> None:
    """Even slabs are filled by several threads, then odd ones; also where pieces of spheres lie in other slabs."""
    kernel = FilterKernel(Grid((5, 5, 60), (1.0,) * 3), (False, False, periodic), mapping=mapping)
    position = np.random.default_rng(1).uniform((0.0, 0.0, 0.0), (5.0, 5.0, 60.0), (3000, 3))
    cell_map = kernel.map_particles(position, np.full(3000, radius))
    layer = 7 * 7  # cells of a layer, with those around
    filled = []
    for begin, end in itertools.pairwise(cell_map.start):
        lowest = cell_map.stencil.first[cell_map.order[begin:end]] // layer
        filled.append(set(lowest.ravel().tolist()) | set((lowest + 1).ravel().tolist()))
    assert len(filled) > 3
    for one, other in itertools.combinations(range(len(filled)), 2):
        assert (one + other) % 2 or not filled[one] & filled[other], (one, other)
