r"""The smoothed liquid, with the plate below it, a free surface, and the bead: viscous stress, pressure, motion.

.. math:: \sum_j a_{ij}(p_i - p_j) + 2\kappa_i p_i = -\frac{\rho}{\Delta t}\nabla\cdot u^* - \sum_w B_{iw}\,g_{iw},
          \qquad g_{iw} = \frac{\rho}{\Delta t}(u_i^* - u_w)\cdot n_{iw}

Neighbours that are missing at the free surface, in all kappa, carry -p_i: the surface need not be found exactly. At a
solid the pressure has the slope g, which stops the liquid there. The speed of the bead is one more unknown, as on the
grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import LinearOperator, bicgstab

from cfddem.backend.errors import RunFailed
from scenarios.collisions.film_impact.pressure import Bead
from scenarios.references.isph import kernel
from scenarios.references.isph.kernel import REACH, SMOOTHING

TOLERANCE = 1e-9
"""Of the residual of the pressure, relative; that of the paper."""

NOISE, ITERATIONS = 1e-12, 2000
"""Round-off of the divergence, over speed and spacing, and the most iterations."""

INSIDE = 0.2
"""Share of the neighbours of a particle inside the liquid that may be missing by disorder."""

ALONE = 0.15
"""Share of liquid among the neighbours, below which a particle has no pressure: it is caught between the solids."""

LEAST = 0.5
"""Least share of the neighbours along a solid that is made up for; particles in thinner gaps scatter otherwise."""

THIN, LEAK = 1.2, 0.03
"""Gaps that hold one layer of particles [spacings], and the share of missing neighbours there: a few particles that are
cut off from the others would have no pressure to start from."""

FIXED = 1e-6
"""Share of missing neighbours in a closed box, where the pressure is free by a constant."""

SHIFT = 1.0
"""Displacement inside the liquid towards where there are fewer particles, over speed, h and the sum of the gradients of
the kernel. Liquid at rest is not shifted."""


class SmoothedLiquid:
    """Liquid particles in a box with mirror planes along its sides."""

    def __init__(self, counts: tuple[int, int, int], dx: float, density: float, viscosity: float,
                 gravity: float = 9.81, bead: Bead | None = None, plate: bool = True) -> None:  # fmt: skip
        self.dx, self.density, self.viscosity, self.gravity, self.bead = dx, density, viscosity, gravity, bead
        self.size = np.array([counts[0] * dx, counts[1] * dx, np.inf if plate else counts[2] * dx])
        self.place = lattice(counts, dx)
        self.velocity, self.pressure = np.zeros_like(self.place), np.zeros(len(self.place))
        self.plate = solid(dx) if plate else None
        self.cap = solid(dx, bead.radius) if bead is not None else None
        self.full = kernel.full_sum(dx)
        self.losses = {"viscous": 0.0, "impulsive": 0.0, "exchange": 0.0}  # in this quarter [J]
        self.plate_force = 0.0  # on the plate, of the whole film [N]

    @property
    def mass(self) -> float:
        """Mass of a particle [kg]."""
        return float(self.density * self.dx**3)

    def step(self, dt: float) -> None:
        """Advance the liquid, and the speed of the bead; the bead itself moves outside."""
        self.find_neighbours()
        self.apply_forces(dt)
        self.apply_pressure(dt)
        self.place += dt * self.velocity + self._shift(dt)

    def find_neighbours(self) -> None:
        """Pairs of the liquid, and what each particle sees of the solids."""
        self.every, self.origin, self.signs = images(self.place, self.size, kernel.REACH * self.dx)
        self.start, self.found = kernel.neighbours(self.every, len(self.place), kernel.REACH * self.dx)
        if len(self.found) == kernel.MOST * len(self.place):
            raise RunFailed(f"particles have more than {kernel.MOST} neighbours on average; the liquid has collapsed")
        self.laplacian, self.gradient = kernel.weights(self.every, self.start, self.found, self.dx)
        self.solids = self._solids()
        self.thin, self.share_of_gap = self._thin_gaps()
        self.stretch = self._stretches()

    def _solids(self) -> list[tuple[Seen, np.ndarray, float]]:
        """For plate and bead: what is seen, unit normals towards the liquid (n, 3), and the vertical speed."""
        solids: list[tuple[Seen, np.ndarray, float]] = []
        if self.plate is not None:
            up = np.zeros_like(self.place)
            up[:, 2] = 1.0
            solids.append((self.plate.at(self.place[:, 2]), up, 0.0))
        if self.bead is not None and self.cap is not None:
            away = self.place - np.array([0.0, 0.0, self.bead.gap + self.bead.radius])
            far = np.linalg.norm(away, axis=1)
            solids.append((self.cap.at(far - self.bead.radius), away / far[:, None], self.bead.velocity))
        return solids

    def apply_forces(self, dt: float) -> None:
        """Viscous stress with no slip on the solids, and gravity."""
        before = self.energy()
        if self.viscosity > 0.0:
            self._diffuse(dt * self.viscosity / self.density)
        self.losses["viscous"] += before - self.energy()
        if self.plate is not None:
            self.velocity[:, 2] -= self.gravity * dt
        if self.bead is not None:
            self.bead.velocity -= self.gravity * dt

    def _diffuse(self, rate: float) -> None:
        """Add the viscous stress of a step, that of the solids implicitly; the bead feels the reaction."""
        change = rate * np.stack([self._sum(self.laplacian * apart) for apart in self._differences()], axis=1)
        resisted, dragged = np.ones(len(self.place)), np.zeros_like(self.place)
        for view, _, speed in self.solids:
            friction = rate * view.friction(self.dx)
            resisted += friction
            dragged[:, 2] += friction * speed
        self.velocity = (self.velocity + change + dragged) / resisted[:, None]
        if self.bead is not None:
            view, _, speed = self.solids[-1]
            gained = rate * view.friction(self.dx) * (speed - self.velocity[:, 2])
            self.bead.velocity -= 4.0 * self.mass * float(gained.sum()) / self.bead.mass

    def _differences(self) -> list[np.ndarray]:
        """Velocity of the neighbour less that of the particle, of each pair, along each axis [m/s]."""
        other, row = self.origin[self.found], self._rows()
        signs = self.signs[self.found]
        return [self.velocity[other, axis] * signs[:, axis] - self.velocity[row, axis] for axis in range(3)]

    def _rows(self) -> np.ndarray:
        return np.repeat(np.arange(len(self.place)), np.diff(self.start))

    def _sum(self, values: np.ndarray) -> np.ndarray:
        """Sum over the pairs of each particle."""
        return np.asarray(kernel.row_sums(self.start, values))

    def apply_pressure(self, dt: float) -> None:
        """Solve for the pressure and the speed of the bead; the velocity becomes free of divergence.

        The loss of a projection is that of impulses; what these particles lose or gain beside it is an error.
        """
        before, explained = self.energy(), self.losses["impulsive"]
        matrix, alone = self._matrix()
        heavy, bead = self.density / dt, self.bead
        every = (self.start, self.found, self.origin, self.signs, self.gradient, self.stretch)
        source = -kernel.divergence(self.velocity, *every)
        slopes = [(self.velocity * normal).sum(axis=1) for _, normal, _ in self.solids]
        for (view, _, _), slope in zip(self.solids, slopes):
            source -= view.slope * slope
        noise = heavy * NOISE * float(np.abs(self.velocity).max()) / self.dx
        self.pressure = self._solve(matrix, np.where(alone, 0.0, heavy * source), self.pressure, noise)
        if bead is not None:
            view, normal = self.solids[-1][:2]
            moving = self._solve(
                matrix,
                np.where(alone, 0.0, heavy * view.slope * normal[:, 2]),
                np.zeros_like(source),
                heavy * NOISE / self.dx,
            )
            still = self._push(view, normal, self.pressure, heavy * slopes[-1])
            rate = self._push(view, normal, moving, -heavy * normal[:, 2])
            share, arrived = dt / bead.mass, bead.velocity
            bead.velocity = (bead.velocity + share * still) / (1.0 - share * rate)
            bead.force = still + rate * bead.velocity
            self.losses["impulsive"] += 0.125 * bead.mass * (bead.velocity - arrived) ** 2
            self.pressure = self.pressure + bead.velocity * moving
            slopes[-1] = slopes[-1] - bead.velocity * normal[:, 2]
        self._correct(dt / self.density, [heavy * slope for slope in slopes])
        self.losses["exchange"] += before - self.energy() - (self.losses["impulsive"] - explained)

    def _thin_gaps(self) -> tuple[np.ndarray, np.ndarray]:
        """Which particles lie in a gap too thin for a second layer, and their height over that of the gap."""
        if self.bead is None or self.plate is None:
            return np.zeros(len(self.place), np.bool_), np.zeros(len(self.place))
        plate, cap = (view for view, _, _ in self.solids)
        height = plate.distance + cap.distance
        thin, share = height < THIN * self.dx, plate.distance / np.maximum(height, 1e-12)
        return thin, share

    def _stretches(self) -> np.ndarray:
        """Tensors by which each particle's neighbours count more along a solid, which hides some of them (n, 3, 3)."""
        stretch = np.zeros((len(self.place), 3, 3))
        stretch += np.eye(3)
        if not self.solids:
            return stretch
        open_share = 1.0 - sum(view.hidden for view, _, _ in self.solids)
        if self.thin.any():
            open_share = np.where(
                self.thin, kernel.moment_across(self.every, self.start, self.found, self.gradient), open_share
            )
            open_share = np.minimum(open_share, 1.0)
        distances = np.stack([view.distance for view, _, _ in self.solids])
        normals = np.stack([normal for _, normal, _ in self.solids])
        normal = normals[distances.argmin(axis=0), np.arange(len(self.place))]
        along = np.eye(3) - normal[:, :, None] * normal[:, None, :]
        return np.asarray(stretch + (1.0 / np.maximum(open_share, LEAST) - 1.0)[:, None, None] * along)

    def _shift(self, dt: float) -> np.ndarray:
        """Displacement of particles inside the liquid towards where there are fewer, in proportion to their speed."""
        uneven = np.stack([self._sum(self.gradient[:, axis]) for axis in range(3)], axis=1)
        for view, normal, _ in self.solids:
            uneven -= np.where(self.thin, 0.0, view.push)[:, None] * normal
        reach = SHIFT * kernel.SMOOTHING * self.dx * dt * np.linalg.norm(self.velocity, axis=1)
        return np.where((self.surface | self.thin)[:, None], 0.0, -reach[:, None] * uneven)

    def _matrix(self) -> tuple[csr_matrix, np.ndarray]:
        """The matrix of the pressure, and which particles have none."""
        count, liquid = len(self.place), self._sum(self.laplacian)
        around = liquid + sum(view.count for view, _, _ in self.solids)
        missing = np.maximum(self.full - around, 0.0)
        self.surface = missing > INSIDE * self.full
        surface = np.where(self.surface, 2.0 * missing, 0.0) + (FIXED * self.full if self.plate is None else 0.0)
        alone = liquid < ALONE * self.full
        every = np.arange(count)
        rows = np.concatenate([self._rows(), every])
        columns = np.concatenate([self.origin[self.found], every])
        more = np.trace(self.stretch, axis1=1, axis2=2) / 2.0 - 0.5
        links = self.laplacian * 0.5 * (more[self._rows()] + more[self.origin[self.found]])
        values = np.concatenate(
            [
                np.where(np.repeat(alone, np.diff(self.start)), 0.0, -links),
                np.where(alone, self.full, self._sum(links) + surface + self.thin * LEAK * self.full),
            ]
        )
        return csr_matrix((values, (rows, columns)), shape=(count, count)), alone

    def _solve(self, matrix: csr_matrix, right: np.ndarray, guess: np.ndarray, noise: float) -> np.ndarray:
        """Solve by BiCGSTAB with the diagonal as preconditioner."""
        if not right.any():
            return np.zeros_like(right)
        if self.plate is None:
            right = right - right.mean()  # a closed box can only turn its liquid
        inverse = 1.0 / matrix.diagonal()
        precondition = LinearOperator(matrix.shape, matvec=lambda x: inverse * x)
        pressure, failed = bicgstab(
            matrix,
            right,
            x0=guess,
            rtol=TOLERANCE,
            atol=noise * math.sqrt(len(right)),
            maxiter=ITERATIONS,
            M=precondition,
        )
        if failed:
            complaint = f"the pressure has not converged to {TOLERANCE:g} in {ITERATIONS} iterations"
            raise RunFailed(f"{complaint}, bead at {self.bead.gap if self.bead else math.inf:g} m; take more layers")
        return np.asarray(pressure)

    def _push(self, view: Seen, normal: np.ndarray, pressure: np.ndarray, slope: np.ndarray) -> float:
        """Force of the liquid's pressure on a solid, upwards, of the whole film [N]."""
        return float(-4.0 * self.dx**3 * (normal[:, 2] * (2.0 * pressure * view.push - slope * view.lag)).sum())

    def _correct(self, rate: float, slopes: list[np.ndarray]) -> None:
        """Subtract the gradient of the pressure, with its slope at the solids."""
        gradient = kernel.gradient_of(
            self.pressure, self.start, self.found, self.origin, self.gradient, self.stretch, self.surface
        )
        for (view, normal, _), slope in zip(self.solids, slopes):
            own = np.where(self.surface, 2.0 * self.pressure * view.push, 0.0)
            gradient -= (own - slope * view.lag)[:, None] * normal
        if self.plate is not None:
            self.plate_force = -self._push(*self.solids[0][:2], self.pressure, slopes[0])
        self.losses["impulsive"] += 0.5 * self.mass * rate**2 * float((gradient**2).sum())
        self.velocity -= rate * gradient
        if self.bead is not None and self.thin.any():
            self.velocity[self.thin, 2] = self.bead.velocity * self.share_of_gap[self.thin]

    def energy(self) -> float:
        """Kinetic energy of this quarter, with that of the bead [J]."""
        bead = self.bead
        return self.kinetic_energy() + (0.125 * bead.mass * bead.velocity**2 if bead is not None else 0.0)

    def kinetic_energy(self) -> float:
        """Of this quarter [J]."""
        return 0.5 * self.mass * float((self.velocity**2).sum())


