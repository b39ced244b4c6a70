"""How a loop is compiled, cached and threaded.

`@kernel` compiles a loop once and keeps the machine code between runs; `@threaded` does the same for a
loop written with `prange`. Neither allows the compiler to reorder arithmetic: results are the same bits
on any number of threads, and a NaN stays a NaN.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from types import FunctionType
from typing import Any

from numba import get_num_threads, njit, prange, set_num_threads
from numba.core import event

import closures.compiled as _cache_first  # noqa: F401  sets the compile cache before numba is loaded
from cfddem.errors import InputError

__all__ = [
    "CHUNKS",
    "announce_compilation",
    "inline",
    "kernel",
    "prange",
    "serial_and_threaded",
    "threaded",
    "use_threads",
]

if "OMP_WAIT_POLICY" not in os.environ:
    # A thread that waits for another by spinning keeps it from its core where other work runs too, and a step takes
    # a hundred times as long. A short spin, then sleep, costs a quiet machine little.
    os.environ.setdefault("GOMP_SPINCOUNT", "1000")

CHUNKS = 64
"""Reductions sum this many fixed pieces in order, so that the sum does not depend on the thread count."""


_INLINE: dict[str, Any] = {
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "forceinline": True,
    "_nrt": False,
}
"""Helpers are never called from outside, always inlined, and count no references: they own no arrays."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a serial loop; kept on disk."""
    return njit(cache=True, error_model="numpy")(function)


def threaded(function: Callable[..., Any]) -> Any:
    """Compile a loop over `prange` that runs on all threads; kept on disk."""
    return njit(cache=True, error_model="numpy", parallel=True)(function)


def inline(function: Callable[..., Any]) -> Any:
    """Compile a small helper into the loops that call it."""
    return njit(**_INLINE)(function)


def use_threads(count: int | None) -> int:
    """Run threaded loops on `count` threads (None: leave as it is); returns the number in use."""
    if count is not None:
        try:
            set_num_threads(count)
        except ValueError as refusal:
            raise InputError("threads", count, f"1 to {_most_threads()} on this machine") from refusal
    return int(get_num_threads())


def _most_threads() -> int:
    import numba

    return int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]


def _on_its_own_line(what: str) -> None:
    print(f"\r{what:<60}\r", end="", file=sys.stderr, flush=True)


class _Announcer(event.Listener):
    """Says which loop is being compiled, and nothing when it is."""

    def __init__(self) -> None:
        self.compiled, self.depth = 0, 0
        self.say: Callable[[str], None] | None = None

    def on_start(self, seen: event.Event) -> None:
        """A compilation begins; those of the helpers inside a loop are part of it."""
        self.depth += 1
        if self.depth == 1 and self.say is not None:
            self.compiled += 1
            self.say(f"compiling loop {self.compiled} (kept for next time) ...")

    def on_end(self, seen: event.Event) -> None:
        """A compilation has ended."""
        self.depth -= 1
        if self.depth == 0 and self.say is not None:
            self.say("")


_announcer = _Announcer()


def announce_compilation(say: Callable[[str], None] = _on_its_own_line) -> None:
    """Tell the person at the terminal when loops are being compiled.

    say  is told which loop, and an empty text when it is done; the line of the terminal if not given
    """
    if not sys.stderr.isatty():
        return
    if _announcer.say is None:
        event.register("numba:compile", _announcer)
    _announcer.say = say


def serial_and_threaded(function: Callable[..., Any], **swapped: Any) -> tuple[Any, Any]:
    """Compile one source twice: for one thread without overhead, and for all threads.

    The second face carries its own name, because the compile cache tells functions apart by name.

    swapped  name=loop, what the threaded face calls instead of the loop of that name
    """
    names = {**function.__globals__, **swapped}
    twin = FunctionType(function.__code__, names, function.__name__ + "_threaded")
    twin.__qualname__ = function.__qualname__ + "_threaded"
    twin.__module__ = function.__module__
    return kernel(function), threaded(twin)
