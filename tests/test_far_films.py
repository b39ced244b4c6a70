"""Films of pairs that cannot touch, which act once in several steps (`Laws.far_film_steps`)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from in_process_ranks import on_ranks
from test_ghosts import assert_same_bits, divided, finished, joined, settings, state

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.pair_graph import HOME, _incidence
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import kinetic_energy, make_particles
from scenarios.benchmarks.dense_bed import STEP, bed

STEEL = Material(density=7780, youngs_modulus=190e9, poisson=0.27, restitution=0.97, friction=0.1, roughness=1e-7)
DIAMETER = 6.35e-3


def meeting(far_film_steps: int, apart: float = 1.6, **options: Any) -> tuple[ParticleSolver, float]:
    """Two steel spheres that meet at 0.5 m/s in a liquid of 50 mPa s, and the time step.

    apart  distance of the centres over the diameter; a film begins at 1.25
    """
    spheres = make_particles(
        np.array([[0.0, 0.0, 0.0], [apart * DIAMETER, 0.0, 0.0]]), 0.5 * DIAMETER, STEEL.density, viscosity=0.05
    )
    spheres.velocity[:, 0] = 0.25, -0.25
    laws = Laws(film=True, far_film_steps=far_film_steps)
    run = ParticleSolver(spheres, pair_table([STEEL]), laws=laws, **options)
    return run, run.recommended_step(0.5)


def restitution(far_film_steps: int) -> float:
    """Of two spheres, from within the reach of the film to beyond it."""
    run, step = meeting(far_film_steps)
    run.advance(step, round(1.9 * DIAMETER / 0.5 / step))
    return float(run.particles.velocity[1, 0] - run.particles.velocity[0, 0]) / 0.5


@pytest.mark.slow
def test_a_collision_is_that_of_every_step() -> None:
    """Within 1e-3: nothing of the impulse is lost, which is a difference of potentials."""
    whole = restitution(1)
    assert 0.5 < whole < 0.9
    assert restitution(10) == pytest.approx(whole, rel=1e-3)
    assert restitution(10) != whole


@pytest.mark.slow
def test_films_take_energy_at_any_viscosity() -> None:
    """In a liquid as thick as syrup, where far films stop a pair within their step, no speed grows or turns round."""
    run, step = meeting(50, 1.2, check_steps=False)
    run.particles.viscosity[:] = 100.0
    run.refresh()
    energy, relative = kinetic_energy(run.particles), -0.5
    for _ in range(20):
        run.advance(step, 50)
        now = float(run.particles.velocity[1, 0] - run.particles.velocity[0, 0])
        assert relative <= now <= 0.0
        assert kinetic_energy(run.particles) <= energy * (1.0 + 1e-12)
        energy, relative = kinetic_energy(run.particles), now
    assert abs(relative) < 0.05


def test_a_run_goes_on_between_two_kicks_with_the_same_bits() -> None:
    """A checkpoint after 13 of 20 steps, between the kicks of the tenth and the twentieth."""
    whole, step = meeting(10)
    whole.advance(step, 20)
    begun, _ = meeting(10)
    begun.advance(step, 13)
    resumed, _ = meeting(10)
    resumed.restore(begun.checkpoint())
    resumed.advance(step, 7)
    assert_same_bits(joined([state(resumed)]), joined([state(whole)]))


@pytest.mark.slow
def test_energy_is_counted_as_in_every_step() -> None:
    """The account closes as well, and films take the same energy within 0.1 %."""
    taken = []
    for far_film_steps in (1, 10):
        run, step = meeting(far_film_steps, energies=True)
        assert run.energies is not None
        before = run.energies.mechanical(run)
        run.advance(step, round(1.9 * DIAMETER / 0.5 / step))
        totals = dict(zip(run.energies.channels, run.energies.totals.tolist()))
        assert sum(totals.values()) + run.energies.mechanical(run) == pytest.approx(before, rel=1e-3)
        taken.append(totals["film"])
    assert taken[0] > 0.0
    assert taken[1] == pytest.approx(taken[0], rel=1e-3)


@pytest.mark.slow
def test_bits_on_threads_and_ranks() -> None:
    """A dense bed on one and on two threads, and a periodic box with walls on one, two and three ranks."""
    before, states = use_threads(None), []
    try:
        for threads in (1, 2):
            use_threads(threads)
            run = bed(10_000, True, far_film_steps=5)
            run.advance(STEP, 100)
            states.append((run.particles.position.copy(), run.particles.velocity.copy(), run.particles.spin.copy()))
        assert all(np.array_equal(one, other) for one, other in zip(*states))
    finally:
        use_threads(before)
    spheres, given = settings(True, True)
    given["laws"] = given["laws"]._replace(far_film_steps=4)
    length = float(spheres.position[:, 0].max())
    whole = finished(spheres.copy(), given, 300)
    assert whole.lists.made > 3
    for ranks in (2, 3):

        def program(communicator: Communicator, ranks: int = ranks) -> dict[str, np.ndarray]:
            division = divided(ranks, 0, length)
            return state(finished(spheres.copy(), given, 300, communicator=communicator, division=division))

        assert_same_bits(joined(on_ranks(ranks, program)), joined([state(whole)]))


@pytest.mark.parametrize(
    "others",
    [{"far_film_steps": 0}, {"film": False}, {"integrator": "verlet"}, {"film_motions": "full"},
     {"bridge": BridgeLaws(1e-3, 0.07)}],
)  # fmt: skip
def test_other_laws_are_refused(others: dict[str, Any]) -> None:
    """Films that resist sliding, bridges and explicit films act in every step."""
    with pytest.raises(InputError, match="far_film_steps"):
        Laws(**{"film": True, "far_film_steps": 2, **others}).check()


@pytest.mark.parametrize("near", [0, 1])
def test_every_edge_is_listed_once(near: int) -> None:
    """A pair that may touch, or cannot, and a wall: the wall comes before a far pair and after a near one."""
    ends = np.array([0, 0], np.int32), np.array([1, 0], np.int32), np.full(2, HOME, np.int8)
    start, incident = _incidence(*ends, near, 1, np.arange(2))
    assert start.tolist() == [0, 2, 3]
    assert incident.tolist() == ([0, 1, -1] if near else [1, 0, -1])
