"""Keys of a case file on a terminal: meaning, unit and default, from the schema."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterator

from pydantic.fields import FieldInfo

from cfddem.case.input_errors import sections_of
from cfddem.case.schema import Case

WIDTH = 100
"""Columns of printed text."""

SEVERAL = {name: f"{name}.NAME" for name in ("material", "compare")} | {"pair": "pair.NAME.NAME"}
SEVERAL |= {name: f"{name}.NUMBER" for name in ("wall", "feed", "outlet")}
"""Tables that a case has several of, by the place of their keys."""


def matching(name: str) -> list[str]:
    """Documentation of a key, of all keys of a table, or of all keys that contain a word.

    returns  lines of at most 100 columns; empty if nothing matches

    >>> matching("bed.jet.velocity"), matching("run.until")[0][:34]
    (['bed.jet.velocity = (required)     superficial velocity, upward [m/s]'], 'run.until = (required)            ')
    """
    every, word = dict(_keys()), name.lower()
    plain = {key: re.sub(r"\.(NAME|NUMBER)\b", "", key).lower() for key in every}
    found = [
        key for key in every if any(each == word or each.startswith(f"{word}.") for each in (key.lower(), plain[key]))
    ]
    found = found or [key for key in every if word in key.lower()]
    return [line for key in found for line in _lines(key, every[key])]


def every_key() -> list[str]:
    """Names of all keys, with their tables."""
    return [key for key, _ in _keys()]


def _keys() -> Iterator[tuple[str, FieldInfo]]:
    """Every key with its table."""
    for name, field in Case.model_fields.items():
        parts = sections_of(field)
        if not parts:
            yield name, field
            continue
        for key, each in parts[0].model_fields.items():
            yield f"{SEVERAL.get(name, name)}.{key}", each
            below = f"{SEVERAL.get(name, name)}.{key}{'.NAME' * str(each.annotation).startswith('dict')}"
            for part in sections_of(each):
                yield from ((f"{below}.{inner}", rest) for inner, rest in part.model_fields.items())


def _lines(key: str, field: FieldInfo) -> list[str]:
    """A key, its default and its meaning."""
    default = None if field.is_required() else field.get_default()
    if any(getattr(rule, "gt", None) == default for rule in field.metadata):  # it stands for a key that is left out
        default = None
    shown = " = (required)" if field.is_required() else "" if default is None else f" = {json.dumps(default)}"
    choices = re.findall(r"Literal\[([^\]]*)\]", str(field.annotation))
    meaning = (field.description or "") + (f"; one of {choices[0]}" if choices else "")
    return textwrap.wrap(f"{key + shown:<33} {meaning}", WIDTH, subsequent_indent=" " * 34)
