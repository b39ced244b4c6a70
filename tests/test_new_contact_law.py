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

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.data.fields import Field
from cfddem.particles.interactions.contact_law import ContactLaw
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles

PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "contact-law.md"
GLASS = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=0.9, friction=0.3)
RADIUS = 5e-4


def law_of_the_page() -> ContactLaw:
    names: dict[str, Any] = {"__name__": "contact_law_page"}
    exec(re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)[0], names)
    return names["WALTON_BRAUN"]  # type: ignore[no-any-return]


LAW = law_of_the_page()


def pair(law: ContactLaw = LAW, speed: float = 0.1, slide: float = 0.0) -> ParticleSolver:
    """Two spheres about to collide."""
    position, velocity = np.zeros((2, 3)), np.zeros((2, 3))
    position[1, 0], velocity[:, 0], velocity[0, 1] = 2.02 * RADIUS, (speed, -speed), slide
    made = make_particles(position, RADIUS, 2500.0, velocity=velocity)
    return ParticleSolver(made, pair_table([GLASS]), laws=Laws(contact=law), skin=0.2 * RADIUS)


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


def test_a_pair_remembers_its_largest_overlap() -> None:
    """Through a new list and a checkpoint, to the same bits; not beyond the end of the contact."""
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


def test_what_a_law_cannot_do_is_refused() -> None:
    def odd(temperature: float) -> float:
        return temperature

    def worded(overlap: float) -> float:
        return float(str(overlap))

    with pytest.raises(InputError, match=r"argument of odd = 'temperature'"):
        pair(ContactLaw(name="odd", force=odd, damping=odd, stiffness=odd, tangential_stiffness=odd))
    with pytest.raises(InputError, match=r"laws.contact = 'worded'.*compiled"):
        replace(LAW, energy=worded).check()
    with pytest.raises(InputError, match=r"energies.*'walton_braun'"):
        ParticleSolver(pair().particles, pair_table([GLASS]), laws=Laws(contact=LAW), energies=True)
    with pytest.raises(InputError, match=r"contact = 'herz'.*did you mean 'hertz'"):
        Laws(contact="herz").check()


@pytest.mark.parametrize("initial", [math.inf, -math.inf, math.nan])
def test_memory_may_begin_at_a_number_that_is_not_finite(initial: float) -> None:
    law = replace(LAW, memory=(Field("largest_overlap", "m", role="memory", initial=initial),))
    memory = SimpleNamespace(largest_overlap=[0.0])
    write = law.choices()["write_memory"].py_func
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
