"""Tables of a case that features own: the schema finds them, and names none of them.

A feature writes its keys as a class in a file `cfddem/features/NAME_keys.py`, next to its own file; a user writes such
a class in a script. `Case` then has the table: it is read, checked, written and explained like any other.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, TypeVar

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from cfddem.backend.errors import InputError
from cfddem.case.materials import Checked

ROOM = Path(__file__).parents[1] / "features"

Model = TypeVar("Model", bound=BaseModel)

Findings = Iterator[tuple[Literal["note", "warning", "error"], str, str, str]]
"""Severity, key, reason and remedy of each issue that `check` tells."""

Numbers = Iterator[tuple[str, str, float, str, str]]
"""Group, name, value, unit and note of each number that `check` tells."""


class FeatureTable(Checked):
    """A table of a case that a feature or a user owns; cases have it as soon as the class is there.

    table        its name in the case
    meaning      one line on what it does
    one_process  whether several processes cannot share a case with it
    """

    table: ClassVar[str]
    meaning: ClassVar[str]
    one_process: ClassVar[bool] = False

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        for case in _CASES:
            if cls.table in case.model_fields and cls.table not in _OWNED:
                raise InputError("table", cls.table, "a name that no table or key of a case has")
            _add(case, cls)

    @classmethod
    def of(cls, case: Any) -> Self | None:
        """The table of a case; None if the case has none."""
        return getattr(case, cls.table, None)  # type: ignore[no-any-return]  # a case may be older than the table

    @property
    def holds_particles(self) -> bool:
        """Whether particles do not move, so that no step is theirs."""
        return False

    def refuse(self, case: Any) -> None:
        """Raise InputError where the table does not go with the rest of a case."""

    def issues(self, case: Any) -> Findings:
        """Severity, key, reason and remedy of each issue that `check` tells."""
        return iter(())

    def numbers(self, case: Any, bed: Any) -> Numbers:
        """Group, name, value, unit and note of each number that `check` tells; bed is its estimate of the bed."""
        return iter(())

    def issues_of_bed(self, case: Any, bed: Any) -> Findings:
        """Issues as of `issues`, which need the estimate of the bed."""
        return iter(())


def feature_tables() -> list[type[FeatureTable]]:
    """All tables that features own, by the names of their files."""
    for module in sorted(pkgutil.iter_modules([str(ROOM)]), key=lambda module: module.name):
        if module.name.endswith("_keys"):
            importlib.import_module(f"cfddem.features.{module.name}")
    return FeatureTable.__subclasses__()


_CASES: list[type[BaseModel]] = []
_OWNED: set[str] = set()
"""Schemas that have the tables, and names of the tables."""


def with_feature_tables(case: type[Model]) -> type[Model]:
    """Decorator: give the schema of a case the tables that features own."""
    for table in feature_tables():
        _add(case, table)
    _CASES.append(case)
    return case


def _add(case: type[BaseModel], table: type[FeatureTable]) -> None:
    """Give a schema a table; a class of the same name, as in a cell of a notebook that runs again, is replaced."""
    _OWNED.add(table.table)
    case.__annotations__[table.table] = table | None
    case.__pydantic_fields__[table.table] = FieldInfo(
        annotation=table | None,  # type: ignore[arg-type]
        default=None,
        description=table.meaning,
    )
    case.model_rebuild(force=True)


def rebuild_cases() -> None:
    """Let the schemas know new keys of their tables."""
    for case in _CASES:
        case.model_rebuild(force=True)


def forget_table(name: str) -> None:
    """Remove a user's table from all cases."""
    _OWNED.remove(name)
    for case in _CASES:
        del case.__annotations__[name], case.__pydantic_fields__[name]
        case.model_rebuild(force=True)
