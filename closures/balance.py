"""Balance of buoyant weight and drag: terminal velocity, minimum fluidisation and bed expansion for any drag law.

In a bed the balance is 18 Re F(Re, eps) / eps = Ar, since the total fluid force is F_d / eps. The drag law is an
argument, a function of Reynolds number and voidage. Compiled loops do not call these functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from closures.numbers import archimedes as archimedes_number

Drag = Callable[[float, float], float]


def reynolds_in_balance(archimedes: float, voidage: float, drag: Drag) -> float:
    r"""Reynolds number of the flow that fluidises a bed of given voidage.

    .. math:: 18\,Re\,F(Re,\varepsilon)/\varepsilon = Ar

    archimedes  Ar, >= 0 [-]
    voidage     eps; 1 for an isolated sphere, that of the packed bed for minimum fluidisation [-]
    drag        F(reynolds, voidage); Re F must increase with Re
    returns     Re on the superficial velocity [-], to 1e-12 relative; NaN if no flow carries the bed, because the drag
                of a law beyond its range may fall with the velocity

    >>> from closures.drag import ergun
    >>> round(reynolds_in_balance(1900 / 0.125, 0.5, ergun), 2)      # 1.75 Re^2 + 75 Re = 1900
    17.88
    """
    if archimedes <= 0.0:
        return 0.0

    def excess(reynolds: float) -> float:
        return _excess(reynolds, voidage, drag, archimedes)

    low = high = archimedes / 18.0
    while excess(high) < 0.0:
        high *= 2.0
    if math.isinf(high):
        return math.nan
    while excess(low) > 0.0:
        low *= 0.5
    return _root(excess, low, high)


def voidage_in_balance(archimedes: float, reynolds: float, drag: Drag, packed_voidage: float = 0.4) -> float:
    r"""Voidage to which a flow expands a bed.

    .. math:: 18\,Re\,F(Re,\varepsilon)/\varepsilon = Ar

    archimedes      Ar, > 0 [-]
    reynolds        Re on the superficial velocity [-]
    drag            F(reynolds, voidage); F / eps must decrease with eps
    packed_voidage  eps of the packed bed [-]
    returns         eps [-]; packed_voidage below minimum fluidisation, 1 above the terminal velocity

    >>> from closures.drag import wen_yu
    >>> round(voidage_in_balance(1.0, 0.5**4.65 / 18.0, wen_yu), 3)     # creeping: eps^4.65 = 18 Re/Ar
    0.5
    """

    def excess(voidage: float) -> float:
        return _excess(reynolds, voidage, drag, archimedes)

    if excess(packed_voidage) <= 0.0:
        return packed_voidage
    if excess(1.0) >= 0.0:
        return 1.0
    return _root(excess, packed_voidage, 1.0)


def pressure_gradient(
    velocity: float, diameter: float, density: float, viscosity: float, voidage: float, drag: Drag
) -> float:
    r"""Pressure gradient of the flow through fixed spheres, for any drag law.

    .. math:: \frac{dp}{dz} = \frac{18\,\eta\,(1-\varepsilon)\,F(Re,\varepsilon)\,U}{\varepsilon\,d^2}

    velocity   U, superficial [m/s]
    diameter   d [m]
    density    rho_f [kg/m3]
    viscosity  eta, dynamic [Pa s]
    voidage    eps [-]
    drag       F(reynolds, voidage)
    returns    dp/dz, without the hydrostatic part [Pa/m]

    >>> from closures.bed import ergun_gradient
    >>> from closures.drag import ergun
    >>> flow = (0.02, 1e-3, 10.0, 1.5e-3, 0.451335)
    >>> round(pressure_gradient(*flow, ergun) / ergun_gradient(*flow), 12)
    1.0
    """
    factor = drag(density * velocity * diameter / viscosity, voidage)
    return 18.0 * viscosity * (1.0 - voidage) * factor * velocity / (voidage * diameter**2)


def terminal_velocity(
    diameter: float, density: float, fluid_density: float, viscosity: float, drag: Drag, gravity: float = 9.81
) -> float:
    """Terminal velocity of an isolated sphere for any drag law.

    diameter       d [m]
    density        rho_p, of the sphere [kg/m3]
    fluid_density  rho_f [kg/m3]
    viscosity      eta, dynamic [Pa s]
    drag           F(reynolds, voidage)
    gravity        g [m/s2]
    returns        u_t, >= 0, falling or rising [m/s]

    >>> from closures.drag_single import brown_lawler
    >>> round(terminal_velocity(0.5e-3, 2554.9, 998.0, 8.882e-4, brown_lawler), 4)   # Mordant & Pinton: 0.0741 m/s
    0.0796
    """
    return fluidising_velocity(diameter, density, fluid_density, viscosity, 1.0, drag, gravity)


class Sphere(NamedTuple):
    """A sphere that falls or rises alone in a fluid."""

    diameter: float  # d [m]
    density: float  # rho_p [kg/m3]
    fluid_density: float  # rho_f [kg/m3]
    viscosity: float  # eta, dynamic, of the fluid [Pa s]
    drag: Drag  # F(reynolds, voidage)
    gravity: float = 9.81  # g [m/s2]


def speed_after(time: float, speed: float, sphere: Sphere, *, added_mass: float = 0.0) -> float:
    r"""Speed of an isolated falling or rising sphere after a given time, from its equation of motion.

    .. math:: (\rho_p + C_m\rho_f)V\dot v = |\rho_p - \rho_f|Vg - 3\pi\eta d\,F(Re)\,v

    time        t [s]
    speed       v at the start, in the direction in which the sphere falls or rises [m/s]
    sphere      and the fluid around it
    added_mass  C_m; 0.5 for an isolated sphere [-]
    returns     v after the time t, to 1e-9 relative [m/s]

    >>> from closures.drag_single import stokes
    >>> relaxation = 2500 * 1e-8 / 18e-3              # 0.1 mm in water, Stokes drag: u_t (1 - 1/e)
    >>> round(speed_after(relaxation, 0.0, Sphere(1e-4, 2500.0, 1000.0, 1e-3, stokes)) / 8.175e-3, 6)
    0.632121
    """
    from scipy.integrate import solve_ivp  # imported here: importing the laws alone does not load scipy

    diameter, density, fluid_density, viscosity, drag, gravity = sphere
    inertia = (density + added_mass * fluid_density) / 6.0
    weight = abs(density - fluid_density) / 6.0 * gravity
    friction = 3.0 * viscosity / diameter**2

    def acceleration(_: float, v: list[float]) -> float:
        factor = drag(fluid_density * diameter * abs(float(v[0])) / viscosity, 1.0)
        return (weight - friction * factor * float(v[0])) / inertia

    solved = solve_ivp(acceleration, (0.0, time), [speed], t_eval=[time], rtol=1e-9, atol=1e-15)
    return float(solved.y[0, -1])


def fluidising_velocity(
    diameter: float,
    density: float,
    fluid_density: float,
    viscosity: float,
    voidage: float,
    drag: Drag,
    gravity: float = 9.81,
) -> float:
    """Superficial velocity that fluidises a bed of given voidage; at the packed voidage, minimum fluidisation.

    diameter       d [m]
    density        rho_p, of the spheres [kg/m3]
    fluid_density  rho_f [kg/m3]
    viscosity      eta, dynamic [Pa s]
    voidage        eps [-]
    drag           F(reynolds, voidage)
    gravity        g [m/s2]
    returns        U, >= 0 [m/s]

    >>> from closures.drag import ergun
    >>> round(fluidising_velocity(3.256e-3, 1131.0, 1.2, 1.8e-5, 0.42, ergun), 2)   # NETL challenge I: measured 1.05
    1.02
    """
    number = abs(archimedes_number(diameter, density, fluid_density, viscosity, gravity))
    return reynolds_in_balance(number, voidage, drag) * viscosity / (fluid_density * diameter)


def inversion_velocity(
    terminal_velocities: tuple[float, float],
    exponents: tuple[float, float],
    densities: tuple[float, float],
    fluid_density: float,
) -> float:
    r"""Superficial velocity at which two species of a liquid-fluidised bed change places (layer inversion).

    .. math:: (1-\varepsilon_1)(\rho_1-\rho_f) = (1-\varepsilon_2)(\rho_2-\rho_f),\qquad
              \varepsilon_i = (U/u_i)^{1/n_i}

    terminal_velocities  u_i, of each species, at voidage 1 [m/s]
    exponents            n_i, Richardson-Zaki exponent of each species alone [-]
    densities            rho_i, of the solids [kg/m3]
    fluid_density        rho_f [kg/m3]
    returns              U, below both terminal velocities [m/s]; NaN if one species is the lower one at all of them

    The layer of larger bulk density lies below; the layers change places where their bulk densities are equal.

    Range: both layers looser than packed.

    Epstein & LeClair, Chem. Eng. Sci. 40 (1985) 1517; observed by Moritomi et al., Chem. Eng. Sci. 37 (1982) 1751.

    >>> round(inversion_velocity((1.0, 4.0), (1.0, 1.0), (3000.0, 2000.0), 1000.0), 4)     # 2 (1 - U) = 1 - U/4
    0.5714
    """

    def excess(velocity: float) -> float:
        first, second = (
            (1.0 - (velocity / terminal) ** (1.0 / exponent)) * (density - fluid_density)
            for terminal, exponent, density in zip(terminal_velocities, exponents, densities)
        )
        return float(first - second)

    low, high = 0.0, min(terminal_velocities)
    return _root(excess, low, high) if excess(low) * excess(high) < 0.0 else float("nan")


def voidage_of_slip(velocity_ratio: float, slip: Callable[[float], float]) -> float:
    r"""Voidage to which a flow expands a bed whose slip velocity is known.

    .. math:: U/u_t = \varepsilon V(\varepsilon)

    velocity_ratio  U/u_t, superficial over terminal velocity, >= 0 [-]
    slip            V(voidage), slip velocity over u_t; must increase with the voidage
    returns         eps [-]; 1 above the terminal velocity

    >>> round(voidage_of_slip(0.6**3, lambda voidage: voidage**2), 12)
    0.6
    """
    if velocity_ratio >= slip(1.0):
        return 1.0
    return _root(lambda voidage: voidage * slip(voidage) - velocity_ratio, 0.0, 1.0)


def _excess(reynolds: float, voidage: float, drag: Drag, archimedes: float) -> float:
    """Drag beyond the buoyant weight, in units of Ar."""
    return 18.0 * reynolds * drag(reynolds, voidage) / voidage - archimedes


def _root(excess: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import brentq  # imported here: importing the laws alone does not load scipy

    if low == high:
        return low
    try:
        return float(brentq(excess, low, high, xtol=1e-300, rtol=1e-12, maxiter=500))
    except RuntimeError as failure:
        raise ArithmeticError(f"no balance between {low:g} and {high:g}: {failure}") from failure
