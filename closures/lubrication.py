r"""The film between two bodies as a resistance c(h): a force -c u against the rate u = dh/dt of the gap.

Because c depends on the gap alone, the impulse of a film is a difference of potentials,
:math:`\int -c\,u\,dt = -A\,[L(h_1) - L(h_0)]`, whatever the path and the time in between. Integrators that
use the potential have no stability limit from the film, however stiff.
"""

from __future__ import annotations

import math

from closures.law import law


@law("lubrication", "Brenner, Chem. Eng. Sci. 16 (1961) 242; Nijssen et al. (2023), eq. (1)")
def film_strength(viscosity: float, reduced_radius: float) -> float:
    r"""Strength A of the film between two immersed spheres, or a sphere and a wall: resistance times gap.

    .. math:: A = 6\pi\eta R^{*2}

    viscosity       eta, dynamic [Pa s]
    reduced_radius  R*; the radius itself against a wall [m]
    returns         A [N s]

    >>> round(film_strength(1e-3, 3.175e-3) * 1e7, 2)
    1.9
    """
    return 6.0 * math.pi * viscosity * reduced_radius**2


@law("lubrication", "Nijssen et al., Powder Technol. (2023), eqs (8) and (9), doi:10.1016/j.powtec.2022.118017")
def film_resistance(strength: float, gap: float, minimum_gap: float, cutoff_gap: float) -> float:
    r"""Resistance of the film, the lever of the lubricated contact included.

    .. math:: c = \frac{A}{h}\ (h_{min}<h\le h_{co}),\qquad c = \frac{h}{h_{min}}\frac{A}{h_{min}}\ (0<h\le h_{min})

    strength     A, from :func:`film_strength` [N s]
    gap          h, surface to surface, positive apart [m]
    minimum_gap  h_min [m]
    cutoff_gap   h_co, reach of the film [m]
    returns      c, force per rate of the gap [kg/s]; 0 for h <= 0 and h > h_co

    >>> [film_resistance(2.0, gap, 0.125, 1.0) for gap in (0.5, 0.0625, 1.5)]
    [4.0, 8.0, 0.0]
    """
    if gap <= 0.0 or gap > cutoff_gap:
        return 0.0
    if gap >= minimum_gap:
        return strength / gap
    return strength * gap / minimum_gap**2


@law("lubrication", "integral of Nijssen et al. (2023), eqs (8) and (9), over the gap")
def film_potential(gap: float, minimum_gap: float, cutoff_gap: float) -> float:
    r"""Potential L of the film: the impulse of the film between two gaps is -A times the difference of L.

    .. math:: L = \ln\frac{\min(h,h_{co})}{h_{min}} + \tfrac12\ (h>h_{min}),\quad
              \frac{h^2}{2h_{min}^2}\ (0<h\le h_{min}),\quad 0\ (h\le 0)

    gap          h [m]
    minimum_gap  h_min, > 0 [m]
    cutoff_gap   h_co, > h_min [m]
    returns      L [-]

    >>> film_potential(1.0, 1.0, 10.0), film_potential(-1.0, 1.0, 10.0)
    (0.5, 0.0)
    """
    if gap <= 0.0:
        return 0.0
    if gap <= minimum_gap:
        return 0.5 * (gap / minimum_gap) ** 2
    return math.log(min(gap, cutoff_gap) / minimum_gap) + 0.5


@law("lubrication", "difference of the film's potential; its series where the gap changes by less than a thousandth")
def film_potential_change(gap: float, change: float, minimum_gap: float, cutoff_gap: float) -> float:
    r"""Change of the film's potential, L(h + x) - L(h), without the logarithm where the change is small.

    .. math:: \ln(1 + q) = q - \tfrac12 q^2 + \tfrac13 q^3 - \dots,\qquad q = x/h

    gap          h [m]
    change       x, of the gap [m]
    minimum_gap  h_min, > 0 [m]
    cutoff_gap   h_co, > h_min [m]
    returns      L(h + x) - L(h) [-]; to 3e-13 where the series is used

    >>> exact = film_potential(1.0005, 0.1, 2.0) - film_potential(1.0, 0.1, 2.0)
    >>> abs(film_potential_change(1.0, 0.0005, 0.1, 2.0) - exact) < 1e-13
    True
    """
    end = gap + change
    if abs(change) < 1e-3 * gap and gap > minimum_gap and end > minimum_gap and gap < cutoff_gap and end < cutoff_gap:
        part = change / gap
        return part * (1.0 - part * (0.5 - part * (1.0 / 3.0)))
    if 0.0 <= gap <= minimum_gap and 0.0 <= end <= minimum_gap:
        return 0.5 * change * (gap + end) / minimum_gap**2
    return film_potential(end, minimum_gap, cutoff_gap) - film_potential(gap, minimum_gap, cutoff_gap)


@law("lubrication", "implicit in the end gap; monotone, so one root and no limit on the step")
def speed_after_film(
    speed: float,
    gap: float,
    accounted_gap: float,
    step: float,
    strength_per_mass: float,
    minimum_gap: float,
    cutoff_gap: float,
) -> float:
    r"""Rate of the gap after a step in which only the film acts, solved for the gap at the step's end.

    .. math:: u_1 + B\,L(h + u_1\Delta t) = u_0 + B\,L(h_a)

    speed              u_0, rate of the gap before, positive apart [m/s]
    gap                h, at the start of the step [m]
    accounted_gap      h_a, gap up to which the film's impulse has been given already; h for a first step [m]
    step               dt [s]
    strength_per_mass  B = A/m* [m/s]
    minimum_gap        h_min [m]
    cutoff_gap         h_co [m]
    returns            u_1 [m/s]

    In the film zone the speed is linear in ln h: u = -v0 + B ln(h_co/h), and a slow pair stops at h_co exp(-St).

    >>> stop = 1.0 + 1e9 * speed_after_film(-1.0, 1.0, 1.0, 1e9, 0.5, 1e-6, 1.0)      # St = v0/B = 2
    >>> round(stop / math.exp(-2.0), 6)
    1.0
    """
    total = speed + strength_per_mass * film_potential_change(gap, accounted_gap - gap, minimum_gap, cutoff_gap)
    guess = total / (1.0 + step * film_resistance(strength_per_mass, gap, minimum_gap, cutoff_gap))
    if abs(step * guess) < 1e-7 * gap:
        return guess  # the resistance has not changed by more than rounding
    low, high = -math.inf, math.inf
    for _ in range(100):
        potential = film_potential_change(gap, step * guess, minimum_gap, cutoff_gap)
        excess = guess + strength_per_mass * potential - total
        if abs(excess) <= 1e-14 * (abs(total) + abs(guess) + strength_per_mass * abs(potential)):
            return guess
        if excess > 0.0:
            high = guess
        else:
            low = guess
        end = gap + step * guess
        following = guess - excess / (1.0 + step * film_resistance(strength_per_mass, end, minimum_gap, cutoff_gap))
        if not low < following < high:
            # the potential lies between 0 and its value at the cut-off gap, which brackets the root
            reach = strength_per_mass * film_potential_change(gap, cutoff_gap - gap, minimum_gap, cutoff_gap)
            depth = strength_per_mass * film_potential_change(gap, -gap, minimum_gap, cutoff_gap)
            following = 0.5 * (max(low, total - reach) + min(high, total - depth))
        if following == guess:
            return guess
        guess = following
    return guess
