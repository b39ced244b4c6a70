"""Errors that say what, where, the number, its limit, and the remedy, in one or two lines."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

MANY = 10
"""More known words than this are not all told where one of them is near [-]."""


class CfddemError(Exception):
    """Any failure that the user can do something about; never shown as a traceback by the command line."""

    exit_code = 1


class InputError(CfddemError, ValueError):
    """A value that a run cannot start from."""

    exit_code = 2

    def __init__(self, field: str, value: Any, limit: str, remedy: str = "") -> None:
        self.field, self.value, self.limit, self.remedy = field, value, limit, remedy
        shown = f" = {value!r}" if value is not None else ""
        super().__init__(f"{field}{shown}: must be {limit}" + (f"; {remedy}" if remedy else ""))


class UnstableStep(CfddemError):
    """A time step that the chosen physics cannot follow."""

    exit_code = 2

    def __init__(self, step: float, limit: float, clock: str, remedy: str) -> None:
        super().__init__(f"time step {step:.3g} s is above the stability limit {limit:.3g} s of the {clock}; {remedy}")


class RunFailed(CfddemError):
    """A run that cannot go on: a number that is no number, a particle that is lost."""

    exit_code = 3


class RunStopped(CfddemError):
    """A run that was asked to stop, and did so where it can go on; ends as a shell expects of a signal."""

    def __init__(self, message: str, signal_number: int) -> None:
        self.exit_code = 128 + signal_number
        super().__init__(message)


def nearest(word: str, known: Iterable[str]) -> str:
    """The limit to state for an unknown word: the known ones, or the nearest of many, and the very nearest.

    >>> nearest("restituton", ["friction", "restitution"])
    "one of friction, restitution (did you mean 'restitution'?)"
    """
    words = list(known)
    close = get_close_matches(word, words, n=3)
    shown = words if len(words) <= (MANY if close else 2 * MANY) else close or words[:MANY]
    more = f" and {len(words) - len(shown)} more" if len(shown) < len(words) else ""
    return f"one of {', '.join(shown)}{more}" + (f" (did you mean {close[0]!r}?)" if close else "")
