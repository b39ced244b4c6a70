"""A user's contact law with memory: the Walton-Braun law of `docs/how-to/contact-law.md`."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_line import call
from solver_options import grouped

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.features.energy import EnergyLedger
from cfddem.model.fields import Field
from cfddem.particles.energy_of_contacts import CHANNELS
from cfddem.particles.interactions.contact_law import ContactLaw, contact_named, register
from cfddem.particles.interactions.laws import Laws, check_contact_law, contact_choices
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import kinetic_energy, make_particles
from cfddem.preflight.summary import preflight
from cfddem.run.simulation import Simulation
from closures import contact

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "contact-law.md"
GLASS = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=0.9, friction=0.3)
RADIUS = 5e-4


def law_of_the_page() -> ContactLaw:
    names: dict[str, Any] = {"__name__": "contact_law_page"}
    exec(re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)[0], names)
    return names["WALTON_BRAUN"]  # type: ignore[no-any-return]


LAW = law_of_the_page()
WITHOUT_ENERGY = register(replace(LAW, name="energy_unknown", energy=None, lost=None))


def pair(law: ContactLaw = LAW, speed: float = 0.1, slide: float = 0.0, **options: Any) -> ParticleSolver:
    """Two spheres about to collide."""
    position, velocity = np.zeros((2, 3)), np.zeros((2, 3))
    position[1, 0], velocity[:, 0], velocity[0, 1] = 2.02 * RADIUS, (speed, -speed), slide
    made = make_particles(position, RADIUS, 2500.0, velocity=velocity)
    return ParticleSolver(made, pair_table([GLASS]), laws=Laws(contact=law), **grouped(skin=0.2 * RADIUS, **options))


def collide(run: ParticleSolver) -> None:
    """Advance until the spheres have touched and parted."""
    step, touched = 0.2 * run.recommended_step(0.2), False
    for _ in range(100_000):
        run.advance(step)
        touching = bool(len(run.gap)) and bool((run.gap < 0.0).any())
        touched |= touching
        if touched and not touching:
            return
    raise AssertionError("no collision")


@pytest.mark.parametrize("ratio", [1.0, 2.0, 6.0])
@pytest.mark.parametrize("speed", [0.02, 0.2])
def test_restitution_is_the_root_of_the_ratio_of_stiffnesses(ratio: float, speed: float) -> None:
    run = pair(LAW.with_parameters(unloading_stiffness=1e4 * ratio), speed)
    collide(run)
    assert -run.particles.velocity[0, 0] / speed == pytest.approx(math.sqrt(1.0 / ratio), rel=2e-3)
    assert run.particles.velocity.sum(axis=0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_the_energy_lost_to_hysteresis_is_counted() -> None:
    """Head-on, it is all that the pair has lost; halfway, the spring holds what it will give back."""
    run = pair(energies=True, record=True)
    assert run.energies is not None and run.collisions is not None
    before, step = kinetic_energy(run.particles), 0.1 * run.recommended_step(0.2)
    while not (run.edges.largest_overlap > 0.0).any() or run.particles.velocity[0, 0] > 0.0:
        run.advance(step)
    spring, _ = run.energies.springs(run)
    assert spring == pytest.approx(0.25 * before, rel=0.01)
    collide(run)
    lost = dict(zip(CHANNELS, run.energies.totals))
    assert lost.pop("hysteresis") == pytest.approx(before - kinetic_energy(run.particles), rel=1e-3)
    assert max(map(abs, lost.values())) < 1e-9 * before
    run.advance(step, 10)
    assert run.collisions.table["lost_to_contact"][0] == pytest.approx(0.75 * before, rel=1e-3)


def test_a_pair_remembers_its_largest_overlap() -> None:
    """Bit for bit through a new neighbour list and a checkpoint, but not beyond the end of the contact."""
    run = pair(slide=0.05)
    step = run.recommended_step(0.2)
    while not (run.edges.largest_overlap > 0.0).any() or run.particles.velocity[0, 0] > 0.0:
        run.advance(step)
    kept, largest = run.checkpoint(), float(run.edges.largest_overlap[0])
    assert largest > 1e-6
    run.advance(step, 5)
    again = pair(slide=0.05)
    again.restore(kept)
    again._relist()
    assert again.edges.largest_overlap[0] == largest
    again.advance(step, 5)
    assert np.array_equal(again.particles.velocity, run.particles.velocity)
    collide(run)
    run.advance(step)
    assert not (run.edges.largest_overlap > 0.0).any()


def test_time_scales_come_from_the_law() -> None:
    mass = 0.5 * float(pair().particles.mass[0])
    scales = pair().time_scales(0.2)
    assert scales.impact == pytest.approx(math.sqrt(mass / 4e4))
    assert scales.hertz == pytest.approx(math.pi * math.sqrt(mass / 4e4) / 50.0)


CASE = """
[material.glass]
density = 2500
youngs_modulus = 1e7
poisson = 0.25

