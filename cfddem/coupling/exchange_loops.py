"""Loops of the exchange: what every particle meets, offers and is answered, each in one pass over the particles."""

from __future__ import annotations

import math

from cfddem.fluid.momentum import implicitness
from cfddem.kernels import prange, threaded


@threaded
def meet(seen, volume, radius, velocity, viscosity, winds, own, density, slip, wind, voidage, reynolds, others):
    """Slip, voidage, Reynolds number and number of others around, less what a particle itself makes of them.

    seen    mean velocity of the fluid and solid fraction around each (N, 4) [m/s], [-]
    winds   its own (N, modes, 3) [m/s]
    own     its own part of the solid fraction (N,) [-]; all zeros leaves everything as it is seen
    others  per volume [1/m3]
    wind    its own in what it sees (N, 3) [m/s]
    """
    for n in prange(len(radius)):
        solid = seen[n, 3]
        share = min(max(own[n] / max(solid, 1e-300), 0.0), 1.0)
        others[n] = max(solid - own[n], 0.0) / volume[n]
        voidage[n] = 1.0 - max(solid - share * own[n], 0.0)
        square = 0.0
        for d in range(3):
            blown = 0.0
            for k in range(winds.shape[1]):
                blown += winds[n, k, d]
            wind[n, d] = share * blown
            slip[n, d] = seen[n, d] - wind[n, d] - velocity[n, d]
            square += slip[n, d] * slip[n, d]
        reynolds[n] = density * 2.0 * radius[n] * voidage[n] * math.sqrt(square) / max(viscosity[n], 1e-300)


@threaded
def promise(drag, inverse_inertia, other, velocity, wind, step, resistance, target, carried):
    r"""b*, v* and what a particle hands to the fluid: b* and b* v*.

    drag             b (N,) [kg/s]
    inverse_inertia  1/m, with the added mass in m (N,) [1/kg]
    other            mean of all other forces (N, 3) [N]
    carried          (N, 4) [kg/s], [N]
    """
    for n in prange(len(drag)):
        stiffness = step * drag[n] * inverse_inertia[n]
        theta = implicitness(stiffness)
        resistance[n] = drag[n] / (1.0 + theta * stiffness)
        carried[n, 0] = resistance[n]
        for d in range(3):
            target[n, d] = velocity[n, d] + wind[n, d] + theta * step * inverse_inertia[n] * other[n, d]
            carried[n, 1 + d] = resistance[n] * target[n, d]


@threaded
def other_force(memory, velocity, inertia, last_step, force):
    """Mean over the step before of all forces but drag (N, 3) [N]; none where nothing moves a particle."""
    for n in prange(len(memory)):
        for d in range(3):
            gained = inertia[n] * (velocity[n, d] - memory[n, d]) if math.isfinite(inertia[n]) else 0.0
            force[n, d] = (gained - memory[n, 3 + d]) / last_step


@threaded
def press(volume, before, between, now, force):
    """Force (N, 3) [N] of the pressure gradients [Pa/m] seen from the last three places, by the weights of their
    voidage."""
    for n in prange(len(volume)):
        for d in range(3):
            force[n, d] = -volume[n] * (0.25 * before[n, d] + 0.5 * between[n, d] + 0.25 * now[n, d])


@threaded
def settle(
    seen, resistance, target, pressure, explicit, volume, mass, density, gravity, velocity, slip, step,
    memory, drag, applied, force,
):  # fmt: skip
    """What the fluid has done to every particle becomes the force on it, and is remembered.

    seen  W and W u_d of the cells around each (N, 6)
    """
    for n in prange(len(memory)):
        for d in range(3):
            drag[n, d] = resistance[n] * (seen[n, 3 + d] - seen[n, d] * target[n, d])
            now = (
                drag[n, d]
                + pressure[n, d]
                + (mass[n] - density * volume[n]) * gravity[d]  # weight and buoyancy
                + explicit[n, d]
            )
            memory[n, d] = velocity[n, d]
            memory[n, 3 + d] = step * drag[n, d]
            memory[n, 6 + d] = slip[n, d] + velocity[n, d]
            force[n, d] += now - applied[n, d]  # the sum of forces at hand changes by as much
            applied[n, d] = now
