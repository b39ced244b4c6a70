"""The pages of the documentation: everything that a reader may copy runs as it stands, and links lead somewhere."""

from __future__ import annotations

import importlib.util
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

HOUSE = Path(__file__).parents[1]
DOCS = HOUSE / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), *(HOUSE / "scenarios").glob("*.md")])
NAMES = [str(page.relative_to(HOUSE)) for page in PAGES]

BLOCK = re.compile(r"^(?:<!-- (?P<mark>[^\n]*?) -->\n)?```(?P<kind>python|sh)\n(?P<text>.*?)^```$", re.M | re.S)
"""A block that can be run. The mark before it says `not run`, `slow`, `exits N`, or `needs LIBRARY`."""


QUICK = ("binary_collision", "wet_pair", "wet_wall")
"""Pages of the gallery that take seconds; the others run whole beds, or maps."""


class Block(NamedTuple):
    """A piece of a page that a reader may copy."""

    kind: str  # python or sh
    text: str
    mark: str
    line: int


def blocks(page: Path) -> Iterator[Block]:
    """The blocks of a page that are to be run, in their order."""
    text = page.read_text()
    for found in BLOCK.finditer(text):
        if found["mark"] != "not run":
            yield Block(found["kind"], found["text"], found["mark"] or "", text.count("\n", 0, found.start("text")))


def go_through(page: Path, slow: bool, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    """Do what a page says, from its first block to its last."""
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {"__name__": "page"}
    for block in blocks(page):
        if (block.mark == "slow" and not slow) or lacks(block):
            continue
        if block.kind == "python":
            exec(compile("\n" * block.line + block.text, page, "exec"), names)
            continue
        for command in block.text.splitlines():
            words = shlex.split(command, comments=True)
            assert words[:1] == ["cfddem"], f"{page.name}:{block.line}: {command} is run by no test"
            wanted = int(block.mark.removeprefix("exits ")) if block.mark.startswith("exits") else 0
            assert ends_with(words, monkeypatch) == wanted, f"{page.name}:{block.line}: {command}"


def lacks(block: Block) -> bool:
    """Whether a block needs a library of an extra that is not installed here."""
    return block.mark.startswith("needs") and importlib.util.find_spec(block.mark.removeprefix("needs ")) is None


def ends_with(words: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    """Exit code of a command line."""
    from cfddem.cli import main

    monkeypatch.setattr(sys, "argv", words)
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def is_long(page: Path) -> bool:
    """Whether a page takes longer than a plain test may."""
    return page.parent.name == "scenarios" and page.stem not in QUICK


def pages_with(mark: str | None) -> list[Any]:
    """The pages that hold something to run; with a mark, those where a block carries it."""
    return [
        pytest.param(page, id=name, marks=[pytest.mark.slow] if is_long(page) else [])
        for page, name in zip(PAGES, NAMES)
        if any(mark is None or block.mark == mark for block in blocks(page))
    ]


@pytest.mark.parametrize("page", pages_with(None))
def test_what_a_page_says_to_do_can_be_done(page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Commands and Python of a page, in one empty folder, but for those that take minutes."""
    go_through(page, False, monkeypatch, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", pages_with("slow"))
def test_pages_that_take_minutes(page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    go_through(page, True, monkeypatch, tmp_path)


# ---------------------------------------------------------------- names, links, and what is made from the sources


def tool(name: str) -> Any:
    """A module of docs/tools, which is no package."""
    found = importlib.util.spec_from_file_location(name, DOCS / "tools" / f"{name}.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


@cache
def made_pages() -> set[str]:
    """Addresses of the pages that are made when the site is built, without making them."""
    pages = tool("pages")
    reference = {pages.page_of(module) for room in pages.ROOMS for module in pages.modules(room)}
    others = {f"reference/{name}.md" for name in ("index", "case", "commands", "shelf")}
    return reference | others | {address for address, _ in pages.gallery()} | {"changes.md"}


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.stem)
def test_links_lead_to_pages_and_pictures(page: Path) -> None:
    made = made_pages()
    for target in re.findall(r"\]\((?!https?:)([^)#\s]+)", page.read_text()):
        place = (page.parent / target).resolve()
        assert place.exists() or str(place.relative_to(DOCS)) in made, target


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.stem)
def test_functions_that_pages_name_are_there(page: Path) -> None:
    """`[words][closures.drag.di_felice]` leads to the function's place in the reference."""
    for name in re.findall(r"\]\[((?:closures|cfddem|scenarios)\.[\w.]+)\]", page.read_text()):
        words = name.split(".")
        module = next(
            ".".join(words[:count])
            for count in range(len(words) - 1, 0, -1)
            if HOUSE.joinpath(*words[:count]).with_suffix(".py").exists()
        )
        found: Any = importlib.import_module(module)
        for word in words[module.count(".") + 1 :]:
            found = getattr(found, word)
        assert found.__doc__, name


def test_pages_in_the_navigation_are_there() -> None:
    listed = re.findall(r"([\w/-]+\.md)", (HOUSE / "mkdocs.yml").read_text())
    made = made_pages()
    assert len(listed) > 10
    assert all((DOCS / each).exists() or each in made for each in listed)
    written = {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")}
    assert written <= set(listed)


def test_every_key_of_a_case_is_in_the_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    from cfddem.bed import Bed, Part
    from cfddem.case import CaseLaws, CaseRun, Column

    monkeypatch.syspath_prepend(str(DOCS / "tools"))
    pytest.importorskip("griffe")
    page = tool("pages").case_keys()
    for part in (Column, Bed, Part, CaseLaws, CaseRun):
        assert all(f"| `{key}` |" in page for key in part.model_fields)


def test_docstrings_become_markdown() -> None:
    pytest.importorskip("griffe")
    marked = tool("docstrings").to_markdown(
        "Sum.\n\n.. math:: a =\n    b + c\n\nfirst  a* [m]\nreturns  |a|\n         in all\n\n>>> 1 + 1\n2"
    )
    assert marked.split("\n\n") == [
        "Sum.",
        "$$ a = b + c $$",
        "|  |  |\n|:--|:--|\n| `first` | a\\* [m] |\n| `returns` | \\|a\\| in all |",
        "```pycon\n>>> 1 + 1\n2\n```",
    ]


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """`mkdocs build --strict`, where the extra `docs` is installed."""
    pytest.importorskip("mkdocs")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=HOUSE,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert built.returncode == 0, built.stderr
