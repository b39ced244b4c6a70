"""Added mass: the acceleration of a sphere, laws of the voidage, inserted particles, and the energy ledger."""

from __future__ import annotations

import numpy as np
import pytest
from test_coupling import momentum, stirred, suspension

from cfddem.coupling.forces.added_mass import AddedMass
from cfddem.coupling.forces.agitation import PseudoTurbulence
from cfddem.features.energy import EnergyLedger
from cfddem.particles.state import make_particles
from cfddem.run.simulation import Simulation
from closures.added_mass import zuber
from closures.registry import law_of


@pytest.mark.parametrize(("added_mass", "coefficient"), [(0.0, 0.0), (0.5, 0.5), ("constant", 0.5), ("zuber", 0.5)])
def test_a_sphere_without_drag_falls_with_its_added_mass(added_mass: float | str, coefficient: float) -> None:
    """Acceleration (rho_s - rho_f) g / (rho_s + C rho_f) of a single sphere in water at rest, within 0.1 %."""
    width = 0.02
    case = suspension(
        **{
            "fluid.viscosity": 1e-6,
            "laws": {"drag": None, "added_mass": added_mass, "lubrication": "none"},
            "column": {"width": width, "height": width, "cell": 1.25e-3, "ends": "closed"},
            "bed": {"diameter": 1e-3, "positions": [(0.51 * width, 0.5 * width, 0.5 * width)]},
            "run": {"until": 1.0, "fluid_step": 2e-4, "reference_speed": 0.01},
        }
    )
    simulation = Simulation(case)
    for _ in range(40):
        simulation.step()
    acceleration = simulation.particles.velocity[0, 2] / simulation.time
    assert acceleration == pytest.approx(-9.81 * 1500.0 / (2500.0 + coefficient * 1000.0), rel=1e-3)


def on_a_lattice(added_mass: float | str) -> Simulation:
    """Spheres in motion on a lattice with the pitch of the cells: the solid fraction is 0.382 in every cell."""
    pitch = 1e-3
    places = [tuple(pitch * (0.5 + n) for n in place) for place in np.ndindex(8, 8, 12)]
    column = {"width": 8e-3, "height": 12e-3, "cell": pitch, "sides": "periodic", "ends": "periodic"}
    laws = {"added_mass": added_mass, "gravity": (0.0, 0.0, 0.0), "self_disturbance_correction": False}
    bed = {"diameter": 0.9e-3, "positions": places}
    run = {"until": 1.0, "reference_speed": 0.1, "fluid_step": 2e-4}
    case = suspension(column=column, bed=bed, laws=laws | {"lubrication": "none"}, run=run)
    simulation = Simulation(case)
    simulation.particles.velocity[:] = (0.01, 0.02, 0.03)
    return simulation


def test_at_a_uniform_solid_fraction_a_law_equals_its_constant() -> None:
    """The spheres stop and set the fluid in motion; with another constant they stop at another rate."""
    solids = 0.9**3 * np.pi / 6.0
    by_law, constant, other = (on_a_lattice(each) for each in ("zuber", zuber(1.0 - solids), 0.5))
    for simulation in (by_law, constant, other):
        for _ in range(20):
            simulation.step()
    assert zuber(1.0 - solids) == pytest.approx(1.426, abs=1e-3)
    assert by_law.particles.velocity == pytest.approx(constant.particles.velocity, rel=1e-9)
    assert by_law.particles.velocity[0, 2] - other.particles.velocity[0, 2] > 1e-5


def test_spheres_and_fluid_approach_each_other_without_oscillation() -> None:
    """Without smoothing, an oscillation would grow by a factor of 1.157 in every step. Momentum is kept."""
    simulation, changes = on_a_lattice("zuber"), []
    begun = momentum(simulation)
    for _ in range(60):
        before = simulation.particles.velocity[:, 2].mean()
        simulation.step()
        changes.append(simulation.particles.velocity[:, 2].mean() - before)
    assert max(changes[20:]) < 0.0
    assert np.abs(np.diff(changes[20:])).max() < 0.2 * abs(changes[20])
    assert momentum(simulation) == pytest.approx(begun, rel=1e-11)


