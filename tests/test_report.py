"""The report of a run: numbers that a made-up record must give, and a page that needs nothing but itself."""

from __future__ import annotations

import json
import logging
import math
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit
from rich.progress import Progress

from cfddem import cli
from cfddem.assembly import grid_of
from cfddem.case import Case
from cfddem.errors import InputError
from cfddem.history import FIELDS
from cfddem.kernels import announce_compilation
from cfddem.progress import Line, live_line, status_of
from cfddem.record.measures import voidage_by_pressure
from cfddem.record.output import RunFolder
from cfddem.record.provenance import provenance
from cfddem.report import as_json, lines, report
from cfddem.view.page import page
from closures import bed as laws_of_beds
from closures.law import SHELF, Law

BED = """
title = "Beads <in> water & more"
[fluid]
density = 1000.0
viscosity = 1e-3
[material.glass]
density = 2500.0
youngs_modulus = 60e9
contact_modulus = 1e7
poisson = 0.25
[column]
width = 0.02
height = 0.06
cell = 0.005
sides = "free_slip"
[bed]
diameter = 2e-3
count = 2000
inlet_velocity = 0.05
[run]
until = 2.0
average_from = 1.0
"""
WEIGHT = 2000 * math.pi / 6.0 * 8e-9 * 1500.0 * 9.81 / 0.02**2
"""Buoyant, over the floor [Pa]."""
OF_THE_FLUID = (
    "bed_voidage", "bed_voidage_pressure", "pressure_drop", "exchange_imbalance", "volume_imbalance", "outside_range",
)  # fmt: skip


def made_up(folder: Path, text: str = BED, rows: int = 401, trend: float = 0.0) -> Path:
    """A run whose pressure drop carries the weight and whose voidage is 0.6, with noise of known strength."""
    case = Case.from_text(text)
    grid = grid_of(case.column)
    wet = case.fluid is not None
    run = RunFolder.create(folder, text, provenance(1), grid if wet else None, FIELDS)
    noise = np.random.default_rng(2).normal(size=(3, rows))
    for k, time in enumerate(np.linspace(0.0, 2.0, rows)):
        row = {
            "time": time,
            "fluid_steps": 10.0 * k,
            "bed_height": 0.04 + 1e-4 * noise[0, k] + trend * time,
            "bed_voidage": 0.6 + 1e-3 * noise[1, k],
            "bed_voidage_pressure": math.nan,
            "pressure_drop": WEIGHT * (1.0 + 0.01 * noise[2, k]),
            "granular_temperature": 1e-4,
            "fastest": 0.1,
            "contact_count": 7.0,
            "particle_count": 2000.0,
            "exchange_imbalance": math.nan if k == 0 else 1e-15,
            "volume_imbalance": 1e-9,
            "outside_range": 20.0 * k,
        }
        run.append_history({name: value for name, value in row.items() if wet or name not in OF_THE_FLUID})
        if k % 100 == 0:
            fluid = {"voidage": np.full(grid.shape, 0.6)} if wet else None
            run.write_snapshot(time, 100 * k, fluid, {"position": np.zeros((3, 3)), "id": np.arange(3)})
    run.note("wall_time", {"fluid": 3.0, "particles": 5.0})
    run.finish("finished")
    return folder


def test_means_errors_and_laws_are_those_of_the_record(tmp_path: Path) -> None:
    result = report(made_up(tmp_path / "run"))
    assert result["window"] == [1.0, 2.0] and result["status"] == "finished"
    height = result["measures"]["bed_height"]
    assert height["mean"] == pytest.approx(0.04, abs=4.0 * height["error"])
    assert height["error"] == pytest.approx(1e-4 / math.sqrt(201), rel=0.3)
    assert height["stationary"] is True
    assert "bed_voidage_pressure" not in result["measures"]  # it was never known
    rows = {row["law"]: row for row in result["laws"]}
    assert rows["pressure drop by the buoyant weight"]["ratio"] == pytest.approx(1.0, abs=0.003)
    archimedes = 1000.0 * 1500.0 * 9.81 * 8e-9 / 1e-6
    reynolds = laws_of_beds.terminal_reynolds_brown_lawler(archimedes)
    exponent = laws_of_beds.exponent_richardson_zaki(reynolds, 0.0)
    expected = (0.05 / (reynolds * 1e-3 / (1000.0 * 2e-3))) ** (1.0 / exponent)
    assert rows["voidage by Richardson-Zaki, from height"]["expected"] == pytest.approx(expected, rel=1e-12)
    assert result["ledger"] == {"exchange_imbalance": 1e-15, "volume_imbalance": 1e-9, "particles_lost": 0.0}
    assert result["steps"] == {"particles": 40_000, "fluid": 4000}


def test_walls_that_stick_lower_the_velocity_of_expansion(tmp_path: Path) -> None:
    free = report(made_up(tmp_path / "free"))["laws"]
    stuck = report(made_up(tmp_path / "stuck", BED.replace("free_slip", "no_slip")))["laws"]
    for one, other in zip(free[1:], stuck[1:]):
        assert other["expected"] > one["expected"] + 0.005, one["law"]


