"""Particle engine: one sphere, granular beds, dense suspensions."""
