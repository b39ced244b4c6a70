"""What docs/compatibility.md promises: names at the top of the package, exit codes, formats that are refused."""

from __future__ import annotations

import re
from pathlib import Path

from command_line import call

import cfddem
from cfddem.backend.errors import CfddemError, InputError, RunFailed, RunStopped
from cfddem.cli.app import app
from cfddem.preflight.summary import PreflightError

PAGE = (Path(__file__).parents[2] / "docs" / "compatibility.md").read_text(encoding="utf-8")


def test_every_name_at_the_top_is_on_the_page() -> None:
    """A name that goes or comes changes the page, and with it the promise."""
    listed = re.findall(r"`(\w+)`", PAGE.split("## Names of the Python interface")[1].split("\n\n", 2)[2])
    assert sorted(listed) == sorted(set(cfddem.__all__) - {"__version__"})


def test_exit_codes_of_the_page_are_those_of_the_errors_and_of_the_help() -> None:
    table = dict(re.findall(r"^\| (\d+) \| (.*) \|$", PAGE, re.M))
    assert set(table) == {"0", "1", "2", "3", "130", "143"}
    assert (InputError.exit_code, PreflightError.exit_code, RunFailed.exit_code) == (2, 2, 3)
    assert [RunStopped("", number).exit_code for number in (2, 15)] == [130, 143]
    assert all(issubclass(each, CfddemError) for each in (InputError, PreflightError, RunFailed, RunStopped))
    for code in table:
        assert re.search(rf"\b{code}\b", str(app.help)), code


def test_commands_end_with_these_codes(tmp_path: Path) -> None:
    assert call("check", "liquid-bed").code == 0
    assert call("check", "liquid-bed", "--strict", "--set", "run.average_from=9").code == 1
    assert call("check", "liquid-bed", "--set", "bed.diameter=1").code == 2
    assert call("report", str(tmp_path)).code == 2
    assert call("check", "--no-such-option").code == 2
