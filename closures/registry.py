"""Registry of laws: kind, source and fitted range of every law.

A law is a plain Python function; call it, plot it or differentiate it like any other. Compiled loops call the same
function by its name; :mod:`closures.compiled` makes that possible.
"""

from __future__ import annotations

import pkgutil
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from inspect import getdoc, signature
from pathlib import Path
from typing import Any, TypeVar

from closures.kinds import BUILT_IN

Function = TypeVar("Function", bound=Callable[..., float])


@dataclass(frozen=True)
class Law:
    """Entry of a law in the registry: its function and metadata."""

    name: str
    kind: str
    reference: str
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    function: Callable[..., float] = field(repr=False, default=lambda: 0.0)

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of the arguments of the function."""
        return tuple(signature(self.function).parameters)

    def outside(self, **arguments: float) -> list[str]:
        """Names of the arguments outside their range."""
        return [name for name, (low, high) in self.ranges.items() if not low <= arguments[name] <= high]

    def _repr_markdown_(self) -> str:
        """The law in a notebook: sentence, equation, arguments, range, source."""
        text = getdoc(self.function) or ""
        equation = re.search(r"\.\. math:: (.*?)\n\n", text + "\n\n", re.DOTALL)
        parts = [f"**{self.name}** ({self.kind.replace('_', ' ')}): {' '.join(text.split(chr(10) * 2)[0].split())}"]
        parts += [f"$${' '.join(equation[1].split())}$$"] if equation else []
        parts += [f"Arguments: {', '.join(f'`{name}`' for name in self.arguments)}"]
        parts += [f"Range: {self.range_in_words}"] if self.ranges else []
        return "\n\n".join([*parts, f"Source: {self.reference}"])

    @property
    def range_in_words(self) -> str:
        """The ranges as text: `reynolds 0.01 to 300, voidage 0.5 to 0.9`."""
        return ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in self.ranges.items())


REGISTRY: dict[str, dict[str, Law]] = {}
"""All laws that have been imported, by kind and name."""

WHEN_REGISTERED: list[Callable[[Callable[..., float]], None]] = []
"""Called with the function of each new law; :mod:`closures.compiled` lets loops call it."""


def law(kind: str, reference: str, **ranges: tuple[float, float]) -> Callable[[Function], Function]:
    """Decorator: register a scalar function as a law and let compiled loops call it.

    kind       "drag", "minimum_gap", "lubrication" ...
    reference  source of the equation: authors, journal, DOI, equation number
    ranges     argument=(low, high) for which the law was derived or fitted
    returns    the function, unchanged
    errors     ValueError, in one line, for a user's law with the name of a built-in law, an unknown kind, or an
               impossible range
    """

    def register(function: Function) -> Function:
        entry = Law(function.__name__, kind, reference, dict(ranges), function)
        if not is_built_in(function):
            _refuse_impossible(entry)
        REGISTRY.setdefault(kind, {})[function.__name__] = entry
        for call in WHEN_REGISTERED:
            call(function)
        return function

    return register


def is_built_in(function: Callable[..., float]) -> bool:
    """Whether a law belongs to this package.

    >>> from closures.minimum_gap import elastohydrodynamic
    >>> is_built_in(elastohydrodynamic)
    True
    """
    return function.__module__.startswith("closures.")


def _refuse_impossible(entry: Law) -> None:
    """Refuse a user's law whose name is taken, whose kind is unknown, or with a range that is none."""
    load_built_in_laws()
    if entry.kind not in REGISTRY:
        kinds = f"{', '.join(BUILT_IN)}, or another kind that `cfddem explain` lists"
        raise ValueError(f"{entry.name}: kind = {entry.kind!r}: must be one of {kinds}")
    earlier = REGISTRY[entry.kind].get(entry.name)
    if earlier is not None and is_built_in(earlier.function):
        module = earlier.function.__module__
        raise ValueError(f"{entry.name} is built in ({module}); choose another name")
    if entry.name in BUILT_IN.get(entry.kind, ()):
        raise ValueError(f"{entry.name} has another meaning in laws.{entry.kind}; choose another name")
    for name, limits in entry.ranges.items():
        if name not in entry.arguments:
            taken = ", ".join(entry.arguments)
            raise ValueError(f"{entry.name}: range of {name}: must be of an argument of the law, one of {taken}")
        if not _is_range(limits):
            raise ValueError(f"{entry.name}: {name} = {limits!r}: must be a pair of numbers (low, high), low < high")


def _is_range(limits: Any) -> bool:
    pair = (
        isinstance(limits, tuple | list)
        and len(limits) == 2
        and all(isinstance(limit, int | float) for limit in limits)
    )
    return pair and bool(limits[0] < limits[1])


def law_of(function: Callable[..., float]) -> Law:
    """The registry entry of a function. Raises KeyError for a function that is not registered.

    >>> from closures.minimum_gap import elastohydrodynamic
    >>> law_of(elastohydrodynamic).kind
    'minimum_gap'
    """
    for laws in REGISTRY.values():
        for entry in laws.values():
            if entry.function is function:
                return entry
    name = repr(getattr(function, "__name__", function))
    raise KeyError(f"{name} is not a registered law; decorate it with @closures.law(kind, reference, ...)")


GROUP = "cfddem.closures"
"""Group of entry points through which an installed package provides laws."""

_WITHOUT_LAWS = ("check", "compiled", "kinds", "linked", "registry")


@cache
def load_built_in_laws() -> None:
    """Import all modules of this package, so that the registry holds their laws. Does not import numba.

    >>> load_built_in_laws()
    >>> "di_felice" in REGISTRY["drag"], "asperities" in REGISTRY["minimum_gap"]
    (True, True)
    """
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        if module.name not in _WITHOUT_LAWS:
            import_module(f"closures.{module.name}")


@cache
def load_package_laws() -> dict[str, str]:
    """Import the laws that installed packages provide through entry points.

    returns  {entry point: error} for those that could not be imported
    """
    failures = {}
    for point in entry_points(group=GROUP):
        try:
            point.load()
        except Exception as failure:
            failures[point.name] = f"{type(failure).__name__}: {failure}"
    return failures
