"""The answer of a report, runs side by side, and measured data beside a run: numbers known from a synthetic record."""

from __future__ import annotations

import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call, parsed
from made_up_run import BED, WEIGHT, made_up

from cfddem.analysis.comparison import compare, distinct_names, lines
from cfddem.analysis.key_results import agreement
from cfddem.analysis.layers import profiles_of
from cfddem.analysis.measured import largest_chi2
from cfddem.analysis.report import case_of, report
from cfddem.analysis.report_text import lines as report_lines
from cfddem.analysis.report_text import markdown
from cfddem.analysis.report_values import KeyResult
from cfddem.backend.errors import InputError
from cfddem.case.compare import CaseData, points_of, read_table
from cfddem.case.schema import Case
from cfddem.io.reading import open_run
from cfddem.plotting.case_drawing import case_drawing
from cfddem.plotting.report_page import histories
from cfddem.preflight.summary import preflight
from cfddem.run.runner import Run


def answer(folder: Path, name: str) -> KeyResult:
    """One answer of a report."""
    return next(each for each in report(folder).key_results if each.name == name)


def test_the_answer_says_which_voidage_to_believe_and_what_carries_the_bed(tmp_path: Path) -> None:
    folder = made_up(tmp_path / "run")
    assert [each.name for each in report(folder).key_results] == [
        "bed height", "bed voidage", "pressure drop", "regime",
    ]  # fmt: skip
    assert answer(folder, "regime").value == "fluidised, expanded"
    drop = answer(folder, "pressure drop")
    assert drop.value == pytest.approx(WEIGHT, rel=0.003) and drop.holds is True
    assert "the buoyant weight" in str(drop.verdict)
    text = report_lines(report(folder))
    answers = next(n for n, line in enumerate(text) if not line) + 1  # after the title and the settings of the run
    assert text[answers].startswith("  bed height") and max(map(len, text)) <= 100


def test_the_voidage_from_a_height_is_no_answer_where_a_tube_in_the_fluid_lifts_particles(tmp_path: Path) -> None:
    """The height is then that of a fountain, and its voidage is not the one to use."""
    tube = '[[wall]]\nshape = "cylinder"\npoint = [0.01, 0.01, 0.01]\nradius = 0.005\nlength = 0.02\nsolid = "thin"\n'
    for equipment, recommended in ((tube, False), ("", True)):
        case = BED.replace("[run]", f"{equipment}[run]")
        folder = made_up(tmp_path / f"run{recommended}", case, bed_voidage_from_pressure=0.6)
        assert ("use this value" in str(answer(folder, "bed voidage").verdict)) is recommended


@pytest.mark.parametrize(
    ("change", "regime", "holds"),
    [
        ((), "fluidised, expanded", True),
        (("inlet_velocity = 0.05", "inlet_velocity = 0.005"), "fluidised, expanded", False),  # carried, but too slow
        (("[run]", "fixed = true\n[run]"), "fixed bed", None),
        (("inlet_velocity = 0.05", "inlet_velocity = 0.0"), "particles in motion", None),
    ],
)
def test_the_regime_follows_from_pressure_and_velocity(
    tmp_path: Path, change: tuple[str, str], regime: str, holds: bool | None
) -> None:
    found = answer(made_up(tmp_path / "run", BED.replace(*change) if change else BED), "regime")
    assert (found.value, found.holds) == (regime, holds)


HELD = """[heat]
particle_temperature = 293.0
fluid_temperature = 293.0
conductivity = 0.6
fluid_heat_capacity = 4180.0
heat_capacity = { glass = 840.0 }
[contact_heat]
held = true
conductivity = { glass = 1.0 }
[run]"""


def test_a_bed_that_a_table_holds_is_judged_as_a_fixed_one(tmp_path: Path) -> None:
    """No law of expansion, no onset of fluidisation, and no advice to fix it, which is refused with contacts."""
    slow = BED.replace("inlet_velocity = 0.05", "inlet_velocity = 0.005").replace("[run]", HELD)
    found = report(made_up(tmp_path / "run", slow))
    assert next(each.value for each in found.key_results if each.name == "regime") == "fixed bed"
    assert [law.law for law in found.laws] == ["pressure drop by di_felice", "pressure drop by Ergun"]
    drop = next(each for each in found.key_results if each.name == "pressure drop")  # made up, far above the law
    assert drop.holds is False and "a poured bed is denser inside than its mean" in str(drop.verdict)
    checked = preflight(Case.from_text(slow))
    assert "u_mf" not in {row.name for row in checked.rows}
    assert not [each for each in checked.issues if "fluidisation" in each.reason or "bed.fixed" in each.remedy]


