"""Random numbers by counter: each number is a function of a seed, a name and a step, and of nothing else.

So a particle draws the same numbers on any number of threads or ranks, in any order of the rows, and after a restart.
The generator is Philox4x32 with ten rounds: Salmon, Moraes, Dror & Shaw, Proc. SC11 (2011),
doi:10.1145/2063384.2063405.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline

_MULTIPLIER_0, _MULTIPLIER_1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_WEYL_0, _WEYL_1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
_LOW, _32 = np.uint64(0xFFFFFFFF), np.uint64(32)
_ROUNDS = 10
_UNIT = 1.0 / 2.0**32


@inline
def philox(counter, key):
    """Four random words of 32 bits from four words of a counter and two of a key; all as uint64."""
    a, b, c, d = counter
    k0, k1 = key
    for _ in range(_ROUNDS):
        first, second = _MULTIPLIER_0 * a, _MULTIPLIER_1 * c
        a, b, c, d = (second >> _32) ^ b ^ k0, second & _LOW, (first >> _32) ^ d ^ k1, first & _LOW
        k0, k1 = (k0 + _WEYL_0) & _LOW, (k1 + _WEYL_1) & _LOW
    return a, b, c, d


@inline
def _pair(one, other):
    """Two independent standard normal numbers from two random words (Box and Muller)."""
    length = math.sqrt(-2.0 * math.log((one + 0.5) * _UNIT))
    angle = 2.0 * math.pi * (other + 0.5) * _UNIT
    return length * math.cos(angle), length * math.sin(angle)


@inline
def normal_numbers(seed, name, step, purpose):
    """Four independent standard normal numbers.

    seed     of the run
    name     of the particle, its id
    step     number of the fluid step
    purpose  which use of random numbers this is: different uses get independent numbers
    """
    name, step = np.uint64(name), np.uint64(step)
    counter = (name & _LOW, name >> _32, step & _LOW, step >> _32)
    a, b, c, d = philox(counter, (np.uint64(seed) & _LOW, np.uint64(purpose) & _LOW))
    first, second = _pair(np.float64(a), np.float64(b)), _pair(np.float64(c), np.float64(d))
    return first[0], first[1], second[0], second[1]
