"""A key and a measure of a user in one file, as the page docs/how-to/measure.md declares them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest
from command_line import call

from cfddem.analysis.report import case_of, report
from cfddem.backend.errors import InputError
from cfddem.case.feature_table import FeatureTable, forget_table
from cfddem.case.schema import Case
from cfddem.io.reading import open_run
from cfddem.run import history
from cfddem.run.resuming import case_to_continue
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "measure.md").read_text(encoding="utf-8")
DECLARED = next(block for block in re.findall(r"```python\n(.*?)```", PAGE, re.S) if "class Splash" in block)
DRY = """
[material.glass]
density = 2500.0
youngs_modulus = 2e6
poisson = 0.25
[column]
width = 0.006
height = 0.012
cell = 0.003
[bed]
diameter = 1e-3
positions = [[3e-3, 3e-3, 1e-3], [3e-3, 3e-3, 5e-3]]
[run]
until = 0.002
history_every = 0.001
"""


@pytest.fixture
def splash() -> Iterator[dict[str, Any]]:
    """Names of the block of the page."""
    names: dict[str, Any] = {"measure": history.measure, "Case": Case, "case": Case.from_text(DRY)}
    exec(DECLARED, names)
    yield names
    history.MEASURES.pop("splashed_share", None)
    if "splash" in Case.model_fields:
        forget_table("splash")


def test_a_table_of_a_user_is_read_checked_written_and_explained(splash: dict[str, Any]) -> None:
    case = Case.from_text(f"{DRY}\n[splash]\nheight = 4e-3\n", "bed.toml")
    assert case == Case.from_text(case.to_toml()) == Case.from_text(DRY).with_(splash={"height": 4e-3})
    assert splash["splashed_share"](Simulation(case)) == pytest.approx(0.5)
    assert "splashed_share" in history.all_columns(case) and "splashed_share" not in history.all_columns(splash["case"])
    with pytest.raises(InputError, match=r"bed.toml:\d+: splash.hight.*did you mean 'height'"):
        Case.from_text(f"{DRY}\n[splash]\nhight = 4e-3\n", "bed.toml")
    with pytest.raises(InputError, match=r"splash.height.*greater than 0|splash.height.*above 0"):
        Case.from_text(f"{DRY}\n[splash]\nheight = -1.0\n", "bed.toml")
    assert "height above the floor [m]" in call("explain", "splash").out


def test_a_run_is_read_without_the_table_but_not_continued(splash: dict[str, Any], tmp_path: Path) -> None:
    Run.begin(splash["case"].with_(splash={"height": 4e-3}), tmp_path / "run").go()
    assert case_of(open_run(tmp_path / "run")).splash.height == 4e-3  # type: ignore[attr-defined]
    assert case_to_continue(tmp_path / "run", None, 0.003).splash.height == 4e-3  # type: ignore[attr-defined]
    history.forget("splashed_share")
    forget_table("splash")
    assert report(tmp_path / "run").measures["splashed_share"].mean == pytest.approx(0.5)
    with pytest.raises(InputError, match=r"splash: must be a table that is known here.*--laws FILE.py"):
        case_to_continue(tmp_path / "run", None, 0.003)
    with pytest.raises(InputError, match="splash"):
        Case.from_text(f"{DRY}\n[splash]\nheight = 4e-3\n")


def test_a_table_takes_no_name_of_another_and_replaces_itself(splash: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="table = 'bed'"):

        class Mine(FeatureTable):
            table: ClassVar[str] = "bed"
            meaning: ClassVar[str] = "nothing"

    assert "diameter" in Case.model_fields["bed"].annotation.model_fields  # type: ignore[union-attr]
    exec(DECLARED, splash)
    assert Case.from_text(DRY).with_(splash={"height": 1e-3}).splash.height == 1e-3  # type: ignore[attr-defined]
