"""Viscous stress: resolved on the grid with no slip on plate and bead, and in thin gaps the resistance of the film.

Where the gap under the bead is thinner than `THIN` cells, the radial velocity is the mean over the gap and feels
12 nu u/h^2, with the pressure and implicitly. Elsewhere the stress is explicit, but for walls closer than half a cell.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline, serial
from scenarios.collisions.film_impact.grid import Grid, surface_height, surface_radius_squared

THIN = 3.0
"""Gaps below this are thin [cells]."""

EXPLICIT = 3.0
"""Coefficient of walls up to which their stress is explicit and stable [-]."""

CLOSEST = 0.1
"""Least distance of a wall [cells]."""


def mobility_of_gaps(grid: Grid, radius: float, gap: float, viscosity: float, dt: float) -> np.ndarray:
    """Factor of the radial velocity in thin gaps, 1/(1 + 12 nu dt/h^2), for each radial face.

    viscosity  kinematic [m2/s]
    returns    (radial + 1, vertical) [-]; 1 where the gap is resolved
    """
    height = heights(grid, radius, gap)
    mobility = np.ones(grid.radial + 1)
    thin = height < THIN * grid.dx
    mobility[thin] = 1.0 / (1.0 + 12.0 * viscosity * dt / height[thin] ** 2)
    return np.ascontiguousarray(np.broadcast_to(mobility[:, None], grid.open_u.shape))


def heights(grid: Grid, radius: float, gap: float) -> np.ndarray:
    """Height of the underside of the bead over each radial face; infinite outside its projected area [m]."""
    r = np.arange(grid.radial + 1) * grid.dx
    below = r < radius
    inside = np.where(below, r, 0.0)
    return np.where(below, gap + inside**2 / (radius + np.sqrt(radius**2 - inside**2)), np.inf)


@serial
def diffuse(flow, wet, opening, rate, bead):
    """Add the viscous stress of a step; `rate` is nu dt/dx^2.

    flow, wet, opening  velocity, whether it is beside liquid, and open fraction of faces, each `Faces`
    bead                `Underside`
    """
    (u, w), (wet_u, wet_w), (open_u, open_w) = flow, wet, opening
    old_u, old_w = u.copy(), w.copy()
    radius, gap, dx = bead.radius, bead.gap, bead.dx
    for i in range(1, u.shape[0] - 1):
        if surface_height(radius, gap, i * dx) < THIN * dx:
            continue
        for j in range(u.shape[1]):
            if wet_u[i, j] and open_u[i, j] > 0.0:
                u[i, j] = radial_face(old_u, wet_u, open_u, i, j, rate, bead)
    for i in range(w.shape[0]):
        if surface_height(radius, gap, (i + 0.5) * dx) < THIN * dx:
            continue
        for j in range(1, w.shape[1] - 1):
            if wet_w[i, j] and open_w[i, j] > 0.0:
                w[i, j] = horizontal_face(old_w, wet_w, open_w, i, j, rate, bead)


@inline
def reach_above(wet, open_u, i, j):
    """Distance from a radial face to the bead above, in cells; 0 where there is liquid or air instead."""
    if open_u[i, j] < 1.0:
        return max(open_u[i, j] - 0.5, CLOSEST)
    if j + 1 < open_u.shape[1] and open_u[i, j + 1] < 0.5:
        return 0.5 + open_u[i, j + 1]
    return 0.0


@inline
def radial_face(u, wet, open_u, i, j, rate, bead):
    """Radial velocity of a face after a step; second differences to the walls' true distance, exact for a parabola."""
    value, flux, wall = u[i, j], 0.0, 1.0 / (i * i)
    near = reach_above(wet, open_u, i, j)
    above, below = near if near > 0.0 else 1.0, 1.0 if j > 0 else 0.5
    if near > 0.0:
        wall += 2.0 / (above * (above + below))
    elif j + 1 < u.shape[1] and wet[i, j + 1]:
        flux += 2.0 / (above * (above + below)) * (u[i, j + 1] - value)
    if j == 0:
        wall += 2.0 / (below * (above + below))
    elif wet[i, j - 1]:
        flux += 2.0 / (below * (above + below)) * (u[i, j - 1] - value)
    for k, middle in ((i - 1, i - 0.5), (i + 1, i + 0.5)):
        if k == 0 or (k < u.shape[0] and open_u[k, j] > 0.0 and wet[k, j]):
            flux += middle / i * (u[k, j] - value)
        elif k < i and open_u[k, j] == 0.0:
            near = i - math.sqrt(surface_radius_squared(bead.radius, bead.gap, (j + 0.5) * bead.dx)) / bead.dx
            wall += middle / (i * min(max(near, 0.5), 1.0))
    return past_walls(value, flux, wall, 0.0, rate)


@inline
def horizontal_face(w, wet, open_w, i, j, rate, bead):
    """Vertical velocity of a face after a step; the bead moves with its velocity."""
    value, flux, wall = w[i, j], 0.0, 0.0
    flux += (w[i, j - 1] if j > 1 else 0.0) - value
    if open_w[i, j + 1] == 0.0:
        near = surface_height(bead.radius, bead.gap, (i + 0.5) * bead.dx) / bead.dx - j
        wall += 1.0 / min(max(near, 0.25), 1.0)
    elif wet[i, j + 1]:
        flux += w[i, j + 1] - value
    for k, middle in ((i - 1, i), (i + 1, i + 1)):
        if 0 <= k < w.shape[0] and open_w[k, j] > 0.0 and wet[k, j]:
            flux += middle / (i + 0.5) * (w[k, j] - value)
        elif 0 <= k < i and open_w[k, j] == 0.0:
            near = i + 0.5 - math.sqrt(surface_radius_squared(bead.radius, bead.gap, j * bead.dx)) / bead.dx
            wall += middle / ((i + 0.5) * min(max(near, 0.5), 1.0))
    return past_walls(value, flux, wall, bead.velocity, rate)


@inline
def past_walls(value, flux, wall, speed, rate):
    """Velocity after a step with stress from neighbours and walls; the excess of close walls acts implicitly."""
    explicit = min(wall, EXPLICIT)
    excess = wall - explicit
    return (value + rate * (flux + explicit * (speed - value) + excess * speed)) / (1.0 + rate * excess)
