"""The documentation: all commands and Python blocks run as they stand, and all links and names exist."""

from __future__ import annotations

import ast
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

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), *(ROOT / "scenarios").rglob("README.md")])
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]

BLOCK = re.compile(r"^(?:<!-- (?P<mark>[^\n]*?) -->\n)?```(?P<kind>python|sh)\n(?P<text>.*?)^```$", re.M | re.S)
"""A block to run. The comment before it: `not run`, `slow`, `exits N`, `needs LIBRARY`, `needs LIBRARY, slow`."""

QUICK = ("wet_pair",)
"""Scenarios whose pages take seconds; the others run whole beds, or maps, or compile loops of their own."""


class Block(NamedTuple):
    """A block of commands or Python on a page."""

    kind: str  # python or sh
    text: str
    mark: str
    line: int


def blocks(page: Path) -> Iterator[Block]:
    """The blocks of a page that are to be run, in order."""
    text = page.read_text()
    for found in BLOCK.finditer(text):
        if found["mark"] != "not run":
            yield Block(found["kind"], found["text"], found["mark"] or "", text.count("\n", 0, found.start("text")))


@pytest.fixture
def clean_names() -> Iterator[None]:
    """Measures and tables that a page declares do not appear in the runs of other tests."""
    from cfddem.case.feature_table import forget_table
    from cfddem.case.schema import Case
    from cfddem.run import history

    measures, tables = dict(history.MEASURES), set(Case.model_fields)
    yield
    history.MEASURES.clear()
    history.MEASURES.update(measures)
    for name in set(Case.model_fields) - tables:
        forget_table(name)


def run_page(page: Path, slow: bool, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    """Run the blocks of a page, from the first to the last."""
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {"__name__": "page"}
    for block in blocks(page):
        if ("slow" in block.mark and not slow) or lacks(block):
            continue
        if block.kind == "python":
            exec(compile("\n" * block.line + block.text, page, "exec", dont_inherit=True), names)
            continue
        for command in block.text.splitlines():
            words = shlex.split(command, comments=True)
            assert words[:1] == ["cfddem"], f"{page.name}:{block.line}: {command} is not tested"
            wanted = int(block.mark.removeprefix("exits ")) if block.mark.startswith("exits") else 0
            assert exit_code(words, monkeypatch) == wanted, f"{page.name}:{block.line}: {command}"


def lacks(block: Block) -> bool:
    """Whether a block needs an optional library that is not installed."""
    return (
        block.mark.startswith("needs")
        and importlib.util.find_spec(block.mark.removeprefix("needs ").split(",")[0]) is None
    )


def exit_code(words: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    """Exit code of a command line."""
    from cfddem.cli.app import main

    monkeypatch.setattr(sys, "argv", words)
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


LONG = {
    "averages", "cluster", "contact-law", "layers", "measure", "own-force", "programs", "read-results", "report",
    "smooth-walls", "sweep", "user-law", "walls", "wet-particles",
}  # fmt: skip
"""Pages with many loops to compile, or processes to start."""


def is_long(page: Path) -> bool:
    """Whether a page takes too long for a test that is not marked slow."""
    return page.stem in LONG or ("scenarios" in page.parts and page.parent.name not in QUICK)


def pages_with(mark: str | None) -> list[Any]:
    """The pages with blocks to run; with a mark, those with a block that has it."""
    return [
        pytest.param(page, id=name, marks=[pytest.mark.slow] if is_long(page) else [])
        for page, name in zip(PAGES, NAMES)
        if any(mark is None or mark in block.mark.split(", ") for block in blocks(page))
    ]


@pytest.mark.usefixtures("clean_names")
@pytest.mark.parametrize("page", pages_with(None))
def test_commands_and_python_of_a_page_run(page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """All blocks of a page in one empty folder, except those that take minutes."""
    run_page(page, False, monkeypatch, tmp_path)


@pytest.mark.slow
@pytest.mark.usefixtures("clean_names")
@pytest.mark.parametrize("page", pages_with("slow"))
def test_slow_commands_and_python_of_a_page_run(page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    run_page(page, True, monkeypatch, tmp_path)


# ---------------------------------------------------------------- names, links, and generated pages


def tool(name: str) -> Any:
    """A module of docs/tools, which is not a package."""
    found = importlib.util.spec_from_file_location(name, DOCS / "tools" / f"{name}.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


@cache
def generated_pages() -> set[str]:
    """Addresses of the pages that are generated when the site is built."""
    pages = tool("pages")
    reference = {pages.page_of(module) for room in pages.ROOMS for module in pages.modules(room)}
    notebooks = {address for address, _ in pages.notebooks() if address.endswith(".md")}
    others = notebooks | {f"reference/{name}.md" for name in ("index", "case", "commands", "laws")}
    return reference | others | {address for address, _ in pages.gallery()} | {"changes.md"}


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.stem)
def test_links_exist(page: Path) -> None:
    generated = generated_pages()
    for target in re.findall(r"\]\((?!https?:)([^)#\s]+)", page.read_text()):
        place = (page.parent / target).resolve()
        assert place.exists() or str(place.relative_to(DOCS)) in generated, target


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.stem)
def test_functions_named_on_pages_exist(page: Path) -> None:
    """`[words][closures.drag.di_felice]` links to the function in the reference."""
    for name in re.findall(r"\]\[((?:closures|cfddem|scenarios)\.[\w.]+)\]", page.read_text()):
        words = name.split(".")
        module = next(
            ".".join(words[:count])
            for count in range(len(words) - 1, 0, -1)
            if ROOT.joinpath(*words[:count]).with_suffix(".py").exists()
        )
        if module == "cfddem.backend.mpi" and importlib.util.find_spec("mpi4py") is None:
            continue  # cannot be imported without the extra `cluster`
        found: Any = importlib.import_module(module)
        for word in words[module.count(".") + 1 :]:
            found = getattr(found, word)
        assert found.__doc__, name


@pytest.mark.parametrize(
    "page",
    [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "scenarios").rglob("README.md"))],
    ids=lambda page: str(page.relative_to(ROOT)),
)
def test_links_in_the_repository_exist(page: Path) -> None:
    for target in re.findall(r"(?:\]\(|src=\")(?!https?:)([^)#\s\"]+)", page.read_text()):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_displayed_equations_are_paragraphs(page: Path) -> None:
    """Inside a paragraph `$$ ... $$` would be shown as text."""
    for paragraph in re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL).split("\n\n"):
        if "$$" in paragraph:
            assert re.fullmatch(r"\$\$[^$]*\$\$", paragraph.strip()), paragraph


