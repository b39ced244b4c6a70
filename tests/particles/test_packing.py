"""Packings, lattices and size distributions; and neighbour lists against a search through all pairs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.particles import listing
from cfddem.particles.initial.packing import (
    OVERLAP_LIMIT,
    PackingFailed,
    from_table,
    lattice,
    log_normal,
    mono,
    normal,
    random_packing,
)
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.neighbours import wrap
from cfddem.particles.pair_graph import HOME
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import Particles, make_particles


def nearest_images(position: np.ndarray, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Separation of every pair to its nearest image (N, N, 3), and how many boxes lie between."""
    apart = position[:, None] - position[None]
    shift = np.where(np.isfinite(box), np.round(apart / box), 0.0)
    return apart - shift * np.where(np.isfinite(box), box, 0.0), shift


SIZES = {
    "equal": mono(300, 1e-3),
    "normal": normal(300, 1e-3, 2e-4, seed=1),
    "ratio 10": from_table(300, np.array([1e-3, 3e-3, 1e-2]), np.array([0.6, 0.3, 0.1]), seed=1),
}


@pytest.mark.parametrize("walled", [(), (2,), (0, 1, 2)], ids=["periodic", "floor and lid", "six walls"])
@pytest.mark.parametrize(
    ("sizes", "fraction"),
    [
        ("equal", 0.3),
        ("equal", 0.55),
        ("normal", 0.3),
        ("normal", 0.55),
        ("ratio 10", 0.3),
        ("ratio 10", 0.55),
    ],
)
def test_random_packing_has_its_fraction_and_no_overlap(sizes: str, fraction: float, walled: tuple[int, ...]) -> None:
    """Solid fraction to rounding; overlap of pairs below the stated limit by a search through all, of walls none."""
    fraction = min(fraction, 0.4) if len(walled) == 3 else fraction  # in a box of a few diameters between walls
    diameters = SIZES[sizes]
    periodic = (0 not in walled, 1 not in walled, 2 not in walled)
    centres, box = random_packing(diameters, fraction, seed=7, shape=(1.0, 1.5, 1.0), periodic=periodic)
    assert np.sum(np.pi / 6.0 * diameters**3) / np.prod(box) == pytest.approx(fraction, rel=1e-12)
    assert box / box[0] == pytest.approx([1.0, 1.5, 1.0], rel=1e-12)
    assert ((centres >= 0.0) & (centres <= box)).all()
    apart, _ = nearest_images(centres, np.where(periodic, box, np.inf))
    radius = 0.5 * diameters
    for axis in walled:
        assert (centres[:, axis] - radius >= 0.0).all()
        assert (centres[:, axis] + radius <= box[axis] * (1.0 + 1e-15)).all()
    smaller = np.minimum(radius[:, None], radius[None])
    overlap = (radius[:, None] + radius[None] - np.linalg.norm(apart, axis=2)) / smaller
    np.fill_diagonal(overlap, -1.0)
    assert overlap.max() <= OVERLAP_LIMIT * (1.0 + 1e-9)


def test_same_seed_same_packing() -> None:
    """Bit for bit; another seed gives another packing."""
    first, second, other = (random_packing(mono(200, 1e-3), 0.5, seed)[0] for seed in (3, 3, 4))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, other)


def test_packing_that_cannot_be_reached_says_so_in_one_line() -> None:
    """No overlapping packing is handed out instead."""
    with pytest.raises(PackingFailed, match=r"^a solid fraction of 0.7 leaves overlaps of [^\n]*; ask for less[^\n]*$"):
        random_packing(mono(100, 1e-3), 0.7, seed=1, most_sweeps=200)
    for fraction in (0.0, 0.74, -1.0):
        with pytest.raises(InputError, match="solid_fraction"):
            random_packing(mono(100, 1e-3), fraction, seed=1)
    with pytest.raises(InputError, match=r"shape\[0\]"):
        random_packing(mono(10, 1e-3), 0.3, seed=1, shape=(1.0, 20.0, 20.0), periodic=(False, True, True))


