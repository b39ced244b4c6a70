"""Features of a particle solver: what one does in a step, what a checkpoint keeps of it, and what is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.particles.energy_count import Energies
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.particle_feature import Engine, ParticleFeature
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles, make_particles
from cfddem.run.simulation import Simulation

GLASS = Material(density=2500.0, youngs_modulus=1e7, poisson=0.25, restitution=0.9, friction=0.3)


class Distance(ParticleFeature):
    """Sum of the distances of all particles, and how many have come and gone."""

    name, every_step = "distance", True

    def __init__(self) -> None:
        self.moved, self.steps, self.came, self.left, self.exchanges = 0.0, 0, 0, 0, 0

    def before(self, engine: Engine, step: float, first: bool) -> None:
        """Note where the particles are."""
        self._at = engine.particles.position.copy()

    def after(self, engine: Engine, step: float, last: bool, ended: int) -> None:
        """Add what they have moved."""
        self.moved += float(np.linalg.norm(engine.particles.position - self._at, axis=1).sum())
        self.steps += 1

    def inserted(self, engine: Engine, joined: Particles, rows: np.ndarray) -> None:
        """Count particles that come."""
        self.came += len(rows)

    def removing(self, engine: Engine, gone: np.ndarray) -> None:
        """Count particles that go."""
        self.left += int(gone.sum())

    def after_exchange(self, engine: Engine) -> None:
        """Count exchanges."""
        self.exchanges += 1

    def checkpoint(self) -> dict[str, Any]:
        """The sum."""
        return {"moved": self.moved}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.moved = float(state["moved"])


def flying(feature: ParticleFeature | None = None) -> ParticleSolver:
    """Three spheres that fly apart at 1 m/s each."""
    velocity = np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    place = np.array([[0.0, 0.0, 0.0], [3e-3, 0.0, 0.0], [6e-3, 0.0, 0.0]])
    run = ParticleSolver(make_particles(place, 1e-3, 2500.0, velocity=velocity), pair_table([GLASS]))
    run.features += [feature] if feature else []
    return run


def test_a_feature_acts_in_every_step_and_sees_who_comes_and_goes() -> None:
    distance = Distance()
    run = flying(distance)
    run.advance(1e-5, 40)
    assert distance.steps == 40
    assert distance.moved == pytest.approx(3 * 40e-5, rel=1e-12)
    run.insert(make_particles(np.array([[0.0, 0.0, 1e-2]]), 1e-3, 2500.0))
    run.remove(run.particles.id == 0)
    assert (distance.came, distance.left, distance.exchanges) == (1, 1, 2)


def test_a_checkpoint_keeps_what_a_feature_has_counted() -> None:
    before, after = Distance(), Distance()
    run = flying(before)
    run.advance(1e-5, 40)
    again = flying(after)
    again.restore(run.checkpoint())
    assert after.moved == before.moved > 0.0


def test_a_feature_that_counts_alone_changes_no_bit() -> None:
    plain, counted = flying(), flying(Distance())
    for run in (plain, counted):
        run.advance(1e-5, 40)
    assert np.array_equal(plain.particles.position, counted.particles.position)


@pytest.mark.parametrize(("kind", "name"), [(Bridges, "bridges"), (Energies, "energies")])
def test_a_feature_that_a_run_lacks_is_refused_in_words(kind: type[ParticleFeature], name: str) -> None:
    run = flying()
    assert run.find(kind) is None
    with pytest.raises(InputError, match=name):
        run.feature(kind)


def test_a_case_without_a_fluid_is_refused_in_words_where_one_is_needed() -> None:
    solid = {"density": 2500.0, "youngs_modulus": 1e7, "poisson": 0.25}
    case = Case(
        material={"glass": solid},
        column={"width": 0.02, "height": 0.04, "cell": 0.01},
        bed={"diameter": 2e-3, "positions": [(0.01, 0.01, 0.01)]},
        run={"until": 1e-3},
    )
    assert not (case.resists or case.in_liquid)
    simulation = Simulation(case)
    for needed in (
        lambda: case.required_fluid,
        lambda: simulation.fluid,
        lambda: simulation.coupling,
    ):
        with pytest.raises(InputError, match="fluid"):
            needed()
