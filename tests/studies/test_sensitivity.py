"""How much keys matter: against closed forms, with errors that are those found in repeated samples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import call, parsed

from cfddem.studies import sweep
from cfddem.studies.samples import Variable
from cfddem.studies.sensitivity import Choice, Design, design, effects, runs_of, sensitivity, sobol_indices, values_of
from cfddem.studies.sweep import Outcome

A, B = 7.0, 0.1


def ishigami(shares: np.ndarray) -> np.ndarray:
    """sin x1 + a sin^2 x2 + b x3^4 sin x1 with all x from -pi to pi, given as shares (..., 3) of the ranges."""
    x = math.pi * (2.0 * shares - 1.0)
    return np.sin(x[..., 0]) + A * np.sin(x[..., 1]) ** 2 + B * x[..., 2] ** 4 * np.sin(x[..., 0])


def exact() -> tuple[list[float], list[float]]:
    """First-order and total indices of the function (Ishigami and Homma 1990)."""
    alone = [0.5 * (1.0 + B * math.pi**4 / 5.0) ** 2, A**2 / 8.0, 0.0]
    together = B**2 * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    variance = sum(alone) + together
    return [each / variance for each in alone], [
        (each + more) / variance for each, more in zip(alone, (together, 0.0, together))
    ]


def test_sobol_indices_of_a_closed_form() -> None:
    """2048 rows: 0.3139, 0.4424, 0 alone, and 0.5576, 0.4424, 0.2437 with interactions, within 0.02."""
    first, total = sobol_indices(ishigami(design("sobol", 2048, 3).points))
    assert exact()[0] == pytest.approx([0.3139, 0.4424, 0.0], abs=1e-4)
    assert exact()[1] == pytest.approx([0.5576, 0.4424, 0.2437], abs=1e-4)
    assert first == pytest.approx(exact()[0], abs=0.02)
    assert total == pytest.approx(exact()[1], abs=0.02)


def test_they_are_those_of_scipy() -> None:
    from scipy.stats import sobol_indices as of_scipy

    values = ishigami(design("sobol", 256, 3).points)
    known = of_scipy(func={"f_A": values[0], "f_B": values[1], "f_AB": values[2:, None]}, n=256)
    first, total = sobol_indices(values)
    assert first == pytest.approx(known.first_order, abs=1e-3) and total == pytest.approx(known.total_order, abs=1e-3)


def test_noise_of_the_means_does_not_count_as_influence() -> None:
    """Noise as large as half of the spread: uncorrected totals are off by 0.2; corrected ones agree within 0.05."""
    exact_values = ishigami(design("sobol", 4096, 3).points)
    error = 0.5 * exact_values[:2].std()
    noisy = exact_values + error * np.random.default_rng(1).normal(size=exact_values.shape)
    assert sobol_indices(noisy, error)[1] == pytest.approx(exact()[1], abs=0.05)
    assert abs(sobol_indices(noisy)[1][2] - exact()[1][2]) > 0.1


def test_stated_errors_are_those_of_repeated_samples() -> None:
    off = []
    for seed in range(30):
        chosen = design("sobol", 64, 3, seed)
        found = made(chosen, Varied)
        rows = found.measures["y"][1]
        off += [(row["total"] - true) / row["total_error"] for row, true in zip(rows, exact()[1])]
    assert 0.5 < float(np.sqrt(np.mean(np.square(off)))) < 1.6


Varied = [Variable("a", 0.0, 1.0), Variable("b", 0.0, 1.0), Variable("c", 0.0, 1.0)]


def made(chosen: Design, varied: Any, error: float = 0.0) -> Any:
    """The sensitivity of made-up runs, whose keys are shares."""

    def outcome(values: Mapping[str, Any]) -> Outcome:
        y = float(ishigami(np.array([values["a"], values["b"], values["c"]])))
        return Outcome("", dict(values), "finished", measures={"y": (y, error, "m"), "same": (1.0, 0.0, "1")})

    return sensitivity(chosen, varied, [outcome(each) for each in runs_of(values_of(chosen, varied))])


def test_elementary_effects_of_a_plane_are_its_slopes() -> None:
    """Without curvature every effect is the slope: no spread, each key changed once in a trajectory."""
    chosen = design("morris", 8, 4)
    slopes = np.array([3.0, -2.0, 0.0, 0.5])
    assert (chosen.points >= 0.0).all() and (chosen.points <= 1.0).all()
    assert effects(chosen.points @ slopes, chosen) == pytest.approx(np.repeat(slopes[:, None], 8, axis=1))
    assert ((np.diff(chosen.points, axis=0) != 0.0).sum(axis=(0, 2)) == 4).all()


def test_effects_of_morris_say_what_is_noise_and_what_has_interactions() -> None:
    rows = made(design("morris", 64, 3), Varied, error=0.1).measures["y"][1]
    assert rows[1]["spread"] > rows[1]["effect"] * 0.9 and rows[1]["effect_error"] < 0.1 * rows[1]["effect"]
    assert rows[0]["effect_of_noise"] == pytest.approx(math.sqrt(2.0 / math.pi) * math.hypot(0.1, 0.1) * 1.5)


def test_rows_with_a_failed_run_and_measures_that_do_not_change_are_left_out() -> None:
    chosen = design("sobol", 16, 3)
    outcomes = [
        Outcome("", each, "finished", measures={"y": (each["a"], 0.0, "m"), "same": (1.0, 0.0, "1")})
        for each in runs_of(values_of(chosen, Varied))
    ]
    failed = [Outcome("", each.values, "failed") if k == 3 else each for k, each in enumerate(outcomes)]
    found = sensitivity(chosen, Varied, failed)
    assert found.rows == (15, 16) and list(found.measures) == ["y"]
    assert "1 rows are left out" in "\n".join(found.lines())


def test_a_key_with_words_takes_them_equally_often() -> None:
    chosen = design("sobol", 64, 1)
    taken = [each["laws.drag"] for each in values_of(chosen, [Choice("laws.drag", ("a", "b", "c", "d"))])[0]]
    assert {taken.count(each) for each in "abcd"} == {16}


def test_the_command_runs_each_point_once_and_writes_table_and_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The height follows the velocity and the drag law, not the restitution."""

    def one(case: Any, values: dict[str, Any], folder: Path, alone: bool, laws: Sequence[Path]) -> sweep.Outcome:
        height = values["bed.inlet_velocity"] + 0.01 * (values["laws.drag"] == "wen_yu")
        return sweep.Outcome(str(folder), values, "finished", measures={"bed_height": (height, 1e-4, "m")})

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sweep, "_one", one)
    keys = ("inlet_velocity=0.03..0.05", "material.glass.restitution=0.5..1", "laws.drag=wen_yu,di_felice")
    vary = [word for key in keys for word in ("--vary", key)]
    line = ("sweep", "liquid-bed", *vary, "--runs", "16", "-o", "many")
    found = parsed(call(*line, "--sensitivity", "sobol", "--json").out)["sensitivity"]["measures"]["bed_height"]["keys"]
    assert [each["key"] for each in found] == ["bed.inlet_velocity", "material.glass.restitution", "laws.drag"]
    assert found[1]["total"] == pytest.approx(0.0, abs=1e-3) and min(found[0]["total"], found[2]["total"]) > 0.2
    text = call(*line, "--sensitivity", "morris").out
    assert re_ordered(text) and "of noise alone" in text
    table = (tmp_path / "many" / "sensitivity.csv").read_text().splitlines()
    assert table[0].startswith("measure,unit,key,effect,") and len(table) == 4
    assert (tmp_path / "many" / "sensitivity.png").stat().st_size > 10_000
    for wrong, said in (
        (("--sensitivity", "sobl"), "did you mean 'sobol'"),
        (("--sensitivity", "sobol", "--runs", "15"), "power of two"),
        (("--sensitivity", "morris", "--runs", "2"), "4 to"),
        (("--sensitivity", "morris", "--over", "seed=1..2"), "without --over"),
    ):
        refused = call("sweep", "liquid-bed", *vary, *wrong)
        assert refused.code == 2 and said in refused.err and refused.err.count("\n") == 1, refused.err


def re_ordered(text: str) -> bool:
    """Whether keys are listed by importance."""
    return text.index("bed.inlet_velocity") < text.index("laws.drag") < text.index("material.glass.restitution")
