"""Wet spheres in a stirred periodic box form agglomerates."""

from scenarios.collisions.wet_tumbler.study import Tumbling, tumble

__all__ = ["Tumbling", "tumble"]
