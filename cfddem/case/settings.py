"""Functions with many arguments: one table of settings, declared and checked as the tables of a case are."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, ClassVar, TypeVar

from cfddem.case.materials import Checked

Result = TypeVar("Result")


class Settings(Checked):
    """Arguments of a function. Each has a type, a default, limits, and a description with its unit.

    by_place  how many of them a call may give without their names
    """

    by_place: ClassVar[int] = 0


def takes(kind: type[Settings]) -> Callable[[Callable[[Any], Result]], Callable[..., Result]]:
    """Let a function of settings be called with their values; its signature and docstring list them.

    kind     of the settings
    returns  decorator; the function raises InputError for a value beyond its limits

    >>> from pydantic import Field
    >>> class Fall(Settings):
    ...     height: float = Field(1.0, gt=0, description="of the fall [m]")
    >>> @takes(Fall)
    ... def speed(fall):
    ...     '''Speed after a fall.'''
    ...     return (2.0 * 9.81 * fall.height) ** 0.5
    >>> round(speed(height=2.0), 2), str(inspect.signature(speed))
    (6.26, '(*, height: float = 1.0)')
    """
    places = [inspect.Parameter.POSITIONAL_OR_KEYWORD] * kind.by_place
    names, wide = list(kind.model_fields), max(map(len, kind.model_fields))
    parameters = [
        inspect.Parameter(
            name,
            place,
            default=inspect.Parameter.empty if field.is_required() else field.default,
            annotation=field.annotation,
        )
        for (name, field), place in zip(
            kind.model_fields.items(), places + [inspect.Parameter.KEYWORD_ONLY] * (len(names) - len(places))
        )
    ]
    lines = [f"{name:<{wide}}  {field.description}" for name, field in kind.model_fields.items()]

    def decorate(function: Callable[[Any], Result]) -> Callable[..., Result]:
        own = inspect.signature(function)

        @wraps(function)
        def call(*arguments: Any, **values: Any) -> Result:
            if len(arguments) > kind.by_place:
                raise TypeError(
                    f"{function.__name__}() takes {kind.by_place} positional arguments, {len(arguments)} given"
                )
            twice = set(names[: len(arguments)]) & set(values)
            if twice:
                raise TypeError(f"{function.__name__}() got multiple values for argument {min(twice)!r}")
            return function(kind(**dict(zip(names, arguments)), **values))

        call.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        head, gap, rest = (inspect.getdoc(function) or "").partition("\n\n")
        call.__doc__ = "\n\n".join([head, "\n".join(lines)] + [rest] * bool(gap))
        return call

    return decorate
