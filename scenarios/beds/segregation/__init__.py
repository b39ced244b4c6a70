"""Two species in a liquid-fluidised bed."""

from scenarios.beds.segregation.study import balance, mixture, separation, thresholds

__all__ = ["balance", "mixture", "separation", "thresholds"]
