"""The pre-run check: its numbers equal those of the laws, and each faulty case gets its error or warning."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from typing import Any

import pytest
from example_case import TEXT

from cfddem.case.gallery import gallery, gallery_files
from cfddem.case.schema import Case
from cfddem.preflight.issue import percent
from cfddem.preflight.summary import Preflight, PreflightError, preflight, refuse_errors
from closures import bed, numbers

GALLERY = gallery()


def made(**given: Any) -> Preflight:
    return preflight(
        Case.from_text(TEXT, "bed.toml", {name.replace("__", "."): value for name, value in given.items()})
    )


def number(of: Preflight, name: str) -> float:
    return next(row.value for row in of.rows if row.name == name)


@pytest.mark.parametrize("name", GALLERY)
def test_no_gallery_case_has_errors(name: str) -> None:
    assert preflight(GALLERY[name]).status in ("ok", "warning"), preflight(GALLERY[name]).issue_lines()


def test_a_draft_tube_in_more_cells_than_memory_has_is_refused_in_a_line() -> None:
    """4e11 cells of the floor: those within the tube are not counted."""
    result = preflight(GALLERY["wurster"].with_(**{"column.cell": 1.5e-7}))
    assert result.status == "error" and result.issues[0].remedy
    assert not any("area by its cells" in row.name for row in result.rows)
    assert any("area by its cells" in row.name for row in preflight(GALLERY["wurster"]).rows)


def test_a_gallery_case_with_a_warning_explains_it() -> None:
    for name in ("liquid-bed", "packed-bed", "sedimentation", "segregation"):
        assert not preflight(GALLERY[name]).issues, preflight(GALLERY[name]).issue_lines()
    for name, key, severity in (
        ("settling", "material.glass.contact_modulus", "note"),
        ("lubrication-study", "material.sphere.contact_modulus", "note"),
        ("gas-bed", "material.seed.contact_modulus", "note"),
        ("gas-bed-flat", "material.polystyrene.contact_modulus", "note"),
        ("defluidisation", "material.seed.contact_modulus", "note"),
        ("spouted-bed", "material.glass.contact_modulus", "warning"),
    ):
        found = preflight(GALLERY[name])
        assert [(each.key, each.severity) for each in found.issues] == [(key, severity)]
        assert found.status == ("ok" if severity == "note" else "warning")
        assert ("`cfddem check` warns" if severity == "warning" else "`cfddem check` notes") in gallery_files()[
            name
        ].read_text()


def test_the_largest_damping_number_of_films_is_that_of_a_bead_at_the_floor_at_its_roughness() -> None:
    """X = 6 pi eta R*^2 dt/(h m*) with R* = R and m* = m: twice that of two beads; there is none without films."""
    radius, density, viscosity, step = 1.5435e-3, 3585.9, 8.354e-4, 1e-6
    found, mass = made(run__particle_step=step), density * 4.0 / 3.0 * math.pi * radius**3
    gap = number(found, "minimum gap") / number(found, "minimum gap / roughness")
    expected = 6.0 * math.pi * viscosity * radius**2 / gap / mass * step
    assert number(found, "damping number X, largest") == pytest.approx(expected, rel=0.01)
    assert "damping number X, largest" not in {row.name for row in made(laws__lubrication="none").rows}


def test_a_bed_that_breaks_up_without_agitation_is_warned_of() -> None:
    """Alumina in water: waves of 31 mm. No warning with agitation, in a shallow bed, in a gas, or in a packed bed."""
    issue, scatter = made().issues
    assert "published beds scatter" in scatter.reason
    assert "waves of 31 mm grow" in issue.reason and "free_spheres" in issue.remedy
    quiet = ({"laws__agitation": "pseudo_turbulence"}, {"bed__count": 600}, {"bed__fixed": True})
    for changes in (*quiet, {"bed__inlet_velocity": 0.03}):
        assert not any("waves" in each.reason for each in made(**changes).issues), changes


def test_a_fluid_without_viscosity_gets_no_profile_warning() -> None:
    still = made(fluid__viscosity=0.0, laws__drag="none", laws__lubrication="none")
    assert "fluid.viscosity" not in [each.key for each in still.issues]


def test_a_sphere_larger_than_the_column_is_the_only_error() -> None:
    assert [each.key for each in made(bed__diameter=3.087).issues] == ["bed.diameter"]


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"bed.count": 200}, "bed.count", "expected bed is 1.1 cells high"),
        ({"column.width": 0.005, "bed.count": 400}, "column.width", "is 2 cells wide"),
        ({"bed.diameter": 1.0}, "bed.diameter", "did you mean 0.001 m (1 mm)?"),
        (
            {"bed.diameter": 1.0, "column.width": 10.0, "column.height": 35.0, "column.cell": 2.5},
            "bed.diameter", "did you mean 0.001 m (1 mm)?",
        ),
        ({"fluid.viscosity": 1.0}, "bed.inlet_velocity", "1000 times that of water; is it in mPa s?"),
        ({"bed.inlet_velocity": 37.0}, "bed.inlet_velocity", "is it in mm/s? 0.037 m/s"),
        ({"bed.inlet_velocity": 0.3}, "bed.inlet_velocity", "use less; fluidisation begins at"),
    ],
)  # fmt: skip
def test_the_first_issue_of_a_bed_in_wrong_units_or_of_few_cells(changes: dict[str, Any], key: str, words: str) -> None:
    first = preflight(Case.from_toml(gallery_files()["liquid-bed"], changes)).issues[0]
    assert first.key == key and words in str(first)


def test_shares_are_shown_without_powers_of_ten() -> None:
    assert [percent(each) for each in (0.0204, 0.999, 1.4, 14.0)] == ["2.04 %", "99.9 %", "140 %", "1400 %"]


def test_the_numbers_are_those_of_the_laws() -> None:
    """Ferreira et al. (2023): alumina of 3.087 mm in water at 0.157 m/s."""
    result = made()
    assert [each.key for each in result.issues] == ["laws.agitation", "bed.inlet_velocity"]
    archimedes = numbers.archimedes(3.087e-3, 3585.9, 997.0, 8.354e-4, 9.81)
    assert number(result, "Ar") == pytest.approx(archimedes, rel=1e-12)
    assert number(result, "Re_p") == pytest.approx(997.0 * 0.157033 * 3.087e-3 / 8.354e-4, rel=1e-12)
    terminal = bed.terminal_reynolds_brown_lawler(archimedes) * 8.354e-4 / (997.0 * 3.087e-3)
    assert number(result, "u_t") == pytest.approx(terminal, rel=1e-9)
    assert number(result, "u / u_t") == pytest.approx(0.157033 / terminal, rel=1e-9)
    weight = 2000 * math.pi / 6 * 3.087e-3**3 * (3585.9 - 997.0) * 9.81 / 0.04**2
    assert number(result, "pressure drop") == pytest.approx(weight, rel=1e-12)
    voidage, height = number(result, "bed voidage"), number(result, "bed height")
    assert height * (1.0 - voidage) * 0.04**2 == pytest.approx(2000 * math.pi / 6 * 3.087e-3**3, rel=1e-12)


def test_minimum_fluidisation_with_ergun_drag_equals_the_ergun_correlation() -> None:
    result = made(laws__drag="ergun")
    reynolds = bed.fluidisation_reynolds_ergun(number(result, "Ar"), 0.42)
    assert number(result, "u_mf") == pytest.approx(reynolds * 8.354e-4 / (997.0 * 3.087e-3), rel=1e-9)


def test_the_terminal_velocity_by_the_drag_law_stands_beside_the_measured_one() -> None:
    """Stokes' law is far above Brown and Lawler at Re = 1000; Ergun's is not for a sphere alone."""
    assert number(made(laws__drag="brown_lawler"), "u_t, drag law") == pytest.approx(number(made(), "u_t"), rel=1e-9)
    assert number(made(laws__drag="stokes"), "u_t, drag law") > 5.0 * number(made(), "u_t")
    assert not any(row.name == "u_t, drag law" for row in made(laws__drag="ergun").rows)


def test_a_fixed_bed_has_the_pressure_drop_of_its_law_and_is_not_fluidised() -> None:
    gas = {"fluid__density": 1.2, "fluid__viscosity": 1.8e-5, "bed__inlet_velocity": 3.0, "bed__fixed": True}
    tang, ergun = (made(**gas, laws__drag=law) for law in ("tang", "ergun"))
    assert not any("u_mf" in row.name or "bubble" in row.note or "fluidis" in row.note for row in tang.rows)
    assert number(tang, "pressure drop, Ergun") == pytest.approx(number(ergun, "pressure drop"), rel=1e-12)
    assert number(tang, "pressure drop") != pytest.approx(number(ergun, "pressure drop"), rel=0.02)


def test_a_gas_bed_that_bubbles_is_at_least_as_high_as_poured() -> None:
    """Gas beds do not expand homogeneously; the balance of weight and drag would overestimate their height."""
    result = made(fluid__density=1.2, fluid__viscosity=1.8e-5, bed__inlet_velocity=3.0, run__reference_speed=0.1)
    assert number(result, "u_mf") < 3.0 < number(result, "u_t")
    assert number(result, "bed voidage") == pytest.approx(0.42)
    assert "bubbles" in next(row.note for row in result.rows if row.name == "bed height")


def test_a_softer_contact_modulus_changes_the_contact_and_not_the_film() -> None:
    smooth = {"material__alumina__roughness": 1e-9, "run__reference_speed": 0.3}
    soft, hard = made(**smooth), made(**smooth, material__alumina__contact_modulus=3e11)
    assert number(soft, "minimum gap") == number(hard, "minimum gap") > 1e-9
    assert number(soft, "minimum gap, softened") > 10.0 * number(soft, "minimum gap")
    assert number(soft, "overlap / diameter") > 10.0 * number(hard, "overlap / diameter")
    assert number(soft, "overlap / diameter, real") == pytest.approx(number(hard, "overlap / diameter"), rel=1e-12)
    assert number(soft, "particle step") > 10.0 * number(hard, "particle step")


@pytest.mark.parametrize(
    ("given", "status", "key", "said"),
    [
        ({"laws.kernel_width": 0.0, "column.cell": 0.002}, "error", "column.cell", "at least 2"),
        ({"laws.kernel_width": 0.0, "column.cell": 0.004}, "warning", "column.cell", "at least 2"),
        (
            {"column.cell": 0.004},
            "warning",
            "column.cell",
            "0.004 m is 1.3 times the diameter; averages over cells below 2",
        ),
        ({"column.cell": 0.003}, "error", "column.cell", "0.00666667 m fits along x, y and z"),
        ({"laws.kernel_width": 0.1}, "warning", "laws.kernel_width", "filters nothing"),
        ({"laws.kernel_width": 30.0}, "warning", "laws.kernel_width", "the column is 0.04 m wide"),
        (
            {"bed.jet": {"width": 1e-3, "velocity": 0.2}, "column.width": 0.032},
            "error",
            "bed.jet.width",
            "no cell of the floor",
        ),
        ({"bed.jet": {"width": 0.02, "velocity": 0.2}}, "warning", "bed.jet.width", "0.00096 m2; its own area"),
        ({"column.cell": 0.00025}, "warning", "column.cell", "of the kernel width"),
        ({"column.cell": 0.0005}, "warning", "column.cell", "of the kernel width"),
        ({"fluid.density": 0.997}, "warning", "fluid.density", "that of a gas"),
        ({"fluid.viscosity": 8.4e-7}, "warning", "fluid.viscosity", "give the dynamic viscosity"),
        (
            {"fluid.viscosity_profile": [[0.0, 1e-3], [0.04, 5e-3]]},
            "warning",
            "fluid.viscosity",
            "viscosity_profile is 0.001 to 0.005 Pa s in the bed",
        ),
        ({"material.alumina.density": 3.5859}, "warning", "material.alumina.density", "are in kg/m3"),
        (
            {"material.alumina.youngs_modulus": 300.0, "material.alumina.contact_modulus": 300.0},
            "warning",
            "material.alumina.youngs_modulus",
            "moduli are in Pa",
        ),
        ({"run.until": 1e8}, "error", "run.until", "days on one core"),
        ({"bed.count": 12_000}, "error", "bed.count", "voidage 0.28 is below the limit 0.36 of a random close packing"),
        ({"bed.count": 9_900}, "error", "bed.count", "above the lid at 0.16 m"),
        (
            {"bed.start": "suspended", "bed.count": 9_000},
            "error",
            "bed.count",
            "above the limit 0.49 of a suspended start",
        ),
        (
            {"bed.start_corner": [0.0] * 3, "bed.start_size": [0.02, 0.02, 0.02], "bed.start": "suspended"},
            "error",
            "bed.start_size",
            "2000 particles start in it; it has room for 216",
        ),
        (
            {"bed.start_corner": [0.0, 0.0, 0.01], "bed.start_size": [0.004, 0.004, 0.01], "bed.count": 100},
            "error",
            "bed.start_size",
            "100 particles start in it; it has room for 46 up to the lid",
        ),
        ({"bed.diameter": 0.05}, "error", "bed.diameter", "larger than the smallest edge of the column, 0.04 m"),
        ({"bed.inlet_velocity": 0.6}, "error", "bed.inlet_velocity", "above the terminal velocity 0.505 m/s"),
        ({"bed.inlet_velocity": [[0, 0.1], [1, 0.6]]}, "warning", "bed.inlet_velocity", "above the terminal velocity"),
        ({"bed.inlet_velocity": 0.03}, "warning", "bed.inlet_velocity", "below minimum fluidisation, 0.0533 m/s"),
        ({"bed.inlet_velocity": 0.4}, "error", "column.height", "the lid is at 0.16 m"),
        ({"column.ends": "closed"}, "warning", "bed.inlet_velocity", "unused"),
        ({"fluid": None}, "warning", "bed.inlet_velocity", "0.157033 m/s is unused, because the case has no"),
        (
            {"fluid": None, "bed.jet": {"width": 0.01, "velocity": 2.0}},
            "warning",
            "bed.jet.velocity",
            "2 m/s is unused, because the case has no table [fluid]",
        ),
        (
            {"run.particle_step": 1e-3},
            "error",
            "run.particle_step",
            "above the stability limit 0.000143 s of the impact criterion",
        ),
        ({"run.particle_step": 5e-5}, "warning", "run.particle_step", "2 % of the Hertz time"),
        ({"material.alumina.contact_modulus": 1e4}, "error", "material.alumina.contact_modulus", "the limit is 2 %"),
        (
            {"material.alumina.contact_modulus": 8e4},
            "warning",
            "material.alumina.contact_modulus",
            "the limit is 2 %",
        ),
        ({"laws.contact": "linear"}, "error", "laws.contact_parameters", "pass through each other"),
        (
            {"laws.contact": "linear", "laws.contact_parameters.normal_stiffness": 20.0},
            "warning",
            "laws.contact_parameters",
            "choose stiffer parameters of the contact law linear",
        ),
        (
            {"laws.drag": "ergun", "bed.inlet_velocity": 0.3, "column.height": 0.32},
            "warning",
            "laws.drag",
            "its drag differs by",
        ),
        ({"laws.drag": "schiller_naumann"}, "warning", "laws.drag", "is for single spheres"),
        ({"laws.lift": True}, "warning", "laws.lift", "lift is 0.42 % of the drag"),
        ({"laws.agitation": "free_spheres"}, "note", "laws.agitation", "changes bed heights by up to 3 %"),
        ({}, "warning", "laws.agitation", "(free_spheres is for reynolds 25 to 130, but the bed has 579)"),
        ({"fluid.viscosity": 0.0}, "error", "fluid.viscosity", "drag laws need a viscosity above 0"),
        ({"laws.gravity": [0, 0, 9.81]}, "error", "laws.gravity", "is not negative"),
        ({"column.width": 40.0, "column.cell": 0.16, "bed.count": 1_000_000_000}, "error", "bed.count", "GB of memory"),
        ({"run.until": 1e5}, "warning", "run.until", "days on one core"),
        ({"run.average_from": 5.0}, "warning", "run.average_from", "not before the end"),
        ({"bed.diameter": 1e-200}, "error", "bed.diameter", "SI units"),
        ({"laws.contact": "jkr"}, "error", "laws.contact", "but films form"),
        (
            {"laws.rolling_resistance": "spring_dashpot"},
            "warning",
            "laws.rolling_resistance",
            "set material.NAME.rolling_friction",
        ),
        (
            {"material.alumina.surface_energy": 0.01},
            "warning",
            "material.alumina.surface_energy",
            'laws.contact is "hertz"',
        ),
    ],
    ids=str,
)
def test_each_fault_gets_its_error_or_warning(given: dict[str, Any], status: str, key: str, said: str) -> None:
    result = preflight(Case.from_text(TEXT, "bed.toml", given))
    found = [each for each in result.issues if each.key == key and said in each.reason + each.remedy]
    assert [each.severity for each in found] == [status], result.issue_lines()
    assert result.status == "error" or status != "error"
    assert found[0].remedy


@pytest.mark.parametrize(
    ("positions", "said"),
    [
        ([[0.02, 0.02, 0.01], [0.02, 0.05, 0.01]], "bed.positions.1: [0.02, 0.05, 0.01] lies outside the column"),
        (
            [[0.02, 0.02, 0.01], [0.02, 0.02, 0.012]],
            "particles 0 and 1 overlap by 35.2 % of their diameter; the limit is 2 %",
        ),
    ],
    ids=["outside", "overlap"],
)
def test_wrong_positions_are_reported(positions: list[list[float]], said: str) -> None:
    case = Case.from_text(TEXT.replace("count = 2000\n", ""), "bed.toml", {"bed.positions": positions})
    assert said in " ".join(preflight(case).issue_lines())
    assert preflight(case).status == "error"


def test_a_dry_case_is_checked() -> None:
    text = TEXT.replace("[fluid] ", "[no]").replace("density = 997.0", "").replace("viscosity = 8.354e-4", "")
    dry = Case.from_text(text.replace("[no]", "#"))
    assert [each.key for each in preflight(dry).issues] == ["bed.inlet_velocity"]  # nothing flows
    result = preflight(dry.with_(**{"bed.inlet_velocity": 0.0}))
    assert result.status == "ok", result.issue_lines()
    assert number(result, "bed height") > 0.03


def test_a_case_with_errors_is_refused_with_all_of_them() -> None:
    case = Case.from_text(TEXT, "bed.toml", {"run.particle_step": 1e-3, "bed.inlet_velocity": 0.6, "bed.count": 12_000})
    with pytest.raises(PreflightError) as refusal:
        refuse_errors(case)
    assert refusal.value.exit_code == 2
    assert {line.split(":")[0] for line in str(refusal.value).splitlines()} >= {
        "run.particle_step",
        "bed.inlet_velocity",
        "bed.count",
    }


def test_the_estimated_steps_are_those_of_the_run() -> None:
    """The estimate uses the case alone; the run uses its particles."""
    from cfddem.run.simulation import Simulation

    given = {"bed.count": 30, "bed.start": "suspended", "column.height": 0.04}
    case = Case.from_text(TEXT, "bed.toml", given)
    simulation = Simulation(case)
    assert number(preflight(case), "particle step") == pytest.approx(simulation.time_steps.particle_step, rel=1e-12)
    fluid, _ = simulation.time_steps.choose(math.inf, 0)
    assert number(preflight(case), "fluid step") == pytest.approx(fluid, rel=1e-12)


def test_the_estimated_viscous_criterion_is_that_of_the_fluid() -> None:
    from cfddem.run.simulation import Simulation

    given = {"bed.count": 30, "bed.start": "suspended", "fluid.viscosity": 50.0, "column.height": 0.04}
    case = Case.from_text(TEXT, "bed.toml", given)
    simulation = Simulation(case)
    fluid, _ = simulation.time_steps.choose(math.inf, 0)
    assert simulation.limiting == "viscous"
    # the run uses the voidage of neighbouring cells, which thirty spheres change by a few per cent
    assert 0.95 < fluid / number(preflight(case), "viscous criterion") <= 1.0


def test_the_check_takes_less_than_three_seconds_and_compiles_nothing() -> None:
    code = """
