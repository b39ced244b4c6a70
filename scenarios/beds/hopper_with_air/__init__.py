"""A hopper with air through its orifice."""

from scenarios.beds.hopper_with_air.study import beverloo, discharge

__all__ = ["beverloo", "discharge"]
