"""Results as JSON text."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass
from os import PathLike
from typing import Any

import numpy as np


def as_json(value: Any, indent: int | None = None) -> str:
    """Plain values or dataclasses as JSON, with null for NaN and infinity.

    >>> as_json({"height": 0.04, "error": math.nan, "window": (0.0, math.inf)})
    '{"height": 0.04, "error": null, "window": [0.0, null]}'
    """
    return json.dumps(plain(value), allow_nan=False, indent=indent)


def plain(value: Any) -> Any:
    """The value in the types of JSON, with None for NaN and infinity.

    >>> plain({"spin": (1.0, math.nan), "outcome": "stick"})
    {'spin': [1.0, None], 'outcome': 'stick'}
    """
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(name): plain(content) for name, content in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(element) for element in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, PathLike) else value


def summary_of(result: Any) -> dict[str, Any]:
    """The values of a dataclass that `repr` shows, in the types of JSON."""
    return {field.name: plain(getattr(result, field.name)) for field in fields(result) if field.repr}
