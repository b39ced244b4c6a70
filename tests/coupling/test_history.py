"""History force: its kernels, a sphere with memory against exact solutions, and a suspension with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import pytest
from scipy.integrate import quad
from test_coupling import momentum, stirred, suspension

from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.features.energy import EnergyLedger
from cfddem.run.simulation import Simulation
from closures import history as laws
from scenarios.beds.settling import study as settling
from scenarios.references.history_force import (
    Memory,
    Motion,
    around_impact,
    convolved,
    difference,
    modelled,
    oscillating,
    turning,
)
from scenarios.validation.table import numbers

WATER, VISCOSITY, GLASS, DIAMETER = 1000.0, 1e-3, 2500.0, 1e-4
DIFFUSION = DIAMETER**2 * WATER / VISCOSITY
"""Time d^2/nu [s]."""

SCALED = {
    "mei_adrian": lambda x: x**-0.5 * (1.0 + x**0.75) ** -2,
    "basset": lambda x: x**-0.5,
}
"""Kernels over the time t_c."""


def sphere(kernel: Literal["mei_adrian", "basset"], inertia: float = math.inf) -> Memory:
    """The history force on one sphere whose slip is given."""
    return Memory(kernel, DIAMETER, WATER, VISCOSITY, inertia)


def exponentials(kernel: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Rates and amplitudes of the exponentials of a kernel, and the integral that they lack near 0."""
    amplitudes, slowest, missing = {
        "mei_adrian": (laws.MEI_ADRIAN_AMPLITUDES, laws.MEI_ADRIAN_SLOWEST, laws.MEI_ADRIAN_MISSING),
        "basset": (laws.BASSET_AMPLITUDES, laws.BASSET_SLOWEST, laws.BASSET_MISSING),
    }[kernel]
    return slowest * laws.RATE_RATIO ** np.arange(len(amplitudes)), np.array(amplitudes), missing


def transform(kernel: str, frequency: float) -> complex:
    """Laplace transform of a scaled kernel at i frequency: x = y^4, and y on the ray on which the exponential falls."""
    ray = np.exp(-0.125j * math.pi)

    def along(y: float) -> complex:
        decay = (1.0 + (ray * y) ** 3) ** -2 if kernel == "mei_adrian" else 1.0
        return complex(4.0 * y * ray**2 * decay * math.exp(-frequency * y**4))

    end = (40.0 / frequency) ** 0.25
    real, imaginary = (
        quad(lambda y, part=part: getattr(along(y), part), 0.0, end, limit=400)[0] for part in ("real", "imag")
    )
    return complex(real, imaginary)


@pytest.mark.parametrize("kernel", SCALED)
def test_exponentials_have_the_spectrum_of_the_kernel(kernel: str) -> None:
    """Amplitude and phase of the force at any frequency within 0.2 %."""
    rates, amplitudes, missing = exponentials(kernel)
    for frequency in (1e-3, 1e-2, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4):
        exact = transform(kernel, frequency)
        summed = complex((amplitudes / (rates + 1j * frequency)).sum() + missing)
        assert abs(summed - exact) < 2e-3 * abs(exact)


@pytest.mark.parametrize("kernel", SCALED)
def test_exponentials_have_the_second_integral_of_the_kernel(kernel: str) -> None:
    """The force of a steady change of the slip, from the shortest step of 1e-6 t_c on, within 0.02 %."""
    rates, amplitudes, missing = exponentials(kernel)
    for end in (1e-6, 1e-4, 1e-2, 1.0, 100.0, 1e3):
        exact = quad(lambda y, end=end: 2 * y * (end - y * y) * SCALED[kernel](y * y), 0.0, end**0.5, limit=400)[0]
        summed = float((amplitudes / rates * (end + np.expm1(-end * rates) / rates)).sum() + missing * end)
        assert summed == pytest.approx(exact, rel=2e-4)


