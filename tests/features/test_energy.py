"""The energy ledger: work is counted force by force, stored energy is read from the state, and the two agree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from disturbed_runs import TINY

from cfddem import open_run
from cfddem.analysis.report import report
from cfddem.analysis.report_text import lines
from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.features.energy import EnergyLedger
from cfddem.fluid import budgets
from cfddem.particles.energy_of_contacts import CHANNELS
from cfddem.particles.initial.packing import lattice
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import kinetic_energy as of_spheres
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation
from closures.contact import hertz_force, spring_energy

ROUGH = Material(
    density=2500, youngs_modulus=60e9, contact_modulus=1e6, poisson=0.25, restitution=0.9, friction=0.3,
    friction_lubricated=0.1, rolling_friction=0.02, roughness=1e-6,
)  # fmt: skip


def box(
    *,
    viscosity: float = 0.0,
    laws: Laws | None = None,
    gravity: float = 0.0,
    lid: float = 0.0,
    count: int = 100,
    record: bool = False,
) -> ParticleSolver:
    """Spheres that fly, spin and collide in a box whose lid slides."""
    random, size = np.random.default_rng(2), 0.012
    places = lattice(2e-3, ((0.0, 0.0, 0.0), (size, size, size)), spacing=1.2, seed=1)[:count]
    spheres = make_particles(
        places, 1e-3, 2500.0, velocity=random.normal(0.0, 0.3, (count, 3)), spin=random.normal(0.0, 300.0, (count, 3)),
        viscosity=viscosity,
    )  # fmt: skip
    walls = [Plane(point=(0.0 if sign > 0.0 else size,) * 3, normal=tuple(sign * np.eye(3)[axis]),
                   velocity=(lid, 0.0, 0.0) if axis == 2 and sign < 0.0 else (0.0, 0.0, 0.0))
             for axis in range(3) for sign in (1.0, -1.0)]  # fmt: skip
    chosen = laws or Laws(film=viscosity > 0.0)
    return ParticleSolver(
        spheres, pair_table([ROUGH]), walls=walls, laws=chosen, gravity=(0.0, 0.0, -gravity),
        settings=SolverSettings(energies=True, record=record),
    )  # fmt: skip


def unexplained(run: ParticleSolver, steps: int) -> tuple[float, dict[str, float]]:
    """Energy that the count does not explain, over what was put in; and the count."""
    assert run.energies is not None
    before = run.energies.mechanical(run)
    run.advance(run.recommended_step(1.0), steps)
    counted = dict(zip(CHANNELS, run.energies.totals))
    put_in = before + sum(max(counted[name], 0.0) for name in ("walls", "fall"))
    gained = sum(counted[name] for name in ("walls", "fall", "stiffening"))
    lost = sum(counted[name] for name in ("film", "contact_damping", "friction", "rolling"))
    return (run.energies.mechanical(run) - before - gained + lost) / put_in, counted


@pytest.mark.parametrize(
    "asked",
    [
        {},
        {"gravity": 9.81, "lid": 0.5},
        {"laws": Laws(spring="rescaled")},
        pytest.param({"laws": Laws(rolling="constant_torque")}, marks=pytest.mark.slow),
        {"viscosity": 1e-3},
        {"viscosity": 1e-2, "gravity": 9.81, "lid": 0.5},
    ],
    ids=["dry", "dry, gravity and a sliding lid", "rescaled springs", "rolling", "film", "thick film"],
)
def test_a_box_of_colliding_spheres_accounts_for_its_energy(asked: dict) -> None:
    """Within 1 %; every channel that is there takes a part."""
    run = box(**asked)
    left, counted = unexplained(run, 4000)
    assert abs(left) < 0.01, counted
    assert counted["contact_damping"] > 0.05 * of_spheres(run.particles)
    assert counted["friction"] > 0.0
    assert (counted["film"] > 0.0) == ("viscosity" in asked)
    assert (counted["walls"] != 0.0) == ("lid" in asked)
    assert (counted["rolling"] > 0.0) == ("laws" in asked and asked["laws"].rolling != "none")


def test_what_stiff_films_take_again_of_springs_and_weight_is_in_the_account() -> None:
    """Spheres pressed together in oil, X above 10: kicks of springs and weight are more than the bodies' way takes."""
    run = box(viscosity=1.0, gravity=1000.0, lid=0.5)
    remainder, counted = unexplained(run, 1500)
    assert run.largest_film_rate * run.recommended_step(1.0) > 10.0
    assert min(counted["film"], counted["friction"], counted["contact_damping"]) > 0.0
    assert abs(remainder) < 1e-3


