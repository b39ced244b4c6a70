"""Bridges of many bodies, solved together: a direct solution of chains and networks, energy and momentum."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.sparse.linalg import spsolve
from wet_spheres import FILM, GRAIN, RADIUS, SYRUP, swarm

from cfddem.backend.law_set import specialise
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.joint_solution import film_kick
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import kinetic_energy, make_particles
from closures import bridge
from closures.lubrication import film_strength

TIGHT, GAP = 1e-8, 5e-6
MASS = GRAIN.density * 4.0 / 3.0 * math.pi * RADIUS**3
STEP_OF_ONE = 0.5 * MASS * GAP / film_strength(SYRUP.viscosity, 0.5 * RADIUS)
"""Time step at which the damping number X of a pair is 1, for a film that is thick beside the gap [s]."""


def without_pull(run: ParticleSolver) -> ParticleSolver:
    """The run with resistances alone: what pulls is balanced by forces from outside."""
    run.refresh()
    run.particles.applied[:] -= run.particles.force
    run.refresh()
    assert np.abs(run.particles.force).max() < 1e-18
    return run


def chain(count: int, held: bool, tolerance: float = TIGHT) -> ParticleSolver:
    """Wet spheres in a row along x, GAP apart, the first of them perhaps held."""
    places = np.zeros((count, 3))
    places[:, 0] = np.arange(count) * (2.0 * RADIUS + GAP)
    made = make_particles(places, RADIUS, GRAIN.density, fixed=held & (np.arange(count) == 0))
    coat(made, FILM)
    laws = Laws(bridge=SYRUP, film_tolerance=tolerance)
    return without_pull(
        ParticleSolver(made, pair_table([GRAIN]), laws=laws, settings=SolverSettings(check_steps=False, skin=RADIUS))
    )


class Direct:
    """The coupled step of the open bridges of a run, by Newton's method and a sparse direct solution."""

    def __init__(self, run: ParticleSolver, step: float) -> None:
        spheres, edges = run.particles, run.edges
        rows = np.flatnonzero(edges.bridge_resistance > 0.0)
        first, second = edges.first[rows].astype(int), edges.second[rows].astype(int)
        apart = spheres.position[first] - spheres.position[second]
        distance = np.linalg.norm(apart, axis=1)
        radii = spheres.radius[first] + spheres.radius[second]
        normal = apart / distance[:, None]
        self.gap, self.film, self.step = distance - radii, edges.bridge_film[rows].copy(), step
        self.strength = [film_strength(SYRUP.viscosity, a * b / (a + b))
                         for a, b in zip(spheres.radius[first], spheres.radius[second])]  # fmt: skip
        speed = spheres.velocity[first] - spheres.velocity[second]
        along = (speed * normal).sum(axis=1)
        aside = ((speed - along[:, None] * normal) ** 2).sum(axis=1)
        self.passing = np.minimum(0.5 * step * aside / distance, np.abs(along))
        data, row, column, weight = [], [], [], []
        for e, (i, j) in enumerate(zip(first, second)):
            n_x = normal[e]
            across = np.eye(3) - np.outer(n_x, n_x)
            turn = np.array([[0, -n_x[2], n_x[1]], [n_x[2], 0, -n_x[0]], [-n_x[1], n_x[0], 0]])  # n x
            rates, lever = np.zeros((4, 12)), distance[e] / radii[e]
            rates[0, :3], rates[0, 6:9] = n_x, -n_x
            rates[1:, :3], rates[1:, 6:9] = across, -across
            rates[1:, 3:6], rates[1:, 9:] = lever * spheres.radius[i] * turn, lever * spheres.radius[j] * turn
            place = np.concatenate([6 * i + np.arange(6), 6 * j + np.arange(6)])
            data.append(rates.ravel())
            row.append(np.repeat(4 * e + np.arange(4), 12))
            column.append(np.tile(place, 4))
            reduced = spheres.radius[i] * spheres.radius[j] / radii[e]
            weight.append(bridge.davis_tangential(SYRUP.viscosity, reduced, self.gap[e], self.film[e]))
        self.sliding, shape = np.array(weight), (4 * len(rows), 6 * spheres.count)
        self.rates = sparse.csr_matrix(
            (np.concatenate(data), (np.concatenate(row), np.concatenate(column))), shape=shape
        )
        inverse = np.stack([spheres.inverse_mass, spheres.inverse_inertia], 1)
        self.inverse_inertia = np.repeat(inverse, 3, axis=1).ravel()
        self.start = np.concatenate([spheres.velocity, spheres.spin], 1).ravel()

    def solve(self) -> np.ndarray:
        """Velocities and spins after a step in which only bridges act (N, 6)."""
        step, after = self.step, self.start.copy()
        for _ in range(100):
            rates = (self.rates @ after).reshape(-1, 4)
            rates[:, 0] += self.passing
            end = self.gap + step * rates[:, 0]
            assert end.min() > SYRUP.minimum_gap
            impulse, slope = np.zeros(rates.shape), np.zeros(rates.shape)
            for e, (strength, film) in enumerate(zip(self.strength, self.film)):
                way = [bridge.deforming_potential(gap, film) for gap in (end[e], self.gap[e])]
                impulse[e, 0] = strength * (way[0] - way[1])
                slope[e, 0] = step * strength * bridge.deforming_share(end[e], film) / end[e]
            impulse[:, 1:] = step * self.sliding[:, None] * rates[:, 1:]
            slope[:, 1:] = step * self.sliding[:, None]
            excess = np.where(self.inverse_inertia > 0.0, after - self.start, 0.0)
            excess += self.inverse_inertia * (self.rates.T @ impulse.ravel())
            if np.abs(excess).max() < 1e-12 * np.abs(self.start).max():
                break
            matrix = sparse.eye(len(after)) + sparse.diags(self.inverse_inertia) @ (
                self.rates.T @ sparse.diags(slope.ravel()) @ self.rates
            )
            after = after - spsolve(matrix.tocsc(), excess)
        return after.reshape(-1, 6)


