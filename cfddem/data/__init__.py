"""Declared fields of particles, pairs and cells, and what is done to all of them alike."""
