"""A particle field that a user declares: one line, and it moves with sorting, inserts, removals, resume and snapshots.

The how-to page docs/how-to/particle-field.md shows the same code.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from disturbed_runs import TINY

from cfddem import open_run
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.model.fields import Field
from cfddem.particles.state import make_particles
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation

AGE = Field("age", "s", snapshot=True, meaning="time since the particle entered")
ENTRY = Field("entry_height", "m", initial=lambda particles, rows: particles.position[rows, 2])


def grow_older(simulation: Simulation) -> None:
    """Callback after every fluid step."""
    simulation.particles.age += simulation.last_step


def case(**changes: object) -> Case:
    return Case.from_text(TINY).with_(**{"run.record_collisions": False, **changes})


def test_age_of_particles_that_enter_and_leave() -> None:
    simulation = Simulation(case(), fields=[AGE, ENTRY], callbacks=[grow_older])
    simulation.until(0.002)
    solver = simulation.particle_solver
    gone = solver.remove(solver.particles.id % 3 == 0)
    assert gone.age == pytest.approx(0.002) and (gone.entry_height > 0.0).all()
    new = solver.insert(make_particles(np.array([[1.5e-3, 1.5e-3, 0.016]]), 0.5e-3, 2500.0))
    back = solver.insert(gone.copy(gone.id == 3))
    simulation.until(0.003)
    particles = simulation.particles
    ages = dict(zip(particles.id.tolist(), particles.age))
    assert ages.pop(int(new[0])) == pytest.approx(0.001)
    assert ages.pop(int(back[0])) == pytest.approx(0.003)  # a particle that is put back brings its age
    assert np.array(list(ages.values())) == pytest.approx(0.003)
    assert particles.entry_height[particles.id == new[0]] == 0.016


def test_sorting_moves_the_field() -> None:
    """More than a thousand particles are sorted by place; the field says which is which."""
    tag = Field("tag", initial=lambda particles, rows: particles.id[rows].astype(float))
    more = {"bed.count": 1100, "bed.diameter": 1e-3, "fluid": None, "bed.inlet_velocity": 0.0}
    simulation = Simulation(case(**more), fields=[tag])
    before = simulation.particles.id.copy()
    simulation.particle_solver.sort_every = 1
    simulation.particles.velocity = np.random.default_rng(1).normal(0.0, 1.0, (1100, 3))
    simulation.particle_solver.refresh()
    simulation.until(0.004)
    assert not np.array_equal(simulation.particles.id, before)
    assert np.array_equal(simulation.particles.tag, simulation.particles.id)


def test_resume_and_snapshots_carry_the_field(tmp_path: Path) -> None:
    asked = {"fields": [AGE], "callbacks": [grow_older]}
    Run.begin(case(**{"run.until": 0.008}), tmp_path / "whole", **asked).go()
    parts = case(**{"run.until": 0.004, "run.every": 0.004, "run.history_every": 0.001})
    Run.begin(parts, tmp_path / "parts", **asked).go()
    with pytest.raises(InputError, match=r"age.*declare age: Simulation\(fields=\.\.\.\)"):
        Run.resume(tmp_path / "parts", until=0.008)
    Run.resume(tmp_path / "parts", until=0.008, **asked).go()
    whole, resumed = open_run(tmp_path / "whole"), open_run(tmp_path / "parts")
    assert whole.unit("age") == "s"
    for place, time in enumerate(whole.times):
        assert whole.particles(place)["age"] == pytest.approx(np.full(160, time), rel=1e-5)
    assert np.array_equal(whole.particles()["age"], resumed.particles()["age"])
    assert np.array_equal(whole.particles()["position"], resumed.particles()["position"])


def test_callbacks_are_called_in_their_order_after_every_step() -> None:
    seen: list[tuple[str, float]] = []
    simulation = Simulation(case(), callbacks=[lambda each: seen.append(("first", each.time))])
    simulation.callbacks.append(lambda each: seen.append(("second", each.time)))
    for _ in range(3):
        simulation.step()
    assert [name for name, _ in seen] == ["first", "second"] * 3
    assert seen[0][1] == pytest.approx(simulation.time / 3.0, rel=0.5)
