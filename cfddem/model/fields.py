"""Declared fields: the columns of a table, each with its unit, shape, role and initial value.

A field is declared by the code that owns its physics. Sorting, inserting and removing rows, checkpoints and snapshots
are written here once, for all fields.

>>> rows = Table([Field("radius", "m"), Field("age", "s")], 3, {"radius": [1.0, 2.0, 3.0]})
>>> rows.age += 0.5
>>> rows.reorder(np.array([2, 0, 1]))
>>> rows.radius, rows.age
(array([3., 1., 2.]), array([0.5, 0.5, 0.5]))
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.backend.named import NAMES, can_be_named

Role = Literal["state", "memory", "scratch"]
"""`state` describes the row itself, `memory` is what a law stores from step to step, `scratch` is valid within a step.
Checkpoints hold state and memory, not scratch."""

Phase = Literal["start", "film", "film_change", "film_direction", "bridge", "motion", "liquid", "work", "heat"]
"""When ghost rows receive values.

In order: at the start of an advance, before the solution of films and bridges and twice within, before films are
reversed, after the drift, before new bridges fill, before work is counted, and within the exchange of heat by contacts.
"""

Initial = float | Callable[[Any, np.ndarray], np.ndarray]
"""Value in new rows: a number, or a function of the table and the new rows (k,) that returns their values."""


@dataclass(frozen=True)
class Field:
    """One column of a table.

    name        attribute of the table, name in checkpoints and snapshots
    unit        SI
    components  0 for a scalar, stored as (n,); m for a vector, stored as (n, m); a tuple for more dimensions
    role        see `Role`
    initial     value in new rows, see `Initial`; a field whose initial value is a function is declared after the fields
                that the function reads
    dtype       of the numbers
    halo        phases in which ghosts are updated, see `Phase`; empty: only copied when the ghost is made
    snapshot    whether snapshots contain the field
    meaning     long name in snapshots and tables

    >>> Field("charge", "C", meaning="electric charge").components
    0
    """

    name: str
    unit: str = "1"
    components: int | tuple[int, ...] = 0
    role: Role = "state"
    initial: Initial = 0.0
    dtype: type = float
    halo: tuple[Phase, ...] = ()
    snapshot: bool = False
    meaning: str = ""

    def __post_init__(self) -> None:
        if not can_be_named(self.name):
            raise InputError("Field.name", self.name, NAMES)
        if self.role not in ("state", "memory", "scratch"):
            raise InputError(f"role of the field {self.name!r}", self.role, "'state', 'memory' or 'scratch'")

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the values of one row."""
        if isinstance(self.components, tuple):
            return self.components
        return (self.components,) if self.components else ()

    def empty(self, count: int) -> np.ndarray:
        """Uninitialised values of `count` rows."""
        return np.empty((count, *self.shape), self.dtype)


