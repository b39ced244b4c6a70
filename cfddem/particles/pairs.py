"""The pair graph: who is near whom, and what each pair remembers.

An edge joins two particles, or a particle and a wall. Edges of particles come first, sorted by their first
particle and then their second; edges of walls follow. Each neighbour is found once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.kernels import kernel
from cfddem.particles.state import Bodies
from cfddem.particles.walls import Walls


class Edges(NamedTuple):
    """The arrays of n edges, as compiled loops take them."""

    first: np.ndarray  # (n,) int32, particle
    second: np.ndarray  # (n,) int32, particle; wall in the edges after `between_particles`
    between_particles: int
    spring: np.ndarray  # (n, 3) tangential displacement of the contact [m]
    approach_speed: np.ndarray  # (n,) largest approach speed of this encounter [m/s]
    minimum_gap: np.ndarray  # (n,) h_min of this encounter [m]
    accounted_gap: np.ndarray  # (n,) gap up to which the film's impulse has been given [m]
    force: np.ndarray  # (n, 3) on the first body [N]
    couple: np.ndarray  # (n, 3) torque per radius, the same on both bodies [N]
    resistance: np.ndarray  # (n,) of the film, without lever; 0 out of its reach [kg/s]
    impulse: np.ndarray  # (n, 3) of the film in this step, on the first body [N s]
    entry: np.ndarray  # (n, 5) begin of the encounter, NaN outside one; (0, 5) where none are recorded
    start: np.ndarray  # (N + 1,) int64, where the edges of a particle begin in `incident`
    incident: np.ndarray  # int32, edge k where the particle is first, -1 - k where it is second


MEMORY = ("spring", "approach_speed", "minimum_gap", "accounted_gap", "entry")
"""What a pair remembers from step to step."""


def edges(first: np.ndarray, second: np.ndarray, between_particles: int, count: int, record: bool = False) -> Edges:
    """A fresh graph over `count` particles; pairs that have never met.

    first, second      (n,) as in :class:`Edges`
    between_particles  number of edges that join two particles
    record             keep the begin of encounters, for a record of them
    """
    number = len(first)
    first, second = np.ascontiguousarray(first, np.int32), np.ascontiguousarray(second, np.int32)
    start, incident = _incidence(first, second, between_particles, count)
    return Edges(
        first,
        second,
        int(between_particles),
        np.zeros((number, 3)),
        np.zeros(number),
        np.zeros(number),
        np.full(number, np.inf),
        np.zeros((number, 3)),
        np.zeros((number, 3)),
        np.zeros(number),
        np.zeros((number, 3)),
        np.full((number if record else 0, 5), np.nan),
        start,
        incident,
    )


@kernel
def _incidence(first, second, between_particles, count):
    """List the edges of each particle in ascending order."""
    start = np.zeros(count + 1, np.int64)
    for k in range(len(first)):
        start[first[k] + 1] += 1
        if k < between_particles:
            start[second[k] + 1] += 1
    for i in range(count):
        start[i + 1] += start[i]
    incident = np.empty(start[count], np.int32)
    filled = start[:-1].copy()
    for k in range(len(first)):
        i = first[k]
        incident[filled[i]] = k
        filled[i] += 1
        if k < between_particles:
            j = second[k]
            incident[filled[j]] = -1 - k
            filled[j] += 1
    return start, incident


def remember(old: Edges, new: Edges, bodies: Bodies) -> None:
    """Carry the memory of each pair from an old list to a new one, by the ids of its bodies."""
    if len(old.first) == 0 or len(new.first) == 0:
        return
    old_names, new_names = _names(old, bodies), _names(new, bodies)
    order = np.argsort(old_names, kind="stable")
    place = np.minimum(np.searchsorted(old_names, new_names, sorter=order), len(order) - 1)
    source = order[place]
    known = old_names[source] == new_names
    for field in MEMORY:
        if len(getattr(new, field)):
            getattr(new, field)[known] = getattr(old, field)[source[known]]
    turned = known & (bodies.id[new.first] != bodies.id[old.first[source]])
    new.spring[turned] *= -1.0


def _names(edges: Edges, bodies: Bodies) -> np.ndarray:
    """One integer that names a pair, whatever the order of its bodies and of the list."""
    split = edges.between_particles
    first = bodies.id[edges.first]
    other = np.concatenate([bodies.id[edges.second[:split]], -1 - edges.second[split:].astype(np.int64)])
    low, high = np.minimum(first, other), np.maximum(first, other)
    return (high << 32) + low


def gaps(edges: Edges, bodies: Bodies, walls: Walls) -> np.ndarray:
    """Gap of every edge (n,) [m]."""
    split = edges.between_particles
    i, j = edges.first[:split], edges.second[:split]
    apart = np.linalg.norm(bodies.position[i] - bodies.position[j], axis=1)
    between = apart - bodies.radius[i] - bodies.radius[j]
    i, w = edges.first[split:], edges.second[split:]
    height = np.einsum("ij,ij->i", bodies.position[i] - walls.point[w], walls.normal[w])
    return np.concatenate([between, height - bodies.radius[i]])