SECTIONS = ["What you'll learn", "Problem", "Code", "Results", "Adapt this", "Reproduce this"]
"""Headings of every page of the gallery."""

GALLERY = [page for page in PAGES if "scenarios" in page.parts and page.parent.name != "scenarios"]

TOP = re.compile(
    r"# [^\n]+\n\n!\[[^\]]{10,}\]\(\S+\)\n\n\*\*(?P<headline>[^*]+)\*\*\n\n"
    r"(?P<command>`[^`]+`): (?P<time>[^\n]+) on one core\.\n\n## "
)
"""What a page of the gallery begins with: title, picture, main result, command and run time."""

NUMBER = re.compile(r"\d+(?:\.\d+)?")


@pytest.mark.parametrize("page", GALLERY, ids=lambda page: page.parent.name)
def test_gallery_pages_follow_one_pattern(page: Path) -> None:
    """A picture, one main result and the run time come first; the list of cases says the same."""
    text = page.read_text()
    top = TOP.match(text)
    assert top, "must begin with a title, a picture, the main result in bold, and `command`: TIME on one core."
    assert re.findall(r"^## (.*)$", text, re.M) == SECTIONS
    assert set(NUMBER.findall(top["headline"])) <= set(NUMBER.findall(text[top.end() :])), (
        "a number that the page lacks"
    )
    row = f"| {' '.join(top['headline'].split())} | {top['command']} | {top['time']} |"
    assert row in (ROOT / "scenarios" / "README.md").read_text()


PLACE = re.compile(r"`([\w/]+(?:\.py|/))`(?:: ((?:`[\w.]+`(?:, )?)+))?")
"""A file or folder, and names that are defined in it."""


def places_on_the_map() -> list[tuple[str, str, list[str]]]:
    """Question, file and names of each row of the table in docs/architecture.md."""
    section = (DOCS / "architecture.md").read_text().split("## Where to find\n")[1].split("\n## ")[0]
    rows = [row.split(" | ") for row in section.splitlines() if row.startswith("| ") and "`" in row]
    return [
        (question.strip("| "), path, re.findall(r"[\w.]+", names))
        for question, answer in rows
        for path, names in PLACE.findall(answer)
    ]


def defined_names(path: Path) -> set[str]:
    """Functions, classes, methods and constants of a module."""
    names: set[str] = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{each.name}" for each in node.body if isinstance(each, ast.FunctionDef)}
        if isinstance(node, ast.Assign):
            names |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    return names


def test_places_on_the_map_exist() -> None:
    """Each answer of the table names an existing file, and names that are defined in it."""
    places = places_on_the_map()
    assert len({question for question, _, _ in places}) >= 20
    for question, path, names in places:
        assert (ROOT / path).exists(), f"{question} {path}"
        if names:
            assert set(names) <= defined_names(ROOT / path), f"{question} {path}: {names}"


def test_files_named_in_the_architecture_exist() -> None:
    for path in re.findall(
        r"`((?:cfddem|closures|scenarios|tests|docs)/[\w/.]+)`", (DOCS / "architecture.md").read_text()
    ):
        assert (ROOT / path).exists() or "NAME" in path, path


def test_all_pages_are_in_the_navigation() -> None:
    listed = re.findall(r"([\w/-]+\.md)", (ROOT / "mkdocs.yml").read_text())
    generated = generated_pages()
    assert len(listed) > 10
    assert all((DOCS / each).exists() or each in generated for each in listed)
    written = {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")}
    assert written <= set(listed)


def test_every_key_of_a_case_is_in_the_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    from cfddem.case.bed import Bed, MixtureSpecies
    from cfddem.case.case_laws import CaseLaws
    from cfddem.case.tables import CaseRun, Column

    monkeypatch.syspath_prepend(str(DOCS / "tools"))
    pytest.importorskip("griffe")
    page = tool("pages").case_keys()
    for part in (Column, Bed, MixtureSpecies, CaseLaws, CaseRun):
        assert all(f"| `{key}` |" in page for key in part.model_fields)


def test_docstrings_are_converted_to_markdown() -> None:
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


@pytest.mark.slow
def test_site_builds_without_warnings(tmp_path: Path) -> None:
    """`mkdocs build --strict`, where the extra `docs` is installed."""
    pytest.importorskip("mkdocs")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert built.returncode == 0, built.stderr
