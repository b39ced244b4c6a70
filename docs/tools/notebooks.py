"""Notebooks: `docs/notebooks/*.py` are the sources, in the percent format that jupytext, VS Code and Spyder read.

`python docs/tools/notebooks.py FOLDER` executes them and writes NAME.ipynb there; `mkdocs build` shows the results of
`build/notebooks` if they belong to the present sources, and the code alone otherwise.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "docs" / "notebooks"
EXECUTED = ROOT / "build" / "notebooks"

NAMES = ("first_bed", "collision", "own_law", "sweep", "read_run")
"""Order of the pages."""

SECONDS = 170
"""Limit of one cell [s]."""


def cells(source: str) -> list[tuple[str, str]]:
    """Kind (markdown or code) and text of each cell of a percent file."""
    found = []
    for part in re.split(r"^# %%", source, flags=re.MULTILINE)[1:]:
        heading, _, text = part.partition("\n")
        if "[markdown]" in heading:
            found.append(("markdown", re.sub(r"^# ?", "", text, flags=re.MULTILINE).strip()))
        else:
            found.append(("code", text.strip()))
    return found


def notebook(name: str) -> dict[str, Any]:
    """A notebook without outputs, as the values of its JSON."""
    made = []
    for number, (kind, text) in enumerate(cells((SOURCES / f"{name}.py").read_text())):
        cell: dict[str, Any] = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": text}
        made.append(cell | ({"execution_count": None, "outputs": []} if kind == "code" else {}))
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def execute(name: str, folder: Path) -> float:
    """Execute a notebook in an empty folder and write it with its outputs; returns the wall time [s]."""
    import nbformat
    from nbclient import NotebookClient

    begun = time.monotonic()
    made = nbformat.from_dict(notebook(name))
    with tempfile.TemporaryDirectory() as place:
        NotebookClient(made, timeout=SECONDS, resources={"metadata": {"path": place}}).execute()
    folder.mkdir(parents=True, exist_ok=True)
    nbformat.write(made, folder / f"{name}.ipynb")
    return time.monotonic() - begun


def page(name: str) -> str:
    """The page of a notebook: with outputs if the executed notebook belongs to the present source."""
    shown = notebook(name)["cells"]
    written = EXECUTED / f"{name}.ipynb"
    if written.exists():
        executed = json.loads(written.read_text())["cells"]
        if [_text(each["source"]) for each in executed] == [each["source"] for each in shown]:
            shown = executed
    parts = [part for cell in shown for part in _shown(cell)]
    parts.insert(1, f"[Download the notebook]({name}.ipynb){{ download }}")
    return "\n\n".join(parts) + "\n"


def files() -> Iterator[tuple[str, str]]:
    """Address and content of the pages and of the notebooks to download."""
    for name in NAMES:
        yield f"notebooks/{name}.md", page(name)
        yield f"notebooks/{name}.ipynb", json.dumps(notebook(name), indent=1)


def _shown(cell: dict[str, Any]) -> Iterator[str]:
    """Markdown of a cell and its outputs."""
    if cell["cell_type"] == "markdown":
        yield _text(cell["source"])
        return
    yield f"```python\n{_text(cell['source'])}\n```"
    for output in cell["outputs"]:
        data = output.get("data", {})
        if output.get("name") == "stdout":
            yield f"```text\n{_text(output['text']).rstrip()}\n```"
        elif "image/png" in data:
            yield f'<img src="data:image/png;base64,{_text(data["image/png"]).strip()}" alt="figure">'
        elif "text/markdown" in data:
            yield _text(data["text/markdown"])
        elif "text/html" in data:
            inside = re.sub(r"<style.*?</style>", "", _text(data["text/html"]), flags=re.DOTALL)
            yield f'<div class="output">{" ".join(inside.split())}</div>'
        elif "text/plain" in data:
            yield f"```text\n{_text(data['text/plain'])}\n```"


def _text(source: str | list[str]) -> str:
    """A text that a notebook file may hold as a list of lines."""
    return source if isinstance(source, str) else "".join(source)


if __name__ == "__main__":
    place = Path(sys.argv[1]) if len(sys.argv) > 1 else EXECUTED
    for each in NAMES:
        print(f"{each}: {execute(each, place):.0f} s", flush=True)