class Table:
    """Rows with declared fields; each field is one array and an attribute of the table.

    An assignment to a field copies the values into its array: `table.age = 0.0` and `table.age += step` change the
    rows and never the array object.

    fields  of the rows
    count   number of rows
    values  values at the start; a field without values starts at its initial value
    """

    fields: dict[str, Field]
    arrays: dict[str, np.ndarray]
    rows: int

    def __init__(self, fields: Iterable[Field], count: int, values: Mapping[str, Any] | None = None) -> None:
        self._set({}, {}, count)
        for field in fields:
            self.declare(field, (values or {}).get(field.name))

    def __getattr__(self, name: str) -> np.ndarray:
        try:
            return self.__dict__["arrays"][name]  # type: ignore[no-any-return]
        except KeyError:
            raise AttributeError(f"{type(self).__name__} has no field {name!r}") from None

    def __setattr__(self, name: str, values: Any) -> None:
        if name in self.__dict__.get("arrays", ()):
            if values is not self.arrays[name]:
                self.arrays[name][...] = values
        elif name in ("fields", "arrays", "rows"):
            object.__setattr__(self, name, values)
        else:
            raise AttributeError(f"{type(self).__name__} has no field {name!r}; declare it first")

    def __getitem__(self, name: str) -> np.ndarray:
        return self.arrays[name]

    def __contains__(self, name: str) -> bool:
        return name in self.fields

    def __iter__(self) -> Iterator[np.ndarray]:
        return iter(self.arrays.values())

    def _set(self, fields: dict[str, Field], arrays: dict[str, np.ndarray], rows: int) -> None:
        self.fields, self.arrays, self.rows = fields, arrays, rows

    # ------------------------------------------------------------ declarations

    def declare(self, field: Field, values: Any = None) -> np.ndarray:
        """Add a field and return its array; a second declaration of the same field changes nothing.

        values  of all rows; the initial value of the field if None
        """
        declared = self.fields.get(field.name)
        if declared is not None and declared != field:
            raise InputError(
                f"field {field.name!r}", None, "declared once", "another declaration differs from this one"
            )
        if declared is None:
            if hasattr(type(self), field.name) or field.name in ("fields", "arrays", "rows"):
                raise InputError("Field.name", field.name, f"a name that {type(self).__name__} does not use itself")
            self.fields[field.name] = field
            self.arrays[field.name] = np.zeros((self.rows, *field.shape), field.dtype)  # no page is touched yet
            if values is not None or field.initial is not Field.initial:
                self._fill(field, values)
        return self.arrays[field.name]

    def reset(self, *names: str) -> None:
        """Set fields to their initial values in all rows."""
        for name in names:
            self._fill(self.fields[name])

    # ------------------------------------------------------------ rows

    def reorder(self, order: np.ndarray) -> None:
        """Change the order of the rows in place.

        order  old row of each new row (n,)
        """
        for array in self.arrays.values():
            array[:] = array[order]

    def append(self, fresh: Table) -> np.ndarray:
        """Add the rows of another table and return their row numbers; fields that it lacks start at initial values."""
        old, rows = self.rows, np.arange(self.rows, self.rows + fresh.rows)
        self.rows += fresh.rows
        for name, field in self.fields.items():
            joined = field.empty(self.rows)
            joined[:old] = self.arrays[name]
            self.arrays[name] = joined
            if name in fresh:
                joined[old:] = fresh[name]
        for name, field in self.fields.items():
            if name not in fresh:
                self._fill(field, rows=rows)
        return rows

    def keep(self, rows: Any) -> None:
        """Remove all rows but these.

        rows  mask (n,), row numbers (k,) or a slice
        """
        self.arrays = {name: array[rows] for name, array in self.arrays.items()}
        self.rows = len(np.arange(self.rows)[rows])

    def copy(self, rows: Any = slice(None)) -> Self:
        """A table with copies of all rows, or of some.

        rows  mask (n,) or row numbers (k,)
        """
        taken = type(self).__new__(type(self))
        arrays = {name: np.array(array[rows]) for name, array in self.arrays.items()}
        taken._set(dict(self.fields), arrays, len(np.arange(self.rows)[rows]))
        return taken

    def rows_from(self, arrays: Mapping[str, np.ndarray]) -> Self:
        """A table with fields of this one and these arrays, for rows that come from another process."""
        taken = type(self).__new__(type(self))
        taken._set({name: self.fields[name] for name in arrays}, dict(arrays), len(next(iter(arrays.values()))))
        return taken

    # ------------------------------------------------------------ checkpoints and snapshots

    def checkpoint(self) -> dict[str, np.ndarray]:
        """Copies of all fields that are not scratch."""
        return {name: array.copy() for name, array in self.lasting().items()}

    def lasting(self) -> dict[str, np.ndarray]:
        """The arrays of all fields that are not scratch, not copied."""
        return {name: self.arrays[name] for name, field in self.fields.items() if field.role != "scratch"}

    def restore(self, kept: Mapping[str, np.ndarray]) -> None:
        """Take all rows from a `checkpoint()`; scratch fields start at their initial values.

        errors  InputError where checkpoint and declarations name different fields
        """
        lasting = {name for name, field in self.fields.items() if field.role != "scratch"}
        if missing := sorted(lasting - kept.keys()):
            raise InputError(
                "checkpoint", None, f"one that holds {', '.join(missing)}", "it was written by another run"
            )
        if unknown := sorted(kept.keys() - lasting):
            names = ", ".join(unknown)
            raise InputError(
                "checkpoint", names, "fields that this run declares", f"declare {names}: Simulation(fields=...)"
            )
        self.rows = len(next(iter(kept.values()))) if kept else 0
        self.arrays = {name: field.empty(self.rows) for name, field in self.fields.items()}
        for name, field in self.fields.items():
            self._fill(field, kept.get(name))

    def snapshot(self) -> dict[str, np.ndarray]:
        """The arrays that a snapshot contains, not copied."""
        return {name: self.arrays[name] for name, field in self.fields.items() if field.snapshot}

    def _fill(self, field: Field, values: Any = None, rows: np.ndarray | None = None) -> None:
        """Give all rows of a field, or some, these values; the initial ones if None."""
        if values is None:
            values = field.initial
        if callable(values):
            values = values(self, np.arange(self.rows) if rows is None else rows)
        self.arrays[field.name][slice(None) if rows is None else rows] = values
