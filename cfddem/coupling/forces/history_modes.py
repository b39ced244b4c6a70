r"""The memory of each particle as a sum of exponentials, and the loop that advances it.

Mode k is :math:`p_k = b_k\int e^{-b_k(t-\tau)/t_c}\,dw`. If the slip changes steadily it tends to the change of the
slip in a time t_c, all the faster the larger its rate. A mode that fades completely in every step equals this change:
it is neither kept nor summed, and a particle keeps the slow modes alone.

How much of each mode fades in a step depends on the step over t_c alone. It is tabulated, and interpolated linearly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, threaded
from cfddem.backend.law_set import Slot
from cfddem.fluid.grid import Array
from cfddem.particles.vectors import NOTHING, minus, of_row, times
from closures.history import RATE_RATIO, basset

FIRST, LAST = -20, 11
"""The table reaches over steps of 2^FIRST to 2^LAST t_c."""

SLOWEST, FASTEST = 2.0**-FIRST, 2.0**-LAST
"""t_c over the step, at most and at least: a slower or faster memory is cut to this."""

ROWS = 64
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


class Surroundings(NamedTuple):
    """Each particle and the flow around it, as the loop takes them."""

    slip: Array  # (N, 3) [m/s]
    drag: Array  # conductance (N,) [kg/s]
    inertia: Array  # (N,) [kg]
    time: Array  # t_c (N,) [s]
    stokes: Array  # force of the memory per slip, with the kernel at t_c (N,) [kg/s]


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
    conductance, stiffness = max(both - drag, 0.0), time * both
    given = conductance * (1.0 + stiffness) / (2.0 + stiffness)
    return conductance, growth / given if given > 0.0 else 1.0


@inline
def _row(time):
    """Row of the table before a step over t_c, and how far the step is from it to the next row."""
    mantissa, exponent = math.frexp(time)
    place = (2.0 * mantissa - 1.0) * ROWS
    row = (exponent - 1 - FIRST) * ROWS + int(place)
    if row < 0:
        return 0, 0.0
    if row >= (LAST - FIRST) * ROWS:
        return (LAST - FIRST) * ROWS - 1, 1.0
    return row, place - math.floor(place)


@inline
def _second(kernel, place):
    """Second integral of the kernel over a step, over the square of the step."""
    row, part = place
    return kernel.second[row] + part * (kernel.second[row + 1] - kernel.second[row])


@inline
def _advance(kernel, modes, gain, last, now):
    """Advance the modes of a particle over the last step; returns their sum in the coming one.

    gain       change of the slip in a time t_c, as in the last step
    last, now  row of the table and part of the way to the next, of the last and of the coming step
    """
    before, until = int(modes[0]), max(kernel.kept[last[0]], kernel.kept[now[0]])
    for k in range(before, until):  # the particle slows down or the step is shorter: more modes than before
        for d in range(3):
            modes[4 + 3 * k + d] = modes[1 + 3 * before + d]
    low, high, part = kernel.fading[now[0]], kernel.fading[now[0] + 1], now[1]
    low_last, high_last, part_last = kernel.fading[last[0]], kernel.fading[last[0] + 1], last[1]
    rest = kernel.rest[until]
    x, y, z = rest * gain[0], rest * gain[1], rest * gain[2]
    for k in range(until):
        fading, here = low[k] + part * (high[k] - low[k]), 1 + 3 * k
        faded = fading
        if last != now:
            faded = low_last[k] + part_last * (high_last[k] - low_last[k])
        along, across, up = modes[here], modes[here + 1], modes[here + 2]
        along += faded * (gain[0] - along)
        across += faded * (gain[1] - across)
        up += faded * (gain[2] - up)
        modes[here], modes[here + 1], modes[here + 2] = along, across, up
        share = fading * kernel.share[k]
        x, y, z = x + share * along, y + share * across, z + share * up
    modes[0] = until
    modes[1 + 3 * until], modes[2 + 3 * until], modes[3 + 3 * until] = gain
    return x, y, z


@threaded
def scales(slip, radius, viscosity, voidage, density, shortest, longest, time, stokes):
    """Time t_c of every particle, and the force of its memory per slip, with the kernel at t_c.

    voidage            by whose inverse the force is larger; empty for 1
    shortest, longest  t_c, to which it is cut [s]
    time, stokes       filled [s], [kg/s]
    """
    for n in prange(len(radius)):
        diameter, kinematic = 2.0 * radius[n], max(viscosity[n], 1e-300) / density
        speed = math.sqrt(slip[n, 0] ** 2 + slip[n, 1] ** 2 + slip[n, 2] ** 2)
        time[n] = max(min(memory_time(speed, diameter, kinematic), longest), shortest)
        scale = 1.0 / voidage[n] if len(voidage) else 1.0
        stokes[n] = scale * 3.0 * math.pi * viscosity[n] * diameter * basset(time[n], speed, diameter, kinematic)


@inline
def _remember_one(memory, around, kernel, step, last_step, n):
    slip, before = of_row(around.slip, n), of_row(memory.before, n)
    time, stokes = around.time[n], around.stokes[n]
    now = _row(step / time)
    growth = stokes * _second(kernel, now)
    conductance, memory.factor[n] = implicit_part(around.drag[n], growth, step / around.inertia[n])
    past, missing = NOTHING, NOTHING
    if last_step > 0.0 and not math.isnan(before[0]):
        change, last, growth_last = minus(slip, before), now, growth
        if last_step != step:
            last = _row(last_step / time)
            growth_last = stokes * _second(kernel, last)
        sum_of_modes = _advance(kernel, memory.modes[n], times(time / last_step, change), last, now)
        past = times(stokes * time / step, sum_of_modes)
        missing = minus(times(last_step * growth_last, change), of_row(memory.newest, n))
    memory.conductance[n] = conductance
    for d in range(3):
        memory.force[n, d] = past[d] + missing[d] / step - conductance * slip[d]
        memory.before[n, d] = slip[d]


@threaded
def remember(memory, around, kernel, step, last_step):
    """Advance the memory of every particle over the last step, and find the force of the coming one."""
    for n in prange(len(around.drag)):
        # in a function: the compiler drops what a parallel loop itself writes through the members of a tuple
        _remember_one(memory, around, kernel, step, last_step, n)


@threaded
def store_impulse(newest, implicit, conductance, factor, slip, step):
    """Impulse that the implicit part of the history force has given every particle."""
    for n in prange(len(conductance)):
        for d in range(3):
            newest[n, d] = step * factor[n] * (implicit[n, d] - conductance[n] * slip[n, d])
