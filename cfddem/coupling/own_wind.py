r"""The wind and the voidage that a lone particle makes itself, and that it must not take for those it meets.

A particle's force, spread over cells, drives a flow that the same cells then show to the particle; its own volume
lowers the voidage there. Drag laws want the fluid without the particle. Both disturbances are known: the kernel is,
and the equations of the grid are. Per force, at a place f within its cell (0 to 1 along each axis),

.. math:: M_d(f) = \sum_{\Delta} G_d(\Delta) \prod_e A_e(\Delta_e),\qquad
          A(0) = (1-f)^2 + f^2,\ A(\pm1) = f(1-f)

where G is the flow of the grid's own Stokes equations, smoothing included, between cells that lie Delta apart. It is
a sum over waves, each of which builds up at its own rate, nu times its eigenvalue L; waves of like L are taken
together, which makes few winds. A moving particle leaves its wind behind: of each wave with the wave number k along
its way the share :math:`1/(1 + (Uk/\nu L)^2)` is left, which gives the steady sum (Oseen's, on the grid). With s the
width of the kernel, :math:`s^2 = M\eta/(2a_0)` where F a_0/rho is the first acceleration, every rate grows by nu/s^2
times :func:`closures.disturbance.left_behind`; so their sum is near the steady one, and what is left is scaled away.

Where particles are many, the drag of the others holds the wind back (Brinkman), which adds beta/(eps rho) to each
rate. And drag laws of dense beds are made for means that count every particle, this one too: of both disturbances
only the share is taken out that the particle has in the solids that it sees.
"""

from __future__ import annotations

import math

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.coupling.own_wind_tables import PER_DECADE, tables
from cfddem.coupling.voidage import Placement, Spreading
from cfddem.fluid.grid import Array
from cfddem.kernels import inline, prange, threaded
from closures.disturbance import left_behind


class OwnWind:
    """Disturbances of one particle, by the place in its cell.

    spreading  how particles spread over cells
    """

    def __init__(self, spreading: Spreading) -> None:
        grid = spreading.grid
        self._cell = np.array(grid.origin), 1.0 / np.array(grid.spacing), float(spreading.mapping == "linear")
        self._tables = tables(spreading)

    def solid(self, place: Placement) -> Array:
        """The part of the solid fraction that each particle sees which is its own (N,)."""
        own = np.empty(len(place.volume))
        _own_solid(place.position, place.volume, self._tables.solid, *self._cell, own)
        return own

    def advance(
        self,
        place: Placement,
        winds: Array,
        drag: Array,
        slip: Array,
        screening: Array,
        density: float,
        viscosity: Array,
        step: float,
    ) -> None:
        """Let the own winds grow and fade over a step [s] in which the particles have pushed the fluid.

        winds      (N, MODES, 3) [m/s], changed in place
        drag       on the particles; the fluid felt its opposite (N, 3) [N]
        slip       u - v, without the own wind (N, 3) [m/s]
        screening  rate at which the drag of all other particles there stops the fluid (N,) [1/s]
        viscosity  of the fluid around each (N,), positive [Pa s]
        """
        _build_up(
            place.position, *self._cell, drag, slip, screening, *self._tables[1:], density, viscosity, step, winds
        )  # fmt: skip


@inline
def _shares(n, position, origin, inverse, linear):
    """Along x, y, z, how much of what a particle does to its cells it sees in the cell next to the one it did it to."""
    x = (position[n, 0] - origin[0]) * inverse[0] - 0.5
    y = (position[n, 1] - origin[1]) * inverse[1] - 0.5
    z = (position[n, 2] - origin[2]) * inverse[2] - 0.5
    a, b, c = linear * (x - math.floor(x)), linear * (y - math.floor(y)), linear * (z - math.floor(z))
    return 2.0 * a * (1.0 - a), 2.0 * b * (1.0 - b), 2.0 * c * (1.0 - c)


@inline
def _seen(table, shares):
    """A table (2, 2, 2), of what is done in a cell and seen so many cells apart, at those shares."""
    a, b, c = shares
    near = (1.0 - b) * ((1.0 - a) * table[0, 0, 0] + a * table[0, 0, 1])
    near += b * ((1.0 - a) * table[0, 1, 0] + a * table[0, 1, 1])
    far = (1.0 - b) * ((1.0 - a) * table[1, 0, 0] + a * table[1, 0, 1])
    far += b * ((1.0 - a) * table[1, 1, 0] + a * table[1, 1, 1])
    return (1.0 - c) * near + c * far


@threaded
def _own_solid(position, volume, table, origin, inverse, linear, own):
    for n in prange(len(volume)):
        own[n] = volume[n] * _seen(table, _shares(n, position, origin, inverse, linear))


@inline
def _steady(moving, slowest, wave_number, shares):
    """Steady velocity times viscosity per force [1/m] at U/nu [1/m]: a power of it between those tabulated."""
    place = max(PER_DECADE * math.log10(max(wave_number, slowest) / slowest), 0.0)
    node = min(int(place), len(moving) - 2)
    low, high = _seen(moving[node], shares), _seen(moving[node + 1], shares)
    return low * (high / low) ** (place - node)


@threaded
def _build_up(
    position, origin, inverse, linear, drag, slip, screening, flow, rates, start, slowest, moving, density,
    viscosity, step, winds,
):  # fmt: skip
    """Exact relaxation of every wind towards what a steady force would make of it."""
    modes = rates.shape[1]
    for n in prange(len(position)):
        diffusivity = viscosity[n] / density
        shares = _shares(n, position, origin, inverse, linear)
        speed = math.sqrt(slip[n, 0] ** 2 + slip[n, 1] ** 2 + slip[n, 2] ** 2)
        for d in range(3):
            creeping = 0.0
            for k in range(modes):
                creeping += _seen(flow[d, k], shares)
            square = 0.5 * creeping / _seen(start[d], shares)
            blown = left_behind(speed * math.sqrt(square) / diffusivity) / square
            total = 0.0
            for k in range(modes):
                total += _seen(flow[d, k], shares) * rates[d, k] / (rates[d, k] + blown)
            scale = -_steady(moving[d], slowest, speed / diffusivity, shares) / total * drag[n, d] / viscosity[n]
            for k in range(modes):
                steady = scale * _seen(flow[d, k], shares) * rates[d, k] / (rates[d, k] + blown)
                fading = diffusivity * (rates[d, k] + blown)
                left = math.exp(-step * (fading + screening[n]))
                steady *= fading / (fading + screening[n])
                winds[n, k, d] = steady + left * (winds[n, k, d] - steady)
