"""A wet sphere strikes a resting pair of wet spheres."""

from scenarios.collisions.three_spheres.study import Event, Triplet, centres, outcomes, simulate_three_spheres

__all__ = ["Event", "Triplet", "centres", "outcomes", "simulate_three_spheres"]