def matrix(solids: float, density_ratio: float, coefficient: float, weight: float, uniform: bool) -> np.ndarray:
    """One step of small motions of spheres and fluid, in which each feels the other's acceleration one step late.

    Both move as a whole along a wave, or against each other through it (not `uniform`): the fluid then fills the place
    that spheres have left in the steps before. State: three accelerations of the spheres, that of the fluid, and the
    running means of both.
    """
    ratio, state = solids / (1.0 - solids), np.eye(6)
    spheres, fluid, seen, lost = state[:3], state[3], state[4], state[5]
    mean = weight * fluid + (1.0 - weight) * seen
    deferred = weight * spheres[0] + (1.0 - weight) * lost
    given = ratio * coefficient * (deferred - mean)
    if uniform:
        pressure, new = 0.0 * given, given
    else:
        new = -0.5 * ratio * (spheres[0] + spheres[1])
        pressure = new - given
    acceleration = (coefficient * mean + pressure) / (density_ratio + coefficient)
    return np.array([acceleration, spheres[0], spheres[1], new, mean, deferred])


@pytest.mark.parametrize("density_ratio", [1e-3, 1.0, 2.5, 8.0])
@pytest.mark.parametrize("solids", [0.1, 0.3, 0.5, 0.6, 0.7])
def test_the_weight_of_the_newest_acceleration_damps_all_oscillations(density_ratio: float, solids: float) -> None:
    """With Zuber's coefficient; with a weight of 1 they grow in a dense bed."""
    particles = make_particles(np.zeros((1, 3)), 1e-3, 1000.0 * density_ratio)
    added_mass = AddedMass(law_of(zuber), 1000.0)
    added_mass.update(particles, np.array([1.0 - solids]))
    weight = float(added_mass.newest_weight(particles, np.array([1.0 - solids]))[0])
    rates = [
        float(np.abs(np.linalg.eigvals(matrix(solids, density_ratio, zuber(1.0 - solids), each, uniform))).max())
        for each in (weight, 1.0)
        for uniform in (True, False)
    ]
    assert max(rates[:2]) < 1.0
    assert max(rates[2:]) > 1.0 or solids < 0.5
    assert weight == 1.0 or solids > 0.15


def test_the_inertia_follows_the_local_solid_fraction() -> None:
    """The coefficient of each particle is the law at the voidage around it."""
    simulation = Simulation(suspension(**{"laws.added_mass": "zuber"}))
    simulation.step()
    particles, coupling = simulation.particles, simulation.coupling
    assert coupling is not None
    terms = coupling.prepare(particles, simulation.last_step)
    expected = [zuber(voidage) for voidage in terms.flow.voidage]
    coefficient = simulation.forces["added_mass"].mass(particles) / (1000.0 * particles.volume)
    assert coefficient == pytest.approx(np.array(expected), rel=1e-12)
    assert coefficient.max() - coefficient.min() > 0.05


def test_a_change_of_the_coefficient_changes_the_inertia_only() -> None:
    """Fixed particles stay fixed; the change is returned."""
    particles = make_particles(np.arange(9.0).reshape(3, 3), 1e-3, 2500.0, fixed=np.array([False, True, False]))
    added_mass = AddedMass(law_of(zuber), 1000.0)
    for voidage in (np.array([1.0, 0.5, 0.5]), np.array([0.4, 0.4, 1.0])):
        before = added_mass.mass(particles)
        change = added_mass.update(particles, voidage)
        assert added_mass.mass(particles) - before == pytest.approx(change, rel=1e-9)
    assert particles.inverse_mass[1] == 0.0
    assert added_mass.mass(particles)[[0, 2]] == pytest.approx(
        1000.0 * particles.volume[[0, 2]] * [zuber(0.4), 0.5], rel=1e-12
    )


@pytest.mark.parametrize("added_mass", [0.5, "zuber"])
def test_an_inserted_particle_that_moves_with_the_fluid_is_not_pushed(added_mass: float | str) -> None:
    """It has an added mass, but the fluid that was at rest before at its place exerts no force on it."""
    pushes = []
    for chosen in (0.0, added_mass):
        open_ends = {"column.ends": "flow", "bed.inlet_velocity": 0.2, "bed.count": 20, "run.fluid_step": 1e-4}
        simulation = Simulation(suspension(**{"laws.added_mass": chosen} | open_ends))
        fluid, solver = simulation.fluid, simulation.particle_solver
        assert fluid is not None
        fluid.set_velocity((0.0, 0.0, 0.2))
        solver.particles.velocity[:, 2] = 0.2
        for _ in range(5):
            simulation.step()
        velocity = np.array([[0.0, 0.0, 0.2]])
        new = solver.insert(make_particles(np.full((1, 3), 1e-3), 2e-4, 2500.0, velocity=velocity))
        simulation.step()
        pushes.append(float(solver.particles.velocity[solver.particles.id == new[0], 2][0]) - 0.2)
    assert pushes[1] == pytest.approx(pushes[0] / 1.2, rel=0.01)


