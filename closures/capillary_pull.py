r"""Pull of a pendular liquid bridge of constant volume between two spheres, and its energy.

All laws take the same arguments, the surface-to-surface gap S and the volume V of the whole bridge. Spheres of unequal
size, and a sphere at a wall, enter with R = 2 R*, the mean radius of Derjaguin: 2 R_i R_j/(R_i + R_j) between spheres,
twice the radius of the sphere at a flat wall. Pull and energy are zero or positive for a wetting liquid. The energy of
a bridge is the work that its pull does while the particles approach from the gap to contact; separation takes the same.
"""

from __future__ import annotations

import math

from closures.capillary import pendular_energy, pendular_pull
from closures.registry import law

_WILLETT = "Willett, Adams, Johnson & Seville, Langmuir 16 (2000) 9396, doi:10.1021/la000657y"
_RABINOVICH = "Rabinovich, Esayanur & Moudgil, Langmuir 21 (2005) 10992, doi:10.1021/la0517639"
_LAMBERT = "Lambert, Chau, Delchambre & Regnier, Langmuir 24 (2008) 3157, doi:10.1021/la7036444"

_NODES = (0.1252334085114689, 0.3678314989981802, 0.5873179542866175, 0.7699026741943047, 0.9041172563704749,
          0.9815606342467193)  # fmt: skip
_WEIGHTS = (0.2491470458134028, 0.2334925365383548, 0.2031674267230659, 0.1600783285433462, 0.1069393259953184,
            0.0471753363865118)  # fmt: skip
"""Positive half of the 12 nodes of Gauss and Legendre, and their weights."""


