"""A run divided among ranks, and a run with its rows in another order, have the bits of the plain run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import in_process_ranks
import numpy as np
import pytest
from example_case import TEXT as EXAMPLE
from in_process_ranks import Rank, on_ranks
from solver_options import grouped

from cfddem.backend.communicator import SERIAL, Communicator, place_of
from cfddem.backend.errors import InputError, RunFailed
from cfddem.backend.portions import collected
from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.features.feeds import Feed, ParticleOutlet
from cfddem.particles import listing
from cfddem.particles.bricks import Bricks
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, Sharing, SolverSettings
from cfddem.particles.state import Particles, make_particles
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.shapes import Box, Plane
from cfddem.particles.walls.wall import Wall
from cfddem.run import history
from cfddem.run.wall_loads import loads_of_particles

GLASS = Material(density=2500, youngs_modulus=10e6, poisson=0.25, restitution=0.8, friction=0.4, rolling_friction=0.02)
STEEL = Material(density=7800, youngs_modulus=20e6, poisson=0.3, restitution=0.9, friction=0.2, rolling_friction=0.01)
DIAMETER, STEP = 1e-3, 2e-6
WET = Laws(film=True, rolling="spring_dashpot")
DRY = Laws(rolling="spring_dashpot")


def slow(*values: bool) -> Any:
    """Parameters of a test whose loops take long to compile."""
    return pytest.param(*values, marks=pytest.mark.slow)


BRIDGES = BridgeLaws(
    viscosity=5e-3, surface_tension=0.05, film="deforming", cut="constant", tangential="davis", minimum_gap=1e-6
)


def bed(count: int = 300, film: bool = False, fast: float = 0.5) -> tuple[Particles, np.ndarray]:
    """Spheres of two sizes and materials in a periodic box, in motion, and the edges of the box."""
    draw = np.random.default_rng(2)
    diameters = DIAMETER * draw.choice([0.7, 1.0], count)
    centres, box = random_packing(diameters, 0.5, seed=3, shape=(2.0, 1.0, 1.0))
    kind = (diameters < DIAMETER).astype(int)
    spheres = make_particles(
        centres, 0.5 * diameters, np.where(kind, STEEL.density, GLASS.density), material=kind,
        velocity=draw.normal(0.0, fast, (count, 3)), spin=draw.normal(0.0, 300.0, (count, 3)),
        viscosity=draw.uniform(0.5e-3, 2e-3, count) if film else 0.0,
    )  # fmt: skip
    return spheres, box


def floor_of_triangles(size: np.ndarray) -> Mesh:
    """A wavy floor a little above the corner of a box."""
    x, y = (np.linspace(-0.2 * each, 1.2 * each, 7) for each in size[:2])
    corners = np.array([[a, b, 1e-4 * np.sin(5e3 * a) * np.cos(4e3 * b)] for a in x for b in y])
    cells = [7 * i + j for i in range(6) for j in range(6)]
    return Mesh(
        vertices=corners, triangles=np.array([t for c in cells for t in ((c, c + 7, c + 1), (c + 7, c + 8, c + 1))])
    )


def state(run: ParticleSolver) -> dict[str, np.ndarray]:
    """Particles of this rank, and what their pairs remember, with ids."""
    rows = slice(run.particles.owned)
    kept = {name: array[rows].copy() for name, array in run.particles.lasting().items()}
    first = run.edges.first < run.particles.owned
    pairs = {name: array[first].copy() for name, array in run.edges.checkpoint().items() if name in run.edges}
    return kept | pairs | {"ends": run.edges.ends(run.particles.id)[first]}


def joined(states: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The particles of all ranks by id, and the pairs in contact, with a film or with a bridge."""
    whole = {name: np.concatenate([each[name] for each in states]) for name in states[0]}
    ends = whole["ends"]
    lasting = (whole["spring"] != 0.0).any(axis=1)
    for name in ("resistance", "bridge_film"):
        lasting |= whole.get(name, np.zeros(len(ends))) > 0.0
    pairs, particles = np.flatnonzero(lasting), np.argsort(whole["id"])
    pairs = pairs[np.lexsort(ends[pairs].T[::-1])]
    return {name: each[pairs if len(each) == len(ends) else particles] for name, each in whole.items()}


