"""Turns validation failures into readable input errors: one line each with place, key, value, limit and remedy.

All errors of a file are reported at once. A misspelled key or value is reported with the closest valid one.
"""

from __future__ import annotations

import itertools
import re
import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from cfddem.backend.errors import LONGEST, InputError, nearest, shown

MOST = 20
"""At most this many input errors are listed."""

Key = tuple[str | int, ...]


class InputErrors(InputError):
    """Several input errors, one line each.

    errors   the errors
    omitted  number of further errors that are not listed
    """

    def __init__(self, errors: Sequence[InputError], omitted: int = 0) -> None:
        first = errors[0]
        super().__init__(first.field, first.value, first.limit, first.remedy)
        self.errors = tuple(errors)
        self.args = ("\n".join([*map(str, errors), *([f"and {omitted} more input errors"] if omitted else [])]),)


def dotted(key: Iterable[str | int]) -> str:
    """A key as text: its parts joined by dots."""
    text = ".".join(str(part) for part in key)
    text = text if text.isprintable() else repr(text)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


# ---------------------------------------------------------------- from pydantic to input errors


def input_error(
    failure: ValidationError,
    model: type[BaseModel],
    values: Any,
    more: Iterable[InputError] = (),
    place: typing.Callable[[Key], str] = lambda _: "",
) -> InputError:
    """The input error for a failed validation.

    failure  what pydantic reports
    model    class that was to be made
    values   raw values
    more     further errors, found elsewhere; not told where a table is missing
    place    location of a key, such as "bed.toml:14: "
    """
    misshapen = list(_misshapen(values, model)) if isinstance(values, Mapping) else []
    tables = {key for key, _ in misshapen}
    reports = {
        key: several for key, several in _by_key(failure, values).items()
        if not any(key[:length] in tables for length in range(1, len(key) + 1))
    }  # fmt: skip
    reported, whole_tables = _without_moved_keys(reports, values, model)
    of_keys = [(key, _one(key, several, model)) for key, several in itertools.islice(reported.items(), MOST)]
    errors = []
    whole_tables = [*misshapen, *whole_tables]
    others = () if whole_tables else (((), error) for error in more)  # which follow from a missing table
    for key, error in [*whole_tables, *of_keys, *others]:
        beyond = error.field.removeprefix(dotted(key)).strip(".")  # a section names a key of its own
        rest = [int(part) if part.isdecimal() else part for part in beyond.split(".")] if beyond else []
        whole = (*key, *rest)
        errors.append(InputError(place(whole) + error.field, error.value, error.limit, error.remedy))
    omitted = max(0, len(reported) - MOST)
    return errors[0] if len(errors) == 1 and not omitted else InputErrors(errors, omitted)


def _by_key(failure: ValidationError, values: Any) -> dict[Key, list[Any]]:
    """Reports grouped by key; a value that may be of two types gives one report for each type."""
    by_key: dict[Key, list[Any]] = {}
    for report in failure.errors(include_url=False):
        by_key.setdefault(_key(report["loc"], values, report["type"]), []).append(report)
    return by_key


def _misshapen(values: Any, model: type[BaseModel], above: Key = ()) -> Iterator[tuple[Key, InputError]]:
    """Tables that begin with the line of another sort, such as [wall] for [[wall]], or [patch] without a name."""
    for name, field in model.model_fields.items():
        value, key = values.get(name), (*above, name)
        if not (isinstance(value, Mapping | list) and sections_of(field)):
            continue
        header, wrong = _header(dotted(key), field), _wrong_header(dotted(key), value, field)
        if wrong:
            limit = f"a table {header} for each" if "NAME" in header or "[[" in header else f"one table {header}"
            yield key, InputError(dotted(key), None, limit, f"the line is {wrong}")
        elif isinstance(value, Mapping):
            yield from _misshapen(value, sections_of(field)[0], key)