def test_a_mean_that_drifts_much_is_not_to_be_used(tmp_path: Path) -> None:
    little = answer(made_up(tmp_path / "little", trend=5e-4), "bed height")
    much = answer(made_up(tmp_path / "much", trend=2e-2), "bed height")
    assert "still drifts by 1.3 % from 1 to 2 s" in str(little.verdict) and "do not use" not in str(little.verdict)
    assert "do not use the mean" in str(much.verdict) and much.holds is False


def test_agreement_is_counted_in_standard_errors() -> None:
    assert agreement(1.0, 0.1, 1.15, "x")[1] is True and agreement(1.0, 0.1, 1.25, "x")[1] is False
    assert agreement(1.0, math.nan, 1.15, "x") == ("13.0 % below x; no error is known", None)
    assert agreement(1.0, 0.0, 1.0, "x")[1] is True
    assert agreement(1.0, 1e-6, 1.15, "x") == ("differs from x: 13.0 % below it", False)
    assert agreement(1.0, 1e-12, 1.15, "x") == ("13.0 % below x; it does not fluctuate", None)


def test_markdown_has_the_answer_first_and_no_signs_of_its_own(tmp_path: Path) -> None:
    text = markdown(report(made_up(tmp_path / "run")), {"The case": "case.png"})
    assert text.startswith("# Beads \\<in> water & more\n")
    assert text.index("**bed height**") < text.index("![The case](<case.png>)") < text.index("## Means")


