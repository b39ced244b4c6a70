"""The runs of a sweep as a table: means and errors of each run, units of all columns."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import cfddem
from cfddem.backend.errors import InputError
from cfddem.studies.sweep import Outcome, drifts, write_table

pytest.importorskip("pandas", reason="needs `pip install 'cfddem[data]'`")


def test_a_table_has_means_errors_and_units(tmp_path: Path) -> None:
    """Keys have the units of their description; a law beside the measures has no error; a failed run has no means."""
    measures = {
        "bed_height": (0.04, 2e-4, "m"), "bed_voidage": (0.6, math.nan, "1"), "voidage by ergun": (0.61, math.nan, "1"),
    }  # fmt: skip
    one = Outcome("s/velocity-0.04", {"bed.inlet_velocity": 0.04, "laws.drag": "wen_yu"}, "finished", measures=measures)
    other = Outcome("s/velocity-9", {"bed.inlet_velocity": 9.0, "laws.drag": "ergun"}, "refused", "too fast, see above")
    write_table([one, other], tmp_path / "sweep.csv")
    runs = cfddem.open_sweep(tmp_path)
    assert runs.index.tolist() == ["velocity-0.04", "velocity-9"]
    assert runs.loc["velocity-0.04", "bed_height"] == 0.04 and runs.loc["velocity-0.04", "bed_height_error"] == 2e-4
    assert runs["bed_height"].isna().tolist() == [False, True] and runs["bed_voidage_error"].isna().all()
    assert runs["message"].tolist()[1] == "too fast, see above" and runs["status"].tolist() == ["finished", "refused"]
    units = runs.attrs["units"]
    assert units["bed.inlet_velocity"] == "m/s" and units["bed_height"] == units["bed_height_error"] == "m"
    assert units["bed_voidage"] == units["voidage by ergun"] == "-" and "laws.drag" not in units


def test_a_sweep_says_which_means_still_drift() -> None:
    steady = Outcome("s/a", {}, "finished")
    moving = Outcome("s/b", {}, "finished", drifting=("bed_height", "pressure_drop", "wall_load", "contact_count"))
    assert drifts([steady]) == ""
    told = drifts([steady, moving])
    assert told.startswith("means still drift in 1 of 2 runs: bed_height, pressure_drop, wall_load and 1 more; ")
    assert moving.summary()["drifting"] == moving.drifting


def test_a_folder_without_a_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a folder with sweep\.csv.*goes on with a sweep"):
        cfddem.open_sweep(tmp_path)
    (tmp_path / "sweep.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"table of runs"):
        cfddem.open_sweep(tmp_path)
