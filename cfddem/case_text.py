"""The text of a case file: read, parsed, a value put in the place of another; what no case can be is refused."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from cfddem.errors import InputError
from cfddem.mistakes import shown

LONGEST_FILE = 500_000
"""A case is a page that a person reads; who places very many particles does so from Python [characters]."""

DEEPEST_KEY = 20
"""Most words in a key; the reader of TOML takes the square of it in time."""


def read_text(path: Path) -> str:
    """The text of a case file."""
    try:
        with path.open("rb") as file:
            content = file.read(LONGEST_FILE + 1)
        if len(content) > LONGEST_FILE:
            raise InputError(
                f"case {path}", None, f"at most {LONGEST_FILE // 1000} kB", "place very many particles from Python"
            )
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except OSError as failure:
        raise InputError(f"case {path}", None, "a readable TOML file", failure.strerror or str(failure)) from None
    except UnicodeDecodeError as failure:
        remedy = f"byte {failure.start} is not UTF-8; save it as UTF-8"
        raise InputError(f"case {path}", None, "UTF-8 text", remedy) from None


_DEEP = re.compile(rf"(?:[\w\"'-]{{1,64}}+[ \t]*+\.[ \t]*+){{{DEEPEST_KEY}}}")


def parsed(text: str, name: str) -> dict[str, Any]:
    """The values of a TOML text."""
    text = text.removeprefix("\ufeff")
    if len(text) > LONGEST_FILE:
        raise InputError(name, None, f"at most {LONGEST_FILE // 1000} kB", "place very many particles from Python")
    deep = _DEEP.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise InputError(f"{name}:{line}", None, f"a case, whose keys have at most {DEEPEST_KEY} words")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(name, None, "a case, whose lists and tables lie a few levels deep") from None
    except ValueError as failure:
        reason, _, where = str(failure).partition(" (at ")
        found = re.match(r"line (\d+), column (\d+)", where)
        place = f"{name}:{found[1]}" if found else name
        where = f" in column {found[2]}" if found else ""
        remedy = "; texts stand in quotation marks" if reason == "Invalid value" else ""
        raise InputError(place, None, "valid TOML", reason + where + remedy) from None


def put(values: dict[str, Any], keys: list[str], value: Any, whole: str) -> None:
    """Set a value in nested tables."""
    for key in keys[:-1]:
        values = values.setdefault(key, {})
        if not isinstance(values, dict):
            raise InputError(f"--set {whole}", shown(value), f"inside a table; {key} is a value")
    values[keys[-1]] = value
