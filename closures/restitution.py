"""Restitution of wet and immersed collisions in closed form; for comparison, not used by the solver."""

from __future__ import annotations

import math

from closures.bridge import deforming_potential
from closures.registry import law


@law(
    "restitution",
    "integral of Nijssen et al. (2023), eq. (9), the 1/2 from below h_min; cf. Davis, Serayssol & Hinch (1986)",
    stokes=(0.0, math.inf),
)
def immersed(stokes: float, restitution: float, cutoff_gap: float, minimum_gap: float) -> float:
    r"""Restitution of two immersed spheres whose overlap is large compared with the minimum gap.

    .. math:: e = e_{dry} - \frac{1+e_{dry}}{St}\left[\ln\frac{h_{co}}{h_{min}} + \tfrac12\right]

    stokes       St, of the approach speed at h_co [-]
    restitution  e_dry [-]
    cutoff_gap   h_co [m]
    minimum_gap  h_min [m]
    returns      e, with the rebound speed at h_co [-]; 0 if the pair does not separate to h_co

    Range: within 5e-4 of the full model if the largest overlap exceeds 15 h_min, within 1.2e-2 if it equals h_min.

    >>> round(immersed(100.0, 0.97, 3.175e-3, 796e-9), 3)        # Delrin in water
    0.797
    """
    lost = math.log(cutoff_gap / minimum_gap) + 0.5
    return max(0.0, restitution - (1.0 + restitution) / stokes * lost)


@law("restitution", "root of the closed form for immersed collisions")
def critical_stokes(restitution: float, cutoff_gap: float, minimum_gap: float) -> float:
    r"""Stokes number above which an immersed pair rebounds.

    .. math:: St_c = \frac{1+e_{dry}}{e_{dry}}\left[\ln\frac{h_{co}}{h_{min}} + \tfrac12\right]

    restitution  e_dry [-]
    cutoff_gap   h_co [m]
    minimum_gap  h_min [m]
    returns      St_c [-]

    Range: that of :func:`immersed`.

    >>> round(critical_stokes(0.97, 3.175e-3, 796e-9), 1)        # Delrin
    17.9
    """
    return (1.0 + restitution) / restitution * (math.log(cutoff_gap / minimum_gap) + 0.5)


@law("restitution", "film zone of Nijssen et al. (2023), eq. (8), integrated")
def stop_gap(stokes: float, cutoff_gap: float) -> float:
    r"""Gap at which the film stops a slow pair.

    .. math:: h_{stop} = h_{co}\,e^{-St}

    stokes      St, of the approach speed at h_co [-]
    cutoff_gap  h_co [m]
    returns     h_stop [m]

    Range: h_stop > h_min.

    >>> round(stop_gap(5.0, 1.0), 5)
    0.00674
    """
    return cutoff_gap * math.exp(-stokes)


@law(
    "restitution",
    "Legendre, Zenit, Daniel & Guiraud, Chem. Eng. Sci. 61 (2006) 3543, doi:10.1016/j.ces.2005.12.028",
    stokes=(1.0, 1e5),
)
def legendre(stokes: float, restitution: float) -> float:
    r"""Restitution of solid spheres and drops against a wall in a fluid, fitted to experiments.

    .. math:: e = e_{dry}\,\exp(-35/St^*),\qquad St^* = \frac{(\rho_p + \rho_f/2)\,U d}{9\eta}

    stokes       St*, Stokes number with added mass [-]
    restitution  e_dry [-]
    returns      e [-]

    Range: 1 < St* < 1e5; experiments scatter by 0.1 to 0.2 between St* = 20 and 200.

    >>> round(legendre(100.0, 1.0), 3)
    0.705
    """
    return restitution * math.exp(-35.0 / stokes)