def test_every_collision_says_what_it_lost_and_to_what() -> None:
    """Oblique, wet and rough: the sum over the row is the energy of motion that the pair has lost."""
    radius, speed = 1e-3, 0.5
    places = np.array([[0.0, 0.0, 0.0], [3.0 * radius, 0.8 * radius, 0.0]])
    velocity = np.array([[0.0, 0.0, 0.0], [-speed, 0.0, 0.0]])
    pair = make_particles(places, radius, 2500.0, velocity=velocity, viscosity=5e-3)
    run = ParticleSolver(
        pair, pair_table([ROUGH]), laws=Laws(film=True), settings=SolverSettings(record=True, energies=True)
    )
    assert run.collisions is not None and run.energies is not None
    before, step = of_spheres(pair), run.recommended_step(speed)
    run.advance(step, int(4.0 * radius / speed / step))
    (row,) = run.collisions.table
    counted = dict(zip(CHANNELS, run.energies.totals))
    assert row["lost_to_contact"] == pytest.approx(counted["contact_damping"], rel=1e-9)
    assert row["lost_to_friction"] == pytest.approx(counted["friction"], rel=1e-9)
    assert row["lost_to_film"] == pytest.approx(counted["film"], rel=0.01)
    lost = sum(row[f"lost_to_{channel}"] for channel in ("film", "contact", "friction"))
    assert lost - counted["stiffening"] == pytest.approx(before - of_spheres(pair), rel=0.01)
    assert min(row["lost_to_film"], row["lost_to_contact"], row["lost_to_friction"]) > 0.01 * lost


def test_the_count_changes_no_bit_and_is_the_same_on_any_number_of_threads() -> None:
    """On one thread, and on all; counted, and not."""
    found = []
    for threads in (1, None):
        before = use_threads(None)
        use_threads(threads)
        run = box(viscosity=1e-3, count=100)
        assert run.energies is not None
        run.advance(2e-5, 300)
        use_threads(before)
        found.append((run.energies.totals.copy(), run.particles.velocity.copy()))
    assert np.array_equal(found[0][0], found[1][0])
    plain = box(viscosity=1e-3, count=100)
    plain.features.clear()
    plain.advance(2e-5, 300)
    assert np.array_equal(plain.particles.velocity, found[0][1])


def test_particles_that_are_fed_bring_their_energy() -> None:
    run = box()
    assert run.energies is not None
    run.advance(2e-5, 50)
    had = run.energies.mechanical(run)
    gone = np.zeros(run.particles.count, bool)
    gone[::3] = True
    taken = run.remove(gone)
    assert -run.energies.fed > of_spheres(taken)  # and what their springs held
    assert run.energies.mechanical(run) == pytest.approx(had + run.energies.fed, rel=1e-12)
    run.advance(2e-5, 10)


