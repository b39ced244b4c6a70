"""History force: its kernels, a sphere with memory against exact solutions, and a suspension with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from test_coupling import momentum, stirred, suspension

from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.coupling.forces.history import History
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.particles.state import Particles, make_particles
from cfddem.run.simulation import Simulation
from closures import history as laws
from scenarios.beds.settling import study as settling
from scenarios.validation.table import numbers

WATER, VISCOSITY, GLASS, DIAMETER = 1000.0, 1e-3, 2500.0, 1e-4
DIFFUSION = DIAMETER**2 * WATER / VISCOSITY
"""Time d^2/nu [s]."""

SCALED = {
    "mei_adrian": lambda x: x**-0.5 * (1.0 + x**0.75) ** -2,
    "basset": lambda x: x**-0.5,
}
"""Kernels over the time t_c."""


class Memory:
    """The history force on one sphere whose slip is given."""

    def __init__(self, kernel: str, inertia: float = math.inf) -> None:
        self.history = History(kernel, WATER)  # type: ignore[arg-type]
        self.particles: Particles = make_particles(np.zeros((1, 3)), 0.5 * DIAMETER, GLASS, viscosity=VISCOSITY)
        for field in self.history.fields:
            self.particles.declare(field)
        self.inertia, self.last = np.array([inertia]), 0.0

    def prepare(self, slip: np.ndarray, drag: float, step: float) -> tuple[float, np.ndarray]:
        """Conductance and explicit force of a step."""
        one = np.ones(1)
        flow = SampledFlow(slip[None], np.zeros((1, 3)), one, one, one, one)
        self.terms = self.history.terms(self.particles, flow, np.array([drag]), self.inertia, step, self.last)
        self.last = step
        return float(self.terms.conductance[0]), self.terms.force[0]

    def along(self, slips: np.ndarray, step: float) -> np.ndarray:
        """Mean force in every step of a slip that is given at its ends (n + 1, 3)."""
        forces = []
        for before, after in pairwise(slips):
            conductance, explicit = self.prepare(before, 0.0, step)
            implicit = conductance * 0.5 * (before + after)  # the middle of the step, for an infinite mass
            self.history.store(self.particles, implicit[None], self.terms, step)
            forces.append(explicit + implicit)
        return np.array(forces)


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
    memory, speeds = Memory("basset", inertia), [0.0]
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
    forces = Memory("basset").along(slips, step)[-per_period:, 0]
    middles = (ends[1:] - 0.5 * step)[-per_period:]
    found = 2.0 * complex(np.mean(forces * np.exp(-1j * omega * middles))) * 1j
    exact = 1.5 * math.pi * VISCOSITY * DIAMETER**2 * np.sqrt(1j * omega * WATER / VISCOSITY)
    assert abs(found) == pytest.approx(abs(exact), rel=0.01)
    assert abs(np.angle(found / exact)) < 0.01


def turned(shape: Callable[[float], float], time: float) -> float:
    """The convolution of the scaled kernel with a shape of the phase; x = y^4, because the kernel is singular at 0."""

    def smooth(y: float) -> float:
        return 4.0 * y / (1.0 + y**3) ** 2 * shape(0.3 * (time - y**4))

    return float(quad(smooth, 0.0, time**0.25, limit=2000)[0])


@pytest.mark.slow
def test_exponentials_and_convolution_agree_at_constant_slip_speed() -> None:
    """A slip that turns at constant speed, for 10 to 100 000 steps of 2 % of t_c: the force within 0.2 %."""
    speed, kinematic = 0.1, VISCOSITY / WATER
    time = laws.decay_time(speed, DIAMETER, kinematic)
    step, turning = 0.02 * time, 0.3 / time
    ends = step * np.arange(100_001)
    slips = speed * np.stack([np.cos(turning * ends), np.sin(turning * ends), 0.0 * ends], axis=1)
    forces = Memory("mei_adrian").along(slips, step)
    scale = (
        3.0 * math.pi * VISCOSITY * DIAMETER * laws.basset(time, speed, DIAMETER, kinematic) * speed * turning * time
    )
    for n in (10, 100, 1000, 9999, 99_999):
        middle = (n + 0.5) * 0.02
        parts = [turned(shape, middle) for shape in (lambda x: -math.sin(x), math.cos)]
        assert np.hypot(*(forces[n, :2] / scale - parts)) < 2e-3 * 1.6 + 1e-4


def test_a_jump_of_the_velocity_is_remembered() -> None:
    """A slip that jumps within a step: the impulse until 50 steps later is that of a ramp over this step."""
    step = 1e-3 * DIFFUSION
    slips = np.zeros((60, 3))
    slips[5:, 0] = 1.0
    memory, given = Memory("basset"), []
    for before in slips[:-1]:
        conductance, explicit = memory.prepare(before, 0.0, step)
        implicit = conductance * before  # the transfer does not know of the jump
        memory.history.store(memory.particles, implicit[None], memory.terms, step)
        given.append(float(explicit[0] + implicit[0]))
    known = Memory("basset").along(slips, step)[:, 0]
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
    case = suspension(
        **{"laws.model": model, "laws.history": "mei_adrian", "laws.added_mass": 0.5, "laws.agitation": agitation}
    )
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
        assert simulation.energy is not None
        row = simulation.energy.row()
        shares.append(abs(row["energy_remainder"]) / row["energy_put_in"])
        assert ("energy_history" in row) == (history != "none")
    assert row["energy_history"] > 0.05 * row["energy_drag"]
    assert shares[1] < max(1.5 * shares[0], 1e-3)


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
