"""Fluid alone: flows with a known solution."""
