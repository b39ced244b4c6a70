"""A user's own force: on particles, on the fluid, on both; exact, conserved, counted and resumed.

The how-to page docs/how-to/own-force.md shows the same code.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from in_process_ranks import on_ranks

from cfddem import Field, FluidForce, OwnForce, Run, Simulation
from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError, RunFailed
from cfddem.case.schema import Case
from cfddem.coupling.forces.drag import Drag
from cfddem.features.energy import EnergyLedger
from cfddem.fluid import budgets
from cfddem.model.feature import Equipment, On
from cfddem.particles.state import Particles
from closures.drag import wen_yu
from closures.registry import law_of

FORCE = np.array([3e-6, -1e-6, 2e-6])


def electric(particles: Particles) -> np.ndarray:
    """The same force on every particle."""
    return FORCE


def case_of(**changes: Any) -> Case:
    """A sphere in a periodic box of water without drag and weight; changes with __ for the point."""
    values: dict[str, Any] = {
        "fluid.density": 1000.0,
        "fluid.viscosity": 1e-3,
        "material.sand": {"density": 2500.0, "youngs_modulus": 1e6, "poisson": 0.25, "friction": 0.3},
        "column": {"width": 0.01, "height": 0.01, "cell": 0.0025, "sides": "periodic", "ends": "periodic"},
        "bed": {"diameter": 1e-3, "positions": [(0.004, 0.005, 0.006)]},
        "laws": {"drag": None, "gravity": (0.0, 0.0, 0.0), "lubrication": "none"},
        "run": {"until": 1.0, "reference_speed": 0.1, "particle_step": 1e-5, "fluid_step": 1e-5},
    }
    return Case.from_text("", overrides=values | {name.replace("__", "."): value for name, value in changes.items()})


def suspension(**changes: Any) -> Case:
    """A thousand spheres in the box, with drag."""
    bed = {"diameter": 1e-3, "count": 500, "start": "suspended"}
    laws = {"drag": "wen_yu", "gravity": (0.0, 0.0, 0.0), "lubrication": "none", "added_mass": 0.5}
    return case_of(**({"bed": bed, "laws": laws, "run__fluid_step": 1e-3, "run__particle_step": None} | changes))


DRY = {"fluid": None, "laws": {"gravity": (0.0, 0.0, 0.0)}}
MODEL_B = {"laws": {"drag": None, "model": "B", "gravity": (0.0, 0.0, 0.0), "lubrication": "none"}}


# ---------------------------------------------------------------- the force itself


@pytest.mark.parametrize("changes", [DRY, MODEL_B], ids=["dry", "in a fluid at rest"])
@pytest.mark.parametrize("way", ["function", "field", "callback"])
def test_a_free_particle_gains_force_over_mass_from_the_first_half_kick_on(changes: dict[str, Any], way: str) -> None:
    """One particle step in a fluid step, without drag: the velocity is F t/m after the first step and after all."""
    simulation, begun = Simulation(case_of(**changes)), 0

    def write(simulation: Simulation) -> None:
        simulation.particles.external[:] = FORCE

    if way == "function":
        simulation.add(electric)
    elif way == "field":
        write(simulation)
    else:
        simulation.callbacks.append(write)
        simulation.step()
        begun = 1
    for steps in range(1, 6):
        simulation.step()
        assert simulation.last_step == pytest.approx(1e-5, rel=1e-9)
        time = simulation.time * steps / (steps + begun)
        expected = FORCE * time / simulation.particles.mass[0]
        assert simulation.particles.velocity[0] == pytest.approx(expected, rel=1e-13)


def test_the_first_step_is_exact_where_the_fluid_pushes_back() -> None:
    """In model A the pressure of the displaced fluid acts from the second step on."""
    simulation = Simulation(case_of())
    simulation.add(electric)
    simulation.step()
    expected = FORCE * simulation.last_step / simulation.particles.mass[0]
    assert simulation.particles.velocity[0] == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("on", ["particles", "fluid", "both"])
def test_momentum_is_what_the_force_gives(on: On) -> None:
    """On both, fluid and particles keep their momentum to round-off; alone, one gains F t for each particle."""
    simulation = Simulation(suspension())
    simulation.add(electric, on=on)
    for _ in range(20):
        simulation.step()
    particles, gained = simulation.particles, FORCE * simulation.time * simulation.particles.count
    total = (particles.mass[:, None] * particles.velocity).sum(axis=0) + budgets.momentum(simulation.fluid)
    total += simulation.forces["added_mass"].deferred_momentum(particles).sum(axis=0)
    total -= particles.drag_momentum.sum(axis=0)  # that the fluid receives in the next step
    assert np.abs(particles.velocity).max() > 1e-3
    assert np.abs(total - (0.0 if on == "both" else gained)).max() < 1e-12 * np.abs(gained).max()


def test_a_force_on_the_fluid_needs_one() -> None:
    with pytest.raises(InputError, match=r'force electric.*a run with a fluid.*on="particles"'):
        Simulation(case_of(**DRY)).add(electric, on="both")


@pytest.mark.parametrize("wrong", [np.ones(2), np.ones((7, 3)), np.array([0.0, np.nan, 0.0])])
def test_a_force_of_a_wrong_shape_or_value_is_refused(wrong: np.ndarray) -> None:
    simulation = Simulation(case_of())
    simulation.add(OwnForce(lambda particles: wrong))
    with pytest.raises(InputError, match=r"force <lambda>.*(shape \(3,\) or \(1, 3\), in N|finite.*particle 0)"):
        simulation.step()


@pytest.mark.parametrize("changes", [{}, DRY], ids=["in a fluid", "dry"])
def test_a_change_of_applied_is_refused_in_one_line(changes: dict[str, Any]) -> None:
    """It would enter the first half kick with the wrong sign, and then be erased."""

    def wrong(simulation: Simulation) -> None:
        simulation.particles.applied += FORCE

    simulation = Simulation(case_of(**changes), callbacks=[wrong])
    simulation.step()
    with pytest.raises(InputError, match=r"applied of particle 0.*write particles.external") as refused:
        simulation.step()
    assert "\n" not in str(refused.value)


# ---------------------------------------------------------------- energy


@pytest.mark.parametrize("on", ["particles", "fluid", "both"])
def test_the_work_of_a_force_is_a_line_of_the_energy_budget(on: On) -> None:
    """The remainder stays below 1 % of it; without the line it would be as large as the work."""
    simulation = Simulation(suspension(run__energy_budget=True), features=[OwnForce(electric, on)])
    for _ in range(20):
        simulation.step()
    row = simulation.feature(EnergyLedger).row()
    assert row["energy_external"] > 0.5 * row["energy_kinetic"] > 0.0
    assert abs(row["energy_remainder"]) < 0.01 * row["energy_external"]


def test_the_work_of_a_force_without_a_fluid_is_that_of_the_displacement() -> None:
    simulation = Simulation(case_of(**DRY, run__energy_budget=True), features=[electric])
    begin = simulation.particles.position[0].copy()
    for _ in range(5):
        simulation.step()
    row, work = simulation.feature(EnergyLedger).row(), FORCE @ (simulation.particles.position[0] - begin)
    assert row["energy_external"] == pytest.approx(work, rel=1e-9)
    assert row["energy_external"] == pytest.approx(row["energy_kinetic"], rel=1e-9)


# ---------------------------------------------------------------- checkpoints, ranks, classes


def test_a_force_that_a_user_adds_is_one_like_ours() -> None:
    """The drag law of the case, and the same law added to a case without drag: the same bits."""
    law = {"drag": None, "gravity": (0.0, 0.0, -9.81), "lubrication": "none", "surface": "smeared"}
    ours, added = Simulation(suspension(laws=law | {"drag": "wen_yu"})), Simulation(suspension(laws=law))
    added.add(Drag(law_of(wen_yu), "A"))
    for simulation in (ours, added):
        for _ in range(3):
            simulation.step()
    assert np.array_equal(ours.particles.velocity, added.particles.velocity)
    assert np.abs(ours.particles.velocity).max() > 1e-3
    assert ours.coupling.outside["drag"] == added.coupling.outside["drag"]


class Charges(FluidForce):
    """The force of a uniform field on charged particles, with a count as its state."""

    name, lines, needs_fluid = "charges", ("external",), False
    fields = (Field("charge", "C", initial=2e-12, snapshot=True),)
    calls = 0

    def act(self, terms: Any) -> None:
        self.calls += 1
        terms.push("external", (1.0 + 0.1 * self.calls) * terms.particles.charge[:, None] * [5e5, 0.0, 0.0])

    def checkpoint(self) -> dict[str, Any]:
        return {"calls": self.calls}

    def restore(self, state: dict[str, Any]) -> None:
        self.calls = int(state["calls"])


@pytest.mark.parametrize("changes", [{"laws__drag": "wen_yu"}, DRY], ids=["in a fluid", "dry"])
def test_a_resumed_run_has_the_same_bits(changes: dict[str, Any], tmp_path: Path) -> None:
    """Function, class and field; a run that is resumed without the function says so."""

    def features() -> list[Any]:
        return [electric, Charges()]

    end = 2.0**-15  # times of rows are exact
    case = case_of(**changes, run__until=end, run__every=0.5 * end, run__history_every=0.125 * end)
    whole = Run.begin(case, tmp_path / "whole", features=features())
    whole.simulation.particles.external[:] = 0.5 * FORCE
    whole.simulation.particles.charge[:] = 3e-12
    whole.go()
    part = Run.begin(case.with_(**{"run.until": 0.5 * end}), tmp_path / "part", features=features())
    part.simulation.particles.external[:] = 0.5 * FORCE
    part.simulation.particles.charge[:] = 3e-12
    part.go()
    with pytest.raises(InputError, match=r"electric.*Run.resume\(features=\.\.\.\)"):
        Run.resume(tmp_path / "part", until=end, features=[Charges()])
    resumed = Run.resume(tmp_path / "part", until=end, features=features())
    resumed.go()
    for name in ("position", "velocity", "force", "applied", "external", "charge"):
        assert np.array_equal(whole.simulation.particles[name], resumed.simulation.particles[name])
    assert resumed.simulation.forces["charges"].calls == whole.simulation.forces["charges"].calls > 4
    assert np.abs(resumed.simulation.particles.velocity).max() > 0.0


def test_a_failed_force_ends_a_run_with_its_name(tmp_path: Path) -> None:
    run = Run.begin(case_of(run__until=4e-5), tmp_path / "run", features=[OwnForce(lambda particles: [np.inf] * 3)])
    with pytest.raises(RunFailed, match=r"force <lambda>.*finite"):
        run.go()


def test_ranks_agree_on_a_force_on_both() -> None:
    """Velocities and fluid of two ranks are those of one process within 1e-9."""
    case = suspension(column__width=0.03, column__cell=0.0025, bed__count=900)

    def moved(communicator: Communicator) -> tuple[np.ndarray, np.ndarray]:
        simulation = Simulation(case, communicator=communicator, features=[OwnForce(electric, "both")])
        simulation.fluid.tolerance = 1e-11
        for _ in range(3):
            simulation.step()
        return simulation.whole("velocity")[np.argsort(simulation.whole("id"))], simulation.fluid.whole("velocity")

    (one,), two = on_ranks(1, moved), on_ranks(2, moved)
    assert np.abs(one[0]).max() > 1e-4
    assert np.abs(two[0][0] - one[0]).max() < 1e-9 * np.abs(one[0]).max()


class Tally(Equipment):
    """Counts its calls."""

    name = "tally"

    def __init__(self) -> None:
        self.steps, self.times = 0.0, 0

    def before(self, simulation: Simulation, step: float) -> None:
        self.steps += step

    def after(self, simulation: Simulation) -> None:
        self.times += 1
        assert simulation.time == pytest.approx(self.steps, rel=1e-9)

    def checkpoint(self) -> dict[str, Any]:
        return {"steps": self.steps, "times": self.times}

    def restore(self, state: dict[str, Any]) -> None:
        self.steps, self.times = float(state["steps"]), int(state["times"])


def test_equipment_acts_before_and_after_every_step_and_is_resumed() -> None:
    simulation = Simulation(case_of(**DRY), features=[Tally()])
    simulation.step()
    simulation.step()
    again = Tally()
    resumed = Simulation.restored(simulation.case, simulation.checkpoint(), features=[again])
    resumed.step()
    assert again.times == 3
    with pytest.raises(InputError, match="it had tally"):
        Simulation.restored(simulation.case, simulation.checkpoint())


class Doubled(FluidForce):
    """A force that is twice as large from the second step on."""

    name, lines, needs_fluid = "doubled", ("external",), False

    def act(self, terms: Any) -> None:
        terms.push("external", np.tile(FORCE, (terms.particles.count, 1)) * (2.0 if terms.last_step > 0.0 else 1.0))


@pytest.mark.parametrize("changes", [{}, DRY], ids=["in a fluid", "dry"])
def test_a_resumed_run_knows_its_last_step(changes: dict[str, Any]) -> None:
    whole = Simulation(case_of(**changes), features=[Doubled()])
    whole.step()
    resumed = Simulation.restored(whole.case, whole.checkpoint(), features=[Doubled()])
    assert resumed.last_step == whole.last_step > 0.0
    for simulation in (whole, resumed):
        simulation.step()
    assert np.array_equal(whole.particles.velocity, resumed.particles.velocity)


def test_two_features_of_one_name_are_refused() -> None:
    simulation = Simulation(case_of(), features=[electric])
    with pytest.raises(InputError, match=r"electric.*no other"):
        simulation.add(electric)


def test_a_name_that_the_case_has_or_no_checkpoint_can_hold_is_refused() -> None:
    """Before the run begins, also where the feature of the case comes later."""
    case = case_of(**DRY, run__energy_budget=True)
    for kind, name in ((Tally, EnergyLedger.name), (Tally, "a/b"), (Doubled, "a/b")):
        added = kind()
        added.name = name
        with pytest.raises(InputError, match=f"name.*{name}|{name}.*name"):
            Simulation(case, features=[added])
