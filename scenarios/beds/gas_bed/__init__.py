"""Bubbling gas beds, and the standard gas bed of the benchmark."""

from scenarios.beds.gas_bed.study import bench, mueller, standard_bed, van_wachem

__all__ = ["bench", "mueller", "standard_bed", "van_wachem"]
