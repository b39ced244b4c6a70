"""Equations of motion of three wet spheres, in polar coordinates and in Cartesian ones."""
