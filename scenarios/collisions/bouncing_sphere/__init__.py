"""A steel sphere bounces off a wall in silicone oil."""

from scenarios.collisions.bouncing_sphere.study import bounce

__all__ = ["bounce"]
