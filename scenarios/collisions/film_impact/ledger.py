r"""Energy of an impact: what bead and liquid have, and what each step takes from them.

The losses are those of the discrete equations. The pressure's work on the liquid is that on the bead with the other
sign. With u* before the pressure and u after it, and the mass of liquid m_f of a face, the kinetic energy falls by

.. math:: \tfrac12\sum_f m_f (u^*-u)^2 + \tfrac12 m (V^*-V)^2 + \sum_f m_f (1/b_f - 1)\,u^2

The first two are of impulses: of sudden changes, above all where the liquid has to turn with the bead. The last is that
of thin gaps. What particles and grid lose in exchange is the error of the method.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cfddem.backend.compile import serial
from scenarios.collisions.film_impact.pressure import distance


@dataclass
class Losses:
    """Energy taken so far [J]."""

    contact: float = 0.0
    viscous: float = 0.0  # resolved stress and thin gaps
    impulsive: float = 0.0
    exchange: float = 0.0  # between particles and grid
    voids: float = 0.0  # stored in voids of a liquid that cavitates
    surface: float = 0.0  # stored in the surface by its tension

    @property
    def total(self) -> float:
        """All losses [J]."""
        return self.contact + self.viscous + self.impulsive + self.exchange + self.voids + self.surface


@serial
def kinetic_energy(flow, cells, opening):
    """Kinetic energy of the flow on the faces of liquid cells [J].

    flow, opening  velocity and open fraction of faces, each `Faces`
    cells          `Cells`
    """
    (u, w), (open_u, open_w), (liquid, filled, dx, outer_open, density) = flow, opening, cells
    radial, vertical = liquid.shape
    energy = 0.0
    for i in range(1, radial + (1 if outer_open else 0)):
        for j in range(vertical):
            mass = 2.0 * math.pi * i * dx**3 * open_u[i, j] * _length(filled, liquid, i - 1, j, i, j)
            energy += 0.5 * density * mass * u[i, j] ** 2
    for i in range(radial):
        for j in range(1, vertical + 1):
            mass = math.pi * dx**3 * (2.0 * i + 1.0) * open_w[i, j] * _length(filled, liquid, i, j - 1, i, j)
            energy += 0.5 * density * mass * w[i, j] ** 2
    return energy


@serial
def _length(filled, liquid, i, j, k, m):
    """Length of liquid across a face, in cells; 0 where neither side is liquid."""
    if liquid[i, j]:
        return distance(filled, liquid, i, j, k, m)
    if k < liquid.shape[0] and m < liquid.shape[1] and liquid[k, m]:
        return distance(filled, liquid, k, m, i, j)
    return 0.0


@serial
def pressure_losses(flow, before, mobility, cells, opening):
    """Losses of the pressure step: of impulses, and of thin gaps [J]. `before` is the flow before it."""
    (u, w), (before_u, before_w), (open_u, open_w) = flow, before, opening
    liquid, filled, dx, outer_open, density = cells
    radial, vertical = liquid.shape
    impulsive, viscous = 0.0, 0.0
    for i in range(1, radial + (1 if outer_open else 0)):
        for j in range(vertical):
            mass = density * 2.0 * math.pi * i * dx**3 * open_u[i, j] * _length(filled, liquid, i - 1, j, i, j)
            impulsive += 0.5 * mass * (u[i, j] - before_u[i, j]) ** 2
            viscous += mass * (1.0 / mobility[i, j] - 1.0) * u[i, j] ** 2
    for i in range(radial):
        for j in range(1, vertical + 1):
            mass = density * math.pi * dx**3 * (2.0 * i + 1.0) * open_w[i, j]
            mass *= _length(filled, liquid, i, j - 1, i, j)
            impulsive += 0.5 * mass * (w[i, j] - before_w[i, j]) ** 2
    return impulsive, viscous


def while_turning(before: float, after: float, impulsive: float) -> tuple[float, float]:
    r"""Kinetic energy of the liquid at its least during an impulse, and after it, over that before [-].

    The velocity changes in proportion to the part s of the impulse that has passed, so that the energy is

    .. math:: K(s) = K_0 + s\,(K_1 - K_0 - C) + s^2 C

    with the energies K before and after, and the loss C of the impulse in the liquid [J].
    """
    if before <= 0.0 or impulsive <= 0.0:
        return math.nan, math.nan
    s = min(max(0.5 * (impulsive + before - after) / impulsive, 0.0), 1.0)
    return (before + s * (after - before - impulsive) + s * s * impulsive) / before, after / before


@serial
def particle_energy(particles, volume, density, gravity):
    """Kinetic and potential energy of the liquid, and its vertical momentum, from the particles [J, J, kg m/s]."""
    kinetic, potential, momentum = 0.0, 0.0, 0.0
    for n in range(len(particles)):
        mass = density * volume[n]
        kinetic += 0.5 * mass * (particles[n, 2] ** 2 + particles[n, 3] ** 2)
        potential += mass * gravity * particles[n, 1]
        momentum += mass * particles[n, 3]
    return kinetic, potential, momentum
