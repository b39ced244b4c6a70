"""The ledger: what must not change, counted by another route than the one that moves it.

Momentum that particles got is summed over particles, momentum that the fluid gave over cells; volume is summed
over the faces of cells; particles are counted. Energy is in :mod:`cfddem.record.energy`.
"""

from __future__ import annotations

import numpy as np

from cfddem.coupling.exchange import Exchange
from cfddem.fluid.solver import FluidSolver


def exchange_imbalance(fluid: FluidSolver, exchange: Exchange) -> float:
    """Momentum that the last fluid step gave and particles did not get, over what was given [-].

    The fluid's side is the sum over cells, the particles' the sum over particles; what is held at walls, inlets and
    outlets belongs to neither.
    """
    given = fluid.drag_exchange()[2].sum(axis=(0, 1, 2))
    got = exchange.drag_impulse.sum(axis=0)
    return float(np.abs(given + got).max() / max(np.abs(exchange.drag_impulse).sum(), 1e-300))


def volume_imbalance(fluid: FluidSolver) -> float:
    """Largest volume that a cell has gained against its faces in a step, over the largest flux through a face [-]."""
    flux = max(float(np.abs(fluid.volume_flux(d)).max()) * fluid.grid.face_area(d) for d in range(3))
    return float(np.abs(fluid.continuity_residual()).max() / max(flux, 1e-300))
