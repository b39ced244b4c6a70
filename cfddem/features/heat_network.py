"""The implicit step of particles that exchange heat, and of walls with a power, by conjugate gradients.

Every rank solves for its own particles. Ghosts receive the unknowns of others before each product. A particle sums its
links in the order of the ids of the others, and scalar products are sums of whole numbers: the bits are those of one
process, for any division of space. A wall with a power is an unknown that every rank has.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.compile import serial
from cfddem.data.fields import Field
from cfddem.particles.state import Particles
from closures.contact_heat import (
    asperity_conductance,
    contact_conductance,
    harmonic_conductivity,
    hertz_radius,
    intersection_radius,
    lens_conductance,
    macro_gap_conductance,
    micro_gap_conductance,
    solid_layer_resistance,
)

TOLERANCE = 1e-13
"""Residual of the implicit step over the right-hand side [-]."""

MOST_ITERATIONS = 2000

UNKNOWN = Field("heat_unknown", "K", role="scratch", halo=("heat",), meaning="iterate of the exchange of heat")
"""The field by which ghosts get the unknowns of others."""


class Links(NamedTuple):
    """Conductances of owned particles with others, by particle and then by the id of the other."""

    row: np.ndarray  # owned particle (n,)
    other: np.ndarray  # owned, or a ghost (n,)
    link: np.ndarray  # [W/K]

    @classmethod
    def of(cls, first: np.ndarray, second: np.ndarray, conductance: np.ndarray, particles: Particles) -> Links:
        """Links of pairs; a pair of two owned particles has two."""
        some = conductance > 0.0
        row, other = np.append(first[some], second[some]), np.append(second[some], first[some])
        link = np.tile(conductance[some], 2)
        mine = row < particles.owned
        row, other, link = row[mine], other[mine], link[mine]
        order = np.lexsort((link, particles.id[other], row))
        return cls(row[order], other[order], link[order])

    def sums(self, values: np.ndarray, count: int) -> np.ndarray:
        """Sums of the values of links over each of so many particles (count,)."""
        return np.bincount(self.row, values, count).astype(float)  # whole numbers without a link


class Network:
    """Linear equations of the new temperatures.

    solver    whose particles exchange
    diagonal  of owned particles, without their links (N,) [W/K]
    pairs     links between particles
    at_walls  rows of owned particles, numbers of walls with a power, and their links [W/K]
    walls     number of these walls
    """

    def __init__(
        self,
        solver: Any,
        diagonal: np.ndarray,
        pairs: Links,
        at_walls: tuple[np.ndarray, np.ndarray, np.ndarray],
        walls: int,
    ) -> None:
        self.solver, self.pairs, self.at_walls, self.walls = solver, pairs, at_walls, walls
        self.total, self.count = solver.communicator.sum, len(diagonal)
        body, _, link = at_walls
        of_particles = diagonal + pairs.sums(pairs.link, self.count)
        np.add.at(of_particles, body, link)
        of_walls = self._at_each_wall(link)
        of_walls[of_walls == 0.0] = 1.0  # a wall that nothing touches
        self.diagonal = np.append(of_particles, of_walls)

    def _at_each_wall(self, values: np.ndarray) -> np.ndarray:
        """Sums over the links of every wall, of all ranks (walls,)."""
        if not self.walls:
            return np.zeros(0)
        of_wall = self.at_walls[1] == np.arange(self.walls)[:, None]
        return np.asarray(self.total(np.where(of_wall, values, 0.0), axis=1))

    def around(self, values: np.ndarray) -> np.ndarray:
        """Values of the owned particles (N,), followed by those of ghosts."""
        particles = self.solver.particles
        particles.heat_unknown[: self.count] = values
        self.solver.lists.ghosts.refresh("heat")
        return np.asarray(particles.heat_unknown)

    def product(self, values: np.ndarray) -> np.ndarray:
        """The equations, applied to unknowns of owned particles and walls (N + walls,)."""
        (_, other, link), (body, node, at_wall), count = self.pairs, self.at_walls, self.count
        apart = self.pairs.sums(link * self.around(values[:count])[other], count)
        np.add.at(apart, body, at_wall * values[count:][node])
        return self.diagonal * values - np.append(apart, self._at_each_wall(at_wall * values[body]))

    def dot(self, one: np.ndarray, other: np.ndarray) -> float:
        """Scalar product over all ranks; walls count once."""
        product, n = one * other, self.count
        return float(self.total(product[:n]) + product[n:].sum())

    def solved(self, right: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Temperatures of owned particles, and of walls with a power [K].

        right  right-hand side (N + walls,) [W]
        start  first guess of particles (N,) [K]
        """
        values = np.append(start, (right / self.diagonal)[self.count :])
        residual = right - self.product(values)
        scale = self.dot(right, right)
        direction, size = np.zeros(len(right)), 1.0
        for _ in range(MOST_ITERATIONS):
            if self.dot(residual, residual) <= TOLERANCE**2 * scale:
                break
            guess = residual / self.diagonal
            before, size = size, self.dot(residual, guess)
            direction = guess + (size / before) * direction
            image = self.product(direction)
            length = size / self.dot(direction, image)
            values, residual = values + length * direction, residual - length * image
        return values[: self.count], values[self.count :]


