"""What a particle sees of the particles around it: in an even suspension, in a wave, alone, and at a surface."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.seen_solids import SeenSolids, cells_of
from cfddem.coupling.self_disturbance_walls import OwnSolids
from cfddem.fluid.conditions import NoSlip
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.solver import FluidSolver
from cfddem.run import history
from cfddem.run.simulation import Simulation
from closures.balance import pressure_gradient
from closures.drag import di_felice
from scenarios.beds.liquid_bed.study import glass

PITCH, LAYER = 0.01 / 9, 81
"""Of a cubic lattice of glass spheres of 1 mm in a column of 10 mm, and spheres in a layer [m]."""

SPHERE = math.pi / 6.0 * 1e-9
WEIGHT = (2500.0 - 998.0) * 9.81 * SPHERE
"""Volume of a sphere [m3], and its weight in water [N]."""

SIDES = ("x_low", "x_high", "y_low", "y_high", "z_low", "z_high")


def lattice(layers: int, below: int = 0) -> list[tuple[float, float, float]]:
    """Centres of the spheres of a cubic lattice [m].

    below  layers that are left out above the floor
    """
    return [((i + 0.5) * PITCH, (j + 0.5) * PITCH, (k + 0.5) * PITCH)
            for k in range(below, below + layers) for j in range(9) for i in range(9)]  # fmt: skip


def flow_through(places: list[tuple[float, float, float]], velocity: float, cell: float) -> Simulation:
    """Steady flow through spheres that are held at their places."""
    bed = {"start": "placed", "positions": places, "count": None, "fixed": True}
    laws = {"laws.agitation": "none", "laws.surface": "sharp"}
    case = glass(velocity).with_(**{f"bed.{key}": value for key, value in bed.items()}, **{"column.cell": cell}, **laws)
    simulation = Simulation(case)
    simulation.until(0.05)
    return simulation


def drop_of_the_law(velocity: float) -> float:
    """Pressure gradient of the drag law within the lattice [Pa/m]."""
    return pressure_gradient(velocity, 1e-3, 998.0, 1e-3, 1.0 - SPHERE / PITCH**3, di_felice)


def fixed_bed(layers: int, cell: float, below: int = 0) -> tuple[float, Array]:
    """Pressure drop of a fixed cubic lattice over the law's, and force on its layers over the law's, from the top.

    The law holds for the lattice up to its last layer: without a kernel all of these are 1.

    below  layers that are left out above the floor
    """
    simulation = flow_through(lattice(layers, below), 0.03, cell)
    law = layers * PITCH * drop_of_the_law(0.03)
    particles = simulation.particles
    force = particles.applied[:, 2] + WEIGHT
    layer = np.floor(particles.position[:, 2] / PITCH).astype(int)
    means = np.array([force[layer == k].mean() for k in reversed(range(below, below + layers))])
    return history.row(simulation)["pressure_drop"] / law, means * layers * LAYER / (law * 1e-4)


LIMITS = [(10.0 / 6.0, 0.05), (1.25, 0.05), (2.5, 0.08), (10.0 / 3.0, 0.12)]
"""Cell in diameters, and the error of the pressure drop that is accepted."""


@pytest.mark.parametrize(("cell", "limit"), [pytest.param(*LIMITS[0]), *(pytest.param(*each, marks=pytest.mark.slow)
                                                                         for each in LIMITS[1:])])  # fmt: skip
def test_a_fixed_bed_has_the_drag_of_the_law_up_to_its_last_layer(cell: float, limit: float) -> None:
    """Six layers; each carries its load within a tenth (the last one half of it with a plain kernel)."""
    drop, layers = fixed_bed(6, 1e-3 * cell)
    assert drop == pytest.approx(1.0, abs=limit)
    assert layers == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("cell", "limit"), LIMITS)
def test_a_deeper_fixed_bed_has_the_drag_of_the_law(cell: float, limit: float) -> None:
    drop, layers = fixed_bed(15, 1e-3 * cell)
    assert drop == pytest.approx(1.0, abs=limit)
    assert layers == pytest.approx(1.0, abs=0.1)


def test_a_plug_has_one_sharp_surface_that_downstream() -> None:
    """The last layer carries its load; the first one sees the mean over space, so that the plug opens into a fan."""
    layers = fixed_bed(6, 5e-3 / 3.0, below=8)[1]
    assert layers[:4].min() > 0.8
    assert 0.3 < layers[-1] < 0.6


def test_a_bead_above_a_bed_in_balance_falls_back() -> None:
    """Spheres in the lattice are nearly carried by the flow; one two diameters above them is not."""
    velocity = brentq(lambda speed: drop_of_the_law(speed) * PITCH**3 - WEIGHT, 1e-3, 0.1)
    above = (5e-3, 5e-3, 6.0 * PITCH + 2e-3)
    net = flow_through([*lattice(6), above], velocity, 5e-3 / 3.0).particles.applied[:, 2] / WEIGHT
    layers = net[:-1].reshape(6, LAYER).mean(axis=1)
    assert layers == pytest.approx(0.0, abs=0.1)
    assert net[-1] < -0.5


@pytest.mark.slow
def test_a_fluidised_bed_has_no_packed_layer_at_its_surface() -> None:
    """Over 0.4 to 1 s no half diameter near the surface is denser than 0.52; the middle is near its balance."""
    start = {"bed.start": "expanded"}  # from which waves need longer to grow
    simulation = Simulation(glass(0.037).with_(**start, **{"column.cell": 2.5e-3, "laws.surface": "sharp"}))
    edges, dense, voidage = 0.5e-3 * np.arange(11), [], []
    for time in 0.4 + 0.02 * np.arange(31):
        simulation.until(time)
        row, centres = history.row(simulation), simulation.particles.position[:, 2]
        below = np.clip(row["bed_height"] - edges[:, None] - centres + 0.5e-3, 0.0, 1e-3)
        solids = (math.pi * below**2 * (0.5e-3 - below / 3.0)).sum(axis=1)  # of spheres, below each height
        dense.append(-np.diff(solids) / (1e-4 * 0.5e-3))
        voidage.append(row["bed_voidage_from_pressure"])
    assert np.mean(dense, axis=0).max() < 0.52
    assert np.mean(voidage) == pytest.approx(0.616, abs=0.010)


@pytest.mark.parametrize("cell", [1.0, 5.0 / 3.0, 2.5])
def test_the_kernel_that_a_particle_sees_with_has_the_given_deviation(cell: float) -> None:
    """Second moment of deposit, sweeps and gather around a particle, averaged over its place in the cell."""
    grid, sigma, along = Grid((20, 20, 20), (cell,) * 3), 1.5, []
    kernel = SeenSolids(FilterKernel(grid, (True,) * 3, smoothing=sigma)).cells
    centres, middle = kernel.grid.centres()[0].ravel(), 10.0 * cell
    width = kernel.grid.spacing[0]
    for place in np.arange(8) / 8.0 * width + 0.5 * width / 8.0:
        at, radius = np.array([[middle + place, middle, middle]]), np.array([0.5])
        cell_map = kernel.map_particles(at, radius)
        spread = kernel.smooth(kernel.deposit(cell_map, np.ones((1, 1))))[0].sum(axis=(0, 1))
        points = at[0, 0] + np.arange(-8 * 8, 8 * 8 + 1) / 8.0 * width
        weights = np.maximum(1.0 - np.abs(points[:, None] - centres) / width, 0.0)
        response = weights @ spread
        along.append((response * (points - at[0, 0]) ** 2).sum() / response.sum())
    assert np.mean(along) == pytest.approx(sigma**2, rel=5e-3)


def lattice_of(box: float, count: int) -> Array:
    """A cubic lattice in a periodic box (count^3, 3)."""
    line = (np.arange(count) + 0.5) * box / count
    return np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize("cell", [1.0, 5.0 / 3.0, 2.5])
def test_a_small_wave_is_seen_alike_in_all_cells(cell: float) -> None:
    """In an even lattice the solid fraction of the box; in a wave exp(-k^2 sigma^2) of its amplitude."""
    box, count, sigma, solid, shift = 15.0, 15, 1.5, math.pi / 6.0, 1e-3
    kernel = FilterKernel(Grid.of_size((box,) * 3, cell), (True,) * 3, smoothing=sigma)
    seen, number = SeenSolids(kernel), 2.0 * math.pi / box
    places = lattice_of(box, count)

    def around(position: Array) -> Array:
        return seen.around(kernel.map_particles(position, np.full(count**3, 0.5)))

    changes = []
    for offset in np.arange(5) / 5.0 * cell:
        begin = places + offset
        even = around(begin)
        limit = 1e-12 if cell == 1.0 else 0.05  # a lattice of spheres beats with other cells
        assert even.mean() == pytest.approx(solid, rel=limit)
        moved = begin.copy()
        moved[:, 2] -= shift / number * np.sin(number * begin[:, 2])  # the solid fraction changes by shift cos(k z)
        changes.append(2.0 * ((around(moved) - even) * np.cos(number * begin[:, 2])).mean())
    assert np.mean(changes) == pytest.approx(solid * shift * math.exp(-((number * sigma) ** 2)), rel=0.01)


def test_a_bead_above_a_bed_sees_looser_surroundings_with_its_height() -> None:
    """Twice the part of the kernel that lies in the bed, and twice its own; the last layer sees the bed."""
    sigma, solid, top = 1.5, math.pi / 6.0, 10.0
    kernel = FilterKernel(Grid((12, 12, 30), (1.0,) * 3), (True, True, False), smoothing=sigma)
    seen = SeenSolids(kernel)
    line = np.arange(12) + 0.5
    bed = np.stack(np.meshgrid(line, line, line[:10], indexing="ij"), axis=-1).reshape(-1, 3)

    def around(position: Array) -> Array:
        return seen.around(kernel.map_particles(position, np.full(len(position), 0.5)))

    assert around(bed)[bed[:, 2] > top - 1.0] == pytest.approx(solid, rel=0.05)
    own = around(np.array([[6.0, 6.0, 20.0]]))[0]
    for height in (1.0, 2.0, 3.0):
        upper = around(np.concatenate([bed, [[6.0, 6.0, top + height]]]))[-1]
        part = 0.5 * math.erfc(height / sigma / math.sqrt(2.0))
        assert upper == pytest.approx(2.0 * (solid * part + own), rel=0.1, abs=0.012)


def test_a_lone_sphere_sees_only_itself() -> None:
    """Its own part is all that it sees, at every place in a cell, and nearly so beside a wall."""
    grid = Grid((12, 12, 12), (2.5e-3,) * 3)
    kernel = FilterKernel(grid, (False,) * 3, smoothing=1.5e-3)
    fluid = FluidSolver(grid, dict.fromkeys(SIDES, NoSlip()), density=1000.0, viscosity=1e-3)
    seen, own = SeenSolids(kernel), OwnSolids(cells_of(kernel), 1, fluid.boundaries)
    for height in (0.5e-3, 1.1e-3, 2e-3, 14.3e-3, 15e-3, 16.1e-3):
        cell_map = kernel.map_particles(np.array([[15.2e-3, 14.6e-3, height]]), np.array([0.5e-3]))
        assert own.of(cell_map.position, cell_map.volume) == pytest.approx(
            seen.around(cell_map), rel=0.06 if height < 2e-3 else 5e-3
        )


@pytest.mark.parametrize("mapping", ["linear", "divided"])
@pytest.mark.parametrize("periodic", [False, True])
def test_slabs_of_cells_are_slabs_of_their_parts(mapping: str, periodic: bool) -> None:
    """Threads fill slabs of even number together, then those of odd number: no two of these deposit on one part."""
    kernel = FilterKernel(Grid((4, 4, 24), (3.0,) * 3), (periodic,) * 3, mapping=mapping, smoothing=1.0)
    cells, radius = cells_of(kernel), np.full(3000, 0.5)
    cell_map = kernel.map_particles(np.random.default_rng(1).uniform(0.0, (12.0, 12.0, 72.0), (3000, 3)), radius)
    _, ny, nx = cells.reach.shape
    layers = cells.stencil(cell_map.position, radius).first[:, 0] // ((ny + 2) * (nx + 2))
    bounds = [layers[cell_map.order[begin:end]] for begin, end in zip(cell_map.start[:-1], cell_map.start[1:])]
    assert len(bounds) == 6 or mapping == "divided"
    assert all(lower.max() + 1 < upper.min() for lower, upper in zip(bounds, bounds[2:]))
