r"""Lubrication film between two spheres that slide, roll and twist: resistances that grow as the logarithm of the gap.

Two surfaces slide at the slip s, and roll at the difference q of their angular velocities, both tangential. The film
exerts the force :math:`k_{ss}s + k_{sr}q` against the slip, with lever arms that add up to the distance of the centres,
and the couple :math:`k_{sr}s + k_{rr}q` against rolling. These are the leading terms of all resistance functions of two
spheres, which Jeffrey & Onishi list for each sphere.
"""

from __future__ import annotations

import math

from closures.registry import law

APERY = 1.2020569031595943
"""zeta(3)"""

JEFFREY_ONISHI = (
    "Jeffrey & Onishi, J. Fluid Mech. 139 (1984) 261; Jeffrey, Phys. Fluids A 4 (1992) 16; "
    "Goldman, Cox & Brenner, Chem. Eng. Sci. 22 (1967) 637"
)


@law("lubrication", "Jeffrey & Onishi (1984), leading terms; lever of Nijssen et al. (2023), eq. (9)")
def film_logarithm(gap: float, minimum_gap: float, smaller_radius: float) -> float:
    r"""Logarithm by which the resistances to sliding and rolling grow, including the load sharing below h_min.

    .. math:: L = \ln\frac{a}{h}\ (h>h_{min}),\qquad L = \frac{h}{h_{min}}\ln\frac{a}{h_{min}}\ (0<h\le h_{min})

    gap             h, surface to surface, positive apart [m]
    minimum_gap     h_min [m]
    smaller_radius  a, radius of the smaller sphere; of the sphere at a wall [m]
    returns         L [-]; 0 for h <= 0 and h >= a

    Range: h << a; used as far as the normal film. For equal spheres h/a is the xi of Jeffrey & Onishi. With this a the
    film and Stokes' drag of the smaller sphere add up to its exact resistance Y^A_11 within 0.03 of that drag.

    >>> round(film_logarithm(1e-6, 1e-7, 1e-3), 4), film_logarithm(0.5e-7, 1e-7, 1e-7 * math.e)
    (6.9078, 0.5)
    """
    if gap <= 0.0 or gap >= smaller_radius:
        return 0.0
    return max(math.log(smaller_radius / max(gap, minimum_gap)), 0.0) * min(gap / minimum_gap, 1.0)


@law("lubrication", JEFFREY_ONISHI)
def shear_resistance(viscosity: float, reduced_radius: float, asymmetry: float) -> float:
    r"""Resistance of the film to sliding, over the logarithm L.

    .. math:: k_{ss}/L = \tfrac25\pi\eta R^*\left(5 + 3\alpha^2\right),\quad \alpha = \frac{R_1-R_2}{R_1+R_2}

    viscosity       eta, dynamic [Pa s]
    reduced_radius  R*; the radius of the sphere at a wall [m]
    asymmetry       alpha; -1 for a sphere and a wall [-]
    returns         k_ss/L, force over the slip of the surfaces [kg/s]

    Range: h << R*. Equal spheres of radius a: pi eta a, as Ball & Melrose (1997); wall: 16/5 pi eta a.

    >>> round(shear_resistance(1.0, 0.5, 0.0) / math.pi, 12), round(shear_resistance(1.0, 1.0, -1.0) / math.pi, 12)
    (1.0, 3.2)
    """
    return 0.4 * math.pi * viscosity * reduced_radius * (5.0 + 3.0 * asymmetry * asymmetry)


@law("lubrication", JEFFREY_ONISHI)
def shear_roll_resistance(viscosity: float, reduced_radius: float, asymmetry: float) -> float:
    r"""Resistance of the film that couples sliding and rolling of unequal spheres, over the logarithm L.

    .. math:: k_{sr}/L = \tfrac{12}5\pi\eta R^{*2}\alpha,\quad \alpha = \frac{R_1-R_2}{R_1+R_2}

    viscosity       eta, dynamic [Pa s]
    reduced_radius  R*; the radius of the sphere at a wall [m]
    asymmetry       alpha, of the first sphere against the second; -1 for a sphere and a wall [-]
    returns         k_sr/L, force over rolling rate, and couple over slip [kg m/s]

    Range: h << R*.

    >>> round(shear_roll_resistance(1.0, 1.0, -1.0) / math.pi, 12)
    -2.4
    """
    return 2.4 * math.pi * viscosity * reduced_radius * reduced_radius * asymmetry


@law("lubrication", JEFFREY_ONISHI)
def roll_resistance(viscosity: float, reduced_radius: float) -> float:
    r"""Resistance of the film to rolling, over the logarithm L.

    .. math:: k_{rr}/L = \tfrac{24}5\pi\eta R^{*3}

    viscosity       eta, dynamic [Pa s]
    reduced_radius  R*; the radius of the sphere at a wall [m]
    returns         k_rr/L, couple over the difference of the angular velocities [kg m2/s]

    Range: h << R*. A sphere that turns beside a wall feels 16/5 pi eta a^3 L in all, as Goldman, Cox & Brenner.

    >>> round(roll_resistance(1.0, 0.5) / math.pi, 12)
    0.6
    """
    return 4.8 * math.pi * viscosity * reduced_radius**3


@law("lubrication", "Jeffrey & Onishi, J. Fluid Mech. 139 (1984) 261, section 7")
def twist_resistance(viscosity: float, gap: float, reduced_radius: float, logarithm: float) -> float:
    r"""Resistance of the film to twisting: spheres that turn against each other about their line of centres.

    .. math:: k_{tt} = 4\pi\eta R^{*2}\left[\zeta(3)R^* - h L\right]

    viscosity       eta, dynamic [Pa s]
    gap             h, at least h_min [m]
    reduced_radius  R*; the radius of the sphere at a wall [m]
    logarithm       L at this gap [-]
    returns         k_tt, couple over the difference of the spins about the line of centres [kg m2/s]

    Range: h << R*. It stays finite in contact. This is the action of one sphere on the other; the change of each
    sphere's resistance to its own spin by the neighbour is smaller, 5 % for equal spheres in contact, and left out.

    >>> round(twist_resistance(1.0, 0.0, 0.5, 0.0) / (8.0 * math.pi), 4)    # X^C_12 of equal spheres in contact
    0.0751
    """
    return 4.0 * math.pi * viscosity * reduced_radius * reduced_radius * (APERY * reduced_radius - gap * logarithm)
