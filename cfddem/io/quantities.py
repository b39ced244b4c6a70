"""Quantities: the unit and the meaning of every field and column that a run writes.

A run declares its quantities once, when its folder is created: particle fields from their `Field` declarations,
columns of the history from their measures. They are kept in `run.json` and on every dataset.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, Protocol

from cfddem.backend.errors import InputError


class Quantity(NamedTuple):
    """Unit and meaning of a recorded number."""

    unit: str
    meaning: str
    group: str = ""  # of a history column: how the report shows it


Quantities = Mapping[str, Mapping[str, Quantity]]
"""Block (`fluid`, `particles`, `collisions` or `history`) -> name -> quantity."""

TIME = Quantity("s", "simulated time")


class Declaration(Protocol):
    """A declared field of particles, pairs or cells."""

    @property
    def name(self) -> str:
        """Name in files."""

    @property
    def unit(self) -> str:
        """SI."""

    @property
    def meaning(self) -> str:
        """Long name; may be empty."""


def of_fields(fields: Iterable[Declaration]) -> dict[str, Quantity]:
    """The quantities of declared fields, by name.

    >>> from cfddem.model.fields import Field
    >>> of_fields([Field("radius", "m", meaning="radius")])
    {'radius': Quantity(unit='m', meaning='radius', group='')}
    """
    return {field.name: Quantity(field.unit, field.meaning or field.name.replace("_", " ")) for field in fields}


def of_function(function: Callable[..., Any], unit: str, group: str) -> Quantity:
    """The quantity that a measure gives; its meaning is the first line of the function's docstring."""
    meaning = (inspect.getdoc(function) or function.__name__.replace("_", " ")).split("\n")[0].rstrip(".")
    return Quantity(unit, meaning[:1].lower() + meaning[1:], group)


def from_json(blocks: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Quantity]]:
    """The quantities of a run as `run.json` holds them."""
    return {
        block: {name: Quantity(*properties) for name, properties in names.items()} for block, names in blocks.items()
    }


def declared(quantities: Quantities, block: str, name: str) -> Quantity:
    """The quantity of a field or column.

    errors  InputError if the run does not declare it
    """
    try:
        return quantities[block][name]
    except KeyError:
        raise InputError(
            f"{block}.{name}", None, "declared with its unit and meaning", "add it to the quantities of the run"
        ) from None


def shown_unit(unit: str) -> str:
    """A unit as axes, tables and reports show it: `-` for a plain number.

    >>> shown_unit("1"), shown_unit("m/s")
    ('-', 'm/s')
    """
    return "-" if unit == "1" else unit
