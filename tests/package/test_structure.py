"""The structure of the code: rooms, import directions, sizes of files and functions, words.

Imports are those of :func:`house.imports`: anywhere in a file, for types alone, and named by strings.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from house import HOME, Count, counts, every_circle, imports, modules, tree

ROOMS = (
    "backend",
    "model",
    "particles",
    "fluid",
    "coupling",
    "case",
    "preflight",
    "io",
    "analysis",
    "plotting",
    "features",
    "run",
    "studies",
    "cli",
)
"""Folders of `cfddem`. A room imports rooms before it only; `particles` and `fluid` do not import each other."""

LONGEST_FILE, MARGIN = 500, 10
"""Lines of a Python file, and how many more are tolerated."""


MOST_ARGUMENTS, LONGEST_FUNCTION = 8, 80
"""Positional arguments and lines of a function outside compiled loops."""

MANY_ARGUMENTS = 0
"""Functions of more than `MOST_ARGUMENTS` arguments of all kinds, compiled ones included. It may only fall."""

STRUCTURES = {"p", "parameters", "numbers", "bridge_functions"}
"""Names of what holds the parameters of a run in `cfddem/particles`: read by names, never by position."""

COMPILED = ("serial", "threaded", "either", "part", "inline", "vector_inline", "compiled", "njit", "jit", "overload")
"""Names of decorators that compile a function."""

PARALLEL = {"threaded", "either", "part", "threaded_part", "vector_part"}
"""Those of them that compile a loop which runs on all threads."""

LOOP_FILES = re.compile(r"(_loops|/integrate|/neighbours|/filling)\.py$")
"""Files of functions that are compiled elsewhere, with a law set or when they are first called."""

LONGEST_SENTENCE, LONGEST_LINE = 38, 120
"""Words of a sentence and characters of a line on a page. Code, an equation or a link counts as its words or as one."""

SET_APART = re.compile(r"^ *```.*?^ *```$|<!--.*?-->|\$\$.*?\$\$|(?<=\n\n)(?: {4}[^\n]*\n)+(?=\n|\Z)", re.M | re.S)
"""Blocks of code, comments and displayed equations on a page."""

OLD_WORDS = re.compile(
    r"own_wind|\bmoisten|\bsqueeze_out|never_faster|\bRedCard\b|\bgrains_of\b|"
    r"\bFootprint\b|\bPlacement\b|swept_along|left_behind|under_way\b|\bshelf\b|\bnewcomers?\b|\brehears|"
    r"\bamber\b|law of (?:one's|your|my) own|who is near whom|\bis told\b|hangs? on\b|\bencounters?\b",
    re.IGNORECASE,
)
"""Words that were replaced by the terms of the field."""

OLD_WORDS_ALLOWED = {
    "tests/package/test_structure.py",
}


def room(name: str) -> str:
    """Room of a module of `cfddem`; empty for the package itself."""
    return name.split(".")[1] if name.startswith("cfddem.") else ""


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Every function of `closures`, `cfddem` and `scenarios` that is not compiled, with its file."""
    for path in modules().values():
        file = str(path.relative_to(HOME))
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.FunctionDef):
                nodes = [inner for each in node.decorator_list for inner in ast.walk(each)]
                decorators = {each.id for each in nodes if isinstance(each, ast.Name)}
                if not decorators & set(COMPILED) and not LOOP_FILES.search(file):
                    yield file, node


# ---------------------------------------------------------------- compiled loops


def test_parallel_loops_write_to_no_array_of_a_tuple() -> None:
    """On all threads, a loop loses `particles.liquid[i] = x`, which numba takes as dead, and so what it writes to
    arrays that it has taken from a tuple that it was given. Helpers may write so."""
    lost = [f"{name}:{each}" for name, path in modules().items() for each in lost_assignments(tree(path))]
    assert not lost, "\n".join(lost)


