"""Two spheres, or a sphere and a wall, collide in a fluid."""

from scenarios.collisions.immersed_pair.study import MATERIALS, Collision, collide

__all__ = ["MATERIALS", "Collision", "collide"]
