"""The report of a run: known numbers from a synthetic record, a self-contained page, and the progress line."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from made_up_run import BED, made_up, quantities

from cfddem.analysis.bed_laws import comparison, expansion_note
from cfddem.analysis.measures import voidage_from_pressure
from cfddem.analysis.report import report
from cfddem.analysis.report_text import lines, markdown
from cfddem.backend.errors import InputError
from cfddem.backend.json_text import as_json
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.cli import app as cli
from cfddem.io.writer import RunFolder
from cfddem.plotting.report_page import page
from closures import bed as laws_of_beds
from closures.drag import di_felice, ergun
from closures.registry import REGISTRY, Law


def test_means_errors_and_laws_match_the_record(tmp_path: Path) -> None:
    result = report(made_up(tmp_path / "run"))
    assert result.window == (1.0, 2.0) and result.status == "finished"
    height = result.measures["bed_height"]
    assert height.mean == pytest.approx(0.04, abs=4.0 * height.error)
    assert height.error == pytest.approx(1e-4 / math.sqrt(201), rel=0.3)
    assert height.stationary is True
    assert "bed_voidage_from_pressure" not in result.measures  # NaN in every row
    rows = {row.law: row for row in result.laws}
    assert rows["pressure drop by the buoyant weight"].ratio == pytest.approx(1.0, abs=0.003)
    archimedes = 1000.0 * 1500.0 * 9.81 * 8e-9 / 1e-6
    reynolds = laws_of_beds.terminal_reynolds_brown_lawler(archimedes)
    exponent = laws_of_beds.exponent_richardson_zaki(reynolds, 0.0)
    expected = (0.05 / (reynolds * 1e-3 / (1000.0 * 2e-3))) ** (1.0 / exponent)
    assert rows["voidage by Richardson-Zaki"].expected == pytest.approx(expected, rel=1e-12)
    assert result.ledger == {"momentum_imbalance": 1e-15, "volume_imbalance": 1e-9, "particles_lost": 0.0}
    assert result.steps == {"particles": 40_000, "fluid": 4000}


@pytest.mark.usefixtures("no_pictures")
def test_iterations_and_damping_number_of_films_are_those_of_the_window(tmp_path: Path) -> None:
    folder, without = made_up(tmp_path / "run"), made_up(tmp_path / "none", BED + 'lubrication = "none"')
    result, words = report(folder), "ilms solved together: 1.2 iterations a step, largest damping number X = 100"
    assert result.film_solution == {"iterations": pytest.approx(1.2), "damping_number": 100.0}
    assert any(words in line for line in lines(result))
    assert words in page(folder, tmp_path / "run.html").read_text() and words in markdown(result)
    assert report(without).film_solution == {} and "solved together" not in "\n".join(lines(report(without)))


def test_a_sentence_says_where_the_voidages_lie_among_the_published_ones(tmp_path: Path) -> None:
    case = Case.from_text(BED)
    laws = [comparison(f"voidage by {law}", 0.6, expected, "1") for law, expected in (("one", 0.59), ("other", 0.62))]
    spread = "the published voidages differ by 0.030, 0.590 to 0.620"
    note = expansion_note(case, laws, {})
    assert note.startswith(f"{spread}; that of the run lies within. ") and "Outside of their ranges: " in note
    assert "that of the run lies 0.010 above them. " in expansion_note(case, laws[:1], {})
    height = report(made_up(tmp_path / "other")).measures["bed_height"]
    both = expansion_note(case, laws, {"bed_voidage_from_pressure": replace(height, mean=0.63)})
    assert "Compare the bed voidage, from the height" in both and "from the pressure, 0.030 higher" in both
    assert expansion_note(case, [], {}) == ""
    assert any("published voidages differ" in line for line in lines(report(made_up(tmp_path / "run"))))


def test_no_slip_walls_increase_the_expected_voidage(tmp_path: Path) -> None:
    free = report(made_up(tmp_path / "free")).laws
    stuck = report(made_up(tmp_path / "stuck", BED.replace("free_slip", "no_slip"))).laws
    for one, other in zip(free[1:], stuck[1:]):
        assert other.expected > one.expected + 0.005, one.law


def test_a_packed_bed_is_compared_with_ergun(tmp_path: Path) -> None:
    fixed = report(made_up(tmp_path / "run", BED.replace("[run]", "fixed = true\n[run]"))).laws
    slope = laws_of_beds.ergun_gradient(0.05, 2e-3, 1000.0, 1e-3, 0.6)
    assert [row.law for row in fixed] == ["pressure drop by di_felice", "pressure drop by Ergun"]
    assert fixed[1].expected == pytest.approx(slope * 0.04 / 0.99, rel=0.003)
    factor = di_felice(100.0, 0.6) / ergun(100.0, 0.6)
    assert fixed[0].expected == pytest.approx(factor * fixed[1].expected, rel=0.01)


def test_the_pressure_drop_of_a_shallow_packed_bed_says_that_it_is_too_low(tmp_path: Path) -> None:
    """A bed of 40 mm in cells of 10 mm, and of 4 mm. One that is fluidised carries its weight in any cells; one whose
    surface is sharp has its drop in any."""
    sharp = BED.replace("[run]", "fixed = true\n[run]")
    fixed = sharp.replace("[laws]", '[laws]\nsurface = "smeared"')
    cases = ((fixed, 0.01, True), (fixed, 0.004, False), (BED, 0.01, False), (sharp, 0.01, False))
    for number, (text, cell, said) in enumerate(cases):
        found = report(made_up(tmp_path / str(number), text.replace("cell = 0.005", f"cell = {cell}"))).key_results
        (drop,) = (each for each in found if each.name == "pressure drop")
        assert ("too low, as the bed is only 4 cells high" in drop.verdict) == said


@pytest.mark.parametrize(("velocity", "said"), [(0.01, True), (0.0, False)])
def test_a_shallow_bed_without_flow_has_no_pressure_drop_that_is_too_low(
    tmp_path: Path, velocity: float, said: bool
) -> None:
    text = BED.replace("inlet_velocity = 0.05", f"inlet_velocity = {velocity}").replace("cell = 0.005", "cell = 0.01")
    folder = made_up(tmp_path / "run", text.replace("[laws]", '[laws]\nsurface = "smeared"'), bed_voidage=0.42)
    (drop,) = (each for each in report(folder).key_results if each.name == "pressure drop")
    assert ("too low, as the bed is only 4 cells high" in drop.verdict) == said


def test_warnings_of_the_check_are_repeated_where_they_affect_the_answers(tmp_path: Path) -> None:
    soft = BED.replace("contact_modulus = 1e7", "contact_modulus = 8e4").replace("[run]", "[run]\nevery = 1e-5")
    said = report(made_up(tmp_path / "run", soft)).actions["check the case: before the run, it had these warnings"]
    assert [each.split(":")[0] for each in said] == ["material.glass.contact_modulus"]  # not that of run.every


@pytest.mark.usefixtures("no_pictures")
def test_a_page_names_the_sources_of_the_laws_of_its_case(tmp_path: Path) -> None:
    cited = {each.name: each.reference for each in report(made_up(tmp_path / "run")).references}
    assert {"di_felice", "film_strength", "elastohydrodynamic", "hertz"} <= cited.keys() and "ergun" not in cited
    text = page(tmp_path / "run", tmp_path / "run.html").read_text()
    assert "Di Felice, Int. J. Multiphase Flow 20 (1994) 153" in text


@pytest.mark.usefixtures("no_pictures")
def test_a_run_without_a_fluid_has_a_report(tmp_path: Path) -> None:
    dry = BED[: BED.index("[fluid]")] + BED[BED.index("[material") :].replace("inlet_velocity = 0.05\n", "")
    result = report(made_up(tmp_path / "run", dry))
    assert result.laws == [] and "pressure_drop" not in result.measures
    assert result.ledger == {"particles_lost": 0.0}
    assert "No warnings." in page(tmp_path / "run", tmp_path / "dry.html").read_text()


def test_warnings_of_ranges_drifts_and_short_windows(tmp_path: Path) -> None:
    steady = report(made_up(tmp_path / "steady"))
    said = "\n".join(each for group in steady.actions.values() for each in group)
    assert not steady.warnings and "the bed as a whole is inside" in said and "cfddem explain" not in said
    assert (
        "the drag law di_felice was evaluated outside of its range in 10 % of its uses (800000 times): voidage" in said
    )
    assert "not stationary" not in said
    drifting = report(made_up(tmp_path / "drifts", trend=5e-3))
    assert drifting.measures["bed_height"].stationary is False
    assert any("not stationary in the averaging window: bed height" in each for each in drifting.warnings)
    short = report(made_up(tmp_path / "short", rows=11))
    assert any("too few rows" in each for each in short.warnings)
    assert max(map(len, lines(drifting))) <= 100


@pytest.mark.parametrize(
    ("laws", "ranges"),
    [
        ('drag = "schiller_naumann"', ["schiller_naumann", "reynolds 0 to 200000"]),
        ('drag = "abraham"', ["abraham", "reynolds 0 to"]),
        ('minimum_gap = "of_ones_own"', ["di_felice voidage 0.4 to 1; of_ones_own approach_speed 0 to 0.1"]),
    ],
)
def test_a_law_evaluated_outside_of_its_range_is_named_with_the_range(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, laws: str, ranges: list[str]
) -> None:
    own = Law("of_ones_own", "minimum_gap", "here", {"approach_speed": (0.0, 0.1)}, lambda roughness: roughness)
    monkeypatch.setitem(REGISTRY["minimum_gap"], "of_ones_own", own)
    run = report(made_up(tmp_path / "run", f"{BED}{laws}\n"))
    said = [each for each in run.warnings if "outside of" in each]
    assert len(said) == 1 and all(each in said[0] for each in [*ranges, "cfddem explain"])
    first = next(place for place, line in enumerate(lines(run)) if "warning: " in line and "outside of" in line)
    assert all(len(line) <= 100 for line in lines(run))
    assert "cfddem explain" in " ".join(" ".join(lines(run)[first : first + 5]).split())


ALONE = """
[fluid]
density = 1000.0
viscosity = 1e-3
[material.sphere]
density = 2500.0
youngs_modulus = 1e3
poisson = 0.25
[column]
width = 0.01
height = 0.02
cell = 0.001
sides = "free_slip"
[bed]
diameter = 1e-4
positions = [[0.005, 0.005, 0.015]]
inlet_velocity = 1e-3
[laws]
drag = "stokes"
[run]
until = 0.01
"""


@pytest.mark.usefixtures("no_pictures")
@pytest.mark.parametrize("density", [2500.0, 400.0])
def test_a_single_sphere_is_compared_with_its_drag_law(tmp_path: Path, density: float) -> None:
    """Stokes drag from rest: u_t (1 - exp(-t/tau)), here with a speed 2 % too high from 4 ms on, up to a contact."""
    text = ALONE.replace("2500.0", f"{density}")
    case = Case.from_text(text)
    grid = grid_of(case)
    terminal = (density - 1000.0) * 9.81 * 1e-8 / 18e-3
    run = RunFolder.create(tmp_path / "run", text, {}, grid, quantities(case))
    for k, time in enumerate(np.linspace(0.0, 0.01, 51)):
        fall = terminal * -math.expm1(-time * 18e-3 / (density * 1e-8)) * (1.02 if time > 3.99e-3 else 1.0)
        touches = k == 50
        velocity = [[0.0, 0.0, 0.0 if touches else 1e-3 - fall]]
        numbers = {"particle_count": 1.0, "contact_count": float(touches)}
        run.append_history({"time": time, "bed_height": 0.015, "largest_speed": abs(velocity[0][2]), **numbers})
        wind = np.zeros((*grid.shape, 3))
        wind[..., 2] = 1e-3
        run.write_snapshot(time, k, {"velocity": wind, "voidage": np.ones(grid.shape)}, {
            "position": np.full((1, 3), 0.01), "velocity": np.array(velocity), "id": np.zeros(1, int),
        })  # fmt: skip
    run.finish("finished")
    last, worst = report(tmp_path / "run").laws
    assert last.law == "terminal velocity by stokes"
    assert last.expected == pytest.approx(abs(terminal), rel=1e-9)
    assert last.computed == pytest.approx(1.02 * abs(terminal) * -math.expm1(-0.0098 * 1.8e6 / density), rel=1e-4)
    assert worst.law.startswith("equation of motion") and worst.ratio == pytest.approx(1.02, rel=1e-4)
    assert "terminal velocity by stokes" in page(tmp_path / "run", tmp_path / "alone.html").read_text()


class Page(HTMLParser):
    """The text of a page, and the addresses that it loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.open: list[str] = []
        self.fetched: list[str] = []
        self.images = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Count images, note addresses, and remember open tags."""
        self.images += tag == "img"
        self.fetched += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("img", "meta", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Tags are closed in order."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Keep the visible text."""
        self.texts.append(data)


