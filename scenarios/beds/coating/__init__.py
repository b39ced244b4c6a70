"""Spray on a small spouted bed: how evenly the particles are coated."""

from scenarios.beds.coating.study import Coating, bed, coating, distribution

__all__ = ["Coating", "bed", "coating", "distribution"]