def test_the_report_is_written_as_markdown_with_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up(tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    assert call("report", "run", "--markdown")[1].startswith("# Beads")
    assert not list(tmp_path.glob("*.md"))
    call("report", "run", "-o", "bed.md")
    assert "![" in Path("bed.md").read_text() and Path("bed-case.png").exists()


# ---------------------------------------------------------------- runs side by side


def test_runs_are_compared_by_the_errors_of_their_means(tmp_path: Path) -> None:
    made_up(tmp_path / "a")
    made_up(tmp_path / "b", BED.replace("0.05\n", "0.04\n"))
    made_up(tmp_path / "c")
    with h5py.File(tmp_path / "c" / "history.h5", "r+") as file:
        file["bed_height"][:] += 1.5e-3
    made_up(tmp_path / "d", trend=1e-3)
    found = compare([tmp_path / name for name in "abcd"])
    assert found["changed"] == {"bed.inlet_velocity": [0.05, 0.04, 0.05, 0.05]}
    height = found["measures"]["bed_height"]["runs"]
    assert height[1]["difference"] == 0.0 and height[2]["difference"] == pytest.approx(1.5e-3, rel=0.01)
    assert height[2]["z"] == pytest.approx(height[2]["difference"] / math.hypot(height[0]["error"], height[2]["error"]))
    assert math.isnan(height[3]["z"]) and height[3]["verdict"] == "not judged: a mean drifts"
    text = lines(found)
    assert any("differs by" in line for line in text) and max(map(len, text)) <= 100


def test_copies_of_the_same_data_are_not_a_difference_of_runs(tmp_path: Path) -> None:
    folders = []
    for name, value in (("a", 40), ("b", 40), ("c", 41)):
        (tmp_path / name).mkdir()
        data = csv_file(tmp_path / name, f"bed height [mm]\n{value}\n")
        folders.append(made_up(tmp_path / f"run-{name}", f'{BED}[compare.data]\nfile = "{data}"\n'))
    assert compare(folders[:2])["changed"] == {}
    assert list(compare(folders[1:])["changed"]) == ["compare.data.file"]


def test_compare_writes_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up(tmp_path / "a")
    made_up(tmp_path / "b", trend=1e-3)
    monkeypatch.chdir(tmp_path)
    code, out, _ = call("compare", "a", "b")
    assert code == 0 and "compare.html" in out
    page = Path("compare.html").read_text()
    assert page.count("data:image/png;base64,") == 2 and "the cases are the same" in page
    assert parsed(call("compare", "a", "b", "--json", "-o", "two.png")[1])["runs"][1]["name"] == "b"
    assert call("compare", "a")[0] == 2 and call("compare", "a", "b", "-o", "x.pdf")[0] == 2


def test_many_runs_with_long_names_fit_on_the_page(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    """Runs are named by what differs, the legend is as wide as the panels, and nothing that is zero is listed."""
    folders = [tmp_path / f"drag-{law}_inlet_velocity-{u}" for law in ("postdoc", "di_felice") for u in (0.045, 0.055)]
    for folder in folders:
        law, speed = folder.name.removeprefix("drag-").split("_inlet_velocity-")
        made_up(folder, BED.replace("0.05\n", f"{speed}\n") + f'drag = "{law.replace("postdoc", "gidaspow")}"\n')
    found = compare(folders)
    names = [each["name"] for each in found["runs"]]
    assert names[0] == "0.045, gidaspow" and len(set(names)) == 4
    text = "\n".join(lines(found))
    assert "  equal" in text and "contact count" in text
    assert not any(all(row["mean"] == 0.0 for row in each["runs"]) for each in found["measures"].values())
    figure = histories([open_run(folder) for folder in folders], names)
    figure.canvas.draw()
    legend, panel = figure.legends[0].get_window_extent(), figure.axes[0].get_window_extent()
    assert legend.x0 >= 0.0 and legend.x1 <= figure.bbox.x1 and legend.y1 < figure.axes[-1].get_window_extent().y0
    assert panel.width > 0.7 * figure.bbox.width and not [each for each in recwarn if "layout" in str(each.message)]


def test_names_of_runs_are_told_apart() -> None:
    assert distinct_names([Path("x/bed"), Path("y/bed"), Path("y/other")]) == ["x/bed", "y/bed", "y/other"]
    assert len(set(distinct_names([Path("a"), Path("a")]))) == 2


# ---------------------------------------------------------------- measured data


def csv_file(folder: Path, text: str, name: str = "points.csv") -> Path:
    """A file of measured data."""
    path = folder / name
    path.write_text(text)
    return path


def test_measured_points_are_scored_by_their_errors(tmp_path: Path) -> None:
    """The made-up bed is 40 mm high, with noise of 0.1 mm: points 1 mm above it with an error of 0.5 mm are 2 off."""
    csv_file(tmp_path, "# measured\ntime [ms]; bed height [mm]; error [cm]\n500;41;0.05\n1000;41;0.05\n9000;41;0.05\n")
    text = BED + '[compare.heights]\nfile = "points.csv"\n'
    (tmp_path / "case.toml").write_text(text)
    case = Case.from_toml(tmp_path / "case.toml")
    folder = made_up(tmp_path / "run", text.replace("points.csv", case.compare["heights"].file))
    score = report(folder).measured[0]
    assert (score["points"], score["outside"], score["quantity"], score["against"]) == (2, 1, "bed_height", "time")
    assert score["bias"] == pytest.approx(-1e-3, abs=2e-4) and score["errors"] == pytest.approx(2.0, abs=0.4)
    assert score["holds"] is False and "differs by more than the errors" in score["verdict"]


def test_means_and_data_without_errors(tmp_path: Path) -> None:
    folder = made_up(tmp_path / "run")
    mean = csv_file(tmp_path, "bed voidage [%], error [%]\n60.1, 0.2\n", "mean.csv")
    bare = csv_file(tmp_path, "bed voidage [-]\n0.66\n", "bare.csv")
    good, unknown = report(folder, [mean, bare]).measured
    assert good["holds"] is True and good["against"] == "mean"
    assert unknown["holds"] is None and unknown["relative_rms"] == pytest.approx(0.06 / 0.66, rel=0.01)


def test_profiles_are_compared_at_the_measured_heights(tmp_path: Path) -> None:
    profile = csv_file(tmp_path, "height [mm], voidage [-], error [-]\n10, 0.6, 0.01\n20, 0.6, 0.01\n")
    made = made_up(tmp_path / "run")
    run = open_run(made)
    profiles = profiles_of(run, case_of(run), 1.0)
    assert profiles is not None and profiles.voidage is not None
    score = report(made, [profile]).measured[0]
    off = np.interp([0.01, 0.02], profiles.height, profiles.voidage) - 0.6
    assert score["points"] == 2 and score["rms"] == pytest.approx(math.sqrt((off**2).mean()))


STEPS = "[[0.0, 0.02], [1.0, 0.02], [1.02, 0.05], [2.0, 0.05]]"


def test_a_curve_over_velocity_is_compared_with_the_steps_of_the_inlet(tmp_path: Path) -> None:
    """A curve as measured: two quantities, each with errors, against velocity. The bed grows by 1 mm/s."""
    text = BED.replace("inlet_velocity = 0.05", f"inlet_velocity = {STEPS}")
    folder = made_up(tmp_path / "run", text, trend=1e-3)
    curve = csv_file(
        tmp_path,
        "velocity [mm/s], bed height [mm], bed height error [mm], pressure drop [Pa]\n"
        f"20, 40.75, 0.1, {WEIGHT}\n50, 41.75, 0.1, {WEIGHT}\n80, 45, 0.1, {WEIGHT}\n",
        "curve.csv",
    )
    height, drop = report(folder, [curve]).measured
    assert (height["points"], height["outside"], height["against"]) == (2, 1, "inlet_velocity")
    assert height["holds"] is True and abs(height["bias"]) < 5e-5, "second half of each step"
    assert drop["holds"] is None and drop["relative_rms"] < 0.01
    steady = made_up(tmp_path / "steady")  # at 50 mm/s all the time
    (one, _) = report(steady, [curve]).measured
    assert one["points"] == 1 and one["outside"] == 2


@pytest.mark.usefixtures("no_pictures")
def test_the_page_shows_measured_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up(tmp_path / "run")
    csv_file(tmp_path, "bed voidage [-]\n0.66\n")
    monkeypatch.chdir(tmp_path)
    assert "comparison with measured data" in call("report", "run", "--data", "points.csv")[1]
    assert "Comparison with measured data" in Path("run-report.html").read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"),
        ("# only\n", "the file is empty"),
        ("time [s], bed height [mm]\n", "at least one line of numbers"),
        ("time [s], bed height\n1, 2\n", "followed by its unit"),
        ("time [s], bed height [furlong]\n1, 2\n", "one of"),
        ("time [s], bed height [mm]\n1\n", "2 numbers, one for each column"),
        ("time [s], bed height [mm]\n1, two\n", "must be a number"),
        ("time [s]; bed height [mm]\n1; 2,5\n", "decimals with a point"),
        ("time [s], bed height [mm]\n1, nan\n", "a finite number"),
        ("time [s], bed height [mm]\n1, 1_0\n", "a finite number"),
        ("time [s], time [s]\n1, 2\n", "no other column has"),
        ("time [mm], bed height [mm]\n1, 2\n", "units of time"),
        ("velocity [mm], bed height [mm]\n1, 2\n", "units of velocity"),
        ("time [s], height [m], bed height [mm]\n1, 2, 3\n", "one of time and height"),
        ("velocity [m/s], height [m]\n1, 2\n", "call the height of a bed: bed height"),
        ("time [s], bed height [mm], voidage [-]\n1, 2, 3\n", "name one: column"),
        ("time [s], bed height [mm], error [s]\n1, 2, 3\n", "in the unit of bed_height"),
        ("time [s], bed height [mm], error [mm]\n1, 2, 0\n", "above 0"),
        ('time [s],"bed height [mm]\n1, 2\n', "a line of a CSV file"),
        ("time [s], a]b [m]\n1, 2\n", "a name and a unit"),
    ],
)
def test_a_bad_file_is_one_clear_line(tmp_path: Path, text: str, words: str) -> None:
    path = csv_file(tmp_path, text)
    with pytest.raises(InputError, match=words) as failure:
        points_of("data", CaseData(file=str(path)))
    assert "\n" not in str(failure.value) and str(path) in str(failure.value)


