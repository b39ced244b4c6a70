"""What resists sliding: Coulomb's limit, and whether the film has taken the solids apart."""

from __future__ import annotations

from closures.law import law


@law("friction", "Coulomb (1785)")
def coulomb_limit(friction: float, normal_force: float) -> float:
    r"""Largest tangential force that a contact carries before it slides.

    .. math:: |F_t| \le \mu\,|F_n|

    friction      mu [-]
    normal_force  F_n, of the solid contact [N]
    returns       limit of the tangential force [N]

    >>> coulomb_limit(0.5, -2.0)
    1.0
    """
    return friction * abs(normal_force)


@law(
    "friction",
    "Nijssen, Ottens & Padding, Powder Technol. (2023), eq. (10), doi:10.1016/j.powtec.2022.118017",
)
def dry_or_lubricated(minimum_gap: float, roughness_gap: float, dry: float, lubricated: float) -> float:
    r"""Friction coefficient of an immersed contact: dry where asperities touch, lubricated where a film holds.

    .. math:: \mu = \mu_{dry}\ \text{if}\ h_\sigma \ge h_\varepsilon,\quad \mu_{lub}\ \text{otherwise}

    minimum_gap    h_min, the larger of the two gaps h_sigma and h_eps [m]
    roughness_gap  h_sigma [m]
    dry            mu_dry [-]
    lubricated     mu_lub [-]
    returns        mu [-]

    Steel bearing balls (24 nm) in 80 wt% glycerol meet on a film of 47 nm and slide with 0.02, in water with 0.11.

    >>> dry_or_lubricated(47e-9, 24e-9, 0.11, 0.02), dry_or_lubricated(24e-9, 24e-9, 0.11, 0.02)
    (0.02, 0.11)
    """
    return lubricated if minimum_gap > roughness_gap else dry
