"""A user's law from its declaration to the report: what is refused, checked, recorded and read without it."""

from __future__ import annotations

import json
import math
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_line import call
from example_case import TEXT
from made_up_run import BED, made_up

from cfddem.analysis.comparison import compare, lines
from cfddem.analysis.report import report
from cfddem.backend.errors import InputError
from cfddem.backend.law_choice import import_laws
from cfddem.case.schema import Case
from cfddem.coupling.forces.drag import Drag
from cfddem.io.reading import open_run
from cfddem.particles.interactions.film_law import FilmLaw
from cfddem.particles.interactions.laws import Laws
from cfddem.plotting.report_page import page
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.law_ranges import effect_of_drag
from cfddem.preflight.summary import preflight
from cfddem.run.resuming import record_of, warn_of_changes
from cfddem.run.runner import Run
from closures import check, registry
from closures.check import first_cause
from closures.drag import di_felice
from closures.registry import REGISTRY, law, law_of

Declare = Callable[..., Any]


@pytest.fixture
def declare(monkeypatch: pytest.MonkeyPatch) -> Declare:
    """Declare a law of a source text, for the length of a test."""

    registry.load_built_in_laws()

    def of(name: str, value: str = "1.0", kind: str = "drag", given: str = "reynolds, voidage", **ranges: Any) -> Any:
        scope: dict[str, Any] = {"math": math, "__name__": "a_package"}
        exec(f"def {name}({given}):\n    return {value}\n", scope)
        monkeypatch.setitem(REGISTRY, "drag", dict(REGISTRY["drag"]))
        return law(kind, "a test", **ranges)(scope[name])

    return of


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("di_felice", {}, r"di_felice is built in \(closures.drag\); choose another name"),
        ("none", {}, "none has another meaning in laws.drag; choose another name"),
        ("mine", {"kind": "drags"}, "kind = 'drags': must be one of drag, "),
        ("mine", {"speed": (0, 1)}, "range of speed: must be of an argument of the law, one of reynolds, voidage"),
        ("mine", {"reynolds": (3, 1)}, r"reynolds = \(3, 1\): must be a pair of numbers \(low, high\), low < high"),
        ("mine", {"reynolds": 3}, "reynolds = 3: must be a pair"),
    ],
)
def test_an_impossible_declaration_is_refused(declare: Declare, name: str, given: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        declare(name, **given)


def test_arguments_that_nothing_gives_are_named(declare: Declare) -> None:
    odd = declare("odd", given="re, voidage")
    assert check(odd)[0].startswith("takes re: not a law of kind drag, it may take reynolds, voidage")
    with pytest.raises(InputError, match=r"laws.drag = 'odd'.*it may take reynolds"):
        Case.from_text(TEXT, "bed.toml", {"laws.drag": "odd"})


def test_the_compiler_gives_its_first_cause() -> None:
    long = (
        "\x1b[1mFailed in nopython mode\x1b[0m\n\n\x1b[1mUnknown attribute 'x' of type y\x1b[0m\n\nFile 'a.py', line 3"
    )
    assert first_cause(TypeError(long)) == "Unknown attribute 'x' of type y; use numbers, math and if"


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("math.nan", "mine is nan at reynolds = 0.001, voidage = 0.4"),
        ("24.0 / reynolds", "mine fails (float division by zero) at reynolds = 0"),
        ("float(str(reynolds))", "mine cannot be compiled: "),
    ],
)
def test_a_law_that_fails_is_named_by_the_check(declare: Declare, value: str, said: str) -> None:
    declare("mine", value)
    result = preflight(Case.from_text(TEXT, "bed.toml", {"laws.drag": "mine"}))
    assert result.status == "error" and all(each.key == "laws.drag" for each in result.issues)
    assert any(each.reason.startswith(said) for each in result.issues)


def test_a_law_that_fails_beyond_its_range_is_named(declare: Declare) -> None:
    declare("mine", "di_felice if reynolds < 1.0 else math.nan", reynolds=(0.0, 0.5)).__globals__["di_felice"] = 1.0
    case = Case.from_text(TEXT, "bed.toml", {"laws.drag": "mine"})
    with pytest.raises(InputError, match=r"laws.drag = 'mine'.*it is nan at Re = .*, voidage = 0\.42"):
        estimate_bed(case)
    assert any("'mine' must be a law that is finite" in each.reason for each in preflight(case).issues)