def test_only_files_of_text_are_read(tmp_path: Path) -> None:
    (tmp_path / "bytes.csv").write_bytes(b"time [s], x [m]\n\xff\n")
    for path, words in ((tmp_path, "a file"), (tmp_path / "none.csv", "does not exist"), (Path("/dev/null"), "a file")):
        with pytest.raises(InputError, match=words):
            read_table(path)
    with pytest.raises(InputError, match="UTF-8"):
        read_table(tmp_path / "bytes.csv")


def test_data_outside_of_the_folder_of_the_case_need_their_whole_path(tmp_path: Path) -> None:
    secret = csv_file(tmp_path, "bed height [mm]\n40\n")
    (tmp_path / "case").mkdir()
    (tmp_path / "case" / "link.csv").symlink_to(secret)
    for file in ("../points.csv", "link.csv"):
        (tmp_path / "case" / "case.toml").write_text(f'{BED}[compare.heights]\nfile = "{file}"\n')
        with pytest.raises(InputError, match="inside the folder of the case"):
            Case.from_toml(tmp_path / "case" / "case.toml")
    (tmp_path / "case" / "case.toml").write_text(f'{BED}[compare.heights]\nfile = "{secret}"\n')
    assert preflight(Case.from_toml(tmp_path / "case" / "case.toml")).status != "error"