def test_a_change_of_the_added_mass_is_in_the_energy_ledger() -> None:
    """The coefficient of all particles triples: the remainder changes by less than 2 % of what this adds."""
    simulation = stirred(suspension(**{"laws.added_mass": 0.5, "run.energy_budget": True}))
    simulation.step()
    particles, coupling = simulation.particles, simulation.coupling
    assert coupling is not None
    before = simulation.feature(EnergyLedger).row()["energy_remainder"]
    added = float((0.5 * 1000.0 * particles.volume[:, None] * particles.velocity**2).sum())
    simulation.forces["added_mass"]._fill = lambda voidage, values: values.fill(1.5)
    particles.sampled_velocity[:] = np.nan
    simulation.step()
    assert abs(simulation.feature(EnergyLedger).row()["energy_remainder"] - before) < 0.02 * added


@pytest.mark.parametrize("added_mass", [0.5, "zuber"])
def test_removed_particles_take_the_energy_of_their_added_mass(added_mass: float | str) -> None:
    """Removal changes no remainder, to round-off."""
    simulation = stirred(suspension(**{"laws.added_mass": added_mass, "run.energy_budget": True}))
    for _ in range(3):
        simulation.step()
    solver, before = simulation.particle_solver, simulation.feature(EnergyLedger).row()
    gone = simulation.particles.id % 3 == 0
    taken = solver.remove(gone)
    after = simulation.feature(EnergyLedger).row()
    lost = 0.5 * float((simulation.forces["added_mass"].mass(taken)[:, None] * taken.velocity**2).sum())
    assert lost > 0.1 * -after["energy_fed"]
    assert before["energy_added_mass"] - after["energy_added_mass"] == pytest.approx(lost, rel=1e-9)
    assert after["energy_remainder"] == pytest.approx(before["energy_remainder"], abs=1e-9 * lost)


def test_agitation_and_added_mass_have_one_coefficient() -> None:
    """The added mass of the run, a law or a number; agitation without added mass takes Zuber's."""
    voidage = np.array([0.5, 0.7, 1.0])
    for added_mass, expected in (("zuber", [2.0, 8.0 / 7.0, 0.5]), (0.7, [0.7] * 3), (0.0, [2.0, 8.0 / 7.0, 0.5])):
        case = suspension(
            **{
                "laws.added_mass": added_mass,
                "laws.agitation": "pseudo_turbulence",
                "laws.agitation_inertia": 0.4,
                "bed.count": 20,
            }
        )
        forces = Simulation(case).forces
        assert isinstance(forces["agitation"], PseudoTurbulence)
        assert forces["agitation"].added_mass.coefficient(voidage) == pytest.approx(expected, rel=1e-12)
        assert "added_mass" not in forces or forces["agitation"].added_mass is forces["added_mass"]


def test_fluid_in_uniform_motion_does_not_push_a_fixed_particle() -> None:
    """A shear wave that passes the particle: the velocity there changes, but no fluid accelerates."""
    height, speed, amplitude = 0.02, 0.5, 0.1
    case = suspension(
        **{
            "fluid.viscosity": 0.0,
            "laws": {"drag": None, "added_mass": 0.5, "lubrication": "none", "gravity": (0.0, 0.0, 0.0)},
            "column": {"width": 0.01, "height": height, "cell": 1e-3, "sides": "periodic", "ends": "periodic"},
            "bed": {"diameter": 1e-4, "positions": [(5e-3, 5e-3, 0.25 * height)], "fixed": True},
            "run": {"until": 1.0, "fluid_step": 1e-5, "reference_speed": 0.01},
        }
    )
    number = 2.0 * np.pi / height
    simulation = Simulation(case)
    particles, fluid, coupling = simulation.particles, simulation.fluid, simulation.coupling
    assert fluid is not None and coupling is not None
    fluid.set_velocity((lambda x, y, z: amplitude * np.cos(number * z) + 0.0 * x * y, 0.0, speed))
    simulation.step()
    particles.inverse_mass[:] = 1.0 / (particles.mass + 0.5 * 1000.0 * particles.volume)  # as if it were free
    terms = coupling.prepare(particles, simulation.last_step)
    change = (terms.flow.slip - particles.sampled_velocity)[0, 0] / simulation.last_step
    assert change == pytest.approx(amplitude * number * speed, rel=0.05)
    assert abs(terms.explicit["explicit"][0, 0]) < 0.05 * 0.5 * 1000.0 * particles.volume[0] * change
