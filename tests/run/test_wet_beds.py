"""Wet gas beds from a case: liquid budget, spray, measures, and continuing from a checkpoint.

Its bridges have the laws of a case that names none.
"""

from __future__ import annotations

from typing import Any, NamedTuple, get_args

import numpy as np
import pytest
from in_process_ranks import on_ranks

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.case.liquid import LAWS, Liquid
from cfddem.case.schema import Case
from cfddem.features.energy import EnergyLedger
from cfddem.particles.interactions import bridge_law
from cfddem.run import history
from cfddem.run.build import bridge_laws_of
from cfddem.run.simulation import Simulation

BED = """
[fluid]
density = 1.13
viscosity = 1.68e-5

[material.seed]
density = 1000.0
youngs_modulus = 1.2e8
contact_modulus = 1.0e6
poisson = 0.3
restitution = 0.9
friction = 0.1
roughness = 1e-6

[column]
width = 0.014
depth = 0.012
height = 0.020
cell = [0.0035, 0.004, 0.004]

[bed]
diameter = 1.2e-3
count = 1100
seed = 2
start = "packed"
inlet_velocity = 0.6

[liquid]
viscosity = 5e-3
surface_tension = 0.02
liquid_fraction = 0.002
share_of_wet_particles = 0.7
wall_share = 0.5
wall_thickness = 1e-6

[spray]
rate = 1e-7
drop_volume = 1e-13
zone = "box"
corner = [0.0, 0.0, 0.010]
size = [0.014, 0.012, 0.010]
begin = 0.001

[laws]
drag = "beetstra"
lubrication = "none"
self_disturbance_correction = false

[run]
until = 0.006
particle_step = 1e-5
reference_speed = 0.3
"""
HALF, END = 0.003, 0.006


class Ran(NamedTuple):
    start: dict[str, float]  # history at the start
    half: dict[str, Any]  # checkpoint
    simulation: Simulation


@pytest.fixture(scope="module")
def ran() -> Ran:
    simulation = Simulation(Case.from_text(BED))
    start = history.row(simulation)
    simulation.particles.velocity += np.random.default_rng(1).normal(0.0, 0.2, (1100, 3))  # so that bridges break
    simulation.until(HALF)
    half = simulation.checkpoint()
    simulation.until(END)
    return Ran(start, half, simulation)


def test_liquid_is_conserved_to_round_off(ran: Ran) -> None:
    now, solver = history.row(ran.simulation), ran.simulation.particle_solver
    assert solver.bridges is not None
    assert solver.bridges.formed > solver.bridges.count > 300 and solver.bridges.broken > 20
    assert ran.start["liquid_imbalance"] == 0.0 and now["liquid_imbalance"] < 1e-13
    before = ran.start["liquid_on_particles"] + ran.start["liquid_in_bridges"]
    before += ran.start["liquid_gained_by_walls"]
    after = now["liquid_on_particles"] + now["liquid_in_bridges"] + now["liquid_gained_by_walls"]
    assert now["liquid_gained_by_walls"] != 0.0
    assert after - before == pytest.approx(now["liquid_sprayed"], rel=1e-9)
    assert now["liquid_sprayed"] + now["liquid_missed"] == pytest.approx(1e-7 * (END - 0.001), rel=1e-3)
    wet = 0.7 * 1100 * 0.002 * np.pi / 6.0 * 1.2e-3**3
    assert before == pytest.approx(wet, rel=1e-9)


@pytest.mark.slow
def test_the_energy_budget_of_a_kicked_bed_closes() -> None:
    """Change of the stored energy that no line explains: 0.0006 of the energy put in; a quarter at half the step."""
    simulation = Simulation(Case.from_text(BED).with_(**{"run.energy_budget": True}))
    simulation.particles.velocity += np.random.default_rng(1).normal(0.0, 0.2, (1100, 3))
    ledger = EnergyLedger(simulation.case, simulation)  # of the kicked bed
    simulation.features[simulation.features.index(simulation.feature(EnergyLedger))] = ledger
    simulation.until(END)
    row = ledger.row()
    assert row["energy_bridge"] > 0.3 * row["energy_put_in"]
    assert abs(row["energy_remainder"]) < 1e-3 * row["energy_put_in"], row


