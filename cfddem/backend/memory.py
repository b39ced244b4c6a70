"""Memory of arrays: what one has given back is kept for the next.

A fluid step makes and frees some twenty arrays of its particles. The C library of Linux would return each to the
system, which clears the pages of the next one again: up to a tenth of the time of fluid and coupling.
"""

from __future__ import annotations

import ctypes
import sys

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Parameters of `mallopt` in <malloc.h>."""

LARGEST = 32 * 1024**2
"""Arrays up to this size are kept; the C library allows no more [bytes]."""


def keep_freed_memory() -> bool:
    """Keep the memory of freed arrays in this process; returns whether the C library can."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except AttributeError:  # a C library without it
        return False
    return bool(mallopt(MMAP_THRESHOLD, LARGEST)) and bool(mallopt(TRIM_THRESHOLD, 4 * LARGEST))
