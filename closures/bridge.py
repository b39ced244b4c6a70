r"""Bridges between two coated particles: viscous resistance and capillary force of films of finite thickness.

A bridge forms at the gap d at which the two liquid films touch. Its resistance is zero there, because the bridge is
small compared with the pressure field of an immersed pair, and approaches that of the immersed pair as the gap closes.
"""

from __future__ import annotations

import math

from closures.registry import law


@law("bridge", "Kantak & Davis, Powder Technol. 168 (2006) 42; Punch et al., AIChE J. 69 (2023) e17989, eq. (7)")
def static_share(gap: float, film: float) -> float:
    r"""Resistance of a static bridge over that of an immersed pair; the displaced liquid does not widen the bridge.

    .. math:: (1 - h/d)^2

    gap      h, surface to surface [m]
    film     d, thickness of the liquid on both particles together [m]
    returns  share of A/h [-]; 0 for h > d

    Range: h > 0, d << R*.

    >>> static_share(0.5, 1.0), static_share(2.0, 1.0)
    (0.25, 0.0)
    """
    return max(1.0 - gap / film, 0.0) ** 2


@law("bridge", "Davis & Sitison, Phys. Rev. Fluids 5 (2020) 054305; Davis, Phys. Fluids 35 (2023) 103328, eq. (3)")
def deforming_share(gap: float, film: float) -> float:
    r"""Resistance of a deforming bridge over that of an immersed pair; the displaced liquid widens the bridge.

    .. math:: \left(1 - \frac{h}{2d-h}\right)^2

    gap      h, surface to surface [m]
    film     d, thickness of the liquid on both particles together [m]
    returns  share of A/h [-]; 0 for h > d

    Range: h > 0, d << R*.

    >>> round(deforming_share(0.5, 1.0) * 9, 12), deforming_share(2.0, 1.0)
    (4.0, 0.0)
    """
    return (1.0 - gap / (2.0 * film - gap)) ** 2 if gap < film else 0.0


@law("bridge", "integral of Punch et al. (2023), eq. (7), over the gap")
def static_potential(gap: float, film: float) -> float:
    r"""Potential of a static bridge; its impulse between two gaps is -A times the difference of L.

    .. math:: L = \ln\frac hd + 2\left(1 - \frac hd\right) - \tfrac12\left(1 - \frac{h^2}{d^2}\right)

    gap      h, > 0 [m]
    film     d [m]
    returns  L [-]; 0 for h >= d

    Range: h > 0, d << R*.

    >>> round(static_potential(0.2, 1.0), 4)
    -0.4894
    """
    share = min(gap / film, 1.0)
    return math.log(share) + 2.0 * (1.0 - share) - 0.5 * (1.0 - share * share)


@law("bridge", "integral of Davis (2023), eq. (3), over the gap; cf. eq. (42)")
def deforming_potential(gap: float, film: float) -> float:
    r"""Potential of a deforming bridge; its impulse between two gaps is -A times the difference of L.

    .. math:: L = \ln x + 3\ln(2-x) + \frac{2}{2-x} - 2,\qquad x = h/d

    gap      h, > 0 [m]
    film     d [m]
    returns  L [-]; 0 for h >= d

    Range: h > 0, d << R*.

    >>> round(deforming_potential(0.05, 1.0), 4)        # h_min = d/20
    -1.9666
    """
    share = min(gap / film, 1.0)
    return math.log(share) + 3.0 * math.log(2.0 - share) + 2.0 / (2.0 - share) - 2.0


@law(
    "bridge", "Pitois, Moucheront & Chateau, J. Colloid Interface Sci. 231 (2000) 26; rederived from Reynolds' equation"
)
def pitois_share(gap: float, reduced_radius: float, volume: float) -> float:
    r"""Resistance of a bridge of constant volume over that of an immersed pair; its edge is free of pressure.

    .. math:: \left(1-\frac{1}{\sqrt{1+\ell^2/h^2}}\right)^2,\qquad \ell^2 = \frac{V}{\pi R^*}

    The liquid fills the gap h + r^2/2R* up to the height H with pi R* (H^2 - h^2) = V; the share is (1 - h/H)^2.

    gap             h, surface to surface, >= 0 [m]
    reduced_radius  R* [m]
    volume          V, of the whole bridge, > 0 [m3]
    returns         share of A/h [-]; 1 at contact

    Range: V << R*^3. Falls as (V/(2 pi R* h^2))^2 at large gaps.

    >>> round(pitois_share(math.sqrt(1.0 / (3.0 * math.pi)), 1.0, 1.0), 12)      # H = 2 h
    0.25
    """
    square = volume / (math.pi * reduced_radius)
    edge = math.sqrt(gap * gap + square)
    # 1 - h/H, written without cancellation
    return (square / (edge * (edge + gap))) ** 2