@pytest.mark.parametrize("compiled", sorted(PARALLEL))
def test_each_lost_assignment_is_found(compiled: str) -> None:
    sample = f"""
@{compiled}
def loop(given, other, array, number):
    a, b = given
    c, (d, e) = number, other
    f = given.field
    g, h = array[:], given.another
    for n in prange(number):
        kept = given.field[n]
        array[n] = g[n] = kept
        given.field[n] = 1.0
        kept, given.field[n, 0] = 1.0, 2.0
        b[n] = 3.0
        e[n] += 4.0
        f[n] = 5.0
        kept, h[n] = 6.0, 7.0
"""
    found = sorted(each.partition(": ")[2] for each in lost_assignments(ast.parse(sample)))
    assert found == ["b[n]", "e[n]", "f[n]", "given.field[n, 0]", "given.field[n]", "h[n]"]


def lost_assignments(file: ast.AST) -> list[str]:
    """Assignments that parallel loops of a file lose, with their lines."""
    lost = []
    for node in ast.walk(file):
        if not isinstance(node, ast.FunctionDef):
            continue
        if {each.id for each in node.decorator_list if isinstance(each, ast.Name)} & PARALLEL:
            taken = _taken_from_tuples(node)
            for each in ast.walk(node):
                written = isinstance(each, ast.Subscript) and isinstance(each.ctx, ast.Store)
                if written and (isinstance(each.value, ast.Attribute) or getattr(each.value, "id", "") in taken):  # type: ignore[attr-defined]
                    lost.append(f"{each.lineno}: {ast.unparse(each)}")  # type: ignore[attr-defined]
    return lost


def _taken_from_tuples(function: ast.FunctionDef) -> set[str]:
    """Names of a function that are parts of its arguments, and nothing else later."""
    given, taken, others = {each.arg for each in function.args.args}, set[str](), set[str]()
    for each in ast.walk(function):
        if isinstance(each, ast.Assign):
            whole, pairs = each.targets[0], [(each.targets[0], each.value)]
            if isinstance(whole, ast.Tuple) and isinstance(each.value, ast.Tuple):
                pairs = list(zip(whole.elts, each.value.elts))
            for target, value in pairs:
                if not isinstance(target, ast.Tuple):
                    value = value.value if isinstance(value, ast.Attribute) else each
                named = [one for one in ast.walk(target) if isinstance(one, ast.Name)]
                names = {one.id for one in named if isinstance(one.ctx, ast.Store)}
                if getattr(value, "id", "") in given:
                    taken |= names
                else:
                    others |= names
    return taken - others


def test_no_parameter_is_read_by_position() -> None:
    """A parameter more or less would move the others. In the text of generated loops, too."""
    text = re.compile(rf"\b({'|'.join(sorted(STRUCTURES))})\[(-?\d|$)")
    read = []
    for name, path in modules().items():
        for node in ast.walk(tree(path)) if name.startswith("cfddem.particles") else ():
            if isinstance(node, ast.Subscript):
                held = getattr(node.value, "id", getattr(node.value, "attr", ""))
                named = isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, str)
                if held in STRUCTURES and not named:
                    read.append(f"{name}:{node.lineno}: {ast.unparse(node)}")
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and text.search(node.value):
                read.append(f"{name}:{node.lineno}: {node.value}")
    assert not read, "\n".join(read)


# ---------------------------------------------------------------- rooms and imports


def test_the_top_level_holds_only_the_rooms() -> None:
    found = {path.name for path in (HOME / "cfddem").iterdir() if path.name != "__pycache__"}
    assert found - set(ROOMS) <= {"__init__.py", "__main__.py", "py.typed"}
    assert set(ROOMS) <= found


def test_no_import_runs_back_up() -> None:
    order = {name: place for place, name in enumerate(ROOMS)}
    wrong = []
    for name in modules():
        for other in imports(name):
            here, there = room(name), room(other)
            if here not in order or there not in order:
                continue
            if order[there] > order[here] or {here, there} == {"particles", "fluid"}:
                wrong.append(f"{name} imports {other}")
    assert not wrong, "\n".join(wrong)