def _wrong_header(name: str, value: Mapping[str, Any] | list[Any], field: FieldInfo) -> str:
    """The line with which a table seems to begin, if that is wrong; else empty."""
    header = _header(name, field)
    if isinstance(value, list):
        return f"[[{name}]]" if "[[" not in header and any(map(_is_table, value)) else ""
    if "[[" in header or ("NAME" in header and not all(map(_is_table, value.values()))):
        return f"[{name}]"
    for word, inner in value.items():
        if header.count("NAME") > 1 and not all(map(_is_table, inner.values())):  # as [pair.glass]
            return f"[{name}.{word}]"
        if "NAME" not in header and len(value) == 1 and isinstance(inner, Mapping) and not _has_all(field, [word]):
            return f"[{name}.{word}]" if _has_all(field, inner) else ""
    return ""


def _is_table(value: Any) -> bool:
    return isinstance(value, Mapping | BaseModel)


def _without_moved_keys(
    reported: dict[Key, list[Any]], values: Any, model: type[BaseModel]
) -> tuple[dict[Key, list[Any]], list[tuple[Key, InputError]]]:
    """Reports without the keys of a table whose header is missing, and one error for each such table.

    Without its header, all keys of a table belong to the table above, which knows none of them.
    """
    unknown: dict[Key, list[str]] = {}
    for key, several in reported.items():
        if key and several[0]["type"] == "extra_forbidden":
            unknown.setdefault(key[:-1], []).append(str(key[-1]))
    errors: list[tuple[Key, InputError]] = []
    for table, words in unknown.items():
        homes = [name for name, field in model.model_fields.items() if _has_all(field, words)]
        missing = [name for name in homes if isinstance(values, Mapping) and name not in values]
        of_names = [name for name in homes if "." in _header(name, model.model_fields[name])]  # as [material.NAME]
        home = next(iter(missing or of_names), None)
        if home is None:
            continue
        owner, wrong = model.model_fields[home], [str(key[-1]) for key in reported if key and key[:-1] == table]
        words = [*words, *(word for word in wrong if word not in words and _has_all(owner, [word]))]
        if len(words) < 2:
            continue
        first, header = (*table, words[0]), _header(home, owner)
        limit = f"below a line {header}, as {', '.join(words[1:MOST])} after it"
        errors.append((first, InputError(dotted(first), None, limit, "the line is missing")))
        moved = {(home,), *((*table, word) for word in words)}
        reported = {key: several for key, several in reported.items() if key not in moved}
    return reported, errors


def _has_all(field: FieldInfo, words: Iterable[str]) -> bool:
    """Whether a table has all of some keys."""
    return any(all(word in section.model_fields for word in words) for section in sections_of(field))


def _header(name: str, field: FieldInfo) -> str:
    """The line that begins a table, such as [bed], [material.NAME] or [[wall]]."""
    text = str(field.annotation).lower()
    return f"[[{name}]]" if text.startswith("tuple") else f"[{name}{'.NAME' * text.count('dict[')}]"


def _key(place: tuple[str | int, ...], values: Any, kind: str) -> Key:
    """The key of a report: its location without the names of the types that were tried."""
    key: list[str | int] = []
    for part in place:
        if isinstance(values, BaseModel):
            values = dict(values)
        entry = isinstance(values, list | tuple) and isinstance(part, int) and part < len(values)
        if entry or (isinstance(values, Mapping) and part in values):
            values = values[part]
        elif not (kind == "missing" and part == place[-1] and isinstance(part, str)):
            continue
        key.append(part)
    return tuple(key)


def _one(key: Key, reports: Sequence[Any], model: type[BaseModel]) -> InputError:
    """One input error: field, value, limit, remedy."""
    owner, field = _owner(model, key), dotted(key) or model.__name__.lower()
    first = reports[0]
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        whole = field if key and cause.field in ("", str(key[-1])) else dotted((*key, cause.field))
        return InputError(whole, shown(cause.value), cause.limit, cause.remedy)
    if cause is not None:
        name, _, limit = str(cause).partition(": must be ")
        return InputError(dotted((*key, name)), None, limit or str(cause))
    last = str(key[-1]) if key else ""
    if first["type"] == "extra_forbidden":
        remedy = absent(last) or _right_table(last, owner, model)
        return InputError(field, shown(first["input"]), nearest(last, owner.model_fields), remedy)
    limits = dict.fromkeys(filter(None, (_limit(report) for report in reports)))
    named = next((str(part) for part in reversed(key[-2:]) if part in owner.model_fields), last)  # or values by name
    about = owner.model_fields[named].description if named in owner.model_fields else None
    value = None if limits.keys() == {"given"} else shown(first["input"])
    if value is None and len(key) == 1 and sections_of(owner.model_fields[named]):
        remedy = f"a table {_header(named, owner.model_fields[named])}; cfddem explain {named} lists its keys"
        return InputError(field, None, "given", remedy)
    return InputError(field, value, " or ".join(limits) or first["msg"], f"{named}: {about}" if about else "")


