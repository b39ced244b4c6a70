"""Response of a cell and its neighbours to a force or a volume in the cell, by Fourier sums on a lattice."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cfddem.coupling.kernel import FilterKernel
from cfddem.fluid.grid import Array
from closures.disturbance import oseen_share

CELLS = 48
"""Cells along the shortest edge of the lattice."""

MODES = 8
"""Number of modes of the self-disturbance."""

SLOWEST, DECADES, PER_DECADE = 1e-3, 5, 4
"""Speeds of a moving particle, U h/nu of the smallest cell, for which the steady sum is tabulated."""

_PERIODIC_STOKES = 2.837297
"""Hasimoto: in a cubic array of pitch L the velocity per force is lower by this number over 6 pi eta L."""


class Tables(NamedTuple):
    """Responses by the distance in cells (0 or 1 along z, y, x) between deposit and gather.

    Velocities are those along a force in the directions x, y, z, per force and times the viscosity.
    """

    flow: Array  # steady velocity of every mode of a particle at rest (3, MODES, 2, 2, 2) [1/m]
    rates: Array  # of the modes, over the kinematic viscosity (3, MODES) [1/m2]
    start: Array  # first acceleration, times density and not viscosity (3, 2, 2, 2) [1/m3]
    slowest: float  # first U/nu of `moving`, with PER_DECADE values for each power of ten [1/m]
    moving: Array  # steady velocity of a moving particle, all modes (3, speeds, 2, 2, 2) [1/m]


def tables(kernel: FilterKernel, kind: int = 0) -> Tables:
    """The tables of a grid and its kernel, or of one kind of it."""
    return tables_of(*lattice_of(kernel, kind))


def lattice_of(kernel: FilterKernel, kind: int, passes: int = 1) -> tuple[tuple[float, ...], tuple[float, ...], int]:
    """Spacing of the lattice of a grid [m], strength of a sweep of one kind of its kernel, and number of all sweeps.

    passes  how often a field passes the second stage
    """
    sweeps, strength = kernel.stages[kind]
    return spacing_of(kernel), tuple(strength), passes * sweeps


def spacing_of(kernel: FilterKernel) -> tuple[float, ...]:
    """Spacing of the lattice of a grid [m]: that of its cells; across a grid one cell thick the smallest of others."""
    grid = kernel.grid
    spacing, flat = np.array(grid.spacing), np.array(grid.cells) == 1
    return tuple(np.where(flat, spacing[~flat].min() if (~flat).any() else spacing[0], spacing))


class Waves:
    """The waves of a lattice of cells.

    spacing   of the cells along x, y, z [m]
    strength  of each sweep of the kernel's second stage along x, y, z
    """

    def __init__(self, spacing: tuple[float, ...], strength: tuple[float, ...]) -> None:
        self.counts = np.rint(CELLS * max(spacing) / np.array(spacing)).astype(int)
        grid = np.meshgrid(*(2.0 * np.pi * np.fft.fftfreq(n) for n in self.counts[::-1]), indexing="ij")
        self.waves: list[Array] = list(grid[::-1])
        self.steps = [2.0 * np.sin(0.5 * wave) / h for wave, h in zip(self.waves, spacing)]
        diffused = sum(a * (h * step) ** 2 for a, h, step in zip(strength, spacing, self.steps))
        self.sweep: Array = np.asarray(1.0 - diffused)
        near = [np.cos(sum(n * wave for n, wave in zip(apart[::-1], self.waves))) for apart in np.ndindex(2, 2, 2)]
        self._near = np.stack(near).reshape(8, -1) / (self.sweep.size * float(np.prod(spacing)))

    def gathered(self, symbol: Array) -> Array:
        """Response of a cell to one that lies 0 or 1 apart along z, y, x, per volume (2, 2, 2)."""
        values: Array = (self._near @ symbol.ravel()).reshape(2, 2, 2)
        return values


@lru_cache(maxsize=16)
def solid_table(spacing: tuple[float, ...], strength: tuple[float, ...], sweeps: int) -> Array:
    """Solid fraction per volume of a particle in its cell, and in a neighbour of the cell (2, 2, 2) [1/m3]."""
    lattice = Waves(spacing, strength)
    return lattice.gathered(lattice.sweep**sweeps)


@lru_cache(maxsize=16)
def tables_of(spacing: tuple[float, ...], strength: tuple[float, ...], sweeps: int) -> Tables:
    """Sums over the waves of a lattice; the flow of its periodic images is subtracted in the mean."""
    lattice = Waves(spacing, strength)
    counts, waves, steps, gathered = lattice.counts, lattice.waves, lattice.steps, lattice.gathered
    laplacian = np.asarray(sum(step**2 for step in steps))
    laplacian[0, 0, 0] = np.inf
    kernel = lattice.sweep**sweeps
    pitch = float(np.cbrt(np.prod(counts * spacing)))
    images = _PERIODIC_STOKES / (6.0 * math.pi * pitch)
    wide = pitch / (math.sqrt(math.pi) * _PERIODIC_STOKES)  # width of the Gaussian with the same velocity per force
    mode = _modes(laplacian)
    speeds = SLOWEST / min(spacing) * 10.0 ** (np.arange(DECADES * PER_DECADE + 1) / PER_DECADE)
    flow, moving, start = np.empty((3, MODES, 2, 2, 2)), np.empty((3, len(speeds), 2, 2, 2)), np.empty((3, 2, 2, 2))
    rates = np.empty((3, MODES))

    for d in range(3):
        # half of the force of a cell acts on each of its faces; a cell gathers the mean of its faces
        along = kernel**2 * np.cos(0.5 * waves[d]) ** 2 * (1.0 - steps[d] ** 2 / laplacian)
        along[0, 0, 0] = 0.0
        steady, start[d] = along / laplacian, gathered(along)
        for k in range(MODES):
            part = np.where(mode == k, steady, 0.0)
            flow[d, k] = gathered(part) + (images if k == 0 else 0.0)
            rates[d, k] = np.where(mode == k, along, 0.0).sum() / part.sum() if part.sum() > 0.0 else laplacian.min()
        for n, speed in enumerate(speeds):
            remaining = _remaining(waves[d] / spacing[d], 2.0 * np.pi / (counts[d] * spacing[d]), laplacian, speed)
            moving[d, n] = gathered(steady * remaining) + images * oseen_share(speed * wide)
    return Tables(flow, rates, start, float(speeds[0]), moving)


def _modes(laplacian: Array) -> Array:
    """Number of the mode of each wave; waves of similar eigenvalue belong to one mode."""
    finite = np.where(np.isfinite(laplacian), laplacian, 1.0)
    return mode_of(finite, float(np.min(laplacian)), float(finite.max()))


def mode_of(rates: Array, smallest: float, largest: float) -> Array:
    """Number of the mode of waves with these rates over the viscosity, between the smallest and largest one."""
    mode: Array = (MODES * np.log(rates / smallest) / np.log(largest / smallest)).astype(int)
    return np.clip(mode, 0, MODES - 1)


def _remaining(wave_number: Array, width: float, laplacian: Array, speed: float) -> Array:
    r"""Share of a wave that remains when the force moves, :math:`1/(1 + (Uk/\nu L)^2)` [-].

    It is the mean over the waves between k - width/2 and k + width/2, which one wave of the lattice represents.
    """
    ends = [np.arctan(speed * (wave_number + side * width) / laplacian) for side in (-0.5, 0.5)]
    share: Array = np.where(np.isfinite(laplacian), laplacian, 0.0) * (ends[1] - ends[0]) / (speed * width)
    return share
