"""Hot water heats a bed of fixed glass beads."""

from scenarios.beds.packed_bed_heating.study import Heating, case, heating, schumann

__all__ = ["Heating", "case", "heating", "schumann"]