import json, sys, time
begun = time.process_time()
import cfddem.cli.app
from cfddem import check, gallery
made = check(gallery()["packed-bed"])
print(json.dumps([made.status, time.process_time() - begun, "numba" in sys.modules, "vtkmodules" in sys.modules]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    status, seconds, compiler, pictures = json.loads(done.stdout)
    assert (status, compiler, pictures) == ("ok", False, False)
    assert seconds < 3.0


def test_json_holds_the_whole_result() -> None:
    summary = json.loads(json.dumps(made(bed__inlet_velocity=0.6).summary(), allow_nan=False))
    assert summary["status"] == "error"
    assert summary["issues"][0]["key"] == "bed.inlet_velocity"
    assert summary["numbers"]["particles and flow"]["u_t"]["unit"] == "m/s"


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({"bed.diameter": 1e12}, "bed.diameter"),
        ({"material.glass.density": 1e300}, "material.glass.density"),
        ({"bed.count": 10**400}, "bed.count"),
        ({"column.height": 1e-300, "bed.start": "suspended"}, "column.height"),
        ({"fluid.viscosity": 1e300}, "fluid.viscosity"),
    ],
    ids=["diameter", "density", "count", "height", "viscosity"],
)
def test_values_beyond_all_correlations_are_named(given: dict[str, Any], key: str) -> None:
    """One error with the key, and no traceback."""
    text = gallery_files()["liquid-bed"].read_text()
    errors = [each.key for each in preflight(Case.from_text(text, "x", given)).issues if each.severity == "error"]
    assert errors[:1] == [key]