def test_the_order_of_arguments_does_not_matter(declare: Declare) -> None:
    declare("mine", "built_in(reynolds, voidage)", given="voidage, reynolds").__globals__["built_in"] = di_felice
    mine, same = (Case.from_text(TEXT, "bed.toml", {"laws.drag": name}) for name in ("mine", "di_felice"))
    assert estimate_bed(mine) == estimate_bed(same)


def test_laws_are_compared_with_built_in_ones_only(declare: Declare) -> None:
    case = Case.from_text(TEXT, "bed.toml", {"laws.drag": "tenneti"})
    assert case.laws.drag_law is not None
    before = effect_of_drag(case, case.laws.drag_law, estimate_bed(case))
    declare("lost", "math.nan")
    assert "built-in laws" in before
    assert effect_of_drag(case, case.laws.drag_law, estimate_bed(case)) == before


def test_a_law_that_cannot_be_compiled_leaves_no_folder(declare: Declare, tmp_path: Path) -> None:
    declare("mine", "float(str(reynolds))")
    case = Case.from_text(TEXT, "bed.toml", {"laws.drag": "mine"})
    with pytest.raises(InputError, match=r"laws.drag = 'mine': must be a law that can be compiled; .*use numbers"):
        Run.begin(case, tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("(gap, 1.0)", "must be a law that returns a number; it returns 2 values"),
        ("'much'", "must be a law that returns a number; it returns a string"),
        ("None", "must be a law that returns a number; it returns nothing"),
        (
            "eta / gap",
            "must be a law that can be compiled; NameError: name 'eta' is not defined; use numbers, math and",
        ),
    ],
)
def test_a_law_of_pairs_that_loops_cannot_use_is_refused_by_its_name(value: str, said: str) -> None:
    scope: dict[str, Any] = {"__name__": "a_package"}
    exec(compile(f"\ndef mine(gap, viscosity, reduced_radius):\n    return {value}\n", "my_laws.py", "exec"), scope)
    with pytest.raises(InputError) as refusal:
        Laws(film=True, lubrication=FilmLaw(scope["mine"])).check()
    assert str(refusal.value).startswith(f"laws.lubrication = 'mine': {said}")
    assert str(refusal.value).endswith("(my_laws.py:2)") and "\n" not in str(refusal.value)


def test_drag_without_a_declaration_is_refused_where_the_case_is_made() -> None:
    with pytest.raises(InputError, match=r"laws.drag: must be a law; '<lambda>' is not a registered law; decorate it"):
        Case.from_text(TEXT, "bed.toml", {"laws.drag": lambda reynolds, voidage: 1.0})


def test_drag_that_returns_no_number_is_refused_without_a_case(declare: Declare) -> None:
    with pytest.raises(InputError, match=r"law = 'mine': must be a law that returns a number; it returns 2 values"):
        Drag(law_of(declare("mine", "(1.0, 2.0)")), "A")


