"""The study of Mueller's wet bed: its states, and its table from made-up means."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cfddem.preflight.summary import refuse_errors
from scenarios.beds.wet_bed import validation
from scenarios.beds.wet_bed.validation import (
    RAMPS,
    STATES,
    Means,
    directions,
    over_packings,
    plan,
    rows,
    state,
    study,
    windows,
)


def test_the_pulls_of_the_states_are_as_their_names_say() -> None:
    """Bond numbers over the weight of a seed: 2 pi R sigma cos(theta) over it."""
    dry, *wet = (state(name) for name in RAMPS)
    assert dry.liquid is None
    weight = 1000.0 * math.pi / 6.0 * 1.2e-3**3 * 9.81
    for case, expected in zip(wet, (0.74, 2.19, 4.24, 0.74)):
        assert case.liquid is not None and case.bed.count == 9240
        pull = 2.0 * math.pi * 0.6e-3 * 0.02 * math.cos(math.radians(case.liquid.contact_angle))
        assert pull / weight == pytest.approx(expected, rel=0.02)
        refuse_errors(case)


def made_up(pressure: float, temperature: float, time: float = 10.0) -> Means:
    """Means with an error in time of 2 %."""
    values = 0.05, 0.01, pressure, temperature, 0.01
    return Means(time, *((each, 0.02 * each) for each in values))


def test_packings_count_by_their_times_and_never_agree_better_than_in_time() -> None:
    alike = over_packings([made_up(100.0, 1e-3)] * 4, "pressure_deviation")
    assert alike == pytest.approx((100.0, 2.0 / math.sqrt(4.0)))
    apart = over_packings([made_up(each, 1e-3) for each in (90.0, 100.0, 110.0)], "pressure_deviation")
    assert apart == pytest.approx((100.0, 10.0 / math.sqrt(3.0)))
    short = over_packings([made_up(100.0, 1e-3), made_up(200.0, 1e-3, time=0.1)], "pressure_deviation")
    assert short[0] == pytest.approx(100.0 + 100.0 * 0.1 / 10.1) and short[1] == pytest.approx(2.0, rel=0.02)


def test_the_table_has_errors_and_ratios() -> None:
    dry = [made_up(100.0, 1e-3)] * 3
    wet = [made_up(100.0 * each, 5e-4) for each in (1.9, 2.0, 2.1)]
    found = {name: dry if name == "dry" else wet for name in STATES}
    table = {row.quantity: row for row in directions(found, {name: 0.3 + 0.1 * (name != "dry") for name in STATES})}
    row = table["weak: pressure deviation larger than dry, logarithm of the ratio"]
    assert row.value == pytest.approx(math.log(2.0)) and "0.031" in row.note
    assert table["weak: temperature smaller than dry, logarithm of the ratio"].value == pytest.approx(math.log(2.0))
    assert table["strong: minimum fluidisation over that of the dry bed"].value == pytest.approx(4.0 / 3.0)
    assert [row.unit for row in rows("dry", dry)] == ["m", "m", "Pa", "m2/s2", "m"]


def test_the_table_of_one_packing_and_two_states_takes_errors_from_time() -> None:
    """What has not been computed has no rows."""
    found = {"dry": [made_up(100.0, 1e-3)], "strong": [made_up(150.0, 5e-4)]}
    table = {row.quantity: row for row in directions(found, {"dry": 0.3})}
    assert len(table) == 3 and not any("fluidisation" in name for name in table)
    row = table["strong: pressure deviation larger than dry, logarithm of the ratio"]
    assert row.value == pytest.approx(math.log(1.5)) and "0.028" in row.note


@pytest.mark.slow
def test_all_states_advance_before_one_goes_further(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One packing in all states first; the whole plan has three packings of 10.1 s in each state, and the ramps."""
    pieces = [(name, until) for name, _, until in plan()]
    assert [name for name, _ in pieces[:4]] == [f"{name}_1" for name in STATES]
    far = {name: max(until for piece, until in pieces if piece == name) for name, _ in pieces}
    ramps = ["dry_ramp", "weak_ramp", "medium_ramp", "strong_ramp", "weak_1_oil_ramp"]
    assert far == {f"{name}_{seed}": 10.1 for name in STATES for seed in (1, 2, 3)} | dict.fromkeys(ramps, 4.6)
    asked: list[tuple[str, float]] = []
    monkeypatch.setattr(validation, "advanced", lambda case, folder, name, progress, until: asked.append((name, until)))
    monkeypatch.setattr(validation, "reached", lambda home: dict(asked).get(home.name, 0.0))
    monkeypatch.setattr(validation, "table", lambda folder: [])
    monkeypatch.setattr(validation, "use_threads", lambda count: count)
    study(tmp_path, lambda text: None, hours=-1.0)
    assert asked == []
    study(tmp_path, lambda text: None)
    assert asked == list(dict.fromkeys(pieces))