def test_the_laws_are_the_scaled_kernels() -> None:
    slip, kinematic = 0.1, 1e-6
    time = laws.decay_time(slip, DIAMETER, kinematic)
    for x in (1e-3, 0.3, 5.0):
        ratio = laws.mei_adrian(x * time, slip, DIAMETER, kinematic) / laws.mei_adrian(time, slip, DIAMETER, kinematic)
        assert ratio == pytest.approx(SCALED["mei_adrian"](x) / SCALED["mei_adrian"](1.0), rel=1e-12)


def fall(step: float, duration: float) -> np.ndarray:
    """Speed of a sphere from rest in creeping flow, with added mass and the force of Basset."""
    mass, displaced = GLASS * math.pi / 6.0 * DIAMETER**3, WATER * math.pi / 6.0 * DIAMETER**3
    inertia, weight, drag = mass + 0.5 * displaced, (mass - displaced) * 9.81, 3.0 * math.pi * VISCOSITY * DIAMETER
    memory, speeds = sphere("basset", inertia), [0.0]
    for _ in range(round(duration / step)):
        speed = speeds[-1]
        history, explicit = memory.prepare(np.array([-speed, 0.0, 0.0]), drag, step)
        stiffness = step * (drag + history) / inertia
        theta, rest = (1.0 + stiffness) / (2.0 + stiffness), weight + explicit[0]
        received = -(drag + history) / (1.0 + theta * stiffness) * (speed + theta * step * rest / inertia)
        memory.history.store(
            memory.particles, np.array([[received * history / (drag + history), 0.0, 0.0]]), memory.terms, step
        )
        speeds.append(speed + step * (received + rest) / inertia)
    return np.array(speeds)


def exact_fall(times: np.ndarray) -> np.ndarray:
    """The same by numerical inversion of the Laplace transform (Talbot's contour)."""
    mass, displaced = GLASS * math.pi / 6.0 * DIAMETER**3, WATER * math.pi / 6.0 * DIAMETER**3
    radius, points = 0.5 * DIAMETER, 64
    angle = (2 * np.arange(points) + 1) * np.pi / points - np.pi
    contour = points * (0.5017 * angle / np.tan(0.6407 * angle) - 0.6122 + 0.2645j * angle)
    slope = 0.5017 / np.tan(0.6407 * angle) - 0.5017 * 0.6407 * angle / np.sin(0.6407 * angle) ** 2 + 0.2645j
    speeds = []
    for time in times:
        s = contour / time
        stokes = 6.0 * math.pi * VISCOSITY * radius * (1.0 + radius * np.sqrt(s * WATER / VISCOSITY))
        image = (mass - displaced) * 9.81 / s / ((mass + 0.5 * displaced) * s + stokes)
        speeds.append(float((np.exp(contour) * image * slope).sum().imag / time))
    return np.array(speeds)


def test_a_sphere_from_rest_in_creeping_flow() -> None:
    """Within 0.15 % of the final speed at 2 % of d^2/nu, and of second order."""
    errors = []
    for share in (0.04, 0.02, 0.01, 0.005):
        speeds = fall(share * DIFFUSION, 4.0 * DIFFUSION)
        exact = exact_fall(share * DIFFUSION * np.arange(1, len(speeds)))
        errors.append(float(np.abs(speeds[1:] - exact).max() / exact[-1]))
    assert errors[1] < 1.5e-3
    assert math.log2(errors[0] / errors[-1]) / 3.0 > 1.65
    assert math.log2(errors[-2] / errors[-1]) > 1.8


