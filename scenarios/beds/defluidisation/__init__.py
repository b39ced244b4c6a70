"""A bed in air is fluidised and defluidised on a velocity ramp."""

from scenarios.beds.defluidisation.study import Onset, onsets

__all__ = ["Onset", "onsets"]
