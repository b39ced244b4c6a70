"""The card of a case: its numbers are those of the laws, and what cannot come out right is named before it runs."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from typing import Any

import pytest
from example_case import TEXT

from cfddem.card import Card, RedCard, card, refuse_red
from cfddem.case import Case
from cfddem.gallery import gallery
from closures import bed, numbers

GALLERY = {name: Case.from_toml(path) for name, path in gallery().items()}


def made(**given: Any) -> Card:
    return card(Case.from_text(TEXT, "bed.toml", {name.replace("__", "."): value for name, value in given.items()}))


def number(of: Card, name: str) -> float:
    return next(row.value for row in of.rows if row.name == name)


@pytest.mark.parametrize("name", GALLERY)
def test_no_case_of_the_gallery_is_red(name: str) -> None:
    assert card(GALLERY[name]).colour in ("green", "amber"), card(GALLERY[name]).verdict()


def test_a_case_of_the_gallery_that_is_amber_says_why() -> None:
    for name in ("liquid-bed", "packed-bed", "sedimentation", "segregation"):
        assert card(GALLERY[name]).colour == "green", card(GALLERY[name]).verdict()
    for name in ("settling", "lubrication-study"):
        assert [each.key for each in card(GALLERY[name]).findings] == ["material.contact_modulus"]
        assert "`cfddem check` is amber" in gallery()[name].read_text()


def test_a_fluid_without_viscosity_is_not_in_layers() -> None:
    still = made(fluid__viscosity=0.0, laws__drag="none", laws__lubrication="none")
    assert "fluid.viscosity" not in [each.key for each in still.findings]


def test_a_sphere_larger_than_the_column_is_all_that_is_said() -> None:
    assert [each.key for each in made(bed__diameter=3.087).findings] == ["bed.diameter"]


def test_the_numbers_are_those_of_the_laws() -> None:
    """Ferreira et al. (2023): alumina of 3.087 mm in water at 0.157 m/s."""
    shown = made()
    assert shown.colour == "green"
    archimedes = numbers.archimedes(3.087e-3, 3585.9, 997.0, 8.354e-4, 9.81)
    assert number(shown, "Ar") == pytest.approx(archimedes, rel=1e-12)
    assert number(shown, "Re_p") == pytest.approx(997.0 * 0.157033 * 3.087e-3 / 8.354e-4, rel=1e-12)
    terminal = bed.terminal_reynolds_brown_lawler(archimedes) * 8.354e-4 / (997.0 * 3.087e-3)
    assert number(shown, "u_t") == pytest.approx(terminal, rel=1e-9)
    assert number(shown, "u / u_t") == pytest.approx(0.157033 / terminal, rel=1e-9)
    weight = 2000 * math.pi / 6 * 3.087e-3**3 * (3585.9 - 997.0) * 9.81 / 0.04**2
    assert number(shown, "pressure drop") == pytest.approx(weight, rel=1e-12)
    voidage, height = number(shown, "bed voidage"), number(shown, "bed height")
    assert height * (1.0 - voidage) * 0.04**2 == pytest.approx(2000 * math.pi / 6 * 3.087e-3**3, rel=1e-12)


def test_the_onset_of_fluidisation_is_that_of_ergun_for_his_drag() -> None:
    shown = made(laws__drag="ergun")
    reynolds = bed.fluidisation_reynolds_ergun(number(shown, "Ar"), 0.42)
    assert number(shown, "u_mf") == pytest.approx(reynolds * 8.354e-4 / (997.0 * 3.087e-3), rel=1e-9)


def test_a_gas_bed_that_bubbles_is_at_least_as_high_as_poured() -> None:
    """Gas beds do not expand evenly: the balance of a suspension would promise too much."""
    shown = made(fluid__density=1.2, fluid__viscosity=1.8e-5, bed__inlet_velocity=3.0, run__reference_speed=0.1)
    assert number(shown, "u_mf") < 3.0 < number(shown, "u_t")
    assert number(shown, "bed voidage") == pytest.approx(0.42)
    assert "bubbles" in next(row.note for row in shown.rows if row.name == "bed height")


def test_softening_shows_in_the_contact_and_not_in_the_film() -> None:
    smooth = {"material__alumina__roughness": 1e-9, "run__reference_speed": 0.3}
    soft, hard = made(**smooth), made(**smooth, material__alumina__contact_modulus=3e11)
    assert number(soft, "minimum gap") == number(hard, "minimum gap") > 1e-9
    assert number(soft, "minimum gap, softened") > 10.0 * number(soft, "minimum gap")
    assert number(soft, "overlap / diameter") > 10.0 * number(hard, "overlap / diameter")
    assert number(soft, "overlap / diameter, real") == pytest.approx(number(hard, "overlap / diameter"), rel=1e-12)
    assert number(soft, "step of the particles") > 10.0 * number(hard, "step of the particles")


@pytest.mark.parametrize(
    ("given", "colour", "key", "said"),
    [
        ({"laws.smoothing": 0.0, "column.cell": 0.002}, "red", "column.cell", "a bed needs 2"),
        ({"laws.smoothing": 0.0, "column.cell": 0.004}, "amber", "column.cell", "a bed needs 2"),
        ({"column.cell": 0.003}, "red", "column.cell", "0.00307692 m fits 13 times"),
        ({"column.cell": 0.00025}, "amber", "column.cell", "far below the kernel"),
        ({"column.cell": 0.0005}, "amber", "column.cell", "far below the kernel"),
        ({"fluid.density": 0.997}, "amber", "fluid.density", "that of a gas"),
        ({"fluid.viscosity": 8.4e-7}, "amber", "fluid.viscosity", "give the dynamic viscosity"),
        (
            {"fluid.viscosity_profile": [[0.0, 1e-3], [0.04, 5e-3]]},
            "amber",
            "fluid.viscosity",
            "it is 0.001 to 0.005 Pa s in the bed",
        ),
        ({"material.alumina.density": 3.5859}, "amber", "material.alumina.density", "are in kg/m3"),
        (
            {"material.alumina.youngs_modulus": 300.0, "material.alumina.contact_modulus": 300.0},
            "amber",
            "material.alumina.youngs_modulus",
            "moduli are in Pa",
        ),
        ({"run.until": 1e8}, "red", "run.until", "days on one core"),
        ({"bed.count": 12_000}, "red", "bed.count", "voidage 0.28, below 0.36 of a packing"),
        ({"bed.count": 9_900}, "red", "bed.count", "above the lid at 0.16 m"),
        ({"bed.start": "suspended", "bed.count": 9_000}, "red", "bed.count", "above 0.49 of a lattice"),
        ({"bed.diameter": 0.05}, "red", "bed.diameter", "more than the column's 0.04 m"),
        ({"bed.inlet_velocity": 0.6}, "red", "bed.inlet_velocity", "above the terminal velocity 0.505 m/s"),
        ({"bed.inlet_velocity": [[0, 0.1], [1, 0.6]]}, "amber", "bed.inlet_velocity", "above the terminal velocity"),
        ({"bed.inlet_velocity": 0.03}, "amber", "bed.inlet_velocity", "below minimum fluidisation, 0.0533 m/s"),
        ({"bed.inlet_velocity": 0.4}, "red", "column.height", "the lid is at 0.16 m"),
        ({"column.ends": "closed"}, "amber", "bed.inlet_velocity", "is not used"),
        ({"run.step": 1e-3}, "red", "run.step", "above the stability limit 0.000143 s of the impact clock"),
        ({"run.step": 5e-5}, "amber", "run.step", "2 % of a collision"),
        ({"material.alumina.contact_modulus": 1e4}, "red", "material.contact_modulus", "% is soft"),
        (
            {"material.alumina.contact_modulus": 5e5},
            "amber",
            "material.contact_modulus",
            "% is soft",
        ),
        ({"laws.contact": "linear"}, "red", "laws.normal_stiffness", "nothing keeps particles apart"),
        ({"laws.drag": "ergun", "bed.inlet_velocity": 0.3, "column.height": 0.32}, "amber", "laws.drag", "fitted for"),
        ({"fluid.viscosity": 0.0}, "red", "fluid.viscosity", "drag laws need a viscous fluid"),
        ({"laws.gravity": [0, 0, 9.81]}, "red", "laws.gravity", "does not point down"),
        ({"column.width": 40.0, "column.cell": 0.16, "bed.count": 1_000_000_000}, "red", "bed.count", "GB of memory"),
        ({"run.until": 1e5}, "amber", "run.until", "days on one core"),
        ({"run.average_from": 5.0}, "amber", "run.average_from", "not before the end"),
        ({"bed.diameter": 1e-200}, "red", "case", "SI units"),
        ({"laws.cohesion": "jkr"}, "red", "laws.cohesion", "but there are films"),
        ({"laws.rolling": "spring_dashpot"}, "amber", "laws.rolling", "give material.rolling_friction"),
        ({"material.alumina.surface_energy": 0.01}, "amber", "material.surface_energy", 'laws.cohesion is "none"'),
    ],
    ids=str,
)
def test_what_speaks_against_a_run_is_named(given: dict[str, Any], colour: str, key: str, said: str) -> None:
    shown = card(Case.from_text(TEXT, "bed.toml", given))
    found = [each for each in shown.findings if each.key == key and said in each.reason + each.remedy]
    assert [each.colour for each in found] == [colour], shown.verdict()
    assert shown.colour == "red" or colour == "amber"
    assert found[0].remedy


@pytest.mark.parametrize(
    ("positions", "said"),
    [
        ([[0.02, 0.02, 0.01], [0.02, 0.05, 0.01]], "bed.positions.1: [0.02, 0.05, 0.01] lies outside of the column"),
        ([[0.02, 0.02, 0.01], [0.02, 0.02, 0.012]], "particles 0 and 1 overlap by 35.2 % of their diameter"),
    ],
    ids=["outside", "overlap"],
)
def test_particles_placed_wrongly_are_named(positions: list[list[float]], said: str) -> None:
    case = Case.from_text(TEXT.replace("count = 2000\n", ""), "bed.toml", {"bed.positions": positions})
    assert said in " ".join(card(case).verdict())
    assert card(case).colour == "red"


def test_a_dry_case_has_a_card() -> None:
    text = TEXT.replace("[fluid] ", "[no]").replace("density = 997.0", "").replace("viscosity = 8.354e-4", "")
    shown = card(Case.from_text(text.replace("[no]", "#")))
    assert shown.colour == "green", shown.verdict()
    assert number(shown, "bed height") > 0.03


def test_a_red_case_is_refused_with_all_its_reasons() -> None:
    case = Case.from_text(TEXT, "bed.toml", {"run.step": 1e-3, "bed.inlet_velocity": 0.6, "bed.count": 12_000})
    with pytest.raises(RedCard) as refusal:
        refuse_red(case)
    assert refusal.value.exit_code == 2
    assert {line.split(":")[0] for line in str(refusal.value).splitlines()} >= {
        "run.step",
        "bed.inlet_velocity",
        "bed.count",
    }


def test_the_step_of_the_card_is_the_step_of_the_run() -> None:
    """The card knows the clocks before anything is built; the run reads them from its particles."""
    from cfddem.simulation import Simulation

    given = {"bed.count": 30, "bed.start": "suspended", "column.height": 0.04}
    case = Case.from_text(TEXT, "bed.toml", given)
    simulation = Simulation(case)
    assert number(card(case), "step of the particles") == pytest.approx(simulation._particle_step, rel=1e-12)
    fluid, _ = simulation._choose_steps(math.inf)
    assert number(card(case), "step of the fluid") == pytest.approx(fluid, rel=1e-12)


def test_the_viscous_clock_of_the_card_is_that_of_the_fluid() -> None:
    from cfddem.simulation import Simulation

    given = {"bed.count": 30, "bed.start": "suspended", "fluid.viscosity": 50.0, "column.height": 0.04}
    case = Case.from_text(TEXT, "bed.toml", given)
    simulation = Simulation(case)
    fluid, _ = simulation._choose_steps(math.inf)
    assert simulation.binding == "viscous"
    # the run weighs each cell by the voidage of its neighbours, which thirty spheres change by a few per cent
    assert 0.95 < fluid / number(card(case), "viscous clock") <= 1.0


def test_a_card_is_there_at_once_and_compiles_nothing() -> None:
    code = """
import json, sys, time
begun = time.process_time()
from cfddem.card import card
from cfddem.case import Case
from cfddem.gallery import gallery
made = card(Case.from_toml(gallery()["packed-bed"]))
print(json.dumps([made.colour, time.process_time() - begun, "numba" in sys.modules, "vtkmodules" in sys.modules]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    colour, seconds, compiler, pictures = json.loads(done.stdout)
    assert (colour, compiler, pictures) == ("green", False, False)
    assert seconds < 3.0


def test_json_holds_the_whole_card() -> None:
    summary = json.loads(json.dumps(made(bed__inlet_velocity=0.6).summary(), allow_nan=False))
    assert summary["colour"] == "red"
    assert summary["findings"][0]["key"] == "bed.inlet_velocity"
    assert summary["numbers"]["particles and flow"]["u_t"]["unit"] == "m/s"
