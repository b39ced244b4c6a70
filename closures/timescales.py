"""Time scales of contacts, films, drag and flow; they limit the time step."""

from __future__ import annotations

import math

from closures.contact import hertz_largest_overlap
from closures.registry import law


@law("timescale", "Johnson, Contact Mechanics (1985) eq. (11.24)")
def hertz_time(reduced_mass: float, stiffness: float, speed: float) -> float:
    r"""Duration of an undamped Hertz impact.

    .. math:: t_H = 2.9432\,\delta_{max}/v

    reduced_mass  m* [kg]
    stiffness     k = 4/3 E* sqrt(R*) [N/m^1.5]
    speed         v, normal approach speed, > 0 [m/s]
    returns       t_H [s]; increases as v^(-1/5) for slow impacts

    Range: overlap << R*, elastic solids.

    Two glass spheres of 10 mm radius at 20 m/s are in contact for 40.338 us (Chung & Ooi 2011, test 1).

    >>> from closures.contact import hertz_stiffness, reduced_modulus
    >>> k = hertz_stiffness(reduced_modulus(48e9, 0.2, 48e9, 0.2), 5e-3)
    >>> round(hertz_time(0.5 * 2800 * 4 / 3 * math.pi * 0.01**3, k, 20.0) * 1e6, 2)
    40.34
    """
    return 2.9432 * hertz_largest_overlap(reduced_mass, stiffness, speed) / speed


@law(
    "timescale",
    "linear stability of velocity Verlet, step < 2/omega, for the tangent stiffness of Hertz' law",
)
def overlap_period(reduced_mass: float, stiffness: float, overlap: float) -> float:
    r"""Inverse angular frequency of a Hertz contact at a given overlap.

    .. math:: 1/\omega = \sqrt{m^*/(\tfrac32 k\sqrt\delta)}

    reduced_mass  m* [kg]
    stiffness     k [N/m^1.5]
    overlap       delta, > 0 [m]
    returns       1/omega [s]

    Range: any.

    >>> round(overlap_period(1.5, 1.0, 1.0), 3)
    1.0
    """
    return math.sqrt(reduced_mass / (1.5 * stiffness * math.sqrt(overlap)))


@law("timescale", "inverse rate of Nijssen et al. (2023), eq. (8), at the minimum gap")
def film_time(reduced_mass: float, strength: float, gap: float) -> float:
    r"""Relaxation time of a pair in its film at a given gap.

    .. math:: t_f = m^* h / A

    reduced_mass  m* [kg]
    strength      A = 6 pi eta R*^2 [N s]
    gap           h [m]
    returns       t_f [s]

    Range: h >= h_min.

    >>> film_time(1.0, 2.0, 4.0)
    2.0
    """
    return reduced_mass * gap / strength


@law("timescale", "inertia of a sphere over its drag in the normal form of closures.drag")
def drag_time(diameter: float, density: float, viscosity: float, voidage: float, drag_factor: float) -> float:
    r"""Relaxation time of a sphere by drag.

    .. math:: \tau = \frac{\rho_p d^2}{18\eta\varepsilon F}

    diameter     d [m]
    density      rho_p, of the sphere [kg/m3]
    viscosity    eta, dynamic [Pa s]
    voidage      eps [-]
    drag_factor  F, over Stokes drag on the superficial slip [-]
    returns      tau [s]

    Range: any.

    >>> round(drag_time(1e-3, 1800.0, 1e-3, 1.0, 1.0), 9)
    0.1
    """
    return density * diameter * diameter / (18.0 * viscosity * voidage * drag_factor)


@law("timescale", "Courant, Friedrichs & Lewy, Math. Ann. 100 (1928) 32")
def courant_time(cell: float, speed: float) -> float:
    r"""Time in which the flow crosses a cell; the time step over it is the Courant number.

    .. math:: t_C = \Delta x / u

    cell     dx, width of the cell [m]
    speed    u, > 0 [m/s]
    returns  t_C [s]

    Range: any.

    >>> courant_time(0.5, 2.0)
    0.25
    """
    return cell / speed
