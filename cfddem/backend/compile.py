"""How a loop is compiled, cached and threaded.

    serial         a loop; the machine code is kept between runs. Within another loop it is a part of that
    threaded       a loop over `prange` that runs on all threads, over arrays that do not overlap; kept between runs.
                   For one thread it is compiled without them, in a third of the time
    either         a loop over `prange` for one thread, or for all where `law_set.specialise` compiles it so; kept
    part           a loop over `prange` that is part of a larger one, and is kept with that; for threads as `either`
    threaded_part  the same, on all threads
    vector_part    as `part`, over arrays that do not overlap: on several rows at once where the processor can
    vector_piece   the same for one thread, also where the loop around it runs on all
    inline         a helper, compiled into the loops that call it
    vector_inline  as `inline`, for loops over arrays that do not overlap
    fused          as `inline`; a product and the sum that it enters may be rounded once, where the processor can

None of them lets the compiler reorder arithmetic: results are the same bits on any number of threads, and a NaN stays a
NaN. In a `fused` helper no sum may be of two products, because the compiler could round either of them.
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

import gc
import os
import sys
import time as clock
from collections.abc import Mapping
from types import FunctionType

from numba import config, get_num_threads, njit, prange, set_num_threads
from numba.core import event
from numba.core.cpu import CPUTargetOptions
from numba.core.options import TargetOptions
from numba.core.types import none as none_type
from numba.core.types import unliteral
from numba.extending import intrinsic, overload

import closures.compiled as _cache_first  # noqa: F401  sets the compile cache before numba is loaded
from cfddem.backend.errors import InputError
from closures.linked import CALLED, INLINE, PART

__all__ = [
    "CHUNKS",
    "announce_compilation",
    "announced",
    "either",
    "fused",
    "get_num_threads",
    "inline",
    "kept_whole",
    "part",
    "prange",
    "seconds_of_compilation",
    "serial",
    "threaded",
    "threaded_part",
    "use_threads",
    "vector_inline",
    "vector_part",
    "vector_piece",
]

if "OMP_WAIT_POLICY" not in os.environ:
    # A thread that waits for another by spinning keeps it from its core where other work runs too: by default for
    # some ms, and a step then takes a hundred times as long. A sleep needs 60 us to end, as long as small loops take.
    # So a thread spins for about 0.1 ms, and then sleeps.
    os.environ.setdefault("GOMP_SPINCOUNT", "10000")

CHUNKS = 64
"""Reductions sum this many fixed pieces in order, so that the sum does not depend on the thread count."""


MANY_ROWS = 1000
"""Fewer rows than this are not worth the start of other threads."""


# the compiler has this flag, but no word for it among the options of `njit`
CPUTargetOptions.noalias = TargetOptions.Mapping("noalias")  # type: ignore[attr-defined]


class Serial:
    """A loop as Python calls it. Within another loop it is a part of that.

    function  the loop

    called, within  as it is compiled for Python, and for other loops
    """

    def __init__(self, function: Any) -> None:
        self.py_func, self.__name__ = function, function.__name__
        self.called, self.within = kept_on_disk(njit(**CALLED)(function)), _linked(function)

    @property
    def _numba_type_(self) -> Any:
        """What a loop calls by this name."""
        return self.within._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        """Run the loop."""
        return self.called(*arguments)


def serial(function: Callable[..., Any]) -> Any:
    """Compile a serial loop; kept on disk."""
    return _marked(Serial(function), serial)


class Threaded:
    """A loop over `prange`, compiled when it is first called on one thread, and when it is first called on several.

    function  the loop

    one, all  as it is compiled for one thread, and for all
    """

    def __init__(self, function: Any) -> None:
        self.py_func, self.__name__ = function, function.__name__
        alone = njit(**(CALLED | {"noalias": True}))
        self.one = kept_on_disk(alone(renamed(function, f"{function.__name__}_on_one_thread")))
        self.all = kept_on_disk(njit(**CALLED, parallel=True)(function))

    def over(self, rows: int) -> Any:
        """The loop for this many rows: on one thread where more would not pay."""
        return self if rows >= MANY_ROWS else self.one

    @property
    def in_use(self) -> Any:
        """The loop as it is compiled for the threads in use."""
        return self.one if get_num_threads() == 1 else self.all

    def __call__(self, *arguments: Any) -> Any:
        """Run the loop on the threads in use."""
        return self.in_use(*arguments)


def threaded(function: Callable[..., Any]) -> Any:
    """Compile a loop over `prange` that runs on all threads; kept on disk.

    No array that it writes shares memory with another argument: the compiler relies on that, on any number of threads.
    """
    return _marked(Threaded(function), threaded)


def either(function: Callable[..., Any]) -> Any:
    """Compile a loop over `prange` for one thread; `law_set.specialise` can compile it for all threads."""
    return _marked(kept_on_disk(njit(**CALLED)(function)), either)


def _linked(function: Callable[..., Any], **options: Any) -> Any:
    """A function for other loops, compiled once for all values of a number that they give it as a constant."""
    compiled = njit(**PART, **options)(function)
    if hasattr(compiled, "get_call_template"):  # compilation is switched on
        template_of = compiled.get_call_template
        compiled.get_call_template = lambda args, kws: template_of(tuple(map(unliteral, args)), kws)
    return compiled


def part(function: Callable[..., Any]) -> Any:
    """Compile a loop over `prange` that is part of a larger one, with which it is kept; as `either` for threads."""
    return _marked(_linked(function), part)


@intrinsic  # type: ignore[untyped-decorator]
def _not_inlined(context):  # type: ignore[no-untyped-def]
    """See `kept_whole`."""

    def code(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        if "alwaysinline" not in builder.function.attributes:  # as in loops for all threads
            builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return none_type(), code


def kept_whole() -> None:
    """Within a loop: keep it out of its caller, where the compiler can no longer tell its arrays apart."""


@overload(kept_whole)
def _kept_whole() -> Any:
    return lambda: _not_inlined()  # type: ignore[call-arg]


def vector_part(function: Callable[..., Any]) -> Any:
    """Compile a loop over `prange` as `part` does, where no two array arguments share memory and rows do not meet.

    The compiler may then work on several rows at once, as it does by itself in loops for all threads.
    """
    return _marked(_linked(function, noalias=True, forceinline=False), vector_part)


def vector_piece(function: Callable[..., Any]) -> Any:
    """Compile a loop as `vector_part` does for one thread, also where several threads share its rows piece by piece."""
    return _marked(_linked(function, noalias=True, forceinline=False), vector_piece)


def vector_inline(function: Callable[..., Any]) -> Any:
    """Compile a helper as `inline` does, where what it writes shares no memory with its other array arguments."""
    compiled = njit(**INLINE, noalias=True)(function)  # type: ignore[call-overload]
    return _marked(compiled, vector_inline)


def threaded_part(function: Callable[..., Any]) -> Any:
    """Compile a loop over `prange` that is part of a larger one and runs on all threads."""
    return _marked(_linked(function, parallel=True), threaded_part)


def inline(function: Callable[..., Any]) -> Any:
    """Compile a small helper into the loops that call it."""
    return _marked(njit(**INLINE)(function), inline)


def fused(function: Callable[..., Any]) -> Any:
    """Compile a small helper as `inline` does, where a product and a sum may be one instruction."""
    return _marked(njit(**INLINE, fastmath={"contract"})(function), fused)


def renamed(function: FunctionType, name: str, bound: Mapping[str, Any] | None = None) -> FunctionType:
    """A copy of a function, which the cache on disk tells from it by its name.

    bound  other values that the copy finds under some names
    """
    names = {**function.__globals__, **bound} if bound else function.__globals__
    twin = FunctionType(function.__code__, names, name, function.__defaults__, function.__closure__)
    twin.__qualname__, twin.__module__, twin.__doc__ = name, function.__module__, function.__doc__
    return twin


def _marked(compiled: Any, how: Callable[..., Any]) -> Any:
    """Note how a function is compiled, so that a copy of it can be compiled the same way."""
    compiled.compiled_as = how
    return compiled


def use_threads(count: int | None) -> int:
    """Run threaded loops on `count` threads (None: leave as it is); returns the number in use."""
    if count is not None:
        try:
            set_num_threads(count)
        except ValueError as refusal:
            most = config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
            raise InputError("threads", count, f"1 to {most} on this machine") from refusal
    return int(get_num_threads())


def announced(message: str) -> None:
    """Show which loop is being compiled on a terminal; elsewhere say once that loops are compiled."""
    if sys.stderr.isatty():
        print(f"\r{message:<60}\r", end="", file=sys.stderr, flush=True)
    elif message and _compilation.compiled == 1:
        print("cfddem: compiling loops, up to two minutes the first time", file=sys.stderr, flush=True)


class _Compilation(event.Listener):
    """Follows the compilation of each loop: shows a message, and keeps Python from looking for garbage meanwhile.

    A compilation makes millions of objects that live until its end. To look through them takes a quarter of its time.
    """

    def __init__(self) -> None:
        self.compiled, self.depth, self.collected = 0, 0, False
        self.seconds, self.begun = 0.0, 0.0
        self.progress: Callable[[str], None] | None = None

    def on_start(self, started: event.Event) -> None:
        """A compilation begins. Helpers are compiled within the loop that calls them and are not counted."""
        self.depth += 1
        if self.depth > 1:
            return
        self.begun = clock.perf_counter()
        self.collected = gc.isenabled()
        gc.disable()
        if self.progress is not None:
            self.compiled += 1
            self.progress(f"compiling loop {self.compiled} (kept for next time) ...")

    def on_end(self, ended: event.Event) -> None:
        """A compilation has ended."""
        self.depth -= 1
        if self.depth > 0:
            return
        self.seconds += clock.perf_counter() - self.begun
        if self.collected:
            gc.enable()
        if self.progress is not None:
            self.progress("")


_compilation = _Compilation()
event.register("numba:compile", _compilation)


def announce_compilation(progress: Callable[[str], None] | None = announced) -> Callable[[str], None] | None:
    """Show a message while loops are compiled.

    progress  called with the message, and with an empty text at the end; None for silence
    returns   what was called until now
    """
    before, _compilation.progress = _compilation.progress, progress
    return before


def seconds_of_compilation() -> float:
    """Wall time for which this process has compiled loops [s]; those loaded from the disk are not counted."""
    return _compilation.seconds


# ---------------------------------------------------------------- the folder of compiled loops, shared by processes


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
        overload = super().load_overload(sig, target_context)
        if overload is None and not self._locked:
            self._locked = _lock(self._place)
            overload = super().load_overload(sig, target_context)
        return overload

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