def test_closures_import_nothing_of_the_machine() -> None:
    for name in modules():
        if name.startswith("closures"):
            assert not [each for each in imports(name) if not each.startswith("closures")], name


def test_only_the_command_line_imports_scenarios_and_nothing_imports_it() -> None:
    """`cli` is the top room, above `scenarios`, whose commands it offers."""
    for name in modules():
        if room(name) != "cli" and name != "cfddem.__main__":
            assert not [each for each in imports(name) if room(each) == "cli"], name
        if name.startswith("cfddem") and room(name) != "cli":
            assert not [each for each in imports(name) if each.startswith("scenarios")], name


def test_no_circle_of_imports() -> None:
    circles = every_circle()
    assert not circles, "\n".join(", ".join(each) for each in circles)


# ---------------------------------------------------------------- sizes


def test_no_file_is_too_long() -> None:
    files = [*modules().values(), *(HOME / "tests").rglob("*.py")]
    lengths = {str(path.relative_to(HOME)): len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    too_long = {file: n for file, n in lengths.items() if n > LONGEST_FILE + MARGIN}
    assert not too_long


def test_no_function_has_too_many_positional_arguments() -> None:
    many = []
    for file, node in functions():
        arguments = [each.arg for each in (*node.args.posonlyargs, *node.args.args) if each.arg not in ("self", "cls")]
        if len(arguments) > MOST_ARGUMENTS:
            many.append(f"{file}:{node.lineno} {node.name}: {len(arguments)}")
    assert not many, "\n".join(many)


def test_no_more_functions_have_many_arguments() -> None:
    """Arguments of all kinds, compiled functions included: more than eight are a missing structure."""
    many = []
    for path in modules().values():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.FunctionDef):
                arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                count = len([each for each in arguments if each.arg not in ("self", "cls")])
                if count > MOST_ARGUMENTS:
                    many.append(f"{path.relative_to(HOME)}:{node.lineno} {node.name}: {count}")
    assert len(many) <= MANY_ARGUMENTS, "\n".join(many)


def test_no_function_is_too_long() -> None:
    long = []
    for file, node in functions():
        length = (node.end_lineno or node.lineno) - node.lineno + 1
        if length > LONGEST_FUNCTION:
            long.append(f"{file}:{node.lineno} {node.name}: {length} lines")
    assert not long, "\n".join(long)


LIMITS = {
    "closures": Count(questions=0, positions=0, many_arguments=0, vague=0),
    "cfddem": Count(questions=33, positions=0, many_arguments=0, vague=1),
    "scenarios": Count(questions=7, positions=0, many_arguments=0, vague=0),
    "scenarios.references": Count(questions=0, positions=0, many_arguments=0, vague=0),
}
"""Limits of the numbers of `python -m tests.house`. They may only fall."""


@pytest.mark.parametrize("package", LIMITS)
@pytest.mark.parametrize("number", ["questions", "positions", "many_arguments", "vague"])
def test_the_house_stays_as_simple_as_it_is(package: str, number: str) -> None:
    """`python -m tests.house questions` lists the places; the others likewise."""
    assert getattr(counts(sizes=False)[package], number) <= getattr(LIMITS[package], number)


# ---------------------------------------------------------------- words


def pages() -> list[Path]:
    """Source files and pages, apart from recorded tables."""
    folders = [HOME / each for each in ("cfddem", "closures", "scenarios", "tests", "docs")]
    found = [path for each in folders for ending in ("*.py", "*.md", "*.toml") for path in each.rglob(ending)]
    return [*found, HOME / "README.md"]


def test_replaced_words_are_gone() -> None:
    found = []
    for path in pages():
        file = str(path.relative_to(HOME))
        if file not in OLD_WORDS_ALLOWED:
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
                if OLD_WORDS.search(line):
                    found.append(f"{file}:{number}: {line.strip()}")
    assert not found, "\n".join(found)


