r"""The history force of a sphere whose slip is given, against direct convolutions.

The kernel of Mei and Adrian belongs to a steady slip speed U: its time t_c depends on it. For a slip speed that varies
there are several readings:

- `modelled`, the one of the package: time is counted in units of the t_c of its moment, and the amplitude is that of
  the present t_c. A particle then needs constant memory.
- `convolved(..., "present")`: the kernel of the present slip speed weights all earlier changes of the slip.
- `convolved(..., "past")`: each change is weighted by the kernel of the slip speed at which it happened.

All three are equal at constant slip speed, except for the error of the exponentials. No measurement tells them apart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from cfddem.coupling.forces.history import History
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.particles.state import Particles, make_particles
from closures.history import basset, decay_time
from scenarios.beds.settling import study as settling
from scenarios.collisions.bouncing_sphere import study as bouncing_sphere

Array = np.ndarray


class Motion(NamedTuple):
    """Slip of a sphere, piecewise linear in time."""

    slips: Array  # fluid velocity less particle velocity at the ends of steps (n + 1, 3) [m/s]
    step: float  # [s]
    diameter: float = 5e-4  # [m]
    density: float = 1000.0  # of the fluid [kg/m3]
    viscosity: float = 1e-3  # of the fluid [Pa s]

    @property
    def kinematic(self) -> float:
        """Kinematic viscosity of the fluid [m2/s]."""
        return self.viscosity / self.density


class Memory:
    """The history force of the package on one sphere.

    kernel   "mei_adrian" or "basset"
    inertia  mass and added mass [kg]
    """

    def __init__(
        self,
        kernel: Literal["mei_adrian", "basset"],
        diameter: float,
        density: float,
        viscosity: float,
        inertia: float = math.inf,
    ) -> None:
        self.history = History(kernel, density)
        self.particles: Particles = make_particles(np.zeros((1, 3)), 0.5 * diameter, 2500.0, viscosity=viscosity)
        for field in self.history.fields:
            self.particles.declare(field)
        self.inertia, self.last = np.array([inertia]), 0.0

    def prepare(self, slip: Array, drag: float, step: float) -> tuple[float, Array]:
        """Conductance [kg/s] and explicit force (3,) [N] of a step."""
        one = np.ones(1)
        flow = SampledFlow(slip[None], np.zeros((1, 3)), one, one, one, one)
        self.terms = self.history.terms(self.particles, flow, np.array([drag]), self.inertia, step, self.last)
        self.last = step
        return float(self.terms.conductance[0]), self.terms.force[0]

    def along(self, slips: Array, step: float) -> Array:
        """Mean force in every step of a slip that is given at its ends (n, 3) [N]."""
        forces = []
        for before, after in pairwise(slips):
            conductance, explicit = self.prepare(before, 0.0, step)
            implicit = conductance * 0.5 * (before + after)  # the middle of the step, for an infinite mass
            self.history.store(self.particles, implicit[None], self.terms, step)
            forces.append(explicit + implicit)
        return np.array(forces)


def modelled(motion: Motion) -> Array:
    """History force of the package, mean of every step (n, 3) [N]."""
    memory = Memory("mei_adrian", motion.diameter, motion.density, motion.viscosity)
    return memory.along(motion.slips, motion.step)


def convolved(motion: Motion, kernel_of: Literal["present", "past"], steps: Sequence[int] | None = None) -> Array:
    """History force by direct convolution, in the middle of every step or of some (m, 3) [N].

    kernel_of  the slip speed in the middle of the present step, or of the step in which the slip changed
    """
    middles = 0.5 * (motion.slips[1:] + motion.slips[:-1])
    times = np.array(
        [decay_time(max(speed, 1e-12), motion.diameter, motion.kinematic) for speed in np.linalg.norm(middles, axis=1)]
    )
    growth = np.diff(motion.slips, axis=0) / motion.step
    forces = []
    for n in range(len(growth)) if steps is None else steps:
        elapsed = motion.step * np.maximum(n + 0.5 - np.arange(n + 2), 0.0)  # since the ends of all steps until now
        scale = times[n] if kernel_of == "present" else times[: n + 1]
        weight = _integral(elapsed[:-1] / scale) - _integral(elapsed[1:] / scale)
        # the amplitude is that of Basset's kernel after the time t_c, and t_c^(1/2) times that after 1 s
        forces.append((np.sqrt(scale) * weight) @ growth[: n + 1])
    stokes = 3.0 * math.pi * motion.viscosity * motion.diameter
    return stokes * basset(1.0, 0.0, motion.diameter, motion.kinematic) * np.array(forces)


def _integral(x: Array) -> Array:
    r"""Integral of :math:`g(x) = x^{-1/2}(1 + x^{3/4})^{-2}` from 0, with :math:`y = x^{1/4}`.

    .. math:: \frac43\left[\frac{y^2}{1 + y^3} + \frac16\ln\frac{1 - y + y^2}{(1 + y)^2}
              + \frac1{\sqrt3}\left(\arctan\frac{2y - 1}{\sqrt3} + \frac\pi6\right)\right]
    """
    y = x**0.25
    series = y**2 * (2.0 - 1.6 * y**3 + 1.5 * y**6)  # the closed form cancels for small y
    angle = (np.arctan((2.0 * y - 1.0) / math.sqrt(3.0)) + math.pi / 6.0) / math.sqrt(3.0)
    closed = y**2 / (1.0 + y**3) + np.log((1.0 - y + y**2) / (1.0 + y) ** 2) / 6.0 + angle
    return np.where(y < 0.02, series, 4.0 / 3.0 * closed)


def difference(force: Array, other: Array) -> float:
    """Root mean square of the difference of two forces (n, 3) over that of the second [-]."""
    return float(np.sqrt(((force - other) ** 2).sum() / (other**2).sum()))


def turning(steps: int) -> Motion:
    """A slip that turns at constant speed, by 0.3 rad in t_c; steps of 2 % of t_c."""
    speed, still = 0.1, Motion(np.zeros((1, 3)), 0.0)
    time = decay_time(speed, still.diameter, still.kinematic)
    angle = 0.3 * 0.02 * np.arange(steps + 1)
    slips = speed * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    return still._replace(slips=slips, step=0.02 * time)


def from_rest(steps: int = 3000) -> Motion:
    """The bead of the gallery case, glass of 0.5 mm in water, from rest until it has reached its terminal velocity."""
    case = settling.mordant()
    times = np.linspace(0.0, case.run.until, steps + 1)
    slips = np.zeros((steps + 1, 3))
    slips[:, 2] = settling.equation_of_motion(case, times)
    return Motion(slips, float(times[1]), case.bed.diameter, case.required_fluid.density, case.required_fluid.viscosity)


def rebounding(steps: int = 3000) -> Motion:
    """The steel sphere that rebounds from a wall in oil at St = 27, as it moves with all forces of the fluid."""
    path = bouncing_sphere.collision()
    times = np.linspace(path.time[0], path.time[-1], steps + 1)
    slips = np.zeros((steps + 1, 3))
    slips[:, 0] = -np.interp(times, path.time, path.history["velocity"][:, 0, 0])
    fall = bouncing_sphere.SLOW
    return Motion(slips, float(times[1]), 2.0 * fall.radius, fall.fluid_density, fall.viscosity)


class Impulse(NamedTuple):
    """Impulse of the history force in a time around an impact, over that of the sphere as it falls."""

    begin: float  # after contact [s]
    end: float
    package: float
    quadrature: float


AROUND = (-1e-3, -2e-5, 2e-5, 1e-4, 5e-4)
"""Times after contact between which impulses are compared: before, during and after the contact [s]."""


def around_impact() -> list[Impulse]:
    """Impulses of the history force around the impact at St = 152, by the package and by quadrature."""
    fall = bouncing_sphere.FAST
    path = bouncing_sphere.collision(AROUND[-1], ("drag", "added_mass", "history"), fall)
    times, slips = path.time, -path.history["velocity"][:, 0, 0]
    forces = (path.history["force_history"][1:, 0], in_elapsed_time(times, slips, fall))
    after, lasting = times[1:] - bouncing_sphere.contact_time(path), np.diff(times)
    scale = fall.steel().density * 4.0 / 3.0 * math.pi * fall.radius**3 * fall.speed
    return [
        Impulse(begin, end, *((force * lasting)[(after > begin) & (after <= end)].sum() / scale for force in forces))
        for begin, end in pairwise(AROUND)
    ]


def in_elapsed_time(times: Array, slips: Array, fall: bouncing_sphere.Fall) -> Array:
    r"""Mean history force of every step by quadrature, with time counted as the package counts it (n,) [N].

    .. math:: F = 3\pi\eta d\,A(t)\int g\Bigl(\int_\tau^t\frac{ds}{t_c}\Bigr)\,dw(\tau)

    times  ends of steps of any length (n + 1,) [s]
    slips  along one direction at these times, linear between them (n + 1,) [m/s]
    """
    diameter, lasting, change = 2.0 * fall.radius, np.diff(times), np.diff(slips)
    scale = np.array([decay_time(max(abs(slip), 1e-9), diameter, fall.kinematic_viscosity) for slip in slips[:-1]])
    elapsed = np.append(0.0, np.cumsum(lasting / scale))
    places, weights = np.polynomial.legendre.leggauss(12)
    forces = np.zeros(len(change))
    for n, (begin, end) in enumerate(pairwise(elapsed)):
        for place, weight in zip(0.5 * (places + 1.0), 0.5 * weights):
            # the square of a place has most points where the step itself begins to act
            own = _integral((end - begin) * place**2) * 2.0 * place * change[n] / (end - begin)
            memory = _integral(begin + (end - begin) * place - elapsed[: n + 1])
            forces[n] += weight * (own - (np.diff(memory) / np.diff(elapsed[: n + 1])) @ change[:n])
    amplitude = np.array([basset(time, 0.0, diameter, fall.kinematic_viscosity) for time in scale])
    return 3.0 * math.pi * fall.viscosity * diameter * amplitude * forces


def oscillating(frequency: float, amplitude: float = 0.8, steps: int = 3000) -> Motion:
    """A mean slip of 0.05 m/s and an oscillation along it, five periods.

    frequency  angular, times t_c of the mean slip [-]
    amplitude  over the mean slip [-]
    """
    mean, still = 0.05, Motion(np.zeros((1, 3)), 0.0)
    phase = np.linspace(0.0, 10.0 * math.pi, steps + 1)
    slips = np.zeros((steps + 1, 3))
    slips[:, 2] = mean * (1.0 + amplitude * np.sin(phase))
    step = float(phase[1]) / frequency * decay_time(mean, still.diameter, still.kinematic)
    return still._replace(slips=slips, step=step)


def agitated(seed: int = 1, steps: int = 2000) -> Motion:
    """A mean slip w of 0.05 m/s and random fluctuations of two times, as in a bed with agitation.

    Variance 0.09 w^2 along and 0.055 w^2 across the mean, correlation time 1.27 d/w, as in the law `free_spheres`. A
    second time, a tenth of the first, makes the acceleration finite; 40 correlation times.
    """
    mean, still = 0.05, Motion(np.zeros((1, 3)), 0.0)
    long = 1.27 * still.diameter / mean
    short, step = 0.1 * long, 40.0 * long / steps
    draws = np.random.default_rng(seed).normal(size=(steps, 3))
    # the variance of the smooth motion is that of the rough one times long/(long + short)
    spread = mean * np.sqrt(np.array([0.055, 0.055, 0.09]) * (1.0 + short / long))
    kept, near = math.exp(-step / long), math.exp(-step / short)
    rough, smooth = np.zeros(3), np.zeros((steps + 1, 3))
    for n, draw in enumerate(draws):
        rough = kept * rough + math.sqrt(1.0 - kept**2) * spread * draw
        smooth[n + 1] = near * smooth[n] + (1.0 - near) * rough
    return still._replace(slips=smooth + np.array([0.0, 0.0, mean]), step=step)