# ---------------------------------------------------------------- solids


POINTS, STEPS = 200, 600
"""Entries of the tables over the distance, and steps of the integrals over s."""

CLOSEST = 0.1
"""Least distance of a particle from a solid, in its viscous stress [particle spacings]."""


@dataclass(frozen=True)
class Solid:
    """The integrals as tables over the distance from the surface."""

    distance: np.ndarray  # [m]
    count: np.ndarray  # A [1/m2]
    slope: np.ndarray  # B [1/m]
    push: np.ndarray  # G [1/m]
    lag: np.ndarray  # C [-]
    hidden: np.ndarray  # H [-]

    def at(self, distance: np.ndarray) -> Seen:
        """The integrals for particles at these distances (n,) [m]; zero beyond the reach."""
        tables = (self.count, self.slope, self.push, self.lag, self.hidden)
        return Seen(distance, *(np.interp(distance, self.distance, column, right=0.0) for column in tables))


@dataclass(frozen=True)
class Seen:
    """What each liquid particle sees of a solid."""

    distance: np.ndarray
    count: np.ndarray
    slope: np.ndarray
    push: np.ndarray
    lag: np.ndarray
    hidden: np.ndarray

    def friction(self, dx: float) -> np.ndarray:
        """Sum of the weights of no slip, B/d: the velocity is linear through the surface (n,) [1/m2]."""
        return np.asarray(self.slope / np.maximum(self.distance, CLOSEST * dx))


