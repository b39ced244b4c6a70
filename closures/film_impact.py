r"""A bead that falls through a liquid film onto a plate: the mass of liquid that moves with it, and what that costs.

The liquid in the gap under the bead leaves along the plate with u = r v/(2 h) and has kinetic energy in proportion to
v^2: an added mass, which grows as the bead comes down. When the bead turns at the plate, this liquid has to turn too.
"""

from __future__ import annotations

import math

from closures.registry import law

STEPS = 400
"""Steps in the logarithm of the gap, in and again out."""

_SOURCE = "thin-film momentum equation; cf. Singh, Windows-Yule & Nair, arXiv:2603.23100 (2026)"


@law("film_impact", "kinetic energy of the thin film under a sphere; see Range")
def film_added_mass(density_ratio: float, film_ratio: float) -> float:
    r"""Added mass of the film at the moment of contact, over the mass of the bead.

    .. math:: \mu = \frac{M_a}{m} = 3\,\frac{\rho_l}{\rho_s}\,\gamma,\qquad
              M_a = \frac{\pi\rho_l}{2}\int_0^{r_w}\frac{r^3}{h}\,dr,\quad h = \frac{r^2}{D},\quad r_w^2 = 2D\delta

    density_ratio  rho_l/rho_s, liquid over solid [-]
    film_ratio     gamma = delta/D, depth of the film over the diameter [-]
    returns        mu [-]

    Range: gamma << 1. The wetted radius r_w is that of a film whose displaced liquid piles up under the bead.

    >>> round(film_added_mass(998 / 2580, 0.4 / 8), 3)          # 8 mm of glass in 0.4 mm of water
    0.058
    """
    return 3.0 * density_ratio * film_ratio


@law("film_impact", "kinetic energy of the thin film between two spheres; see Range")
def pair_added_mass(density: float, film: float, reduced_radius: float) -> float:
    r"""Added mass of the film between two bodies at the moment of contact.

    .. math:: M_a = \frac{\pi\rho_l}{2}\int_0^{r_w}\frac{r^3}{h}\,dr = 2\pi\rho_l R^{*2}\delta,\qquad
              h = \frac{r^2}{2R^*},\quad r_w^2 = 4R^*\delta

    density         rho_l, of the liquid [kg/m3]
    film            delta, thickness of the liquid on both bodies together [m]
    reduced_radius  R*; at a wall the radius of the sphere [m]
    returns         M_a [kg]

    Range: delta << R*. At a wall it is :func:`film_added_mass` times the mass of the sphere.

    >>> sphere = 2580 * math.pi / 6 * 8e-3**3
    >>> round(pair_added_mass(998, 0.4e-3, 4e-3) / sphere, 3), round(film_added_mass(998 / 2580, 0.4 / 8), 3)
    (0.058, 0.058)
    """
    return 2.0 * math.pi * density * reduced_radius * reduced_radius * film


@law("film_impact", "momentum of bead and film at contact")
def reversal_restitution(restitution: float, added_mass: float) -> float:
    r"""Speed of the bead once the film has turned with it, over its speed before contact.

    .. math:: e = \frac{e_r - \mu}{1 + \mu}

    restitution  e_r, dry [-]
    added_mass   mu, from :func:`film_added_mass` [-]
    returns      e [-]; below 0 the film pushes the bead onto the plate again

    Range: any. At high Stokes numbers this is an upper estimate of the restitution of the whole impact, and
    e/(1 + mu), with the loss on the way in, a lower one (:func:`slowest_rebound`). Both are estimates: resolved impacts
    end above them where the liquid pushes the bead up as it closes in behind it.

    >>> round(reversal_restitution(0.98, 0.058), 3)
    0.871
    """
    return (restitution - added_mass) / (1.0 + added_mass)


@law("film_impact", "momentum of bead and film on the way in and at contact")
def slowest_rebound(restitution: float, added_mass: float) -> float:
    r"""Lower estimate of the restitution at high Stokes numbers: all liquid is set in motion, none gives it back.

    .. math:: e = \frac{e_r - \mu}{(1 + \mu)^2}

    restitution  e_r, dry [-]
    added_mass   mu, from :func:`film_added_mass` [-]
    returns      e [-]

    Range: St above about 500; the lower side of the bracket of :func:`reversal_restitution`.

    >>> round(slowest_rebound(0.98, 0.058), 3)
    0.824
    """
    return (restitution - added_mass) / (1.0 + added_mass) ** 2


@law("film_impact", _SOURCE)
def moving_added_mass(density_ratio: float, film_ratio: float, gap_ratio: float) -> float:
    r"""Added mass of the film while the bead is at a height, over the mass of the bead.

    .. math:: \frac{M_a}{m} = \frac32\,\frac{\rho_l}{\rho_s}\left[x_w - x - x\ln\frac{x_w}{x}\right],\qquad
              x = h_0/D,\quad x_w = 2\gamma - x

    density_ratio  rho_l/rho_s [-]
    film_ratio     gamma [-]
    gap_ratio      x, height of the lowest point of the bead over its diameter, 0 < x <= gamma [-]
    returns        M_a/m [-]; :func:`film_added_mass` for x -> 0

    Range: gamma << 1.

    >>> round(moving_added_mass(0.387, 0.05, 1e-9) / film_added_mass(0.387, 0.05), 6)
    1.0
    """
    gap = min(gap_ratio, film_ratio)
    edge = 2.0 * film_ratio - gap
    return 1.5 * density_ratio * (edge - gap - gap * math.log(edge / gap))


