"""Measures of beds and statistics of time series, each on synthetic data with a known result."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.analysis import bubbles, measures
from cfddem.backend.errors import InputError

SPACING = (0.01, 0.02, 0.005)


def random(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


# ---------------------------------------------------------------- height, profiles, pressure


def test_bed_height_of_a_stack_of_layers() -> None:
    """A hundred layers of touching spheres: 99 % of the volume lies below 99 diameters."""
    position = np.column_stack([np.zeros((100, 2)), 0.5 + np.arange(100.0)])
    assert measures.bed_height(position, np.full(100, 0.5)) == pytest.approx(99.0, abs=1e-6)


def test_bed_height_of_unequal_spheres_cuts_them() -> None:
    """The volume below the height, integrated slice by slice, is the share."""
    radius = random().uniform(0.2, 1.0, 300)
    position = random(2).uniform(0.0, 5.0, (300, 3))
    for share in (0.1, 0.5, 0.99):
        height = measures.bed_height(position, radius, share)
        slices = np.linspace(-1.0, 6.0, 70_001)
        area = np.zeros_like(slices)
        for centre, size in zip(position[:, 2], radius):
            area += np.pi * np.maximum(size**2 - (slices - centre) ** 2, 0.0)
        below = area[slices <= height].sum() / area.sum()
        assert below == pytest.approx(share, abs=1e-4)


def test_bed_height_of_no_particles_and_of_one_sphere() -> None:
    assert np.isnan(measures.bed_height(np.zeros((0, 3)), np.zeros(0)))
    assert measures.bed_height(np.array([[0, 0, 2.0]]), np.array([0.3]), 0.5) == pytest.approx(2.0, abs=1e-9)
    with pytest.raises(InputError, match="share"):
        measures.bed_height(np.zeros((1, 3)), np.ones(1), 1.0)


@pytest.mark.parametrize(("along", "axis"), [("x", 2), ("y", 1), ("z", 0)])
def test_profiles_average_over_the_other_directions(along: str, axis: int) -> None:
    field = random().random((4, 5, 6))
    gone = tuple({0, 1, 2} - {axis})
    assert measures.profile(field, along) == pytest.approx(field.mean(axis=gone))
    vector = random().random((4, 5, 6, 3))
    assert measures.profile(vector, along) == pytest.approx(vector.mean(axis=gone))


def test_profiles_ignore_values_in_solid_cells() -> None:
    field = np.arange(8.0).reshape(2, 2, 2)
    field[0, 0, 0] = np.nan
    open_cells = np.ones((2, 2, 2), bool)
    open_cells[0, 0, 0] = open_cells[1] = False
    values = measures.profile(field, "z", open_cells)
    assert values[0] == pytest.approx(2.0)
    assert np.isnan(values[1])
    with pytest.raises(InputError, match="shape"):
        measures.profile(field, "z", np.ones((2, 2), bool))


def test_pressure_drop_of_a_bed_below_a_freeboard() -> None:
    """1 000 Pa/m up to 0.1 m, nothing above; heights between centres, at the floor and at the lid."""
    z = (np.arange(40) + 0.5) * SPACING[2]
    pressure = np.maximum(0.1 - z, 0.0).reshape(40, 1, 1) * 1000.0 * np.ones((40, 4, 4))
    assert measures.pressure_drop(pressure, SPACING, 0.0, 0.2) == pytest.approx(100.0)
    assert measures.pressure_drop(pressure, SPACING, 0.0111, 0.0523) == pytest.approx(41.2)
    assert measures.pressure_drop(pressure, SPACING, 1.0, 1.2, origin=(0, 0, 1.0)) == pytest.approx(100.0)
    open_cells = np.ones(pressure.shape, bool)
    open_cells[:, 0, 0] = False
    pressure[:, 0, 0] = 1e9
    assert measures.pressure_drop(pressure, SPACING, 0.0, 0.2, open_cells=open_cells) == pytest.approx(100.0)
    with pytest.raises(InputError, match=r"high = 0\.3"):
        measures.pressure_drop(pressure, SPACING, 0.0, 0.3)


def test_solids_flux_of_a_rising_core_and_a_sinking_annulus() -> None:
    """2 000 kg/m3 at solid fraction 0.1: 0.04 of the volume at 3 m/s up, 0.06 at 1 m/s down, net 120 kg/(m2 s)."""
    count, area, height = 100_000, 0.5, 2.0
    position = random().uniform(0.0, height, (count, 3))
    rising = np.arange(count) < 0.4 * count
    velocity = np.zeros((count, 3))
    velocity[:, 2] = np.where(rising, 3.0, -1.0)
    mass = np.full(count, 2000.0 * 0.1 * area * height / count)
    found = measures.solids_flux(position, velocity, mass, np.linspace(0.0, height, 5), area)
    assert found.up == pytest.approx(240.0, rel=0.02)
    assert found.down == pytest.approx(120.0, rel=0.02)
    assert found.net == pytest.approx(120.0, rel=0.05)


# ---------------------------------------------------------------- granular temperature, mixing


@pytest.mark.parametrize("count", [100, 100_000])
def test_granular_temperature_is_independent_of_mean_flow_and_particle_number(count: int) -> None:
    """Fluctuations of 0.2 m/s in each direction give 0.04 m2/s2, even with about two particles per cell."""
    cells, total, fields = (4, 5, 5), 0.0, []
    for seed in range(200_000 // (2 * count)):
        generator = random(seed)
        position = generator.uniform(0.0, 1.0, (count, 3)) * (5.0, 5.0, 4.0)
        flow = np.floor(position) @ np.array([[0.0, 1.0, 5.0], [2.0, 0.0, 1.0], [0.0, 7.0, 3.0]])
        velocity = flow + generator.normal(0.0, 0.2, (count, 3))
        found = measures.granular_temperature(velocity, measures.cells_of(position, cells, (1.0, 1.0, 1.0)))
        total += found.mean
        fields.append(found.cells)
    assert total / len(fields) == pytest.approx(0.04, rel=0.01)
    assert np.nanmean(fields) == pytest.approx(0.04, rel=0.02)
    assert fields[0].shape == cells


def test_granular_temperature_of_a_single_particle_is_nan() -> None:
    cells = measures.cells_of(np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 1.5], [9.0, 0.0, 0.0]]), (2, 1, 1), (1.0, 1.0, 1.0))
    assert cells.inside.tolist() == [True, True, False]
    found = measures.granular_temperature(np.ones((3, 3)), cells)
    assert np.isnan(found.cells).all()
    assert np.isnan(found.mean)


def test_cell_numbers_follow_the_order_of_fields() -> None:
    cells = measures.cells_of(np.array([[2.5, 1.5, 0.5], [0.1, 0.1, 1.9]]), (2, 2, 3), (1.0, 1.0, 1.0))
    assert np.transpose(np.unravel_index(cells.cell, cells.shape)).tolist() == [[0, 1, 2], [1, 0, 0]]


def test_mixing_indices_of_segregated_and_mixed_beds() -> None:
    lacey, nearest = [], []
    position = random().uniform(0.0, 1.0, (2000, 3))
    cells = measures.cells_of(position, (5, 5, 5), (0.2, 0.2, 0.2))
    apart = position[:, 2] > 0.4
    assert measures.lacey_index(apart, cells) == pytest.approx(0.0, abs=1e-9)
    assert measures.neighbour_mixing_index(apart, position) < 0.2
    for seed in range(100):
        mixed = random(seed).permutation(apart)
        lacey.append(measures.lacey_index(mixed, cells))
        nearest.append(measures.neighbour_mixing_index(mixed, position))
    for values in (lacey, nearest):
        assert np.mean(values) == pytest.approx(1.0, abs=3.0 * np.std(values) / 10.0)
        assert np.std(values) < 0.03
    half = np.where(position[:, 0] < 0.5, apart, random().permutation(apart)).astype(bool)
    assert 0.3 < measures.neighbour_mixing_index(half, position) < 0.7


def test_neighbour_mixing_index_of_three_species() -> None:
    position, species = random().uniform(0.0, 1.0, (3000, 3)), np.arange(3000) % 3
    found = [measures.neighbour_mixing_index(random(seed).permutation(species), position) for seed in range(30)]
    assert np.mean(found) == pytest.approx(1.0, abs=3.0 * np.std(found) / np.sqrt(30.0))
    layers = np.searchsorted(np.quantile(position[:, 2], [1 / 3, 2 / 3]), position[:, 2])
    assert measures.neighbour_mixing_index(layers, position) < 0.3


def test_lacey_index_of_a_random_mixture_is_one_in_small_samples() -> None:
    """Twelve particles in four cells, shuffled 4 000 times; without the finite-sample terms the mean would be 0.89."""
    position = np.column_stack([np.arange(12) % 4 + 0.5, np.full((12, 2), 0.5)])
    cells = measures.cells_of(position, (1, 1, 4), (1.0, 1.0, 1.0))
    values = [measures.lacey_index(random(seed).permutation(12) < 5, cells) for seed in range(4000)]
    assert np.mean(values) == pytest.approx(1.0, abs=0.02)


def test_mixing_indices_of_an_ordered_mixture_exceed_one() -> None:
    grid = np.stack(np.meshgrid(*[np.arange(10.0)] * 3), -1).reshape(-1, 3)
    board = grid.sum(axis=1) % 2 == 0
    assert measures.neighbour_mixing_index(board, grid, neighbours=6) > 1.5
    assert measures.lacey_index(board, measures.cells_of(grid, (5, 5, 5), (2.0, 2.0, 2.0))) > 1.0
    assert np.isnan(measures.neighbour_mixing_index(np.ones(1000, bool), grid))
    assert np.isnan(measures.lacey_index(np.ones(1000, bool), measures.cells_of(grid, (5, 5, 5), (2.0, 2.0, 2.0))))


# ---------------------------------------------------------------- bubbles


def bed_with(spheres: list[tuple[float, float, float, float]], shift: float = 0.0) -> np.ndarray:
    """Voidage 0.4 up to 0.8 m and 1 above, cells of 0.02 m, with empty spheres (x, y, z, diameter) in it."""
    z, y, x = np.meshgrid((np.arange(50) + 0.5) * 0.02, *[(np.arange(20) + 0.5) * 0.02] * 2, indexing="ij")
    voidage = np.where(z < 0.8, 0.4, 1.0)
    for cx, cy, cz, diameter in spheres:
        dx = (x - cx - shift + 0.2) % 0.4 - 0.2  # as if x repeated
        voidage[dx**2 + (y - cy) ** 2 + (z - cz) ** 2 < 0.25 * diameter**2] = 0.95
    return voidage


def test_bubbles_have_the_right_size_and_position_and_exclude_the_freeboard() -> None:
    known = [(0.11, 0.21, 0.3, 0.14), (0.27, 0.15, 0.55, 0.18)]
    found = bubbles.find_bubbles(bed_with(known), (0.02, 0.02, 0.02))
    assert len(found) == 2
    for bubble, (x, y, z, diameter) in zip(found, known):
        assert bubble["centroid"] == pytest.approx([x, y, z], abs=0.003)
        assert bubble["diameter"] == pytest.approx(diameter, rel=0.03)
        assert bubble["volume"] == pytest.approx(np.pi / 6.0 * bubble["diameter"] ** 3)


def test_bubbles_that_break_the_surface_are_excluded() -> None:
    field = bed_with([(0.2, 0.2, 0.3, 0.1), (0.2, 0.2, 0.76, 0.16)])
    assert len(bubbles.find_bubbles(field, (0.02, 0.02, 0.02))) == 1
    assert len(bubbles.find_bubbles(field, (0.02, 0.02, 0.02), surface=0.8)) == 1
    assert len(bubbles.find_bubbles(field, (0.02, 0.02, 0.02), surface=0.32)) == 0
    assert len(bubbles.find_bubbles(np.full((4, 4, 4), 0.5), (1.0, 1.0, 1.0))) == 0
    assert len(bubbles.find_bubbles(field, (0.02, 0.02, 0.02), smallest=1000)) == 0


def test_solid_cells_are_not_bubbles() -> None:
    field = bed_with([(0.2, 0.2, 0.3, 0.1)])
    open_cells = np.ones(field.shape, bool)
    open_cells[:, :3] = False
    field[:30, :3] = 1.0
    assert len(bubbles.find_bubbles(field, (0.02, 0.02, 0.02))) == 2
    assert len(bubbles.find_bubbles(np.where(open_cells, field, 0.0), (0.02, 0.02, 0.02))) == 1


def test_a_bubble_across_a_periodic_side_is_counted_once() -> None:
    field = bed_with([(0.39, 0.2, 0.3, 0.14)])
    cut = bubbles.find_bubbles(field, (0.02, 0.02, 0.02), origin=(1.0, 0.0, 0.0))
    whole = bubbles.find_bubbles(field, (0.02, 0.02, 0.02), origin=(1.0, 0.0, 0.0), periodic=(True, False))
    assert len(cut) == 2
    assert len(whole) == 1
    assert whole["centroid"][0] == pytest.approx([1.39, 0.2, 0.3], abs=0.003)
    assert whole["volume"][0] == pytest.approx(cut["volume"].sum())


def test_bubbles_of_a_flat_bed_have_the_diameter_of_discs() -> None:
    z, _, x = np.meshgrid((np.arange(60) + 0.5) * 0.01, [0.5, 1.5], (np.arange(40) + 0.5) * 0.01, indexing="ij")
    field = np.where((x - 0.2) ** 2 + (z - 0.3) ** 2 < 0.01, 0.9, 0.5)
    found = bubbles.find_bubbles(field, (0.01, 0.004, 0.01), flat=True)
    assert found["diameter"] == pytest.approx([0.2], rel=0.01)


def test_number_and_size_of_bubbles_against_height() -> None:
    rows = np.zeros(300, bubbles.BUBBLE)
    rows["centroid"][:, 2] = random().uniform(0.0, 1.0, 300)
    rows["diameter"] = 0.1 + 0.2 * np.floor(2.0 * rows["centroid"][:, 2])
    found = bubbles.bubble_profile(np.array_split(rows, 50), np.array([0.0, 0.5, 1.0, 2.0]))
    assert found.number.sum() == pytest.approx(6.0)
    assert found.diameter[:2] == pytest.approx([0.1, 0.3])
    assert found.error[:2] == pytest.approx([0.0, 0.0], abs=1e-8)
    assert found.number[2] == 0.0
    assert np.isnan(found.diameter[2])


@pytest.mark.parametrize("hundreds", range(1, 40))
def test_bed_height_if_whole_spheres_add_up_to_the_share(hundreds: int) -> None:
    """Of n hundred spheres n are far above: the bed ends at the top of the others."""
    rng = np.random.default_rng(hundreds)
    height = rng.uniform(0.0, 1.0, 100 * hundreds)
    height[: 99 * hundreds].sort()
    height[99 * hundreds :] += 5.0
    place = np.column_stack([np.zeros((len(height), 2)), height])
    top = height[: 99 * hundreds].max() + 1e-3
    assert measures.bed_height(place, np.full(len(height), 1e-3)) == pytest.approx(top, abs=1e-6)
