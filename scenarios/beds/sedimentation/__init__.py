"""Hindered settling of spheres in a liquid."""

from scenarios.beds.sedimentation.study import between_walls, exponent, in_periodic_box

__all__ = ["between_walls", "exponent", "in_periodic_box"]
