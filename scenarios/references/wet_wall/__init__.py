"""Equations of motion of a wet impact on a wall, solved twice."""