[column]
width = 0.006
height = 0.02
cell = 0.002

[bed]
diameter = 1e-3
count = 40
start = "suspended"

[laws]
contact = "walton_braun"
contact_parameters = { unloading_stiffness = 500.0, loading_stiffness = 400.0 }

[run]
until = 0.001
"""


def test_a_registered_law_is_chosen_by_its_name_in_a_case() -> None:
    """Checks, time steps, loops and `explain` use it without another change."""
    case = Case.from_text(CASE, "bed.toml")
    found = preflight(case)
    numbers = found.summary()["numbers"]
    swing = math.sqrt(0.5 * 2500.0 * math.pi / 6.0 * 1e-9 / 500.0)
    assert found.status == "ok"
    assert numbers["time scales"]["impact criterion"]["value"] == pytest.approx(swing)
    depth = case.reference_speed * swing * math.sqrt(500.0 / 400.0)  # loading is softer than unloading
    assert numbers["collisions and film"]["overlap / diameter"]["value"] == pytest.approx(depth / 1e-3, rel=1e-4)
    assert "contact modulus / real" not in numbers["collisions and film"]
    simulation = Simulation(case.with_(**{"run.energy_budget": True}))
    simulation.until(1e-3)
    assert simulation.feature(EnergyLedger).row()["energy_hysteresis"] == 0.0  # no collision yet
    assert "largest_overlap" in simulation.particle_solver.edges.fields
    numbers_of_law = simulation.particle_solver.system.parameters.contact
    assert (numbers_of_law.loading_stiffness, numbers_of_law.unloading_stiffness) == (400.0, 500.0)
    assert Case.from_text(case.to_toml()) == case
    page = call("explain", "walton_braun").out
    assert "Walton and Braun" in page and "unloading_stiffness = 40000" in page and "largest_overlap [m]" in page


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"laws.contact": "walton"}, "--set laws.contact = 'walton': must be one of .*did you mean 'walton_braun'"),
        ({"laws.contact": "hertz"}, "laws.contact_parameters.*left out; hertz has no parameters"),
        ({"laws.contact_parameters.stiffness": 1.0}, "one of loading_stiffness, unloading_stiffness"),
        ({"laws.contact_parameters.loading_stiffness": -1.0}, "loading_stiffness.*at least 0"),
    ],
    ids=str,
)
def test_wrong_words_for_a_contact_law_are_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Case.from_text(CASE, "bed.toml", changed)


def test_a_run_that_counts_energy_needs_a_law_that_gives_it() -> None:
    unknown = {"laws.contact": WITHOUT_ENERGY.name, "run.energy_budget": True}
    found = preflight(Case.from_text(CASE, "bed.toml", unknown))
    assert [each.key for each in found.issues] == ["run.energy_budget"]


@pytest.mark.parametrize("speed", [0.01, 1.0])
def test_the_estimated_overlap_is_that_of_the_law(speed: float) -> None:
    """Hertz in closed form; a spring v sqrt(m/k)."""
    row, mass, radius = pair_table([GLASS])[0, 0], 1e-6, 2.5e-4
    stiffness = contact.hertz_stiffness(float(row["contact_modulus"]), radius)
    hertz = contact_named("hertz")
    assert hertz.largest_overlap(mass, radius, row, speed) == pytest.approx(
        contact.hertz_largest_overlap(mass, stiffness, speed), rel=1e-5
    )
    assert hertz.resting_overlap(mass, radius, row, 0.01) == pytest.approx((0.01 / stiffness) ** (2 / 3), rel=1e-5)
    spring = contact_named("linear").with_parameters(normal_stiffness=1e4)
    assert spring.largest_overlap(mass, radius, row, speed) == pytest.approx(speed * math.sqrt(mass / 1e4), rel=1e-5)


def test_what_a_law_cannot_do_is_refused() -> None:
    def odd(temperature: float) -> float:
        return temperature

    def worded(overlap: float) -> float:
        return float(str(overlap))

    with pytest.raises(InputError, match=r"argument of odd = 'temperature'"):
        pair(ContactLaw(name="odd", force=odd, damping=odd, stiffness=odd, tangential_stiffness=odd))
    with pytest.raises(InputError, match=r"laws.contact = 'worded'.*compiled"):
        check_contact_law(replace(LAW, energy=worded))
    with pytest.raises(InputError, match=r"energies.*'energy_unknown'"):
        pair(WITHOUT_ENERGY, energies=True)
    with pytest.raises(InputError, match=r"contact = 'herz'.*did you mean 'hertz'"):
        Laws(contact="herz").check()


@pytest.mark.parametrize("initial", [math.inf, -math.inf, math.nan])
def test_memory_may_begin_at_a_number_that_is_not_finite(initial: float) -> None:
    law = replace(LAW, memory=(Field("largest_overlap", "m", role="memory", initial=initial),))
    memory = SimpleNamespace(largest_overlap=[0.0])
    write = contact_choices(law)["write_memory"].py_func
    write(memory, 0, (1e-6,), True)
    assert memory.largest_overlap == [1e-6]
    write(memory, 0, (1e-6,), False)
    assert memory.largest_overlap == pytest.approx([initial], nan_ok=True)


@pytest.mark.parametrize(
    ("field", "said"),
    [
        (Field("way", "m", 3, "memory"), "'way': must be one number"),
        (Field("oldest", role="memory", initial=lambda table, rows: rows), "'oldest'.*initial value is a number"),
        (Field("spring", "m", role="memory"), "'spring': must be another name"),
        (Field("approach_speed", "m/s", role="memory"), "'approach_speed': must be another name"),
        (Field("roll", role="memory"), "'roll': must be another name"),
        (Field("begin", "s", role="memory"), "'begin': must be another name"),
        (Field("first", role="memory"), "'first': must be another name"),
    ],
)
def test_memory_that_loops_cannot_keep_is_refused(field: Field, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Laws(contact=replace(LAW, memory=(field,))).check()


@pytest.mark.parametrize(
    "changes, said",
    [
        (
            {"force": lambda overlap: math.log(overlap - 1.0)},
            r"force fails \(",
        ),
        ({"force": lambda overlap: math.nan}, "force is nan at an overlap of 0.0001 % of a diameter"),
        ({"force": lambda overlap: None}, "force fails"),
        ({"damping": lambda overlap: -1.0}, "damping not negative"),
        ({"stiffness": lambda overlap: 0.0}, "stiffness must be positive"),
        ({"stiffness": lambda loading_stiffness: 0.1 * loading_stiffness}, "but force rises by 400 N/m"),
        ({"force": lambda overlap, temperature: overlap}, "temperature.*declare another one in `parameters`"),
    ],
)
def test_a_check_names_what_is_wrong_with_a_contact_law(changes: dict[str, Any], said: str) -> None:
    """The key is that of the law, and only a stiffness below the slope of the force is no error."""
    name = register(replace(LAW, name="wrong", secant_stiffness=None, **changes)).name
    case = Case(
        material={"glass": GLASS}, column={"width": 0.006, "height": 0.02, "cell": 0.002},
        bed={"diameter": 1e-3, "count": 40, "start": "suspended"}, run={"until": 0.002},
        laws={"contact": name, "contact_parameters": {"loading_stiffness": 400.0, "unloading_stiffness": 500.0}},
    )  # fmt: skip
    found = [issue for issue in preflight(case).issues if issue.key == "laws.contact"]
    assert len(found) == 1 and re.search(said, found[0].reason), found
    assert (found[0].severity == "warning") == ("but force" in said)
    right = case.with_(**{"laws.contact": LAW.name})
    assert not [issue for issue in preflight(right).issues if issue.key == "laws.contact"]
