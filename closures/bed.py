"""Packed and fluidised beds: pressure gradient, minimum fluidisation, terminal velocity, expansion."""

from __future__ import annotations

import math

from closures.registry import law


@law("bed", "Ergun, Chem. Eng. Prog. 48 (1952) 89", voidage=(0.36, 0.8))
def ergun_gradient(velocity: float, diameter: float, density: float, viscosity: float, voidage: float) -> float:
    r"""Pressure gradient of a packed bed (Ergun).

    .. math:: \frac{\Delta p}{L} = 150\frac{(1-\varepsilon)^2\eta U}{\varepsilon^3d^2}
              + 1.75\frac{(1-\varepsilon)\rho U^2}{\varepsilon^3d}

    velocity   U, superficial, >= 0 [m/s]
    diameter   d [m]
    density    rho, of the fluid [kg/m3]
    viscosity  eta, dynamic [Pa s]
    voidage    eps [-]
    returns    dp/L, without the hydrostatic part [Pa/m]

    Range: 0.36 < eps < 0.8.

    >>> round(ergun_gradient(0.02, 1e-3, 10.0, 1.5e-3, 0.451335) * 15.6e-3, 1)
    230.5
    """
    scale = (1.0 - voidage) * velocity / (voidage * voidage * voidage * diameter)
    return scale * (150.0 * (1.0 - voidage) * viscosity / diameter + 1.75 * density * velocity)


@law("bed", "Ergun (1952), set equal to the buoyant weight of the bed", voidage=(0.36, 0.8))
def fluidisation_reynolds_ergun(archimedes: float, voidage: float) -> float:
    r"""Reynolds number of minimum fluidisation for a known voidage (Ergun).

    .. math:: \frac{1.75}{\varepsilon^3}Re^2 + \frac{150(1-\varepsilon)}{\varepsilon^3}Re = Ar

    archimedes  Ar, >= 0 [-]
    voidage     eps, at minimum fluidisation [-]
    returns     Re_mf = rho u_mf d / eta [-]

    Range: 0.36 < eps < 0.8.

    >>> round(fluidisation_reynolds_ergun(1900 / 0.125, 0.5), 2)      # 1.75 Re^2 + 75 Re = 1900
    17.88
    """
    half = 75.0 * (1.0 - voidage)
    weight = archimedes * voidage * voidage * voidage
    return weight / (half + math.sqrt(half * half + 1.75 * weight))


@law("bed", "Wen & Yu, AIChE J. 12 (1966) 610, doi:10.1002/aic.690120343")
def fluidisation_reynolds_wen_yu(archimedes: float) -> float:
    r"""Reynolds number of minimum fluidisation for an unknown voidage (Wen and Yu).

    .. math:: Re_{mf} = \sqrt{33.7^2 + 0.0408 Ar} - 33.7

    archimedes  Ar, >= 0 [-]
    returns     Re_mf = rho u_mf d / eta [-]

    Range: 0.001 < Re < 4000; scatter about 30 %.

    >>> round(fluidisation_reynolds_wen_yu(1e5), 2)
    38.52
    """
    part = 0.0408 * archimedes
    return part / (math.sqrt(33.7 * 33.7 + part) + 33.7)


@law("bed", "Abraham, Phys. Fluids 13 (1970) 2194, solved for Re in the balance Ar = 18 Re F")
def terminal_reynolds_abraham(archimedes: float) -> float:
    r"""Terminal Reynolds number of a sphere with Abraham's drag law.

    .. math:: \sqrt{Re}\,(1 + \sqrt{Re}/9.06) = \sqrt{Ar/18}

    archimedes  Ar, >= 0 [-]
    returns     Re_t [-]

    Range: Re_t < 5000, that of the drag law.

    >>> round(terminal_reynolds_abraham(49.14**2), 1)      # Mordant & Pinton (2000), 0.5 mm glass: measured 41
    44.5
    """
    side = math.sqrt(archimedes / 18.0)
    root = 2.0 * side / (1.0 + math.sqrt(1.0 + 4.0 * side / 9.06))
    return root * root


@law("bed", "Brown & Lawler, J. Environ. Eng. 129 (2003) 222, solved for Re in the balance Ar = 18 Re F")
def terminal_reynolds_brown_lawler(archimedes: float) -> float:
    r"""Terminal Reynolds number of a sphere with the drag law of Brown and Lawler.

    .. math:: Ar = 18 Re + 2.7 Re^{1.681} + \frac{0.30525\,Re^3}{Re + 8710}

    archimedes  Ar, >= 0 [-]
    returns     Re_t [-]

    Range: Re_t < 2e5, that of the drag law. Solved by Newton's method from above, to 1e-12 relative.

    >>> round(terminal_reynolds_brown_lawler(49.14**2), 1)      # Mordant & Pinton (2000), 0.5 mm glass: measured 41
    44.7
    """
    number = archimedes / 18.0
    for _ in range(60):
        pull = 18.0 * number + 2.7 * number**1.681 + 0.30525 * number * number * number / (number + 8710.0)
        inertia = 0.30525 * number * number * (2.0 * number + 26130.0) / ((number + 8710.0) * (number + 8710.0))
        number -= (pull - archimedes) / (18.0 + 4.5387 * number**0.681 + inertia)
    return float(number)