@law("restitution", "Davis & Sitison, Phys. Rev. Fluids 5 (2020) 054305; Davis, Phys. Fluids 35 (2023), eq. (42)")
def davis_sitison_critical_stokes(restitution: float, film_share: float) -> float:
    r"""Stokes number above which two coated spheres rebound from a head-on collision.

    .. math:: St_s = \frac{1+e_{dry}}{e_{dry}}\left[\ln\frac1x - 3\ln(2-x) + 2 - \frac{2}{2-x}\right]

    restitution  e_dry [-]
    film_share   x = h_min/d, minimum gap over the film thickness of both particles, 0 < x <= 1 [-]
    returns      St_s [-]

    Range: deforming films, 0 < x <= 1.

    >>> round(davis_sitison_critical_stokes(1.0, 0.05), 3)
    3.933
    """
    return -(1.0 + restitution) / restitution * deforming_potential(film_share, 1.0)


@law("restitution", "Davis & Sitison, Phys. Rev. Fluids 5 (2020) 054305; Davis, Phys. Fluids 35 (2023), eq. (41)")
def davis_sitison(stokes: float, restitution: float, film_share: float) -> float:
    r"""Restitution of two coated spheres in a head-on collision, with a hard-sphere rebound at the minimum gap.

    .. math:: e = e_{dry}\,(1 - St_s/St)\quad(St > St_s),\qquad 0\quad(St \le St_s)

    stokes       St, of the approach speed where the films touch [-]
    restitution  e_dry [-]
    film_share   x = h_min/d [-]
    returns      e, with the rebound speed where the films separate [-]

    Range: deforming films, 0 < x <= 1.

    >>> round(davis_sitison(10.0, 1.0, 0.05), 4)
    0.6067
    """
    return max(0.0, restitution * (1.0 - davis_sitison_critical_stokes(restitution, film_share) / stokes))


@law(
    "restitution",
    "Singh, Windows-Yule & Nair, arXiv:2603.23100 (2026), eqs (21) and (22)",
    stokes=(34.0, 3440.0),
    film_ratio=(0.05, 0.143),
)
def singh(stokes: float, film_ratio: float) -> float:
    r"""Restitution of a glass bead (e_dry = 0.98) on a plate with a liquid film, at high Stokes numbers.

    .. math:: e = \min\left(e^{-1.76}\,St^{0.17}\gamma^{-0.16},\ e^{-0.90}\,St^{0.01}\gamma^{-0.22}\right)

    stokes      St = rho_p D v / (9 eta) [-]
    film_ratio  gamma, film thickness over diameter of the bead [-]
    returns     e [-]

    Range: fitted to 34 < St < 3440 and 0.05 < gamma < 0.143. Outside, the fit is wrong: it never gives e = 0 at low St
    and exceeds 0.98 for gamma < 0.025. ``law_of(singh).outside(stokes=..., film_ratio=...)`` lists arguments out of
    range.

    With these prefactors the two branches meet without a jump; the rounded 0.17 and 0.4 of the paper's eq. (24) leave a
    jump of 0.6 %.

    >>> round(singh(200.0, 0.1), 3), round(singh(2000.0, 0.1), 3)
    (0.612, 0.728)
    >>> from closures.registry import law_of
    >>> law_of(singh).outside(stokes=10.0, film_ratio=0.1)
    ['stokes']
    """
    slow = math.exp(-1.76) * stokes**0.17 * film_ratio**-0.16
    fast = math.exp(-0.90) * stokes**0.01 * film_ratio**-0.22
    return float(min(slow, fast))


@law(
    "restitution",
    "Singh, Windows-Yule & Nair, arXiv:2603.23100 (2026): where the branches of eqs (21) and (22) meet",
    film_ratio=(0.05, 0.143),
)
def singh_crossover(film_ratio: float) -> float:
    r"""Stokes number at which the two branches of :func:`singh` meet.

    .. math:: St^* = \exp\frac{1.76 - 0.90 + (0.16 - 0.22)\ln\gamma}{0.17 - 0.01}

    film_ratio  gamma, film thickness over diameter of the bead [-]
    returns     St* [-]

    Range: 0.05 < gamma < 0.143, that of the fit.

    >>> round(singh_crossover(0.1))
    512
    """
    return math.exp((1.76 - 0.90 + (0.16 - 0.22) * math.log(film_ratio)) / (0.17 - 0.01))
