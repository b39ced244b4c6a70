"""Liquid particles: they carry the volume and the velocity of the liquid, and mark where it is.

Each particle has a volume that never changes, the ring it was seeded in. Velocities go to the faces by bilinear weights
and come back as FLIP: the particle keeps a share of its own velocity and takes the change of the grid's.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline, serial
from scenarios.collisions.film_impact.grid import Grid, surface_height

LEAST_WEIGHT = 1e-3
"""Faces with a smaller share of a cell's volume from particles take no velocity from them."""


def seed(grid: Grid, depth: float, per_side: int) -> tuple[np.ndarray, np.ndarray]:
    """Particles of a layer at rest.

    grid      of the impact
    depth     of the layer [m]
    per_side  particles along each side of a cell
    returns   places and velocities (n, 4): radius, height [m], radial and vertical velocity [m/s]; volumes (n,) [m3]
    """
    spacing = grid.dx / per_side
    r = (np.arange(grid.radial * per_side) + 0.5) * spacing
    layers = round(depth / spacing)
    z = (np.arange(layers) + 0.5) * (depth / layers)
    particles = np.zeros((len(r) * layers, 4))
    particles[:, 0], particles[:, 1] = np.repeat(r, layers), np.tile(z, len(r))
    return particles, 2.0 * np.pi * particles[:, 0] * spacing * (depth / layers)


@inline
def sample(values, x, y):
    """Bilinear value at a place in units of cells from the first value; constant beyond the last."""
    x = min(max(x, 0.0), values.shape[0] - 1.000001)
    y = min(max(y, 0.0), values.shape[1] - 1.000001)
    i, j = int(x), int(y)
    a, b = x - i, y - j
    low = (1.0 - a) * values[i, j] + a * values[i + 1, j]
    high = (1.0 - a) * values[i, j + 1] + a * values[i + 1, j + 1]
    return (1.0 - b) * low + b * high


@inline
def spread(weights, sums, x, y, volume, value):
    """Add a particle to the values around it."""
    i, j = math.floor(x), math.floor(y)
    a, b = x - i, y - j
    for k in range(2):
        for m in range(2):
            if 0 <= i + k < weights.shape[0] and 0 <= j + m < weights.shape[1]:
                weight = volume * (a if k else 1.0 - a) * (b if m else 1.0 - b)
                weights[i + k, j + m] += weight
                sums[i + k, j + m] += weight * value


@serial
def to_faces(particles, volume, dx, u, w, known_u, known_w):
    """Velocities of the particles on the faces; `known_u`, `known_w` mark faces with enough liquid around them."""
    weight_u, weight_w = np.zeros_like(u), np.zeros_like(w)
    u[:] = 0.0
    w[:] = 0.0
    for n in range(len(particles)):
        x, y = particles[n, 0] / dx, particles[n, 1] / dx
        spread(weight_u, u, x, y - 0.5, volume[n], particles[n, 2])
        spread(weight_w, w, x - 0.5, y, volume[n], particles[n, 3])
    ring = 2.0 * math.pi * dx * dx * dx
    for i in range(u.shape[0]):
        for j in range(u.shape[1]):
            known_u[i, j] = weight_u[i, j] > LEAST_WEIGHT * ring * max(i, 1)
            u[i, j] = u[i, j] / weight_u[i, j] if known_u[i, j] and i > 0 else 0.0
    for i in range(w.shape[0]):
        for j in range(w.shape[1]):
            known_w[i, j] = weight_w[i, j] > LEAST_WEIGHT * ring * (i + 0.5)
            w[i, j] = w[i, j] / weight_w[i, j] if known_w[i, j] and j > 0 else 0.0


@serial
def deposit(particles, volume, dx, volumes):
    """Liquid around each cell's centre, weighted with a tent of two cells [m3]."""
    unused = np.zeros_like(volumes)
    volumes[:] = 0.0
    for n in range(len(particles)):
        spread(volumes, unused, particles[n, 0] / dx - 0.5, particles[n, 1] / dx - 0.5, volume[n], 0.0)


