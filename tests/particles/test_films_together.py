"""Films of many bodies, solved together: exact cases, a direct solution of networks, energy and momentum."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from in_process_ranks import on_ranks
from scipy.sparse.linalg import spsolve
from solver_options import grouped
from test_ghosts import assert_same_bits, joined, state

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import use_threads
from cfddem.case.materials import Material
from cfddem.particles.bricks import Bricks
from cfddem.particles.interactions.film import WEAK
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import kinetic_energy, make_particles
from cfddem.particles.walls.shapes import Plane
from closures import tangential_lubrication as tangential
from closures.lubrication import film_potential_change, film_resistance
from scenarios.validation.particles.granular_beds import suspension

RADIUS, VISCOSITY, GAP = 5e-5, 0.05, 2e-7
SPHERE = Material(
    density=2500, youngs_modulus=50e9, contact_modulus=1e7, poisson=0.25, restitution=1.0, friction=0.0, roughness=1e-9
)
MASS = SPHERE.density * 4.0 / 3.0 * math.pi * RADIUS**3
STRENGTH = 6.0 * math.pi * VISCOSITY * (0.5 * RADIUS) ** 2
STEP_OF_ONE = 0.5 * MASS * GAP / STRENGTH
"""Time step at which the damping number X of a pair is 1 [s]."""

TIGHT = 1e-6


def row_of(spheres: int, held: list[int], tolerance: float = TIGHT, **options: Any) -> ParticleSolver:
    """Spheres in a row along x, GAP apart, some of them held."""
    places = np.zeros((spheres, 3))
    places[:, 0] = np.arange(spheres) * (2.0 * RADIUS + GAP)
    fixed = np.isin(np.arange(spheres), held)
    made = make_particles(places, RADIUS, SPHERE.density, viscosity=VISCOSITY, fixed=fixed)
    laws = Laws(film=True, film_tolerance=tolerance)
    return ParticleSolver(made, pair_table([SPHERE]), laws=laws, **grouped(check_steps=False, **options))


def gaps_of(run: ParticleSolver) -> np.ndarray:
    """Gaps along the row [m]."""
    return np.diff(np.sort(run.particles.position[:, 0])) - 2.0 * RADIUS


def film_force(run: ParticleSolver, particle: int, step: float) -> np.ndarray:
    """Mean force of all films on a particle in the last step [N]."""
    edges, row = run.edges, int(np.flatnonzero(run.particles.id == particle)[0])
    pairs = np.arange(len(edges.first)) < edges.between_particles
    sign = (edges.first == row).astype(float) - ((edges.second == row) & pairs)
    impulse: np.ndarray = sign @ edges.impulse
    return impulse / step


@pytest.mark.parametrize("damping", [0.1, 1.0, 10.0])
def test_a_chain_under_a_force_closes_at_its_exact_rate(damping: float) -> None:
    """Eight spheres against a held one: gaps close as exp(-F t/A), within the inertia of the chain, which is 1.3 %."""
    step = damping * STEP_OF_ONE
    force = 1e3 * STRENGTH
    run = row_of(9, [0])
    run.particles.applied[run.particles.id == 8, 0] = -force
    steps = round(1.5e-4 / step)
    run.advance(step, steps)
    before = gaps_of(run)
    run.advance(step, steps)
    rate = np.log(before / gaps_of(run)) / (steps * step) / 1e3
    assert rate == pytest.approx(np.ones(8), abs=0.015)
    assert rate[-1] == pytest.approx(1.003, abs=1e-3)


@pytest.mark.parametrize("between", [1, 8])
@pytest.mark.parametrize("damping", [0.1, 1.0, 10.0])
def test_two_plates_that_close_feel_the_sum_of_the_gaps(damping: float, between: int) -> None:
    """Free spheres between two held ones that approach: the force is A U/sum(h) within 1e-3 at any X."""
    step, speed = damping * STEP_OF_ONE, 50.0 * GAP
    run = row_of(between + 2, [0, between + 1])
    run.particles.velocity[run.particles.id == between + 1, 0] = -speed
    run.advance(step, max(30, round(200.0 * between**2 * STEP_OF_ONE / step)))
    force = film_force(run, between + 1, step)[0]
    assert force * gaps_of(run).sum() / (STRENGTH * speed) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("ranks", [1, 2])
def test_impulses_that_are_lost_beside_the_new_ones_do_no_harm(ranks: int) -> None:
    """A row at rest in its films, with impulses of 1e-40 of the next ones, is pulled apart: as if they were zero.

    Two ranks share the row, with a film between them: the same bits.
    """

    def speeds(last: float, communicator: Communicator) -> np.ndarray:
        division = Bricks.slabs(0, [3.0 * RADIUS]) if communicator.size > 1 else None
        run = row_of(4, [], tolerance=1e-3, communicator=communicator, division=division)
        run.particles.velocity[:, 0] = np.where(run.particles.id == 3, 1e-3, 0.0)
        run.edges.impulse[:, 0] = last
        run.advance(10.0 * STEP_OF_ONE)
        owned = run.particles.without_ghosts()
        return owned.velocity[np.argsort(owned.id)]

    (first,) = on_ranks(1, lambda communicator: speeds(0.0, communicator))
    assert 0.0 < np.ptp(first[:, 0]) < 1e-3
    for last in (0.0, 1e-40, -1e-40):
        found = on_ranks(ranks, lambda communicator, last=last: speeds(last, communicator))  # type: ignore[misc]
        assert np.array_equal(np.concatenate(found), first)


@pytest.mark.parametrize("damping", [0.1, 10.0, 1000.0])
def test_a_sphere_between_two_that_approach_stays(damping: float) -> None:
    """Two held spheres that approach by U each: the middle one does not move, and each side feels A 2U/(2h)."""
    step, speed = damping * STEP_OF_ONE, 1e-3 * GAP / (damping * STEP_OF_ONE)
    run = row_of(3, [0, 2])
    run.particles.velocity[run.particles.id == 0, 0] = speed
    run.particles.velocity[run.particles.id == 2, 0] = -speed
    run.advance(step)
    middle = run.particles.id == 1
    assert np.abs(run.particles.velocity[middle]).max() < 1e-12 * speed
    mean = 0.5 * (GAP + float(gaps_of(run)[0]))
    assert film_force(run, 0, step)[0] == pytest.approx(-STRENGTH * speed / mean, rel=1e-6)
    assert film_force(run, 2, step)[0] == pytest.approx(STRENGTH * speed / mean, rel=1e-6)


# ---------------------------------------------------------------- networks against a direct solution


class Direct:
    """The coupled step of the films of a run, by Newton's method and a sparse direct solution.

    step  [s]
    weak  with those that act by themselves in the run

    M (v' - v) = -G^T [A (L(h + u' dt) - L(h)), K r' dt], with the rates u', r' after the step; walls and held bodies
    have an infinite mass.
    """

    def __init__(self, run: ParticleSolver, step: float, sliding: bool, weak: bool = False) -> None:
        self.run, self.step, self.sliding = run, step, sliding
        spheres, edges = run.particles, run.edges
        inverse = spheres.inverse_mass[edges.first]
        inverse[: edges.between_particles] += spheres.inverse_mass[edges.second[: edges.between_particles]]
        rate = edges.resistance * inverse * (run.gap > 0.0)
        films = np.flatnonzero(rate > 0.0 if weak else step * rate >= WEAK)
        self.first, self.second = edges.first[films].astype(int), edges.second[films].astype(int)
        self.pair = films < edges.between_particles
        n, count = len(films), spheres.count
        self.gap, self.least = run.gap[films], edges.minimum_gap[films].copy()
        self.strength = edges.resistance[films] * np.maximum(self.gap, self.least)
        self.sliding_resistance = edges.shear_resistance[films].copy() if sliding else np.zeros(n)
        normal = np.zeros((n, 3))
        other, radius = np.where(self.pair, self.second, 0), spheres.radius
        between = spheres.position[self.first] - spheres.position[other]
        between -= np.where(np.isfinite(run.box), run.box, 0.0) * np.round(between / run.box)
        normal[self.pair] = (between / np.linalg.norm(between, axis=1)[:, None])[self.pair]
        apart = spheres.velocity[self.first] - spheres.velocity[other]
        along = (apart * normal).sum(axis=1)
        aside = ((apart - along[:, None] * normal) ** 2).sum(axis=1)
        passing = np.minimum(0.5 * step * aside / (radius[self.first] + radius[other] + self.gap), np.abs(along))
        self.passing = np.where(self.pair, passing, 0.0)
        normal[~self.pair] = edges.touch[films[~self.pair] - edges.between_particles, :3]
        self.reduced = np.where(
            self.pair, radius[self.first] * radius[other] / (radius[self.first] + radius[other]), radius[self.first]
        )
        blocks = []
        for e in range(n):
            i, j, at_pair = self.first[e], other[e], bool(self.pair[e])
            n_x = normal[e]
            across = np.eye(3) - np.outer(n_x, n_x)
            turn = np.array([[0, -n_x[2], n_x[1]], [n_x[2], 0, -n_x[0]], [-n_x[1], n_x[0], 0]])  # n x
            lever = 1.0 + self.gap[e] / (radius[i] + radius[j]) if at_pair else 1.0
            rows = np.zeros((7, 12))
            rows[0, :3], rows[0, 6:9] = n_x, -n_x
            rows[1:4, :3], rows[1:4, 6:9] = across, -across
            rows[1:4, 3:6], rows[1:4, 9:] = lever * radius[i] * turn, lever * radius[j] * turn
            rows[4:, 3:6], rows[4:, 9:] = turn, -turn
            if not at_pair:
                rows[:, 6:] = 0.0
            blocks.append((rows if sliding else rows[:1], i, j))
        height = 7 if sliding else 1
        data, row, column = [], [], []
        for e, (rows, i, j) in enumerate(blocks):
            place = np.concatenate([6 * i + np.arange(6), 6 * j + np.arange(6)])
            data.append(rows.ravel())
            row.append(np.repeat(height * e + np.arange(height), 12))
            column.append(np.tile(place, height))
        shape = (height * n, 6 * count)
        parts = (np.concatenate(data), (np.concatenate(row), np.concatenate(column)))
        self.rates = sparse.csr_matrix(parts, shape=shape)
        inverse = np.repeat(np.stack([spheres.inverse_mass, spheres.inverse_inertia], 1), 3, axis=1).ravel()
        self.inverse_inertia = inverse.copy()
        self.start = np.concatenate([spheres.velocity, spheres.spin], 1).ravel()

    def blocks(self, e: int) -> np.ndarray:
        """Resistance of film e to slip and roll (6, 6)."""
        a, b = (
            self.run.particles.radius[self.first[e]],
            self.run.particles.radius[self.second[e]] if self.pair[e] else 0,
        )
        asymmetry = (a - b) / (a + b) if self.pair[e] else -1.0
        per = self.sliding_resistance[e] / tangential.shear_resistance(1.0, self.reduced[e], asymmetry)
        both = per * tangential.shear_roll_resistance(1.0, self.reduced[e], asymmetry)
        roll = per * tangential.roll_resistance(1.0, self.reduced[e])
        return np.kron(np.array([[self.sliding_resistance[e], both], [both, roll]]), np.eye(3))

    def solve(self) -> np.ndarray:
        """Velocities and spins after a step in which only films act (N, 6)."""
        step, n, height = self.step, len(self.first), 7 if self.sliding else 1
        after = self.start.copy()
        cross = [self.blocks(e) for e in range(n)] if self.sliding else []
        for _ in range(100):
            rates = (self.rates @ after).reshape(n, height)
            rates[:, 0] += self.passing
            impulse, slope = np.zeros((n, height)), []
            for e in range(n):
                cutoff = self.reduced[e] * self.run.laws.cutoff_ratio
                change = film_potential_change(self.gap[e], step * rates[e, 0], self.least[e], cutoff)
                impulse[e, 0] = self.strength[e] * change
                end = self.gap[e] + step * rates[e, 0]
                block = np.zeros((height, height))
                block[0, 0] = step * film_resistance(self.strength[e], end, self.least[e], cutoff)
                if self.sliding:
                    impulse[e, 1:] = step * cross[e] @ rates[e, 1:]
                    block[1:, 1:] = step * cross[e]
                slope.append(block)
            free = self.inverse_inertia > 0.0
            excess = np.where(free, after - self.start, 0.0)
            excess += self.inverse_inertia * (self.rates.T @ impulse.ravel())
            if np.abs(excess).max() < 1e-13 * max(np.abs(self.start).max(), 1e-300):
                break
            matrix = sparse.eye(len(after)) + sparse.diags(self.inverse_inertia) @ (
                self.rates.T @ sparse.block_diag(slope) @ self.rates
            )
            after = after - spsolve(matrix.tocsc(), excess)
        return after.reshape(-1, 6)

    def energy(self, state: np.ndarray) -> float:
        """Kinetic energy of what moves freely [J]."""
        free = self.inverse_inertia > 0.0
        return 0.5 * float((state.ravel()[free] ** 2 / self.inverse_inertia[free]).sum())


def films_only(run: ParticleSolver) -> ParticleSolver:
    """The run without contacts."""
    run.table["contact_modulus"], run.table["shear_modulus"] = 0.0, 0.0
    run.refresh()
    return run


def network(motions: str, count: int = 300, tolerance: float = TIGHT, large: bool = False, **options: Any) -> Any:
    """A periodic suspension at a solid fraction of 0.5 with a smooth flow and noise, films alone.

    large  a sphere of ten times the radius among small ones, at rest
    """
    made, _ = suspension(count, 0.5, fixed=False, viscosity=VISCOSITY)
    spheres, box = made.particles, made.box
    draw, x = np.random.default_rng(1), spheres.position
    wave = 2.0 * math.pi * x / box
    spheres.velocity[:] = 0.02 * np.stack([np.sin(wave[:, 2]), 0.0 * x[:, 0], np.sin(wave[:, 0])], 1)
    spheres.velocity[:] += draw.normal(0.0, 0.004, x.shape)
    if motions != "normal":
        spheres.spin[:] = draw.normal(0.0, 0.004 / RADIUS, x.shape)
    laws = Laws(film=True, film_motions=motions, film_tolerance=tolerance)
    run = ParticleSolver(
        spheres, pair_table([SPHERE]), laws=laws, box=tuple(box), **grouped(check_steps=False, **options)
    )
    return films_only(run)


def compare(run: ParticleSolver, step: float, sliding: bool, weak: bool = False) -> tuple[float, float]:
    """Error of the dissipation of one step, and of the change of all velocities, against the direct solution.

    weak  with the films that act by themselves at the end of the step
    """
    direct = Direct(run, step, sliding, weak)
    before = direct.energy(direct.start.reshape(-1, 6))
    exact = direct.solve()
    run.advance(step)
    ours = np.concatenate([run.particles.velocity, run.particles.spin], 1)
    if not weak:
        ours -= np.concatenate([run.particles.film_gain, run.particles.film_spin_gain], 1)
    scale = np.concatenate([np.ones(3), np.full(3, RADIUS)])
    change = (exact - direct.start.reshape(-1, 6)) * scale
    error = float(np.linalg.norm((ours - exact) * scale) / np.linalg.norm(change))
    lost = before - direct.energy(exact)
    return abs(before - direct.energy(ours) - lost) / lost, error


@pytest.mark.parametrize("step", [3e-8, 2.5e-7, 1e-6])
@pytest.mark.parametrize("motions", ["normal", pytest.param("full", marks=pytest.mark.slow)])
def test_a_network_is_that_of_a_direct_solution(motions: str, step: float) -> None:
    """300 spheres: dissipation within 1e-6, velocities within 1e-5 at a tolerance of 1e-6."""
    lost, velocity = compare(network(motions, tolerance=TIGHT), step, motions != "normal")
    assert lost < 1e-6
    assert velocity < 1e-5


@pytest.mark.parametrize("step", [3e-8, 2.5e-7, 1e-6])
@pytest.mark.parametrize("motions", ["normal", pytest.param("full", marks=pytest.mark.slow)])
def test_weak_films_that_act_by_themselves_are_nearly_those_of_a_direct_solution(motions: str, step: float) -> None:
    """The same network with its weak films in the direct solution, too."""
    lost, velocity = compare(network(motions, tolerance=TIGHT), step, motions != "normal", weak=True)
    assert lost < 1e-3
    assert velocity < 1e-2


def test_without_contacts_energy_falls_and_momentum_stays_at_any_tolerance() -> None:
    """At X up to a thousand, from no iteration to a thousandth, from the first step and with a warm start."""
    for tolerance in (1.0, 0.1, 1e-3):
        run = network("full", 150, tolerance)
        mass = run.particles.mass[:, None]
        carried = float((mass * np.abs(run.particles.velocity)).sum())
        for step in (1e-7, 1e-5, 1e-6):
            for _ in range(5):
                energy, momentum = kinetic_energy(run.particles), (mass * run.particles.velocity).sum(axis=0)
                run.advance(step)
                assert kinetic_energy(run.particles) <= energy * (1.0 + 1e-14)
                drift = np.abs((mass * run.particles.velocity).sum(axis=0) - momentum).max()
                assert drift < 1e-13 * carried


def ball(count: int, large: float, seed: int, plane: bool) -> tuple[np.ndarray, np.ndarray]:
    """Places and radii of small spheres around a large one at random distances (n, 3), (n,) [m].

    large  radius of the large sphere over that of the small ones
    plane  all lie above z = 0, and some near it
    """
    draw = np.random.default_rng(seed)
    places, radii = [np.array([0.0, 0.0, large * RADIUS + 0.2e-6])], [large * RADIUS]
    for _ in range(20_000):
        if len(places) == count:
            break
        reach = large * RADIUS + RADIUS * draw.uniform(1.0, 2.2)
        direction = draw.normal(size=3)
        place = places[0] + reach * direction / np.linalg.norm(direction)
        if plane:
            place[2] = RADIUS * draw.uniform(1.002, 2.0)
            place[:2] = draw.uniform(-1.0, 1.0, 2) * (large + 3.0) * RADIUS
        gaps = np.linalg.norm(place - places, axis=1) - np.array(radii) - RADIUS
        if gaps.min() > 1e-7:
            places.append(place)
            radii.append(RADIUS)
    return np.array(places), np.array(radii)


@pytest.mark.parametrize("plane", [False, True])
def test_a_large_sphere_among_small_ones_is_that_of_a_direct_solution(plane: bool) -> None:
    """One of ten times the radius among 120, free or at a plane that moves; velocities within 1e-5."""
    places, radii = ball(120, 10.0, 3, plane)
    draw = np.random.default_rng(4)
    spheres = make_particles(places, radii, SPHERE.density, viscosity=VISCOSITY)
    spheres.velocity[:] = draw.normal(0.0, 0.01, places.shape)
    spheres.spin[:] = draw.normal(0.0, 0.01 / RADIUS, places.shape)
    laws = Laws(film=True, film_motions="full", film_tolerance=TIGHT)
    walls = [Plane()] if plane else []
    run = films_only(
        ParticleSolver(
            spheres, pair_table([SPHERE]), laws=laws, walls=walls, settings=SolverSettings(check_steps=False)
        )
    )
    assert int((run.edges.resistance > 0.0).sum()) > 100
    lost, velocity = compare(run, 1e-6, True)
    assert lost < 1e-6
    assert velocity < 1e-5


@pytest.mark.parametrize(
    "motions", ["normal", *(pytest.param(motions, marks=pytest.mark.slow) for motions in ("full", "full_twist"))]
)
def test_a_cluster_that_turns_as_a_rigid_body_feels_nothing(motions: str) -> None:
    """Velocities and spins of a rigid body: neither changes."""
    places, radii = ball(40, 2.0, 5, False)
    spheres = make_particles(places, radii, SPHERE.density, viscosity=VISCOSITY)
    turn = np.array([30.0, -20.0, 50.0])
    spheres.velocity[:] = 0.1 + np.cross(turn, places)
    spheres.spin[:] = turn
    laws = Laws(film=True, film_motions=motions)
    run = films_only(
        ParticleSolver(spheres, pair_table([SPHERE]), laws=laws, settings=SolverSettings(check_steps=False))
    )
    before = run.particles.velocity.copy(), run.particles.spin.copy()
    run.advance(1e-6)
    assert np.abs(run.particles.velocity - before[0]).max() < 1e-14
    assert np.abs(run.particles.spin - before[1]).max() < 1e-9


@settings(max_examples=25, deadline=None)
@given(
    st.integers(2, 12), st.floats(1.0, 12.0), st.integers(0, 10_000), st.floats(-9.0, -3.0),
    st.sampled_from([1.0, 0.1, 1e-3]),
)  # fmt: skip
def test_any_cluster_loses_energy_and_keeps_momentum(
    count: int, large: float, seed: int, power: float, tolerance: float
) -> None:
    """Drawn clusters of unequal spheres, time steps from a nanosecond to a millisecond, any tolerance."""
    places, radii = ball(count, large, seed, False)
    draw = np.random.default_rng(seed)
    spheres = make_particles(places, radii, SPHERE.density, viscosity=VISCOSITY)
    spheres.velocity[:] = draw.normal(0.0, 1e-3, places.shape)
    spheres.spin[:] = draw.normal(0.0, 1e-3 / RADIUS, places.shape)
    laws = Laws(film=True, film_motions="full", film_tolerance=tolerance)
    run = films_only(
        ParticleSolver(spheres, pair_table([SPHERE]), laws=laws, settings=SolverSettings(check_steps=False))
    )
    mass = run.particles.mass[:, None]
    for _ in range(3):
        began = run.edges.film_owed != 0.0
        energy, momentum = kinetic_energy(run.particles), (mass * run.particles.velocity).sum(axis=0)
        run.advance(10.0**power)
        if not began.any():
            assert kinetic_energy(run.particles) <= energy * (1.0 + 1e-13)
        drift = np.abs((mass * run.particles.velocity).sum(axis=0) - momentum).max()
        assert drift <= 1e-12 * float((mass * np.abs(run.particles.velocity)).sum()) + 1e-30


def said(run: ParticleSolver) -> tuple[float, float, float]:
    """What a report says of the solution: its steps and iterations so far, and the largest damping rate [1/s]."""
    return run.film_counts[0], run.film_counts[1], run.largest_film_rate


def test_the_largest_damping_rate_is_that_of_the_nearest_pair() -> None:
    run = row_of(3, [2])
    run.particles.position[2, 0] += GAP  # twice as far, and with half the inverse mass
    run.refresh()
    assert run.largest_film_rate * STEP_OF_ONE == pytest.approx(1.0, rel=0.02)
    run.particles.position[0, 0] -= 9.0 * GAP
    run.refresh()
    assert run.largest_film_rate * STEP_OF_ONE == pytest.approx(0.25, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [2, 3])
def test_films_and_what_a_report_says_of_them_are_the_same_on_any_number_of_ranks(ranks: int) -> None:
    """Velocities, impulses, iterations and the largest damping rate of a network that needs many iterations."""

    def program(communicator: Communicator) -> tuple[dict[str, np.ndarray], tuple[float, float, float], float]:
        length = float(suspension(900, 0.5, fixed=False, viscosity=VISCOSITY)[0].box[0])
        planes = [length * n / ranks for n in range(1, ranks)]
        division = Bricks.slabs(0, planes) if communicator.size > 1 else None
        run = network("full", 900, 1e-3, communicator=communicator, division=division)
        for _ in range(3):
            run.advance(2.5e-7, 4)
        return state(run), said(run), run.film_counts[3]

    ((whole, counts, films),) = on_ranks(1, program)
    found = on_ranks(ranks, program)
    assert counts[0] == 12.0 and counts[1] > 12.0
    assert [said_there for _, said_there, _ in found] == [counts] * ranks
    assert sum(films_there for *_, films_there in found) == films  # each belongs to one rank
    assert_same_bits(joined([there for there, *_ in found]), joined([whole]))


@pytest.mark.slow
def test_one_and_two_threads_give_the_same_bits_and_a_resumed_run_goes_on_with_them() -> None:
    """A network over 12 steps: on two threads, and from a checkpoint after 5."""
    before, states = use_threads(None), []
    try:
        for threads in (1, 2):
            use_threads(threads)
            run = network("full", 1500, 1e-3)
            run.advance(2.5e-7, 5)
            kept = run.checkpoint()
            run.advance(2.5e-7, 7)
            states.append((run.particles.velocity.copy(), run.particles.spin.copy(), *said(run)))
        resumed = network("full", 1500, 1e-3)
        resumed.restore(kept)
        resumed.advance(2.5e-7, 7)
        states.append((resumed.particles.velocity.copy(), resumed.particles.spin.copy(), *said(resumed)))
    finally:
        use_threads(before)
    for other in states[1:]:
        assert all(np.array_equal(one, same) for one, same in zip(other, states[0]))
