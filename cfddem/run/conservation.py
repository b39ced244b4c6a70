"""Conservation of momentum and volume, each counted independently of the step that transfers it.

Momentum that the particles received is summed over particles, momentum that the fluid gave over cells; volume is summed
over the faces of cells. Energy is in :mod:`cfddem.features.energy`.
"""

from __future__ import annotations

import numpy as np

from cfddem.fluid.budgets import continuity_residual, drag_exchange
from cfddem.fluid.solver import FluidSolver
from cfddem.particles.state import Particles


def momentum_imbalance(fluid: FluidSolver, particles: Particles) -> float:
    """Momentum that the fluid gave in the last step and particles did not receive, over that given [-].

    The fluid's side is the sum over cells, the particles' side the sum over particles. Momentum taken by walls, inlets
    and outlets belongs to neither.
    """
    total = fluid.communicator.sum
    given, got = total(drag_exchange(fluid), axis=(0, 1, 2)), total(particles.drag_impulse, axis=0)
    scale = max(total(np.abs(particles.drag_impulse)), 1e-300)
    return float(max(abs(component) for component in given + got) / scale)


def volume_imbalance(fluid: FluidSolver) -> float:
    """Largest volume gained by a cell and not through its faces in the last step, over the largest flux [-]."""
    largest = fluid.communicator.largest
    flux = max(largest(np.abs(fluid.volume_flux(d))) * fluid.grid.face_area(d) for d in range(3))
    return float(largest(np.abs(continuity_residual(fluid))) / max(flux, 1e-300))
