"""Cases by name: a file of the user's, or one of the gallery that comes with the package."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from cfddem.case import Case
from cfddem.errors import InputError, nearest
from cfddem.materials import Material
from cfddem.mistakes import parts_of


def gallery() -> dict[str, Path]:
    """Case files that come with the package, by name."""
    home = Path(str(files("scenarios")))
    return {path.stem.replace("_", "-"): path for path in sorted(home.glob("*.toml"))}


def gallery_case(path: Path) -> Case:
    """A case of the gallery."""
    return Case.from_toml(path)


def begin(name: str, output: Path | None = None) -> Path:
    """Write a case of the gallery where the user can change it; an existing file is never overwritten.

    name     of the gallery
    output   file to write; in this folder if not given
    returns  the file
    """
    known = gallery()
    if name.replace("_", "-") not in known:
        raise InputError("name", name, nearest(name, known), "the gallery has no case of another name")
    source = known[name.replace("_", "-")]
    output = output or Path(source.name)
    try:
        with output.open("x", encoding="utf-8") as file:
            file.write(source.read_text(encoding="utf-8"))
    except FileExistsError:
        raise InputError("output", str(output), "a file that is not there yet", "give another name with -o") from None
    except OSError as failure:
        raise InputError("output", str(output), "a file that can be written", str(failure.strerror)) from None
    return output


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
        values[full_key(key)] = read_value(value)
    return values


def read_value(text: str) -> Any:
    """A value as TOML reads it; what TOML cannot read is a text."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def full_key(key: str) -> str:
    """A key with its table, where its last word alone says enough: seed is bed.seed.

    >>> full_key("seed"), full_key("fluid.viscosity"), full_key("title")
    ('bed.seed', 'fluid.viscosity', 'title')
    """
    if "." in key or key in Case.model_fields:
        return key
    homes = {name: parts[0].model_fields for name, field in Case.model_fields.items() if (parts := parts_of(field))}
    homes.pop("material")  # by the name of the solid: material.NAME.density
    found = [f"{name}.{key}" for name, words in homes.items() if key in words]
    if len(found) > 1:
        raise InputError("key", key, f"unambiguous: {' or '.join(found)}")
    if not found and key in Material.model_fields:
        raise InputError("key", key, f"written out, material.NAME.{key}", "NAME is that of a solid of the case")
    if not found:
        raise InputError("key", key, nearest(key, sorted({*Case.model_fields, *itertools.chain(*homes.values())})))
    return found[0]