def compare(run: ParticleSolver, step: float) -> tuple[float, float]:
    """Error of the dissipation of one step, and of the change of all velocities, against the direct solution."""
    exact = Direct(run, step).solve()
    start = np.concatenate([run.particles.velocity, run.particles.spin], 1)
    run.advance(step)
    kicked = 0.5 * step * run.particles.inverse_mass[:, None] * run.particles.force  # the pull at the end has changed
    ours = np.concatenate([run.particles.velocity - kicked, run.particles.spin], 1)
    scale = np.array([1.0, 1.0, 1.0, RADIUS, RADIUS, RADIUS])

    def energy(state: np.ndarray) -> float:
        made = run.particles
        return float(
            (made.mass[:, None] * state[:, :3] ** 2).sum()
            + (0.4 * made.mass * made.radius**2 * (state[:, 3:] ** 2).sum(axis=1)).sum()
        )

    lost = energy(start) - energy(exact)
    error = float(np.linalg.norm((ours - exact) * scale) / np.linalg.norm((exact - start) * scale))
    return abs(energy(start) - energy(ours) - lost) / lost, error


@pytest.mark.parametrize("damping", [0.1, 1.0, 10.0, 100.0])
@pytest.mark.parametrize("held", [False, True])
def test_a_chain_of_bridges_is_that_of_a_direct_solution(damping: float, held: bool) -> None:
    """Eight wet spheres with velocities and spins of all directions, the first perhaps held."""
    run, step = chain(8, held), damping * STEP_OF_ONE
    draw, speed = np.random.default_rng(2), 0.02 * GAP / step
    free = run.particles.inverse_mass > 0.0
    run.particles.velocity[free] = draw.normal(0.0, speed, (8, 3))[free]
    run.particles.spin[free] = draw.normal(0.0, speed / RADIUS, (8, 3))[free]
    lost, velocity = compare(run, step)
    assert lost < 1e-6
    assert velocity < 1e-5


