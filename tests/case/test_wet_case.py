"""Cases with a liquid and a spray: their input, and what the pre-run check says of them."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.gallery import full_key
from cfddem.case.liquid import Liquid
from cfddem.case.schema import Case
from cfddem.preflight.summary import Preflight, preflight
from cfddem.run.build import bridge_laws_of
from closures import capillary, numbers, restitution
from scenarios.beds.wet_bed import study

WET = """
[fluid]
density = 1.13
viscosity = 1.68e-5

[material.seed]
density = 1000.0
youngs_modulus = 1.2e8
contact_modulus = 1.0e7
poisson = 0.3
restitution = 0.9
roughness = 1e-6

[column]
width = 0.0216
depth = 0.0108
height = 0.0864
cell = [0.0036, 0.0108, 0.0036]

[bed]
diameter = 1.2e-3
count = 400
inlet_velocity = 0.6

[liquid]
viscosity = 0.02
surface_tension = 0.02
contact_angle = 20.0
thickness = 10e-6
pull = "lambert"

[laws]
lubrication = "none"

[run]
until = 1.0
"""
SPRAY: dict[str, Any] = {
    "spray.rate": 1e-10, "spray.drop_volume": 1e-13, "spray.nozzle": [0.0108, 0.0054, 0.08], "spray.length": 0.06,
}  # fmt: skip


def made(**given: Any) -> Case:
    return Case.from_text(WET, "bed.toml", {name.replace("__", "."): value for name, value in given.items()})


def refused(text: str = WET, given: dict[str, Any] | None = None) -> str:
    with pytest.raises(InputError) as refusal:
        Case.from_text(text, "bed.toml", given or {})
    message = str(refusal.value)
    assert "\n" not in message and message.count(";") <= 2
    return message


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"liquid.thickness": -1e-6}, "liquid.thickness = -1e-06: must be at least 0"),
        ({"liquid.liquid_fraction": 0.01}, "liquid.liquid_fraction = 0.01: must be left out where thickness is given"),
        (
            {"liquid.redistribution": "contact_angle"},
            "liquid.redistribution = 'contact_angle': must be used with wall_share above 0",
        ),
        ({"liquid.wall_contact_angle": 50.0}, "liquid.wall_contact_angle = 50.0: must be left out without"),
        ({"liquid.contact_angle": 200.0}, "liquid.contact_angle = 200.0: must be at most 180"),
        ({"liquid.surface_tension": -0.02}, "liquid.surface_tension = -0.02: must be at least 0"),
        ({"liquid.share_of_wet_particles": 1.5}, "liquid.share_of_wet_particles = 1.5: must be at most 1"),
        ({"liquid.wall_thickness": 1e-6}, "liquid.wall_share = 0.0: must be above 0 where wall_thickness is given"),
        (
            {"liquid.film_density": 998.0, "liquid.film": "none"},
            "film_density = 998.0: must be 0 where film is none",
        ),
        ({"liquid.pull": "wilett"}, "did you mean 'willett'?"),
        ({"fluid.density": 1000.0, "fluid.viscosity": 0.02}, "must be other than that of the fluid, 0.02 Pa s"),
        ({**SPRAY, "spray.length": 0.1}, "spray.length: must be chosen so that the spray zone lies in the column"),
        ({**SPRAY, "spray.nozzle": [0.03, 0.005, 0.08]}, "spray.nozzle: must be chosen so that"),
        ({**SPRAY, "spray.rate": -1.0}, "spray.rate = -1.0: must be at least 0"),
        ({**SPRAY, "spray.end": 0.2, "spray.begin": 0.3}, "spray.end = 0.2: must be after the beginning, 0.3 s"),
        ({**SPRAY, "spray.corner": [0.0, 0.0, 0.0]}, 'must be left out for zone = "cone"'),
        ({**SPRAY, "spray.zone": "box"}, 'spray.corner: must be given for zone = "box"'),
    ],
    ids=str,
)
def test_an_input_error_of_a_wet_case_is_one_line(given: dict[str, Any], said: str) -> None:
    assert said in refused(WET, given)


def test_a_missing_amount_and_a_missing_liquid_are_named() -> None:
    dry = WET.replace("thickness = 10e-6\n", "")
    assert "liquid.thickness: must be given, or volume_per_particle or liquid_fraction" in refused(dry)
    without = WET.split("[liquid]")[0] + WET[WET.index("[laws]") :]
    assert "spray: must be left out where there is no liquid" in refused(without, SPRAY)
    assert Case.from_text(dry, "bed.toml", SPRAY).liquid is not None, "a spray may begin on dry particles"


def test_a_wet_case_survives_its_own_text() -> None:
    case = made(**{name.replace(".", "__"): value for name, value in SPRAY.items()})
    assert Case.from_text(case.to_toml()) == case
    assert full_key("viscosity") == "fluid.viscosity"
    with pytest.raises(InputError, match=r"must be written as fluid\.density or material\.NAME\.density"):
        full_key("density")
    assert full_key("surface_tension") == "liquid.surface_tension"
    with pytest.raises(InputError, match=r"must be one of \w+, \w+ and \d+ more; cfddem new --schema shows all"):
        full_key("nonsense")


def test_the_density_of_a_film_reaches_the_laws() -> None:
    """0 by default: films have no inertia."""
    assert [bridge_laws_of(made(liquid__film_density=each)).film_density for each in (0.0, 998.0)] == [0.0, 998.0]  # type: ignore[union-attr]
    assert bridge_laws_of(made()).film_density == 0.0  # type: ignore[union-attr]


def test_the_three_amounts_of_liquid_agree() -> None:
    radius = np.array([1e-3, 2e-3])
    film = 1e-5
    volume = 4.0 / 3.0 * math.pi * ((radius + film) ** 3 - radius**3)
    given = {"viscosity": 1e-3, "surface_tension": 0.07}
    assert Liquid(thickness=film, **given).volume_on(radius) == pytest.approx(volume, rel=1e-12)
    assert Liquid(volume_per_particle=volume[0], **given).volume_on(radius) == pytest.approx([volume[0]] * 2)
    share = volume[1] / (4.0 / 3.0 * math.pi * radius[1] ** 3)
    assert Liquid(liquid_fraction=share, **given).volume_on(radius)[1] == pytest.approx(volume[1])


# ---------------------------------------------------------------- pre-run check


def number(of: Preflight, name: str) -> float:
    return next(row.value for row in of.rows if row.name == name)


def test_numbers_of_the_pre_run_check_are_those_of_the_laws() -> None:
    case = made()
    seen, radius, mass = preflight(case), 0.3e-3, 0.5 * 1000.0 * math.pi / 6.0 * 1.2e-3**3
    speed = case.reference_speed
    own = 4.0 / 3.0 * math.pi * (0.61e-3**3 - 0.6e-3**3)
    volume = 2.0 * own * capillary.liquid_share(1.0, 1.0)
    assert number(seen, "film thickness") == pytest.approx(10e-6)
    assert number(seen, "liquid / particle volume") == pytest.approx(own / (math.pi / 6.0 * 1.2e-3**3))
    assert number(seen, "bridge volume / R^3") == pytest.approx(volume / 0.6e-3**3)
    bond = numbers.granular_bond(0.02, math.radians(20.0), radius, 2.0 * mass * 9.81)
    assert number(seen, "Bo_g") == pytest.approx(bond) == pytest.approx(7.98, abs=0.01)
    assert number(seen, "Ca") == pytest.approx(0.02 * speed / 0.02)
    assert number(seen, "St, liquid") == pytest.approx(numbers.stokes(mass, speed, 0.02, radius))
    assert number(seen, "critical St, Ennis") == pytest.approx((1.0 + 1.0 / 0.9) * math.log(20.0))
    critical = number(preflight(made(liquid__film="deforming")), "critical St, film of the case")
    assert critical == pytest.approx(restitution.davis_sitison_critical_stokes(0.9, 0.05))
    assert number(seen, "critical St, film of the case") > critical, "the bridge reaches beyond the films"
    assert number(seen, "rupture gap") == pytest.approx((1.0 + math.radians(10.0)) * volume ** (1.0 / 3.0))


def test_the_regime_follows_the_stokes_number() -> None:
    def regime(viscosity: float) -> str:
        rows = preflight(made(liquid__viscosity=viscosity)).rows
        return next(row.note for row in rows if row.name == "critical St, film of the case")

    assert [regime(each).split(":")[0] for each in (1e-4, 0.02, 1.0)] == ["coating", "inertial", "non-inertial"]
    assert not any(row.group == "liquid bridges" for row in preflight(_dry()).rows)


def _dry() -> Case:
    return Case.from_text(WET.split("[liquid]")[0] + WET[WET.index("[laws]") :])


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({"liquid.thickness": 1e-4}, "liquid.thickness"),
        ({"liquid.contact_angle": 120.0}, "liquid.contact_angle"),
        ({"liquid.minimum_gap": 3e-5, "liquid.film": "deforming"}, "liquid.minimum_gap"),
        ({"fluid.density": 900.0, "fluid.viscosity": 1e-3, "laws.lubrication": "none"}, "liquid"),
        ({**SPRAY, "spray.rate": 1e-7}, "spray.rate"),
        ({**SPRAY, "spray.drop_volume": 1e-9}, "spray.drop_volume"),
    ],
    ids=str,
)
def test_a_doubtful_liquid_gets_a_warning(given: dict[str, Any], key: str) -> None:
    keys = [each.key for each in preflight(Case.from_text(WET, "bed.toml", given)).issues]
    assert key in keys and key not in [each.key for each in preflight(made()).issues]


def test_asperities_thicker_than_the_films_are_noted() -> None:
    """The resistance to sliding ends where the films do; that of Pitois along the line of centres does not."""
    said = {each.key: each for each in preflight(made(liquid__minimum_gap=3e-5)).issues}
    assert said["liquid.minimum_gap"].severity == "note" and "sliding" in said["liquid.minimum_gap"].reason
    keys = [each.key for each in preflight(made(liquid__minimum_gap=3e-5, liquid__tangential="none")).issues]
    assert "liquid.minimum_gap" not in keys


def test_adhesive_contacts_are_refused_with_bridges() -> None:
    wet = preflight(made(laws__contact="jkr", material__seed__surface_energy=0.05))
    assert ("laws.contact", "error") in [(each.key, each.severity) for each in wet.issues]


# ---------------------------------------------------------------- the case of the gallery


def test_the_states_of_the_gallery_case_differ_in_their_liquid_only() -> None:
    dry, *wet = (study.bed(name) for name in study.LIQUIDS)
    assert dry.liquid is None and all(each.liquid is not None for each in wet)
    assert len({each.liquid for each in wet}) == len(wet)
    for each in wet:
        assert each.with_(liquid=None, title=dry.title) == dry


def test_effects_are_means_over_the_window() -> None:
    time = np.linspace(0.0, 1.0, 11)
    history = {
        "time": time, "bed_height": time, "pressure_drop": 2.0 * time, "granular_temperature": 0.0 * time + 3.0,
        "bridges_per_particle": 4.0 * (time > 0.4), "agglomerate_size": 5.0 * (time > 0.4),
    }  # fmt: skip
    found = study.effects(SimpleNamespace(history=history), 0.5)  # type: ignore[arg-type]
    assert found.height == pytest.approx(0.75) and found.pressure_drop == pytest.approx(1.5)
    assert found.pressure_deviation > 0.0
    assert found.pressure_deviation == pytest.approx(2.0 * found.height_deviation)
    assert (found.granular_temperature, found.bridges_per_particle, found.agglomerate_size) == (3.0, 4.0, 5.0)
    del history["bridges_per_particle"], history["agglomerate_size"]
    dry = study.effects(SimpleNamespace(history=history), 0.5)  # type: ignore[arg-type]
    assert (dry.bridges_per_particle, dry.agglomerate_size) == (0.0, 1.0)
