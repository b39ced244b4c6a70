r"""History force: the memory of the flow around each particle of its earlier acceleration.

With the slip :math:`w = u - v` and a kernel :math:`K = A\,g(s/t_c)` of :mod:`closures.history`,

.. math:: F_h = 3\pi\eta d\int_{-\infty}^t K(t-\tau)\,\dot w\,d\tau

**Constant memory.** g is a sum of exponentials, :math:`g(x) = \sum_k a_k e^{-b_kx}`. Each has a mode, which decays and
grows with the change of the slip in every step: :math:`p_k = b_k\int e^{-b_k(t-\tau)/t_c}\,dw`. Rates scale with t_c
at the present slip; for the kernel of Basset t_c is d^2/nu.

If the slip changes steadily a mode tends to the change of the slip in a time t_c, all the faster the larger its rate. A
mode that fades completely in every step equals this change: it is neither kept nor summed, and a particle keeps the
slow modes alone. How much of each mode fades in a step depends on the step over t_c alone. It is tabulated, and
interpolated linearly.

**One step.** The slip changes steadily in a step h. The mean force over the step is

.. math:: \bar F_h = B\,(w' - w) + \sum_k\ldots p_k,\qquad B = 3\pi\eta d\,A\,\frac{H(h/t_c)}{(h/t_c)^2}

with w' the slip at the end and H the second integral of g, exact for the step itself. The first part is implicit: it
joins the conductance of the drag (:mod:`cfddem.coupling.transfer`). A contact can change the velocity by more than the
implicit part predicts; the missing impulse is applied in the next step.

There is no kernel for suspensions in the literature: every particle has that of a single sphere in the flow around it.
A particle begins without memory where it is inserted.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import fused, inline, prange, threaded, vector_part
from cfddem.backend.law_set import Slot, specialise
from cfddem.coupling.sampled_flow import SampledFlow, Seen
from cfddem.coupling.terms import ForceTerms
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles
from cfddem.particles.vectors import NOTHING, minus, of_row, plus, times
from closures.history import (
    BASSET_AMPLITUDES,
    BASSET_MISSING,
    BASSET_SLOWEST,
    MEI_ADRIAN_AMPLITUDES,
    MEI_ADRIAN_MISSING,
    MEI_ADRIAN_SLOWEST,
    RATE_RATIO,
    basset,
    decay_time,
)

FIRST, LAST = -20, 11
"""The table reaches over steps of 2^FIRST to 2^LAST t_c."""

SLOWEST, FASTEST = 2.0**-FIRST, 2.0**-LAST
"""t_c over the step, at most and at least: a slower or faster memory is cut to this."""

ROW_BITS = 6
ROWS = 1 << ROW_BITS
"""Rows of the table between a step and twice this step."""

COMPLETE = 1.0 - 1e-3
"""A mode of which this share fades in a step is not kept."""

memory_time = Slot("memory_time")


class Exponentials(NamedTuple):
    """Sum of exponentials of a kernel, as compiled loops take it; times are over t_c."""

    fading: Array  # share of each mode that fades in a step (rows, modes)
    second: Array  # second integral of the kernel over a step, over the square of the step (rows,)
    kept: Array  # how many modes a step leaves incomplete (rows,)
    share: Array  # amplitude over the square of the rate (modes,)
    rest: Array  # sum of the shares from a mode on; one more than there are modes


def exponentials(amplitudes: tuple[float, ...], slowest: float, missing: float) -> Exponentials:
    """Table of a sum of exponentials whose rates are `RATE_RATIO` apart.

    missing  integral of the kernel that the exponentials lack near 0
    """
    rates = slowest * RATE_RATIO ** np.arange(len(amplitudes), dtype=float)
    share = np.array(amplitudes) / rates**2
    octaves = 2.0 ** np.arange(FIRST, LAST)
    steps = np.append(np.outer(octaves, 1.0 + np.arange(ROWS) / ROWS), 2.0**LAST)
    fading = -np.expm1(-np.outer(steps, rates))
    second = ((np.outer(steps, rates) - fading) @ share + missing * steps) / steps**2
    kept = (fading < COMPLETE).sum(axis=1)  # local: of the modes of a kernel
    return Exponentials(fading, second, kept, share, np.append(np.cumsum(share[::-1])[::-1], 0.0))


def columns(kernel: Exponentials) -> int:
    """Numbers that a particle remembers: how many modes it keeps, their components, and those of a mode not kept."""
    return 1 + 3 * (len(kernel.share) + 1)


class Memory(NamedTuple):
    """Memory and history force of all particles, as the loop takes them."""

    before: Array  # slip in the last step (N, 3) [m/s]
    newest: Array  # impulse of the implicit part in the last step (N, 3) [N s]
    modes: Array  # (N, columns)
    conductance: Array  # of the implicit part (N,) [kg/s]
    force: Array  # explicit part (N, 3) [N]
    factor: Array  # of the impulse of the implicit part, see `implicit_part` (N,)


class Scales(NamedTuple):
    """Scales of the memory of some particles, and their places in the table of the coming step."""

    time: Array  # t_c (n,) [s]
    stokes: Array  # force of the memory per slip, with the kernel at t_c (n,) [kg/s]
    row: np.ndarray  # of the table (n,)
    part: Array  # of the way to the next row (n,)
    growth: Array  # B, force per change of the slip in the step (n,) [kg/s]


class Place(NamedTuple):
    """Place in the table of a step over t_c."""

    row: int
    part: float  # of the way to the next row


@inline
def implicit_part(drag, growth, time):
    r"""Conductance of the newest part of the history force, and the factor of its impulse.

    In the transfer the force of a conductance b on the inertia m is that at the share theta = (1 + x)/(2 + x) of the
    step, x = h b/m. Of drag and history together it is to be that of the drag alone at its own share, and the force by
    the growth of the slip: :math:`b\theta = b_d\theta_d + B`. A theta that both share would make the drag of order 1.5,
    because B is of order :math:`h^{-1/2}`.

    drag     conductance of the drag [kg/s]
    growth   B, force per change of the slip in the whole step [kg/s]
    time     h/m; 0 for fixed particles [s/kg]
    returns  conductance [kg/s]; B over the force per change of the slip that the transfer gives this conductance [-]
    """
    stiffness = time * drag
    force = drag * (1.0 + stiffness) / (2.0 + stiffness) + growth
    rest = 1.0 - time * force
    both = 4.0 * force / (rest + math.sqrt(rest * rest + 8.0 * time * force))
    conductance = max(both - drag, 0.0)
    product = conductance * force  # over both: theta of the transfer is force/both
    return conductance, growth * both / product if product > 0.0 else 1.0


_MANTISSA, _UNIT = np.int64(52 - ROW_BITS), 2.0 ** (ROW_BITS - 52)
_REST, _FIRST_ROW = np.int64((1 << (52 - ROW_BITS)) - 1), np.int64((FIRST + 1023) << ROW_BITS)
_LAST_ROW = np.int64((LAST - FIRST) * ROWS - 1)
"""Bits of a number below those of its row; weight of the lowest; their mask; row of the number 0.0 in the table."""


@inline
def _row(time):
    """Row of the table before a step over t_c, and how far the step is from it to the next row.

    Exponent and first bits of the mantissa are the row, the other bits the rest.
    """
    bits = np.float64(time).view(np.int64)
    row = (bits >> _MANTISSA) - _FIRST_ROW
    part = np.float64(bits & _REST) * _UNIT
    inside = 0.0 if row < 0 else part  # no branches: the compiler works on several particles at once
    return min(max(row, np.int64(0)), _LAST_ROW), 1.0 if row > _LAST_ROW else inside


@inline
def _between(table, row, part):
    """Value of a table at a part of the way from a row to the next."""
    return table[row] + part * (table[row + 1] - table[row])


@fused
def _advance(kernel, modes, before, until, gain, last, now, steady):
    """Advance the modes of a particle over the last step; returns their sum in the coming one.

    modes      their components, and those of a mode not kept
    before     number of modes so far
    until      number of modes from now on
    gain       change of the slip in a time t_c, as in the last step
    last, now  `Place` of the last and of the coming step
    steady     whether both are equal
    """
    for k in range(before, until):  # the particle slows down or the step is shorter: more modes than before
        for d in range(3):
            modes[3 + 3 * k + d] = modes[3 * before + d]
    low, high, part, share = kernel.fading[now.row], kernel.fading[now.row + 1], now.part, kernel.share
    low_last, high_last, part_last = kernel.fading[last.row], kernel.fading[last.row + 1], last.part
    x, y, z = NOTHING
    for k in range(until):
        fading, here = low[k] + part * (high[k] - low[k]), 3 * k
        faded = fading if steady else low_last[k] + part_last * (high_last[k] - low_last[k])
        along = modes[here] + faded * (gain[0] - modes[here])
        across = modes[here + 1] + faded * (gain[1] - modes[here + 1])
        up = modes[here + 2] + faded * (gain[2] - modes[here + 2])
        modes[here], modes[here + 1], modes[here + 2] = along, across, up
        left = fading * share[k]
        x, y, z = x + left * along, y + left * across, z + left * up
    modes[3 * until], modes[1 + 3 * until], modes[2 + 3 * until] = gain
    return plus(times(kernel.rest[until], gain), (x, y, z))


PIECE = 512
"""Particles whose scales are found before their memory advances: few enough for the cache."""


@threaded
def advance(flow, drag, inertia, kernel, step, last_step, memory):
    """Advance the memory of every particle over the last step, and find its force in the coming one.

    flow     by the inverse of whose voidage the force is larger
    drag     conductance (N,) [kg/s]
    inertia  (N,) [kg]
    memory   `Memory`, all of it filled but `newest`
    """
    slip, voidage, radius, viscosity, density = flow
    count = len(radius)
    for piece in prange((count + PIECE - 1) // PIECE):
        begin, end = piece * PIECE, min((piece + 1) * PIECE, count)
        here = slice(begin, end)
        room = np.empty((4, end - begin))
        scales = Scales(room[0], room[1], np.empty(end - begin, np.int64), room[2], room[3])
        _times(slip[here], radius[here], viscosity[here], voidage[here], density, step, scales.time, scales.stokes)
        _growths(scales.time, scales.stokes, kernel.second, step, scales.row, scales.part, scales.growth)
        _implicit_parts(drag[here], inertia[here], scales.growth, step, memory.conductance[here], memory.factor[here])
        for n in range(begin, end):
            # in a function: the compiler drops what a parallel loop itself writes through the members of a tuple
            _remember_one(memory, slip, scales, kernel, step, last_step, n, n - begin)


@vector_part
def _times(slip, radius, viscosity, voidage, density, step, time, stokes):
    """Time scale of the memory, and the force of the memory per slip."""
    longest, shortest = step * SLOWEST, step * FASTEST
    for n in range(len(radius)):
        diameter, kinematic = 2.0 * radius[n], max(viscosity[n], 1e-300) / density
        speed = math.sqrt(slip[n, 0] ** 2 + slip[n, 1] ** 2 + slip[n, 2] ** 2)
        scale = 1.0 / voidage[n] if len(voidage) else 1.0
        time[n] = max(min(memory_time(speed, diameter, kinematic), longest), shortest)
        stokes[n] = scale * 3.0 * math.pi * viscosity[n] * diameter * basset(time[n], speed, diameter, kinematic)


@vector_part
def _growths(time, stokes, second, step, row, part, growth):
    """Place in the table, and the force per change of the slip in the step."""
    for n in range(len(time)):
        row[n], part[n] = _row(step / time[n])
        growth[n] = stokes[n] * _between(second, row[n], part[n])


@vector_part
def _implicit_parts(drag, inertia, growth, step, conductance, factor):
    """`implicit_part` of every particle."""
    for n in range(len(drag)):
        conductance[n], factor[n] = implicit_part(drag[n], growth[n], step / inertia[n])


@inline
def _remember_one(memory, slips, scales, kernel, step, last_step, n, place):
    """Advance the modes of one particle, and find its explicit force.

    place  of the particle in `scales`
    """
    slip, before = of_row(slips, n), of_row(memory.before, n)
    past, missing = NOTHING, NOTHING
    if last_step > 0.0 and not math.isnan(before[0]):
        time, stokes, growth_last = scales.time[place], scales.stokes[place], scales.growth[place]
        change, now = minus(slip, before), Place(scales.row[place], scales.part[place])
        last = now
        if last_step != step:
            row, part = _row(last_step / time)
            last, growth_last = Place(row, part), stokes * _between(kernel.second, row, part)
        gain, until = times(time / last_step, change), max(kernel.kept[last.row], kernel.kept[now.row])
        modes, steady = memory.modes[n, 1:], last_step == step
        modes_sum = _advance(kernel, modes, int(memory.modes[n, 0]), until, gain, last, now, steady)
        memory.modes[n, 0] = until
        past = times(stokes * time / step, modes_sum)
        missing = minus(times(last_step * growth_last, change), of_row(memory.newest, n))
    for d in range(3):
        memory.force[n, d] = past[d] + missing[d] / step - memory.conductance[n] * slip[d]
        memory.before[n, d] = slip[d]


@threaded
def store_impulse(newest, implicit, conductance, factor, slip, step):
    """Impulse that the implicit part of the history force has given every particle."""
    for n in prange(len(conductance)):
        for d in range(3):
            newest[n, d] = step * factor[n] * (implicit[n, d] - conductance[n] * slip[n, d])


SLIP = Field(
    "history_slip", "m/s", 3, "memory", np.nan, meaning="fluid velocity less particle velocity in the last fluid step"
)
"""NaN in inserted particles, which have no memory yet."""

NEWEST = Field("history_impulse", "N s", 3, "memory", meaning="implicit part of the history force of the last step")


class HistoryTerms(NamedTuple):
    """History force in one fluid step."""

    conductance: Array  # of the implicit part, as a drag (N,) [kg/s]
    force: Array  # explicit part on every particle, its opposite on the fluid (N, 3) [N]
    factor: Array  # of the impulse of the implicit part (N,) [-]


def _room(count: int) -> HistoryTerms:
    """Arrays for the terms of so many particles."""
    return HistoryTerms(np.empty(count), np.empty((count, 3)), np.empty(count))


@inline
def _diffusion_time(slip, diameter, kinematic_viscosity):
    """Time in which vorticity diffuses over a diameter [s]."""
    return diameter * diameter / kinematic_viscosity


@inline
def _decay_time(slip, diameter, kinematic_viscosity):
    """t_c; infinite without slip [s]."""
    return decay_time(slip, diameter, kinematic_viscosity) if slip > 0.0 else math.inf


_KERNELS = {
    "basset": (exponentials(BASSET_AMPLITUDES, BASSET_SLOWEST, BASSET_MISSING), _diffusion_time),
    "mei_adrian": (exponentials(MEI_ADRIAN_AMPLITUDES, MEI_ADRIAN_SLOWEST, MEI_ADRIAN_MISSING), _decay_time),
}
"""The kernel, and its scale of time t_c."""


class History(FluidForce):
    """History force of the particles.

    kernel   "mei_adrian" or "basset"
    density  of the fluid [kg/m3]
    model    "A" or "B" of the fluid
    """

    name, lines, late = "history", ("history",), True

    def __init__(self, kernel: Literal["mei_adrian", "basset"], density: float, model: str = "A") -> None:
        self.density, self.model = density, model
        self._kernel, scale = _KERNELS[kernel]
        self._modes = Field(
            "history_modes", "m/s", columns(self._kernel), "memory", meaning="changes of the slip, as they fade"
        )
        self.fields = (SLIP, NEWEST, self._modes)
        self._terms = _room(0)
        self._advance = specialise(advance, {"memory_time": scale})

    def act(self, terms: ForceTerms) -> None:
        """Resist the newest change of the slip; the memory of the others pushes."""
        history = self.terms(terms.particles, terms.flow, terms.resistance, terms.inertia, terms.step, terms.last_step)
        terms.resist("history", history.conductance)
        terms.between("history", history.force)

    def end(self, terms: ForceTerms) -> None:
        """Store the impulse of the implicit part."""
        self.store(terms.particles, terms.implicit_force["history"], self._terms, terms.step)

    def terms(
        self, particles: Particles, flow: SampledFlow, drag: Array, inertia: Array, step: float, last_step: float
    ) -> HistoryTerms:
        """History force in the coming fluid step [s].

        drag       conductance of the drag (N,) [kg/s]
        inertia    mass and added mass (N,); infinite for fixed particles [kg]
        last_step  0 at the start [s]
        returns    arrays that the next step overwrites
        """
        if len(self._terms.factor) != particles.count:
            self._terms = _room(particles.count)
        terms = self._terms
        voidage = flow.voidage if self.model == "B" else flow.voidage[:0]
        flow_seen = Seen(flow.slip, voidage, particles.radius, particles.viscosity, float(self.density))
        memory = Memory(particles[SLIP.name], particles[NEWEST.name], particles[self._modes.name], *terms)
        self._advance(flow_seen, drag, inertia, self._kernel, float(step), float(last_step), memory)
        return terms

    def store(self, particles: Particles, implicit: Array, terms: HistoryTerms, step: float) -> None:
        """Store the impulse that the implicit part has given.

        implicit  force of the conductance of the history on every particle (N, 3) [N]
        """
        newest, slip = particles[NEWEST.name], particles[SLIP.name]
        store_impulse(newest, implicit, terms.conductance, terms.factor, slip, float(step))