def test_bridges_in_balance_resist_with_all_their_strength() -> None:
    """A chain pulled at its end: every gap opens at its own steady rate, as if each bridge were alone, at X = 10."""
    run, step = chain(6, True), 10.0 * STEP_OF_ONE
    force = 1e-3 * GAP / step * film_strength(SYRUP.viscosity, 0.5 * RADIUS) / GAP
    last = np.argmax(run.particles.position[:, 0])
    run.particles.applied[last, 0] += force
    run.advance(step, 20)
    before = np.diff(np.sort(run.particles.position[:, 0]))
    run.advance(step, 20)
    opened = np.diff(np.sort(run.particles.position[:, 0])) - before
    gap = before + 0.5 * opened - 2.0 * RADIUS
    resistance = np.array([bridge.deforming_share(h, 2.0 * FILM) / h for h in gap]) * film_strength(
        SYRUP.viscosity, 0.5 * RADIUS
    )
    assert opened * resistance / (20 * step * force) == pytest.approx(np.ones(5), rel=0.02)


def test_energy_falls_and_momentum_stays_at_any_tolerance() -> None:
    """300 unequal wet spheres with closed and open bridges at X up to a thousand, with and without a warm start."""
    for tolerance in (1.0, 0.1, 1e-3):
        run, bridges = swarm(300)
        system = run.system._replace(parameters=run.parameters._replace(film_tolerance=tolerance))
        assert bridges.count > 200
        kick, mass = specialise(film_kick, run.choices), run.particles.mass[:, None]
        carried = float((mass * np.abs(run.particles.velocity)).sum())
        for step in (1e-7, 1e-5, 1e-3):
            for _ in range(5):
                energy, momentum = kinetic_energy(run.particles), (mass * run.particles.velocity).sum(axis=0)
                kick(system, step)
                assert kinetic_energy(run.particles) <= energy * (1.0 + 1e-14)
                drift = np.abs((mass * run.particles.velocity).sum(axis=0) - momentum).max()
                assert drift < 1e-13 * carried


@pytest.mark.slow
def test_a_film_and_a_bridge_of_one_pair_share_its_impulse_by_their_resistances() -> None:
    """Wet spheres in oil: along and across the line of centres, at X of a tenth and of a hundred."""
    for step in (0.1 * STEP_OF_ONE, 100.0 * STEP_OF_ONE):
        places = np.zeros((4, 3))
        places[:, 0] = np.arange(4) * (2.0 * RADIUS + GAP)
        made = make_particles(places, RADIUS, GRAIN.density, viscosity=0.5 * SYRUP.viscosity)
        coat(made, FILM)
        laws = Laws(film=True, film_motions="full", bridge=SYRUP, film_tolerance=TIGHT)
        run = without_pull(
            ParticleSolver(
                made, pair_table([GRAIN]), laws=laws, settings=SolverSettings(check_steps=False, skin=RADIUS)
            )
        )
        draw, speed = np.random.default_rng(2), 1e-3 * GAP / step
        run.particles.velocity[:] = draw.normal(0.0, speed, (4, 3))
        run.particles.spin[:] = draw.normal(0.0, speed / RADIUS, (4, 3))
        edges, mass = run.edges, run.particles.mass[:, None]
        energy, momentum = kinetic_energy(run.particles), (mass * run.particles.velocity).sum(axis=0)
        run.advance(step)
        assert kinetic_energy(run.particles) < energy
        assert np.abs((mass * run.particles.velocity).sum(axis=0) - momentum).max() < 1e-12 * np.abs(mass).max() * speed
        film = 2.0 * FILM
        along = film_strength(SYRUP.viscosity, 0.5 * RADIUS) * bridge.deforming_share(GAP, film) / GAP
        assert edges.impulse[:3, 0] / edges.bridge_impulse[:3, 0] == pytest.approx(
            edges.resistance[:3] / along, rel=5e-3
        )
        rolled = edges.shear_impulse.reshape(-1, 3, 3)[:3]
        assert (edges.bridge_impulse[:3, 1:] != 0.0).all() and (rolled[:, 0, 1:] != 0.0).all()
