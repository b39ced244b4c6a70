"""What commands print: results as aligned lines or as JSON."""

from __future__ import annotations

import json as _json
from typing import Any


def tell_of_compilation() -> None:
    """Say on the terminal when loops are compiled for the first time; loads the compiler."""
    from cfddem.kernels import announce_compilation

    announce_compilation()


def show(values: dict[str, Any], units: dict[str, str], as_json: bool) -> None:
    """Print a result as aligned lines or as JSON."""
    if as_json:
        print(_json.dumps(values))
        return
    width = max(len(name) for name in values)
    for name, value in values.items():
        print(f"{name:<{width}}  {_readable(value)} {units.get(name, '')}".rstrip())


def _readable(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(_readable(each) for each in value) or "-"
    return str(value)
