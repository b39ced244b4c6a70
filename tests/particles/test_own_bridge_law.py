"""A user's bridge law in one file, as the page docs/how-to/bridge-law.md writes it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case import liquid
from cfddem.case.schema import Case
from cfddem.particles.interactions import bridge_law
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.preflight.summary import preflight
from cfddem.run.build import bridge_laws_of

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "bridge-law.md").read_text(encoding="utf-8")
LAW, USE = re.findall(r"```python\n(.*?)```", PAGE, re.S)
CASE = re.findall(r'"""\n(.*?)"""', USE, re.S)[0]
SIGMA, THETA, REDUCED, VOLUME = 0.07, 0.4, 0.25e-3, 1e-13


@pytest.fixture
def page() -> Iterator[dict[str, Any]]:
    """Names of the first block of the page."""
    names: dict[str, Any] = {}
    exec(LAW, names)
    yield names
    bridge_law._WORDS["pull"].pop("linear_pull", None)


def test_its_energy_is_the_integral_of_its_pull(page: dict[str, Any]) -> None:
    length = (1.0 + 0.5 * THETA) * VOLUME ** (1.0 / 3.0)
    other = {"volume": VOLUME, "reduced_radius": REDUCED, "surface_tension": SIGMA, "contact_angle": THETA}
    gaps = np.linspace(0.0, 1.2 * length, 4001)
    pulls = np.array([page["pull"](gap, **other) for gap in gaps])
    assert pulls[0] == pytest.approx(2.0 * math.pi * (2.0 * REDUCED) * SIGMA * math.cos(THETA), rel=1e-14)
    assert page["energy"](gaps[-1], **other) == pytest.approx(np.trapezoid(pulls, gaps), rel=1e-4)


def test_a_case_chooses_it_by_its_name_and_the_loops_get_it(page: dict[str, Any]) -> None:
    case = Case.from_text(CASE)
    laws = bridge_laws_of(case)
    assert laws is not None and preflight(case).status == "ok"
    laws.check()
    slot = laws.choices()["bridge_pull"].py_func.__globals__["law"]
    assert slot.py_func.__code__ is page["pull"].__code__
    assert Case.from_text(case.to_toml()) == case


def test_a_name_that_nobody_has_registered_is_refused(page: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"liquid.pull = 'linear_pul'.*did you mean 'linear_pull'"):
        Case.from_text(CASE.replace('"linear_pull"', '"linear_pul"'))
    with pytest.raises(InputError, match="pull = 'mine'"):
        BridgeLaws(pull="mine").check()
    with pytest.raises(InputError, match=r"name = .willett.*built-in"):
        bridge_law.register("pull", "willett", page["pull"])
    with pytest.raises(InputError, match="kind = 'push'"):
        bridge_law.register("push", "mine", page["pull"])
    bridge_law._WORDS["pull"].pop("linear_pull")
    assert Case.from_text(CASE, finished=True).liquid.pull == "linear_pull"  # type: ignore[union-attr]


def test_the_words_of_cases_are_those_of_the_engine() -> None:
    for kind, words in liquid.LAWS.items():
        assert set(words) == set(bridge_law._BUILT_IN[kind]), kind


@pytest.mark.slow
def test_the_page_runs(page: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    exec(USE, page)
    said = capsys.readouterr().out.split()
    assert said[0] == "ok" and int(said[1]) > 0
