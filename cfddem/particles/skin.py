"""Skin of the neighbour list: how far it reaches beyond the range of interaction, so that it lasts several steps."""

from __future__ import annotations

import math

LISTING_COST = 8.0
"""Cost of a new list over the cost that a skin of one radius adds to a step; 7 to 9 in a bubbling bed, dry or wet."""

FIRST_SKIN = (0.1, 0.02)
"""Skin of the first list over the mean radius; for few particles and for many."""

NARROWEST, WIDEST = 0.01, 0.6
"""Bounds of the tuned skin over the mean radius."""


def tuned(skin: float, age: int, radius: float, room: float) -> float:
    """The skin at which new lists and pairs that do not touch cost the same [m].

    The life of a list grows with the skin, and so does the number of pairs in it.

    skin    of the last list [m]
    age     steps for which it lasted, above 0
    radius  mean of the particles [m]
    room    widest skin that the periodic box allows [m]
    """
    best = radius * math.sqrt(LISTING_COST * skin / (radius * age))
    best = min(max(best, 0.5 * skin), 2.0 * skin)
    return min(max(best, NARROWEST * radius), WIDEST * radius, max(skin, 0.99 * room))
