"""Case files: written and read again they are equal; every input error is reported with its line."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import pytest
from example_case import TEXT

from cfddem.backend.errors import InputError
from cfddem.case.gallery import gallery_files, overrides
from cfddem.case.input_errors import InputErrors
from cfddem.case.schema import Case
from cfddem.case.toml_text import DEEPEST_KEY, LONGEST_FILE
from cfddem.preflight.summary import preflight
from cfddem.run.build import laws_of

GALLERY = gallery_files()
LONGEST_LINE = 600


def refused(text: str, given: dict[str, Any] | None = None) -> InputError:
    with pytest.raises(InputError) as refusal:
        Case.from_text(text, "bed.toml", given)
    return refusal.value


@pytest.mark.parametrize("name", GALLERY)
def test_a_case_written_and_read_again_is_equal(name: str) -> None:
    case = Case.from_toml(GALLERY[name])
    assert Case.from_text(case.to_toml()) == case
    changed = case.with_(**{"run.until": 0.125, "bed.seed": 7})
    assert (changed.run.until, changed.bed.seed) == (0.125, 7)
    assert Case.from_text(changed.to_toml()) == changed


def test_all_input_errors_are_reported_at_once_each_with_its_line() -> None:
    text = TEXT.replace("viscosity = 8.354e-4", 'viscosity = "thick"').replace("count = 2000", "cuont = 2000")
    text = text.replace('drag = "di_felice"', 'drag = "di_felce"').replace("until = 3.0 ", "")
    refusal = refused(text, {"column.width": -1})
    assert isinstance(refusal, InputErrors)
    reported = str(refusal).splitlines()
    assert len(reported) == len(refusal.errors) == 5
    lines = {
        name: 1 + next(k for k, line in enumerate(text.split("\n")) if name in line) for name in ("thick", "cuont")
    }
    assert f"bed.toml:{lines['thick']}: fluid.viscosity = 'thick': must be a number" in reported[0]
    assert "--set column.width = -1: must be above 0" in reported[1]
    assert f"bed.toml:{lines['cuont']}: bed.cuont = 2000: must be one of " in reported[2]
    assert "did you mean 'count'" in reported[2]
    assert "laws.drag = 'di_felce'" in reported[3] and "did you mean 'di_felice'" in reported[3]
    assert "run.until: must be given" in reported[4]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"bed.height": 0.01}, "count = 2000: must be given, or height, or positions, and only one"),
        ({"bed.material": "alumna"}, "bed.material = 'alumna': must be one of alumina (did you mean 'alumina'?)"),
        ({"column.material": "glass"}, "column.material = 'glass'"),
        ({"column.shape": "cylinder", "column.depth": 0.1}, "column.depth = 0.1: must be left out, or equal to width"),
        (
            {"column.shape": "cylinder", "column.sides": "periodic"},
            "column.sides = 'periodic': must be no_slip or",
        ),
        ({"column.sides": "freeslip"}, "did you mean 'free_slip'"),
        ({"fluid.viscosity_profile": [[0.1, 1e-3], [0.0, 2e-3]]}, "fluid.viscosity_profile = [0.1, 0.0]: must be"),
        (
            {"fluid.viscosity_profile": [[0.0, 1e-3], [0.1, 0.0]]},
            "fluid.viscosity_profile = 0.0: must be above 0 everywhere",
        ),
        ({"bed.inlet_velocity": -0.1}, "bed.inlet_velocity = -0.1: must be at least 0"),
        ({"bed.inlet_velocity": [[0, 0.1], [1, -0.2]]}, "bed.inlet_velocity = -0.2: must be at least 0"),
        ({"bed.diametr": 1e-3}, "must be one of diameter and 17 more (did you mean 'diameter'?)"),
        ({"laws.drag": "wenyu"}, "(did you mean 'wen_yu'?); cfddem explain lists all laws"),
        (
            {"laws.lubrication": "nijsen"},
            "must be one of auto, nijssen, nijssen_full",
        ),  # and laws that other tests have registered
        ({"laws.added_mass": "zubr"}, "(did you mean 'zuber'?); cfddem explain lists all laws"),
        ({"laws.added_mass": -0.5}, "laws.added_mass = -0.5: must be zero or positive, or the name of a law"),
        ({"column.viscosity": 1e-3}, "viscosity belongs to fluid"),
        ({"column.cell": [0.1, 0.2]}, "column.cell = [0.1, 0.2]: must be a number or a list of at least 3 values"),
        ({"bed.inlet_velocity": [[1.0, 0.1], [0.5, 0.2]]}, "bed.inlet_velocity: must be a number, or [time, velocity]"),
        ({"bed.count": 10.5}, "bed.count = 10.5: must be a whole number"),
        ({"bed.diameter": float("inf")}, "bed.diameter = inf: must be a finite number"),
        (
            {"material.alumina.contact_modulus": 1e12},
            "contact_modulus = 1000000000000.0: must be at most young",
        ),
        ({"bed.diameter.mean": 1e-3}, "must be inside a table; diameter is a value"),
        ({"laws.gravity": 9.81}, "laws.gravity = 9.81: must be a list"),
        ({"run": 3.0}, "run = 3.0: must be a table"),
        ({"bed.seed": True}, "bed.seed = True: must be something other than true or false; seed: random seed"),
        ({"run": None}, "run: must be given; a table [run]; cfddem explain run lists its keys"),
        ({"inlet": {"velocity": 1.0}}, "evaporation; keys with this word: bed.inlet_velocity, "),
        ({"solver": {"name": "x"}}, "evaporation; cfddem new --schema shows all tables"),
        (
            {"wall": {"shape": "plane", "normal": [0.0, 0.0, 1.0]}},
            "wall: must be a table [[wall]] for each; the line is [wall]",
        ),
        ({"outlet": {}}, "outlet: must be a table [[outlet]] for each; the line is [outlet]"),
        (
            {"patch": {"kind": "inlet", "velocity": 0.1, "shape": "disc"}},
            "must be a table [patch.NAME] for each; the line is [patch]",
        ),
        ({"patch": [{"kind": "inlet"}]}, "patch: must be a table [patch.NAME] for each; the line is [[patch]]"),
        (
            {"pair": {"alumina": {"friction": 0.1}}},
            "must be a table [pair.NAME.NAME] for each; the line is [pair.alumina]",
        ),
        ({"bed": [{"diameter": 1e-3, "count": 5}]}, "bed: must be one table [bed]; the line is [[bed]]"),
        ({"bed.jet": [{"velocity": 1.0}]}, "bed.jet: must be one table [bed.jet]; the line is [[bed.jet]]"),
        (
            {"fluid": {"water": {"density": 1e3, "viscosity": 1e-3}}},
            "must be one table [fluid]; the line is [fluid.water]",
        ),
        ({"laws.contact_parameter.normal_stiffness": 1.0}, "(did you mean 'contact_parameters'?)"),
        ({"title": "two\nlines"}, "title = 'two\\nlines': must be one line"),
    ],
    ids=str,
)
def test_an_input_error_names_key_value_and_limit(given: dict[str, Any], said: str) -> None:
    message = str(refused(TEXT, given))
    assert said in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\xff\xfe[\x00b\x00", "must be UTF-8 text; byte 0 is not UTF-8"),
        (b"a = 1\nb = \n", ":2: must be valid TOML"),
        (b"[a]\nb = 1\n[c]\nb = 3\nd = 4\nb = 2", ":6: c.b: must be given once; line 4 gives it, too"),
        (b"[a]\nb = 1\n[a]\nc = 3", ":3: a: must be given once; line 1 gives it, too"),
        (b"a = 1\nuntil = 1,7\n", ":2: must be valid TOML; Expected newline or end of document after a statement in"),
        (b"until = 1,7 # s\n", "; decimals have a point: 1.7"),
        (b"viscosity = 1,0e-3 # Pa s\n", "; decimals have a point: 1.0e-3"),
        (b"until = 1.7 s\n", "; numbers stand without a unit, in SI units: 1.7"),
        (b"viscosity = 1.8x10-5\n", "in column 16; powers of ten are written 1.8e-5"),
        (b"viscosity = 1.8 * 10^-5\n", "; powers of ten are written 1.8e-5"),
        (b'title = "bed\n', ":1: must be valid TOML; a string without its closing quotation mark"),
        (b"start = expanded\n", "must be valid TOML; Invalid value in column 9; strings need quotation marks"),
        (b"[material]\ndensity = 1.0", ":1: material: must be a table [material.NAME] for each; the line is"),
        (b"x = '" + b"x" * LONGEST_FILE + b"'", "must be at most 500 kB"),
        (b"x = " + b"[" * 100_000, "must be a case with lists and tables nested a few levels deep"),
        (
            b"\n" + b".".join([b"a"] * 20_000) + b" = 1",
            f":2: must be a case with fewer than {DEEPEST_KEY} dots in a key",
        ),
        (b"x = " + b"9" * 5000, "must be valid TOML; Exceeds the limit"),
        (b"", "must be given"),
    ],
    ids=range(18),
)
def test_a_file_that_is_no_case_is_refused_in_short_lines(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "bed.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as refusal:
        Case.from_toml(path)
    assert said in str(refusal.value)
    assert max(map(len, str(refusal.value).splitlines())) < LONGEST_LINE


def test_an_unreadable_file_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(InputError, match="a readable TOML file"):
            Case.from_toml(path)


def test_a_text_in_the_place_of_a_file_is_told_apart() -> None:
    with pytest.raises(InputError, match=r"path: must be the name of a case file; .*Case\.from_text reads one"):
        Case.from_toml(TEXT)


def test_a_byte_order_mark_and_windows_line_ends_are_read(tmp_path: Path) -> None:
    path = tmp_path / "bed.toml"
    path.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    assert Case.from_toml(path) == Case.from_text(TEXT)


def test_a_key_without_its_table_is_completed() -> None:
    assert overrides(["seed=3", "viscosity=2e-3", "bed.count=5", "title=a bed"]) == {
        "bed.seed": 3,
        "fluid.viscosity": 2e-3,
        "bed.count": 5,
        "title": "a bed",
    }
    with pytest.raises(InputError, match=r"seeed.*did you mean 'seed'"):
        overrides(["seeed=3"])
    with pytest.raises(InputError, match=r"height.*column.height or bed.height"):
        overrides(["height=3"])


def test_a_file_on_the_command_line_lies_relative_to_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert overrides(["compare.bed.file=b.csv"]) == {"compare.bed.file": str(tmp_path / "b.csv")}
    assert overrides(['wall.0.file="/data/cone.stl"']) == {"wall.0.file": "/data/cone.stl"}


def test_an_installed_package_can_provide_a_drag_law(monkeypatch: pytest.MonkeyPatch) -> None:
    from types import SimpleNamespace

    from closures import registry
    from closures.registry import law

    def load() -> None:
        law("drag", "of a test", reynolds=(0.0, 1.0))(offered_drag)

    def offered_drag(reynolds: float, voidage: float) -> float:
        return voidage**-3.65

    def broken() -> None:
        raise ImportError("no such file")

    points = [SimpleNamespace(name="good", load=load), SimpleNamespace(name="bad", load=broken)]
    monkeypatch.setattr(registry, "entry_points", lambda group: points if group == "cfddem.closures" else [])
    registry.load_package_laws.cache_clear()
    try:
        case = Case.from_text(TEXT, "bed.toml", {"laws.drag": "offered_drag"})
        assert case.laws.drag_law is not None and case.laws.drag_law.reference == "of a test"
        assert registry.load_package_laws() == {"bad": "ImportError: no such file"}
    finally:
        registry.REGISTRY["drag"].pop("offered_drag", None)
        registry.load_package_laws.cache_clear()


def test_a_gas_has_no_films_by_default_and_a_liquid_has() -> None:
    gas = {"fluid.density": 1.2, "fluid.viscosity": 1.8e-5, "bed.inlet_velocity": 2.0}
    text = TEXT.replace('lubrication = "nijssen"\n', "")
    for changes, film in (({}, True), (gas, False), ({**gas, "laws.lubrication": "nijssen"}, True)):
        case = Case.from_text(text, "bed.toml", changes)
        assert (case.has_films, laws_of(case).film) == (film, film)
    assert "none, the default in a gas" in str(preflight(Case.from_text(text, "bed.toml", gas)))


def test_the_advised_contact_modulus_is_the_least_that_the_limit_needs() -> None:
    """Advice is rounded up to two digits, less than 12 % too much."""

    def remedies(modulus: float) -> list[str]:
        found = preflight(Case.from_text(TEXT, "bed.toml", {"material.alumina.contact_modulus": modulus})).issues
        return [each.remedy for each in found if "contact_modulus" in each.key]

    advice = float(remedies(5e5)[0].split()[3])
    assert not remedies(advice) and remedies(advice / 1.12)


def test_places_go_with_a_placed_start_and_with_no_other() -> None:
    with pytest.raises(InputError, match=r'bed.positions: must be given with start = "placed"; one centre'):
        Case.from_text(TEXT, "bed.toml", {"bed.start": "placed"})
    places = {"bed.count": None, "bed.positions": [[0.02, 0.02, 0.02]]}
    assert Case.from_text(TEXT, "bed.toml", places).bed.start == "placed"
    with pytest.raises(InputError, match=r'with start = "suspended"; leave out start, or set start = "placed"'):
        Case.from_text(TEXT, "bed.toml", {**places, "bed.start": "suspended"})


def test_the_json_schema_holds_every_key() -> None:
    schema = Case.model_json_schema()
    for name, section in (("Bed", "bed"), ("Column", "column"), ("CaseLaws", "laws"), ("CaseRun", "run")):
        assert set(tomllib.loads(TEXT)[section]) <= set(schema["$defs"][name]["properties"])
        assert schema["$defs"][name]["additionalProperties"] is False


def test_tables_of_the_caller_stay_as_they_are() -> None:
    """A key inside of a table that the caller gives, too, changes the case and not that table."""
    bed = {"diameter": 2e-3, "count": 100, "sizes": [], "inlet_velocity": [[0.0, 0.01], [1.0, 0.02]]}
    given = {"bed": bed, "bed.count": 7, "bed.start": "suspended"}
    before = copy.deepcopy(given)
    assert Case.from_text(TEXT, "bed.toml", given).bed.count == 7
    assert Case.from_text(TEXT).with_(**given).bed.count == 7
    assert given == before and list(bed) == list(before["bed"])
