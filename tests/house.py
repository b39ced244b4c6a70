"""The command `python -m tests.house`: how large the code is, and how much of it must be known at once.

Each number is to fall, or to stay; `tests/package/test_structure.py` holds the limits.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple, dataclass, fields
from functools import cache
from pathlib import Path

HOME = Path(__file__).parents[1]

PACKAGES = ("closures", "cfddem", "scenarios")

REFERENCES = "scenarios.references"
"""What only tests and comparisons use; counted apart."""

FEATURES = re.compile(
    r"(^|_)(bridges?|films?|liquids?|spray|fluid|exchange|coupling|history|agitation|added_mass|wall_drag|"
    r"self_disturbance|shear|lift|torque|energy|energies|counting|collisions?|jet|feeds?|outlets?|equipment|species|"
    r"cohesion|rolling|potential|lubricated|temperature|heat|ghosts)(_|$)"
)
"""Words in the name of an optional feature, of a part of it, or of a key that turns it on."""

PARAMETERS = ("p", "parameters", "numbers", "then", "now", "last", "modes")
"""Names that arrays of parameters of laws, and of what a pair or particle remembers, have in the rooms of loops."""

VAGUE = {"each", "found", "given", "made", "known", "held", "seen", "said", "what"}
"""Names that do not say what they hold: a particle, a face, a species, a key, a law."""

ROOMS_OF_LOOPS = re.compile(r"cfddem/(backend|particles|fluid|coupling|features|model)/")

MOST_ARGUMENTS = 8


@dataclass(frozen=True, slots=True)
class Count:
    """Numbers of a package.

    files           with the ending `.py`
    lines           of all kinds
    code            lines that are neither empty, nor comments, nor docstrings
    questions       `x is None` or `x is not None`, where the last name of `x` has a word of :data:`FEATURES`
    asking          files with such questions
    positions       reads or writes of a fixed place of an array of :data:`PARAMETERS`, such as `p[-1]`
    many_arguments  functions and methods of more than eight arguments of all kinds, without `self` and `cls`
    vague           places where a name of :data:`VAGUE` is given a value, arguments and fields among them
    """

    files: int = 0
    lines: int = 0
    code: int = 0
    questions: int = 0
    asking: int = 0
    positions: int = 0
    many_arguments: int = 0
    vague: int = 0

    def __add__(self, other: Count) -> Count:
        return Count(*(a + b for a, b in zip(astuple(self), astuple(other))))


@cache
def modules() -> dict[str, Path]:
    """Every module of the three packages and its file."""
    files = [path for package in PACKAGES for path in sorted((HOME / package).rglob("*.py"))]
    return {".".join(path.relative_to(HOME).with_suffix("").parts).removesuffix(".__init__"): path for path in files}


@cache
def text(path: Path) -> str:
    """A file."""
    return path.read_text(encoding="utf-8")


@cache
def tree(path: Path) -> ast.Module:
    """Syntax tree of a file."""
    return ast.parse(text(path))


# ---------------------------------------------------------------- lines


_NO_CODE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENCODING,
    tokenize.ENDMARKER,
}  # fmt: skip


def code_lines(source: str) -> int:
    """Lines that are neither empty, nor comments, nor strings that stand alone."""
    strings = {
        line
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    tokens = [each for each in tokenize.generate_tokens(io.StringIO(source).readline) if each.type not in _NO_CODE]
    return len({line for each in tokens for line in range(each.start[0], each.end[0] + 1)} - strings)


# ---------------------------------------------------------------- questions, positions, arguments


def last_name(node: ast.AST) -> str:
    """`film` of `film`, of `laws.film`, of `film(x)` and of `(y := laws.film)`; empty for all else."""
    if isinstance(node, ast.NamedExpr):
        return last_name(node.value)
    if isinstance(node, ast.Call):
        return last_name(node.func)
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def questions(path: Path) -> Iterator[str]:
    """Questions of a file whether an optional feature is None, as `line: expression`."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is | ast.IsNot):
            to = node.comparators[0]
            if isinstance(to, ast.Constant) and to.value is None and FEATURES.search(last_name(node.left)):
                yield f"{node.lineno}: {ast.unparse(node)}"


def _fixed(place: ast.AST | None) -> bool:
    """Whether a subscript is a number, a name in capitals, or a slice between such."""
    if isinstance(place, ast.Slice):
        return (place.lower or place.upper) is not None and _fixed(place.lower) and _fixed(place.upper)
    if isinstance(place, ast.UnaryOp):
        return _fixed(place.operand)
    if isinstance(place, ast.Constant):
        return isinstance(place.value, int)
    return place is None or (isinstance(place, ast.Name) and place.id.isupper())


