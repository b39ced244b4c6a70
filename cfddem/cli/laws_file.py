"""A file of the user that declares laws: executed where a command names it, and nowhere else."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from cfddem.backend.errors import InputError


def import_laws(file: Path) -> None:
    """Execute a Python file, so that its laws are known.

    errors  InputError if it is no Python file, or fails
    """
    if file.suffix != ".py" or not file.stem.isidentifier() or not file.is_file():
        raise InputError("--laws", str(file), "an existing Python file, such as my_laws.py")
    known = sys.modules.get(file.stem)
    if known is not None and getattr(known, "__file__", None) == str(file.resolve()):
        return
    if known is not None or file.stem in sys.stdlib_module_names:
        raise InputError("--laws", str(file), "a file with a name of its own", "another module has its name; rename it")
    spec = spec_from_file_location(file.stem, file.resolve())
    assert spec is not None and spec.loader is not None
    module = sys.modules[file.stem] = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as failure:
        del sys.modules[file.stem]
        limit = "a file that can be executed"
        raise InputError("--laws", str(file), limit, f"{type(failure).__name__}: {failure}") from failure
