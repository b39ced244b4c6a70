"""The spray of a case: it brings liquid to the particles in its zone, and notes their visits there.

A visit lasts from a particle's entry to its exit, a round from one entry to the next. Particles are looked at after
every call; shorter visits are not seen. A particle that is in the zone at the first call counts from its next entry.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.case.schema import Case
from cfddem.data.fields import Field
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.drops import Spray, box, cone
from cfddem.features.heat import HeatExchange
from cfddem.features.heat_keys import Heat
from cfddem.features.liquid import LiquidOnParticles
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

    name = "spray"
    fields = FIELDS

    def __init__(self, case: Case, simulation: Any) -> None:
        given = case.spray
        assert given is not None
        first, second = given.extremes
        if given.zone == "cone":
            zone = cone(first, given.axis, math.radians(given.angle), given.length or 0.0)
        else:
            zone = box(first, second - first)
        end = math.inf if given.end is None else given.end
        heat = Heat.of(case)
        self.warms = bool(heat and heat.spray_temperature)
        self.spray = Spray(
            given.rate, given.drop_volume, zone, case.bed.seed, given.begin, end, communicator=simulation.communicator
        )

    @classmethod
    def is_in(cls, case: Case) -> bool:
        """Whether the case has a spray."""
        return case.spray is not None

    @classmethod
    def measures(cls, case: Case) -> tuple[Measured, ...]:
        """What the spray brings, and how particles pass through its zone."""
        return (
            Measured("m3", "recorded", liquid_sprayed),
            Measured("m3", "recorded", liquid_missed),
            Measured("1", "measure", spray_zone_share),
            Measured("s", "recorded", spray_residence_time),
            Measured("s", "recorded", spray_circulation_time),
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

    def checkpoint(self) -> dict[str, Any]:
        """The drops so far."""
        return self.spray.checkpoint()

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.spray.restore(state)


def liquid_sprayed(simulation: Any) -> float:
    """Volume of liquid that the spray has brought to particles so far."""
    return float(simulation.feature(SprayZone).spray.volume)


def liquid_missed(simulation: Any) -> float:
    """Volume of liquid sprayed so far that found no particle."""
    spray = simulation.feature(SprayZone).spray
    return float(spray.missed * spray.drop_volume)


def spray_zone_share(simulation: Any) -> float:
    """Share of the particles in the spray zone."""
    owned, total = simulation.owned, simulation.communicator.sum
    return float(total(simulation.feature(SprayZone).spray.zone(owned.position)) / max(total([owned.count]), 1))


def spray_residence_time(simulation: Any) -> float:
    """Mean time so far of a visit to the spray zone."""
    return mean_visit(simulation.owned, simulation.communicator)


def spray_circulation_time(simulation: Any) -> float:
    """Mean time so far from one entry of a particle into the spray zone to its next."""
    return mean_round(simulation.owned, simulation.communicator)


# ---------------------------------------------------------------- visits to the zone


def note_visits(particles: Particles, inside: np.ndarray, time: float) -> None:
    """Note which particles have entered or left the zone.

    particles  with `FIELDS`
    inside     whether each is in the zone now (N,) bool
    time       now [s]
    """
    entered = particles.zone_entered
    known = np.isfinite(entered)
    leaves = particles.zone_inside & ~inside & known
    particles.zone_visits += leaves
    particles.zone_visit_time += np.where(leaves, time - entered, 0.0)
    enters = inside & ~particles.zone_inside
    returns = enters & known
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
