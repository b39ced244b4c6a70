"""Ranks that share a box: how many along x, y and z, and where in it each of them is.

Space and cells are divided by planes across x, y and z, the same for all ranks, so that each rank has a *brick*. Bricks
of one rank along two axes are slabs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfddem.backend.errors import InputError

Shape = tuple[int, int, int]
"""Ranks along x, y, z."""


def shapes(ranks: int, most: Sequence[int]) -> list[Shape]:
    """All ways to arrange ranks along x, y, z; along y rather than x and x rather than z first.

    most  largest number along x, y, z
    """
    return [
        (x, ranks // z // x, z)
        for z in range(1, min(ranks, most[2]) + 1) if ranks % z == 0
        for x in range(1, min(ranks // z, most[0]) + 1) if ranks // z % x == 0 and ranks // z // x <= most[1]
    ]  # fmt: skip


def place_of(rank: int, shape: Shape) -> tuple[int, int, int]:
    """Place of a rank along x, y, z."""
    x, y, z = (int(n) for n in np.unravel_index(rank, shape))
    return x, y, z


def with_ghosts(widths: Sequence[np.ndarray], reach: float) -> np.ndarray:
    """Volume of each brick of an open box, with what lies within reach of it in other bricks, over its own volume.

    widths  of the bricks along x, y, z
    reach   in the unit of the widths
    returns of the shape of the ranks
    """
    lines = []
    for width in widths:
        sides = np.full(len(width), 2.0)
        sides[0] -= 1.0
        sides[-1] -= 1.0
        lines.append(1.0 + sides * reach / width)
    return np.einsum("x,y,z->xyz", *lines)


def parsed(text: str) -> Shape:
    """The shape that a text such as "2x2x1" names.

    >>> parsed("2x2x1")
    (2, 2, 1)
    """
    parts = text.lower().split("x")
    if len(parts) != 3 or not all(part.isdecimal() and int(part) > 0 for part in parts):
        raise InputError("--division", text, "ranks along x, y and z, such as 2x2x1")
    x, y, z = map(int, parts)
    return x, y, z
