r"""The wind and the voidage that a lone particle makes itself, and that it must not take for those it meets.

A particle's force, spread over cells, drives a flow that the same cells then show to the particle; its own volume
lowers the voidage there. Drag laws want the fluid without the particle. Both disturbances are known: the kernel is,
and the equations of the grid are. Per force, at a place f within its cell (0 to 1 along each axis),

.. math:: M_d(f) = \sum_{\Delta} G_d(\Delta) \prod_e A_e(\Delta_e),\qquad
          A(0) = (1-f)^2 + f^2,\ A(\pm1) = f(1-f)

where G is the flow of the grid's own Stokes equations, smoothing included, between cells that lie Delta apart. It is
a sum over waves, each of which builds up at its own rate, nu times its eigenvalue L; waves of like L are taken
together, which makes few winds. A moving particle leaves its wind behind: with s the width of the kernel,
:math:`s^2 = M\eta/(2a_0)` where F a_0/rho is the first acceleration, every rate grows by nu/s^2 times
:func:`closures.disturbance.left_behind`, and the steady sum is Oseen's, :func:`closures.disturbance.oseen_share`.

Where particles are many, the drag of the others holds the wind back (Brinkman), which adds beta/(eps rho) to each
rate. And drag laws of dense beds are made for means that count every particle, this one too: of both disturbances
only the share is taken out that the particle has in the solids that it sees.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.coupling.voidage import Placement, Spreading
from cfddem.fluid.grid import Array
from cfddem.kernels import inline, prange, threaded
from closures.disturbance import left_behind, oseen_share

CELLS = 48
"""Cells along the shortest edge of the lattice on which a kernel's flow is tabulated."""

_PERIODIC_STOKES = 2.837297
"""Hasimoto: in a cubic array of pitch L a force moves slower by this over 6 pi eta L."""

MODES = 8
"""Number of winds of a particle."""


class OwnWind:
    """Disturbances of one particle, by the place in its cell.

    spreading  how particles spread over cells
    """

    def __init__(self, spreading: Spreading) -> None:
        grid = spreading.grid
        self._cell = np.array(grid.origin), 1.0 / np.array(grid.spacing), float(spreading.mapping == "linear")
        self._flow, self._rates, self._density = _tables(spreading)

    def solid(self, place: Placement) -> Array:
        """The part of the solid fraction that each particle sees which is its own (N,)."""
        own = np.empty(len(place.volume))
        _own_solid(place.position, place.volume, self._density, *self._cell, own)
        return own

    def advance(
        self,
        place: Placement,
        rows: np.ndarray,
        winds: Array,
        drag: Array,
        slip: Array,
        screening: Array,
        density: float,
        viscosity: float,
        step: float,
    ) -> None:
        """Let the own winds grow and fade over a step [s] in which the particles have pushed the fluid.

        rows       by which a particle's winds are known
        winds      (n, MODES, 3) [m/s], changed in place
        drag       on the particles; the fluid felt its opposite (N, 3) [N]
        slip       u - v, without the own wind (N, 3) [m/s]
        screening  rate at which the drag of all other particles there stops the fluid (N,) [1/s]
        """
        if viscosity <= 0.0:
            winds[rows] = 0.0
            return
        _build_up(
            place.position, *self._cell, rows, drag, slip, screening, self._flow, self._rates, density, viscosity,
            step, winds,
        )  # fmt: skip


def _tables(spreading: Spreading) -> tuple[Array, Array, Array]:
    """What a force does to cells so many cells apart, the rates of its winds, and the own volume there.

    Of a force along x, y, z: steady velocity of every wind times viscosity [1/m], then first acceleration times
    density [1/m3], as tables (3 MODES + 3, 2, 2, 2); rates over the viscosity nu (3, MODES) [1/m2]; volume (2, 2, 2)
    [1/m3].

    Fourier sums over a lattice large enough to be endless but for the mean flow of its images, which is known.
    """
    grid = spreading.grid
    spacing = np.array(grid.spacing)
    flat = np.array(grid.cells) == 1
    spacing = np.where(flat, spacing[~flat].min() if (~flat).any() else spacing[0], spacing)
    length = CELLS * spacing.max()
    counts = np.rint(length / spacing).astype(int)
    waves = np.meshgrid(*(2.0 * np.pi * np.fft.fftfreq(n) for n in counts[::-1]), indexing="ij")[::-1]
    steps = [2.0 * np.sin(0.5 * wave) / h for wave, h in zip(waves, spacing)]
    laplacian = sum(step**2 for step in steps)
    laplacian[0, 0, 0] = np.inf
    smoothing = 1.0 - sum(a * (h * step) ** 2 for a, h, step in zip(spreading.strength, spacing, steps))
    kernel = smoothing**spreading.sweeps
    volume = float(np.prod(spacing))

    def near(symbol: Array) -> Array:
        values = np.fft.ifftn(symbol).real[:2, :2, :2]
        return values / volume

    # waves of like eigenvalue make one wind
    finite = np.where(np.isfinite(laplacian), laplacian, 1.0)
    smallest, largest = float(np.min(laplacian)), float(finite.max())
    wind = np.clip((MODES * np.log(finite / smallest) / np.log(largest / smallest)).astype(int), 0, MODES - 1)
    images = _PERIODIC_STOKES / (6.0 * math.pi * float(np.cbrt(np.prod(counts * spacing))))
    flow, rates, acceleration = [], np.zeros((3, MODES)), []
    for d in range(3):
        # half of a cell's force acts on each of its faces, and a cell sees the mean of its faces
        seen = kernel**2 * np.cos(0.5 * waves[d]) ** 2
        along = seen * (1.0 - steps[d] ** 2 / laplacian)
        along[0, 0, 0] = 0.0
        for k in range(MODES):
            part = np.where(wind == k, along, 0.0)
            steady = float((part / laplacian).sum())
            rates[d, k] = float(part.sum()) / steady if steady > 0.0 else smallest
            flow.append(near(part / laplacian) + (images if k == 0 else 0.0))
        acceleration.append(near(along))
    return np.array(flow + acceleration), rates, near(kernel)


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


@threaded
def _build_up(
    position, origin, inverse, linear, rows, drag, slip, screening, flow, rates, density, viscosity, step, winds
):
    """Exact relaxation of every wind towards what a steady force would make of it."""
    modes, diffusivity = rates.shape[1], viscosity / density
    for n in prange(len(rows)):
        shares = _shares(n, position, origin, inverse, linear)
        speed = math.sqrt(slip[n, 0] ** 2 + slip[n, 1] ** 2 + slip[n, 2] ** 2)
        for d in range(3):
            creeping = 0.0
            for k in range(modes):
                creeping += _seen(flow[modes * d + k], shares)
            square = 0.5 * creeping / _seen(flow[3 * modes + d], shares)
            reynolds = speed * math.sqrt(square) / diffusivity
            blown = left_behind(reynolds) / square
            moving = 0.0
            for k in range(modes):
                moving += _seen(flow[modes * d + k], shares) * rates[d, k] / (rates[d, k] + blown)
            scale = -oseen_share(reynolds) * creeping / moving * drag[n, d] / viscosity
            for k in range(modes):
                steady = scale * _seen(flow[modes * d + k], shares) * rates[d, k] / (rates[d, k] + blown)
                fading = diffusivity * (rates[d, k] + blown)
                left = math.exp(-step * (fading + screening[n]))
                steady *= fading / (fading + screening[n])
                winds[rows[n], k, d] = steady + left * (winds[rows[n], k, d] - steady)