@law("film_impact", _SOURCE)
def film_pressure_force(density_ratio: float, film_ratio: float, gap_ratio: float, approaching: float) -> float:
    r"""Force of the film's inertia at constant speed, over m v^2/D; away from the plate.

    .. math:: \frac95\,\frac{\rho_l}{\rho_s}\cdot\frac12\left[\ln X - \frac1X + \frac1{X^2}\right]
              + 6\,\frac{\rho_l}{\rho_s}\,\frac{\gamma(\gamma - x)}{(2\gamma - x)^2}\ \text{(on the way in)},\qquad
              X = \frac{2\gamma - x}{x}

    density_ratio  rho_l/rho_s [-]
    film_ratio     gamma [-]
    gap_ratio      x = h_0/D, 0 < x <= gamma [-]
    approaching    1 on the way in, 0 on the way out [-]
    returns        force [-]

    Range: gamma << 1. The first term is the momentum of the flow in the gap, with 6/5 for its parabolic profile; the
    second, the pressure at the front that sets the film outside in motion. The closure of the front is one of several
    possible; it is not derived.

    >>> film_pressure_force(0.387, 0.05, 0.05, 1.0)
    0.0
    """
    gap = min(gap_ratio, film_ratio)
    edge = 2.0 * film_ratio - gap
    flow = 0.9 * (math.log(edge / gap) - gap / edge + gap / edge * gap / edge)
    front = 6.0 * film_ratio * (film_ratio - gap) / (edge * edge)
    return density_ratio * (flow + approaching * front)


@law("film_impact", _SOURCE)
def speed_gradient(
    speed: float,
    gap_ratio: float,
    approaching: float,
    stokes: float,
    film_ratio: float,
    density_ratio: float,
    gravity: float,
) -> float:
    r"""Change of the speed of the bead with the logarithm of its height: equation of motion of bead and thin film.

    .. math:: (m + M_a)\,\dot v = F_p - m g \pm F_\eta,\qquad
              F_\eta = \frac{6\pi\eta R^2 v}{h_0}\Big(1-\frac{h_0}{h_w}\Big)^2,\qquad h_w = 2\delta - h_0

    speed          v over that at the undisturbed surface, > 0 in either direction [-]
    gap_ratio      x = h_0/D, 0 < x <= gamma [-]
    approaching    1 on the way in, 0 on the way out [-]
    stokes         St = rho_s D v/(9 eta), of the speed at the undisturbed surface [-]
    film_ratio     gamma = delta/D [-]
    density_ratio  rho_l/rho_s [-]
    gravity        g D/v^2, of the same speed [-]
    returns        dv/d(ln x) [-]

    M_a is :func:`moving_added_mass`, F_p :func:`film_pressure_force`.

    Range: gamma << 1, no surface tension.

    >>> speed_gradient(1.0, 0.05, 1.0, 1e3, 0.05, 0.387, 0.0)            # no force yet where the bead meets the film
    0.0
    """
    gap = min(gap_ratio, film_ratio)
    share = 1.0 - gap / (2.0 * film_ratio - gap)
    viscous = speed / (stokes * gap) * share * share
    upward = film_pressure_force(density_ratio, film_ratio, gap, approaching) * speed * speed - gravity
    upward += (2.0 * approaching - 1.0) * viscous
    return gap * upward / ((1.0 + moving_added_mass(density_ratio, film_ratio, gap)) * speed)


@law("film_impact", _SOURCE, stokes=(34.0, 3440.0), film_ratio=(0.05, 0.143))
def reduced_impact(
    stokes: float, film_ratio: float, density_ratio: float, restitution: float, touching: float, gravity: float
) -> float:
    r"""Restitution of a bead on a plate with a film, from the equation of motion of bead and thin film.

    .. math:: e = \frac{v(\delta)_{out}}{v(\delta)_{in}},\qquad
              v^+ = \frac{e_r m - M_a}{m + M_a}\,v^-\ \text{at}\ h_0 = h_{min}

    stokes         St = rho_s D v/(9 eta), of the speed where the bead meets the film [-]
    film_ratio     gamma = delta/D [-]
    density_ratio  rho_l/rho_s [-]
    restitution    e_r, dry [-]
    touching       h_min/delta, gap at which the solids touch over the depth of the film [-]
    gravity        g D/v^2 [-]
    returns        e, at the undisturbed surface [-]; 0 where the bead sticks

    The motion in and out is that of :func:`speed_gradient`, integrated by the classical Runge-Kutta method.

    Range: gamma << 1, no surface tension. Water at 0.2 to 1.5 m/s and beads of 2.8 to 8 mm are within 0.041 of the fit
    :func:`closures.restitution.singh`; oil M5 is 0.04 to 0.12 above it.

    >>> round(reduced_impact(2293.3, 0.05, 998 / 2580, 0.98, 1e-6 / 0.4e-3, 9.81 * 8e-3), 3)     # 8 mm at 1 m/s
    0.849
    """
    speed = 1.0
    step = math.log(touching) / STEPS
    for count in range(2 * STEPS):
        approaching = 1.0 if count < STEPS else 0.0
        if count == STEPS:
            mass = moving_added_mass(density_ratio, film_ratio, touching * film_ratio)
            speed *= (restitution - mass) / (1.0 + mass)
            step = -step
        place = math.log(film_ratio) + (count * step if count < STEPS else (count - 2 * STEPS) * step)
        change, slope = 0.0, 0.0
        for part in range(4):
            share = 0.0 if part == 0 else (1.0 if part == 3 else 0.5)
            guess = speed + share * step * slope
            if not guess > 0.0:
                return 0.0
            gap = math.exp(place + share * step)
            slope = speed_gradient(guess, gap, approaching, stokes, film_ratio, density_ratio, gravity)
            change += slope * (1.0 if part == 0 or part == 3 else 2.0)
        speed += step * change / 6.0
        if not speed > 0.0:
            return 0.0
    return speed
