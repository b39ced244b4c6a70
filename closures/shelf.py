"""The whole shelf: every law of this package, and the laws that installed packages offer.

A package offers laws by an entry point of the group `cfddem.closures` that names a module; importing the module
puts its functions that are decorated with @closures.law(...) on the shelf.
"""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points

import closures
from closures.law import SHELF

__all__ = ["GROUP", "SHELF", "fill", "fill_from_packages"]

GROUP = "cfddem.closures"
"""Group of entry points by which an installed package offers laws."""

_MACHINERY = ("check", "compiled", "law", "shelf")


@cache
def fill() -> None:
    """Put all laws of this package on the shelf; compiles nothing and does not load the compiler.

    >>> fill()
    >>> "di_felice" in SHELF["drag"], "asperities" in SHELF["minimum_gap"]
    (True, True)
    """
    for module in pkgutil.iter_modules(closures.__path__):
        if module.name not in _MACHINERY:
            import_module(f"closures.{module.name}")


@cache
def fill_from_packages() -> dict[str, str]:
    """Put the laws of installed packages on the shelf.

    returns  {entry point: what went wrong} of those that could not be loaded
    """
    failures = {}
    for point in entry_points(group=GROUP):
        try:
            point.load()
        except Exception as failure:
            failures[point.name] = f"{type(failure).__name__}: {failure}"
    return failures
