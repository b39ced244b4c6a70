"""Liquid bridges between the particles of a run.

Every sphere carries liquid, the field `liquid`. A bridge forms where the films of two spheres overlap, from the liquid
that each has in the shadow of the other. It breaks where it is stretched too far; half of its liquid goes to each
sphere. In between it pulls and resists, by the laws of :class:`~cfddem.particles.interactions.bridge_loops.BridgeLaws`.
Impulses are applied one bridge after the other, so bridges are for a run in one process.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError
from cfddem.data.fields import Field
from cfddem.particles.interactions.bridge_loops import BridgeLaws, Joined, kick, new_contacts, solid_gaps, survey
from cfddem.particles.pair_graph import Graph
from cfddem.particles.state import Particles
from closures.capillary import liquid_share

LIQUID = Field("liquid", "m3", snapshot=True, meaning="volume of the liquid film on the particle, without bridges")

_NONE = Joined(*(np.zeros(0, np.int64) for _ in range(2)), *(np.zeros(0) for _ in range(3)))


class Bridges:
    """All bridges of a run, an argument of :class:`cfddem.particles.solver.ParticleSolver`.

    particles  the particles; they get the field `liquid`
    film       thickness of the liquid on each at the start (N,), or one for all [m]
    laws       laws of the bridges
    """

    communicator: Communicator = SERIAL

    def __init__(self, particles: Particles, film: np.ndarray | float, laws: BridgeLaws) -> None:
        laws.check()
        thickness = np.broadcast_to(np.asarray(film, float), (particles.count,))
        refused = np.flatnonzero(~((thickness >= 0.0) & np.isfinite(thickness)))
        if len(refused):
            row = int(refused[0])
            raise InputError(f"film of particle {particles.id[row]}", float(thickness[row]), "at least 0 and finite")
        self.laws, self.joined = laws, _NONE
        self.formed, self.broken = 0, 0
        self._row = np.zeros(0, np.int64)
        self.take(particles)
        particles.declare(LIQUID)
        particles.liquid = (
            4.0 / 3.0 * np.pi * thickness * (thickness**2 + 3.0 * particles.radius * (thickness + particles.radius))
        )

    # ------------------------------------------------------------ state

    @property
    def count(self) -> int:
        """Number of bridges."""
        return len(self.joined.first)

    @property
    def film(self) -> np.ndarray:
        """Thickness of the film of each sphere, without the liquid in bridges (N,) [m]."""
        return _thickness(self._particles.liquid, self._particles.radius)

    @property
    def liquid(self) -> float:
        """All liquid of the run, in films and bridges [m3]."""
        return self.communicator.sum(self._particles.liquid) + self.communicator.sum(self.joined.volume)  # type: ignore[no-any-return]

    @property
    def agglomerates(self) -> np.ndarray:
        """Number of the agglomerate that each sphere belongs to: spheres joined by bridges (N,), by row."""
        count = self._particles.count
        ends = self._row[self.joined.first], self._row[self.joined.second]
        joined = coo_matrix((np.ones(self.count), ends), shape=(count, count))
        return connected_components(joined, directed=False)[1]  # type: ignore[no-any-return]

    @property
    def reach_ratio(self) -> float:
        """Largest gap at which two films can touch, over R* [-]; the range of neighbour lists."""
        returned = self._particles.liquid.copy()
        for end in (self.joined.first, self.joined.second):
            np.add.at(returned, self._row[end], 0.5 * self.joined.volume)
        radius = self._particles.radius
        return 4.0 * self.communicator.largest(_thickness(returned, radius)) / self.communicator.smallest(radius)  # type: ignore[no-any-return]

    def gaps(self, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gap of every bridge, and how far it can still be stretched (n,), (n,) [m]."""
        gap, room = np.empty(self.count), np.empty(self.count)
        survey(self.joined, self._row, self._particles.view, box, self.laws, gap, room)
        return gap, room

    # ------------------------------------------------------------ in a run

    def kick(self, box: np.ndarray, span: float, backwards: bool) -> None:
        """Give every sphere the impulses of its bridges over a time [s], in the order of bridges or in reverse."""
        kick(self.joined, self._row, self._particles.view, box, self.laws, span, backwards)

    def update(self, edges: Graph, box: np.ndarray) -> None:
        """Break bridges that are stretched too far, and join spheres whose films overlap."""
        self._break(self.gaps(box)[1] < 0.0)
        self._form(edges, box)

    def take(self, particles: Particles) -> None:
        """Continue with these particles, the same ones in another order or others."""
        self._particles = particles
        self._row = np.full(max(self.communicator.largest(particles.id, default=-1) + 1, len(self._row)), -1, np.int64)
        self._row[particles.id] = np.arange(particles.count)

    def release(self, gone: np.ndarray) -> None:
        """Break the bridges of particles that will be removed; each keeps its half of the liquid.

        gone  rows of the particles (N,) bool
        """
        self._break(gone[self._row[self.joined.first]] | gone[self._row[self.joined.second]])

    def checkpoint(self) -> dict[str, Any]:
        """Everything that the next step depends on, besides the particles."""
        kept = {name: each.copy() for name, each in self.joined._asdict().items()}
        return {"joined": kept, "formed": self.formed, "broken": self.broken}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.joined = Joined(**{name: np.array(each) for name, each in state["joined"].items()})
        self.formed, self.broken = int(state["formed"]), int(state["broken"])

    def _break(self, broken: np.ndarray) -> None:
        """Break bridges (n,) bool; half of the liquid of each goes to each sphere."""
        count = int(np.count_nonzero(broken))  # local: bridges are for one process
        if not count:
            return
        for end in (self.joined.first, self.joined.second):
            np.add.at(self._particles.liquid, self._row[end[broken]], 0.5 * self.joined.volume[broken])
        self.joined = Joined(*(each[~broken] for each in self.joined))
        self.broken += count

    def _form(self, edges: Graph, box: np.ndarray) -> None:
        """Join spheres whose films overlap."""
        most, particles = len(self._row), self._particles.view
        keys = self.joined.first * most + self.joined.second
        found, film = np.empty(64, np.int64), self.film
        while (number := new_contacts(edges, particles, box, film, keys, most, found)) > len(found):
            found = np.empty(number, np.int64)
        if number == 0:
            return
        fresh = np.unique(found[:number])
        first, second = fresh // most, fresh % most
        rows = self._row[first], self._row[second]
        volume = np.array([self._draw(int(i), int(j)) for i, j in zip(first, second)])
        new = Joined(first, second, volume, film[rows[0]] + film[rows[1]], np.zeros(len(fresh)))
        solid_gaps(new, self._row, particles, box, self.laws)
        order = np.argsort(np.concatenate([keys, fresh]))
        self.joined = Joined(*(np.concatenate(pair)[order] for pair in zip(self.joined, new)))
        self.formed += len(fresh)

    def _draw(self, i: int, j: int) -> float:
        """Take the liquid of a new bridge from the films of its two spheres, by id; returns its volume [m3]."""
        drawn = 0.0
        for one, other in ((i, j), (j, i)):
            radii = (float(self._particles.radius[self._row[each]]) for each in (one, other))
            share = self._particles.liquid[self._row[one]] * liquid_share(*radii)
            self._particles.liquid[self._row[one]] -= share
            drawn += share
        return drawn


def _thickness(volume: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Thickness of a layer of liquid all over a sphere (N,) [m]."""
    swell = 3.0 * volume / (4.0 * np.pi * radius**3)
    thickness: np.ndarray = radius * np.expm1(np.log1p(swell) / 3.0)
    return thickness
