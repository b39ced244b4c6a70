r"""Layers of a bed over its height: mean profiles of a run, the map of layers over time, and waves in it.

Waves in liquid beds are horizontal layers of higher solid fraction that move upward. A wave is described by the Fourier
component of the map along the height,

.. math:: A_k(t) = \frac{2}{\sum w}\sum_z w(z)\,\bigl[\phi(z,t) - \bar\phi(z)\bigr]\,e^{-ikz}

with a Hann window w. The wave number with the largest mean square is that of the wave.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.analysis.measures import cells_of, granular_temperature, layer_solid_fraction, profile, solids_flux
from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.fluid.cut_cells import open_share
from cfddem.fluid.grid import Grid
from cfddem.io.reading import RunData
from cfddem.particles.state import sphere_volume

MOST_SNAPSHOTS = 40
"""Largest number of snapshots that are averaged."""


class Profiles(NamedTuple):
    """Means over snapshots and over each layer of cells; a quantity that the run does not record is None."""

    snapshots: int
    height: np.ndarray  # (n,) of the layer centres [m]
    voidage: np.ndarray | None  # (n,) [-]
    voidage_spread: np.ndarray | None  # (n,) standard deviation over the snapshots [-]
    upward: np.ndarray | None  # (n,) superficial velocity of rising solids [m/s]
    downward: np.ndarray | None  # (n,) superficial velocity of sinking solids [m/s]
    temperature: np.ndarray | None  # (n,) granular temperature; NaN without particles [m2/s2]


def profiles_of(run: RunData, case: Case, begin: float) -> Profiles | None:
    """Profiles averaged over the snapshots from a time on.

    begin    of the averaging window [s]
    returns  Profiles; None if there is no snapshot in the window
    errors   RunFailed if a snapshot cannot be read
    """
    inside = np.flatnonzero(run.times >= begin)
    if not len(inside):
        return None
    chosen = inside[np.unique(np.linspace(0, len(inside) - 1, min(len(inside), MOST_SNAPSHOTS)).astype(int))].tolist()
    grid = grid_of(case)
    height = grid.origin[2] + (np.arange(grid.shape[0]) + 0.5) * grid.spacing[2]
    voidage = spread = None
    if "voidage" in run.fluid_fields:
        layers = np.array(
            [profile(run.fluid("voidage", place), "z", weight=open_share(grid).astype(float)) for place in chosen]
        )
        voidage, spread = layers.mean(axis=0), layers.std(axis=0)
    if not {"velocity", "radius"} <= {*run.particle_fields}:
        return Profiles(len(chosen), height, voidage, spread, None, None, None)
    upward, downward, temperature = _of_particles(run, chosen, grid, open_share(grid))
    return Profiles(len(chosen), height, voidage, spread, upward, downward, temperature)


def _of_particles(
    run: RunData, chosen: list[int], grid: Grid, open_shares: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Upward and downward flux, and granular temperature, of the layers."""
    layers, spacing = grid.shape[0], grid.spacing
    edges = np.asarray(grid.origin[2] + np.arange(layers + 1) * spacing[2], np.float64)
    area = float(open_shares[0].sum()) * spacing[0] * spacing[1]
    upward, downward, energy, freedoms = np.zeros((4, layers))
    for place in chosen:
        particles = run.particles(place)
        volume = sphere_volume(particles["radius"].astype(float))
        flux = solids_flux(particles["position"], particles["velocity"], volume, edges, area)
        upward += flux.up / len(chosen)
        downward += flux.down / len(chosen)
        cells = cells_of(particles["position"], grid.shape, spacing, grid.origin)
        temperature = granular_temperature(particles["velocity"], cells)
        energy += (np.nan_to_num(temperature.cells) * temperature.freedoms).sum(axis=(1, 2))
        freedoms += temperature.freedoms.sum(axis=(1, 2))
    with np.errstate(invalid="ignore", divide="ignore"):
        return upward, downward, energy / freedoms