@serial
def openness(open_cell, shares):
    """Share of the volume around each cell's centre that is open, weighted with the same tent."""
    radial, vertical = open_cell.shape
    for i in range(radial):
        for j in range(vertical):
            room, whole = 0.0, 0.0
            for k in range(max(i - 1, 0), min(i + 2, radial)):
                for m in range(max(j - 1, 0), min(j + 2, vertical)):
                    weight = (0.75 if k == i else 0.125) * (0.75 if m == j else 0.125) * (k + 0.5)
                    room += weight * open_cell[k, m]
                    whole += weight
            shares[i, j] = room / whole


def full(grid: Grid, per_side: int) -> np.ndarray:
    """What :func:`deposit` gives where there is liquid everywhere [m3]."""
    volumes = np.zeros(grid.open_cell.shape)
    deposit(*seed(grid, grid.vertical * grid.dx, per_side), grid.dx, volumes)
    return volumes


def filled_share(grid: Grid, particles: np.ndarray, volume: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Share of the open volume around each cell's centre that is liquid; a half where the surface passes through it.

    whole  from :func:`full`
    """
    volumes, shares = np.zeros_like(whole), np.zeros_like(whole)
    deposit(particles, volume, grid.dx, volumes)
    openness(grid.open_cell, shares)
    room = np.where((grid.open_cell > 0.0) & (shares > 0.0), whole * shares, np.inf)
    return np.asarray(volumes / room)


def in_columns(grid: Grid, particles: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Liquid in each column [m3]."""
    column = (particles[:, 0] / grid.dx).astype(int)
    return np.bincount(column, weights=volume, minlength=grid.radial)[: grid.radial]


@serial
def to_particles(particles, dx, flip, u, w, before_u, before_w):
    """New velocities of the particles from the faces, before and after the forces of the step."""
    for n in range(len(particles)):
        x, y = particles[n, 0] / dx, particles[n, 1] / dx
        new_u, new_w = sample(u, x, y - 0.5), sample(w, x - 0.5, y)
        old_u, old_w = sample(before_u, x, y - 0.5), sample(before_w, x - 0.5, y)
        particles[n, 2] = new_u + flip * (particles[n, 2] - old_u)
        particles[n, 3] = new_w + flip * (particles[n, 3] - old_w)


@serial
def move(particles, dx, dt, u, w, radius, gap):
    """Move the particles by the midpoint rule, and keep them between plate, side and bead."""
    right = (u.shape[0] - 1) * dx
    for n in range(len(particles)):
        r, z = particles[n, 0], particles[n, 1]
        x = r + 0.5 * dt * sample(u, r / dx, z / dx - 0.5)
        y = z + 0.5 * dt * sample(w, r / dx - 0.5, z / dx)
        r += dt * sample(u, x / dx, y / dx - 0.5)
        z += dt * sample(w, x / dx - 0.5, y / dx)
        r, z = min(abs(r), right * (1.0 - 1e-9)), max(z, 1e-3 * dx)
        if z > surface_height(radius, gap, r):
            z = outside_bead(radius, gap, r, z)
        particles[n, 0], particles[n, 1] = r, z


@inline
def outside_bead(radius, gap, r, z):
    """Height just below the bead for a particle that has entered it."""
    return max(surface_height(radius, gap, r), 0.0) * (1.0 - 1e-9)


# ---------------------------------------------------------------- faces that no particle reaches


AROUND, BESIDE = 3, 2
"""Layers of faces to which velocities are extended, and to which their change in a step is; beyond, liquid falls
freely."""


@serial
def carry(dt, dx, along, values, is_set, last, last_known):
    """Velocities of faces without particles from the step before, carried along the radius with the speed `along`."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            if not is_set[i, j] and last_known[i, j]:
                values[i, j] = sample(last, i - dt * along[i, min(j, along.shape[1] - 1)] / dx, float(j))
                is_set[i, j] = True


@serial
def extend(values, is_set, layers):
    """Extend values outwards, layer by layer, by the mean of the neighbours that are known."""
    is_set = is_set.copy()
    for _ in range(layers):
        fresh = is_set.copy()
        for i in range(values.shape[0]):
            for j in range(values.shape[1]):
                if is_set[i, j]:
                    continue
                total, count = 0.0, 0
                for k, m in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                    if 0 <= k < values.shape[0] and 0 <= m < values.shape[1] and is_set[k, m]:
                        total += values[k, m]
                        count += 1
                if count:
                    values[i, j] = total / count
                    fresh[i, j] = True
        is_set[:] = fresh


def cells_to_faces(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether each radial and each horizontal face has a marked cell on one side."""
    u = np.zeros((cells.shape[0] + 1, cells.shape[1]), dtype=np.bool_)
    w = np.zeros((cells.shape[0], cells.shape[1] + 1), dtype=np.bool_)
    u[:-1] |= cells
    u[1:] |= cells
    w[:, :-1] |= cells
    w[:, 1:] |= cells
    return u, w


def extended_change(after: np.ndarray, before: np.ndarray, wet: np.ndarray, elsewhere: float) -> np.ndarray:
    """Velocities after a step, also beside the liquid and within the solids, where the change is that next to them.

    after, before  velocities of the step
    wet            faces on which the step has computed one
    elsewhere      change far from the liquid [m/s]
    """
    change = np.where(wet, after - before, np.nan)
    extend(change, wet, BESIDE)
    return before + np.where(np.isnan(change), elsewhere, change)


# ---------------------------------------------------------------- volume of the liquid


FROM = 0.03
"""Excess of a cell, over its room, that is within the noise of the particles [-]."""

SHARE, FARTHEST = 0.25, 0.1
"""Shift of a particle in a step down the gradient of the filled share, in cells, and the largest."""

BLOCK = 4
"""Half the width of the tents with which liquid and room are compared [cells]."""


@serial
def spread_out(particles, dx, filled, open_cell, first):
    """Shift the particles of crowded cells towards emptier ones, in columns from `first` on."""
    for n in range(len(particles)):
        i = min(int(particles[n, 0] / dx), filled.shape[0] - 1)
        j = min(int(particles[n, 1] / dx), filled.shape[1] - 1)
        if i < first or filled[i, j] <= 1.0 + FROM:
            continue
        along = beside(filled, open_cell, i + 1, j, i, j) - beside(filled, open_cell, i - 1, j, i, j)
        up = beside(filled, open_cell, i, j + 1, i, j) - beside(filled, open_cell, i, j - 1, i, j)
        particles[n, 0] -= dx * min(max(0.5 * SHARE * along, -FARTHEST), FARTHEST)
        particles[n, 1] -= dx * min(max(0.5 * SHARE * up, -FARTHEST), FARTHEST)


@inline
def beside(filled, open_cell, k, m, i, j):
    """Filled share of a neighbour; that of the cell itself where the neighbour is closed."""
    if 0 <= k < filled.shape[0] and 0 <= m < filled.shape[1] and open_cell[k, m] > 0.5:
        return filled[k, m]
    return filled[i, j]


def overfilled(grid: Grid, particles: np.ndarray, volume: np.ndarray) -> float:
    """Liquid that lies where there is no room for it, over all liquid [-].

    Liquid and room are summed with tents of four cells to each side, which add up to 1. Sums over blocks with sharp
    edges would count the particles that happen to lie on one side of an edge: 1 to 2.5 % in a lattice that is merely
    stretched.

    particles  radius and height in the first two columns [m]
    volume     of each particle [m3]
    """
    cells = np.stack(np.meshgrid(*(np.arange(length) + 0.5 for length in grid.open_cell.shape), indexing="ij"), axis=-1)
    room = grid.open_cell * (grid.ring * grid.dx)[:, None]
    volumes = _tents(particles[:, :2] / grid.dx, volume, grid)
    return float(np.maximum(volumes - _tents(cells.reshape(-1, 2), room.ravel(), grid), 0.0).sum() / volume.sum())


def _tents(places: np.ndarray, volume: np.ndarray, grid: Grid) -> np.ndarray:
    """Volumes at places, in cells, summed with tents around every fourth corner of the cells."""
    sums = np.zeros([length // BLOCK + 2 for length in grid.open_cell.shape])
    most = np.array(grid.open_cell.shape) - 1e-9
    corner, share = np.divmod(np.minimum(places, most) / BLOCK, 1.0)
    i, j = corner.astype(int).T
    for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
        weight = np.abs(1.0 - a - share[:, 0]) * np.abs(1.0 - b - share[:, 1])
        np.add.at(sums, (i + a, j + b), weight * volume)
    return sums
