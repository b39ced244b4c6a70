"""Spheres in a fluid, with the thin film between them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "Fluid": "cfddem.materials",
    "Material": "cfddem.materials",
    "CfddemError": "cfddem.errors",
}
__all__ = ["CfddemError", "Fluid", "Material", "__version__"]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for, so that `import cfddem` costs nothing."""
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'cfddem' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
