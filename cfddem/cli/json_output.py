"""What commands print with `--json`: one object, whose `schema` names its form and the number of its version.

The number rises when a name goes or gets another meaning; new names may come without. Units are SI.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any

from cfddem.backend.errors import CfddemError, InputError, nearest
from cfddem.backend.json_text import as_json
from cfddem.cli.json_forms import SCHEMAS, Mistake, form


def word(name: str) -> str:
    """The value of `schema` in an object.

    >>> word("check")
    'cfddem/check/1'
    """
    return f"cfddem/{name}/{SCHEMAS[name][0]}"


def json_schema(name: str) -> dict[str, Any]:
    """The JSON schema of what commands print with `--json`.

    errors  InputError for an unknown name
    """
    if name not in SCHEMAS:
        raise InputError("name", name, nearest(name, ["case", *SCHEMAS]))
    from pydantic import TypeAdapter

    schema = TypeAdapter(form(name)).json_schema()
    schema["properties"]["schema"] |= {"const": word(name)}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": word(name)} | schema


_printed = False
"""Whether the command has printed its object."""


def begin() -> None:
    """A command begins: it has not printed anything."""
    global _printed
    _printed = False


def print_json(name: str, value: Mapping[str, Any]) -> None:
    """Print a result in the form of a schema."""
    global _printed
    _printed = True
    print(as_json({"schema": word(name), **value}))


def asked_for_json() -> bool:
    """Whether the command line has `--json`."""
    return "--json" in sys.argv[1:]


def print_failure(message: str, code: int, failure: BaseException | None = None) -> None:
    """Print an error as JSON, unless the command has printed its result, and failed after that.

    message  one error in each line
    failure  the error itself, if it is known
    """
    if not _printed:
        print_json("error", {"exit_code": code, "errors": list(_mistakes(message, failure))})


def _mistakes(message: str, failure: BaseException | None) -> Iterator[Mistake]:
    issues = getattr(failure, "issues", ())
    if issues:  # of a case with errors in its check
        for issue in issues:
            yield {"message": str(issue), "key": issue.key, "limit": issue.reason, "remedy": issue.remedy}
        return
    errors: tuple[CfddemError, ...] = getattr(failure, "each", (failure,) if isinstance(failure, InputError) else ())
    if not errors:
        for line in message.splitlines():
            yield {"message": line}
    for error in errors:
        mistake: Mistake = {"message": str(error)}
        if isinstance(error, InputError):
            place, _, key = error.field.rpartition(" ")  # such as "bed.toml:14: " and "--set "
            value = "" if error.value is None else str(error.value)
            mistake |= {
                "place": place.rstrip(":"), "key": key, "value": value, "limit": error.limit, "remedy": error.remedy,
            }  # fmt: skip
        yield mistake
