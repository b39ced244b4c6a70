"""Laws chosen by the user: by name from the registry or an installed package, or as a function."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from functools import wraps

from cfddem.backend.errors import InputError, nearest, shown
from closures import registry
from closures.kinds import ARGUMENTS, BUILT_IN, DRAG_ARGUMENTS, arguments_of
from closures.registry import Law, is_built_in, law_of

OF_THE_PAIR_LOOP = ("minimum_gap", "lubrication")
"""Kinds of law that the pair loop calls."""


def chosen(kind: str, law: str | Callable[..., float]) -> Law:
    """Registry entry of a law chosen by its name or passed as a function.

    kind  a key of `BUILT_IN`
    """
    entry = _named(kind, law) if isinstance(law, str) else _user_defined(kind, law)
    if not _can_be_called(kind, entry):
        loop = "pair loop" if kind in OF_THE_PAIR_LOOP else "coupling"
        raise InputError(kind, entry.name, f"a law of kind {kind!r} that the {loop} can call", arguments_of(kind))
    return entry


def _can_be_called(kind: str, entry: Law) -> bool:
    """Whether the caller of laws of this kind has all arguments that this one takes."""
    if kind not in ARGUMENTS:
        return True
    may, must = ARGUMENTS[kind]
    return entry.kind == kind and set(must) <= set(inspect.signature(entry.function).parameters) <= set(may)


def called_by_name(law: Callable[..., float], names: Sequence[str], numbers: Sequence[float]) -> float:
    """Value of a law that takes some of these arguments, in any order."""
    values = dict(zip(names, numbers))
    return law(**{name: values[name] for name in inspect.signature(law).parameters})


class NotInstalled(str):
    """Name of a law in the case of a finished run that this machine does not have."""


def drag_by_name(law: Law, diameter_ratio: float = 1.0) -> Callable[[float, float], float]:
    """A drag law as a function of Reynolds number and voidage, whatever the order of its arguments.

    diameter_ratio  diameter over the Sauter mean diameter, for laws that use it [-]
    returns         function; it raises InputError where a user's law fails or is not finite
    """
    if is_built_in(law.function) and law.arguments == DRAG_ARGUMENTS[:2]:
        return law.function

    @wraps(law.function)
    def factor(reynolds: float, voidage: float) -> float:
        try:
            value = called_by_name(law.function, DRAG_ARGUMENTS, (reynolds, voidage, diameter_ratio))
        except (ArithmeticError, ValueError, TypeError) as failure:
            if is_built_in(law.function):
                raise
            raise _not_finite(law, f"it fails ({failure})", reynolds, voidage) from None
        if math.isfinite(reynolds) and not math.isfinite(value) and not is_built_in(law.function):
            raise _not_finite(law, f"it is {value:g}", reynolds, voidage)
        return value

    return factor


def _not_finite(law: Law, result: str, reynolds: float, voidage: float) -> InputError:
    remedy = f"{result} at Re = {reynolds:.3g}, voidage = {voidage:.3g}"
    return InputError("laws.drag", law.name, "a law that is finite in the bed and beside it", remedy)


def _named(kind: str, name: str) -> Law:
    registry.load_built_in_laws()
    laws = registry.REGISTRY[kind]
    failures = {} if name in laws else registry.load_package_laws()
    if name not in laws:
        choices = [*BUILT_IN[kind], *(law.name for law in laws.values() if _can_be_called(kind, law))]
        remedy = "cfddem explain lists all laws; name the file of one of your own with --laws FILE.py"
        lost = [f"the package {package} could not be loaded: {reason}" for package, reason in failures.items()]
        remedy = "; ".join([remedy, *lost])
        raise InputError(kind, shown(name), nearest(name, dict.fromkeys(choices)), remedy)
    return laws[name]


def _user_defined(kind: str, function: Callable[..., float]) -> Law:
    try:
        return law_of(function)
    except KeyError as failure:
        raise InputError(f"laws.{kind}", None, "a law", str(failure.args[0])) from None