@law("bed", "Richardson & Zaki, Trans. Inst. Chem. Eng. 32 (1954) 35")
def exponent_richardson_zaki(reynolds: float, wall_ratio: float) -> float:
    r"""Richardson-Zaki exponent n of bed expansion.

    .. math:: n = 4.65 + 19.5\tfrac dD,\ (4.35 + 17.5\tfrac dD)Re^{-0.03},\ (4.45 + 18\tfrac dD)Re^{-0.1},\
              4.45 Re^{-0.1},\ 2.39

    reynolds    Re_t, at the terminal velocity; the pieces meet at 0.2, 1, 200 and 500 [-]
    wall_ratio  d/D, sphere over column diameter; 0 for a wide column [-]
    returns     n [-]

    Range: any. The pieces do not meet exactly: n jumps by up to 2.3 % in a wide column.

    >>> exponent_richardson_zaki(0.1, 0.0), exponent_richardson_zaki(1000.0, 0.0)
    (4.65, 2.39)
    """
    if reynolds < 0.2:
        return 4.65 + 19.5 * wall_ratio
    if reynolds < 1.0:
        return float((4.35 + 17.5 * wall_ratio) * reynolds**-0.03)
    if reynolds < 200.0:
        return float((4.45 + 18.0 * wall_ratio) * reynolds**-0.1)
    if reynolds < 500.0:
        return float(4.45 * reynolds**-0.1)
    return 2.39


@law("bed", "Garside & Al-Dibouni, Ind. Eng. Chem. Process Des. Dev. 16 (1977) 206", reynolds=(1e-3, 3e4))
def exponent_garside(reynolds: float) -> float:
    r"""Exponent n of bed expansion (Garside and Al-Dibouni).

    .. math:: \frac{5.1-n}{n-2.7} = 0.1 Re^{0.9}

    reynolds  Re_t, at the terminal velocity [-]
    returns   n [-]

    Range: 1e-3 < Re_t < 3e4.

    >>> round(exponent_garside(10.0 ** (1 / 0.9)), 6)      # halfway between 5.1 and 2.7
    3.9
    """
    ratio = 0.1 * reynolds**0.9
    return float((5.1 + 2.7 * ratio) / (1.0 + ratio))


@law("bed", "Khan & Richardson, Chem. Eng. Commun. 78 (1989) 111")
def exponent_khan_richardson(archimedes: float, wall_ratio: float) -> float:
    r"""Exponent n of bed expansion with a wall correction (Khan and Richardson).

    .. math:: \frac{4.8-n}{n-2.4} = 0.043 Ar^{0.57}\,[1 - 1.24(d/D)^{0.27}]

    archimedes  Ar [-]
    wall_ratio  d/D, sphere over column diameter; 0 for a wide column [-]
    returns     n [-]

    Range: d/D < 0.45; above it the wall correction is limited to 0.

    >>> round(exponent_khan_richardson(0.0, 0.0), 6)
    4.8
    """
    wall = max(0.0, 1.0 - 1.24 * wall_ratio**0.27)
    ratio = 0.043 * archimedes**0.57 * wall
    return float((4.8 + 2.4 * ratio) / (1.0 + ratio))


@law("bed", "Richardson & Zaki, Trans. Inst. Chem. Eng. 32 (1954) 35")
def expanded_voidage(velocity: float, terminal_velocity: float, exponent: float) -> float:
    r"""Voidage of a liquid-fluidised bed (Richardson and Zaki).

    .. math:: \varepsilon = (U/u_t)^{1/n}

    velocity           U, superficial, >= 0 [m/s]
    terminal_velocity  u_t [m/s]
    exponent           n [-]
    returns            eps [-]; at most 1

    Range: from minimum fluidisation to eps = 0.95.

    >>> expanded_voidage(0.25, 1.0, 2.0)
    0.5
    """
    return float(min(1.0, velocity / terminal_velocity) ** (1.0 / exponent))


