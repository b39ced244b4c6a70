"""How far beyond reach a neighbour list looks, so that it lasts a while."""

from __future__ import annotations

import math

LISTING_COSTS = (8.0, 2.0)
"""Steps that a new list takes, over what a skin of one radius adds to a step; for few particles and for many."""

FIRST_SKIN = (0.1, 0.02)
"""Skin of the first list over the mean radius; for few particles and for many."""

NARROWEST, WIDEST = 0.01, 0.6
"""Bounds of the skin that is found in the run, over the mean radius."""


def tuned(skin: float, age: int, radius: float, many: bool, room: float) -> float:
    """The skin at which finding the pairs anew and looking at those that do not touch cost the same [m].

    The time between two lists grows with the skin, and so does the number of pairs in them.

    skin    of the list that has just ended [m]
    age     steps for which it lasted, above 0
    radius  mean of the particles [m]
    many    so many particles that loops run on all threads
    room    widest skin that the periodic box leaves [m]
    """
    best = radius * math.sqrt(LISTING_COSTS[many] * skin / (radius * age))
    best = min(max(best, 0.5 * skin), 2.0 * skin)
    return min(max(best, NARROWEST * radius), WIDEST * radius, max(skin, 0.99 * room))
