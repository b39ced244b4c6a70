r"""Lubrication film between two particles as a resistance c(h): a force -c u, with u = dh/dt the rate of the gap.

Since c depends on the gap alone, the impulse of a film is a difference of potentials,
:math:`\int -c\,u\,dt = -A\,[L(h_1) - L(h_0)]`, for any path between the two gaps. An integrator that uses the potential
has no stability limit from the film.
"""

from __future__ import annotations

import math

from closures.registry import law


@law("lubrication", "Brenner, Chem. Eng. Sci. 16 (1961) 242; Nijssen et al. (2023), eq. (1)")
def film_strength(viscosity: float, reduced_radius: float) -> float:
    r"""Strength A of the film between two immersed spheres, or a sphere and a wall: resistance times gap.

    .. math:: A = 6\pi\eta R^{*2}

    viscosity       eta, dynamic [Pa s]
    reduced_radius  R*; the radius of the sphere against a wall [m]
    returns         A [N s]

    Range: h << R*; used up to h = R*.

    >>> round(film_strength(1e-3, 3.175e-3) * 1e7, 2)
    1.9
    """
    return 6.0 * math.pi * viscosity * reduced_radius**2


@law("lubrication", "Nijssen et al., Powder Technol. (2023), eqs (8) and (9), doi:10.1016/j.powtec.2022.118017")
def film_resistance(strength: float, gap: float, minimum_gap: float, cutoff_gap: float) -> float:
    r"""Resistance of the film, including the load sharing below the minimum gap.

    .. math:: c = \frac{A}{h}\ (h_{min}<h\le h_{co}),\qquad c = \frac{h}{h_{min}}\frac{A}{h_{min}}\ (0<h\le h_{min})

    strength     A, from :func:`film_strength` [N s]
    gap          h, surface to surface, positive apart [m]
    minimum_gap  h_min [m]
    cutoff_gap   h_co, gap at which the film begins [m]
    returns      c, force per rate of the gap [kg/s]; 0 for h <= 0 and h > h_co

    Range: any.

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
    r"""Potential L of the film; the impulse of the film between two gaps is -A times the difference of L.

    .. math:: L = \ln\frac{\min(h,h_{co})}{h_{min}} + \tfrac12\ (h>h_{min}),\quad
              \frac{h^2}{2h_{min}^2}\ (0<h\le h_{min}),\quad 0\ (h\le 0)

    gap          h [m]
    minimum_gap  h_min, > 0 [m]
    cutoff_gap   h_co, > h_min [m]
    returns      L [-]

    Range: any.

    >>> film_potential(1.0, 1.0, 10.0), film_potential(-1.0, 1.0, 10.0)
    (0.5, 0.0)
    """
    if gap <= 0.0:
        return 0.0
    if gap <= minimum_gap:
        return 0.5 * (gap / minimum_gap) ** 2
    return math.log(min(gap, cutoff_gap) / minimum_gap) + 0.5


@law("lubrication", "difference of the film's potential; series of the inverse hyperbolic tangent")
def short_film_potential(gap: float, change: float, minimum_gap: float) -> float:
    r"""Change of the film potential over a small change of the gap on one side of h_min, without branch or logarithm.

    .. math:: L(h + x) - L(h) = 2\left(t + \tfrac13 t^3 + \tfrac15 t^5 + \dots\right),\ t = \frac{x}{2h + x}
              \quad(h>h_{min});\qquad \frac{\max(h + x,0)^2 - \max(h,0)^2}{2h_{min}^2}\quad(h\le h_{min})

    gap          h [m]
    change       x; h + x is on the same side of h_min [m]
    minimum_gap  h_min, > 0 [m]
    returns      L(h + x) - L(h) [-]

    Range: gaps that change by less than a tenth, or stay below h_min; error below 1e-16 there.

    >>> abs(short_film_potential(1.0, 0.1, 0.1) - math.log(1.1)) < 1e-16
    True
    """
    inside, start, end = gap > minimum_gap, max(gap, 0.0), max(gap + change, 0.0)
    # one division for both sides of h_min
    above = change if inside else (end - start) * (end + start)
    part = above / (2.0 * gap + change if inside else 2.0 * minimum_gap * minimum_gap)
    square = part * part
    series = 1.0 + square * (
        1.0 / 3.0 + square * (1.0 / 5.0 + square * (1.0 / 7.0 + square * (1.0 / 9.0 + square * (1.0 / 11.0))))
    )
    return 2.0 * part * series if inside else part


@law("lubrication", "difference of the film's potential; its series where the gap changes by less than a tenth")
def film_potential_change(gap: float, change: float, minimum_gap: float, cutoff_gap: float) -> float:
    r"""Change of the film potential, L(h + x) - L(h); small changes are computed without the logarithm.

    .. math:: L(h + x) - L(h)

    gap          h [m]
    change       x, change of the gap [m]
    minimum_gap  h_min, > 0 [m]
    cutoff_gap   h_co, > h_min [m]
    returns      L(h + x) - L(h) [-]

    Range: any.

    >>> exact = film_potential(1.05, 0.1, 2.0) - film_potential(1.0, 0.1, 2.0)
    >>> abs(film_potential_change(1.0, 0.05, 0.1, 2.0) - exact) < 1e-15
    True
    """
    end = gap + change
    low, high = min(gap, end), max(gap, end)
    if high <= minimum_gap or (low > minimum_gap and high < cutoff_gap and high - low < 0.1 * low):
        return short_film_potential(gap, change, minimum_gap)
    return film_potential(end, minimum_gap, cutoff_gap) - film_potential(gap, minimum_gap, cutoff_gap)


@law("lubrication", "implicit equation in the end gap, solved by Newton's method with bisection")
def speed_after_film(
    speed: float,
    gap: float,
    integrated_gap: float,
    step: float,
    strength_per_mass: float,
    minimum_gap: float,
    cutoff_gap: float,
) -> float:
    r"""Rate of the gap after a step in which only the film acts; implicit in the gap at the end of the step.

    .. math:: u_1 + B\,L(h + u_1\Delta t) = u_0 + B\,L(h_a)

    speed              u_0, rate of the gap before, positive apart [m/s]
    gap                h, at the start of the step [m]
    integrated_gap      h_a, gap up to which the impulse of the film has already been applied; h for a first step [m]
    step               dt [s]
    strength_per_mass  B = A/m* [m/s]
    minimum_gap        h_min [m]
    cutoff_gap         h_co [m]
    returns            u_1 [m/s]

    Range: any step; the equation is monotone and has one root. For h > h_min the speed is linear in ln h,
    u = -v0 + B ln(h_co/h), and a slow pair stops at h_co exp(-St).

    >>> stop = 1.0 + 1e9 * speed_after_film(-1.0, 1.0, 1.0, 1e9, 0.5, 1e-6, 1.0)      # St = v0/B = 2
    >>> round(stop / math.exp(-2.0), 6)
    1.0
    """
    total = speed + strength_per_mass * film_potential_change(gap, integrated_gap - gap, minimum_gap, cutoff_gap)
    guess = total / (1.0 + step * film_resistance(strength_per_mass, gap, minimum_gap, cutoff_gap))
    if abs(step * guess) < 1e-7 * gap:
        return guess  # the change of the resistance is below rounding
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
            # the potential lies between 0 and its value at the cut-off gap; this brackets the root
            reach = strength_per_mass * film_potential_change(gap, cutoff_gap - gap, minimum_gap, cutoff_gap)
            depth = strength_per_mass * film_potential_change(gap, -gap, minimum_gap, cutoff_gap)
            following = 0.5 * (max(low, total - reach) + min(high, total - depth))
        if following == guess:
            return guess
        guess = following
    return guess


@law("lubrication", "same equation as speed_after_film; root of a quadratic equation and a step of Halley's method")
def speed_after_short_step(
    speed: float,
    gap: float,
    integrated_gap: float,
    step: float,
    strength_per_mass: float,
    minimum_gap: float,
    cutoff_gap: float,
) -> float:
    r"""Rate of the gap after a step with a small change of the gap, without branch or logarithm; NaN otherwise.

    .. math:: u_1 - u_0 + B\,[L(h_1) - L(h_a)] = 0,\ h_1 = h + u_1\Delta t;\qquad
              L(h_1) - L(h_a) = 2\left(t + \tfrac13 t^3 + \dots\right),\ t = \frac{h_1-h_a}{h_1+h_a}\quad(h>h_{min})

    The first term of the series, and the square of the gap below h_min, leave a quadratic equation in u_1.

    speed              u_0, rate of the gap before, positive apart [m/s]
    gap                h, at the start of the step [m]
    integrated_gap      h_a, gap up to which the impulse of the film has already been applied; h for a first step [m]
    step               dt [s]
    strength_per_mass  B = A/m* [m/s]
    minimum_gap        h_min [m]
    cutoff_gap         h_co [m]
    returns            u_1, to 1e-14 relative; NaN outside the range [m/s]

    Range: the gap changes by less than a tenth within the film, or stays below h_min on one side of 0. Outside, use
    :func:`speed_after_film`.

    >>> fast, safe = (f(-1.0, 1.0, 1.001, 0.03, 0.5, 1e-6, 2.0) for f in (speed_after_short_step, speed_after_film))
    >>> abs(fast - safe) < 1e-15, speed_after_short_step(-1.0, 1.0, 1.0, 0.5, 0.5, 1e-6, 2.0)
    (True, nan)
    """
    inside = gap > minimum_gap
    weight, total = step * strength_per_mass, integrated_gap + gap
    # a u^2 + b u = c: the equation times h_1 + h_a in the film, times 2 h_min^2 below h_min
    now, before, square = max(gap, 0.0), max(integrated_gap, 0.0), 2.0 * minimum_gap * minimum_gap
    returned = strength_per_mass * (before - now) * (before + now)
    a = step if inside else (step * weight if gap > 0.0 else 0.0)
    b = total + 2.0 * weight - step * speed if inside else square + 2.0 * weight * now
    c = speed * total + 2.0 * strength_per_mass * (integrated_gap - gap) if inside else square * speed + returned
    discriminant = b * b + 4.0 * a * c
    guess = 2.0 * c / (b + math.sqrt(max(discriminant, 0.0)))
    # the rest of the series, by one step of Halley's method
    end = gap + step * guess
    begin, change = (integrated_gap if inside else minimum_gap), gap - integrated_gap + step * guess
    excess = guess - speed + strength_per_mass * short_film_potential(begin, change, minimum_gap)
    inverse = 1.0 / (end * (end + weight) if inside else 1.0)
    correction = excess * end * end * inverse
    bent = 0.5 * step * weight * correction * inverse
    guess -= correction * (1.0 - bent) if inside else 0.0
    end = gap + step * guess
    low, high = min(gap, end, integrated_gap), max(gap, end, integrated_gap)
    if inside:
        shortly = low > minimum_gap and high < cutoff_gap and high - low <= 0.1 * low
    else:
        shortly = high <= minimum_gap and (end >= 0.0 if gap > 0.0 else end <= 0.0)
    converged = not inside or 4.0 * bent * bent * abs(correction) <= 1e-14 * (abs(speed) + abs(guess))
    return guess if shortly and converged and discriminant >= 0.0 else math.nan
