"""The mistakes of a description, all at once and a line each: where, key, value, limit, and the nearest known key."""

from __future__ import annotations

import itertools
import re
import reprlib
import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from cfddem.errors import InputError, nearest

MOST = 20
"""No more mistakes than this are listed; who has more has another problem."""

LONGEST = 60
"""Longest value or key that is shown [characters]."""

Key = tuple[str | int, ...]


class Mistakes(InputError):
    """Several mistakes, a line each.

    each  the mistakes, every one an InputError of its own
    """

    def __init__(self, each: Sequence[InputError], untold: int = 0) -> None:
        first = each[0]
        super().__init__(first.field, first.value, first.limit, first.remedy)
        self.each = tuple(each)
        self.args = ("\n".join([*map(str, each), *([f"and {untold} more mistakes"] if untold else [])]),)


class _Words(str):
    """A text that stands without quotation marks where a value is shown."""

    def __repr__(self) -> str:
        return str(self)


def shown(value: Any) -> Any:
    """A value as a mistake shows it: itself where it is short, else what it is."""
    if isinstance(value, Mapping | BaseModel):
        return _Words("a table")
    if isinstance(value, int) and abs(value) >= 10**LONGEST:
        return _Words("a whole number of more than 60 digits")
    if isinstance(value, str | list | tuple):
        brief = reprlib.Repr()
        brief.maxstring = brief.maxother = LONGEST
        brief.maxlevel, brief.maxlist = 2, 3
        try:
            return _Words(brief.repr(value))
        except ValueError:  # whole numbers in it that are too long to print
            return _Words("a list")
    return value


def described(key: Iterable[str | int]) -> str:
    """A key as it is written: parts with dots between them."""
    text = ".".join(str(part) for part in key)
    text = text if text.isprintable() else repr(text)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


# ---------------------------------------------------------------- from what the checker says


def refused(
    complaints: ValidationError,
    model: type[BaseModel],
    values: Any,
    more: Iterable[InputError] = (),
    place: typing.Callable[[Key], str] = lambda _: "",
) -> InputError:
    """What the checker of a model complains about, as one error.

    complaints  of the checker
    model       that was to be made
    values      it was to be made of
    more        mistakes found elsewhere
    place       where a key stands, such as "bed.toml:14: "
    """
    said = _by_key(complaints, values)
    found = [(key, _one(key, several, model)) for key, several in itertools.islice(said.items(), MOST)]
    errors = []
    for key, error in [*found, *(((), error) for error in more)]:
        beyond = error.field.removeprefix(described(key)).strip(".")  # what the parts of a description say of theirs
        whole = (*key, *beyond.split(".")) if beyond else key
        errors.append(InputError(place(whole) + error.field, error.value, error.limit, error.remedy))
    untold = max(0, len(said) - MOST)
    return errors[0] if len(errors) == 1 and not untold else Mistakes(errors, untold)


def _by_key(complaints: ValidationError, values: Any) -> dict[Key, list[Any]]:
    """Complaints about the same value together; a value that may be of two kinds gives one for each."""
    found: dict[Key, list[Any]] = {}
    for each in complaints.errors(include_url=False):
        found.setdefault(_key(each["loc"], values, each["type"]), []).append(each)
    return found


def _key(place: tuple[str | int, ...], values: Any, kind: str) -> Key:
    """The key of a complaint: its place without the names of the kinds that were tried."""
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


def _one(key: Key, complaints: Sequence[Any], model: type[BaseModel]) -> InputError:
    """One mistake: field, value, limit, remedy."""
    owner, field = _owner(model, key), described(key) or model.__name__.lower()
    first = complaints[0]
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        whole = field if key and str(key[-1]) == cause.field else described((*key, cause.field))
        return InputError(whole, shown(cause.value), cause.limit, cause.remedy)
    if cause is not None:
        name, _, limit = str(cause).partition(": must be ")
        return InputError(described((*key, name)), None, limit or str(cause))
    last = str(key[-1]) if key else ""
    if first["type"] == "extra_forbidden":
        return InputError(field, shown(first["input"]), nearest(last, owner.model_fields), _home(last, owner, model))
    limits = dict.fromkeys(filter(None, (_limit(each) for each in complaints)))
    about = owner.model_fields[last].description if last in owner.model_fields else None
    value = None if limits.keys() == {"given"} else shown(first["input"])
    return InputError(field, value, " or ".join(limits) or first["msg"], f"{last} is {about}" if about else "")


