"""All golden runs: the modules that declare them."""

from golden import beds, inserted_and_removed, many_particles, two_particles, walls
from golden.registry import RUNS

__all__ = ["RUNS", "beds", "inserted_and_removed", "many_particles", "two_particles", "walls"]
