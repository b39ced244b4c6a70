"""Wet collisions of a few spheres."""