_LIMITS = {
    "missing": "given",
    "finite_number": "a finite number",
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float", "int_parsing_size"), "a whole number"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    "string_type": "a string",
    "string_pattern_mismatch": "made of letters, digits, _ and -",
    "dict_type": "a table, such as {NAME = value}",
    **dict.fromkeys(("model_type", "model_attributes_type"), "a table"),
    "callable_type": "",
    "none_required": "",
}


def _limit(report: Any) -> str:
    """The limit that a value violates, in words."""
    kind, context = report["type"], report.get("ctx", {})
    bounds = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
    for name, word in bounds.items():
        if name in context:
            return f"{word} {context[name]:g}"
    if kind == "missing" and isinstance(report["loc"][-1], int):
        return f"a list of at least {report['loc'][-1] + 1} values"
    if kind == "literal_error":
        choices = re.findall(r"'([^']*)'", str(context.get("expected", "")))
        return nearest(str(report["input"])[:LONGEST], choices)
    if kind in ("tuple_type", "too_short", "too_long"):
        length = context.get("actual_length")
        return "a list" if length is None else f"a list of another length than {length}"
    return _LIMITS.get(kind, str(report["msg"]).lower())


def _owner(model: type[BaseModel], key: Key) -> type[BaseModel]:
    """The section that the last part of a key belongs to."""
    for part in key[:-1]:
        if part in model.model_fields:
            model = next(iter(sections_of(model.model_fields[str(part)])), model)
    return model


def field_of(model: type[BaseModel], key: Sequence[str]) -> str | None:
    """Description of a key; None for an unknown one."""
    owner = _owner(model, tuple(key))
    return owner.model_fields[key[-1]].description if key[-1] in owner.model_fields else None


def sections_of(field: FieldInfo) -> list[type[BaseModel]]:
    """Models nested in a field."""
    return list(_models(field.annotation))


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Models in a type annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in typing.get_args(annotation):
        yield from _models(argument)


def _right_table(word: str, owner: type[BaseModel], model: type[BaseModel]) -> str:
    """Remedy for a key in the wrong table; empty if no table has the key."""
    for name, field in model.model_fields.items():
        for part in sections_of(field):
            if part is not owner and word in part.model_fields:
                return f"{word} belongs to {name}"
    if owner is model:
        fields, stem = model.model_fields.items(), word.rstrip("s")
        keys = [f"{name}.{key}" for name, field in fields for part in sections_of(field) for key in part.model_fields]
        alike = [key for key in keys if stem in key.partition(".")[2].split("_")]
        return f"keys with this word: {', '.join(alike[:3])}" if alike else "cfddem new --schema shows all tables"
    return f"cfddem explain {table} lists them" if (table := next(iter(_tables(owner, model)), "")) else ""


def _tables(owner: type[BaseModel], model: type[BaseModel]) -> Iterator[str]:
    """The tables whose keys are those of a section."""
    yield from (name for name, field in model.model_fields.items() if owner in sections_of(field))


# ---------------------------------------------------------------- line of a key in a file

_PART = r"(?:[\w-]+|\"[^\"\n]*\"|'[^'\n]*')"
_DOTTED = rf"{_PART}(?:[ \t]*\.[ \t]*{_PART})*"
_LINE = re.compile(rf"[ \t]*(?:\[\[?[ \t]*(?P<table>{_DOTTED})[ \t]*\]|(?P<key>{_DOTTED})[ \t]*=)")


