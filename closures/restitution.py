"""Closed-form restitution of wet and immersed collisions, for plots and checks."""

from __future__ import annotations

import math

from closures.law import law


@law(
    "restitution",
    "integral of Nijssen et al. (2023), eq. (9), with the lever zone's half; cf. Davis, Serayssol & Hinch (1986)",
    stokes=(0.0, math.inf),
)
def immersed(stokes: float, restitution: float, cutoff_gap: float, minimum_gap: float) -> float:
    r"""Restitution of two immersed spheres whose contact is deep against the minimum gap.

    .. math:: e = e_{dry} - \frac{1+e_{dry}}{St}\left[\ln\frac{h_{co}}{h_{min}} + \tfrac12\right]

    stokes       St, of the approach at h_co [-]
    restitution  e_dry [-]
    cutoff_gap   h_co [m]
    minimum_gap  h_min [m]
    returns      e at h = h_co outbound [-]; 0 where the pair does not come back to h_co

    Range: within 5e-4 of the full model where the largest overlap exceeds 15 h_min, 1.2e-2 where it equals h_min.

    >>> round(immersed(100.0, 0.97, 3.175e-3, 796e-9), 3)        # Delrin in water
    0.797
    """
    lost = math.log(cutoff_gap / minimum_gap) + 0.5
    return max(0.0, restitution - (1.0 + restitution) / stokes * lost)


@law("restitution", "root of the closed form of immersed collisions")
def critical_stokes(restitution: float, cutoff_gap: float, minimum_gap: float) -> float:
    r"""Stokes number above which an immersed pair separates again.

    .. math:: St_c = \frac{1+e_{dry}}{e_{dry}}\left[\ln\frac{h_{co}}{h_{min}} + \tfrac12\right]

    restitution  e_dry [-]
    cutoff_gap   h_co [m]
    minimum_gap  h_min [m]
    returns      St_c [-]

    >>> round(critical_stokes(0.97, 3.175e-3, 796e-9), 1)        # Delrin
    17.9
    """
    return (1.0 + restitution) / restitution * (math.log(cutoff_gap / minimum_gap) + 0.5)


@law("restitution", "film zone of Nijssen et al. (2023), eq. (8), integrated")
def stop_gap(stokes: float, cutoff_gap: float) -> float:
    r"""Gap at which the film has stopped a slow pair, where that is above the minimum gap.

    .. math:: h_{stop} = h_{co}\,e^{-St}

    stokes      St, of the approach at h_co [-]
    cutoff_gap  h_co [m]
    returns     h_stop [m]

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
    r"""Fitted restitution of solid spheres and drops that bounce off a wall in a fluid.

    .. math:: e = e_{dry}\,\exp(-35/St^*),\qquad St^* = \frac{(\rho_p + \rho_f/2)\,U d}{9\eta}

    stokes       St*, Stokes number with the added mass in it [-]
    restitution  e_dry [-]
    returns      e [-]

    Range: experiments scatter by 0.1 to 0.2 about it between St* = 20 and 200.

    >>> round(legendre(100.0, 1.0), 3)
    0.705
    """
    return restitution * math.exp(-35.0 / stokes)
