"""Notebooks of the documentation, how values look in a notebook, and progress below a cell."""

from __future__ import annotations

import html.parser
import importlib.util
import math
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from example_case import TEXT
from made_up_run import made_up

import closures
from cfddem.backend import html as drawn
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.io.reading import open_run
from cfddem.preflight.summary import preflight
from cfddem.run.progress import Status
from cfddem.studies import notebook as run_notebook
from cfddem.studies.notebook import run_case
from closures.drag import di_felice

ROOT = Path(__file__).parents[2]
SECONDS = 180.0
"""Longest time of all notebooks together [s]."""


def tool() -> Any:
    """The module docs/tools/notebooks.py."""
    found = importlib.util.spec_from_file_location("notebooks", ROOT / "docs" / "tools" / "notebooks.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def is_whole(text: str) -> bool:
    """Whether every element of an HTML text is closed."""
    open_now: list[str] = []

    class Reader(html.parser.HTMLParser):
        def handle_starttag(self, tag: str, attrs: Any) -> None:
            if tag not in ("br", "img"):
                open_now.append(tag)

        def handle_endtag(self, tag: str) -> None:
            assert open_now.pop() == tag

    Reader().feed(text)
    return not open_now


# ---------------------------------------------------------------- displays


def test_a_case_shows_its_keys_with_units() -> None:
    text = Case.from_text(TEXT)._repr_html_()
    assert is_whole(text) and "Liquid-fluidised bed of alumina beads" in text
    assert "<td>bed.diameter</td><td>0.003087</td><td>" in text and "[m]" in text
    assert "bed.spread" not in text, "defaults are not shown"


def test_the_check_and_a_run_show_their_numbers(tmp_path: Path) -> None:
    text = preflight(Case.from_text(TEXT))._repr_html_()
    assert is_whole(text) and "u_mf" in text
    text = open_run(made_up(tmp_path / "run", rows=41))._repr_html_()
    assert is_whole(text) and "<td>status</td><td>finished</td>" in text and text.count("<circle") == 3


def test_only_a_run_folder_is_overwritten(tmp_path: Path) -> None:
    """A folder of another program, which has a `run.json` too, keeps its files."""
    (tmp_path / "run.json").write_text('{"format": "of another program"}')
    (tmp_path / "data").write_text("results of a year")
    with pytest.raises(InputError, match="a run folder to be overwritten"):
        run_case(Case.from_text(TEXT), tmp_path, overwrite=True)
    assert (tmp_path / "data").read_text() == "results of a year"


def test_a_drawing_shows_near_spheres_last_and_fast_ones_yellow() -> None:
    position = np.array([[0.5, 0.1, 0.5], [0.5, 0.3, 0.5], [1.5, 0.2, 0.5]])
    text = drawn.spheres(position, np.full(3, 0.1), np.array([[0, 0, 1.0], [0, 0, 0], [0, 0, 0]]))
    near, far = text.index(drawn.SHADES[-1]), text.index(drawn.SHADES[0])
    assert is_whole(text) and far < near, "the fast sphere at y = 0.1 is nearest and drawn over the others"
    assert drawn.spheres(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3))) == ""
    many = np.random.default_rng(1).random((3000, 3))
    assert drawn.spheres(many, np.full(3000, 0.01), many).count("<circle") == drawn.MOST_DRAWN


def test_a_law_shows_equation_range_and_source() -> None:
    text = closures.law_of(di_felice)._repr_markdown_()
    assert "**di_felice** (drag)" in text and "$$" in text and "Di Felice" in text


def test_a_bar_below_the_cell_shows_the_part_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    handle = SimpleNamespace(update=shown.append)
    display = SimpleNamespace(HTML=str, display=lambda *_, **__: handle)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(display=display, get_ipython=lambda: None))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    assert not run_notebook.in_notebook()
    row = {"bed_height": 0.02, "largest_speed": 0.1, "contact_count": 7.0, "time": 0.5}
    with run_notebook.notebook_line() as line:
        line.progress("packing")
        line.update(Status(0.5, 2.0, math.nan, "inlet", 100, row))
    assert "packing" in shown[0] and 'value="0.250"' in shown[-1] and "limit: inlet" in shown[-1]
    assert all(is_whole(each) for each in shown)


# ---------------------------------------------------------------- sources and pages


def test_a_percent_file_has_its_cells() -> None:
    source = "# %% [markdown]\n# # Title\n#\n# text\n\n# %%\nx = 1\n\n\n# %%\nx\n"
    assert tool().cells(source) == [("markdown", "# Title\n\ntext"), ("code", "x = 1"), ("code", "x")]


@pytest.mark.parametrize("name", tool().NAMES)
def test_jupytext_reads_the_same_cells(name: str) -> None:
    jupytext = pytest.importorskip("jupytext", reason="needs `pip install 'cfddem[notebook]'`")
    read = jupytext.read(ROOT / "docs" / "notebooks" / f"{name}.py")
    assert [(each.cell_type, each.source) for each in read.cells] == tool().cells(
        (ROOT / "docs" / "notebooks" / f"{name}.py").read_text()
    )


def test_every_source_has_a_page_and_holds_no_outputs() -> None:
    names = {path.stem for path in (ROOT / "docs" / "notebooks").glob("*.py")}
    assert names == set(tool().NAMES)
    assert not list((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def test_the_page_of_an_executed_notebook_shows_its_outputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = tool()
    monkeypatch.setattr(made, "EXECUTED", tmp_path)
    plain = made.page("own_law")
    assert "```python" in plain and 'class="output"' not in plain
    values = made.notebook("own_law")
    cell = next(each for each in values["cells"] if each["cell_type"] == "code")
    cell["outputs"] = [{"data": {"text/html": "<b>\n5</b>"}}, {"name": "stdout", "text": "six\n"}]
    (tmp_path / "own_law.ipynb").write_text(made.json.dumps(values))
    assert '<div class="output"><b> 5</b></div>' in made.page("own_law") and "```text\nsix\n```" in made.page("own_law")
    values["cells"][0]["source"] = "changed since"
    (tmp_path / "own_law.ipynb").write_text(made.json.dumps(values))
    assert made.page("own_law") == plain


@pytest.mark.parametrize("names", [("collision",), pytest.param(tool().NAMES, marks=pytest.mark.slow)], ids=len)
def test_notebooks_run_in_three_minutes(names: tuple[str, ...]) -> None:
    """They are kept for the documentation, which shows their outputs."""
    pytest.importorskip("nbclient", reason="needs `pip install 'cfddem[notebook]'`")
    pytest.importorskip("ipykernel", reason="needs `pip install 'cfddem[notebook]'`")
    made = tool()
    times = {name: made.execute(name, made.EXECUTED) for name in names}
    assert sum(times.values()) < SECONDS, times
