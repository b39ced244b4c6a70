"""The spray of a case: it brings liquid to the particles in its zone, and notes their visits there."""

from __future__ import annotations

import math
from typing import Any

from cfddem.case.schema import Case
from cfddem.features import zone_times
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.drops import Spray, box, cone
from cfddem.features.liquid import LiquidOnParticles


class SprayZone(CaseFeature):
    """The spray of a case and its zone."""

    name = "spray"
    fields = zone_times.FIELDS

    def __init__(self, case: Case, simulation: Any) -> None:
        given = case.spray
        assert given is not None
        first, second = given.extremes
        if given.zone == "cone":
            zone = cone(first, given.axis, math.radians(given.angle), given.length or 0.0)
        else:
            zone = box(first, second - first)
        end = math.inf if given.end is None else given.end
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
        self.spray(owned, simulation.time)
        simulation.feature(LiquidOnParticles).brought = self.spray.volume
        zone_times.note_visits(owned, self.spray.zone(owned.position), simulation.time)

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
    return zone_times.mean_visit(simulation.owned, simulation.communicator)


def spray_circulation_time(simulation: Any) -> float:
    """Mean time so far from one entry of a particle into the spray zone to its next."""
    return zone_times.mean_round(simulation.owned, simulation.communicator)
