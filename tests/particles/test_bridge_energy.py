"""The energy account of liquid bridges closes: resistance, pull as a potential, and what forms and breaks."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wet_spheres import ANGLE, FILM, GRAIN, LIQUID, RADIUS, SYRUP, TENSION, THIN, bridged, swarm

from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import kinetic_energy, make_particles
from cfddem.particles.walls.shapes import Plane
from closures import capillary


def ledger(run: ParticleSolver, step: float, steps: int) -> tuple[float, dict[str, float], float]:
    """Energy that the count does not explain [J], the count, and the energy at the start and put in [J]."""
    count = run.energies
    assert count is not None
    before, counted = count.mechanical(run), dict(zip(count.channels, count.totals.copy()))
    run.advance(step, steps)
    done = {name: float(total) - float(counted[name]) for name, total in zip(count.channels, count.totals)}
    gained = sum(done[name] for name in ("walls", "fall", "stiffening", "bridges_formed"))
    lost = sum(done[name] for name in done if name not in ("walls", "fall", "stiffening", "bridges_formed"))
    put_in = kinetic_energy(run.particles) + sum(max(done[name], 0.0) for name in ("walls", "fall", "bridges_formed"))
    return count.mechanical(run) - before - gained + lost, done, before + put_in


@pytest.mark.slow
def test_a_pair_loses_what_the_closed_forms_say() -> None:
    """Formation at both films, rupture at its length: within 2 %, by the gap of a step."""
    velocity = np.array([[0.15, 0, 0], [-0.15, 0, 0]])
    two = make_particles([[0, 0, 0], [2.0 * RADIUS + 3.0 * FILM, 0, 0]], RADIUS, GRAIN.density, velocity=velocity)
    laws = BridgeLaws(surface_tension=TENSION, contact_angle=ANGLE)
    run, bridges = bridged(two, laws, energies=True)
    step = 0.25 * run.time_scales(0.3).recommended
    remainder, done, put_in = ledger(run, step, 8000)
    assert (bridges.formed, bridges.broken) == (1, 1)
    work = [capillary.pendular_energy(TENSION, ANGLE, 0.5 * RADIUS, LIQUID, gap)
            for gap in (2.0 * FILM, capillary.rupture_length(0.0, ANGLE, LIQUID))]  # fmt: skip
    assert done["bridges_formed"] == pytest.approx(work[0], rel=0.02)  # the gap of the first step below both films
    assert done["bridges_broken"] == pytest.approx(work[1], rel=0.02)
    assert abs(done["bridge"]) < 1e-9 * put_in
    assert abs(remainder) < 1e-3 * put_in


@pytest.mark.parametrize(("laws", "speed"), [(THIN, 0.5), (SYRUP, 0.2)], ids=["thin", "syrup"])
def test_the_account_of_many_bridges_closes(laws: BridgeLaws, speed: float) -> None:
    run, bridges = swarm(150, laws, speed=speed, energies=True)
    remainder, done, put_in = ledger(run, 0.5 * run.time_scales(1.0).recommended, 1000)
    assert bridges.formed > 100
    assert done["bridge"] > 0.1 * put_in
    assert abs(remainder) < 1e-3 * put_in


@pytest.mark.slow
def test_the_account_with_inertia_of_the_films_closes() -> None:
    """The loss where films turn with their bodies counts as that of bridges; momentum is kept."""
    run, _ = swarm(150, replace(THIN, film_density=1000.0), speed=0.5, energies=True)
    start = (run.particles.mass[:, None] * run.particles.velocity).sum(axis=0)
    remainder, done, put_in = ledger(run, 0.5 * run.time_scales(1.0).recommended, 1000)
    assert (run.edges.bridge_impact_speed >= 0.0).all()
    assert done["bridge"] > 0.1 * put_in
    assert abs(remainder) < 1e-3 * put_in
    end = (run.particles.mass[:, None] * run.particles.velocity).sum(axis=0)
    size = float((run.particles.mass * np.linalg.norm(run.particles.velocity, axis=1)).sum())
    assert np.abs(end - start).max() < 1e-12 * size


def test_the_account_does_not_depend_on_neighbour_lists() -> None:
    """The work of the pull in the half kick before a new list counts, too."""
    counted = []
    for skin in (None, 3e-6):
        run, _ = swarm(60, THIN, speed=0.5, energies=True, skin=skin)
        counted.append(ledger(run, 0.5 * run.time_scales(1.0).recommended, 200)[1])
    assert run.lists.made > 50
    within = 1e-9 * max(counted[0].values())
    for name, energy in counted[0].items():
        assert counted[1][name] == pytest.approx(energy, abs=within), name


def test_a_moving_wall_puts_energy_in_through_its_bridges() -> None:
    """A plane slides below wet spheres and drags them along."""
    draw = np.random.default_rng(1)
    places = np.array([[3.0 * RADIUS * n, 0.0, RADIUS + 0.5 * FILM] for n in range(5)])
    spheres = make_particles(places, RADIUS, GRAIN.density, velocity=draw.normal(0.0, 0.01, (5, 3)))
    given: dict[str, Any] = {"walls": [Plane(velocity=(0.1, 0.0, 0.0))], "energies": True}
    run, bridges = bridged(spheres, SYRUP, **given)
    assert bridges.count == 5
    remainder, done, put_in = ledger(run, run.time_scales(0.1).recommended, 500)
    assert done["walls"] > 0.0 and done["bridge"] > 0.0
    assert abs(remainder) < 1e-3 * put_in
    assert math.isfinite(remainder)


@pytest.mark.slow
def test_the_record_says_wet_or_dry_and_what_the_bridge_took() -> None:
    """Two pairs that collide, one of them wet: from where the films touch to where the bridge breaks."""
    gap = 3.0 * FILM
    places = np.array(
        [[0, 0, 0], [2.0 * RADIUS + gap, 0, 0], [0, 9.0 * RADIUS, 0], [2.0 * RADIUS + gap, 9.0 * RADIUS, 0]]
    )
    velocity = np.array([[0.5, 0, 0], [-0.5, 0, 0]] * 2)
    spheres = make_particles(places, RADIUS, GRAIN.density, velocity=velocity)
    thin = replace(THIN, viscosity=2e-3)
    run, bridges = bridged(spheres, thin, np.array([FILM, FILM, 0.0, 0.0]), energies=True, record=True)
    step = 0.25 * run.time_scales(1.0).recommended
    while len(run.collisions.table) < 2 and run.steps < 20_000:  # type: ignore[union-attr]
        run.advance(step, 50)
    assert run.collisions is not None and run.energies is not None
    rows = {int(row["first"]): row for row in run.collisions.table}
    wet, dry = rows[0], rows[2]
    assert bridges.broken == 1
    assert wet["wet"] and not dry["wet"]
    assert np.isnan(dry["lost_to_bridge"])
    total = dict(zip(run.energies.channels, run.energies.totals))["bridge"]
    assert wet["lost_to_bridge"] == pytest.approx(total, rel=1e-3)
    assert wet["restitution"] < 0.98 < dry["restitution"]
    assert wet["end"] - wet["begin"] > 3.0 * (dry["end"] - dry["begin"])
