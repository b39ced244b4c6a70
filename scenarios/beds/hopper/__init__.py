"""A hopper with a gate, a feed and an outlet."""

from scenarios.beds.hopper.study import Discharge, beverloo, discharge

__all__ = ["Discharge", "beverloo", "discharge"]