@law("bed", "Richardson & Zaki, Trans. Inst. Chem. Eng. 32 (1954) 35", wall_ratio=(0.0, 0.1))
def wall_factor_richardson_zaki(wall_ratio: float) -> float:
    r"""Extrapolated bed velocity at voidage 1 over the terminal velocity (Richardson and Zaki).

    .. math:: u_i/u_t = 10^{-d/D}

    wall_ratio  d/D, sphere over column diameter; 0 for a wide column [-]
    returns     u_i/u_t [-]

    Range: fluidisation, d/D < 0.1. In sedimentation u_i = u_t.

    >>> wall_factor_richardson_zaki(0.0), round(wall_factor_richardson_zaki(0.05), 3)
    (1.0, 0.891)
    """
    return float(10.0**-wall_ratio)


@law(
    "bed", "Khan & Richardson, Chem. Eng. Commun. 78 (1989) 111, doi:10.1080/00986448908940189", wall_ratio=(1e-3, 0.2)
)
def wall_factor_khan_richardson(wall_ratio: float) -> float:
    r"""Extrapolated bed velocity at voidage 1 over the terminal velocity (Khan and Richardson).

    .. math:: u_i/u_t = 1 - 1.15\,(d/D)^{0.6}

    wall_ratio  d/D, sphere over column diameter; 0 for a wide column [-]
    returns     u_i/u_t, >= 0 [-]

    Range: 0.001 < d/D < 0.2.

    >>> wall_factor_khan_richardson(0.0), round(wall_factor_khan_richardson(0.05), 3)
    (1.0, 0.809)
    """
    return float(max(0.0, 1.0 - 1.15 * wall_ratio**0.6))


SLIP_FORM = (
    "Garside & Al-Dibouni, Ind. Eng. Chem. Process Des. Dev. 16 (1977) 206, as printed in the MFIX Theory Guide, "
    "DOE/METC-94/1004 (1993), doi:10.2172/10145548, eqs. 12 to 14"
)


@law("bed", SLIP_FORM, reynolds=(1e-3, 3e4))
def slip_ratio_garside(voidage: float, reynolds: float) -> float:
    r"""Slip velocity in a bed over the terminal velocity (slip form of Garside and Al-Dibouni).

    .. math:: \frac{V-A}{B-V} = 0.06 Re,\quad A = \varepsilon^{4.14},\quad
              B = 0.8\,\varepsilon^{1.28}\ (\varepsilon \le 0.85),\ \varepsilon^{2.65}

    voidage   eps [-]
    reynolds  Re_t, at the terminal velocity [-]
    returns   V = U/(eps u_t) [-]

    Range: 1e-3 < Re_t < 3e4. V is a ratio of slip velocities, as eq. 11 of the guide uses it: in creeping flow
    U/u_t = eps^5.14 then, beside eps^5.1 by :func:`exponent_garside` of the same paper.

    >>> round(slip_ratio_garside(0.5, 0.0) / 0.5**4.14, 6), round(slip_ratio_garside(0.5, 1e9) / (0.8 * 0.5**1.28), 6)
    (1.0, 1.0)
    """
    creeping = voidage**4.14
    inertial = 0.8 * voidage**1.28 if voidage <= 0.85 else voidage**2.65
    share = 0.06 * reynolds
    return float((creeping + inertial * share) / (1.0 + share))


TABLE_REYNOLDS = (1.02, 1.83, 5.0, 9.98, 20.0, 500.0)
TABLE_RATIO = (0.92, 0.90, 0.86, 0.86, 0.88, 0.8)
TABLE_EXPONENT = (4.2, 4.1, 4.0, 3.8, 3.6, 2.39)
"""Re_t, k and n of the two-parameter law: resolved suspensions of Yin and Koch up to Re_t = 20."""

YIN_KOCH = (
    "Yin & Koch, Phys. Fluids 19 (2007) 093302, resolved suspensions, as plotted by Willen & Prosperetti, "
    "Phys. Rev. Fluids 4 (2019) 014304; 0.8 above Re_t = 500 from memory"
)


@law("bed", YIN_KOCH, reynolds=(1.02, 20.0))
def velocity_ratio_two_parameters(reynolds: float) -> float:
    r"""Extrapolated bed velocity at voidage 1 over the terminal velocity (two-parameter law of bed expansion).

    .. math:: U/u_t = k(Re)\,\varepsilon^{n(Re)}

    reynolds  Re_t, at the terminal velocity [-]
    returns   k [-], linear in log Re between 1.02, 1.83, 5, 9.98, 20 and 500

    Range: 1.02 < Re_t < 20, solid fractions up to 0.4, no walls. Below it, k is held. Above it, k tends to 0.8 at
    Re_t = 500, a value from memory (0.8 to 0.9 in reviews of fluidised beds) that has not been checked.

    >>> round(velocity_ratio_two_parameters(9.98), 6), velocity_ratio_two_parameters(2000.0)
    (0.86, 0.8)
    """
    number = min(max(reynolds, TABLE_REYNOLDS[0]), TABLE_REYNOLDS[-1])
    place = 1
    while number > TABLE_REYNOLDS[place]:
        place += 1
    low, high = TABLE_REYNOLDS[place - 1], TABLE_REYNOLDS[place]
    part = math.log(number / low) / math.log(high / low)
    return float(TABLE_RATIO[place - 1] + part * (TABLE_RATIO[place] - TABLE_RATIO[place - 1]))


