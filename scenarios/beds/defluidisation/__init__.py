"""A bed in air is fluidised and defluidised on a velocity ramp."""

from scenarios.beds.defluidisation.study import Layers, Onset, layers, onsets

__all__ = ["Layers", "Onset", "layers", "onsets"]