# ---------------------------------------------------------------- map of layers, and waves


Array = NDArray[np.float64]

LAYER = 2.5
"""Thickness of a layer of the map over the mean diameter [-]."""

FEWEST_LAYERS, FEWEST_TIMES = 4, 8
"""Layers and times that a wave needs."""


class LayerMap(NamedTuple):
    """Solid fraction of horizontal layers over time."""

    time: Array  # (T,) [s]
    height: Array  # (L,) of the layer centres [m]
    solid_fraction: Array  # (T, L) [-]


class Waves(NamedTuple):
    """Waves in a map."""

    wavelength: float  # [m]
    speed: float  # upward [m/s]
    amplitude: float  # root mean square over time, of the solid fraction [-]
    growth: float  # of the amplitude in time [1/s]
    deviation: float  # standard deviation in time of the solid fraction of a layer, mean over the layers [-]


def layer_map(run: RunData, case: Case, layer: float | None = None) -> LayerMap:
    """Map of a run, from the positions of the particles in all snapshots.

    layer  thickness of the layers [m]; 2.5 mean diameters if not given
    """
    height = case.column.height
    count = max(1, round(height / (layer or LAYER * case.bed.diameter)))
    edges = np.linspace(0.0, height, count + 1)
    rows = []
    for place in range(len(run.times)):
        particles = run.particles(place)
        if not {"position", "radius"} <= {*particles}:
            raise InputError("snapshot", place, "one with positions and radii of particles", "its file is damaged")
        rows.append(layer_solid_fraction(particles["position"], particles["radius"], edges, case.floor_area))
    return LayerMap(run.times, 0.5 * (edges[1:] + edges[:-1]), np.array(rows))


def waves(layers: LayerMap, low: float, high: float, begin: float = -math.inf) -> Waves:
    """Wavelength, speed, amplitude and growth of the strongest wave in part of a map.

    layers     evenly spaced in time
    low, high  heights between which waves are sought, inside the bed [m]
    begin      first time [s]
    returns    Waves; NaN where the map is too short or too flat to tell

    The speed follows from the phase between neighbouring times. It is ambiguous, and too small, if a wave moves by more
    than half of its length between two times. Waves longer than the part of the bed are not seen.
    """
    if not low < high:
        raise InputError("low", low, f"below high, {high:g} m")
    inside, late = (layers.height >= low) & (layers.height <= high), layers.time >= begin
    height, time, field = layers.height[inside], layers.time[late], layers.solid_fraction[np.ix_(late, inside)]
    nan = math.nan
    if len(height) < FEWEST_LAYERS or len(time) < FEWEST_TIMES:
        return Waves(nan, nan, nan, nan, nan)
    field = field - field.mean(axis=0)
    deviation = float(field.std(axis=0).mean())
    thickness = height[1] - height[0]
    extent = len(height) * thickness
    window = np.sin(math.pi * (np.arange(len(height)) + 0.5) / len(height)) ** 2
    numbers = np.linspace(2.0 * math.pi / extent, math.pi / thickness, 8 * len(height))
    parts = 2.0 / window.sum() * (field * window) @ np.exp(-1j * np.outer(height, numbers))  # (T, K)
    best = int(np.argmax((np.abs(parts) ** 2).mean(axis=0)))
    wave, number = parts[:, best], float(numbers[best])
    if not np.abs(wave).any():
        return Waves(nan, nan, 0.0, nan, deviation)
    turned = float(np.angle((wave[1:] * np.conj(wave[:-1])).sum()))
    return Waves(
        wavelength=2.0 * math.pi / number,
        speed=-turned / (number * float(np.diff(time).mean())),
        amplitude=float(np.sqrt((np.abs(wave) ** 2).mean())),
        growth=float(np.polyfit(time, np.log(np.maximum(np.abs(wave), 1e-300)), 1)[0]),
        deviation=deviation,
    )
