"""The effect of lubrication films on a liquid bed."""

from scenarios.beds.lubrication_study.study import Outcome, Setting, bed, mean, outcomes

__all__ = ["Outcome", "Setting", "bed", "mean", "outcomes"]
