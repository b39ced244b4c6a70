"""A feed of a user, as the page docs/how-to/own-feed.md writes it: also in a fluid, and resumed with the same bits."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from in_process_ranks import on_ranks

from cfddem.backend.communicator import Communicator
from cfddem.case.schema import Case
from cfddem.run import history
from cfddem.run.simulation import Simulation

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "own-feed.md").read_text(encoding="utf-8")
FEED, RUN = re.findall(r"```python\n(.*?)```", PAGE, re.S)
CASE = re.findall(r'"""\n(title.*?)"""', RUN, re.S)[0]
WATER = """
[fluid]
density = 1000.0
viscosity = 1e-3
[laws]
lubrication = "none"
drag = "di_felice"
"""


@pytest.fixture
def page() -> Iterator[dict[str, Any]]:
    """Names of the first block of the page."""
    names: dict[str, Any] = {}
    exec(FEED, names)
    yield names
    history.forget("fed_count")


def test_the_page_feeds_three_layers_and_loses_none(
    page: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(RUN, page)
    assert capsys.readouterr().out.splitlines()[-1] == "48.0 0.0"


def test_a_bead_that_enters_replaces_fluid_of_its_own_volume(page: dict[str, Any]) -> None:
    simulation = Simulation(Case.from_text(CASE + WATER), features=[page["Layers"]()])
    simulation.step()
    simulation.step()
    assert simulation.particles.count == 17
    solids = (1.0 - simulation.fluid.voidage).sum() * simulation.fluid.grid.cell_volume
    assert solids == pytest.approx(simulation.particles.volume.sum(), rel=1e-9)


def test_it_continues_with_the_same_bits(page: dict[str, Any]) -> None:
    case = Case.from_text(CASE)
    whole = Simulation(case, features=[page["Layers"]()])
    whole.until(0.008)
    state = whole.checkpoint()
    part = Simulation.restored(case, state, features=[page["Layers"]()])
    for each in (whole, part):
        each.until(0.015)
    assert whole.particles.count == part.particles.count == 33
    assert np.array_equal(whole.particles.position, part.particles.position)


def test_two_ranks_feed_the_same_beads_with_the_same_bits(page: dict[str, Any]) -> None:
    """Dry particles have the bits of one process; in water the solids are conserved on two ranks, too."""

    def moved(communicator: Communicator) -> tuple[np.ndarray, np.ndarray]:
        simulation = Simulation(Case.from_text(CASE), communicator=communicator, features=[page["Layers"]()])
        simulation.until(0.012)
        return simulation.whole("id"), simulation.whole("position")

    def solids(communicator: Communicator) -> tuple[float, float]:
        case = Case.from_text(CASE + WATER).with_(**{"column.width": 0.03})
        simulation = Simulation(case, communicator=communicator, features=[page["Layers"]()])
        simulation.step()
        fluid = (1.0 - simulation.fluid.whole("voidage")).sum() * simulation.fluid.grid.cell_volume
        return float(fluid), float((4.0 / 3.0 * np.pi * simulation.whole("radius") ** 3).sum())

    (one,), two = on_ranks(1, moved), on_ranks(2, moved)
    assert np.array_equal(one[1][np.argsort(one[0])], two[0][1][np.argsort(two[0][0])]) and len(one[0]) == 33
    for fluid, particles in on_ranks(2, solids):
        assert fluid == pytest.approx(particles, rel=1e-9)
