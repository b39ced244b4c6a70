"""A slice of a spouted bed."""

from scenarios.beds.spouted_bed.study import HEIGHTS, Profile, bed, profiles

__all__ = ["HEIGHTS", "Profile", "bed", "profiles"]
