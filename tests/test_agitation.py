"""Agitation: statistics of the random processes, conservation, and where there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.backend.compile import serial, use_threads
from cfddem.case.schema import Case
from cfddem.coupling.forces.agitation import SHORT, _advanced
from cfddem.run.simulation import Simulation

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

[run]
until = 0.1
reference_speed = 0.1
"""


def suspension(**changes: object) -> Simulation:
    """Glass beads in water that rises through them in a periodic box, carried by a mean fall of pressure."""
    case = Case.from_text(SUSPENSION, "case", {name.replace("__", "."): value for name, value in changes.items()})
    simulation = Simulation(case)
    fluid, particles = simulation.fluid, simulation.particles
    assert fluid is not None
    solids = float(particles.volume.sum()) / math.prod(case.column.size)
    fluid.boundaries.driving[2] = solids * (2500.0 - fluid.density) * 9.81
    fluid.set_velocity((0.0, 0.0, 0.08))
    return simulation


@serial
def _path(numbers, long, short, step, path):
    value, rate = numbers[0, 0], numbers[0, 1]
    for n in range(len(numbers)):
        value, rate = _advanced(value, rate, long, short, step, numbers[n, 0], numbers[n, 1])
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


@pytest.mark.parametrize("law", ["pseudo_turbulence", "lattanzi"])
def test_momentum_is_conserved(law: str) -> None:
    """The force on the fluid is the opposite of that on the particles, to 1e-12; none is lost over twenty steps."""
    simulation = suspension(laws__agitation=law, laws__gravity=(0.0, 0.0, 0.0))
    fluid, particles = simulation.fluid, simulation.particles
    assert fluid is not None
    fluid.boundaries.driving[2] = 0.0
    start = fluid.momentum() + (particles.mass[:, None] * particles.velocity).sum(axis=0)
    for _ in range(20):
        simulation.step()
    end = fluid.momentum() + (particles.mass[:, None] * particles.velocity).sum(axis=0)
    passed = float(np.abs(particles.mass[:, None] * particles.velocity).sum())
    assert np.abs(end - start).max() < 1e-3 * passed  # the last force of the step is still under way
    terms = simulation.exchange.prepare(particles, 1e-4)
    given = terms.source.sum(axis=(0, 1, 2)) * fluid.grid.cell_volume
    assert np.abs(given + terms.explicit.sum(axis=0)).max() < 1e-12 * np.abs(terms.explicit).sum()


def test_beads_are_agitated_and_keep_their_mean_drag() -> None:
    """A fluctuation of the order of the slip; its mean over the box is zero; the mean drag changes by less than 2 %."""
    quiet, stirred = suspension(laws__agitation="none"), suspension()
    for simulation in (quiet, stirred):
        for _ in range(40):
            simulation.step()
    seen = stirred.particles.fluid_fluctuation
    weights = stirred.particles.volume / stirred.particles.volume.sum()
    assert 0.1 * 0.08 < seen[:, 2].std() < 0.08
    assert np.abs(weights @ seen).max() < 0.02 * seen.std()
    drag = [float(each.particles.drag_impulse[:, 2].sum() / each.last_step) for each in (quiet, stirred)]
    assert drag[1] == pytest.approx(drag[0], rel=0.02)


@pytest.mark.parametrize("law", ["pseudo_turbulence", "lattanzi"])
def test_without_slip_there_is_no_agitation(law: str) -> None:
    simulation = suspension(laws__agitation=law, laws__gravity=(0.0, 0.0, 0.0))
    assert simulation.fluid is not None
    simulation.fluid.boundaries.driving[2] = 0.0
    simulation.fluid.set_velocity((0.0, 0.0, 0.0))
    for _ in range(3):
        simulation.step()
    slip = np.abs(simulation.particles.velocity).max()  # of a few spheres that touch at the start
    assert slip < 1e-4
    if law == "pseudo_turbulence":
        assert np.abs(simulation.particles.fluid_fluctuation).max() < 3.0 * slip


def test_a_lone_particle_feels_no_agitation() -> None:
    one = {"bed__count": None, "bed__start": "placed", "bed__positions": [(0.006, 0.006, 0.008)]}
    falls = []
    for law in ("none", "pseudo_turbulence"):
        simulation = suspension(laws__agitation=law, laws__self_disturbance_correction=True, **one)
        for _ in range(20):
            simulation.step()
        falls.append(simulation.particles.velocity[0].copy())
    assert np.abs(falls[1] - falls[0]).max() < 5e-3 * np.abs(falls[0]).max()


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
    assert simulation.fluid is not None and again.fluid is not None
    again.fluid.boundaries.driving[:] = simulation.fluid.boundaries.driving
    again.step()
    assert np.array_equal(simulation.particles.velocity, again.particles.velocity)