def assert_same_bits(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    """All arrays are equal."""
    assert one.keys() == other.keys()
    for name in one:
        assert np.array_equal(one[name], other[name], equal_nan=True), name


def settings(film: bool, walls: bool, liquid: bool = False) -> tuple[Particles, dict[str, Any]]:
    """Particles and what else the solver takes: a periodic box, or a box of walls with a mesh as its floor."""
    spheres, box = bed(film=film)
    laws = WET if film else DRY
    if liquid:
        laws = laws._replace(bridge=BRIDGES)
        coat(spheres, np.random.default_rng(4).uniform(0.0, 2e-5, spheres.count))
    given: dict[str, Any] = {"laws": laws, "gravity": (0.0, 0.0, -9.81)}
    if not walls:
        return spheres, given | {"box": tuple(box)}
    sides: list[Wall] = [Box(low=(0.0, 0.0, -DIAMETER), high=tuple(box)), floor_of_triangles(box)]
    return spheres, given | {"walls": sides}


def finished(spheres: Particles, given: dict[str, Any], steps: int, **others: Any) -> ParticleSolver:
    """The run after some steps."""
    run = ParticleSolver(spheres, pair_table([GLASS, STEEL]), **grouped(check_steps=False, **given, **others))
    run.advance(STEP, steps)
    return run


@pytest.mark.parametrize(("film", "walls"), [slow(False, False), slow(True, False), (False, True), slow(True, True)])
def test_bits_do_not_depend_on_the_order_of_rows(film: bool, walls: bool) -> None:
    """The same spheres with the same ids in other rows, over several neighbour lists."""
    spheres, given = settings(film, walls)
    mixed = spheres.copy(np.random.default_rng(5).permutation(spheres.count))
    plain = finished(spheres, given, 300)
    assert plain.lists.made > 3
    assert_same_bits(joined([state(finished(mixed, given, 300))]), joined([state(plain)]))


@pytest.mark.slow
def test_bits_do_not_depend_on_sorting(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that sorts its rows at every list."""
    spheres, given = settings(True, False)
    plain = joined([state(finished(spheres.copy(), given, 200, skin=1e-5))])
    monkeypatch.setattr(listing, "THREADING_PAYS", 1)
    sorted_run = finished(spheres, given, 200, skin=1e-5, sort_every=1)
    assert (np.diff(sorted_run.particles.id) < 0).any()
    assert_same_bits(joined([state(sorted_run)]), plain)


@pytest.mark.parametrize(("film", "walls"), [slow(False, False), slow(True, True)])
def test_bridges_do_not_depend_on_the_order_of_rows(film: bool, walls: bool) -> None:
    """Liquid, bridges and velocities."""
    spheres, given = settings(film, walls, liquid=True)
    mixed = spheres.copy(np.random.default_rng(5).permutation(spheres.count))
    plain = finished(spheres, given, 200)
    assert plain.bridges is not None and plain.bridges.formed > plain.bridges.count > 100
    assert_same_bits(joined([state(finished(mixed, given, 200))]), joined([state(plain)]))


# ---------------------------------------------------------------- ranks


def divided(size: int, axis: int, length: float) -> Bricks:
    """Equal slabs."""
    return Bricks.slabs(axis, [length * n / size for n in range(1, size)])


def bricks(shape: Sequence[int], position: np.ndarray) -> Bricks:
    """Equal bricks between the lowest and the highest place."""
    low, high = position.min(axis=0), position.max(axis=0)
    x, y, z = ((low[d] + (high - low)[d] * np.arange(1, n) / n).tolist() for d, n in enumerate(shape))
    return Bricks((x, y, z))


@pytest.mark.parametrize("shape", [(2, 1, 1), (3, 1, 1), (2, 2, 1), (2, 2, 2)])
@pytest.mark.parametrize(
    ("film", "walls", "liquid"),
    [slow(False, False, False), slow(True, False, False), (False, True, False), slow(True, True, False),
     slow(False, False, True), slow(True, True, True)],
)  # fmt: skip
def test_a_divided_box_has_the_bits_of_the_whole_one(
    film: bool, walls: bool, liquid: bool, shape: tuple[int, int, int]
) -> None:
    """Over several lists, with particles that change their rank and pairs across the planes and the periodic border."""
    spheres, given = settings(film, walls, liquid)
    ranks = int(np.prod(shape))

    def program(communicator: Communicator) -> tuple[dict[str, np.ndarray], int, int, tuple[float, ...], Any]:
        division = bricks(shape, spheres.position)
        run = finished(spheres.copy(), given, 0, communicator=communicator, division=division)
        before, most = set(run.particles.id[: run.particles.owned].tolist()), 0
        for _ in range(3):
            run.advance(STEP, 100)
            most = max(most, run.particles.count - run.particles.owned)
        moved = len(before - set(run.particles.id[: run.particles.owned].tolist()))
        films = *run.film_counts[:2], run.largest_film_rate, run.film_counts[3]
        return state(run), moved, most, films, loads_of_particles(run)

    results = on_ranks(ranks, program)
    whole = finished(spheres.copy(), given, 0)
    for _ in range(3):
        whole.advance(STEP, 100)
    assert whole.lists.made > 3
    assert sum(moved for _, moved, *_ in results) > 2
    assert all(ghosts > 20 for _, _, ghosts, *_ in results)
    loads = loads_of_particles(whole)
    assert np.abs(loads).min(axis=(0, 2), initial=np.inf).all()  # every wall has some
    assert all(np.array_equal(found, loads) for *_, found in results)
    assert [films[:3] for *_, films, _ in results] == [(*whole.film_counts[:2], whole.largest_film_rate)] * ranks
    assert sum(films[3] for *_, films, _ in results) == whole.film_counts[3]  # each film belongs to one rank
    assert (whole.film_counts[0] == 300.0) == (film or liquid)
    assert_same_bits(joined([each for each, *_ in results]), joined([state(whole)]))


@pytest.mark.parametrize(
    ("film", "walls", "liquid"),
    [slow(False, True, False), slow(True, False, False), slow(False, True, True), slow(True, False, True)],
)
def test_ranks_count_the_energies_of_one_process(film: bool, walls: bool, liquid: bool) -> None:
    """Every channel, stored energy, and what each recorded collision has lost; pairs change their rank meanwhile."""
    spheres, given = settings(film, walls, liquid)
    length = float(spheres.position[:, 0].max())

    def program(communicator: Communicator) -> tuple[np.ndarray, np.ndarray]:
        if communicator.size > 1:
            given["division"] = divided(communicator.size, 0, length)
        run = finished(spheres.copy(), given, 0, communicator=communicator, energies=True, record=True)
        assert run.energies is not None and run.collisions is not None
        for _ in range(3):
            run.advance(STEP, 70)
        assert run.lists.made > 3
        mine = run.collisions.table
        lost = np.stack([mine[name] for name in mine.dtype.names if name.startswith("lost_to_")], axis=1)
        names = np.stack([mine["first"], mine["second"], mine["end"]], axis=1)
        rows = communicator.joined(np.concatenate([names, lost], axis=1))
        stored = [*run.energies.springs(run), run.energies.stored(run).get("bridges", 0.0)]
        return np.append(run.energies.totals, stored), rows[np.lexsort(rows[:, 2::-1].T)]

    expected, collisions = program(SERIAL)
    assert len(collisions) > 30 and np.nanmax(np.abs(collisions[:, 3:])) > 0.0
    for found, rows in on_ranks(3, program):
        assert found == pytest.approx(expected, rel=1e-10, abs=1e-12 * np.abs(expected).max())
        assert np.array_equal(rows, collisions, equal_nan=True)


def test_particles_come_and_go_on_ranks_as_in_one_process() -> None:
    """A feed and an outlet; ids, particles and counts are the same."""

    def program(communicator: Communicator) -> tuple[dict[str, np.ndarray], list[float]]:
        first = make_particles([[1e-3, 2e-3, 5e-3], [4e-3, 2e-3, 5e-3]], 0.5e-3, GLASS.density)
        division = Bricks.slabs(0, [2.5e-3]) if communicator.size == 2 else None
        run = ParticleSolver(
            first, pair_table([GLASS]), walls=[Plane()], gravity=(0.0, 0.0, -9.81), settings=SolverSettings(skin=2e-4),
            sharing=Sharing(communicator=communicator, division=division),
        )  # fmt: skip
        feed = Feed(
            3e4, (0.0, 0.0, 6e-3), (5e-3, 4e-3, 0.0), lambda n, draw: draw.uniform(6e-4, 1e-3, n), GLASS.density,
            velocity=(0.2, 0.0, -1.0), seed=1,
        )  # fmt: skip
        outlet = ParticleOutlet(high=(4.5e-3, np.inf, np.inf))
        for _ in range(12):
            feed(run)
            run.advance(5e-6, 50)
            outlet(run)
        return state(run), [feed.entered, len(feed.waiting), outlet.left, outlet.mass]

    one, counts = program(SERIAL)
    many = on_ranks(2, program)
    assert counts[0] > 40 and counts[2] > 3
    assert [each[1][:3] for each in many] == [counts[:3]] * 2
    assert many[0][1][3] == pytest.approx(counts[3], rel=1e-12)
    assert_same_bits(joined([each for each, _ in many]), joined([one]))


@pytest.mark.slow
def test_a_divided_run_is_resumed_with_the_same_bits() -> None:
    """From the state by ids."""
    spheres, given = settings(True, True)
    division = divided(2, 0, float(spheres.position[:, 0].max()))

    def program(communicator: Communicator) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        straight, again = (
            finished(spheres.copy(), given, 0, communicator=communicator, division=division) for _ in range(2)
        )
        straight.advance(STEP, 70)
        again.restore(collected(straight.checkpoint(), communicator))
        for run in (straight, again):
            run.advance(STEP, 70)
        return state(again), state(straight)

    results = on_ranks(2, program)
    assert_same_bits(joined([again for again, _ in results]), joined([straight for _, straight in results]))


@pytest.mark.parametrize(("before", "after"), [(1, 2), (3, 2), (3, 1)])
@pytest.mark.parametrize(("film", "liquid"), [(False, False), slow(True, False), slow(False, True)])
def test_a_checkpoint_goes_on_with_another_number_of_ranks(film: bool, liquid: bool, before: int, after: int) -> None:
    """With moving triangles, between two lists; the bits are those of a run without a stop."""
    spheres, given = settings(film, True, liquid)
    given["walls"] = [given["walls"][0], replace(given["walls"][1], velocity=(0.1, 0.0, 0.3))]
    length = float(spheres.position[:, 0].max())

    def made(communicator: Communicator) -> ParticleSolver:
        space = divided(communicator.size, 0, length) if communicator.size > 1 else None
        return finished(spheres.copy(), given, 0, communicator=communicator, division=space)

    def begun(communicator: Communicator) -> Any:
        run = made(communicator)
        run.advance(STEP, 70)
        return collected(run.checkpoint(), communicator)

    def resumed(communicator: Communicator) -> dict[str, np.ndarray]:
        run = made(communicator)
        run.restore(kept)
        run.advance(STEP, 130)
        return state(run)

    kept = on_ranks(before, begun)[0]
    straight = made(SERIAL)
    straight.advance(STEP, 70)
    straight.advance(STEP, 130)
    assert straight.lists.made > 3
    assert_same_bits(joined(on_ranks(after, resumed)), joined([state(straight)]))


def test_a_failure_on_one_rank_stops_all() -> None:
    """After the first step; the message names the same particle on every rank."""
    spheres, given = settings(False, False)

    def program(communicator: Communicator) -> str:
        division = divided(2, 0, given["box"][0])
        run = finished(spheres.copy(), given, 0, communicator=communicator, division=division)
        run.particles.velocity[run.particles.id == 7] = np.nan
        with pytest.raises(RunFailed) as failure:
            run.advance(STEP, 10)
        assert run.steps == 1
        return str(failure.value)

    one, other = on_ranks(2, program)
    assert one == other and "is NaN" in one


def test_what_ranks_cannot_share_is_refused() -> None:
    """Space that is not divided, a number of bricks that does not fit, and an earlier run over other particles."""
    spheres, given = settings(False, False)

    def program(communicator: Communicator) -> None:
        with pytest.raises(InputError, match="bricks"):
            finished(spheres.copy(), given, 0, communicator=communicator, division=Bricks.slabs(0, []))
        with pytest.raises(InputError, match="division"):
            finished(spheres.copy(), given, 0, communicator=communicator)
        shared: dict[str, Any] = {"communicator": communicator, "division": Bricks.slabs(0, [1e-3])}
        before = finished(spheres.copy(), given, 0, **shared)
        with pytest.raises(InputError, match="ids differ"):
            finished(spheres.copy(slice(10, None)), given, 0, after=before, **shared)

    on_ranks(2, program)


@pytest.mark.parametrize(
    ("film", "walls", "liquid"), [(False, True, False), slow(True, False, False), slow(True, True, True)]
)
def test_a_run_after_another_takes_over_its_pairs_on_ranks(film: bool, walls: bool, liquid: bool) -> None:
    """From four bricks to three slabs; the bits of two runs in one process. Without the memory they would differ."""
    spheres, given = settings(film, walls, liquid)

    def program(communicator: Communicator, remember: bool = True) -> dict[str, np.ndarray]:
        shared: list[dict[str, Any]] = [{}, {}]
        if communicator.size > 1:
            shared = [
                {"communicator": communicator, "division": bricks(shape, spheres.position)}
                for shape in ((2, 1, 2), (1, 4, 1))
            ]
        run = finished(spheres.copy(), given, 150, **shared[0])
        owned = run.particles.without_ghosts().lasting()
        order = np.argsort(communicator.joined(owned["id"]))
        between = spheres.copy()
        for field in run.laws.particle_fields():
            between.declare(field)
        between.restore({name: communicator.joined(each)[order] for name, each in owned.items()})
        return state(finished(between, given, 100, after=run if remember else None, **shared[1]))

    alone = joined([program(SERIAL)])
    assert_same_bits(joined(on_ranks(4, program)), alone)
    assert not np.array_equal(joined([program(SERIAL, remember=False)])["velocity"], alone["velocity"])


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(3, 1, 1), (2, 2, 1), (2, 2, 2)])
def test_liquid_on_walls_is_shared(shape: tuple[int, int, int]) -> None:
    """Particles, bridges and patches of one process; bridges of several ranks draw from one patch."""
    spheres, given = settings(False, True, True)
    laws = given["laws"]._replace(
        bridge=replace(BRIDGES, wall_share=0.5, wall_film=1e-5, wall_patch=4.0 * DIAMETER, contact_angle=0.3)
    )
    floor = replace(given["walls"][1], velocity=(0.1, 0.0, 0.3))
    given |= {"laws": laws, "walls": [given["walls"][0], floor]}

    def program(communicator: Communicator) -> tuple[dict[str, np.ndarray], np.ndarray, list[float]]:
        shared: dict[str, Any] = {}
        if communicator.size > 1:
            shared = {"communicator": communicator, "division": bricks(shape, spheres.position)}
        run = finished(spheres.copy(), given, 0, **shared)
        for _ in range(3):
            run.advance(STEP, 100)
        count, bridges = int(run.walls.patch_count[0]), run.bridges
        assert bridges is not None
        patches = np.stack([run.walls.patch_key[:count].astype(float), run.walls.patch_liquid[:count]])
        return state(run), patches, [bridges.formed, bridges.broken, bridges.liquid, bridges.gained_by_walls]

    alone, patches, liquid = program(SERIAL)
    assert patches.shape[1] > 5 and liquid[1] > 10
    found = on_ranks(int(np.prod(shape)), program)
    for _, others, counted in found:
        assert np.array_equal(others, patches) and counted == liquid
    assert_same_bits(joined([each for each, *_ in found]), joined([alone]))


def test_a_measure_of_one_process_is_refused_on_ranks() -> None:
    """By its name, unless it says that it sums over the ranks."""
    case = Case.from_text(EXAMPLE)

    @history.measure("m/s")
    def mean_speed(simulation: Any) -> float:
        return float(np.linalg.norm(simulation.particles.velocity, axis=1).mean())

    try:
        history.require_shared(case, 1)
        with pytest.raises(InputError, match="mean_speed"):
            history.require_shared(case, 2)
        history.forget("mean_speed")
        history.measure("m/s", shared=True)(mean_speed)
        history.require_shared(case, 2)
    finally:
        history.forget("mean_speed")


# ---------------------------------------------------------------- many ranks


def many(shape: tuple[int, int, int]) -> Any:
    """A shape of a test that takes long."""
    return pytest.param(shape, marks=pytest.mark.slow)


class Counted(Rank):
    """A rank that counts how often all ranks write to all."""

    to_all = 0

    def _given_by_all(self, numbers: Any) -> Any:
        self.to_all += 1
        return super()._given_by_all(numbers)


@pytest.mark.parametrize("shape", [(3, 3, 1), *map(many, [(3, 3, 3), (27, 1, 1), (64, 1, 1), (4, 4, 4)])])
def test_many_ranks_write_to_their_neighbours_only(
    shape: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bits of one process over several lists in a box of walls; all write to all at the first list alone."""
    monkeypatch.setattr(in_process_ranks, "Rank", Counted)
    box, ranks = 4.0 * DIAMETER * np.array(shape), int(np.prod(shape))
    places = (np.indices(3 * np.array(shape)).reshape(3, -1).T + 0.5) * (4.0 / 3.0 * DIAMETER)
    velocity = np.random.default_rng(5).normal(0.0, 1.0, places.shape)
    spheres = make_particles(places, 0.5 * DIAMETER, GLASS.density, velocity=velocity)
    walls: list[Wall] = [Box(low=(0.0, 0.0, -DIAMETER), high=tuple(box)), floor_of_triangles(box)]
    given: dict[str, Any] = {"laws": DRY, "gravity": (0.0, 0.0, -9.81), "walls": walls}

    def program(communicator: Any) -> tuple[dict[str, np.ndarray], int, int, int, int]:
        x, y, z = ((box[d] * np.arange(1, n) / n).tolist() for d, n in enumerate(shape))
        run = finished(spheres.copy(), given, 400, communicator=communicator, division=Bricks((x, y, z)))
        here, partners = np.array(place_of(communicator.rank, shape)), communicator.partners
        farthest = max(int(np.abs(np.subtract(place_of(other, shape), here)).max()) for other in partners)
        return state(run), run.lists.made, communicator.to_all, farthest, len(partners)

    results, alone = on_ranks(ranks, program), finished(spheres.copy(), given, 400)
    assert alone.lists.made > 3
    assert [result[1:4] for result in results] == [(alone.lists.made, 1, 1)] * ranks
    assert max(result[4] for result in results) == np.prod(np.minimum(shape, 3)) - 1
    assert_same_bits(joined([each for each, *_ in results]), joined([state(alone)]))