def test_the_page_is_self_contained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    written = page(made_up(tmp_path / "run"))
    assert written == Path("run-report.html")
    seen = Page(written.read_text())
    assert seen.open == []
    assert seen.images in (3, 4) and all(each.startswith("data:image/png;base64,") for each in seen.fetched)
    words = " ".join(seen.texts)
    assert "Beads <in> water & more" in words
    for expected in (
        "Richardson-Zaki",
        "stationary",
        "outside of its range in 10 %",
        "momentum imbalance",
        "62.5 %",
    ):
        assert expected in words, expected


def test_json_is_strict_and_has_null_for_nan(tmp_path: Path) -> None:
    result = report(made_up(tmp_path / "run", rows=11))
    read = json.loads(as_json(result), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert read["measures"]["bed_height"]["error"] is None
    assert read["measures"]["bed_height"]["mean"] == result.measures["bed_height"].mean


def test_the_report_command_writes_a_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made_up(tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["cfddem", "report"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
        raise SystemExit(0)
    assert ended.value.code == 0
    assert "run-report.html" in capsys.readouterr().out and (tmp_path / "run-report.html").exists()


def test_a_run_without_history_is_refused(tmp_path: Path) -> None:
    RunFolder.create(tmp_path / "run", BED, {}, grid_of(Case.from_text(BED))).finish("failed")
    with pytest.raises(InputError, match="ended before its first row"):
        report(tmp_path / "run")


def test_voidage_from_the_pressure_gradient() -> None:
    """A bed of voidage 0.55 below a freeboard, for several cell sizes; NaN with too few cells."""
    for cells in (20, 50, 160):
        spacing = 0.1 / cells
        height = (np.arange(cells) + 0.5) * spacing
        pressure = np.minimum(height, 0.06) * -(1.0 - 0.55) * 1e4
        found = voidage_from_pressure(pressure.reshape(-1, 1, 1), (1.0, 1.0, spacing), 1e4, 0.012, 0.048)
        assert found == pytest.approx(0.55, abs=1e-12)
    assert math.isnan(voidage_from_pressure(np.zeros((4, 1, 1)), (1.0, 1.0, 0.025), 1e4, 0.012, 0.048))


def test_the_head_of_a_report_breaks_between_its_parts(tmp_path: Path) -> None:
    head = lines(report(made_up(tmp_path / "run")))[1:3]
    assert head[0].endswith(";") and head[1] == "  surface of the bed: sharp, the default"