@law("capillary", f"{_WILLETT}, eqs (12), (13); constants as in YADE 2023.02a")
def willett_pull(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Pull of a small bridge between two spheres, a fit to the numerical solution of the Laplace-Young equation.

    .. math:: F = \frac{2\pi R\sigma\cos\theta}{1 + 1.05\,s + 2.5\,s^2},\qquad s = S\sqrt{R/V},\quad R = 2R^*

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V, of the whole bridge [m3]
    gap              S; negative values count as 0 [m]
    returns          F, attractive; 0 without liquid [N]

    Range: V < 0.001 R^3; contact angles below 50 degrees (stated from memory). Derived for equal spheres.

    >>> contact = willett_pull(0.0728, 0.0, 0.5e-3, 1e-13, 0.0)
    >>> round(willett_pull(0.0728, 0.0, 0.5e-3, 1e-13, 1e-5) / contact, 4)      # s = 1
    0.2198
    """
    if volume == 0.0:
        return 0.0
    radius = 2.0 * reduced_radius
    stretch = max(gap, 0.0) * math.sqrt(radius / volume)
    contact = 2.0 * math.pi * radius * surface_tension * math.cos(contact_angle)
    return contact / (1.0 + stretch * (1.05 + 2.5 * stretch))


@law("capillary", f"integral over the gap of the pull of {_WILLETT}")
def willett_energy(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Work of the pull of :func:`willett_pull` on two particles that approach from a gap to contact.

    .. math:: W = \frac{4\pi R\sigma\cos\theta}{D}\sqrt{\frac VR}
              \left[\arctan\frac{5s+1.05}{D}-\arctan\frac{1.05}{D}\right],\qquad D = \sqrt{4\cdot2.5-1.05^2}

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V, of the whole bridge [m3]
    gap              S; negative values count as 0 [m]
    returns          W; 0 without liquid [J]

    Range: as the pull. Separation to infinity takes 0.8263 times the pull at contact times sqrt(V/R):

    >>> work = willett_energy(0.0728, 0.0, 0.5e-3, 1e-13, 1.0)
    >>> round(work / (willett_pull(0.0728, 0.0, 0.5e-3, 1e-13, 0.0) * 1e-5), 4)
    0.8263
    """
    if volume == 0.0:
        return 0.0
    radius = 2.0 * reduced_radius
    length = math.sqrt(volume / radius)
    stretch = max(gap, 0.0) / length
    root = math.sqrt(4.0 * 2.5 - 1.05 * 1.05)
    # arctan a - arctan b, written without cancellation
    angle = math.atan2(5.0 * stretch * root, root * root + (5.0 * stretch + 1.05) * 1.05)
    return 4.0 * math.pi * radius * surface_tension * math.cos(contact_angle) * length * angle / root


@law("capillary", f"{_LAMBERT}, eq. (65), as in YADE 2023.02a; the same closed form as pendular_pull")
def lambert_pull(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Pull of a bridge between two spheres, the derivative of its interfacial energy at constant volume.

    .. math:: F = \frac{2\pi R\sigma\cos\theta}{1 + S/2d},\qquad
              d = \frac S2\left[\sqrt{1+\frac{2V}{\pi RS^2}}-1\right],\quad R = 2R^*

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V, of the whole bridge [m3]
    gap              S; negative values count as 0 [m]
    returns          F, attractive; 0 without liquid [N]

    Range: V << R^3; too high for larger volumes. With S^2 = 2V/(3 pi R) the root is 2 and the pull half that at
    contact:

    >>> gap = math.sqrt(2e-13 / (3.0 * math.pi * 1e-3))
    >>> round(lambert_pull(0.0728, 0.0, 0.5e-3, 1e-13, gap) / lambert_pull(0.0728, 0.0, 0.5e-3, 1e-13, 0.0), 12)
    0.5
    """
    return pendular_pull(surface_tension, contact_angle, reduced_radius, volume, gap)


@law("capillary", f"integral over the gap of the pull of {_LAMBERT}; the same closed form as pendular_energy")
def lambert_energy(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Work of the pull of :func:`lambert_pull` on two particles that approach from a gap to contact.

    .. math:: W = 2\pi R\sigma\cos\theta\left[S+\ell-\sqrt{S^2+\ell^2}\right],\qquad
              \ell^2=\frac{2V}{\pi R},\quad R=2R^*

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V, of the whole bridge [m3]
    gap              S; negative values count as 0 [m]
    returns          W; 0 without liquid [J]

    Range: V << R^3. Separation to infinity takes the pull at contact times the length l:

    >>> length = math.sqrt(2e-13 / (math.pi * 1e-3))
    >>> work = lambert_energy(0.0728, 0.0, 0.5e-3, 1e-13, 1e3)
    >>> round(work / (lambert_pull(0.0728, 0.0, 0.5e-3, 1e-13, 0.0) * length), 6)
    1.0
    """
    return pendular_energy(surface_tension, contact_angle, reduced_radius, volume, max(gap, 0.0))


@law("capillary", f"{_RABINOVICH}, eqs (20), (A3), as in YADE 2023.02a")
def thin_half_filling(reduced_radius: float, volume: float, gap: float) -> float:
    r"""Half-filling angle of a small bridge, a cylinder between two paraboloids.

    .. math:: \alpha^2 = \frac{\sqrt{S^2+\ell^2}-S}{R},\qquad \ell^2=\frac{2V}{\pi R},\quad R = 2R^*

    reduced_radius  R* [m]
    volume          V, of the whole bridge, > 0 [m3]
    gap             S, >= 0 [m]
    returns         alpha [rad]

    Range: V << R^3.

    >>> round(thin_half_filling(0.5e-3, 1e-13, 0.0), 4)
    0.0893
    """
    square = volume / (math.pi * reduced_radius)
    # sqrt(S^2 + l^2) - S, written without cancellation
    return math.sqrt(square / ((math.sqrt(gap * gap + square) + gap) * 2.0 * reduced_radius))


@law("capillary", f"{_RABINOVICH}, eqs (19), (20), (A3), as in YADE 2023.02a")
def rabinovich_pull(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Pull of a bridge between two spheres: interfacial energy plus surface tension on the contact line.

    .. math:: F = \frac{2\pi R\sigma\cos\theta}{1 + S/2d} + 2\pi R\sigma\sin\alpha\sin(\theta+\alpha),\qquad
              \alpha^2 = \frac{2d}{R},\quad d = \frac S2\left[\sqrt{1+\frac{2V}{\pi RS^2}}-1\right],\quad R = 2R^*

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V, of the whole bridge [m3]
    gap              S; negative values count as 0 [m]
    returns          F, attractive; 0 without liquid [N]

    Range: V << R^3. Lambert et al. (2008) show that the first term contains the whole pull; their law is the first
    term alone. YADE leaves the second term out at S = 0; here it is continuous, with alpha = (2V/(pi R^3))^(1/4).

    >>> reference = lambert_pull(0.0728, 0.0, 0.5e-3, 1e-13, 0.0)
    >>> alpha = (2e-4 / math.pi) ** 0.25
    >>> round((rabinovich_pull(0.0728, 0.0, 0.5e-3, 1e-13, 0.0) / reference - 1.0) / math.sin(alpha) ** 2, 12)
    1.0
    """
    if volume == 0.0:
        return 0.0
    radius = 2.0 * reduced_radius
    angle = thin_half_filling(reduced_radius, volume, max(gap, 0.0))
    tension = 2.0 * math.pi * radius * surface_tension * math.sin(angle) * math.sin(contact_angle + angle)
    return pendular_pull(surface_tension, contact_angle, reduced_radius, volume, gap) + tension


@law("capillary", f"integral over the gap of the pull of {_RABINOVICH}, by quadrature")
def rabinovich_energy(
    surface_tension: float, contact_angle: float, reduced_radius: float, volume: float, gap: float
) -> float:
    r"""Work of the pull of :func:`rabinovich_pull` on two particles that approach from a gap to contact.

    .. math:: W = W_L + 2\pi R\sigma\int_{\alpha}^{\alpha_0}\sin a\,\sin(\theta+a)\,\frac{\ell^2+R^2a^4}{R\,a^3}\,da,
              \qquad \ell^2=\frac{2V}{\pi R},\quad R=2R^*

    W_L is the energy of :func:`lambert_energy`, alpha_0 the angle at contact. The integral is taken over ln a with 12
    nodes of Gauss and Legendre; its error is below 1e-9 of W up to gaps of a thousand times l.

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    volume           V, of the whole bridge [m3]
    gap              S; negative values count as 0 [m]
    returns          W; 0 without liquid [J]

    Range: as the pull; 0 at contact.

    >>> rabinovich_energy(0.0728, 0.3, 0.5e-3, 1e-13, 0.0)
    0.0
    """
    if volume == 0.0:
        return 0.0
    radius = 2.0 * reduced_radius
    apart = max(gap, 0.0)
    square = 2.0 * volume / (math.pi * radius)
    low, high = thin_half_filling(reduced_radius, volume, apart), thin_half_filling(reduced_radius, volume, 0.0)
    middle, half = 0.5 * math.log(high * low), 0.5 * math.log(high / low)
    total = 0.0
    for node, weight in zip(_NODES, _WEIGHTS):
        for place in (middle - half * node, middle + half * node):
            angle = math.exp(place)
            rate = (square + (radius * angle * angle) ** 2) / (radius * angle * angle)
            total += weight * rate * math.sin(angle) * math.sin(contact_angle + angle)
    tension = 2.0 * math.pi * radius * surface_tension * half * total
    return pendular_energy(surface_tension, contact_angle, reduced_radius, volume, apart) + tension