# ---------------------------------------------------------------- loops
#
# Conductances of pairs of particles, and of particles and walls, in one compiled loop.


NONE, SMOOTH, ROUGH = 0, 1, 2
LENS, RAREFIED = 1, 2


class Pairs(NamedTuple):
    """Pairs of two spheres, or of a sphere and a wall, whose radius is infinite."""

    first: np.ndarray  # radius [m]
    second: np.ndarray  # radius [m]
    gap: np.ndarray  # [m]
    force: np.ndarray  # normal, of the contact; 0 or less without one [N]
    modulus: np.ndarray  # E* of the real solids [Pa]
    first_conductivity: np.ndarray  # [W/m/K]
    second_conductivity: np.ndarray  # [W/m/K]
    hardness: np.ndarray  # harmonic mean of the two [Pa]
    roughness: np.ndarray  # of both surfaces together [m]
    slope: np.ndarray  # of both together [-]


class Choices(NamedTuple):
    """Which conductances act, and the gas."""

    contact: int  # NONE, SMOOTH or ROUGH
    by_force: bool  # the radius of a contact is that of Hertz
    gap: int  # NONE, LENS or RAREFIED
    conductivity: float  # of the gas [W/m/K]
    lens: float  # gap up to which it conducts, over the larger radius [-]
    least_gap: float  # [m]
    jump: float  # gas parameter M [m]


@serial
def conductances(pairs, choices, result):
    """Conductance of each pair, written to `result` (n,) [W/K]."""
    gas = choices.conductivity
    for k in range(len(result)):
        first, second, gap = pairs.first[k], pairs.second[k], pairs.gap[k]
        reduced = first if second == math.inf else first * second / (first + second)
        circle, total = 0.0, 0.0
        if choices.contact != NONE:
            if choices.by_force and pairs.force[k] > 0.0:
                circle = min(hertz_radius(pairs.force[k], pairs.modulus[k], reduced), reduced)
            elif not choices.by_force and gap < 0.0:
                circle = intersection_radius(first, second, -gap)
        if circle > 0.0:
            both = harmonic_conductivity(pairs.first_conductivity[k], pairs.second_conductivity[k])
            total = contact_conductance(both, circle)
            if choices.contact == ROUGH:
                pressure = max(1.5 * pairs.force[k] / (math.pi * circle**2 * pairs.hardness[k]), 1e-12)
                rough = asperity_conductance(both, circle, pressure, pairs.roughness[k], pairs.slope[k])
                if choices.gap != NONE:
                    rough += gas * micro_gap_conductance(circle, pressure, pairs.roughness[k], choices.jump)
                total = 1.0 / (1.0 / total + 1.0 / rough)
        if choices.by_force and gap < 0.0:  # a softened contact overlaps too much
            gap = -(circle**2) / reduced
        if choices.gap == LENS:
            total += gas * lens_conductance(first, second, gap, choices.lens, choices.least_gap)
        elif choices.gap == RAREFIED and gap < choices.lens * (first if second == math.inf else max(first, second)):
            around = gas * macro_gap_conductance(first, second, gap, circle, choices.jump)
            layers = solid_layer_resistance(first, circle, pairs.first_conductivity[k])
            if second != math.inf:
                layers += solid_layer_resistance(second, circle, pairs.second_conductivity[k])
            total += 1.0 / (1.0 / around + layers)
        result[k] = total