def test_the_check_before_a_run_reads_the_data(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(f'{BED}[compare.heights]\nfile = "none.csv"\n')
    issues = preflight(Case.from_toml(tmp_path / "case.toml")).issues
    assert any(each.severity == "error" and each.key == "compare.heights" for each in issues)
    csv_file(tmp_path, "time [min], bed height [mm]\n5, 40\n", "none.csv")
    issues = preflight(Case.from_toml(tmp_path / "case.toml")).issues
    assert any("outside of 0 to 2 s" in each.reason for each in issues)


def test_the_largest_score_is_that_of_chance() -> None:
    """Of 2000 sets of 5 points with normal errors, about one in forty exceeds two standard deviations of chi2."""
    normal = np.random.default_rng(3).normal(size=(2000, 5))
    share = ((normal**2).mean(axis=1) > largest_chi2(5)).mean()
    assert 0.02 < share < 0.07


@pytest.mark.parametrize("name", ["liquid-bed", "hopper", "coating", "spouted-bed", "settling", "segregation"])
def test_every_kind_of_case_is_drawn(name: str) -> None:
    from cfddem.case.gallery import gallery

    assert len(case_drawing(gallery()[name], 0.02).axes) == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("bed hight [mm]\n40\n", "did you mean 'bed_height'"),
        ("time [s], bed height [Pa]\n1, 40\n", "a unit of bed_height, such as m"),
        ("height [m], pressure [Pa]\n1, 40\n", "one of voidage, granular_temperature"),
    ],
)
def test_data_that_a_run_will_not_have_are_refused_before_it_starts(tmp_path: Path, text: str, said: str) -> None:
    csv_file(tmp_path, text)
    (tmp_path / "case.toml").write_text(f'{BED}[compare.data]\nfile = "points.csv"\n')
    done = call("check", str(tmp_path / "case.toml"), "--json")
    (error,) = (each for each in parsed(done.out)["issues"] if each["severity"] == "error")
    assert done.code == 2 and error["key"] == "compare.data" and said in error["reason"]
    with pytest.raises(InputError, match=said):
        Run.begin(Case.from_toml(tmp_path / "case.toml"), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_any_text_is_read_or_refused_in_one_line(tmp_path: Path) -> None:
    """Changes of one file by a fixed seed."""
    random, good = np.random.default_rng(7), "time [s], bed height [mm], error [mm]\n1, 40, 0.5\n2, 41, 0.5\n"
    signs = list(",;\t\n\"'[]#-+.eE0123456789 \0\r\ufeffnaif%²µé\u2028")
    for _ in range(400):
        text = list(good)
        for _ in range(int(random.integers(1, 6))):
            place = int(random.integers(0, len(text)))
            text[place : place + int(random.integers(0, 3))] = [signs[int(random.integers(0, len(signs)))]]
        path = csv_file(tmp_path, "".join(text))
        try:
            points_of("data", CaseData(file=str(path)))
        except InputError as failure:
            assert "\n" not in str(failure), repr("".join(text))
