r"""Implicit transfer of one quantity between particles and the cells of a fluid: momentum, heat, a species.

A particle with the value :math:`v` and the capacity :math:`C` exchanges the quantity with a fluid of value :math:`u`
through the conductance :math:`b`, and receives :math:`f` from everything else:

.. math:: C\,\dot v = b\,(u - v) + f

| quantity | value | capacity | conductance |
|---|---|---|---|
| momentum | velocity | mass, with added mass [kg] | drag over slip [kg/s] |
| heat | temperature | heat capacity m c [J/K] | heat transfer coefficient times surface h A [W/K] |

**Implicit on both sides.** Over a step h the particle receives

.. math:: J = h\,b^*(u - v^*),\qquad b^* = \frac{b}{1+\theta\lambda},\quad v^* = v + \theta\frac{hf}{C},\quad
          \lambda = \frac{hb}{C},\quad \theta=\frac{1+\lambda}{2+\lambda}

which is of second order for small lambda and never passes the value of the fluid for large lambda. f is the mean over
the step before. The fluid takes b* and v* into its own implicit step. What it has given in each cell is returned to
the particles by the weights of the deposit. So the sum over particles is the opposite of the sum over cells to
round-off, for any stiffness of either side.

**Resistance that depends on direction.** A particle has the resistance B = b + T: a conductance b, the same in every
direction, and a symmetric tensor T. Over a step it receives what is given above, in each principal direction with the
resistance there. With :math:`\Lambda = hB/C`,

.. math:: J = h\,B\,D^{-1}\left[(2+\Lambda)(u-v) - (1+\Lambda)\frac{hf}{C}\right],\qquad D = 2 + 2\Lambda + \Lambda^2

The cells know one conductance for each axis, the sum of the sizes along a row of B, which in no direction is below it.
Where the principal directions are axes, as beside a floor, these are the resistances themselves, and fluid and
particle are implicit in each axis on its own. Elsewhere the force is that at the velocity u of the fluid that is
foreseen: that before the step and half of the change du of the last one, since drag sees the mean of a heavy fluid over
the step. What else the fluid changes acts through the conductances b* of the axes, so that it stays stable. Its change
in this step is du', with

.. math:: m\,du' = F - \tfrac12 b^*\,du' + \tfrac12 (b^* - B^*)\,du

for fluid of the mass m (over h) and a force F. So du' settles where the fluid feels B* alone, by a factor
(b* - B*)/(2m + b*) in each step. A light fluid, whose drag sees more of du', keeps a part of the excess.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, threaded
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import Slot, bind_arguments, specialise
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.fluid.grid import Array
from cfddem.fluid.momentum import implicitness
from cfddem.model.fields import Field, Table
from cfddem.particles.state import Particles
from cfddem.particles.vectors import NOTHING, minus, of_row, plus, solved, through, times
from closures.kinds import HEAT_ARGUMENTS
from closures.registry import Law


class ImplicitCoefficients(NamedTuple):
    """Implicit coefficients of one step, of the particles and summed over cells."""

    step: float  # [s]
    implicit: Array  # b* (N, 1), or along each axis (N, 3)
    target: Array  # v* (N, m)
    cell_conductance: Array  # sum of b* per volume (nz, ny, nx), or along each axis (nz, ny, nx, 3)
    cell_product: Array  # sum of b* v* likewise (nz, ny, nx, m)
    cell_source: Array | None = None  # sum of what is given beside, likewise (nz, ny, nx, k)


@dataclass
class Transfer:
    """Transfer of one quantity between particles and cells.

    kernel       deposits the coefficients and gathers the field of the fluid
    value        field of the particles that relaxes towards the fluid: "velocity", "temperature"; (N, m) or (N,)
    received     name of the field that stores what each particle received in the last step, and its unit
    capacity     particles -> C (N,), infinite where the value is held
    source       particles -> f in the first step, (N, m); zero if None
    """

    kernel: FilterKernel
    value: str
    received: tuple[str, str]
    capacity: Callable[[Particles], Array]
    source: Callable[[Particles], Array] | None = None
    last_step: float = 0.0  # length of the step before; 0 before the first [s]

    def declare(self, particles: Particles) -> list[str]:
        """Declare what the transfer stores of each particle: the value before the last step, and what it received.

        returns  names of these fields
        """
        stored = memory_of(particles.fields[self.value], self.received)
        for field in stored:
            particles.declare(field)
        return [field.name for field in stored]

    @property
    def before(self) -> str:
        """Name of the field with the value before the last step."""
        return before(self.value)

    def prepare(
        self,
        particles: Particles,
        cell_map: ParticleCellMap,
        conductance: Array,
        step: float,
        disturbance: Array | None = None,
        source: Array | None = None,
        directions: Directions | None = None,
    ) -> ImplicitCoefficients:
        """Coefficients of the coming step [s].

        conductance  b (N,)
        disturbance  part of the fluid's value that the particle causes itself, not part of u (N, m); zero if None
        source       what every particle gives to the fluid beside (N, k); nothing if None
        directions   how the resistance depends on direction; None if it does not
        """
        kernel, value = self.kernel, columns(particles[self.value])
        disturbance = _or_zero(disturbance, value)
        implicit, target, carried = implicit_coefficients(
            conductance, self.capacity(particles), value, disturbance, self._last(particles, value), step, directions
        )
        if source is not None:
            carried = np.concatenate([carried, source], axis=1)
        cells = kernel.spread(cell_map, carried) / kernel.grid.cell_volume
        axes = implicit.shape[1]
        parts = np.split(cells, [axes, axes + value.shape[1]])
        sent, product, beside = (np.moveaxis(part, 0, -1) for part in parts)
        cell_source = None if source is None else np.ascontiguousarray(beside)
        return ImplicitCoefficients(step, implicit, target, sent if axes > 1 else cells[0], product, cell_source)

    def apply(
        self, particles: Particles, cell_map: ParticleCellMap, sent: ImplicitCoefficients, weight: Array, value: Array
    ) -> Array:
        """Return the rate at which each particle receives the quantity in this step (N, m), and store it.

        sent    what `prepare` returned
        weight  W: the cell has given W h (b* v* - b* u) per volume (nz, ny, nx, m) [-]
        value   u, the value of the fluid in its implicit step (nz, ny, nx, m)
        """
        fields = np.concatenate([np.moveaxis(field, -1, 0) for field in (weight, weight * value)])
        return self.receive(particles, sent, self.kernel.sample(cell_map.stencil, cell_map.radius, fields))

    def receive(self, particles: Particles, sent: ImplicitCoefficients, gathered: Array) -> Array:
        """As `apply`, from the means of W and W u around every particle (N, 2 m); further columns are not used."""
        value = columns(particles[self.value])
        rate = np.empty(value.shape)
        before, received = (columns(particles[name]) for name in (self.before, self.received[0]))
        _receive(gathered, sent.implicit, sent.target, sent.step, value, rate, before, received)
        self.last_step = sent.step
        return rate

    def _last(self, particles: Particles, value: Array) -> tuple[Array, Array, float]:
        """Value before the last step (N, m), what it received (N, m) and the length of that step [s]."""
        if self.last_step == 0.0:
            return after_source(value, _or_zero(None if self.source is None else self.source(particles), value))
        return columns(particles[self.before]), columns(particles[self.received[0]]), self.last_step


def before(value: str) -> str:
    """Name of the field with the value before the last step."""
    return f"{value}_before"


def memory_of(field: Field, received: tuple[str, str]) -> tuple[Field, Field]:
    """What a transfer stores of each particle: the value of its field before the last step, and what it received.

    received  name of the second field, and its unit
    """
    name, unit = received
    meaning = f"{field.meaning or field.name} before the last fluid step"
    return (
        Field(before(field.name), field.unit, field.components, "memory", _present(field.name), meaning=meaning),
        Field(name, unit, field.components, "memory", meaning="received from the fluid in the last fluid step"),
    )


def after_source(value: Array, source: Array) -> tuple[Array, Array, float]:
    """The last step of `implicit_coefficients`, as if a source (N, m) alone had acted in it, for a second."""
    return value, -source, 1.0


@cache
def _present(name: str) -> Callable[[Table, np.ndarray], np.ndarray]:
    """The present value of another field, as initial value of a field; the same function for the same name."""
    return lambda table, rows: table[name][rows]


def columns(values: Array) -> Array:
    """Values of the particles as (N, m), a view; a rank may hold no particle."""
    return values.reshape(len(values), math.prod(values.shape[1:]))


def _or_zero(values: Array | None, like: Array) -> Array:
    return np.zeros_like(like) if values is None else values


def implicit_coefficients(
    conductance: Array,
    capacity: Array,
    value: Array,
    disturbance: Array,
    last: tuple[Array, Array, float],
    step: float,
    directions: Directions | None = None,
) -> tuple[Array, Array, Array]:
    """b* (N, 1), v* (N, m), and what each particle deposits: b* and b* v* (N, 1 + m).

    Where the resistance depends on direction, b* is one for each axis (N, 3).

    last        value before the last step (N, m), what the transfer gave in it (N, m), and its length [s]
    directions  how the resistance depends on direction; None if it does not
    """
    axes = conductance[:, None] if directions is None else by_axis(conductance, directions.tensor)
    coefficients = np.empty(axes.shape), np.empty(value.shape), np.empty((len(value), axes.shape[1] + value.shape[1]))
    _implicit_coefficients(axes, capacity, value, disturbance, last, step, coefficients)
    if directions is not None:
        aim_by_direction(directions, conductance, axes, capacity, step, (value, disturbance), coefficients)
    return coefficients


@threaded
def _implicit_coefficients(conductance, capacity, value, disturbance, last, step, coefficients):
    """Write b*, v*, and what each particle deposits, as coefficients; conductances are (N, 1), or one for each axis.

    f is the change of the quantity over the last step, less what the transfer gave, per time; held values change
    nothing.
    """
    for n in prange(len(conductance)):
        _implicit_one(n, conductance, capacity, value, disturbance, last, step, coefficients)


@inline
def _implicit_one(n, conductance, capacity, value, disturbance, last, step, coefficients):
    """`_implicit_coefficients` of one particle."""
    (before, received, last_step), (implicit, target, carried) = last, coefficients
    inverse, is_fixed, axes = 1.0 / capacity[n], not math.isfinite(capacity[n]), conductance.shape[1]
    for d in range(value.shape[1]):
        along = min(d, axes - 1)
        stiffness = step * conductance[n, along] * inverse
        theta = implicitness(stiffness)
        implicit[n, along] = conductance[n, along] / (1.0 + theta * stiffness)
        carried[n, along] = implicit[n, along]
        gained = 0.0 if is_fixed else capacity[n] * (value[n, d] - before[n, d])
        other = (gained - received[n, d]) / last_step
        target[n, d] = value[n, d] + disturbance[n, d] + theta * step * inverse * other
        carried[n, axes + d] = implicit[n, along] * target[n, d]


@threaded
def _receive(gathered, implicit, target, step, value, rate, before, received):
    """Rate b* (W u - W v*) of every particle, and what is stored until the next step.

    gathered  W and W u around each particle (N, 2 m)
    """
    components, axes = target.shape[1], implicit.shape[1]
    for n in prange(len(target)):
        for d in range(components):
            rate[n, d] = implicit[n, min(d, axes - 1)] * (gathered[n, components + d] - gathered[n, d] * target[n, d])
            before[n, d] = value[n, d]
            received[n, d] = step * rate[n, d]


# ---------------------------------------------------------------- the number of a law of transfer


exchange_number = Slot("exchange_number")


class ExchangeLaw:
    """Evaluates a law of heat transfer for all particles.

    outside  how often it was evaluated outside its range, on this rank
    """

    def __init__(self, law: Law) -> None:
        self.law, self.outside = law, 0
        number = bind_arguments(law.function, ", ".join(HEAT_ARGUMENTS), {name: name for name in HEAT_ARGUMENTS})
        self._loop = specialise(_numbers, {"exchange_number": number})
        self._ranges = np.array([law.ranges.get(name, (-math.inf, math.inf)) for name in HEAT_ARGUMENTS])

    def numbers(self, flow: SampledFlow, prandtl: Array) -> Array:
        """Nusselt number of every particle (N,) [-].

        prandtl  Prandtl number of the fluid around each, or Schmidt number (N,) [-]
        """
        numbers = np.empty(len(flow.reynolds))
        outside, wrong = self._loop(flow.reynolds, prandtl, flow.voidage, self._ranges, numbers)
        self.outside += int(outside)
        if wrong and np.isfinite(flow.reynolds).all():  # local: every rank has its own particles
            n = int(np.argmin(np.isfinite(numbers) & (numbers >= 0.0)))  # local: the first on this rank
            at = f"it is {numbers[n]:.3g} at Re = {flow.reynolds[n]:.3g}, voidage = {flow.voidage[n]:.3g}"
            raise InputError("laws.heat_transfer", self.law.name, "a law that is finite and not negative", at)
        return numbers


@threaded
def _numbers(reynolds, prandtl, voidage, ranges, numbers):
    """Number of every particle; returns how many states are outside the range, how many numbers negative or NaN."""
    outside = wrong = 0
    for n in prange(len(reynolds)):
        number = exchange_number(reynolds[n], prandtl[n], voidage[n])
        numbers[n] = number
        beyond = reynolds[n] < ranges[0, 0] or reynolds[n] > ranges[0, 1]
        beyond = beyond or prandtl[n] < ranges[1, 0] or prandtl[n] > ranges[1, 1]
        outside += 1 if beyond or voidage[n] < ranges[2, 0] or voidage[n] > ranges[2, 1] else 0
        wrong += 0 if number >= 0.0 and number < math.inf else 1
    return outside, wrong


# ---------------------------------------------------------------- resistance that depends on direction


class Directions(NamedTuple):
    """How the resistance of every particle depends on direction."""

    tensor: Array  # resistance beside the conductance, symmetric (N, 3, 3) [kg/s]
    slip: Array  # foreseen u less v before the step, with all that acts through the resistance (N, 3) [m/s]


def by_axis(conductance: Array, tensor: Array) -> Array:
    """Conductance along each axis that in no direction is below the resistance (N, 3) [kg/s]."""
    others = np.abs(tensor)
    for axis in range(3):
        others[:, axis, axis] = tensor[:, axis, axis]
    return np.asarray(conductance[:, None] + (others[..., 0] + others[..., 1] + others[..., 2]))


def slip_of(force: Array, conductance: Array, tensor: Array) -> Array:
    """Slip at which the resistance has these forces; zero where there is none (N, 3) [m/s]."""
    slip = np.empty_like(force)
    _slip_of(force, conductance, tensor, slip)
    return slip


def implicit_force(slip: Array, conductance: Array, tensor: Array, capacity: Array, step: float) -> Array:
    """Implicit force of the resistance at a slip alone (N, 3) [N]."""
    force = np.empty_like(slip)
    _implicit_force(slip, conductance, tensor, capacity, step, force)
    return force


@inline
def _resistance(conductance, tensor, n):
    """Rows of the resistance of a particle."""
    b, more = conductance[n], tensor[n]
    return (
        (b + more[0, 0], more[0, 1], more[0, 2]),
        (more[1, 0], b + more[1, 1], more[1, 2]),
        (more[2, 0], more[2, 1], b + more[2, 2]),
    )


@threaded
def _slip_of(force, conductance, tensor, slip):
    for n in prange(len(force)):
        resists = conductance[n] + tensor[n, 0, 0] + tensor[n, 1, 1] + tensor[n, 2, 2] > 0.0
        acting = solved(_resistance(conductance, tensor, n), of_row(force, n)) if resists else NOTHING
        slip[n, 0], slip[n, 1], slip[n, 2] = acting


@inline
def _denominator(matrix):
    """2 + 2 M + M^2 of a symmetric matrix."""
    x = plus(times(2.0, matrix[0]), through(matrix, matrix[0]))
    y = plus(times(2.0, matrix[1]), through(matrix, matrix[1]))
    z = plus(times(2.0, matrix[2]), through(matrix, matrix[2]))
    return (x[0] + 2.0, x[1], x[2]), (y[0], y[1] + 2.0, y[2]), (z[0], z[1], z[2] + 2.0)


@inline
def _force(n, slip, gain, conductance, tensor, share):
    """Mean force over the step; gain is h f/C, and share h/C."""
    resistance = _resistance(conductance, tensor, n)
    stiffness = times(share, resistance[0]), times(share, resistance[1]), times(share, resistance[2])
    change = minus(slip, gain)
    wanted = plus(plus(slip, change), through(stiffness, change))
    return through(resistance, solved(_denominator(stiffness), wanted))


@threaded
def _implicit_force(slip, conductance, tensor, capacity, step, force):
    for n in prange(len(slip)):
        mean = _force(n, of_row(slip, n), NOTHING, conductance, tensor, step / capacity[n])
        force[n, 0], force[n, 1], force[n, 2] = mean


@threaded
def aim_by_direction(directions, conductance, axes, capacity, step, begin, coefficients):
    """Change v* so that the particle receives by direction what it does, see above.

    axes          of `by_axis` (N, 3)
    begin         v and disturbance (N, 3)
    coefficients  b*, v*, and b* and b* v* of `implicit_coefficients` for the conductances along the axes
    """
    for n in prange(len(conductance)):
        _aim_one(n, directions, conductance, axes, capacity, step, begin, coefficients)


@inline
def _aim_one(n, directions, conductance, axes, capacity, step, begin, coefficients):
    (value, disturbance), (implicit, target, carried) = begin, coefficients
    share, slip = step / capacity[n], of_row(directions.slip, n)
    start = plus(of_row(value, n), of_row(disturbance, n))
    ahead, along = minus(of_row(target, n), start), of_row(axes, n)
    gain = (
        ahead[0] / implicitness(share * along[0]),
        ahead[1] / implicitness(share * along[1]),
        ahead[2] / implicitness(share * along[2]),
    )  # h f/C
    force = _force(n, slip, gain, conductance, directions.tensor, share)
    for d in range(3):
        target[n, d] = start[d] + slip[d] - force[d] / max(implicit[n, d], 1e-300)
        carried[n, 3 + d] = implicit[n, d] * target[n, d]
