"""Flow through a fixed bed of packed spheres."""

from scenarios.beds.packed_bed.study import case, flow_through

__all__ = ["case", "flow_through"]
