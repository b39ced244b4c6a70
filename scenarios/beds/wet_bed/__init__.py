"""A bubbling gas bed, dry and with liquid bridges."""

from scenarios.beds.wet_bed.study import LIQUIDS, Effects, bed, effects

__all__ = ["LIQUIDS", "Effects", "bed", "effects"]
