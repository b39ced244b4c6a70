"""Convert docstrings to Markdown; add source and range to those of laws.

Docstrings of this package hold equations after `.. math::`, one argument per line with its unit, and examples after
`>>>`. These become equations, tables and code blocks. Sentences stay as they are.
"""

from __future__ import annotations

import inspect
import re
from functools import cache
from importlib import import_module
from typing import Any

import griffe

ARGUMENT = re.compile(r"(\.{0,3}[A-Za-z_][\w.,]*(?:, [\w.]+)*) {2,}(\S.*)")
"""A line with names of arguments, at least two spaces, and their description."""

ROLE = re.compile(r":(\w+):`([^`]+)`")


def to_markdown(text: str) -> str:
    """A docstring as Markdown."""
    blocks = [block for block in re.split(r"\n\s*\n", text.strip("\n")) if block.strip()]
    return "\n\n".join(part for block in blocks for part in _parts(block.split("\n")))


def _parts(lines: list[str]) -> list[str]:
    """A paragraph, split into sentences, equations, arguments and examples."""
    parts: list[str] = []
    while lines:
        if lines[0].startswith(".. math::"):
            end = _first(lines, lambda line: not line.startswith(" "), 1)
            parts.append("$$ " + " ".join([lines[0][9:].strip(), *(line.strip() for line in lines[1:end])]) + " $$")
        elif lines[0].startswith(">>>"):
            end = len(lines)
            parts.append("\n".join(["```pycon", *lines, "```"]))
        elif lines[0].startswith("    "):
            end = _first(lines, lambda line: not line.startswith("    "), 1)
            parts.append("\n".join(["```text", *(line[4:] for line in lines[:end]), "```"]))
        elif ARGUMENT.match(lines[0]):
            end = _first(lines, lambda line: line.startswith((".. math::", ">>>")), 1)
            parts.append(_arguments(lines[:end]))
        else:
            end = _first(lines, lambda line: line.startswith((".. math::", ">>>")) or bool(ARGUMENT.match(line)), 1)
            parts.append(sentence(" ".join(line.strip() for line in lines[:end])))
        lines = lines[end:]
    return parts


def _first(lines: list[str], wanted: Any, start: int) -> int:
    """Index of the first line that satisfies a condition."""
    return next((place for place in range(start, len(lines)) if wanted(lines[place])), len(lines))


def _arguments(lines: list[str]) -> str:
    rows: list[list[str]] = []
    for line in lines:
        found = ARGUMENT.match(line)
        if found:
            rows.append([found[1], found[2]])
        elif line.startswith("  ") and rows:
            rows[-1][1] += " " + line.strip()
        else:
            name, _, meaning = line.strip().partition(" ")
            rows.append([name, meaning])
    table = [f"| `{name}` | {sentence(meaning).replace('|', chr(92) + '|')} |" for name, meaning in rows]
    return "\n".join(["|  |  |", "|:--|:--|", *table])


def sentence(text: str) -> str:
    """Text with characters escaped that Markdown would take for markup."""
    text = ROLE.sub(lambda role: f"${role[2]}$" if role[1] == "math" else f"`{role[2]}`", text)
    pieces = re.split(r"(`[^`]+`|\$[^$]+\$|\*\*[^*]+\*\*)", text)
    for place in range(0, len(pieces), 2):
        pieces[place] = (
            pieces[place].replace("*", r"\*").replace("] [", "] &#91;").replace("<", "&lt;").replace(">", "&gt;")
        )
    return "".join(pieces)


def of_the_law(reference: str, ranges: dict[str, tuple[float, float]]) -> str:
    """The arguments of `@law(kind, reference, **ranges)` as paragraphs.

    >>> of_the_law("Di Felice (1994)", {"voidage": (0.4, 1.0)})
    '**Source.** Di Felice (1994)\\n\\n**Fitted for** voidage 0.4 to 1'
    """
    said = [f"**Source.** {sentence(reference)}"]
    if ranges:
        said.append(
            "**Fitted for** " + ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in ranges.items())
        )
    return "\n\n".join(said)


class Docstrings(griffe.Extension):
    """Convert the docstrings of the reference to Markdown."""

    def on_object(self, *, obj: griffe.Object, loader: Any, **_: Any) -> None:
        """Called by griffe for every module, class, function and constant."""
        if obj.docstring is None:
            return
        if isinstance(obj, griffe.Function) and any("takes(" in str(each.value) for each in obj.decorators):
            function = getattr(import_module(obj.path.rpartition(".")[0]), obj.name)
            obj.docstring.value = inspect.getdoc(function) or ""  # with the settings that it takes
        text = to_markdown(obj.docstring.value)
        entry = _laws().get(obj.path)
        obj.docstring.value = text if entry is None else text + "\n\n" + of_the_law(entry.reference, entry.ranges)


@cache
def _laws() -> dict[str, Any]:
    """The registry entry of every law, by its dotted name."""
    from closures import registry

    registry.load_built_in_laws()
    return {
        f"{entry.function.__module__}.{name}": entry
        for laws in registry.REGISTRY.values()
        for name, entry in laws.items()
    }