def test_lattice_fills_its_room_without_overlap() -> None:
    """As many as fit at the spacing, inside the room, shaken or not, from below."""
    room = ((0.0, 1.0, 0.0), (0.01, 1.02, 0.005))
    still, shaken = lattice(1e-3, room), lattice(1e-3, room, seed=5)
    assert len(still) == 9 * 19 * 4
    assert (np.diff(still[:, 2]) >= 0.0).all()
    for centres in (still, shaken):
        assert (centres - 0.5e-3 >= room[0]).all()
        assert (centres + 0.5e-3 <= room[1]).all()
        distance = np.linalg.norm(centres[:, None] - centres[None], axis=2) + np.eye(len(centres))
        assert distance.min() >= 1e-3 * (1.0 - 1e-12)
    assert np.abs(shaken - still).max() > 0.0
    with pytest.raises(InputError, match="room"):
        lattice(1e-3, ((0.0, 0.0, 0.0), (0.01, 0.01, 1e-4)))


def test_moments_of_size_distributions() -> None:
    """Mean and deviation within four standard errors; nothing beyond the cut at three deviations.

    A normal distribution cut at three deviations has 0.98658 of its deviation; a log-normal one whose logarithm
    is clipped there has mean logarithm 0 and deviation 0.9985.
    """
    count = 40_000
    drawn = normal(count, 1e-3, 1e-4, seed=1)
    assert drawn.mean() == pytest.approx(1e-3, abs=4e-4 / math.sqrt(count))
    assert drawn.std() == pytest.approx(0.98658e-4, rel=0.015)
    assert np.abs(drawn - 1e-3).max() <= 3e-4
    logarithm = np.log(log_normal(count, 2e-3, 0.3, seed=2) / 2e-3)
    assert logarithm.mean() == pytest.approx(0.0, abs=4 * 0.3 / math.sqrt(count))
    assert logarithm.std() == pytest.approx(0.9985 * 0.3, rel=0.015)
    assert np.abs(logarithm).max() <= 0.9 * (1.0 + 1e-12)
    classes, shares = np.array([1e-3, 2e-3, 4e-3]), np.array([5.0, 3.0, 2.0])
    table = from_table(count, classes, shares, seed=3)
    found = [(table == size).mean() for size in classes]
    assert found == pytest.approx([0.5, 0.3, 0.2], abs=4 * 0.5 / math.sqrt(count))
    assert normal(1000, 1e-3, 0.5e-3, seed=1).min() >= 1e-4


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: mono(3, 0.0), "diameter"),
        (lambda: normal(3, math.nan, 1.0, 1), "mean"),
        (lambda: log_normal(3, -1.0, 0.1, 1), "median"),
        (lambda: from_table(3, np.array([1.0, 2.0]), np.array([0.0, 0.0]), 1), "number_fractions"),
        (lambda: from_table(3, np.array([1.0, 2.0]), np.array([1.0, -1.0]), 1), "number_fractions"),
    ],
)
def test_bad_sizes_are_refused_by_name(make: object, field: str) -> None:
    """The message begins with the field."""
    with pytest.raises(InputError, match=f"^{field}"):
        make()  # type: ignore[operator]


INF = math.inf
GLASS = Material(density=2500, youngs_modulus=10e6, poisson=0.25, roughness=1e-6)


def listed(spheres: Particles, film: bool, skin: float, box: np.ndarray) -> ParticleSolver:
    """A run over these spheres, as it begins: with its first list."""
    sides = tuple(length if np.isfinite(length) else None for length in box)
    return ParticleSolver(
        spheres, pair_table([GLASS]), laws=Laws(film=film), box=sides, settings=SolverSettings(skin=skin)
    )  # type: ignore[arg-type]


