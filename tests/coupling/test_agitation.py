"""Agitation: statistics of the random processes, conservation, and where there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

import closures
from cfddem.backend.compile import serial, use_threads
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.coupling.forces.agitation import AgitationTerms, _advanced, _transition
from cfddem.features.energy import EnergyLedger
from cfddem.fluid import budgets
from cfddem.preflight.bed_waves import uniform_bed, with_agitation
from cfddem.run.simulation import Simulation
from closures import registry
from closures.agitation import SHORT

SUSPENSION = """
[fluid]
density = 1000.0
viscosity = 1e-3

[material.glass]
density = 2500.0
youngs_modulus = 6.0e10
contact_modulus = 1.0e6
poisson = 0.25

[column]
width = 0.012
height = 0.016
cell = 0.004
sides = "periodic"
ends = "periodic"

[bed]
diameter = 1.0e-3
count = 1320
start = "packed"

[laws]
drag = "wen_yu"
lubrication = "none"
self_disturbance_correction = false
agitation = "pseudo_turbulence"
surface = "smeared"

[run]
until = 0.1
reference_speed = 0.1
"""


def suspension(text: str = SUSPENSION, **changes: object) -> Simulation:
    """Glass beads in water that rises through them in a periodic box, carried by a mean fall of pressure."""
    case = Case.from_text(text, "case", {name.replace("__", "."): value for name, value in changes.items()})
    simulation = Simulation(case)
    fluid, particles = simulation.fluid, simulation.particles
    assert fluid is not None
    solids = float(particles.volume.sum()) / math.prod(case.column.size)
    fluid.boundaries.driving[2] = solids * (2500.0 - fluid.density) * 9.81
    fluid.set_velocity((0.0, 0.0, 0.08))
    return simulation


def agitation_of(simulation: Simulation) -> AgitationTerms:
    """Agitation that the next step would have."""
    terms = simulation.coupling.prepare(simulation.particles, simulation.last_step or 1e-4)
    velocity = terms.fluctuations["drag"]
    return AgitationTerms(velocity, terms.explicit.get("agitation", np.zeros_like(velocity)))


@serial
def _path(numbers, long, short, step, path):
    value, rate, transition = numbers[0, 0], numbers[0, 1], _transition(long, short, step)
    for n in range(len(numbers)):
        value, rate = _advanced(value, rate, transition, numbers[n, 0], numbers[n, 1])
        path[n, 0], path[n, 1] = value, rate


@pytest.mark.parametrize("step", [0.02, 0.1, 1.0])
def test_the_process_has_unit_variance_and_the_given_correlation_time(step: float) -> None:
    """Variance within 2 % and correlation as the closed form, over 60 000 correlation times."""
    long, short, count = 1.0 - SHORT, SHORT, int(60_000 / step)
    path = np.empty((count, 2))
    _path(np.random.default_rng(1).standard_normal((count, 2)), long, short, step, path)
    assert path.var(axis=0) == pytest.approx([1.0, 1.0], rel=0.02)
    for lag in (max(1, round(0.3 / step)), max(1, round(1.0 / step))):
        time = lag * step
        closed = (long * math.exp(-time / long) - short * math.exp(-time / short)) / (long - short)
        assert np.mean(path[lag:, 0] * path[:-lag, 0]) == pytest.approx(closed, abs=0.02)


def test_the_fluctuation_is_smooth() -> None:
    """Its mean square change over a step falls as the square of the step: the force du''/dt has a finite variance."""
    changes = []
    for step in (0.02, 0.01):
        path = np.empty((200_000, 2))
        _path(np.random.default_rng(2).standard_normal((200_000, 2)), 1.0 - SHORT, SHORT, step, path)
        changes.append(np.mean(np.diff(path[:, 0]) ** 2))
    assert changes[0] / changes[1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize(
    ("law", "surface"), [("pseudo_turbulence", "smeared"), ("pseudo_turbulence", "sharp"), ("lattanzi", "smeared")]
)
def test_momentum_is_conserved(law: str, surface: str) -> None:
    """The force on the fluid is the opposite of that on the particles, to 1e-12; none is lost over twenty steps."""
    changes = {"laws__agitation_inertia": 0.4, "laws__gravity": (0.0, 0.0, 0.0), "laws__surface": surface}
    simulation = suspension(laws__agitation=law, **changes)
    fluid, particles = simulation.fluid, simulation.particles
    assert fluid is not None
    fluid.boundaries.driving[2] = 0.0
    start = budgets.momentum(fluid) + (particles.mass[:, None] * particles.velocity).sum(axis=0)
    for _ in range(20):
        simulation.step()
    end = budgets.momentum(fluid) + (particles.mass[:, None] * particles.velocity).sum(axis=0)
    passed = float(np.abs(particles.mass[:, None] * particles.velocity).sum())
    assert np.abs(end - start).max() < 1e-3 * passed  # the last force of the step has not acted yet
    owed = particles.drag_momentum.sum(axis=0) / 1e-4 if surface == "sharp" else 0.0  # by drag in the last step
    terms = simulation.coupling.prepare(particles, 1e-4)
    given = terms.implicit.cell_source.sum(axis=(0, 1, 2)) * fluid.grid.cell_volume + owed
    force = sum(terms.force(line) for line in terms.on_fluid)
    assert np.abs(given + force.sum(axis=0)).max() < 1e-12 * np.abs(force).sum()


def test_beads_are_agitated_and_keep_their_mean_drag() -> None:
    """A fluctuation of the order of the slip; its mean over the box is zero; the mean drag changes by less than 2 %."""
    quiet, stirred = suspension(laws__agitation="none"), suspension()
    for simulation in (quiet, stirred):
        for _ in range(40):
            simulation.step()
    drag = [float(each.particles.drag_impulse[:, 2].sum() / each.last_step) for each in (quiet, stirred)]
    assert drag[1] == pytest.approx(drag[0], rel=0.02)
    seen = agitation_of(stirred).velocity
    assert 0.1 * 0.08 < seen[:, 2].std() < 0.08
    assert np.abs(seen.mean(axis=0)).max() < 0.02 * seen.std()


@pytest.mark.parametrize("law", ["pseudo_turbulence", "lattanzi"])
def test_without_slip_there_is_no_agitation(law: str) -> None:
    simulation = suspension(laws__agitation=law, laws__gravity=(0.0, 0.0, 0.0))
    simulation.fluid.boundaries.driving[2] = 0.0
    simulation.fluid.set_velocity((0.0, 0.0, 0.0))
    for _ in range(3):
        simulation.step()
    slip = np.abs(simulation.particles.velocity).max()  # of a few spheres that touch at the start
    assert slip < 1e-4
    if law == "pseudo_turbulence":
        assert np.abs(agitation_of(simulation).velocity).max() < 3.0 * slip


def test_mean_force_on_fixed_particles_is_unchanged() -> None:
    """Within 0.5 % over forty steps; a fixed packed bed."""
    forces = []
    for law in ("none", "pseudo_turbulence"):
        simulation = suspension(laws__agitation=law, bed__fixed=True, bed__count=1700)
        total = 0.0
        for _ in range(40):
            simulation.step()
            total += float(simulation.particles.drag_impulse[:, 2].sum() / simulation.last_step)
        forces.append(total)
    assert forces[1] == pytest.approx(forces[0], rel=5e-3)


@pytest.mark.slow
def test_the_power_of_agitation_is_a_line_of_the_energy_ledger() -> None:
    """It heats the particles as much as drag on their random motion cools them, within 5 %.

    Drag takes 3 b T from each particle; collisions are elastic and without friction, so that they take nothing.
    """
    still = {"material__glass__restitution": 1.0, "material__glass__friction": 0.0}
    simulation = suspension(run__energy_budget=True, laws__agitation_drag_along=1.0, **still)
    particles, coupling, ledger = simulation.particles, simulation.coupling, simulation.feature(EnergyLedger)
    for _ in range(150):
        simulation.step()
    resistance = coupling.prepare(particles, simulation.last_step).conductance("drag")
    began, start, lost = ledger.row(), simulation.time, 0.0
    for _ in range(300):
        simulation.step()
        fluctuation = particles.velocity - particles.velocity.mean(axis=0)
        lost += simulation.last_step * float((resistance * (fluctuation**2).sum(axis=1)).sum())
    row = ledger.row()
    gained = row["energy_agitation"] - began["energy_agitation"]
    assert simulation.time > start and gained > 0.0
    assert gained == pytest.approx(lost, rel=0.05)
    assert abs(row["energy_remainder"] - began["energy_remainder"]) < 0.01 * gained


def test_a_lone_particle_feels_no_agitation() -> None:
    one = {"bed__count": None, "bed__start": "placed", "bed__positions": [(0.006, 0.006, 0.008)]}
    falls = []
    for law in ("none", "pseudo_turbulence"):
        simulation = suspension(laws__agitation=law, laws__self_disturbance_correction=True, **one)
        for _ in range(20):
            simulation.step()
        falls.append(simulation.particles.velocity[0].copy())
    assert np.abs(falls[1] - falls[0]).max() < 5e-3 * np.abs(falls[0]).max()


def test_a_mixture_gets_no_net_drag() -> None:
    """Weighted by the drag coefficient of each particle, fluctuations add up to zero, for spheres of two sizes."""
    species = {"small": {"diameter": 0.7e-3, "count": 1200}, "large": {"diameter": 1.2e-3, "count": 500}}
    text = SUSPENSION.replace("diameter = 1.0e-3\n", "").replace("count = 1320\n", "")
    simulation = suspension(text, bed__species=species, laws__agitation_inertia=0.4)
    for _ in range(5):
        simulation.step()
    terms = simulation.coupling.prepare(simulation.particles, simulation.last_step)
    force = terms.conductance("drag")[:, None] * terms.fluctuations["drag"]
    for each in (force, terms.explicit["agitation"]):
        assert np.abs(each.sum(axis=0)).max() < 1e-12 * np.abs(each).sum()


@closures.law("agitation", "of a test", solid_fraction=(0.0, 0.1))
def even_fluctuation(solid_fraction: float) -> float:
    """A tenth of the squared slip in every direction."""
    return 0.1 + 0.0 * solid_fraction


def test_a_law_of_the_user_agitates() -> None:
    """The variance of the fluctuation is that of the law, times the factor of the drag; values out of range count."""
    laws = {"laws__agitation": even_fluctuation, "laws__kernel_width": 4.0, "laws__drag": "wen_yu"}
    simulation = suspension(**laws, laws__agitation_drag_along=2.0)
    simulation.step()
    slip = 0.08 - simulation.particles.velocity[:, 2].mean()
    deviation = agitation_of(simulation).velocity.std(axis=0) / slip
    assert deviation == pytest.approx(math.sqrt(0.1) * np.array([1.0, 1.0, 2.0]), rel=0.06)
    assert simulation.forces["agitation"].outside == 2 * simulation.particles.count


@pytest.mark.parametrize(
    "law, factors", [("pseudo_turbulence", (0.45, 0.65)), ("lattanzi", (1.0, 0.6)), (even_fluctuation, (1.0, 1.0))]
)
def test_factors_of_the_drag_are_those_of_the_law_unless_given(law: object, factors: tuple[float, float]) -> None:
    made = suspension(laws__agitation=law).forces["agitation"]
    assert made.factors[:2] == factors
    made = suspension(laws__agitation=law, laws__agitation_drag_across=0.0, laws__agitation_time=3.0).forces[
        "agitation"
    ]
    assert (made.factors.along, made.factors.across, made.factors.time) == (factors[0], 0.0, 3.0)


def test_a_law_with_unknown_arguments_is_refused() -> None:
    def wrong(voidage: float) -> float:
        return voidage

    closures.law("agitation", "of a test")(wrong)
    with pytest.raises(InputError, match="it may take solid_fraction, reynolds, along, density_ratio"):
        suspension(laws__agitation=wrong)
    registry.REGISTRY["agitation"].pop("wrong")


@pytest.mark.slow
def test_same_bits_on_one_and_two_threads_and_after_a_restart() -> None:
    states, kept = [], []
    for threads in (1, 2):
        use_threads(threads)
        simulation = suspension()
        for _ in range(4):
            simulation.step()
        states.append(simulation.particles.velocity.copy())
        kept.append(simulation.checkpoint())
    assert np.array_equal(*states)
    simulation.step()
    again = Simulation.restored(simulation.case, kept[0])
    again.fluid.boundaries.driving[:] = simulation.fluid.boundaries.driving
    again.step()
    assert np.array_equal(simulation.particles.velocity, again.particles.velocity)


@pytest.mark.slow
def test_the_granular_temperature_is_independent_of_the_fluid_step() -> None:
    """Within 10 % for a step of half the length; the estimate of the stability page is within 20 %."""
    found = []
    for step in (4e-4, 2e-4):
        simulation = suspension(run__fluid_step=step)
        simulation.until(0.1)
        samples = []
        for row in range(100):
            simulation.until(0.1 + 0.3 * (row + 1) / 100)
            velocity = simulation.particles.velocity
            samples.append(((velocity - velocity.mean(axis=0)) ** 2).sum(axis=1).mean() / 3.0)
        found.append(float(np.mean(samples)))
    assert found[1] == pytest.approx(found[0], rel=0.1)
    case = simulation.case
    voidage = 1.0 - float(simulation.particles.volume.sum()) / math.prod(case.column.size)
    assert found[1] == pytest.approx(with_agitation(uniform_bed(case, voidage), case).granular_temperature, rel=0.2)
