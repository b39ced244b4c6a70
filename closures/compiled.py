"""The compiled face of the laws, and the folder where compiled code is kept between runs.

Compiled code is kept under a key made of all sources, because a compiled loop does not notice by itself
that a law it calls in another file has changed. Importing this module before anything is compiled is
enough; `import closures` alone compiles nothing and does not load the compiler.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tempfile
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from closures.registry import REGISTRY, WHEN_REGISTERED

_IMPORTS = re.compile(
    r"^(?:from|import) ((?:cfddem|closures|scenarios)[\w.]*)(?: import ([\w ,]+|\([^)]*\)))?", re.MULTILINE
)
_COMPILES = re.compile(
    r"^from (?:cfddem\.backend\.compile import .*(?:either|inline|part|serial|threaded)|numba import)|^import numba",
    re.MULTILINE,
)


def source_key() -> str:
    """Hash of every Python source that compiled code may come from.

    These are the laws, the files that compile loops, and what these files import. Other files can change without
    compiling anything anew.
    """
    sources = {}
    for package in ("cfddem", "closures", "scenarios"):
        spec = find_spec(package)
        for folder in (spec.submodule_search_locations or []) if spec else []:
            for path in Path(folder).rglob("*.py"):
                name = ".".join((package, *path.relative_to(folder).with_suffix("").parts)).removesuffix(".__init__")
                sources[name] = path.read_text(encoding="utf-8")
    digest = hashlib.sha256()
    for name in sorted(_compiled_from(sources)):
        digest.update(f"{name}\n{sources[name]}".encode())
    return digest.hexdigest()[:12]


def _compiled_from(sources: Mapping[str, str]) -> set[str]:
    """Names of the modules that compiled code may come from, among all modules and their texts."""
    todo = [name for name, text in sources.items() if name.startswith("closures") or _COMPILES.search(text)]
    reached = set(todo)
    while todo:
        for module, names in _IMPORTS.findall(sources[todo.pop()]):
            imported = {module, *(f"{module}.{name}" for name in re.findall(r"\w+", names))} & sources.keys()
            todo += imported - reached
            reached |= imported
    return reached


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


def _set_compiler(setting: str, value: str) -> None:
    """Set a setting of the compiler, whether it is loaded already or not."""
    os.environ[f"NUMBA_{setting}"] = value
    if "numba" in sys.modules:
        setattr(sys.modules["numba"].config, setting, value)


def _use_wide_vectors() -> None:
    """Let loops use vectors of 512 bits where the processor has them, and fill them as it does faster.

    Compilers prefer 256 bits, because early processors with AVX-512 lowered their clock for wider ones. Loops over
    pairs divide and gather much, and are 1.3 to 1.8 times as fast with 512 bits. On processors of AMD an instruction
    that gathers eight numbers takes longer than eight loads. The results are the same bits.
    """
    import llvmlite.binding as processor
    from numba import config

    if config.CPU_NAME or config.CPU_FEATURES or not config.ENABLE_AVX:  # type: ignore[attr-defined]
        return  # the user's own choice
    try:
        features = processor.get_host_cpu_features()
    except RuntimeError:  # LLVM does not know this processor
        return
    if features.get("avx512f"):
        wide = _wide_vectors(processor.get_host_cpu_name(), processor.llvm_version_info[0])
        _set_compiler("CPU_FEATURES", f"{features.flatten()},{wide}")


def _wide_vectors(processor: str, llvm: int) -> str:
    """Settings of a processor with AVX-512, by its name and the version of LLVM, for `_use_wide_vectors`."""
    loads_faster = processor.startswith("znver") and llvm >= 17  # older versions do not know the setting
    return "-prefer-256-bit" + ",+prefer-no-gather" * loads_faster


_EXPOSED: set[Callable[..., float]] = set()


def expose(function: Callable[..., float]) -> None:
    """Let compiled loops call this plain function by its name."""
    _EXPOSED.add(function)
    overload(function, strict=False, jit_options=INLINE)(lambda *_, **__: function)  # type: ignore[arg-type]


def is_exposed(function: Callable[..., Any]) -> bool:
    """Whether compiled loops can call this plain function by its name."""
    return function in _EXPOSED


_set_compiler("CACHE_DIR", str(cache_folder()))
_use_wide_vectors()

from numba.extending import overload  # noqa: E402  the compiler reads its settings when it is loaded

from closures.linked import INLINE  # noqa: E402

for _laws in REGISTRY.values():
    for _law in _laws.values():
        expose(_law.function)
WHEN_REGISTERED.append(expose)
