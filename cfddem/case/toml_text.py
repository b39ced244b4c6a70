"""Reads and parses the text of a case file, and sets single values. Text that cannot be a case is refused early."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from cfddem.backend.errors import InputError, shown
from cfddem.case.input_errors import dotted, key_lines

LONGEST_FILE = 500_000
"""Largest case file; very many particle positions are given from Python instead [characters]."""

DEEPEST_KEY = 20
"""Most dots in a key; the time to parse a dotted key grows with the square of their number."""


def read_text(path: Path) -> str:
    """Text of a case file."""
    if "\n" in str(path):
        first = next(filter(None, (line.strip() for line in str(path).splitlines())), "")
        remedy = f"this is a text that begins with {first[:40]!r}; Case.from_text reads one"
        raise InputError("path", None, "the name of a case file", remedy)
    try:
        with path.open("rb") as file:
            content = file.read(LONGEST_FILE + 1)
        if len(content) > LONGEST_FILE:
            raise _too_long(f"case {path}")
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except OSError as failure:
        raise InputError(f"case {path}", None, "a readable TOML file", failure.strerror or str(failure)) from None
    except UnicodeDecodeError as failure:
        remedy = f"byte {failure.start} is not UTF-8; save the file as UTF-8"
        raise InputError(f"case {path}", None, "UTF-8 text", remedy) from None


_DEEP = re.compile(rf"(?:[\w\"'-]{{1,64}}+[ \t]*+\.[ \t]*+){{{DEEPEST_KEY}}}")


_POWER = re.compile(r"[^=#]*=\s*([-+]?[.\d]+)\s*[xX*×]\s*10\s*(?:\^|\*\*)?\s*([-+]?\d+).*")
"""A number such as 1.8x10-5, where 1.8e-5 is meant."""


def parse(text: str, name: str) -> dict[str, Any]:
    """Values of a TOML text; errors call it `name`."""
    text = text.removeprefix("\ufeff")
    if len(text) > LONGEST_FILE:
        raise _too_long(name)
    deep = _DEEP.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise InputError(f"{name}:{line}", None, f"a case with fewer than {DEEPEST_KEY} dots in a key")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(name, None, "a case with lists and tables nested a few levels deep") from None
    except ValueError as failure:
        reason, _, where = str(failure).partition(" (at ")
        position = re.match(r"line (\d+), column (\d+)", where)
        place = f"{name}:{position[1]}" if position else name
        where = f" in column {position[2]}" if position else ""
        line = int(position[1]) if position else text.rstrip().count("\n") + 1
        if reason.startswith("Cannot overwrite a value") or reason.endswith(" twice"):
            raise _given_twice(text, line, name) from None
        comma = re.fullmatch(r"[^=]*=\s*(-?\d+),(\d+(?:[eE][-+]?\d+)?)\s*(#.*)?", text.split("\n")[line - 1])
        remedy = f"; decimals have a point: {comma[1]}.{comma[2]}" if comma else ""
        unit = re.fullmatch(r"[^=#]*=\s*([-+]?[.\d]+(?:e[-+]?\d+)?)\s*[A-Za-z%µ°][^=]*", text.split("\n")[line - 1])
        power = _POWER.fullmatch(text.split("\n")[line - 1])
        if power:
            remedy += f"; powers of ten are written {power[1]}e{power[2]}"
        else:
            remedy += f"; numbers stand without a unit, in SI units: {unit[1]}" if unit else ""
        if reason == r"Illegal character '\n'":
            reason, where = "a string without its closing quotation mark", ""
        remedy += "; strings need quotation marks" if reason == "Invalid value" else ""
        raise InputError(place, None, "valid TOML", reason + where + remedy) from None


def _given_twice(text: str, line: int, name: str) -> InputError:
    """The error for a key in a line that an earlier line has given."""
    lines = text.split("\n")
    heads = not lines[line - 1].lstrip().startswith("[")
    only = [row if k == line or (heads and row.lstrip().startswith("[")) else "" for k, row in enumerate(lines, 1)]
    key = next((key for key, at in key_lines("\n".join(only)).items() if at == line), ())
    first = key_lines(text).get(key)
    return InputError(f"{name}:{line}: {dotted(key)}", None, "given once", f"line {first} gives it, too")


def _too_long(name: str) -> InputError:
    return InputError(name, None, f"at most {LONGEST_FILE // 1000} kB", "give very many positions from Python instead")


def set_value(values: dict[str, Any], keys: list[str], value: Any, whole: str) -> None:
    """Set a value in nested tables.

    keys   of the tables and of the value
    whole  the dotted key, for errors
    """
    *tables, last = keys
    while tables:
        key = tables.pop(0)
        inner = values.setdefault(key, {})
        if isinstance(inner, list | tuple) and inner and isinstance(inner[0], dict):  # tables [[wall]], by number
            values[key] = inner = list(inner)
            number = tables.pop(0) if tables else ""
            if not number.isdecimal() or int(number) >= len(inner):
                limit = f"written as {key}.NUMBER.KEY with a number from 0 to {len(inner) - 1}"
                raise InputError(f"--set {whole}", shown(value), limit)
            inner = inner[int(number)]
        values = inner
        if not isinstance(values, dict):
            raise InputError(f"--set {whole}", shown(value), f"inside a table; {key} is a value")
    values[last] = _copied(value)


def _copied(value: Any) -> Any:
    """A value whose tables and lists are its own, so that a later key inside of it leaves the caller's as they are."""
    if isinstance(value, dict):
        return {key: _copied(content) for key, content in value.items()}
    return [_copied(element) for element in value] if type(value) is list else value
