"""Cases by name: a file of the user's, or one of the gallery that comes with the package."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from cfddem.errors import InputError, nearest


def gallery() -> dict[str, Path]:
    """Case files that come with the package, by name."""
    home = Path(str(files("scenarios")))
    return {path.stem.replace("_", "-"): path for path in sorted(home.glob("*.toml"))}


def find_case(name: Path | None) -> Path:
    """The file of a case: a path, a name of the gallery, or the only TOML file in this folder."""
    if name is None:
        here = sorted(path for path in Path().glob("*.toml") if path.name != "pyproject.toml")
        if len(here) != 1:
            found = ", ".join(path.name for path in here) or "none"
            raise InputError("case", None, f"given, unless one TOML file lies here (found: {found})")
        return here[0]
    if name.is_file():
        return name
    known = gallery()
    if str(name) in known:
        return known[str(name)]
    raise InputError("case", str(name), f"a file, or {nearest(str(name), known)}")


def overrides(given: Sequence[str]) -> dict[str, Any]:
    """Values of `key=value` texts, read as TOML reads them; what TOML cannot read is a text."""
    values: dict[str, Any] = {}
    for each in given:
        key, equals, value = each.partition("=")
        if not equals or not key:
            raise InputError("--set", each, "key=value, such as bed.inlet_velocity=0.06")
        try:
            values[key] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            values[key] = value
    return values
