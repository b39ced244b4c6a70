"""Every case of the gallery starts, runs, reports and draws, as a user would try it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
from command_line import HOME, call
from wheel import wheel_environment

from cfddem.case.gallery import gallery
from cfddem.case.schema import Case

SHARE = 20
"""The plain test takes a twentieth of the particles; the time of a start by pouring grows with their number."""
OWN_LAWS = ("coating", "wet-bed", "lubrication-study", "drying-bed", "spray-coating-hot")
"""Cases whose laws no other test compiles."""
LIKE_ANOTHER = (
    "defluidisation", "gas-bed", "gas-bed-flat", "hopper-with-air", "packed-bed", "sedimentation", "settling",
    "spouted-bed", "wurster",
)  # fmt: skip
"""Cases of a kind that another one has, too: gas beds, beds in liquid, vessels; or another test: one sphere.

`.ci/wheel` starts every case.
"""


def try_out(name: str, folder: Path, overrides: dict[str, Any]) -> None:
    """Run a few fluid steps, report and draw."""
    end = gallery()[name].run.until
    times = {"until": 2e-3 * end, "every": 1e-3 * end, "history_every": 5e-4 * end, "average_from": 1e-3 * end}
    settings = {**{f"run.{key}": value for key, value in times.items()}, **overrides}
    words = [word for key, value in settings.items() for word in ("--set", f"{key}={value!r}")]
    made = call("run", name, "-o", str(folder / "run"), *words)
    assert made.code == 0, made.err
    reported = call("report", str(folder / "run"), "-o", str(folder / "report.html"))
    assert reported.code == 0, reported.err
    assert "finished" in reported.out.splitlines()[0]
    drawn = call("view", str(folder / "run"), "-o", str(folder / "picture.png"))
    assert drawn.code == 0, drawn.err
    assert (folder / "picture.png").stat().st_size > 10_000
    assert (folder / "report.html").stat().st_size > 10_000


def fewer(case: Case) -> dict[str, Any]:
    """Overrides of a case with a twentieth of its particles."""
    bed = case.bed
    if bed.positions:
        return {}
    return {"bed.height": bed.height / SHARE} if bed.height else {"bed.count": (bed.count or 0) // SHARE}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in OWN_LAWS or name in LIKE_ANOTHER)) for name in gallery()],
)
def test_a_twentieth_of_every_gallery_case_starts_reports_and_draws(name: str, tmp_path: Path) -> None:
    try_out(name, tmp_path, fewer(gallery()[name]))


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery())
def test_every_gallery_case_starts_reports_and_draws(name: str, tmp_path: Path) -> None:
    try_out(name, tmp_path, {})


@pytest.mark.slow
def test_every_gallery_case_starts_from_the_wheel(tmp_path: Path) -> None:
    """As before a release: every command, case and data file of the installed package, away from the source."""
    home, _ = wheel_environment(tmp_path)
    here = tmp_path / "here"
    here.mkdir()
    done = subprocess.run(
        [home / "bin" / "python", "-I", HOME / ".ci" / "try_installed.py"],
        cwd=here, env={key: each for key, each in os.environ.items() if key != "PYTHONPATH"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0 and "cases started" in done.stdout, done.stderr[-2000:]