def positions(path: Path) -> Iterator[str]:
    """Uses of a fixed place of an array of parameters, as `line: expression`."""
    loops = ROOMS_OF_LOOPS.match(path.relative_to(HOME).as_posix())
    for node in ast.walk(tree(path)) if loops else ():
        if isinstance(node, ast.Subscript) and last_name(node.value) in PARAMETERS and _fixed(node.slice):
            yield f"{node.lineno}: {ast.unparse(node)}"


def many_arguments(path: Path) -> Iterator[str]:
    """Functions of a file with more than eight arguments of all kinds, compiled or not, as `line name: arguments`."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            number = len([each for each in every if each.arg not in ("self", "cls")])
            if number > MOST_ARGUMENTS:
                yield f"{node.lineno} {node.name}: {number}"


def vague(path: Path) -> Iterator[str]:
    """Places of a file where a name of :data:`VAGUE` is given a value, as `line: name`."""
    for node in ast.walk(tree(path)):
        is_set = isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        name = node.arg if isinstance(node, ast.arg) else last_name(node) if is_set else ""
        if name in VAGUE:
            yield f"{node.lineno}: {name}"


def count(path: Path, sizes: bool = True) -> Count:
    """Numbers of a file; those of its lines, which take most of the time, if `sizes`."""
    asked = len(list(questions(path)))
    return Count(
        files=1,
        lines=len(text(path).splitlines()),
        code=code_lines(text(path)) if sizes else 0,
        questions=asked,
        asking=bool(asked),
        positions=len(list(positions(path))),
        many_arguments=len(list(many_arguments(path))),
        vague=len(list(vague(path))),
    )


@cache
def counts(sizes: bool = True) -> dict[str, Count]:
    """Numbers of each package, and of the references apart; with lines of code if `sizes`."""
    found = {name: Count() for name in (*PACKAGES, REFERENCES)}
    for name, path in modules().items():
        package = REFERENCES if f"{name}.".startswith(f"{REFERENCES}.") else name.partition(".")[0]
        found[package] += count(path, sizes)
    return found


# ---------------------------------------------------------------- imports


_A_MODULE = re.compile(rf"((?:{'|'.join(PACKAGES)})(?:\.\w+)+)(?::\w+)?")


@cache
def _exported() -> dict[str, str]:
    """Modules of the names that `cfddem` imports when they are first used."""
    made: dict[str, str] = {}
    for node in tree(HOME / "cfddem" / "__init__.py").body:
        if (
            isinstance(node, ast.Assign)
            and isinstance(node.value, ast.Dict)
            and last_name(node.targets[0]) == "_MODULES"
        ):
            made = ast.literal_eval(node.value)
    return made


def _imported(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (each.name for each in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module == "cfddem":
        yield from (_exported().get(each.name, f"cfddem.{each.name}") for each in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module:
        inner = [f"{node.module}.{each.name}" for each in node.names]
        yield from (each if each in modules() else node.module for each in inner)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str) and (name := _A_MODULE.fullmatch(node.value)):
        yield name[1]


@cache
def imports(name: str) -> frozenset[str]:
    """Modules of the three packages that a module imports: anywhere, for types alone, or named by a string."""
    found = {each for node in ast.walk(tree(modules()[name])) for each in _imported(node)}
    return frozenset((found & modules().keys()) - {name})


def circles(graph: Mapping[str, Iterable[str]]) -> list[list[str]]:
    """Groups of modules that import each other, directly or through others (Tarjan's strong components)."""
    low: dict[str, int] = {}
    open_, found = [], []

    def visit(name: str) -> None:
        place = low[name] = len(low)
        open_.append(name)
        for other in sorted(graph[name]):
            if other not in low:
                visit(other)
            if other in open_:
                low[name] = min(low[name], low[other])
        if low[name] == place:
            group = open_[open_.index(name) :]
            del open_[open_.index(name) :]
            if len(group) > 1:
                found.append(sorted(group))

    for each in graph:
        if each not in low:
            visit(each)
    return found


def every_circle() -> list[list[str]]:
    """Circles of the three packages."""
    return circles({name: imports(name) for name in modules()})


# ---------------------------------------------------------------- command


def main(words: list[str]) -> int:
    """Print the numbers; with a name of a list, such as `questions`, also each place."""
    lists = {"questions": questions, "positions": positions, "many_arguments": many_arguments, "vague": vague}
    if set(words) - set(lists):
        print(f"usage: python -m tests.house [{'] ['.join(lists)}]", file=sys.stderr)
        return 2
    for word in words:
        for path in modules().values():
            for place in lists[word](path):
                print(f"{path.relative_to(HOME)}:{place}")
    table = counts()
    print(f"{'':22}" + "".join(f"{each.name:>16}" for each in fields(Count)))
    for name, numbers in [*table.items(), ("all", sum(table.values(), Count()))]:
        print(f"{name:22}" + "".join(f"{each:16,}" for each in astuple(numbers)))
    groups = every_circle()
    print(f"circles of imports: {len(groups)}, of {sum(map(len, groups))} files")
    for group in groups:
        print(f"  {', '.join(group)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
