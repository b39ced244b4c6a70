r"""Exact resistance of two spheres that move across their line of centres in creeping flow.

The recurrences of Jeffrey & Onishi, J. Fluid Mech. 139 (1984) 261, with the corrections of Townsend (2018),
arXiv:1802.08226. A resistance function is a series in x = 2/s = (R1 + R2)/r whose coefficients tend to those of its
singular terms, which are summed in closed form.
"""

from __future__ import annotations

from functools import cache
from math import comb
from typing import NamedTuple

import numpy as np

TERMS = 120
"""Terms of each series."""

_CHOOSE = np.array([[float(comb(n + s, n + 1)) for s in range(TERMS + 2)] for n in range(TERMS + 2)])


class Resistance(NamedTuple):
    """Resistance functions of two spheres, all over those of the first sphere alone; lambda = R2/R1.

    Signs are such that each is positive where the film acts alone: a force or couple on the first sphere against
    a motion.
    """

    force_by_own: float  # Y^A_11, over 6 pi eta R1
    force_by_other: float  # -Y^A_12
    couple_by_own: float  # -Y^B_11, over 4 pi eta R1^2
    couple_by_other: float  # Y^B_12
    turn_by_own: float  # Y^C_11, over 8 pi eta R1^3
    turn_by_other: float  # Y^C_12


def leading(ratio: float) -> Resistance:
    """Coefficients of ln(1/xi) in these functions, J&O (4.16), (5.6) and (7.10)."""
    force = 4.0 / 15.0 * ratio * (2.0 + ratio + 2.0 * ratio**2) / (1.0 + ratio) ** 3
    couple = 0.2 * ratio * (4.0 + ratio) / (1.0 + ratio) ** 2
    return Resistance(force, force, couple, couple, 0.4 * ratio / (1.0 + ratio), 0.1 * ratio**2 / (1.0 + ratio))


def following(ratio: float) -> Resistance:
    """Coefficients of xi ln(1/xi), J&O (4.16), (5.6) and (7.10), the last as corrected by Townsend (30)."""
    powers = ratio ** np.arange(5)
    force = 2.0 / 375.0 * float(powers @ [16, -45, 58, -45, 16]) / (1.0 + ratio) ** 3
    couple = float(powers @ [32, -33, 83, 43, 0]) / (250.0 * (1.0 + ratio) ** 2)
    own = float(powers @ [8, 6, 33, 0, 0]) / (125.0 * (1.0 + ratio))
    other = ratio * float(powers @ [43, -24, 43, 0, 0]) / (500.0 * (1.0 + ratio))
    return Resistance(force, force, couple, couple, own, other)


def resistance(gap: float, ratio: float = 1.0) -> Resistance:
    """Exact resistance functions.

    gap    xi, surface to surface over the mean radius [-]
    ratio  lambda, radius of the second sphere over that of the first [-]
    """
    x = 2.0 / (2.0 + gap)
    series = _series(ratio)
    odd = (False, True, True, False, False, True)
    return Resistance(*(
        _summed(terms, x, is_odd, first, second)
        for terms, is_odd, first, second in zip(series, odd, leading(ratio), following(ratio))
    ))  # fmt: skip


def _summed(terms: np.ndarray, x: float, odd: bool, first: float, second: float) -> float:
    """Sum of the odd or even terms, singular parts in closed form."""
    m = np.arange(1 if odd else 2, TERMS, 2)
    own = 2.0 / m
    next_own = own - np.where(m > 2, 2.0 / np.maximum(m - 2, 1), 0.0)
    rest = terms[m] - first * own - second * next_own
    logarithm = np.log((1.0 + x) / (1.0 - x)) if odd else -np.log(1.0 - x * x)
    singular = (first + second * (1.0 - x * x)) * logarithm
    return float((0.0 if odd else terms[0]) + singular + rest @ x**m)


@cache
def _series(ratio: float) -> tuple[np.ndarray, ...]:
    """Coefficients of x^m of the six functions, each (TERMS,)."""
    m = np.arange(TERMS)
    of_force, _ = _coefficients(False)
    _, of_force_turn = _coefficients(False)
    _, of_turn = _coefficients(True)
    weights = np.array([[ratio**q / (1.0 + ratio) ** k if q <= k else 0.0 for q in m] for k in m])
    force = np.array([of_force[k - m[: k + 1], m[: k + 1]] @ weights[k, : k + 1] for k in m])
    couple = np.array([2.0 * of_force_turn[k - m[: k + 1], m[: k + 1]] @ weights[k, : k + 1] for k in m])
    turn = np.array([of_turn[k - m[: k + 1], m[: k + 1]] @ weights[k, : k + 1] * ratio ** (k % 2) for k in m])
    return force, force, -couple, -couple, turn, turn


@cache
def _coefficients(turning: bool) -> tuple[np.ndarray, np.ndarray]:
    """P_1pq and Q_1pq, J&O (4.6) to (4.11) and (7.3) to (7.5), V as Townsend (18) (TERMS, TERMS).

    turning  a sphere turns; else it moves
    """
    # the last places of each axis stay empty: negative indices find zeros there
    p_, v_, q_ = (np.zeros((TERMS + 4,) * 3) for _ in range(3))
    for k in range(TERMS):
        for p in range(k + 1):
            _fill(p_, v_, q_, p, k - p, turning)
    return p_[1, :TERMS, :TERMS], q_[1, :TERMS, :TERMS]


def _fill(p_: np.ndarray, v_: np.ndarray, q_: np.ndarray, p: int, q: int, turning: bool) -> None:
    """Find P, V and Q of all n at p and q from those of smaller p + q."""
    if p + q == 0:
        q_[1, 0, 0] = float(turning)
        p_[1, 0, 0] = v_[1, 0, 0] = float(not turning)
        return
    n, s = np.arange(1.0, p + 2)[:, None], np.arange(1.0, q + 1)[None, :]
    m, t = n.astype(int), s.astype(int)
    choose = _CHOOSE[m, t]
    near, next_near = p_[t, q - t, p - m + 1], p_[t, q - t, p - m - 1]
    first = (2 * n + 1) / (2 * (n + 1)) * (3 * (n + s) - (n * s + 1) * (2 * n * s - s - n + 2))
    terms = first / (s * (n + s) * (2 * s - 1)) * near + n * (2 * n - 1) / (2 * (n + 1)) * next_near
    terms += n * (4 * n**2 - 1) / (2 * (n + 1) * (2 * s + 1)) * v_[t, q - t - 2, p - m + 1]
    terms -= 2 * (4 * n**2 - 1) / (3 * (n + 1)) * q_[t, q - t - 1, p - m + 1]
    found = (choose * terms).sum(axis=1)
    rest = (choose * next_near).sum(axis=1)
    turned = choose * (s / (n + 1) * q_[t, q - t - 1, p - m] - 3 / (2 * n * s * (n + 1)) * p_[t, q - t, p - m])
    p_[m[:, 0], p, q] = found
    v_[m[:, 0], p, q] = found + 2 * n[:, 0] / ((n[:, 0] + 1) * (2 * n[:, 0] + 3)) * rest
    q_[m[:, 0], p, q] = turned.sum(axis=1)
