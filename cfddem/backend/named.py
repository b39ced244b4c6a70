"""Classes of named tuples whose members are known when a run begins: arrays and numbers that loops read by names."""

from __future__ import annotations

from collections import namedtuple
from functools import cache
from typing import Any

NAMES = "a Python name without a leading or double underscore"
"""What a member of a structure may be called."""


def can_be_named(name: str) -> bool:
    """Whether a member of a structure may have this name."""
    return name.isidentifier() and not name.startswith("_") and "__" not in name


@cache
def named_arrays(kind: str, names: tuple[str, ...]) -> Any:
    """A class of named tuples with these members.

    kind  what they are; the name of the class consists of it and the names of the members, see `__getattr__`
    """
    structure = namedtuple("__".join((kind, *names)), names)  # type: ignore[misc]
    structure.__module__ = __name__
    return globals().setdefault(structure.__name__, structure)


def __getattr__(name: str) -> Any:
    """A class of `named_arrays` by its name, for loops that the compile cache has kept from another process."""
    kind, *names = name.split("__")
    if kind not in ("Memory", "Numbers", "Particles"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return named_arrays(kind, tuple(names))
