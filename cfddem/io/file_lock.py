"""A lock on a file that ends with the process that holds it: `fcntl` on Linux and macOS, `msvcrt` on Windows."""

from __future__ import annotations

from typing import IO, Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

try:
    import msvcrt as _windows
except ImportError:
    _windows = None  # type: ignore[assignment]

msvcrt: Any = _windows


def lock_file(file: IO[Any]) -> bool:
    """Lock an open file; False if another process holds the lock.

    A file system or machine without locks counts as free.
    """
    try:
        if fcntl is not None:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        elif msvcrt is not None:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return True
    return True