def test_a_packed_bed_is_held_against_ergun(tmp_path: Path) -> None:
    fixed = report(made_up(tmp_path / "run", BED.replace("[run]", "fixed = true\n[run]")))["laws"]
    slope = laws_of_beds.ergun_gradient(0.05, 2e-3, 1000.0, 1e-3, 0.6)
    assert [row["law"] for row in fixed] == ["pressure drop by Ergun"]
    assert fixed[0]["expected"] == pytest.approx(slope * 0.04, rel=0.01)


def test_dry_particles_have_a_report_too(tmp_path: Path) -> None:
    dry = BED[: BED.index("[fluid]")] + BED[BED.index("[material") :].replace("inlet_velocity = 0.05\n", "")
    result = report(made_up(tmp_path / "run", dry))
    assert result["laws"] == [] and "pressure_drop" not in result["measures"]
    assert result["ledger"] == {"particles_lost": 0.0}
    assert "has no voidage on a grid" in page(tmp_path / "run", tmp_path / "dry.html").read_text()


def test_what_speaks_against_the_run_is_counted(tmp_path: Path) -> None:
    said = "\n".join(report(made_up(tmp_path / "steady"))["warnings"])
    assert "di_felice was asked outside of its range 8000 times, 0.1 % of all: voidage 0.4 to 1; compare" in said
    assert "not stationary" not in said
    drifting = report(made_up(tmp_path / "drifts", trend=5e-3))
    assert drifting["measures"]["bed_height"]["stationary"] is False
    assert any("not stationary in the window: bed height" in each for each in drifting["warnings"])
    short = report(made_up(tmp_path / "short", rows=11))
    assert any("too few rows" in each for each in short["warnings"])
    assert max(map(len, lines(drifting))) <= 100


@pytest.mark.parametrize(
    ("laws", "ranges"),
    [
        ('drag = "wen_yu"', ["wen_yu", "voidage 0.4 to 1, reynolds 0 to 1000"]),
        ('drag = "tenneti"', ["tenneti", "voidage 0.5 to 1, reynolds 0 to 300"]),
        ('minimum_gap = "of_ones_own"', ["di_felice voidage 0.4 to 1; of_ones_own approach_speed 0 to 0.1"]),
    ],
)
def test_a_law_asked_outside_of_its_range_is_named_with_the_range(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, laws: str, ranges: list[str]
) -> None:
    own = Law("of_ones_own", "minimum_gap", "here", {"approach_speed": (0.0, 0.1)}, lambda roughness: roughness)
    monkeypatch.setitem(SHELF["minimum_gap"], "of_ones_own", own)
    run = report(made_up(tmp_path / "run", f"{BED}[laws]\n{laws}\n"))
    said = [each for each in run["warnings"] if "outside of" in each]
    assert len(said) == 1 and all(each in said[0] for each in [*ranges, "cfddem explain"])
    first = next(place for place, line in enumerate(lines(run)) if "outside of" in line)
    assert all(len(line) <= 100 for line in lines(run))
    assert "cfddem explain" in " ".join(lines(run)[first : first + 2])  # in two lines


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


@pytest.mark.parametrize("density", [2500.0, 400.0])
def test_a_sphere_alone_is_held_against_its_drag_law(tmp_path: Path, density: float) -> None:
    """Stokes drag from rest: u_t (1 - exp(-t/tau)), here with a speed 2 % too high from 4 ms on, until it touches."""
    text = ALONE.replace("2500.0", f"{density}")
    grid = grid_of(Case.from_text(text).column)
    terminal = (density - 1000.0) * 9.81 * 1e-8 / 18e-3
    run = RunFolder.create(tmp_path / "run", text, {}, grid, FIELDS)
    for k, time in enumerate(np.linspace(0.0, 0.01, 51)):
        fall = terminal * -math.expm1(-time * 18e-3 / (density * 1e-8)) * (1.02 if time > 3.99e-3 else 1.0)
        touches = k == 50
        velocity = [[0.0, 0.0, 0.0 if touches else 1e-3 - fall]]
        numbers = {"particle_count": 1.0, "contact_count": float(touches), "granular_temperature": math.nan}
        run.append_history({"time": time, "bed_height": 0.015, "fastest": abs(velocity[0][2]), **numbers})
        wind = np.zeros((*grid.shape, 3))
        wind[..., 2] = 1e-3
        run.write_snapshot(time, k, {"velocity": wind, "voidage": np.ones(grid.shape)}, {
            "position": np.full((1, 3), 0.01), "velocity": np.array(velocity), "id": np.zeros(1, int),
        })  # fmt: skip
    run.finish("finished")
    last, worst = report(tmp_path / "run")["laws"]
    assert last["law"] == "terminal velocity by stokes"
    assert last["expected"] == pytest.approx(abs(terminal), rel=1e-9)
    assert last["computed"] == pytest.approx(1.02 * abs(terminal) * -math.expm1(-0.0098 * 1.8e6 / density), rel=1e-4)
    assert worst["law"].startswith("equation of motion") and worst["ratio"] == pytest.approx(1.02, rel=1e-4)
    assert "terminal velocity by stokes" in page(tmp_path / "run", tmp_path / "alone.html").read_text()


