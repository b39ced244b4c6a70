"""Errors that say what, where, the number, its limit, and the remedy, in one or two lines; missing packages."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from importlib import import_module
from typing import Any

MANY = 10
"""Largest number of known words that a message lists if one of them is similar."""


ALIKE = 0.61
"""Least likeness of a word to a known one that is named as the one that was meant, of difflib; 1 for the same word."""

LONGEST = 60
"""Longest value or key that is shown [characters]."""


class CfddemError(Exception):
    """A failure that the user can resolve; the command line shows it without a traceback."""

    exit_code = 1


class InputError(CfddemError, ValueError):
    """An invalid input value."""

    exit_code = 2

    def __init__(self, field: str, value: Any, limit: str, remedy: str = "") -> None:
        self.field, self.value, self.limit, self.remedy = field, value, limit, remedy
        shown = f" = {value!r}" if value is not None else ""
        super().__init__(f"{field}{shown}: must be {limit}" + (f"; {remedy}" if remedy else ""))


class UnstableStep(CfddemError):
    """A time step above the stability limit."""

    exit_code = 2

    def __init__(self, step: float, limit: float, criterion: str, remedy: str) -> None:
        super().__init__(
            f"time step {step:.3g} s is above the stability limit {limit:.3g} s of the {criterion}; {remedy}"
        )


class RunFailed(CfddemError):
    """A run that cannot continue: a value is NaN, or a particle is lost."""

    exit_code = 3


class RunStopped(CfddemError):
    """A run that was stopped by a signal and can be resumed; the exit code is that of the signal."""

    def __init__(self, message: str, signal_number: int) -> None:
        self.exit_code = 128 + signal_number
        super().__init__(message)


def failure_elsewhere(message: str, exit_code: int) -> CfddemError:
    """The failure of another process, with its message and exit code."""
    failure = CfddemError(message)
    failure.exit_code = exit_code
    return failure


def nearest(word: str, allowed: Iterable[str]) -> str:
    """The limit to state for an unknown word: all known words, or the nearest of many, and the one that was meant.

    >>> nearest("restituton", ["friction", "restitution"])
    "one of friction, restitution (did you mean 'restitution'?)"
    >>> nearest("DiFeliceDrag", ["di_felice", "gidaspow"])
    "one of di_felice, gidaspow (did you mean 'di_felice'?)"
    """
    words = list(allowed)
    close = get_close_matches(word, words, 3, ALIKE) or get_close_matches(_plain_name(word), words, 3, ALIKE)
    few = len(words) <= (MANY if close else 2 * MANY)
    shown = words if few else close or get_close_matches(_plain_name(word), words, 2, 0.0)
    more = f" and {len(words) - len(shown)} more" if len(shown) < len(words) else ""
    return f"one of {', '.join(shown)}{more}" + (f" (did you mean {close[0]!r}?)" if close else "")


def _plain_name(word: str) -> str:
    """The name of a class of another code as this one would write it: DiFeliceDrag is di_felice."""
    return re.sub(r"_(drag|force|model|law)$", "", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", word).lower())


class _Words(str):
    """A text that is shown without quotation marks."""

    def __repr__(self) -> str:
        return str(self)


def shown(value: Any) -> Any:
    """A value as an error message shows it: itself if it is short, else what it is."""
    if isinstance(value, Mapping) or hasattr(value, "model_fields"):
        return _Words("a table")
    if isinstance(value, int) and abs(value) >= 10**LONGEST:
        return _Words("a whole number of more than 60 digits")
    if isinstance(value, str | list | tuple):
        brief = reprlib.Repr()
        brief.maxstring = brief.maxother = LONGEST
        brief.maxlevel, brief.maxlist = 2, 3
        try:
            return _Words(brief.repr(value))
        except ValueError:  # whole numbers in it that are too long to print
            return _Words("a list")
    return value


# ---------------------------------------------------------------- packages of extras


def library(name: str, user: str, extra: str) -> Any:
    """A package that may be missing.

    name    of the package
    user    what needs it
    extra   of `cfddem` that installs it
    errors  InputError with the command that installs it
    """
    try:
        return import_module(name)
    except ImportError:
        raise InputError(user, None, f"used with {name} installed", f"`pip install 'cfddem[{extra}]'`") from None
