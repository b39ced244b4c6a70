"""Closed bridges of bodies that are not stiff act by themselves: as the joint solution does, stable, and counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_bridge_energy import ledger
from test_many_bridges import by_id
from wet_spheres import CLOSED, FILM, RADIUS, bridged, swarm

from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.particles import listing
from cfddem.particles.interactions import laws
from cfddem.particles.interactions.bridge_apart import MOST
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import kinetic_energy, make_particles

SLACK = replace(CLOSED, surface_tension=0.0)
"""The same liquid without a pull."""


def packing(law: BridgeLaws = SLACK, **options: bool) -> ParticleSolver:
    """200 wet spheres at a solid fraction of 0.6, closer than h_min but not in touch, that are sheared."""
    run, _ = swarm(200, law, speed=0.02, solid=0.6, **options)
    made = run.particles
    made.velocity[:, 0] += 0.2 * np.sin(2.0 * np.pi * made.position[:, 2] / run.box[2])
    return run


def apart(run: ParticleSolver) -> float:
    """Part of the bridges that act by themselves."""
    return float((run.edges.bridge_apart > 0.0).sum() / (run.edges.bridge_film > 0.0).sum())


def largest_sum(run: ParticleSolver) -> float:
    """Largest sum of the loads of two bodies that a bridge joins [1/s]."""
    edges, load = run.edges, run.particles.bridge_load
    rows = np.flatnonzero(edges.bridge_film > 0.0)
    return float((load[edges.first[rows]] + load[edges.second[rows]]).max())


@pytest.fixture(scope="module")
def limit() -> float:
    """Step at which the stiffest bridge of the packing is at the limit [s]."""
    run = packing()
    run.advance(1e-9)
    return MOST / largest_sum(run)


def test_energy_falls_in_every_step_just_below_the_limit(limit: float) -> None:
    """Without a pull: linear momentum stays, too."""
    run, step = packing(), 0.99 * limit
    mass = run.particles.mass[:, None]
    momentum, energies = (mass * run.particles.velocity).sum(axis=0), []
    carried = float((mass * np.abs(run.particles.velocity)).sum())
    for _ in range(200):
        energies.append(kinetic_energy(run.particles))
        run.advance(step)
    assert apart(run) > 0.7
    assert (np.diff(energies) < 0.0).all()
    assert energies[-1] < 0.1 * energies[0]
    assert np.abs((mass * run.particles.velocity).sum(axis=0) - momentum).max() < 1e-12 * carried


def test_stiff_bodies_are_solved_together(limit: float) -> None:
    """At twenty times the limit no bridge acts by itself, from the first step of that length on."""
    run = packing(check_steps=False)
    run.advance(0.1 * limit, 10)
    assert apart(run) > 0.7
    energy = kinetic_energy(run.particles)
    for _ in range(20):
        run.advance(20.0 * limit)
        before, energy = energy, kinetic_energy(run.particles)
        assert energy < before
    assert apart(run) == 0.0


def test_the_only_bridge_of_two_bodies_is_solved_with_the_others() -> None:
    """A pair, and three in a row: closed bridges that hardly resist."""
    for count, share in ((2, 0.0), (3, 1.0)):
        places = np.zeros((count, 3))
        places[:, 0] = np.arange(count) * (2.0 * RADIUS + 0.5 * FILM)
        made = make_particles(places, RADIUS, 2500.0, velocity=1e-3 * np.eye(count, 3))
        run, _ = bridged(made, replace(SLACK, viscosity=1e-3), box=(None, None, 20.0 * RADIUS))
        run.advance(1e-6, 3)
        assert apart(run) == share


def test_the_account_of_energy_closes(limit: float) -> None:
    """With a pull, and with steps and lists that change."""
    run = packing(CLOSED, energies=True)
    for step in (0.5 * limit, 0.9 * limit, 0.3 * limit):
        remainder, done, put_in = ledger(run, step, 60)
        assert apart(run) > 0.7
        assert done["bridge"] > 0.01 * put_in
        assert abs(remainder) < 1e-5 * put_in


@pytest.mark.slow
def test_it_is_the_joint_solution_to_first_order_in_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half the step halves the difference of velocities and spins, of half a percent at the limit."""

    def final(alone: bool, step: float) -> np.ndarray:
        laws._choices.cache_clear()
        with monkeypatch.context() as patch:
            if not alone:
                patch.setattr(BridgeLaws, "resists_evenly", False)
            run = packing()
            run.advance(step, round(2.56e-4 / step))
        laws._choices.cache_clear()
        assert (apart(run) > 0.7) if alone else "bridge_apart" not in run.edges
        order = np.argsort(run.particles.id)
        return np.concatenate([run.particles.velocity[order], RADIUS * run.particles.spin[order]])

    differences = []
    for step in (2e-6, 1e-6, 5e-7):
        joint = final(False, step)
        differences.append(np.linalg.norm(final(True, step) - joint) / np.linalg.norm(joint))
    assert differences[0] < 0.01
    assert np.array(differences[:-1]) / differences[1:] == pytest.approx(2.0, rel=0.05)


@pytest.mark.slow
def test_the_bits_are_the_same_on_two_threads_and_from_a_checkpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listing, "THREADING_PAYS", 1)
    before, states = use_threads(None), []
    try:
        for threads in (1, 2):
            use_threads(threads)
            run = packing(CLOSED)
            run.advance(1e-6, 100)
            kept = run.checkpoint()
            run.advance(1e-6, 100)
            states.append(by_id(run))
            other = packing(CLOSED)
            other.restore(kept)
            other.advance(1e-6, 100)
            states.append(by_id(other))
    except InputError:
        pytest.skip("this machine has one thread")
    finally:
        use_threads(before)
    assert apart(run) > 0.7
    assert all(np.array_equal(states[0], each) for each in states)
