"""Packages that only an extra of the installation brings."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from cfddem.backend.errors import InputError


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
