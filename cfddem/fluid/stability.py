"""How fast things happen in a cell: the rates that limit a step."""

from __future__ import annotations

from dataclasses import dataclass

from cfddem.fluid.grid import LOW, UNIT
from cfddem.kernels import prange, threaded


@dataclass(frozen=True)
class StepLimit:
    """The largest stable step [s] and the clock that sets it: "Courant", "viscous" or "none"."""

    step: float
    clock: str


@threaded
def clocks(velocity, voidage, viscosity, open_cells, density, inverse, advection, diffusion, fastest):
    """Plane by plane the largest |u|/h summed over directions [1/s], viscous rate [1/s] and eps |u| [m/s].

    viscosity is eps mu; the viscous rate takes the thickest neighbour of the thinnest cell, 2 mu (sum 1/h^2)/rho eps.
    """
    nz, ny, nx = open_cells.shape
    squares = 2.0 * (inverse[0] ** 2 + inverse[1] ** 2 + inverse[2] ** 2)
    for k in prange(nz):
        turnover, spreading, flux = 0.0, 0.0, 0.0
        for j in range(ny):
            for i in range(nx):
                kk, jj, ii = k + LOW, j + LOW, i + LOW
                crossing, thickest = 0.0, viscosity[kk, jj, ii]
                for d in range(velocity.shape[0]):
                    dk, dj, di = UNIT[d]
                    speed = max(abs(velocity[d, kk, jj, ii]), abs(velocity[d, kk + dk, jj + dj, ii + di]))
                    crossing += speed * inverse[d]
                    flux = max(flux, speed * voidage[kk, jj, ii])
                    around = max(viscosity[kk - dk, jj - dj, ii - di], viscosity[kk + dk, jj + dj, ii + di])
                    thickest = max(thickest, around)
                turnover = max(turnover, crossing)
                spreading = max(spreading, open_cells[k, j, i] * thickest * squares / (density * voidage[kk, jj, ii]))
        advection[k], diffusion[k], fastest[k] = turnover, spreading, flux
