"""What a force or a volume that is put into a cell does to that cell and its neighbours, by Fourier sums."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cfddem.coupling.voidage import Spreading
from cfddem.fluid.grid import Array
from closures.disturbance import oseen_share

CELLS = 48
"""Cells along the shortest edge of the lattice on which a kernel's flow is tabulated."""

MODES = 8
"""Number of winds of a particle."""

SLOWEST, DECADES, PER_DECADE = 1e-3, 5, 4
"""Speeds of a moving particle, U h/nu of the smallest cell, for which the steady sum is tabulated."""

_PERIODIC_STOKES = 2.837297
"""Hasimoto: in a cubic array of pitch L a force moves slower by this over 6 pi eta L."""


class Tables(NamedTuple):
    """By the number of cells (0 or 1 along z, y, x) between where something is done and where it is seen.

    Velocities are those along a force in the directions x, y, z, per force and times the viscosity.
    """

    solid: Array  # volume put in, over the volume of a cell (2, 2, 2) [1/m3]
    flow: Array  # steady velocity of every wind of a particle at rest (3, MODES, 2, 2, 2) [1/m]
    rates: Array  # of these winds, over the kinematic viscosity (3, MODES) [1/m2]
    start: Array  # first acceleration, times density and not viscosity (3, 2, 2, 2) [1/m3]
    slowest: float  # first U/nu of `moving`; the next are ten times as fast after PER_DECADE [1/m]
    moving: Array  # steady velocity of all winds of a moving particle (3, speeds, 2, 2, 2) [1/m]


def tables(spreading: Spreading) -> Tables:
    """The tables of a grid and its kernel."""
    grid = spreading.grid
    spacing, flat = np.array(grid.spacing), np.array(grid.cells) == 1
    spacing = np.where(flat, spacing[~flat].min() if (~flat).any() else spacing[0], spacing)
    return _tables(tuple(spacing), tuple(spreading.strength), spreading.sweeps)


@lru_cache(maxsize=16)
def _tables(spacing: tuple[float, ...], strength: tuple[float, ...], sweeps: int) -> Tables:
    """Sums over the waves of a lattice, large enough to be endless but for the mean flow of its images."""
    counts = np.rint(CELLS * max(spacing) / np.array(spacing)).astype(int)
    waves = np.meshgrid(*(2.0 * np.pi * np.fft.fftfreq(n) for n in counts[::-1]), indexing="ij")[::-1]
    steps = [2.0 * np.sin(0.5 * wave) / h for wave, h in zip(waves, spacing)]
    laplacian = sum(step**2 for step in steps)
    laplacian[0, 0, 0] = np.inf
    smoothing = 1.0 - sum(a * (h * step) ** 2 for a, h, step in zip(strength, spacing, steps))
    kernel = smoothing**sweeps
    pitch = float(np.cbrt(np.prod(counts * spacing)))
    images = _PERIODIC_STOKES / (6.0 * math.pi * pitch)
    wide = pitch / (math.sqrt(math.pi) * _PERIODIC_STOKES)  # width of the Gaussian that a force moves as fast
    wind = _winds(laplacian)
    speeds = SLOWEST / min(spacing) * 10.0 ** (np.arange(DECADES * PER_DECADE + 1) / PER_DECADE)
    flow, moving, start = np.empty((3, MODES, 2, 2, 2)), np.empty((3, len(speeds), 2, 2, 2)), np.empty((3, 2, 2, 2))
    rates = np.empty((3, MODES))

    near = np.stack([np.cos(sum(n * wave for n, wave in zip(apart[::-1], waves))) for apart in np.ndindex(2, 2, 2)])
    near = near.reshape(8, -1) / (laplacian.size * float(np.prod(spacing)))

    def seen(symbol: Array) -> Array:
        values: Array = (near @ symbol.ravel()).reshape(2, 2, 2)
        return values

    for d in range(3):
        # half of a cell's force acts on each of its faces, and a cell sees the mean of its faces
        along = kernel**2 * np.cos(0.5 * waves[d]) ** 2 * (1.0 - steps[d] ** 2 / laplacian)
        along[0, 0, 0] = 0.0
        steady, start[d] = along / laplacian, seen(along)
        for k in range(MODES):
            part = np.where(wind == k, steady, 0.0)
            flow[d, k] = seen(part) + (images if k == 0 else 0.0)
            rates[d, k] = np.where(wind == k, along, 0.0).sum() / part.sum() if part.sum() > 0.0 else laplacian.min()
        for n, speed in enumerate(speeds):
            left = _left(waves[d] / spacing[d], 2.0 * np.pi / (counts[d] * spacing[d]), laplacian, speed)
            moving[d, n] = seen(steady * left) + images * oseen_share(speed * wide)
    return Tables(seen(kernel), flow, rates, start, float(speeds[0]), moving)


def _winds(laplacian: Array) -> Array:
    """Number of the wind to which each wave belongs; waves of like eigenvalue make one wind."""
    finite = np.where(np.isfinite(laplacian), laplacian, 1.0)
    smallest, largest = float(np.min(laplacian)), float(finite.max())
    wind: Array = (MODES * np.log(finite / smallest) / np.log(largest / smallest)).astype(int)
    return np.clip(wind, 0, MODES - 1)


def _left(wave_number: Array, width: float, laplacian: Array, speed: float) -> Array:
    r"""What is left of a wave where the force moves, :math:`1/(1 + (Uk/\nu L)^2)`, as its mean over the waves between
    k - width/2 and k + width/2 that stand for one of the lattice [-]."""
    ends = [np.arctan(speed * (wave_number + side * width) / laplacian) for side in (-0.5, 0.5)]
    left: Array = np.where(np.isfinite(laplacian), laplacian, 0.0) * (ends[1] - ends[0]) / (speed * width)
    return left