def test_measures_agree_with_a_search_from_particle_to_particle(ran: Ran) -> None:
    now, solver = history.row(ran.simulation), ran.simulation.particle_solver
    assert solver.bridges is not None
    pairs = [(int(i), int(j)) for i, j in solver.bridges.bodies if j >= 0]
    neighbours: dict[int, set[int]] = {name: set() for name in range(1100)}
    for i, j in pairs:
        neighbours[i].add(j)
        neighbours[j].add(i)
    left, sizes = set(neighbours), []
    while left:
        found, todo = set(), [left.pop()]
        while todo:
            found.add(name := todo.pop())
            todo += neighbours[name] - found
        left -= found
        sizes.append(len(found))
    assert now["largest_agglomerate"] == max(sizes) > 5
    assert now["agglomerate_size"] == pytest.approx(sum(size * size for size in sizes) / 1100)
    assert now["agglomerated_share"] == pytest.approx(1.0 - sizes.count(1) / 1100)
    assert now["bridges_per_particle"] == pytest.approx(2.0 * len(pairs) / 1100)
    assert now["bridge_count"] == solver.bridges.count >= len(pairs)
    assert ran.start["wet_share"] < now["wet_share"] <= 1.0


def test_a_run_continues_from_its_checkpoint_with_the_same_bits(ran: Ran) -> None:
    resumed = Simulation.restored(ran.simulation.case, ran.half)
    resumed.until(END)
    ours, theirs = resumed.particles, ran.simulation.particles
    for name in ("position", "velocity", "liquid"):
        assert np.array_equal(ours.by_id(ours[name]), theirs.by_id(theirs[name])), name
    assert history.row(resumed) == history.row(ran.simulation)


def test_a_case_knows_all_words_of_the_laws() -> None:
    """The case repeats them: reading it must not load the compiler."""
    for name, words in LAWS.items():
        assert {*words} == {*bridge_law._BUILT_IN[name]}, name
    assert {*get_args(Liquid.model_fields["cut"].annotation)} == {*bridge_law.CUTS}


def test_laws_of_the_case_reach_the_solver() -> None:
    words = {"liquid.pull": "lambert", "liquid.film": "deforming"}
    case = Case.from_text(BED, "bed.toml", {"liquid.contact_angle": 60.0, **words})
    laws = bridge_laws_of(case)
    assert laws is not None
    assert (laws.pull, laws.film, laws.viscosity, laws.surface_tension) == ("lambert", "deforming", 5e-3, 0.02)
    assert laws.contact_angle == pytest.approx(np.pi / 3.0) and laws.minimum_gap == pytest.approx(2e-6, rel=0.5)
    dry = Case.from_text(BED.split("[liquid]")[0] + BED[BED.index("[laws]") :])
    assert bridge_laws_of(dry) is None
    assert "bridge_count" not in history.all_columns(dry) and "liquid_sprayed" in history.all_columns(case)


@pytest.mark.slow
def test_two_ranks_share_a_wet_bed() -> None:
    """Bridges across the border, the spray, and the measures, which look at the particles of both."""
    case = Case.from_text(
        BED,
        "bed.toml",
        {
            "spray.begin": 0.0,
            "run.fluid_step": 5e-5,
            "column.cell": [0.0035, 0.004, 0.0025],
            "liquid.wall_share": 0.0,
            "liquid.wall_thickness": 0.0,
        },
    )

    def program(communicator: Communicator) -> tuple[dict[str, float], np.ndarray]:
        simulation = Simulation(case, communicator=communicator)
        for _ in range(5):
            simulation.step()
        order = np.argsort(simulation.whole("id"))
        return history.row(simulation), simulation.whole("liquid")[order]

    (row, liquid), *others = on_ranks(2, program)
    whole, expected = program(SERIAL)
    assert others[0][0] == row, "all ranks measure the same"
    assert whole["liquid_sprayed"] > 0.0 and row["liquid_imbalance"] < 1e-13
    assert liquid == pytest.approx(expected, rel=1e-6)
    for name in whole:
        if name.startswith(("liquid_o", "liquid_s", "bridge", "agglomer", "largest_a", "wet", "coating")):
            assert row[name] == pytest.approx(whole[name], rel=1e-6), name