@pytest.mark.parametrize("ratio", [1.0, 3.0, 15.0])
@pytest.mark.parametrize("film", [0.0, 1.0])
@pytest.mark.parametrize("box", [(INF, INF, INF), (1.0, 1.0, 1.0), (1.0, 0.7, INF)], ids=["open", "periodic", "mixed"])
@pytest.mark.parametrize("tight", [False, True], ids=["roomy", "tight"])
def test_list_is_that_of_a_search_through_all_pairs(
    ratio: float, film: float, box: tuple[float, float, float], tight: bool
) -> None:
    """Every pair within reach once, none beyond, sorted, with the right image; also in the smallest box allowed."""
    generator = np.random.default_rng(int(10 * ratio) + int(film))
    box_size = np.array(box)
    skin = 0.01
    room = np.where(np.isfinite(box_size), box_size, 1.0)
    largest = (0.5 * room.min() - skin) / (2.0 + 0.5 * film) * (1.0 - 1e-9) if tight else 0.06
    radius = largest * ratio ** -generator.uniform(0.0, 1.0, 250)
    radius[:2] = largest, largest / ratio
    position = generator.uniform(0.0, 1.0, (250, 3)) * room
    position[:3] = 0.0  # corners belong to the box
    wrap(position, box_size)
    spheres = make_particles(position, radius, 1000.0)
    found = listed(spheres, film > 0.0, skin, box_size).edges
    apart, shift = nearest_images(spheres.position, box_size)
    touch = radius[:, None] + radius[None]
    reach = touch + film * radius[:, None] * radius[None] / touch + skin
    near = np.triu(np.linalg.norm(apart, axis=2) < reach, 1)
    first, second = np.nonzero(near)
    assert found.between_particles == len(first)
    order = np.lexsort((found.second, found.first))  # pairs that have films alone come after those that may touch
    assert np.array_equal(found.first[order], first)
    assert np.array_equal(found.second[order], second)
    code = HOME - (shift[first, second] @ [9.0, 3.0, 1.0])
    assert np.array_equal(found.image[order], code.astype(int))
    gap = np.linalg.norm(apart, axis=2)[found.first, found.second] - touch[found.first, found.second]
    assert found.near == found.between_particles or gap[found.near :].min() > skin


def test_box_too_small_for_one_image_of_a_pair_is_refused() -> None:
    """Below twice the reach a pair could meet itself in two images."""
    spheres = make_particles(np.full((2, 3), 0.5), 0.3, 1000.0)
    with pytest.raises(InputError, match="box"):
        listed(spheres, False, 0.01, np.array([1.0, 1.0, 1.0]))


@pytest.mark.parametrize("film", [False, True])
def test_memory_goes_with_the_pair_through_lists_and_sorting(film: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A spring written as a function of the two ids is that function after listing and sorting."""
    monkeypatch.setattr(listing, "THREADING_PAYS", 1)
    centres, box = random_packing(mono(400, 1e-3), 0.55, seed=9)
    shuffled = centres[np.random.default_rng(1).permutation(len(centres))]
    spheres = make_particles(shuffled, 0.5e-3, 2500.0, viscosity=1e-3 if film else 0.0)
    run = ParticleSolver(
        spheres, pair_table([GLASS]), laws=Laws(film=film), box=tuple(box), settings=SolverSettings(sort_every=1)
    )

    def expected() -> tuple[np.ndarray, np.ndarray]:
        one, other = (run.particles.id[row].astype(float) for row in (run.edges.first, run.edges.second))
        return (one**1.5 - other**1.5)[:, None] * [1.0, -2.0, 3.0], one * other + 1.0

    springs, speeds = expected()
    run.edges.spring[:] = springs
    if film:
        run.edges.approach_speed[:] = speeds
    ids = run.particles.id.copy()
    pairs_before = set(zip(*(np.sort([ids[run.edges.first], ids[run.edges.second]], axis=0).tolist())))
    # move the corner of the box, so that the next sorting takes another order
    run.particles.position[:] += 0.37 * box
    run._relist()
    assert not np.array_equal(ids, run.particles.id)
    assert (run.edges.first > run.edges.second).sum() > 0
    assert (run.particles.id[run.edges.first] < run.particles.id[run.edges.second]).all()
    springs, speeds = expected()
    now = zip(*(np.sort([run.particles.id[run.edges.first], run.particles.id[run.edges.second]], axis=0).tolist()))
    kept = np.array([pair in pairs_before for pair in now])
    assert kept.sum() == len(pairs_before)  # the skin grew: none was dropped
    assert np.array_equal(run.edges.spring[kept], springs[kept])
    if film:
        assert np.array_equal(run.edges.approach_speed[kept], speeds[kept])