@law("bed", YIN_KOCH, reynolds=(1.02, 20.0))
def exponent_two_parameters(reynolds: float) -> float:
    r"""Exponent n of the two-parameter law of bed expansion.

    .. math:: U/u_t = k(Re)\,\varepsilon^{n(Re)}

    reynolds  Re_t, at the terminal velocity [-]
    returns   n [-], linear in log Re between 1.02, 1.83, 5, 9.98, 20 and 500

    Range: 1.02 < Re_t < 20, as for :func:`velocity_ratio_two_parameters`; 2.39 of Richardson and Zaki at Re_t = 500.

    >>> round(exponent_two_parameters(9.98), 6), exponent_two_parameters(2000.0)
    (3.8, 2.39)
    """
    number = min(max(reynolds, TABLE_REYNOLDS[0]), TABLE_REYNOLDS[-1])
    place = 1
    while number > TABLE_REYNOLDS[place]:
        place += 1
    low, high = TABLE_REYNOLDS[place - 1], TABLE_REYNOLDS[place]
    part = math.log(number / low) / math.log(high / low)
    return float(TABLE_EXPONENT[place - 1] + part * (TABLE_EXPONENT[place] - TABLE_EXPONENT[place - 1]))


@law(
    "bed", "Hirata & Bulos, J. Chem. Eng. Japan 23 (1990) 599, doi:10.1252/jcej.23.599, abstract",
    reynolds=(0.7, 3200.0), wall_ratio=(1e-3, 0.2),
)  # fmt: skip
def expanded_voidage_hirata_bulos(
    velocity: float, terminal_velocity: float, reynolds: float, wall_ratio: float, packed_voidage: float
) -> float:
    r"""Voidage of a liquid-fluidised bed between the walls of a column (Hirata and Bulos).

    .. math:: \varepsilon = \varepsilon_p + (1-\varepsilon_p)\,\varepsilon_{RZ}^A\exp(B(1-\varepsilon_{RZ})),\quad
              A = 2.2n + 8\tfrac dD,\quad B = 2.1n

    velocity           U, superficial, >= 0 [m/s]
    terminal_velocity  u_t [m/s]
    reynolds           Re_t, at the terminal velocity [-]
    wall_ratio         d/D, sphere over column diameter [-]
    packed_voidage     eps_p, of the bed at rest [-]
    returns            eps [-]; n and eps_RZ are those of Richardson and Zaki in a wide column

    Range: 0.7 < Re_t < 3200, 811 points with a standard deviation below 5 %. The abstract does not say which d/D they
    had, nor whether n and eps_RZ contain the correction for walls. The range of d/D is a choice: without walls the
    formula lies far above all others, 0.72 in the example instead of 0.61 to 0.67.

    >>> round(expanded_voidage_hirata_bulos(0.157033, 0.505, 1862.0, 1 / 13, 0.4), 3)
    0.637
    """
    exponent = exponent_richardson_zaki(reynolds, 0.0)
    wide = expanded_voidage(velocity, terminal_velocity, exponent)
    power, rate = 2.2 * exponent + 8.0 * wall_ratio, 2.1 * exponent
    return float(packed_voidage + (1.0 - packed_voidage) * wide**power * math.exp(rate * (1.0 - wide)))


@law(
    "bed", "Khan & Richardson, Chem. Eng. Commun. 62 (1987) 135, doi:10.1080/00986448708912056", archimedes=(1.0, 1e10)
)
def terminal_reynolds_khan_richardson(archimedes: float) -> float:
    r"""Terminal Reynolds number of a sphere (Khan and Richardson).

    .. math:: Re_t = (2.33\,Ar^{0.018} - 1.53\,Ar^{-0.016})^{13.3}

    archimedes  Ar, > 0 [-]
    returns     Re_t [-]; 0 below Ar = 4e-6, where the bracket is negative

    Range: 1 < Ar < 1e10.

    >>> round(terminal_reynolds_khan_richardson(49.14**2), 1)      # Mordant & Pinton (2000), 0.5 mm glass: measured 41
    44.4
    """
    if archimedes <= 0.0:
        return 0.0
    return float(max(0.0, 2.33 * archimedes**0.018 - 1.53 * archimedes**-0.016) ** 13.3)
