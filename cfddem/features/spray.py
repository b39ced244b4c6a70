"""The spray of a case: it brings liquid to the particles in its zone, and notes their visits there.

A visit lasts from a particle's entry to its exit, a round from one entry to the next. Particles are looked at after
every call; shorter visits are not seen. A particle that is in the zone at the first call counts from its next entry.

Each drop draws a number for every particle in the zone, exponentially distributed with the projected area as its rate,
and lands on the particle with the smallest one. That particle is any of them with a probability proportional to its
area. The numbers follow from the seed, the id of the particle and the number of the drop, so that the result does not
depend on the order of particles, on threads or on ranks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.compile import serial
from cfddem.backend.counter_random import philox
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.heat import HeatExchange
from cfddem.features.heat_keys import Heat
from cfddem.features.liquid import LiquidOnParticles
from cfddem.model.fields import Field
from cfddem.particles.state import Particles

INSIDE = Field("zone_inside", dtype=bool, initial=True, meaning="the particle is in the spray zone")
ENTERED = Field("zone_entered", "s", initial=math.nan, meaning="time of the last entry into the spray zone; NaN before")
VISITS = Field("zone_visits", dtype=np.int64, meaning="visits to the spray zone that have ended")
VISIT_TIME = Field("zone_visit_time", "s", meaning="sum of the times of these visits")
ROUNDS = Field("zone_rounds", dtype=np.int64, meaning="rounds from one entry into the spray zone to the next")
ROUND_TIME = Field("zone_round_time", "s", meaning="sum of the times of these rounds")
FIELDS = (INSIDE, ENTERED, VISITS, VISIT_TIME, ROUNDS, ROUND_TIME)
"""What particles remember of the zone. They begin inside, so that a visit without a known beginning does not count."""


class SprayZone(CaseFeature):
    """The spray of a case and its zone."""

    name, table = "spray", "spray"
    fields = FIELDS
    measures = (
        Measured("liquid_sprayed", "m3", "recorded",
                 "volume of liquid that the spray has brought to particles so far", lambda zone, _: zone.spray.volume),
        Measured("liquid_missed", "m3", "recorded",
                 "volume of liquid sprayed so far that found no particle",
                 lambda zone, _: zone.spray.missed * zone.spray.drop_volume),
        Measured("spray_zone_share", "1", "measure", "share of the particles in the spray zone",
                 lambda zone, simulation: zone.share(simulation)),
        Measured("spray_residence_time", "s", "recorded", "mean time so far of a visit to the spray zone",
                 lambda _, simulation: mean_visit(simulation.owned, simulation.communicator)),
        Measured("spray_circulation_time", "s", "recorded",
                 "mean time so far from one entry of a particle into the spray zone to its next",
                 lambda _, simulation: mean_round(simulation.owned, simulation.communicator)),
    )  # fmt: skip

    def __init__(self, case: Case, simulation: Any) -> None:
        keys = case.spray
        assert keys is not None
        first, second = keys.extremes
        if keys.zone == "cone":
            zone = cone(first, keys.axis, math.radians(keys.angle), keys.length or 0.0)
        else:
            zone = box(first, second - first)
        end = math.inf if keys.end is None else keys.end
        heat = Heat.of(case)
        self.warms = bool(heat and heat.spray_temperature)
        self.spray = Spray(
            keys.rate, keys.drop_volume, zone, case.bed.seed, keys.begin, end, communicator=simulation.communicator
        )

    def after(self, simulation: Any) -> None:
        """Release the drops that are due, and note which particles are in the zone."""
        owned = simulation.owned
        reached = self.spray(owned, simulation.time)
        if self.warms:
            volume = self.spray.drop_volume * np.bincount(reached, minlength=owned.count)
            simulation.feature(HeatExchange).mix_in(owned, volume)
        simulation.feature(LiquidOnParticles).brought = self.spray.volume
        note_visits(owned, self.spray.zone(owned.position), simulation.time)

    def share(self, simulation: Any) -> float:
        """Share of the particles in the zone [-]."""
        owned, total = simulation.owned, simulation.communicator.sum
        return float(total(self.spray.zone(owned.position)) / max(total([owned.count]), 1))

    def checkpoint(self) -> dict[str, Any]:
        """The drops so far."""
        return self.spray.checkpoint()

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.spray.restore(state)


# ---------------------------------------------------------------- visits to the zone


def note_visits(particles: Particles, inside: np.ndarray, time: float) -> None:
    """Note which particles have entered or left the zone.

    particles  with `FIELDS`
    inside     whether each is in the zone now (N,) bool
    time       now [s]
    """
    entered = particles.zone_entered
    was_inside = np.isfinite(entered)
    leaves = particles.zone_inside & ~inside & was_inside
    particles.zone_visits += leaves
    particles.zone_visit_time += np.where(leaves, time - entered, 0.0)
    enters = inside & ~particles.zone_inside
    returns = enters & was_inside
    particles.zone_rounds += returns
    particles.zone_round_time += np.where(returns, time - entered, 0.0)
    particles.zone_entered = np.where(enters, time, entered)
    particles.zone_inside = inside


def mean_visit(particles: Particles, communicator: Communicator) -> float:
    """Mean time of a visit so far [s]; NaN before the first has ended."""
    return _mean(particles.zone_visit_time, particles.zone_visits, communicator)


def mean_round(particles: Particles, communicator: Communicator) -> float:
    """Mean time from one entry to the next so far [s]; NaN before the first round."""
    return _mean(particles.zone_round_time, particles.zone_rounds, communicator)


def _mean(time: np.ndarray, number: np.ndarray, communicator: Communicator) -> float:
    count = communicator.sum(number)
    return float(communicator.sum(time) / count) if count > 0 else math.nan


# ---------------------------------------------------------------- drops


PURPOSE = 0x5B4A7
"""Use of random numbers, see :mod:`cfddem.backend.counter_random`."""

Zone = Callable[[np.ndarray], np.ndarray]
"""Which of the positions (N, 3) [m] lie in the zone (N,) bool."""


def cone(tip: np.ndarray, axis: np.ndarray, angle: float, length: float) -> Zone:
    """Zone inside a cone.

    tip     (3,) [m]
    axis    unit vector away from the tip (3,)
    angle   full opening angle [rad]
    length  along the axis [m]

    >>> below = cone(np.zeros(3), np.array([0.0, 0.0, -1.0]), math.pi / 2.0, 1.0)
    >>> below(np.array([[0.4, 0.0, -0.5], [0.6, 0.0, -0.5], [0.0, 0.0, -1.1]]))
    array([ True, False, False])
    """
    slope = math.tan(0.5 * angle)

    def inside(position: np.ndarray) -> np.ndarray:
        apart = position - tip
        along = apart @ axis
        across = apart - along[:, None] * axis
        return np.asarray((along >= 0.0) & (along <= length) & ((across**2) @ np.ones(3) <= (slope * along) ** 2))

    return inside


def box(corner: np.ndarray, size: np.ndarray) -> Zone:
    """Zone inside a box.

    corner, size  lower corner and edges (3,) [m]
    """

    def inside(position: np.ndarray) -> np.ndarray:
        share = (position - corner) / size
        return np.logical_and.reduce((share >= 0.0) & (share <= 1.0), axis=1)  # local: three coordinates of a row

    return inside


class Spray:
    """Brings liquid to the particles in a zone.

    Call it after every step; it releases the drops that are due. A drop that finds no particle in the zone is counted
    as missed. The particles have the field `liquid`.

    rate         volume of liquid per time [m3/s]
    drop_volume  of each drop [m3]
    zone         where the particles are reached
    seed         of the random choices
    begin, end   times between which it sprays [s]
    communicator  path to the smallest numbers over all ranks
    """

    def __init__(
        self,
        rate: float,
        drop_volume: float,
        zone: Zone,
        seed: int,
        begin: float = 0.0,
        end: float = math.inf,
        *,
        communicator: Communicator = SERIAL,
    ) -> None:
        if not 0.0 <= rate < math.inf:
            raise InputError("rate", rate, "at least 0")
        if not 0.0 < drop_volume < math.inf:
            raise InputError("drop_volume", drop_volume, "above 0")
        self.rate, self.drop_volume, self.zone, self.seed = rate, drop_volume, zone, seed
        self.begin, self.end, self.communicator = begin, end, communicator
        self.landed, self.missed = 0, 0

    @property
    def released(self) -> int:
        """Number of drops so far."""
        return self.landed + self.missed

    @property
    def volume(self) -> float:
        """Volume that has landed on particles [m3]."""
        return self.landed * self.drop_volume

    def __call__(self, particles: Particles, time: float) -> np.ndarray:
        """Release the drops that are due.

        particles  those of this rank, without ghosts
        time       now [s]
        returns    row of the particle on which each drop landed on this rank (drops,)
        """
        sprayed = self.rate * max(min(time, self.end) - self.begin, 0.0)
        due = int(sprayed / self.drop_volume * (1.0 + 1e-12)) - self.released
        if due <= 0:
            return np.zeros(0, np.int64)
        rows = np.flatnonzero(self.zone(particles.position))
        smallest, winner = np.full(due, math.inf), np.full(due, -1)
        draw(self.seed, self.released, particles.id[rows], particles.radius[rows], smallest, winner)
        first = np.asarray(self.communicator.smallest(smallest[None, :], axis=0))
        landed = np.isfinite(first)
        mine = landed & (smallest == first)
        reached = rows[winner[mine]]
        np.add.at(particles.liquid, reached, self.drop_volume)
        hits = int(np.count_nonzero(landed))  # local: the same on all ranks
        self.landed += hits
        self.missed += due - hits
        return reached

    def checkpoint(self) -> dict[str, Any]:
        """Drops so far."""
        return {"landed": self.landed, "missed": self.missed}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()` of the same spray."""
        self.landed, self.missed = int(state["landed"]), int(state["missed"])


@serial
def draw(seed, released, ids, radius, smallest, winner):
    """For each drop, the smallest of the particles' numbers and the particle that drew it.

    released  number of drops before these
    ids       of the particles in the zone (n,)
    radius    of them (n,) [m]
    smallest  of the numbers (drops,), written; unchanged without particles
    winner    place among the n particles (drops,), written
    """
    for drop in range(len(smallest)):
        number = np.uint64(released + drop)
        for n in range(len(ids)):
            name = np.uint64(ids[n])
            low, bits = np.uint64(0xFFFFFFFF), np.uint64(32)
            counter = (name & low, name >> bits, number & low, number >> bits)
            a, b, _, _ = philox(counter, (np.uint64(seed) & low, np.uint64(PURPOSE)))
            # 53 random bits, above 0 and below 1
            uniform = (np.float64(a >> np.uint64(5)) * 67108864.0 + np.float64(b >> np.uint64(6)) + 0.5) / 2.0**53
            value = -math.log(uniform) / (radius[n] * radius[n])
            if value < smallest[drop]:
                smallest[drop], winner[drop] = value, n
