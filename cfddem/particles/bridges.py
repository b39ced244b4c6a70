"""Liquid bridges between the particles of a run.

Every sphere carries liquid. Where the films of two spheres overlap a bridge forms, from what each has in the
other's shadow; where it is stretched too far it breaks, and half of its liquid goes to each. In between it pulls
and resists, by the laws that :class:`~cfddem.particles.bridge_loops.BridgeLaws` chooses.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from cfddem.errors import InputError
from cfddem.particles.bridge_loops import BridgeLaws, Joined, kick, meetings, solid_gaps, survey
from cfddem.particles.pairs import Edges
from cfddem.particles.state import Bodies
from cfddem.particles.vectors import flat
from closures.capillary import liquid_share

_NONE = Joined(*(np.zeros(0, np.int64) for _ in range(2)), *(np.zeros(0) for _ in range(3)))


class Bridges:
    """All bridges of a run; handed to :class:`cfddem.particles.solver.ParticleSolver`, which moves by them.

    bodies  the particles
    film    thickness of the liquid on each at the start (N,), or one for all [m]
    laws    which laws hold for bridges
    """

    def __init__(self, bodies: Bodies, film: np.ndarray | float, laws: BridgeLaws) -> None:
        laws.check()
        thickness = np.broadcast_to(np.asarray(film, float), (bodies.count,))
        if not ((thickness >= 0.0) & np.isfinite(thickness)).all():
            row = int(np.argmin((thickness >= 0.0) & np.isfinite(thickness)))
            raise InputError(f"film of particle {bodies.id[row]}", float(thickness[row]), "at least 0 and finite")
        self.laws, self.joined = laws, _NONE
        self.formed, self.broken = 0, 0
        self._row = np.zeros(0, np.int64)
        self._take(bodies)
        self.free_liquid = np.zeros(len(self._row))  # by id, in no bridge [m3]
        self.free_liquid[bodies.id] = (
            4.0 / 3.0 * np.pi * thickness * (thickness**2 + 3.0 * bodies.radius * (thickness + bodies.radius))
        )

    # ------------------------------------------------------------ what can be asked

    @property
    def count(self) -> int:
        """Number of bridges."""
        return len(self.joined.first)

    @property
    def film(self) -> np.ndarray:
        """Thickness of the film of each sphere, of the liquid that is in no bridge (N,), by row [m]."""
        return _thickness(self.free_liquid[self._bodies.id], self._bodies.radius)

    @property
    def liquid(self) -> float:
        """All the liquid, in films and bridges, on spheres that have been taken out too [m3]."""
        return float(self.free_liquid.sum() + self.joined.volume.sum())

    @property
    def agglomerates(self) -> np.ndarray:
        """Number of the agglomerate that each sphere belongs to: spheres joined by bridges (N,), by row."""
        count = self._bodies.count
        ends = self._row[self.joined.first], self._row[self.joined.second]
        joined = coo_matrix((np.ones(self.count), ends), shape=(count, count))
        return connected_components(joined, directed=False)[1]  # type: ignore[no-any-return]

    @property
    def reach_ratio(self) -> float:
        """Bound of the gap at which two films can meet, over R* [-]; neighbour lists must reach so far."""
        returned = self.free_liquid.copy()
        for end in (self.joined.first, self.joined.second):
            np.add.at(returned, end, 0.5 * self.joined.volume)
        radius = self._bodies.radius
        thickest = float(_thickness(returned[self._bodies.id], radius).max())
        return 4.0 * thickest / float(radius.min())

    def gaps(self, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gap of every bridge, and how far it can still be stretched (n,), (n,) [m]."""
        gap, room = np.empty(self.count), np.empty(self.count)
        survey(self.joined, self._row, flat(self._bodies), box, self.laws, gap, room)
        return gap, room

    # ------------------------------------------------------------ in a run

    def kick(self, box: np.ndarray, span: float, backwards: bool) -> None:
        """Give every sphere the impulses of its bridges over a time [s], in the order of bridges or back."""
        kick(self.joined, self._row, flat(self._bodies), box, self.laws, span, backwards)

    def update(self, edges: Edges, box: np.ndarray) -> None:
        """Break what is stretched too far, and join spheres whose films overlap."""
        self._keep(self.gaps(box)[1] >= 0.0)
        self._form(edges, box)

    def take(self, bodies: Bodies) -> None:
        """Go on with these bodies, perhaps others or in another order; bridges of what is gone break."""
        known = len(self.free_liquid)
        self._take(bodies)
        if len(self._row) > known:
            self.free_liquid = np.append(self.free_liquid, np.zeros(len(self._row) - known))
        self._keep((self._row[self.joined.first] >= 0) & (self._row[self.joined.second] >= 0))

    def checkpoint(self) -> dict[str, Any]:
        """Copies of everything the next step depends on."""
        kept = {name: each.copy() for name, each in self.joined._asdict().items()}
        return {"joined": kept, "free_liquid": self.free_liquid.copy(), "formed": self.formed, "broken": self.broken}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a `checkpoint()`."""
        self.joined = Joined(**{name: np.array(each) for name, each in state["joined"].items()})
        self.free_liquid = np.array(state["free_liquid"])
        self.formed, self.broken = int(state["formed"]), int(state["broken"])

    def _take(self, bodies: Bodies) -> None:
        """Note where each particle stands."""
        self._bodies = bodies
        self._row = np.full(max(int(bodies.id.max(initial=-1)) + 1, len(self._row)), -1, np.int64)
        self._row[bodies.id] = np.arange(bodies.count)

    def _keep(self, kept: np.ndarray) -> None:
        """Break all other bridges; half of the liquid of each goes to each sphere."""
        if kept.all():
            return
        for end in (self.joined.first, self.joined.second):
            np.add.at(self.free_liquid, end[~kept], 0.5 * self.joined.volume[~kept])
        self.joined = Joined(*(each[kept] for each in self.joined))
        self.broken += int((~kept).sum())

    def _form(self, edges: Edges, box: np.ndarray) -> None:
        """Join spheres whose films overlap."""
        most, bodies = len(self._row), flat(self._bodies)
        keys = self.joined.first * most + self.joined.second
        found, film = np.empty(64, np.int64), self.film
        while (number := meetings(edges, bodies, box, film, keys, most, found)) > len(found):
            found = np.empty(number, np.int64)
        if number == 0:
            return
        fresh = np.unique(found[:number])
        first, second = fresh // most, fresh % most
        rows = self._row[first], self._row[second]
        volume = np.array([self._draw(int(i), int(j)) for i, j in zip(first, second)])
        new = Joined(first, second, volume, film[rows[0]] + film[rows[1]], np.zeros(len(fresh)))
        solid_gaps(new, self._row, bodies, box, self.laws)
        order = np.argsort(np.concatenate([keys, fresh]))
        self.joined = Joined(*(np.concatenate(pair)[order] for pair in zip(self.joined, new)))
        self.formed += len(fresh)

    def _draw(self, i: int, j: int) -> float:
        """Liquid that two spheres give to a bridge; it leaves their films."""
        drawn = 0.0
        for one, other in ((i, j), (j, i)):
            radii = (float(self._bodies.radius[self._row[each]]) for each in (one, other))
            share = self.free_liquid[one] * liquid_share(*radii)
            self.free_liquid[one] -= share
            drawn += share
        return drawn


def _thickness(volume: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Thickness of a layer of liquid all over a sphere (N,) [m]."""
    swell = 3.0 * volume / (4.0 * np.pi * radius**3)
    thickness: np.ndarray = radius * np.expm1(np.log1p(swell) / 3.0)
    return thickness
