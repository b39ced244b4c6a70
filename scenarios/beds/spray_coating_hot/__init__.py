"""Spray on a small spouted bed in hot air and in cold air: whether it dries as fast as it is wetted."""

from scenarios.beds.spray_coating_hot.study import COLD, Coated, case, coated, moisture

__all__ = ["COLD", "Coated", "case", "coated", "moisture"]
