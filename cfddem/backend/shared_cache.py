"""The folder of compiled loops, which several processes fill at once: one compiles a loop, the others wait and load it.

The compiler updates the index of a loop without a lock. Two processes that compile a loop for different arguments could
name the same file, and a later run would then load the code for other arguments.
"""

from __future__ import annotations

import atexit
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from numba.core.caching import FunctionCache
from numba.core.compiler_lock import global_compiler_lock

from closures.compiled import cache_folder

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

LONGEST = 600.0
"""How long a process waits for another that compiles the same loop, before it compiles the loop itself [s]."""

_LOCKS: list[IO[bytes]] = []


class SharedCache(FunctionCache):
    """The compiled code of one function on disk. `begin` and `end` enclose each call of the compiler."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._place = zlib.crc32(self._impl.filename_base.encode())  # each function locks a byte of the lock file
        self._depth, self._locked = 0, False

    def begin(self) -> None:
        """The compiler is called; a function that calls itself comes here again."""
        self._depth += 1

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for some arguments; None if this process is to compile it, with all others locked out."""
        found = super().load_overload(sig, target_context)
        if found is None and not self._locked:
            self._locked = _lock(self._place)
            found = super().load_overload(sig, target_context)
        return found

    def end(self) -> None:
        """The compiler has returned or failed."""
        self._depth -= 1
        if self._locked and not self._depth:
            fcntl.lockf(_LOCKS[0], fcntl.LOCK_UN, 1, self._place)
            self._locked = False


def kept_on_disk(compiled: Any) -> Any:
    """Let a compiled function keep its code on disk."""
    if not hasattr(compiled, "enable_caching"):  # compilation is switched off
        return compiled
    compiler, cache = compiled.compile, SharedCache(compiled.py_func)

    def compile_once(sig: Any) -> Any:
        with global_compiler_lock:
            cache.begin()
            try:
                return compiler(sig)
            finally:
                cache.end()

    compiled._cache, compiled.compile = cache, compile_once
    return compiled


def _lock(place: int) -> bool:
    """Lock a byte of the lock file; False if the file system has no locks, or another process keeps it for too long."""
    if fcntl is None:
        return False
    until, pause = time.monotonic() + LONGEST, 1e-3
    while time.monotonic() < until:
        try:
            if not _LOCKS:
                folder = Path(cache_folder())
                folder.mkdir(parents=True, exist_ok=True)
                _LOCKS.append((folder / "lock").open("ab"))
                atexit.register(_LOCKS[0].close)
            fcntl.lockf(_LOCKS[0], fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
        except BlockingIOError:
            time.sleep(pause)
            pause = min(2.0 * pause, 0.05)
        except OSError:
            return False
        else:
            return True
    return False
