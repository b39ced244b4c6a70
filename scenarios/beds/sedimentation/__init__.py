"""Hindered settling of spheres in a liquid."""

from scenarios.beds.sedimentation.study import NARROW, between_walls, exponent, in_periodic_box

__all__ = ["NARROW", "between_walls", "exponent", "in_periodic_box"]
