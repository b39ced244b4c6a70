"""Collisions of a few spheres, wet or immersed in a fluid: one folder a case, each with a page."""