# ---------------------------------------------------------------- sentences and lines of pages

PAGES = sorted([*(HOME / "docs").rglob("*.md"), *(HOME / "scenarios").rglob("*.md"), *HOME.glob("*.md")])

each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(HOME)))


def lines_of_text(text: str) -> list[str]:
    """Lines of a page; those of blocks of code, comments and displayed equations are empty."""
    return SET_APART.sub(lambda block: "\n" * block[0].count("\n"), text).splitlines()


def sentences(text: str) -> Iterator[tuple[int, str]]:
    """Sentences of a page with the line in which their paragraph, item or cell begins. A colon or `;` ends none."""
    paragraphs: list[tuple[int, str]] = [(0, "")]
    for number, line in enumerate(lines_of_text(text), 1):
        line = re.sub(r"`[^`]+`|\$[^$]+\$", "X", line.strip())
        if line.startswith("|"):
            paragraphs += [(number, cell) for cell in line.split("|")]
        elif not line or re.match(r"[-*+] |\d+\. |#", line) or not paragraphs[-1][1]:
            paragraphs.append((number, line))
        else:
            paragraphs[-1] = (paragraphs[-1][0], f"{paragraphs[-1][1]} {line}")
    for number, paragraph in paragraphs:
        words = re.sub(r"!?\[([^]]*)\](?:\([^)]*\)|\[[^]]*\])", r"\1", paragraph)
        words = re.sub(r"\bal\.(?= [a-z(\d])", "al", words)
        for sentence in re.split(r"(?<=[.!?]) |(?<=[.!?][)*\"]) |(?<=[.!?]\*\*) ", words):
            yield number, sentence


def long_sentences(text: str) -> list[str]:
    """Sentences with too many words, each with its line and number of words."""
    counted = [(number, len(re.findall(r"\S*\w\S*", sentence)), sentence) for number, sentence in sentences(text)]
    return [f"{number}: {words} words: {sentence}" for number, words, sentence in counted if words > LONGEST_SENTENCE]


def long_lines(text: str) -> list[str]:
    """Lines with too many characters that could be broken: no rows of tables, and no lone link, picture or equation."""
    parts = re.compile(r"(?:`[^`]*`|\$[^$]*\$|!?\[[^]]*\]\([^)]*\)|\S)+")
    return [
        f"{number}: {len(line)} characters: {line}"
        for number, line in enumerate(lines_of_text(text), 1)
        if len(line) > LONGEST_LINE and not line.lstrip().startswith("|") and len(parts.findall(line)) > 1
    ]


@each_page
def test_no_sentence_of_a_page_is_too_long(page: Path) -> None:
    found = long_sentences(page.read_text(encoding="utf-8"))
    assert not found, "\n".join(found)


@each_page
def test_no_line_of_a_page_is_too_long(page: Path) -> None:
    found = long_lines(page.read_text(encoding="utf-8"))
    assert not found, "\n".join(found)


def test_long_sentences_and_lines_are_found() -> None:
    """Clauses after a semicolon count, and so do broken lines, items and cells; code, equations and tables do not."""
    clause = "one two three four five six seven eight nine ten"
    long = f"{clause}; {clause}: {clause}\n{clause}"
    for page in (long, f"- {long}", f"1. {long}", f"    {long}", f"| a | {long.replace(chr(10), ' ')} |"):
        assert len(long_sentences(page)) == 1, page
    for page in (f"```sh\n{long}\n```", f"{clause}. {clause}.\n\n{clause} {clause}", f"a\n\n    {clause * 5}\n"):
        assert not long_sentences(page), page
    assert len(long_lines("word " * 25)) == 1
    assert not long_lines(f"`{'word ' * 25}`\n\n| {'word ' * 25} |\n\n$$ {'word ' * 25} $$\n\n![{'word ' * 25}](a.png)")