@pytest.mark.parametrize("laws", [Laws(contact="jkr"), Laws(film=True, integrator="verlet")], ids=["jkr", "verlet"])
def test_laws_whose_energy_is_not_counted_are_refused(laws: Laws, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before any loop is compiled for them."""
    monkeypatch.delattr(ParticleSolver, "refresh")
    with pytest.raises(InputError, match="energies: must be"):
        box(laws=laws, viscosity=1e-3 if laws.film else 0.0, record=laws.film)


@pytest.mark.parametrize("minimum_gap", [0.0, 1e-6, 1e-4])
def test_the_energy_of_a_spring_is_the_integral_of_its_force(minimum_gap: float) -> None:
    overlap = np.linspace(0.0, 2e-5, 200_001)
    force = [hertz_force(1e9, each) * (min(each / minimum_gap, 1.0) if minimum_gap else 1.0) for each in overlap]
    assert spring_energy(1e9, 1.5, 2e-5, minimum_gap) == pytest.approx(np.trapezoid(force, overlap), rel=1e-6)


# ---------------------------------------------------------------- with a fluid

LIQUID = TINY.replace("record_collisions = true", "energy_budget = true")
assert "energy" in LIQUID


@pytest.mark.parametrize("model", ["A", "B"])
def test_terms_of_the_momentum_balance_add_up_to_the_kinetic_energy(model: str) -> None:
    """To round-off, in a bed that a liquid begins to lift."""
    run = Simulation(Case.from_text(LIQUID).with_(**{"laws.model": model, "run.energy_budget": False}))
    for _ in range(5):
        before = budgets.kinetic_energy(run.fluid)
        run.step()
        done = budgets.works(run.fluid)
        gained = sum(done) - done.kinetic - done.inlet_drag
        assert done.kinetic == pytest.approx(budgets.kinetic_energy(run.fluid) - before, rel=1e-9)
        assert gained == pytest.approx(done.kinetic, abs=1e-9 * sum(map(abs, done)))


def test_a_liquid_bed_accounts_for_its_energy(tmp_path: Path) -> None:
    """Remainder below 1 % of what was put in; drag takes most; a run that was stopped counts on."""
    case = Case.from_text(LIQUID)
    whole = Run.begin(case, tmp_path / "whole")
    whole.go()
    found = report(tmp_path / "whole")
    ledger = found.energy
    assert abs(ledger["remainder"]) < 0.01 * ledger["put_in"], ledger
    assert ledger["inflow"] > 0.0 and ledger["drag"] > 0.3 * ledger["put_in"]
    assert ledger["film"] > 0.0 and ledger["viscous"] > 0.0
    assert sum(each.fraction for each in found.energy_lines if each.group == "lost") < 1.1
    between = ledger["drag"] + ledger["drag_in_cells"] + ledger["implicit_drag"]
    assert ledger["drag_from_fluid"] - ledger["drag_to_particles"] == pytest.approx(between, rel=1e-9)
    assert ledger["pressure_from_fluid"] == pytest.approx(ledger["pressure_to_particles"], abs=0.05 * ledger["put_in"])
    text = "\n".join(lines(found))
    assert "energy budget, of an input of" in text and "remainder" in text

    half = Run.begin(case.with_(**{"run.until": 0.5 * case.run.until}), tmp_path / "half")
    half.every, half.interval, half.rows_per_snapshot = whole.every, whole.interval, whole.rows_per_snapshot
    half.go()
    Run.resume(tmp_path / "half", until=case.run.until).go()
    one, other = open_run(tmp_path / "whole").history, open_run(tmp_path / "half").history
    for name in one:
        if name.startswith("energy_"):
            assert np.array_equal(one[name], other[name]), name


def test_dry_spheres_that_fall_on_a_floor_account_for_their_energy(tmp_path: Path) -> None:
    changes = {"fluid": None, "bed.inlet_velocity": 0.0, "run.until": 0.1, "run.every": 0.05}
    Run.begin(Case.from_text(LIQUID).with_(**changes), tmp_path / "run").go()
    ledger = report(tmp_path / "run").energy
    assert -ledger["potential"] > 0.5 * ledger["put_in"]
    assert ledger["contact_damping"] > 0.1 * ledger["put_in"] and ledger["friction"] > 0.0
    assert not {"drag", "inflow", "fluid_kinetic"} & ledger.keys()
    assert abs(ledger["remainder"]) < 0.01 * ledger["put_in"], ledger


def test_spin_lost_to_the_fluid_is_in_the_ledger() -> None:
    """Fast spinning beads in still water, far apart: their spin goes to the torque of the fluid, and nowhere else."""
    changes = {"laws.torque": True, "bed.inlet_velocity": 0.0, "bed.count": 20, "bed.start": "suspended"}
    run = Simulation(Case.from_text(LIQUID).with_(**changes))
    run.particles.spin[:] = [300.0, 0.0, 100.0]
    run.particle_solver.refresh()
    ledger = EnergyLedger(run.case, run)  # of the spinning beads
    run.features[run.features.index(run.feature(EnergyLedger))] = ledger
    for _ in range(10):
        run.step()
    row = ledger.row()
    spheres = run.particles
    started = 0.2 * float((spheres.mass * spheres.radius**2).sum()) * (300.0**2 + 100.0**2)
    left = 0.2 * float((spheres.mass * spheres.radius**2 * (spheres.spin**2).sum(axis=1)).sum())
    assert row["energy_torque"] == pytest.approx(started - left, rel=0.02) and row["energy_torque"] > 0.05 * started
    assert abs(row["energy_remainder"]) < 1e-3 * started
