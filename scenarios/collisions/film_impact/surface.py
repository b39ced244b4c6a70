r"""Surface tension: the pressure just inside the surface of the liquid is sigma times its curvature.

The curvature is the divergence of the normal, from the smoothed share of liquid F,

.. math:: \kappa = -\nabla\cdot\frac{\nabla F}{|\nabla F|}

and the pressure takes the value sigma kappa where the surface crosses between two cells, so that a drop at rest stays
at rest. On plate, side and bead the normal has the static contact angle; within them F continues in a straight line, so
that the smoothing does not bend the surface beside them. Where the film is thinner than a cell, the curvature of its
edge is that of a meniscus between the two walls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cfddem.backend.compile import inline, serial
from scenarios.collisions.film_impact.grid import Faces, Grid
from scenarios.collisions.film_impact.liquid import extend, sample

PASSES = 6
"""How often the share of liquid is smoothed with weights 1/4, 1/2, 1/4 along both axes."""

FAINT, LEAST_OPEN = 1e-3, 1e-3
"""Change of the share over a cell below which there is no surface; open share of a cell below which it has none."""

NEUTRAL = 0.5 * math.pi
"""Contact angle of a solid that does not bend the surface [rad]."""

GHOSTS, BESIDE = 9, 3
"""Cells within plate and side, and layers within the bead, to which the share of liquid is continued."""

OFF, STEEPEST = 1.5, 3.0
"""Distance from a solid at which the share is taken that is continued into it [cells], and its steepest slope there."""


@dataclass(frozen=True)
class Tension:
    """Surface tension, and static contact angles within the liquid."""

    sigma: float  # [N/m]
    bead: float = 0.0  # contact angle [rad]
    plate: float = 0.0
    side: float = NEUTRAL

    def longest_step(self, dx: float, density: float) -> float:
        """Largest stable step, in which the shortest wave of the grid does not cross a cell [s]."""
        return math.sqrt(density * dx**3 / (4.0 * math.pi * self.sigma))

    def pressure(self, grid: Grid, filled: np.ndarray, liquid: np.ndarray, radius: float, gap: float) -> Faces:
        """Pressure of the surface where it crosses between the cells of radial and horizontal faces [Pa].

        filled  share of liquid
        liquid  which cells are liquid
        radius  of the bead [m]
        gap     height of its lowest point [m]
        """
        share, kappa = np.clip(filled, 0.0, 1.0), np.zeros_like(filled)
        cosines = np.cos(np.array([self.bead, self.plate, self.side]))
        around = np.pad(share, ((0, GHOSTS), (GHOSTS, 0)), mode="edge")
        is_set = np.pad(grid.open_cell > 0.0, ((0, GHOSTS), (GHOSTS, 0)), mode="edge")
        extend(around, is_set, BESIDE)
        continued = around.copy()
        continue_into_solids(around, continued, radius / grid.dx, gap / grid.dx)
        for _ in range(PASSES):
            smooth(continued)
        curvature(continued, grid.open_u, grid.open_w, grid.open_cell, grid.dx, radius, cosines, kappa)
        edges = np.zeros_like(grid.open_u), np.zeros_like(grid.open_w)
        at_faces(kappa, share, liquid, grid.open_cell, *edges)
        return Faces(self.sigma * edges[0], self.sigma * edges[1])

    def pull(self, contact: float, radius: float) -> float:
        r"""Vertical force on the bead along its contact line [N].

        .. math:: F = -2\pi r\,\sigma\sin(\alpha + \theta), \qquad \sin\alpha = r/R

        contact  radius r of the line [m]
        radius   of the bead [m]
        """
        slope = math.asin(min(contact / radius, 1.0))
        return -2.0 * math.pi * contact * self.sigma * math.sin(slope + self.bead)


@serial
def continue_into_solids(share, continued, radius, gap):
    """Share of liquid within plate, side and bead, as if the surface went straight on; lengths in cells.

    share  padded with ghosts below the plate and beyond the side
    """
    radial, vertical = share.shape
    for i in range(radial):
        r = i + 0.5
        for j in range(vertical):
            z = j + 0.5 - GHOSTS
            up = gap + radius - z
            away = math.sqrt(r * r + up * up)
            if z < 0.0:
                continued[i, j] = beyond(share, r, z, 0.0, -1.0, -z)
            elif r > radial - GHOSTS:
                continued[i, j] = beyond(share, r, z, 1.0, 0.0, r - (radial - GHOSTS))
            elif up > 0.0 and away < radius:
                continued[i, j] = beyond(share, r, z, -r / away, up / away, radius - away)


@inline
def beyond(share, r, z, normal_r, normal_z, depth):
    """Share at a depth within a solid, whose normal points into it: that beside it, shifted along its own slope."""
    depth += OFF
    x, y = r - depth * normal_r - 0.5, z - depth * normal_z - 0.5 + GHOSTS
    along = sample(share, abs(x - normal_z + 0.5) - 0.5, y + normal_r) - sample(share, x + normal_z, y - normal_r)
    inwards = sample(share, x + normal_r, y + normal_z) - sample(share, abs(x - normal_r + 0.5) - 0.5, y - normal_z)
    steepest = STEEPEST * abs(along)
    shift = depth * min(max(inwards, -steepest), steepest) / along if along != 0.0 else 0.0
    return sample(share, abs(x + 0.5 - shift * normal_z) - 0.5, y + shift * normal_r)


@serial
def smooth(share):
    """One pass with weights 1/4, 1/2, 1/4 along height and, by the area of the faces, along the radius."""
    radial, vertical = share.shape
    old = share.copy()
    for i in range(radial):
        inner, outer = max(i - 1, 0), min(i + 1, radial - 1)
        for j in range(vertical):
            share[i, j] = (i * old[inner, j] + (2 * i + 1) * old[i, j] + (i + 1) * old[outer, j]) / (4 * i + 2)
    for i in range(radial):
        before = share[i, 0]
        for j in range(vertical):
            here = share[i, j]
            share[i, j] = 0.25 * before + 0.5 * here + 0.25 * share[i, min(j + 1, vertical - 1)]
            before = here


@inline
def normal(across, along):
    """Component of the normal along a difference of the share across a face; 0 where there is no surface."""
    size = math.sqrt(across * across + along * along)
    return -across / size if size > FAINT else 0.0


@inline
def across_face(share, i, j, k, m):
    """Outward normal on the face between two cells, of which (k, m) is the farther one."""
    along = 0.0
    for a, b in ((i, j), (k, m)):
        if m == j:
            along += 0.25 * (share[a, min(b + 1, share.shape[1] - 1)] - share[a, max(b - 1, 0)])
        else:
            along += 0.25 * (share[min(a + 1, share.shape[0] - 1), b] - share[max(a - 1, 0), b])
    return normal(share[k, m] - share[i, j], along)


@serial
def curvature(share, open_u, open_w, open_cell, dx, radius, cosines, kappa):
    """Curvature of the surface in each open cell [1/m]; positive for a drop.

    share    padded and smoothed
    radius   of the bead [m]
    cosines  of the contact angles of bead, plate and side
    """
    radial, vertical = kappa.shape
    for i in range(radial):
        ring = 2.0 * i + 1.0
        for m in range(vertical):
            j = m + GHOSTS
            kappa[i, m] = 0.0
            if open_cell[i, m] <= LEAST_OPEN:
                continue
            outer = across_face(share, i, j, i + 1, j) if i + 1 < radial else -cosines[2]
            inner = across_face(share, i - 1, j, i, j) if i > 0 else 0.0
            upper = across_face(share, i, j, i, j + 1) if m + 1 < vertical else 0.0
            lower = across_face(share, i, j - 1, i, j) if m > 0 else cosines[1]
            flux = 2.0 * ((i + 1) * open_u[i + 1, m] * outer - i * open_u[i, m] * inner)
            flux += ring * (open_w[i, m + 1] * upper - open_w[i, m] * lower)
            covered = ring * (open_w[i, m] - open_w[i, m + 1])
            if covered > 0.0:
                flux -= cosines[0] * covered / math.sqrt(max(1.0 - ((i + 0.5) * dx / radius) ** 2, 0.01))
            kappa[i, m] = flux / (ring * open_cell[i, m] * dx)


@serial
def at_faces(kappa, share, liquid, open_cell, edge_u, edge_w):
    """Curvature where the surface crosses between two cells."""
    for i in range(liquid.shape[0]):
        for j in range(liquid.shape[1]):
            if i > 0 and liquid[i, j] != liquid[i - 1, j]:
                edge_u[i, j] = between(kappa, share, open_cell, i - 1, j, i, j)
            if j > 0 and liquid[i, j] != liquid[i, j - 1]:
                edge_w[i, j] = between(kappa, share, open_cell, i, j - 1, i, j)


@inline
def between(kappa, share, open_cell, i, j, k, m):
    """Mean of the curvature of two cells, weighted with their open volume and how near the surface is."""
    near = open_cell[i, j] * (share[i, j] * (1.0 - share[i, j]) + FAINT)
    far = open_cell[k, m] * (share[k, m] * (1.0 - share[k, m]) + FAINT)
    return (near * kappa[i, j] + far * kappa[k, m]) / max(near + far, FAINT**2)


@serial
def work(edge_u, edge_w, liquid, u, w, open_u, open_w, dx):
    """Power with which the liquid pushes its surface outwards [W]."""
    radial, vertical = liquid.shape
    total = 0.0
    for i in range(radial):
        for j in range(vertical):
            if i > 0 and edge_u[i, j] != 0.0:
                out = u[i, j] if liquid[i - 1, j] else -u[i, j]
                total += edge_u[i, j] * out * 2.0 * math.pi * i * dx * dx * open_u[i, j]
            if j > 0 and edge_w[i, j] != 0.0:
                out = w[i, j] if liquid[i, j - 1] else -w[i, j]
                total += edge_w[i, j] * out * math.pi * (2.0 * i + 1.0) * dx * dx * open_w[i, j]
    return total


@serial
def contact_radius(filled, liquid, open_w, open_cell, dx):
    """Radius at which the surface of the liquid meets the bead, along the lowest cells that the bead cuts [m]."""
    last = -1.0
    for i in range(liquid.shape[0]):
        top = -1
        for j in range(liquid.shape[1]):
            if open_cell[i, j] > 0.0:
                top = j
        if open_w[i, liquid.shape[1]] > 0.0 or top < 0 or not liquid[i, top]:
            if last < 0.0:
                return 0.0
            share = min(max(filled[i, top], 0.0), 0.5) if top >= 0 else 0.0
            return dx * (i - 0.5 + min(max((last - 0.5) / max(last - share, 1e-9), 0.0), 1.0))
        last = min(max(filled[i, top], 0.5), 1.0)
    return 0.0