@law("bridge", "integral over the gap of the resistance of Pitois et al. (2000)")
def pitois_potential(gap: float, reduced_radius: float, volume: float) -> float:
    r"""Potential of a bridge of constant volume; its impulse between two gaps is -A times the difference of L.

    .. math:: L = \ln\frac{4x\sqrt{1+x^2}}{(x+\sqrt{1+x^2})^2},\qquad x = h\sqrt{\frac{\pi R^*}{V}}

    gap             h, > 0 [m]
    reduced_radius  R* [m]
    volume          V, of the whole bridge, > 0 [m3]
    returns         L [-]; 0 at an infinite gap

    Range: V << R*^3.

    >>> round(pitois_potential(0.75 / math.sqrt(math.pi), 1.0, 1.0), 12) == round(math.log(15.0 / 16.0), 12)
    True
    """
    x = gap * math.sqrt(math.pi * reduced_radius / volume)
    root = math.sqrt(1.0 + x * x)
    if x > 0.5:
        return math.log1p(-1.0 / (root + x) ** 4)
    return math.log(4.0 * x * root) - 2.0 * math.log(x + root)


@law("bridge", "Davis & Sitison, Phys. Rev. Fluids 5 (2020) 054305; Davis (2023), eq. (4)")
def davis_tangential(viscosity: float, reduced_radius: float, gap: float, film: float) -> float:
    r"""Resistance of a bridge to sliding, from the shear stress over the area of the bridge.

    .. math:: c_t = 2\pi\eta R^*\ln\frac{2d-h}{h}

    viscosity       eta, dynamic [Pa s]
    reduced_radius  R* [m]
    gap             h, > 0 [m]
    film            d [m]
    returns         c_t, force per relative speed of the surfaces [kg/s]; 0 for h > d

    Range: h > 0, d << R*.

    >>> round(davis_tangential(1.0, 1.0, 0.5, 1.0) / (2 * math.pi), 4)
    1.0986
    """
    return 2.0 * math.pi * viscosity * reduced_radius * math.log((2.0 * film - gap) / gap) if gap < film else 0.0


@law("bridge", "Nase et al., Powder Technol. 116 (2001) 214; Goldman, Cox & Brenner, Chem. Eng. Sci. 22 (1967) 637")
def nase_tangential(viscosity: float, reduced_radius: float, gap: float, film: float) -> float:
    r"""Resistance to sliding of two immersed surfaces, applied to coated spheres up to the gap d.

    .. math:: c_t = 6\pi\eta R^*\left(\tfrac{8}{15}\ln\frac{R^*}{h} + 0.9588\right)

    viscosity       eta, dynamic [Pa s]
    reduced_radius  R* [m]
    gap             h, > 0 [m]
    film            d [m]
    returns         c_t, force per relative speed of the surfaces [kg/s]; drops to 0 for h > d

    Range: h << R*; derived for a sphere near a plane in an unbounded liquid.

    >>> round(nase_tangential(1.0, 1.0, 0.01, 0.1) / (6 * math.pi), 4)
    3.4149
    """
    if gap > film:
        return 0.0
    return 6.0 * math.pi * viscosity * reduced_radius * (8.0 / 15.0 * math.log(reduced_radius / gap) + 0.9588)


@law("bridge", "Davis & Sitison, Phys. Rev. Fluids 5 (2020) 054305; Davis (2023), eq. (3)")
def constant_capillary(surface_tension: float, reduced_radius: float) -> float:
    r"""Capillary force of a thin bridge of wetting liquid between two spheres, independent of the gap.

    .. math:: F_c = 8\pi\sigma R^*

    surface_tension  sigma [N/m]
    reduced_radius   R* [m]
    returns          F_c, attractive [N]

    Range: thin films, d << R*, of a wetting liquid.

    >>> round(constant_capillary(0.0205, 6.35e-3) * 1e3, 2)     # silicone oil, spheres of 25.4 mm
    3.27
    """
    return 8.0 * math.pi * surface_tension * reduced_radius