HOLDS = """
import sys, time
from pathlib import Path
from scenarios.validation.kept_runs import taken

with taken(Path(sys.argv[1]), "dry_1"):
    print("has it", flush=True)
    time.sleep(60.0)
"""


def test_processes_share_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that another process has is left alone; the next one of the plan is advanced."""
    asked: list[tuple[str, float]] = []
    monkeypatch.setattr(validation, "advanced", lambda case, folder, name, progress, until: asked.append((name, until)))
    with subprocess.Popen([sys.executable, "-c", HOLDS, tmp_path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "has it\n"
        assert validation.advance_one(tmp_path, lambda text: None)
        process.kill()
    assert validation.advance_one(tmp_path, lambda text: None)
    assert asked == [("weak_1", 1.1), ("dry_1", 1.1)]


def test_states_are_compared_over_the_same_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    times = {"dry_1": 2.1, "weak_1": 1.6, "strong_1": 0.7, "dry_2": 0.3}
    monkeypatch.setattr(validation, "reached", lambda home: times.get(home.name, 0.0))
    assert windows(tmp_path) == {"dry": {1: 1.6}, "weak": {1: 1.6}}


def test_a_bed_at_rest_is_in_no_mean(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The means of a packing end when it comes to rest; the table says when. One that hardly moved is left out."""
    ends, asked = {f"{name}_{seed}": 10.1 for name in STATES for seed in (1, 2)}, []
    rests = {"strong_1": 5.0, "strong_2": 0.7}

    def averaged(run: str, begin: float, end: float) -> Means:
        asked.append((run, begin, end))
        return made_up(100.0, 1e-3)

    monkeypatch.setattr(validation, "reached", lambda home: ends.get(home.name, 0.0))
    monkeypatch.setattr(validation, "open_run", lambda home: home.name)
    monkeypatch.setattr(validation, "rest", lambda run, case: rests.get(run, math.inf))
    monkeypatch.setattr(validation, "means", averaged)
    table = {row.quantity: row.value for row in validation.table(tmp_path)}
    assert [end for run, begin, end in asked if run == "strong_1"] == [5.0] and ("dry_2", 0.6, 10.1) in asked
    assert "strong_2" not in [run for run, *_ in asked] and (tmp_path / "wet-beds.png").exists()
    assert {key: table[key] for key in table if "rest" in key} == {
        "strong: packing 1 comes to rest after": 5.0,
        "strong: packing 2 comes to rest after": 0.7,
    }
    assert table["strong: simulated time in the means"] == pytest.approx(4.4)


def test_errors_in_time_are_those_of_a_known_series() -> None:
    """Independent normal values: the error of their deviation is deviation / sqrt(2 n)."""
    values = np.random.default_rng(1).normal(5.0, 2.0, 4000)
    deviation, error = validation._deviation(values)
    assert deviation == pytest.approx(2.0, rel=0.03)
    assert error == pytest.approx(2.0 / math.sqrt(8000.0), rel=0.25)
