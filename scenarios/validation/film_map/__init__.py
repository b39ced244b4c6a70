"""The map of films: where lubrication films matter in liquid-fluidised beds."""