def solid(dx: float, radius: float = np.inf) -> Solid:
    """A sphere, or a half-space, as particles of a spacing see it.

    dx      [m]
    radius  of the sphere [m]
    """
    h, reach = SMOOTHING * dx, REACH * dx
    distance = np.linspace(0.0, reach, POINTS)
    s = (np.arange(STEPS) + 0.5) * reach / STEPS
    steep = -np.array([kernel.slope.py_func(place, h) for place in s])
    if np.isinf(radius):
        cosine = distance[:, None] / s
    else:
        middle = radius + distance[:, None]
        cosine = (middle**2 + s**2 - radius**2) / (2.0 * middle * s)
    low = np.clip(cosine, -1.0, 1.0)
    weight = 2.0 * steep * s / (s**2 + 0.01 * h * h)
    shell = 2.0 * np.pi * s**2 * reach / STEPS
    one, two, three = 1.0 - low, 0.5 * (1.0 - low**2), (1.0 - low**3) / 3.0
    return Solid(
        distance,
        (weight * shell * one).sum(axis=1),
        (weight * s * shell * two).sum(axis=1),
        (steep * shell * two).sum(axis=1),
        (steep * s * shell * three).sum(axis=1),
        (0.5 * steep * s * shell * (one - three)).sum(axis=1),
    )


