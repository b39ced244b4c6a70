"""Distribution of the normal load between the film and the solid contact."""

from __future__ import annotations

from closures.registry import law


@law("blend", "Nijssen, Ottens & Padding, Powder Technol. (2023), eq. (9), doi:10.1016/j.powtec.2022.118017")
def contact_share(gap: float, minimum_gap: float) -> float:
    r"""Share of the normal load carried by the solid contact; the film carries the rest.

    .. math:: s = 1 - h/h_{min}\ \text{between } h = 0 \text{ and } h = h_{min}

    gap          h, surface to surface [m]
    minimum_gap  h_min; 0 for a dry contact [m]
    returns      s: 0 above h_min, 1 at geometric overlap [-]

    Range: any.

    >>> contact_share(0.25, 1.0), contact_share(2.0, 1.0), contact_share(-0.1, 0.0)
    (0.75, 0.0, 1.0)
    """
    if gap <= 0.0:
        return 1.0
    if gap >= minimum_gap:
        return 0.0
    return 1.0 - gap / minimum_gap
