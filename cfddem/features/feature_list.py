"""What a case can have beside particles, fluid and their coupling, each in one object.

A feature of a case acts around every step, gives columns to the history and keeps its state in checkpoints. The
simulation goes over `FEATURES` and names none of them.
"""

from __future__ import annotations

from cfddem.features.case_feature import CaseFeature
from cfddem.features.contact_heat import HeatExchangeOfContacts
from cfddem.features.energy import EnergyLedger
from cfddem.features.evaporation import EvaporationOfLiquid
from cfddem.features.feeds import Feeds
from cfddem.features.heat import HeatExchange
from cfddem.features.liquid import LiquidOnParticles
from cfddem.features.moving_walls import MovingWalls
from cfddem.features.spray import SprayZone
from cfddem.features.vapour import Vapour

FEATURES: tuple[type[CaseFeature], ...] = (
    MovingWalls,
    LiquidOnParticles,
    SprayZone,
    EnergyLedger,
    Feeds,
    HeatExchange,
    HeatExchangeOfContacts,
    EvaporationOfLiquid,
    Vapour,
)
"""In the order in which they act, before the particles move and after."""
