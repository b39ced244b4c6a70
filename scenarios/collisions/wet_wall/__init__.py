"""A sphere strikes a wall under a thin liquid layer."""

from scenarios.collisions.wet_wall.study import Ball, Impact, Liquid, impact, sticking_velocity

__all__ = ["Ball", "Impact", "Liquid", "impact", "sticking_velocity"]