def test_a_law_that_is_not_finite_in_a_run_is_named_with_its_arguments() -> None:
    drag = Drag(law_of(di_felice), "A")
    drag.law_name = "mine"
    numbers = SimpleNamespace(reynolds=np.array([1.0, 2.5, np.nan]), voidage=np.array([0.5, 0.42, 0.5]))
    drag._require_drag(numbers, np.array([3.0, 4.0, np.nan]))  # type: ignore[arg-type]
    for wrong in (np.nan, -1.0, np.inf):
        with pytest.raises(InputError, match=r"laws.drag = 'mine'.*it is .* at Re = 2.5, voidage = 0.42"):
            drag._require_drag(numbers, np.array([3.0, wrong, 4.0]))  # type: ignore[arg-type]


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An installed package of laws with a syntax error."""

    def load() -> None:
        raise SyntaxError("invalid syntax", ("my_laws.py", 5, 1, ""))

    points = [SimpleNamespace(name="my_laws", load=load)]
    monkeypatch.setattr(registry, "entry_points", lambda group: points)
    registry.load_package_laws.cache_clear()
    yield
    registry.load_package_laws.cache_clear()


@pytest.mark.usefixtures("broken")
def test_a_package_that_could_not_be_loaded_is_named() -> None:
    said = (
        r"laws.drag = 'mine'.*the package my_laws could not be loaded: SyntaxError: invalid syntax \(my_laws.py, line 5"
    )
    with pytest.raises(InputError, match=said):
        Case.from_text(TEXT, "bed.toml", {"laws.drag": "mine"})
    assert any("my_laws could not be loaded" in each.reason for each in preflight(Case.from_text(TEXT)).issues)


# ---------------------------------------------------------------- finished runs


@pytest.mark.usefixtures("no_pictures")
def test_a_run_is_read_without_the_law_that_it_used(tmp_path: Path) -> None:
    text = BED.replace('agitation = "none"', 'drag = "narrow"\nagitation = "wild"')
    result = report(_with_case(made_up(tmp_path / "run"), text))
    said = "\n".join(result.warnings)
    assert "law narrow (laws.drag) is not installed here: no prediction" in said and "law wild" in said
    assert result.preflight["numbers"] == {}
    assert "law narrow is not installed here" in page(tmp_path / "run", tmp_path / "run.html").read_text()
    found = compare([made_up(tmp_path / "other"), tmp_path / "run"])
    assert found["changed"]["laws.drag"] == ["di_felice", "narrow"]
    with pytest.raises(InputError, match=r"laws.drag = 'narrow': must be a law that is known here; .*--laws FILE.py"):
        Run.resume(tmp_path / "run")


def _with_case(folder: Path, text: str) -> Path:
    (folder / "case.toml").write_text(text)
    return folder


def test_a_law_is_recorded_and_its_change_is_reported(declare: Declare, tmp_path: Path) -> None:
    declare("mine", "1.0 + reynolds")
    case = Case.from_text(TEXT, "bed.toml", {"laws.drag": "mine"})
    about = record_of(case)
    mark = about["laws"]["drag"]["fingerprint"]
    assert about["laws"]["drag"]["module"] == "a_package" and record_of(Case.from_text(TEXT)) == {}
    noted: dict[str, Any] = {}
    folder: Any = SimpleNamespace(about={"provenance": about}, note=lambda name, value: noted.update({name: value}))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_changes(folder, case)
    assert noted == {}
    declare("mine", "1.0 + 2.0 * reynolds")
    with pytest.warns(UserWarning, match=r"laws.drag = 'mine': its source has changed since the run began"):
        warn_of_changes(folder, case)
    changed = noted["provenance"]["laws"]["drag"]["fingerprint"]
    assert changed.startswith(f"{mark}, then ") and changed.count(",") == 1
    folder.about = noted
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_changes(folder, case)


def test_a_comparison_shows_that_the_source_of_a_law_differs(tmp_path: Path) -> None:
    for name, mark in (("a", "0123"), ("b", "4567")):
        path = made_up(tmp_path / name) / "run.json"
        about = json.loads(path.read_text())
        about["provenance"]["laws"] = {"drag": {"name": "mine", "fingerprint": mark}}
        path.write_text(json.dumps(about))
    found = compare([tmp_path / "a", tmp_path / "b"])
    assert found["changed"] == {"laws.drag, source": ["0123", "4567"]}
    assert not any("the cases are the same" in line for line in lines(found))


def test_any_use_outside_of_the_range_is_reported(tmp_path: Path) -> None:
    import h5py

    with h5py.File(made_up(tmp_path / "run") / "history.h5", "r+") as file:
        file["out_of_range_count"][:] = 3.0
    said = "\n".join(each for group in report(tmp_path / "run").actions.values() for each in group)
    assert "outside of its range in 3.75e-05 % of its uses (3 times)" in said


# ---------------------------------------------------------------- resumed runs

OWN = """
import math

import closures


@closures.law("drag", "a test", reynolds=(0.0, 300.0), voidage=(0.3, 1.0))
def of_a_file(reynolds: float, voidage: float) -> float:
    return (1.0 + 0.15 * reynolds**0.687) * voidage**-3.2
