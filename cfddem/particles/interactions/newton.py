"""One step of Newton's method for the speed after an impulse, which lies between known bounds."""

from __future__ import annotations

from cfddem.backend.compile import inline


@inline
def next_guess(guess, excess, slope, low, high):
    """Next guess for the root of an increasing function, and the bounds that hold it.

    excess  value of the function at the guess
    slope   of the function there
    """
    if excess > 0.0:
        high = guess
    else:
        low = guess
    following = guess - excess / slope
    if not low < following < high:
        following = 0.5 * (low + high)
    return following, low, high
