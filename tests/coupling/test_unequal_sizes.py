"""Particles of unequal sizes have kernels of unequal widths: conservation, widths, and a layered lattice."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.coupling.kernel import FilterKernel
from cfddem.fluid.grid import Array, Grid
from cfddem.run import build, history
from cfddem.run.simulation import Simulation
from closures.balance import pressure_gradient
from closures.drag import di_felice
from scenarios.beds.liquid_bed.study import glass

SIZES = ((0.5, 1.5), (1.0, 3.0))
"""Radius and standard deviation of the kernel."""

LARGE, SMALL = 2e-3, 1e-3
PITCH = 1.25
"""Of the lattices, over the diameter."""


def kernel(smoothing: float = 3.0, sizes: tuple[tuple[float, float], ...] = SIZES) -> FilterKernel:
    return FilterKernel(Grid((16, 16, 16), (1.5,) * 3), (True, False, True), smoothing=smoothing, sizes=sizes)


def some(count: int = 40) -> tuple[Array, Array]:
    random = np.random.default_rng(4)
    return random.uniform(0.0, 24.0, (count, 3)), random.choice([0.5, 1.0], count)


def test_deposit_and_gather_of_unequal_particles_are_adjoint_and_keep_sums() -> None:
    unequal, (position, radius), random = kernel(), some(), np.random.default_rng(5)
    cell_map = unequal.map_particles(position, radius)
    values, field = random.normal(size=(40, 2)), random.normal(size=(2, *unequal.grid.shape))
    spread = unequal.spread(cell_map, values)
    assert spread.sum(axis=(1, 2, 3)) == pytest.approx(values.sum(axis=0), rel=1e-12)
    sampled = unequal.sample(cell_map.stencil, radius, field)
    assert (spread * field).sum() == pytest.approx((values * sampled).sum(), rel=1e-12)
    assert unequal.solid_fraction(cell_map).sum() * 1.5**3 == pytest.approx(cell_map.volume.sum(), rel=1e-12)


def test_each_size_has_the_bits_that_it_has_alone() -> None:
    unequal, (position, radius) = kernel(), some()
    field = np.random.default_rng(6).normal(size=(3, *unequal.grid.shape))
    for size, width in SIZES:
        rows = radius == size
        alone = kernel(width, ())
        stencil, own = alone.stencil(position[rows], radius[rows]), unequal.stencil(position, radius)
        sampled = unequal.sample(own, radius, field, field[:1])[rows]
        assert np.array_equal(sampled[:, :3], alone.sample(stencil, radius[rows], field))
        assert np.array_equal(sampled[:, 3:], alone.gather(stencil, field[:1]))
        spread = unequal.spread(unequal.map_particles(position[rows], radius[rows]), np.ones((rows.sum(), 1)))
        assert np.array_equal(
            spread, alone.spread(alone.map_particles(position[rows], radius[rows]), np.ones((rows.sum(), 1)))
        )


def test_diameters_that_hardly_differ_share_a_kernel() -> None:
    sizes = {"large": {"diameter": LARGE, "count": 5}, "nearly": {"diameter": 1.7e-3, "count": 5},
             "small": {"diameter": SMALL, "count": 5}}  # fmt: skip
    case = glass(0.02).with_(bed={"inlet_velocity": 0.02, "species": sizes})
    assert build.kernels_of(case) == [(0.5e-3, 1.5e-3), (1e-3, 3e-3)]
    assert build.kernels_of(glass(0.02)) == []


def lattice(diameter: float, layers: int, height: float) -> list[tuple[float, float, float]]:
    """A cubic lattice across a column of 10 mm, from a height on."""
    pitch = PITCH * diameter
    line = [(i + 0.5) * pitch for i in range(round(0.01 / pitch))]
    return [(x, y, height + (k + 0.5) * pitch) for k in range(layers) for y in line for x in line]


def small_on_large(surface: str) -> tuple[float, Array, Array]:
    """Pressure drop of 8 layers of small spheres on 4 of large ones, over that of the law, and force on each layer.

    returns  drop, and forces on the layers of small and of large spheres over those of the law, from the top
    """
    large, small = lattice(LARGE, 4, 0.0), lattice(SMALL, 8, 4 * PITCH * LARGE)
    species = {"large": {"diameter": LARGE, "count": len(large)}, "small": {"diameter": SMALL, "count": len(small)}}
    bed = {"inlet_velocity": 0.02, "start": "placed", "positions": large + small, "fixed": True, "species": species}
    run = Simulation(glass(0.02).with_(bed=bed, **{"laws.agitation": "none", "laws.surface": surface}))
    run.until(0.05)
    particles, row = run.particles, history.row(run)
    assert row["momentum_imbalance"] < 1e-13
    force = particles.applied[:, 2] + (2500.0 - 998.0) * 9.81 * particles.volume
    drops, layers = 0.0, {}
    for diameter, count in ((LARGE, 4), (SMALL, 8)):
        law = pressure_gradient(0.02, diameter, 998.0, 1e-3, 1.0 - math.pi / 6.0 / PITCH**3, di_felice)
        own, pitch = np.isclose(particles.radius, 0.5 * diameter), PITCH * diameter
        layer = np.floor((particles.position[own, 2] - particles.position[own, 2].min()) / pitch + 0.5).astype(int)
        layers[diameter] = np.bincount(layer, force[own])[::-1] / (law * pitch * 1e-4)
        drops += count * pitch * law
    return row["pressure_drop"] / drops, layers[SMALL], layers[LARGE]


def test_layers_of_small_spheres_on_large_ones_have_the_drag_of_their_law() -> None:
    drop, small, large = small_on_large("sharp")
    assert drop == pytest.approx(1.0, abs=0.02)
    assert small == pytest.approx(1.0, abs=0.08) and np.sqrt(((small - 1.0) ** 2).mean()) < 0.035
    assert large[1:] == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("surface", "least", "most"), [("smeared", 0.93, 0.9), ("sharp", 0.98, 0.97)])
def test_a_kernel_for_the_largest_spheres_has_less_drag(
    monkeypatch: pytest.MonkeyPatch, surface: str, least: float, most: float
) -> None:
    """The pressure drop is closer to the law with kernels by size, and so are the layers of small spheres."""
    drop, small, _ = small_on_large(surface)
    monkeypatch.setattr(build, "kernels_of", lambda case: [])
    smeared, blurred, _ = small_on_large(surface)
    assert most > smeared and least < drop < 1.02
    assert np.sqrt(((small - 1.0) ** 2).mean()) < 0.7 * np.sqrt(((blurred - 1.0) ** 2).mean())
