"""Tables of a case that features own: the schema finds them, and names none of them.

A feature writes its keys as a class in a file `cfddem/features/NAME_keys.py`, next to its own file. `Case` then has the
table: it is read, checked, written and explained like any other.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, TypeVar

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from cfddem.case.materials import Checked

ROOM = Path(__file__).parents[1] / "features"

Model = TypeVar("Model", bound=BaseModel)


class FeatureTable(Checked):
    """A table of a case that a feature owns.

    table    its name in the case
    meaning  one line on what it does
    """

    table: ClassVar[str]
    meaning: ClassVar[str]

    @classmethod
    def of(cls, case: Any) -> Self | None:
        """The table of a case; None if the case has none."""
        return getattr(case, cls.table)  # type: ignore[no-any-return]

    def refuse(self, case: Any) -> None:
        """Raise InputError where the table does not go with the rest of a case."""

    def issues(self, case: Any) -> Iterator[tuple[Literal["note", "warning", "error"], str, str, str]]:
        """Severity, key, reason and remedy of each issue that `check` tells."""
        return iter(())


def feature_tables() -> list[type[FeatureTable]]:
    """All tables that features own, by the names of their files."""
    for each in sorted(pkgutil.iter_modules([str(ROOM)]), key=lambda each: each.name):
        if each.name.endswith("_keys"):
            importlib.import_module(f"cfddem.features.{each.name}")
    return FeatureTable.__subclasses__()


def with_feature_tables(case: type[Model]) -> type[Model]:
    """Decorator: give the schema of a case the tables that features own."""
    for each in feature_tables():
        case.__annotations__[each.table] = each | None
        case.__pydantic_fields__[each.table] = FieldInfo(
            annotation=each | None,  # type: ignore[arg-type]
            default=None,
            description=each.meaning,
        )
    case.model_rebuild(force=True)
    return case
