"""Commands made from the functions of the scenarios: their options are the arguments of the function."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from cyclopts import Parameter

from cfddem.cli.json_output import print_json
from cfddem.cli.printing import announce_compilation, show

SIMPLE = (float, int, bool, str)
"""Types that a command line can give."""

JSON = inspect.Parameter(
    "json",
    inspect.Parameter.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, Parameter(help="print the result as JSON", negative="")],
)


def command(
    function: Callable[..., Any],
    schema: str | Callable[[Any], str],
    *,
    units: Mapping[str, str] | None = None,
    options: Mapping[str, tuple[Any, Any, str]] | None = None,
    call: Callable[..., Any] | None = None,
    show_result: Callable[[Any], None] | None = None,
) -> Callable[..., None]:
    """Make a command that calls a function and prints the summary of its result.

    Arguments of the function that a command line can give become options, with their defaults; the help of each is its
    line in the docstring. Other arguments keep their defaults.

    function     returns a result that has a method `summary`
    units        of the printed values, by name
    options      further options, or replacements: name -> (type, default, help)
    call         takes all options and returns the result; the function itself if not given
    show_result  prints the result as text; prints the summary if not given
    schema       name of that of the summary in :data:`cfddem.cli.json_output.SCHEMAS`, or a function of the result
    """
    lines = descriptions(function)
    parameters: dict[str, inspect.Parameter] = {}
    for name, parameter in inspect.signature(function, eval_str=True).parameters.items():
        kind = _simple(parameter.annotation)
        if kind is not None and parameter.default is not inspect.Parameter.empty:
            parameters[name] = _option(name, kind, parameter.default, lines.get(name, ""))
    for name, (kind, default, text) in (options or {}).items():
        parameters[name] = _option(name, kind, default, text)

    defaults = {name: option.default for name, option in parameters.items()}

    def run(**arguments: Any) -> None:
        as_json = arguments.pop("json", False)
        if not as_json:
            announce_compilation()
        result = (call or function)(**defaults | arguments)
        if as_json:
            print_json(schema if isinstance(schema, str) else schema(result), result.summary())
        elif show_result is None:
            show(result.summary(), dict(units or {}))
        else:
            show_result(result)

    run.__signature__ = inspect.Signature([*parameters.values(), JSON])  # type: ignore[attr-defined]
    return run


def descriptions(function: Callable[..., Any]) -> dict[str, str]:
    """Description of each argument, from the docstring; arguments on one line share it.

    >>> def area(width: float, height: float) -> float:
    ...     '''Area of a rectangle.
    ...
    ...     width, height  of one side,
    ...                    without the rim [m]
    ...     returns        [m2]
    ...     '''
    >>> descriptions(area)["height"]
    'of one side, without the rim [m]'
    """
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in (inspect.getdoc(function) or "").splitlines():
        if match := re.fullmatch(r"(\w+(?:, \w+)*) {2,}(\S.*)", line):
            names = match[1].split(", ")
            texts |= dict.fromkeys(names, match[2])
        elif names and line.startswith("  "):
            texts |= dict.fromkeys(names, f"{texts[names[0]]} {line.strip()}")
        else:
            names = []
    return texts


def _simple(annotation: Any) -> Any:
    """The part of an annotation that a command line can give; None where there is none."""
    parts = get_args(annotation) if get_origin(annotation) in (UnionType, Union) else (annotation,)
    words = [str if get_origin(part) is Literal else part for part in parts]  # refused by name, as other values are
    kept = [part for part in words if part in SIMPLE]
    if not kept:
        return None
    return kept[0] | None if type(None) in parts else kept[0]


def _option(name: str, kind: Any, default: Any, text: str) -> inspect.Parameter:
    parameter = Parameter(help=text, negative="") if kind is bool else Parameter(help=text)
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, parameter]
    )
