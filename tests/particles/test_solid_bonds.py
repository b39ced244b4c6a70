"""Solid bonds that dry bridges leave: stiffness, strength, momentum, energy; bits on threads and resumed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_bridge_energy import ledger
from wet_spheres import GRAIN, RADIUS, SYRUP, bridged, swarm

from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.particles.interactions.bond import BondLaw
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles

STRONG = BondLaw(solid_fraction=0.1, youngs_modulus=1e8, tensile_strength=1e9, shear_strength=1e9, damping=0.0)
LAWS = replace(SYRUP, dries=True, bond=STRONG)
"""A law set that all tests here share; numbers compile nothing anew."""


def dry(bridges: Bridges, share: float = 0.95) -> None:
    """Take a share of the water from all bridges; their solids are a tenth."""
    bridges.dry(bridges.edges, share * bridges.volume)


def doublet(laws: BridgeLaws = LAWS, **options: Any) -> tuple[ParticleSolver, Bridges]:
    """Two spheres at rest, 0.5 um apart, that a bond joins."""
    two = make_particles([[0, 0, 0], [2.0 * RADIUS + 0.5e-6, 0, 0]], RADIUS, GRAIN.density)
    run, bridges = bridged(two, replace(laws, surface_tension=0.0), **options)
    run.advance(1e-7)
    assert bridges.count == 1 and len(bridges.bonds) == 0
    dry(bridges)
    run.advance(1e-7)
    assert bridges.bonds_formed == 1 == len(bridges.bonds)
    run.particles.liquid[:] = 0.0  # no new bridge
    return run, bridges


def neck(run: ParticleSolver) -> float:
    """Radius of the neck of the only bond [m]."""
    return float(run.edges.bond_radius.max())


@pytest.mark.slow
def test_a_bond_has_the_volume_of_the_solids_and_the_stiffness_of_its_cylinder() -> None:
    """Its four springs, in still positions: stretch, slip, bending and twist."""
    run, _ = doublet()
    radius, solid = neck(run), float(run.edges.bridge_solid[0])
    assert math.pi * radius**2 * (0.5e-6 + radius**2 / (2.0 * RADIUS)) == pytest.approx(solid, rel=1e-3, abs=0.0)
    assert solid > 0.0 and np.abs(run.edges.bond_force).max() == 0.0
    along = 1e8 / (2.0 * RADIUS) * math.pi * radius**2
    step, particles = 1e-9, run.particles
    for velocity, spin, expected in (
        ((-0.01, 0.0, 0.0), (0.0, 0.0, 0.0), ("bond_force", 0, along)),
        ((0.0, 0.01, 0.0), (0.0, 0.0, 0.0), ("bond_force", 1, 0.4 * along)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.01), ("bond_moment", 2, 0.25 * radius**2 * along)),
        ((0.0, 0.0, 0.0), (0.01, 0.0, 0.0), ("bond_moment", 0, 0.2 * radius**2 * along)),
    ):
        particles.velocity[:] = np.array([velocity, np.negative(velocity)])
        particles.spin[:] = np.array([spin, np.negative(spin)])
        name, axis, stiffness = expected
        before = float(run.edges[name][0, axis])
        run.advance(step)
        strain = step * 0.02
        assert abs(run.edges[name][0, axis] - before) == pytest.approx(stiffness * strain, rel=1e-4)


@pytest.mark.slow
def test_a_doublet_that_turns_keeps_its_momentum_and_its_energy() -> None:
    """Any motion of bodies that a bond joins: angular momentum to round-off, energy to the accuracy of the steps."""
    run, _ = doublet(energies=True)
    particles = run.particles
    particles.velocity[:] = [[0, 0.01, 0.02], [0.005, -0.01, 0.03]]
    particles.spin[:] = [[10, 20, 30], [-10, 20, 20]]

    def angular() -> np.ndarray:
        orbit = np.cross(particles.position, particles.velocity) * particles.mass[:, None]
        return np.asarray((orbit + particles.spin / particles.inverse_inertia[:, None]).sum(axis=0))

    start, step = angular(), 0.2 * run.recommended_step()
    remainder, done, put_in = ledger(run, step, 5000)
    assert abs(remainder) < 1e-3 * put_in and done["bonds_broken"] == 0.0
    assert np.abs(angular() - start).max() < 1e-12 * np.abs(start).max()


@pytest.mark.slow
def test_a_damped_bond_loses_what_the_account_says() -> None:
    run, _ = doublet(replace(LAWS, bond=replace(STRONG, damping=0.3)), energies=True)
    run.particles.velocity[:] = [[-0.001, 0.001, 0], [0.001, -0.001, 0]]
    run.particles.spin[:] = [[0, 3, 0], [0, -1, 0]]
    remainder, done, put_in = ledger(run, 0.1 * run.recommended_step(), 2000)
    assert done["bond_damping"] > 0.2 * put_in
    assert abs(remainder) < 1e-3 * put_in


@pytest.mark.slow
def test_a_bond_breaks_at_its_strength() -> None:
    """Pulled apart slowly, it breaks at the stretch of its strength, and takes the energy of its spring along."""
    run, bridges = doublet(replace(LAWS, bond=replace(STRONG, tensile_strength=1e5)), energies=True)
    run.particles.inverse_mass[:] = 0.0
    run.particles.velocity[:] = [[-0.0005, 0, 0], [0.0005, 0, 0]]
    length = float(run.edges.bond_length[0])
    count = run.energies
    assert count is not None
    while len(bridges.bonds):
        held = count.stored(run)["bonds"]
        run.advance(1e-7)
    stretch = float(run.particles.position[1, 0] - run.particles.position[0, 0]) - length
    assert stretch == pytest.approx(1e5 / (1e8 / (2.0 * RADIUS)), rel=1e-3)
    broken = dict(zip(count.channels, count.totals))["bonds_broken"]
    assert broken == pytest.approx(held, rel=0.01)


def granules(laws: BridgeLaws, count: int = 150, **options: Any) -> tuple[ParticleSolver, Bridges]:
    """A swarm of wet spheres whose bridges dry after a while."""
    run, bridges = swarm(count, laws, speed=0.02, **options)
    step = 0.2 * run.recommended_step(0.1)
    run.advance(step, 400)
    dry(bridges)
    run.advance(step, 20)
    return run, bridges


@pytest.mark.slow
def test_the_account_of_granules_closes_while_bridges_dry_and_bonds_form_and_break() -> None:
    run, bridges = granules(replace(LAWS, bond=replace(STRONG, tensile_strength=3e4, damping=0.1)), energies=True)
    formed, count = bridges.bonds_formed, run.energies
    assert formed > 50 and len(bridges.bonds) > 10 and count is not None
    remainder, done, put_in = ledger(run, 0.1 * run.recommended_step(0.1), 1000)
    print(f"{formed} bonds formed, {len(bridges.bonds)} last; remainder over put in {remainder / put_in:.2g}", done)
    assert done["bonds_broken"] > 0.0
    assert abs(remainder) < 1e-3 * put_in


@pytest.mark.slow
def test_granules_last_with_new_lists_and_resumed() -> None:
    found = []
    for skin in (None, 3e-6):
        run, bridges = granules(LAWS, skin=skin)
        if skin is None:
            kept = run.checkpoint()
        run.advance(1e-6, 300)
        found.append((run.particles.position.copy(), sorted(run.edges.bond_radius[bridges.bonds].tolist())))
    again, bridges = swarm(150, LAWS, speed=0.02)
    again.restore(kept)
    again.advance(1e-6, 300)
    assert np.array_equal(found[0][0], again.particles.position)
    radii = sorted(again.edges.bond_radius[bridges.bonds].tolist())
    assert len(radii) > 50 and radii == found[0][1] == found[1][1]
    assert found[1][0] == pytest.approx(found[0][0], abs=1e-12)
    assert np.bincount(bridges.agglomerates).max() > 10


@pytest.mark.slow
def test_granules_have_the_same_bits_on_two_threads() -> None:
    found = []
    for threads in (1, 2):
        use_threads(threads)
        run, bridges = granules(LAWS, count=1100)
        run.advance(1e-6, 300)
        found.append((run.particles.position.copy(), run.edges.bond_slip.copy(), len(bridges.bonds)))
    use_threads(1)
    assert found[0][2] > 300
    for one, two in zip(*found):
        assert np.array_equal(one, two)


@pytest.mark.parametrize(
    ("laws", "message"),
    [
        (replace(LAWS, dries=False), "bond"),
        (replace(LAWS, bond=replace(STRONG, youngs_modulus=0.0)), "bond.youngs_modulus"),
        (replace(LAWS, bond=replace(STRONG, solid_fraction=1.0)), "bond.solid_fraction"),
    ],
)
def test_wrong_bonds_are_refused(laws: BridgeLaws, message: str) -> None:
    with pytest.raises(InputError, match=message):
        laws.check()
