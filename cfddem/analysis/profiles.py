"""Vertical profiles of a run: voidage, solids flux and granular temperature, averaged over snapshots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.analysis.measures import cells_of, granular_temperature, profile, solids_flux
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
