"""Docstrings as Markdown: equations, lists of arguments, examples; and the source and range of every law.

Docstrings of this package are made to be read in the code: an equation behind `.. math::`, arguments one a line with
their units, examples behind `>>>`. What is sentences stays; the rest is marked up for the page.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import griffe

ARGUMENT = re.compile(r"(\.{0,3}[A-Za-z_][\w.,]*(?:, [\w.]+)*) {2,}(\S.*)")
"""A line that names arguments and, two spaces on, says what they are."""

ROLE = re.compile(r":(\w+):`([^`]+)`")


def to_markdown(text: str) -> str:
    """A docstring as Markdown."""
    blocks = [block for block in re.split(r"\n\s*\n", text.strip("\n")) if block.strip()]
    return "\n\n".join(part for block in blocks for part in _parts(block.split("\n")))


def _parts(lines: list[str]) -> list[str]:
    """A paragraph, cut where sentences, equations and examples meet."""
    made: list[str] = []
    while lines:
        if lines[0].startswith(".. math::"):
            end = _first(lines, lambda line: not line.startswith(" "), 1)
            made.append("$$ " + " ".join([lines[0][9:].strip(), *(line.strip() for line in lines[1:end])]) + " $$")
        elif lines[0].startswith(">>>"):
            end = len(lines)
            made.append("\n".join(["```pycon", *lines, "```"]))
        elif lines[0].startswith("    "):
            end = _first(lines, lambda line: not line.startswith("    "), 1)
            made.append("\n".join(["```text", *(line[4:] for line in lines[:end]), "```"]))
        elif ARGUMENT.match(lines[0]):
            end = _first(lines, lambda line: line.startswith((".. math::", ">>>")), 1)
            made.append(_arguments(lines[:end]))
        else:
            end = _first(lines, lambda line: line.startswith((".. math::", ">>>")) or bool(ARGUMENT.match(line)), 1)
            made.append(sentence(" ".join(line.strip() for line in lines[:end])))
        lines = lines[end:]
    return made


def _first(lines: list[str], wanted: Any, start: int) -> int:
    """Place of the first line that is wanted."""
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
    """Words as they are, but for what Markdown would take for markup."""
    text = ROLE.sub(lambda role: f"${role[2]}$" if role[1] == "math" else f"`{role[2]}`", text)
    pieces = re.split(r"(`[^`]+`|\$[^$]+\$|\*\*[^*]+\*\*)", text)
    for place in range(0, len(pieces), 2):
        pieces[place] = (
            pieces[place].replace("*", r"\*").replace("] [", "] &#91;").replace("<", "&lt;").replace(">", "&gt;")
        )
    return "".join(pieces)


def of_the_law(reference: str, ranges: dict[str, tuple[float, float]]) -> str:
    """What `@law(kind, reference, **ranges)` says, as a paragraph.

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
    """Turns the docstrings that are read for the reference into Markdown."""

    def on_object(self, *, obj: griffe.Object, loader: Any, **_: Any) -> None:
        """Called for every module, class, function and constant."""
        if obj.docstring is None:
            return
        text = to_markdown(obj.docstring.value)
        card = _laws().get(obj.path)
        obj.docstring.value = text if card is None else text + "\n\n" + of_the_law(card.reference, card.ranges)


@cache
def _laws() -> dict[str, Any]:
    """The card of every law, by its dotted name."""
    from closures import shelf

    shelf.fill()
    return {f"{card.function.__module__}.{name}": card for laws in shelf.SHELF.values() for name, card in laws.items()}