# ---------------------------------------------------------------- points of a lattice


def lattice(counts: tuple[int, int, int], dx: float) -> np.ndarray:
    """Points at the centres of a block of cells, corner at the origin (n, 3) [m]."""
    x, y, z = ((np.arange(count) + 0.5) * dx for count in counts)
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)


def images(points: np.ndarray, size: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Images in the mirror planes at 0 and at the size along each axis, and at their edges.

    points   (n, 3) [m]
    size     of the box; infinite along an axis without mirrors (3,) [m]
    reach    distance from a plane up to which a point has an image [m]
    returns  all places, those of the points first (m, 3) [m]; the point of each (m,); signs of its velocity (m, 3)
    """
    places, origin, signs = points, np.arange(len(points)), np.ones_like(points)
    for axis in np.flatnonzero(np.isfinite(size)):
        near = (places[:, axis] < reach, places[:, axis] > size[axis] - reach)
        copies = []
        for close, plane in zip(near, (0.0, size[axis])):
            copy, turned = places[close].copy(), signs[close].copy()
            copy[:, axis] = 2.0 * plane - copy[:, axis]
            turned[:, axis] *= -1.0
            copies.append((copy, origin[close], turned))
        places = np.concatenate([places, *(image[0] for image in copies)])
        origin = np.concatenate([origin, *(image[1] for image in copies)])
        signs = np.concatenate([signs, *(image[2] for image in copies)])
    return places, origin, signs


def reflected(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """The points, those that have crossed a mirror plane back inside (n, 3) [m]."""
    inside = np.abs(points)
    return np.where(inside > size, 2.0 * np.where(np.isfinite(size), size, 0.0) - inside, inside)
