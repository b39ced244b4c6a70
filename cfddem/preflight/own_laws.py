"""Checks of the user's laws in a case: what `closures.check` finds, and packages that could not be loaded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache

from cfddem.case.schema import Case
from cfddem.preflight.issue import Issue
from closures import registry
from closures.check import check

FATAL = ("fails", "cannot be compiled", "takes", "does not take", "is nan", "is inf", "is -inf", "is not")
"""How problems begin with which a law cannot be used in a run."""


def check_own_laws(case: Case) -> Iterator[Issue]:
    """Check the laws of a case that are not built in against the requirements of their kinds."""
    for kind, law in case.laws.own_laws.items():
        for problem in _problems(law.function):
            fatal = problem.startswith(FATAL) or "must be positive" in problem
            remedy = "correct it, or state the range for which it holds" if fatal else "see closures.check"
            yield Issue("error" if fatal else "warning", f"laws.{kind}", f"{law.name} {problem}", remedy)
    for name, reason in registry.load_package_laws().items():
        yield Issue("warning", "laws", f"the package {name} could not be loaded: {reason}", "correct or remove it")


@lru_cache(maxsize=64)
def _problems(law: Callable[..., float]) -> tuple[str, ...]:
    """What the check finds; a law is compiled once for it."""
    return tuple(check(law))