_LIMITS = {
    "missing": "given",
    "finite_number": "a finite number",
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float", "int_parsing_size"), "a whole number"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    "string_type": "a text",
    "string_pattern_mismatch": "made of letters, digits, _ and -",
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "a table"),
    "callable_type": "",
    "none_required": "",
}


def _limit(complaint: Any) -> str:
    """The limit that a complaint is about, in words."""
    kind, context = complaint["type"], complaint.get("ctx", {})
    bounds = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
    for name, word in bounds.items():
        if name in context:
            return f"{word} {context[name]:g}"
    if kind == "missing" and isinstance(complaint["loc"][-1], int):
        return "a longer list"
    if kind == "literal_error":
        known = re.findall(r"'([^']*)'", str(context.get("expected", "")))
        return nearest(str(complaint["input"])[:LONGEST], known)
    if kind in ("tuple_type", "too_short", "too_long"):
        length = context.get("actual_length")
        return "a list" if length is None else f"a list of another length than {length}"
    return _LIMITS.get(kind, str(complaint["msg"]).lower())


def _owner(model: type[BaseModel], key: Key) -> type[BaseModel]:
    """The part of a description that the last word of a key belongs to."""
    for part in key[:-1]:
        if part in model.model_fields:
            model = next(iter(parts_of(model.model_fields[str(part)])), model)
    return model


def field_of(model: type[BaseModel], key: Sequence[str]) -> str | None:
    """What a description says of one of its keys."""
    owner = _owner(model, tuple(key))
    return owner.model_fields[key[-1]].description if key[-1] in owner.model_fields else None


def parts_of(field: FieldInfo) -> list[type[BaseModel]]:
    """Descriptions that stand in a field."""
    return list(_models(field.annotation))


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Descriptions that an annotation speaks of."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for each in typing.get_args(annotation):
        yield from _models(each)


def _home(word: str, owner: type[BaseModel], model: type[BaseModel]) -> str:
    """Where an unknown key belongs, if another part of the description knows it."""
    for name, field in model.model_fields.items():
        for part in parts_of(field):
            if part is not owner and word in part.model_fields:
                return f"{word} belongs to {name}"
    return ""


# ---------------------------------------------------------------- where a key stands in a file

_PART = r"(?:[\w-]+|\"[^\"\n]*\"|'[^'\n]*')"
_DOTTED = rf"{_PART}(?:[ \t]*\.[ \t]*{_PART})*"
_LINE = re.compile(rf"[ \t]*(?:\[\[?[ \t]*(?P<table>{_DOTTED})[ \t]*\]|(?P<key>{_DOTTED})[ \t]*=)")


def key_lines(text: str) -> dict[Key, int]:
    """Line of every key and table of a TOML text, as far as it begins a line."""
    lines: dict[Key, int] = {}
    table: Key = ()
    for number, line in enumerate(text.split("\n"), 1):
        found = _LINE.match(line[:1000])
        if found is None:
            continue
        parts = tuple(each.strip("\"'") for each in re.findall(_PART, found["table"] or found["key"]))
        if found["table"]:
            table = parts
        else:
            parts = (*table, *parts)
        lines.setdefault(parts, number)
    return lines


def line_of(key: Key, lines: Mapping[Key, int]) -> int | None:
    """Line of a key, or of the table that it stands in or is missing from."""
    words = tuple(part for part in key if isinstance(part, str))
    for length in range(len(words), 0, -1):
        if words[:length] in lines:
            return lines[words[:length]]
    return None