class Page(HTMLParser):
    """What stands on a page, and what it would fetch from elsewhere."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.open: list[str] = []
        self.fetched: list[str] = []
        self.images = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Count images, note addresses, and remember what is open."""
        self.images += tag == "img"
        self.fetched += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("img", "meta", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Everything is closed in its order."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Keep what a person reads."""
        self.texts.append(data)


def test_the_page_needs_nothing_but_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    written = page(made_up(tmp_path / "run"))
    assert written == Path("run-report.html")
    seen = Page(written.read_text())
    assert seen.open == []
    assert seen.images == 2 and all(each.startswith("data:image/png;base64,") for each in seen.fetched)
    words = " ".join(seen.texts)
    assert "Beads <in> water & more" in words
    for expected in (
        "Richardson-Zaki",
        "stationary",
        "outside of its range 8000 times",
        "exchange imbalance",
        "62.5 %",
    ):
        assert expected in words, expected


def test_json_is_strict_and_holds_null_for_what_has_no_value(tmp_path: Path) -> None:
    result = report(made_up(tmp_path / "run", rows=11))
    read = json.loads(as_json(result), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert read["measures"]["bed_height"]["error"] is None
    assert read["measures"]["bed_height"]["mean"] == result["measures"]["bed_height"]["mean"]


def test_report_on_the_command_line(
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


def test_a_run_without_a_row_says_so(tmp_path: Path) -> None:
    RunFolder.create(tmp_path / "run", BED, {}, grid_of(Case.from_text(BED).column)).finish("failed")
    with pytest.raises(InputError, match="ended before its first row"):
        report(tmp_path / "run")


def test_voidage_by_the_slope_of_the_pressure() -> None:
    """A bed of 0.55 below, nothing above: the slope within it, whatever the cells, and NaN where they are too few."""
    for cells in (20, 50, 160):
        spacing = 0.1 / cells
        height = (np.arange(cells) + 0.5) * spacing
        pressure = np.minimum(height, 0.06) * -(1.0 - 0.55) * 1e4
        found = voidage_by_pressure(pressure.reshape(-1, 1, 1), (1.0, 1.0, spacing), 1e4, 0.012, 0.048)
        assert found == pytest.approx(0.55, abs=1e-12)
    assert math.isnan(voidage_by_pressure(np.zeros((4, 1, 1)), (1.0, 1.0, 0.025), 1e4, 0.012, 0.048))


# ---------------------------------------------------------------- progress


def under_way(time: float, remaining: float = 3725.0) -> SimpleNamespace:
    particles = SimpleNamespace(steps=12345)
    row = {"time": time, "bed_height": 0.0456, "fastest": 0.123, "contact_count": 789.0}
    simulation = SimpleNamespace(time=time, particles=particles, binding="collision")
    return SimpleNamespace(row=row, simulation=simulation, end=2.0, remaining=remaining)


def test_progress_tells_steps_clock_and_remaining_time() -> None:
    said = status_of(under_way(0.5))  # type: ignore[arg-type]
    assert said == "0.5/2 s  1:02:05 left  clock: collision  12345 steps  bed 45.6 mm  0.12 m/s  789 contacts"
    assert "  - left  " in status_of(under_way(0.5, math.nan))  # type: ignore[arg-type]


def test_the_log_gets_a_line_for_every_row_and_nothing_is_said_in_a_pipe(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for time in (0.25, 0.5):  # a second run goes on in the same file
        with live_line(tmp_path / "log.txt") as line:
            line.say("pouring 10 particles")
            for _ in range(3):  # said again on the way to the next row
                line.update(under_way(time))  # type: ignore[arg-type]
            logging.getLogger("cfddem").warning("a checkpoint is damaged")
    rows = (tmp_path / "log.txt").read_text().splitlines()
    assert [row[21:28] for row in rows] == ["pouring", "0.25/2 ", "a check", "pouring", "0.5/2 s", "a check"]
    assert capfd.readouterr().err == 2 * "a checkpoint is damaged\n"
    with pytest.raises(InputError, match=r"log = .*: must be a file that can be written"), live_line(tmp_path):
        pass


def test_the_live_line_says_what_is_prepared_and_which_loop_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    bar = Progress(disable=True)
    line, seen = Line(bar), []

    def compiling(what: str) -> None:
        line.compiling(what)
        seen.append((bar.tasks[0].description, bar.tasks[0].fields["status"]))

    line.say("pouring 10 particles")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    announce_compilation(compiling)
    try:
        helper = njit(lambda x: 2.0 * x)
        njit(lambda x: helper(x) + 1.0)(1.0)
    finally:
        announce_compilation()
    (before, told), (after, nothing) = seen
    assert before == after == "pouring 10 particles"
    assert re.fullmatch(r"compiling loop \d+ \(kept for next time\) \.\.\.", told) and nothing == ""
