"""Means that drift, and means whose error is a lower bound: marked in reports, not judged in comparisons."""

from __future__ import annotations

import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from made_up_run import made_up

from cfddem.analysis.comparison import compare, lines
from cfddem.analysis.report import report
from cfddem.analysis.report_text import lines as report_lines
from cfddem.analysis.report_text import markdown
from cfddem.io.reading import open_run
from cfddem.plotting.report_page import comparison_page, render


def test_the_drift_is_that_of_the_rows_that_are_averaged(tmp_path: Path) -> None:
    """A height that falls by 3.5 % in three quarters of the window, then rests: the line falls by 0.0394/0.978."""
    folder = made_up(tmp_path / "run", rows=121)
    with h5py.File(folder / "history.h5", "r+") as file:
        part = np.clip((file["time"][:] - 1.0) / 0.75, 0.0, 1.0)
        file["bed_height"][:] = 0.04 * (1.0 - 0.035 * part) + 1e-6 * np.sin(np.arange(121))
    found = next(each for each in report(folder).key_results if each.name == "bed height")
    assert str(found.verdict).startswith("still drifts by 4 % from 1 to 2 s, do not use the mean")
    assert found.holds is False
    measure = report(folder).measures["bed_height"]
    assert measure.drift == pytest.approx(-0.0394 * 0.04, rel=0.05)


@pytest.mark.usefixtures("no_pictures")
def test_an_error_that_is_a_lower_bound_is_marked_everywhere_and_judges_nothing(tmp_path: Path) -> None:
    """Two levels of a slow wave, whose block means are correlated up to an eighth of the record."""
    for name, level in (("a", 0.04), ("b", 0.05)):
        with h5py.File(made_up(tmp_path / name) / "history.h5", "r+") as file:
            file["bed_height"][:] = level + 1e-3 * np.sin(2.0 * np.pi * 4.0 * file["time"][:])
    result = report(tmp_path / "a")
    assert result.measures["bed_height"].error_is_lower_bound
    for text in ("\n".join(report_lines(result)), markdown(result), render(open_run(tmp_path / "a"), result)):
        assert "at least" in text
    found = compare([tmp_path / "a", tmp_path / "b"])
    row = found["measures"]["bed_height"]["runs"][1]
    assert (math.isnan(row["z"]), row["verdict"]) == (True, "not judged: errors are lower bounds")
    assert any("at least" in line and "not judged" in line for line in lines(found))
    comparison_page([tmp_path / "a", tmp_path / "b"], tmp_path / "both.html", found)
    page = (tmp_path / "both.html").read_text()
    assert "at least" in page and "not judged: errors are lower bounds" in page