"""


@pytest.fixture
def stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Path, Path]]:
    """A run with a law of a file, and that file; the law is not known any more."""
    registry.load_built_in_laws()
    monkeypatch.setitem(REGISTRY, "drag", dict(REGISTRY["drag"]))
    (file := tmp_path / "laws_of_a_test.py").write_text(OWN)
    import_laws([file])
    changes = {
        "laws.drag": "of_a_file", "laws.lubrication": "none", "bed.start": "suspended", "bed.count": 50,
        "run.until": 0.002, "run.every": 0.001, "run.average_from": 0.0, "column.height": 0.032,
    }  # fmt: skip
    Run.begin(Case.from_text(TEXT, "bed.toml", changes), tmp_path / "bed").go()
    del REGISTRY["drag"]["of_a_file"], sys.modules[file.stem]
    yield tmp_path / "bed", file
    sys.modules.pop(file.stem, None)


def test_resume_imports_a_law_of_the_file_that_the_user_names(
    stopped: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without its name, files beside the run and in it are not executed, and the message names the remedy."""
    folder, file = stopped
    monkeypatch.chdir(folder.parent)
    for place in (folder, folder.parent):
        (place / "my_laws.py").write_text("raise SystemExit('executed')")
    done = call("resume", "bed", "--until", "0.003")
    assert done.code == 2 and len(done.err.splitlines()) == 1
    assert "laws.drag = 'of_a_file': must be a law that is known here" in done.err
    assert "cfddem resume bed --laws FILE.py" in done.err and "cfddem.Run.resume" in done.err
    assert open_run(folder).status == "finished" and file.stem not in sys.modules
    done = call("resume", "bed", "--until", "0.003", "--laws", file.name)
    assert done.code == 0 and "warning: laws.drag" not in done.err, done.err
    assert open_run(folder).history["time"][-1] == 0.003


def test_check_and_run_import_a_law_of_the_file_that_the_user_names(
    stopped: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, file = stopped
    monkeypatch.chdir(folder.parent)
    done = call("check", "bed/case.toml")
    assert done.code == 2 and "laws.drag = 'of_a_file': must be one of" in done.err and "--laws FILE.py" in done.err
    assert file.stem not in sys.modules
    (folder.parent / "unused_laws.py").write_text("import closures\n")
    assert call("check", "bed/case.toml", "--laws", "unused_laws.py", "--laws", file.name).code == 0
    done = call("run", "bed/case.toml", "-o", "again", "--laws", file.name, "--set", "until=0.001")
    assert done.code == 0, done.err
    assert open_run("again").status == "finished" and "of_a_file" in open_run("again").case_text


def test_a_file_of_laws_that_is_none_is_refused(tmp_path: Path) -> None:
    for name, text, said in [
        ("no_python.txt", "", "must be an existing Python file"),
        ("numpy.py", "", "must be a file with a name of its own"),
        ("turtle.py", "", "must be a file with a name of its own"),
        (
            "broken_laws.py",
            "import nothing_of_this_name",
            "No module named 'nothing_of_this_name'",
        ),
    ]:
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match=said):
            import_laws([tmp_path / name])
    assert "broken_laws" not in sys.modules


def test_resume_says_how_a_changed_case_is_run(tmp_path: Path) -> None:
    """`cfddem resume FOLDER --set ...`: one line with the command that begins a new run at its end."""
    folder = made_up(tmp_path / "run")
    done = call("resume", str(folder), "--set", "fluid.viscosity=2e-3")
    assert done.code == 2 and len(done.err.splitlines()) == 1
    assert f"cfddem run --from {folder} --set fluid.viscosity=2e-3 -o NEW" in done.err
    assert "--set" not in call("resume", "--help").out


