"""What makes a function a law: its kind, its range, its source, and its two faces.

The plain face is the function itself: call it, plot it, differentiate it. The compiled face is the same
source, called by the same name inside a compiled loop; :mod:`closures.compiled` tells the compiler how.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

Function = TypeVar("Function", bound=Callable[..., float])


@dataclass(frozen=True)
class Law:
    """The card of a law: everything about it that is not its equation."""

    name: str
    kind: str
    reference: str
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    function: Callable[..., float] = field(repr=False, default=lambda: 0.0)

    def outside(self, **arguments: float) -> list[str]:
        """Names of the arguments that lie outside the range the law was fitted to."""
        return [name for name, (low, high) in self.ranges.items() if not low <= arguments[name] <= high]

    @property
    def fitted_for(self) -> str:
        """The range the law was fitted to, in words: `reynolds 0.01 to 300, voidage 0.5 to 0.9`."""
        return ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in self.ranges.items())


SHELF: dict[str, dict[str, Law]] = {}
"""All laws by kind and name."""


def law(kind: str, reference: str, **ranges: tuple[float, float]) -> Callable[[Function], Function]:
    """Put a scalar function on the shelf and make it callable from compiled loops.

    kind       chapter it belongs to: "drag", "minimum_gap", "lubrication" ...
    reference  where the equation stands: authors, journal, DOI, equation number
    ranges     argument=(low, high) within which the law was derived or fitted
    returns    the function itself, unchanged
    """

    def shelve(function: Function) -> Function:
        card = Law(function.__name__, kind, reference, dict(ranges), function)
        SHELF.setdefault(kind, {})[function.__name__] = card
        compiled = sys.modules.get("closures.compiled")
        if compiled is not None:
            compiled.expose(function)
        return function

    return shelve


def page(function: Callable[..., float]) -> Law:
    """The card of a law.

    >>> from closures.minimum_gap import elastohydrodynamic
    >>> page(elastohydrodynamic).kind
    'minimum_gap'
    """
    for laws in SHELF.values():
        for card in laws.values():
            if card.function is function:
                return card
    raise KeyError(f"{getattr(function, '__name__', function)!r} is no law; decorate it with @closures.law(...)")