@pytest.mark.parametrize("frequency", [0.01, 0.1, 1.0, 10.0, 100.0])
def test_amplitude_and_phase_of_an_oscillating_sphere(frequency: float) -> None:
    r"""Creeping flow: :math:`6\pi\eta a^2\sqrt{i\omega/\nu}\,w`, each within 1 %; frequencies are over nu/d^2."""
    omega, per_period, periods = frequency / DIFFUSION, 200, 6
    step = 2.0 * math.pi / omega / per_period
    ends = step * np.arange(per_period * periods + 1)
    slips = np.stack([np.sin(omega * ends), 0.0 * ends, 0.0 * ends], axis=1)
    forces = sphere("basset").along(slips, step)[-per_period:, 0]
    middles = (ends[1:] - 0.5 * step)[-per_period:]
    found = 2.0 * complex(np.mean(forces * np.exp(-1j * omega * middles))) * 1j
    exact = 1.5 * math.pi * VISCOSITY * DIAMETER**2 * np.sqrt(1j * omega * WATER / VISCOSITY)
    assert abs(found) == pytest.approx(abs(exact), rel=0.01)
    assert abs(np.angle(found / exact)) < 0.01


def turned(motion: Motion, step: int) -> np.ndarray:
    """History force on a slip that turns at constant speed, in the middle of a step: two components [N].

    x = y^4, because the kernel is singular at 0.
    """
    speed = float(np.linalg.norm(motion.slips[0]))
    time = laws.decay_time(speed, motion.diameter, motion.kinematic)
    now = (step + 0.5) * 0.02

    def smooth(y: float, shape: Callable[[float], float]) -> float:
        return 4.0 * y / (1.0 + y**3) ** 2 * shape(0.3 * (now - y**4))

    shapes = (lambda x: -math.sin(x), math.cos)
    parts = [quad(smooth, 0.0, now**0.25, args=(shape,), limit=2000)[0] for shape in shapes]
    stokes = 3.0 * math.pi * motion.viscosity * motion.diameter
    return stokes * laws.basset(time, speed, motion.diameter, motion.kinematic) * 0.3 * speed * np.array(parts)


@pytest.mark.slow
def test_exponentials_and_convolution_agree_at_constant_slip_speed() -> None:
    """A slip that turns at constant speed, for 10 to 100 000 steps of 2 % of t_c: the force within 0.2 %."""
    motion = turning(100_000)
    forces = modelled(motion)
    for n in (10, 100, 1000, 9999, 99_999):
        exact = turned(motion, n)
        assert np.hypot(*(forces[n, :2] - exact)) < 2e-3 * np.hypot(*exact)


def test_readings_of_the_kernel_differ_where_the_slip_speed_varies() -> None:
    """At constant speed the force is that of both convolutions, which is that of the integral; otherwise not."""
    motion = turning(300)
    force, present, past = modelled(motion), convolved(motion, "present"), convolved(motion, "past")
    assert difference(past, present) < 1e-12
    assert difference(force, present) < 2e-3
    assert difference(present[-1, :2], turned(motion, 299)) < 1e-4
    motion = oscillating(1.0, steps=300)
    force, present, past = modelled(motion), convolved(motion, "present"), convolved(motion, "past")
    assert min(difference(force, present), difference(force, past), difference(past, present)) > 0.05


def test_a_jump_of_the_velocity_is_remembered() -> None:
    """A slip that jumps within a step: the impulse until 50 steps later is that of a ramp over this step."""
    step = 1e-3 * DIFFUSION
    slips = np.zeros((60, 3))
    slips[5:, 0] = 1.0
    memory, given = sphere("basset"), []
    for before in slips[:-1]:
        conductance, explicit = memory.prepare(before, 0.0, step)
        implicit = conductance * before  # the transfer does not know of the jump
        memory.history.store(memory.particles, implicit[None], memory.terms, step)
        given.append(float(explicit[0] + implicit[0]))
    known = sphere("basset").along(slips, step)[:, 0]
    assert given[4] == 0.0
    # the impulse of the step of the jump comes one step later; afterwards the forces are equal
    assert given[5] - known[5] == pytest.approx(known[4], rel=1e-9)
    assert given[6:] == pytest.approx(known[6:], rel=1e-9)


