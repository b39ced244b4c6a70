"""Rates of a fluid that limit its step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from cfddem.backend.compile import prange, threaded
from cfddem.fluid.grid import LOW, UNIT


@dataclass(frozen=True)
class StepLimit:
    """The largest stable step [s] and the criterion that sets it: "Courant", "viscous" or "none"."""

    step: float
    criterion: str


class Rates(NamedTuple):
    """Largest values over all cells."""

    advection: float  # |u|/h summed over directions [1/s]
    viscous: float  # 2 mu/(rho eps) times the sum of 1/h^2 over directions [1/s]
    flux: float  # eps |u| [m/s]


@threaded
def largest_rates(velocity, voidage, viscosity, open_cells, density, inverse, advection, viscous, fluxes):
    """Write the largest rates of each plane of cells, in the units of `Rates`.

    viscosity is eps mu. The viscous rate of a cell combines its voidage with the largest viscosity among the cell and
    its six neighbours.
    """
    nz, ny, nx = open_cells.shape
    squares = 2.0 * (inverse[0] ** 2 + inverse[1] ** 2 + inverse[2] ** 2)
    for k in prange(nz):
        fastest, stiffest, flux = 0.0, 0.0, 0.0
        for j in range(ny):
            for i in range(nx):
                kk, jj, ii = k + LOW, j + LOW, i + LOW
                crossing, largest = 0.0, viscosity[kk, jj, ii]
                for d in range(velocity.shape[0]):
                    dk, dj, di = UNIT[d]
                    speed = max(abs(velocity[d, kk, jj, ii]), abs(velocity[d, kk + dk, jj + dj, ii + di]))
                    crossing += speed * inverse[d]
                    flux = max(flux, speed * voidage[kk, jj, ii])
                    around = max(viscosity[kk - dk, jj - dj, ii - di], viscosity[kk + dk, jj + dj, ii + di])
                    largest = max(largest, around)
                fastest = max(fastest, crossing)
                stiffest = max(stiffest, open_cells[k, j, i] * largest * squares / (density * voidage[kk, jj, ii]))
        advection[k], viscous[k], fluxes[k] = fastest, stiffest, flux
