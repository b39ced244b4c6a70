"""Two wet spheres collide obliquely."""

from scenarios.collisions.wet_pair.study import TRANSITION_PRESSURES, WetPair, collide_wet

__all__ = ["TRANSITION_PRESSURES", "WetPair", "collide_wet"]
