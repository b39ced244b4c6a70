"""Fluidised, packed and settling beds."""
