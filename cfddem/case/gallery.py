"""Finds cases: the user's files and the gallery of the package; reads `key=value` overrides."""

from __future__ import annotations

import itertools
import os
import tomllib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from cfddem.backend.errors import InputError, nearest
from cfddem.case.input_errors import absent, sections_of
from cfddem.case.materials import Material
from cfddem.case.schema import Case


def gallery() -> dict[str, Case]:
    """Cases of the gallery by name.

    >>> gallery()["settling"].title
    'A glass bead settles in water'
    """
    return {name: Case.from_toml(path) for name, path in gallery_files().items()}


def gallery_files() -> dict[str, Path]:
    """Case files of the gallery by name."""
    home = Path(str(files("scenarios"))) / "beds"
    return {path.parent.name.replace("_", "-"): path for path in sorted(home.glob("*/case.toml"))}


def copy_from_gallery(name: str, output: Path | None = None) -> Path:
    """Copy a gallery case to a file of the user; an existing file is never overwritten.

    name     of the gallery case
    output   file to write; default: NAME.toml in the working directory
    returns  the file
    """
    of_gallery = gallery_files()
    if name.replace("_", "-") not in of_gallery:
        raise InputError("name", name, nearest(name, of_gallery), "cfddem new lists the gallery")
    source = of_gallery[name.replace("_", "-")]
    output = output or Path(f"{source.parent.name}.toml")
    try:
        with output.open("x", encoding="utf-8") as file:
            file.write(source.read_text(encoding="utf-8"))
    except FileExistsError:
        raise InputError(
            "output", str(output), "a file that does not exist yet", "choose another name with -o"
        ) from None
    except OSError as failure:
        raise InputError("output", str(output), "a file that can be written", str(failure.strerror)) from None
    return output


def find_case(name: Path | None) -> Path:
    """Case file of a path or a gallery name; without a name, the only TOML file in the working directory."""
    if name is None:
        here = sorted(path for path in Path().glob("*.toml") if path.name != "pyproject.toml")
        if len(here) != 1:
            names = ", ".join(path.name for path in here) or "none"
            limit = f"given, unless the folder holds exactly one TOML file (found: {names})"
            raise InputError("case", None, limit, "cfddem new liquid-bed writes one" if names == "none" else "")
        return here[0]
    if name.is_file():
        return name
    of_gallery = gallery_files()
    if str(name) in of_gallery:
        return of_gallery[str(name)]
    if name.suffix or len(name.parts) > 1 or name.is_dir():
        remedy = "cfddem new writes one" if not name.is_dir() else "name the case file in it"
        raise InputError("case", str(name), "an existing file", remedy)
    raise InputError("case", str(name), f"a file, or {nearest(str(name), of_gallery)}")


def overrides(texts: Sequence[str]) -> dict[str, Any]:
    """Values of `key=value` texts by full key; a file lies relative to the current folder, as in any command."""
    values: dict[str, Any] = {}
    for setting in texts:
        key, equals, text = setting.partition("=")
        if not equals or not key:
            raise InputError("--set", setting, "key=value, such as bed.inlet_velocity=0.06")
        key, value = full_key(key), read_value(text)
        is_file = key.endswith(".file") and isinstance(value, str)
        values[key] = os.path.abspath(value) if is_file else value
    return values


def read_value(text: str) -> Any:
    """A value in TOML notation; other text is returned as a string."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


NAMED = ("material", "pair", "wall", "patch", "feed", "outlet", "compare")
"""Tables whose keys need a name or a number."""


def full_key(key: str) -> str:
    """The key with its table; the table may be left out if only one table has the key, [liquid] and [spray] aside.

    >>> full_key("seed"), full_key("fluid.viscosity"), full_key("title")
    ('bed.seed', 'fluid.viscosity', 'title')
    """
    if "." in key or key in Case.model_fields:
        return key
    tables = {
        name: sections[0].model_fields for name, field in Case.model_fields.items() if (sections := sections_of(field))
    }
    for several in NAMED:
        tables.pop(several)
    homes = [f"{name}.{key}" for name, words in tables.items() if key in words]
    if len(homes) > 1:
        homes = [home for home in homes if not home.startswith(("liquid.", "spray."))] or homes
    if len(homes) > 1:
        raise InputError("key", key, f"unambiguous: {' or '.join(homes)}")
    if key in Material.model_fields:
        meant = " or ".join([*homes, f"material.NAME.{key}"])
        raise InputError("key", key, f"written as {meant}", "NAME is the name of a material of the case")
    if not homes:
        keys = sorted({*Case.model_fields, *itertools.chain(*tables.values())})
        raise InputError("key", key, nearest(key, keys), absent(key) or "cfddem new --schema shows all")
    return homes[0]
