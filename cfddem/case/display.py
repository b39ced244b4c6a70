"""How a case looks in a notebook: its keys that differ from the defaults, with values and meanings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from cfddem.backend.errors import shown
from cfddem.backend.html import table


def model_html(model: BaseModel) -> str:
    """A table of a case, or a part of it, as HTML."""
    return table(getattr(model, "title", "") or type(model).__name__, _rows(model, ""))


def _rows(model: BaseModel, before: str) -> Iterator[tuple[str, str, str]]:
    """Key, value and meaning of every key that differs from its default."""
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if name == "title" or value is None or (not field.is_required() and value == field.get_default()):
            continue
        inner = list(_parts(value, f"{before}{name}"))
        for key, part in inner:
            yield from _rows(part, f"{key}.")
        if not inner:
            yield f"{before}{name}", _text(value), field.description or ""


def _parts(value: Any, key: str) -> Iterator[tuple[str, BaseModel]]:
    """The tables in a value, each with its key."""
    if isinstance(value, BaseModel):
        yield key, value
    elif isinstance(value, Mapping):
        yield from ((f"{key}.{name}", each) for name, each in value.items() if isinstance(each, BaseModel))
    elif isinstance(value, tuple):
        yield from ((f"{key}[{k}]", each) for k, each in enumerate(value) if isinstance(each, BaseModel))


def _text(value: Any) -> str:
    if callable(value):
        return str(getattr(value, "__name__", "user-defined law"))
    return f"{value:g}" if isinstance(value, float) else str(shown(value))
