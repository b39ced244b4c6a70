"""The compiled face of the laws, and the folder where compiled code is kept between runs.

Compiled code is kept under a key made of all sources, because a compiled loop does not notice by itself
that a law it calls in another file has changed. Importing this module before anything is compiled is
enough; `import closures` alone compiles nothing and does not load the compiler.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from closures.law import SHELF


def source_key() -> str:
    """Hash of every Python source that compiled code may come from."""
    digest = hashlib.sha256()
    for package in ("cfddem", "closures", "scenarios"):
        spec = find_spec(package)
        for folder in (spec.submodule_search_locations or []) if spec else []:
            for source in sorted(Path(folder).rglob("*.py")):
                digest.update(str(source.relative_to(folder)).encode())
                digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def cache_folder() -> Path:
    """Where compiled code is kept: the user's cache, or a temporary folder where that is read-only.

    A folder named in NUMBA_CACHE_DIR is honoured; the key of the sources is added to it.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    private = f"cfddem-{os.getuid() if hasattr(os, 'getuid') else os.getlogin()}"
    candidates = [Path(chosen)] if chosen else [Path(home) / "cfddem", Path(tempfile.gettempdir()) / private]
    key = source_key()
    for folder in candidates:
        if folder.name == key:
            return folder  # a parent process has added the key already
        if _writable(folder):
            return folder / key
    return Path(tempfile.mkdtemp(prefix="cfddem-")) / key


def _point_compiler_at(folder: Path) -> None:
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(folder)


_OPTIONS: Any = {
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "forceinline": True,
    "_nrt": False,
}


def expose(function: Callable[..., float]) -> None:
    """Let compiled loops call this plain function by its name."""
    overload(function, strict=False, jit_options=_OPTIONS)(lambda *_, **__: function)


_point_compiler_at(cache_folder())

from numba.extending import overload  # noqa: E402  the cache folder must be known first

for _laws in SHELF.values():
    for _card in _laws.values():
        expose(_card.function)