def key_lines(text: str) -> dict[Key, int]:
    """Line number of every key and table of a TOML text that begins a line."""
    lines: dict[Key, int] = {}
    table: Key = ()
    count: dict[Key, int] = {}
    for number, line in enumerate(text.split("\n"), 1):
        heading = _LINE.match(line[:1000])
        if heading is None:
            continue
        parts = tuple(part.strip("\"'") for part in re.findall(_PART, heading["table"] or heading["key"]))
        if heading["table"]:
            table = parts
            if line.lstrip().startswith("[["):  # one table of several
                lines.setdefault(parts, number)
                parts = table = (*parts, count.setdefault(table, 0))
                count[table[:-1]] += 1
        else:
            parts = (*table, *parts)
        lines.setdefault(parts, number)
        for length in range(len(parts) - 1, 0, -1):  # a table [a.b] is a part of a
            lines.setdefault(parts[:length], number)
    return lines


def line_of(key: Key, lines: Mapping[Key, int]) -> int | None:
    """Line number of a key, or of the table that should hold it; None if neither is in the file."""
    for length in range(len(key), 0, -1):
        if key[:length] in lines:
            return lines[key[:length]]
    return None


# ---------------------------------------------------------------- what a case cannot have, or has by another name


LIMITS = "the page Limits has more"

ABSENT: dict[str, str] = {
    "turbulen|k_epsilon|k_omega|smagorinsky|rans$|les$": "no turbulence model acts in a case",
    "superquadric|aspherical|nonspherical|non_spherical|polyhedr|clump|shape_factor|sphericity|multisphere":
        "all particles are spheres",
    "electrostatic|magnet|van_der_waals|hamaker": "no such force: add yours in Python (page Add a force), or "
        "take the cohesion of laws.contact",
    "breakage|attrition|fragment": "particles do not break",
    "natural_convection|thermal_expansion|boussinesq": "warm fluid is lighter by heat.buoyancy; no density follows "
        "a gas law",
    "reaction|combustion|arrhenius": "no reactions; [vapour] and [evaporation] are water in air",
    "melting|solidification|condensation": "of phase changes there is the evaporation of water, [evaporation]",
    "compressib|mach$|speed_of_sound": "the fluid is incompressible",
    "bubble|level_set|volume_of_fluid": "there is one fluid; bubbles of a bed are regions of "
        "high voidage",
    "fill_level|fill_height|free_surface|half_filled|liquid_level": "one fluid fills the whole vessel, without a free "
        "surface; for a drum of particles in air leave out [fluid], or give that of the air",
    "rotation_rate|rpm$|angular_velocity": "a wall turns by spin, a vector [rad/s]",
    "stl$|stl_|mesh_file": "a surface is [[wall]] with shape = \"surface\" and file",
    "cooling": "temperatures are [heat] of the fluid and [contact_heat] of contacts and walls",
}  # fmt: skip
"""Patterns of words -> what to say."""

TABLES: dict[str, str] = {
    "heat": "Not there: viscosity that changes with the temperature, density that does beyond heat.buoyancy, "
    "temperatures inside a particle, and reactions. Conduction at contacts and radiation are contact_heat, drying is "
    "evaporation.",
    "contact_heat": "Not there: temperatures inside a particle, and radiation from particle to particle: each sees "
    "surroundings of one temperature.",
    "vapour": "Not there: more than one vapour, its effect on the density of the gas, and reactions.",
    "evaporation": "Not there: condensation, and pores; what bonds are made of has no mass.",
    "fluid": "Not there: turbulence models, compressibility, free surfaces, and a viscosity that flows with the fluid.",
    "vessel": "Not there: a free surface of the fluid, surfaces that turn, and walls that move through it.",
    "wall": "Not there: the effect of a moving wall on the fluid; and wear.",
    "liquid": "Not there: several liquids, flow through bridges, and the mass of the liquid.",
    "spray": "Not there: flight of drops, which land at once, and their momentum.",
    "laws": "Not there: forces between particles of other kinds than contacts, films and bridges; add yours in Python.",
    "bed": "Not there: particles that are not spheres, or that break.",
}
"""What a table does not have, in words."""


def absent(word: str) -> str:
    """What to say to somebody who asks for a word; empty where nothing is known.

    >>> absent("turbulence_model")
    'no turbulence model acts in a case; the page Limits has more'
    >>> absent("diameter")
    ''
    """
    plain = word.lower().replace("-", "_")
    for pattern, words in ABSENT.items():
        if re.search(rf"(^|[_.])({pattern})", plain):
            return f"{words}; {LIMITS}"
    return ""