@pytest.mark.slow
def test_mordants_bead_reaches_its_velocity_in_time() -> None:
    """Measured: 95 % after 0.055 s (12 %); the convolution of the same equation within 1 %; the same final speed."""
    case = settling.mordant()
    assert case.laws.history == "mei_adrian"
    times, speeds = settling.release(case)
    late = np.argmax(speeds >= 0.95 * speeds[-1])
    reached = np.interp(0.95 * speeds[-1], speeds[late - 1 : late + 1], times[late - 1 : late + 1])
    assert reached == pytest.approx(numbers("mordant2000_glass_0p5mm")["tau95"][0], rel=0.12)
    without = settling.release(case.with_(**{"laws.history": "none"}))[1]
    assert speeds[-1] == pytest.approx(without[-1], rel=2e-3)
    early = times <= 0.15
    exact = settling.equation_of_motion(case, times[early])
    assert np.abs(speeds[early] - exact).max() < 0.01 * exact[-1]


@pytest.mark.parametrize(("model", "agitation"), [("A", "none"), ("B", "none"), ("A", "free_spheres")])
def test_momentum_is_kept(model: str, agitation: str) -> None:
    laws: dict[str, Any] = {"model": model, "history": "mei_adrian", "added_mass": 0.5, "agitation": agitation}
    laws["surface"] = "smeared"
    case = suspension(**{f"laws.{key}": value for key, value in laws.items()})
    simulation = stirred(case)
    start, scale = momentum(simulation), float((simulation.particles.mass * 0.02).sum())
    for _ in range(20):
        simulation.step()
    assert np.abs(momentum(simulation) - start).max() < 1e-11 * scale


def test_the_energy_of_the_history_force_is_a_line_of_the_budget() -> None:
    """A stirred suspension loses energy to it, and the remainder stays as small as without it."""
    shares = []
    for history in ("none", "mei_adrian"):
        case = suspension(**{"laws.history": history, "laws.added_mass": 0.5, "run.energy_budget": True})
        simulation = stirred(case)
        for _ in range(20):
            simulation.step()
        row = simulation.feature(EnergyLedger).row()
        shares.append(abs(row["energy_remainder"]) / row["energy_put_in"])
        assert ("energy_history" in row) == (history != "none")
    assert row["energy_history"] > 0.05 * row["energy_drag"]
    assert shares[1] < max(1.5 * shares[0], 1e-3)


def test_same_bits_after_a_restart() -> None:
    simulation = stirred(suspension(**{"laws.history": "mei_adrian"}))
    for _ in range(4):
        simulation.step()
    again = Simulation.restored(simulation.case, simulation.checkpoint())
    for each in (simulation, again):
        each.step()
    assert np.array_equal(simulation.particles.velocity, again.particles.velocity)


@pytest.mark.slow  # as a plain test: a bed with all forces that is divided among ranks, which run on all threads
def test_same_bits_on_one_and_two_threads_and_after_a_restart() -> None:
    states, kept = [], []
    before = use_threads(None)
    for threads in (1, 2):
        try:
            use_threads(threads)
        except InputError:
            pytest.skip("one thread only")
        simulation = stirred(suspension(**{"laws.history": "mei_adrian"}))
        for _ in range(4):
            simulation.step()
        states.append(simulation.particles.velocity.copy())
        kept.append(simulation.checkpoint())
    use_threads(before)
    assert np.array_equal(*states)
    again = Simulation.restored(simulation.case, kept[0])
    for each in (simulation, again):
        each.step()
    assert np.array_equal(simulation.particles.velocity, again.particles.velocity)


def test_the_history_force_around_an_impact_is_that_of_the_convolution() -> None:
    """Before, during and after the contact of a sphere with a wall, where the slip changes its sign within 10 us."""
    before, during, *after = around_impact()
    assert before.package == pytest.approx(before.quadrature, abs=3e-5)
    assert 0.005 < during.package == pytest.approx(during.quadrature, rel=5e-3)
    assert sum(each.package for each in after) > 0.03
    for each in after:
        assert each.package == pytest.approx(each.quadrature, rel=2e-3)