def test_sweeps_import_laws_of_a_file_also_in_other_processes(
    stopped: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two runs at a time; a repeated sweep keeps them, and refuses them where the source of the law has changed."""
    folder, file = stopped
    monkeypatch.chdir(folder.parent)
    words = ("sweep", "bed/case.toml", "--over", "seed=1,2", "--laws", file.name, "-o", "seeds", "--jobs", "2")
    assert call(*words[:4]).code == 2
    done = call(*words)
    assert done.code == 0, done.err
    assert "already finished" in call(*words).out
    about = Path("seeds/seed-1/run.json")
    about.write_text(about.read_text().replace('"fingerprint": "', '"fingerprint": "0'))
    done = call(*words)
    fault, *others = done.err.splitlines()  # of the run that is kept
    assert done.code == 3 and "the source of laws.drag has changed" in fault
    assert not others or others[0].startswith("cfddem: warning: means still drift")  # in the other run


def test_commands_of_a_job_array_name_the_files_of_laws(
    stopped: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, file = stopped
    monkeypatch.chdir(folder.parent)
    done = call("sweep", "bed/case.toml", "--over", "seed=1,2", "--laws", file.name, "-o", "seeds", "--write-jobs")
    assert done.code == 0, done.err
    assert all(f"--laws {file.resolve()}" in line for line in Path("seeds/jobs.txt").read_text().splitlines())


def test_explain_shows_a_law_of_a_file(stopped: tuple[Path, Path]) -> None:
    assert call("explain", "of_a_file").code == 2
    done = call("explain", "of_a_file", "--laws", str(stopped[1]))
    assert done.code == 0 and "a test" in done.out and "reynolds" in done.out


@pytest.mark.parametrize(
    "text, name, said",
    [
        ("    return 1.0 if reynolds > 1e9 else None", "odd", "returns None, which is not a number"),
        ("    return str(reynolds)", "odd", "which is not a number"),
        ("    return [1.0][int(reynolds) + 1]", "odd", "odd fails (list index out of range)"),
        ("    return 1.0", "not_there", "declares none of this name"),
        (
            "    return 1.0\n\ndef bare(reynolds, voidage):\n    return 1.0",
            "bare",
            'put @closures.law("drag", source) before the function of this name',
        ),
    ],
)
def test_a_wrong_function_of_a_file_is_refused_in_a_line(
    text: str, name: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry.load_built_in_laws()
    monkeypatch.setitem(REGISTRY, "drag", dict(REGISTRY["drag"]))
    head = 'import closures\n\n@closures.law("drag", "a test")\ndef odd(reynolds, voidage):\n'
    (file := tmp_path / "odd_laws_of_a_test.py").write_text(f"{head}{text}\n")
    try:
        done = call("check", "liquid-bed", "--laws", str(file), "--set", f"laws.drag={name}")
    finally:
        sys.modules.pop(file.stem, None)
    assert done.code == 2 and said in " ".join(f"{done.out} {done.err}".split()), done


FILM = """
import math

import closures


@closures.law("lubrication", "a test")
def film_of_a_file(gap: float, viscosity: float, reduced_radius: float) -> float:
    return 6.0 * math.pi * viscosity * reduced_radius**2 / gap
"""


def test_collisions_take_a_film_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`collide` and `calibrate --collide` give the function of the law that is named to the collision."""
    from scenarios.collisions.immersed_pair import calibration, collide, study

    registry.load_built_in_laws()
    monkeypatch.setitem(REGISTRY, "lubrication", dict(REGISTRY["lubrication"]))
    monkeypatch.chdir(tmp_path)
    Path("film_of_a_test.py").write_text(FILM)
    Path("points.csv").write_text("stokes [-], restitution [-], error [-]\n30, 0.4, 0.1\n")
    taken = []

    class Asked(study.Impact):
        def laws(self, viscosity: float) -> Laws:
            taken.append(self.lubrication)
            raise InputError("here", None, "the end of the test")

    ended = study.takes(Asked)(collide.__wrapped__)
    monkeypatch.setattr(calibration, "collide", ended)
    monkeypatch.setattr("scenarios.collisions.immersed_pair.collide", ended)
    laws = ("--laws", "film_of_a_test.py")
    film = ("--velocity", "0.1", "--stokes", "30", "--lubrication")
    fit = ("calibrate", "--collide", "glass", "--match", "points.csv", "--vary", "roughness=1e-8..1e-7",
           "--set", "velocity=0.1", "--set", "lubrication=film_of_a_file")  # fmt: skip
    try:
        assert "--laws FILE.py" in call("collide", *film, "film_of_a_file").err
        assert "--laws FILE.py" in call(*fit).err
        for words in (("collide", *film, "film_of_a_file", *laws), (*fit, *laws)):
            assert "the end of the test" in call(*words).err
        assert [law.__name__ for law in taken] == ["film_of_a_file"] * len(taken) and len(taken) >= 2
        taken.clear()
        assert "the end of the test" in call("collide", *film, "nijssen").err and taken == [None]
        assert "film_motions" in call("collide", *film, "nijssen_full").err
    finally:
        sys.modules.pop("film_of_a_test", None)
