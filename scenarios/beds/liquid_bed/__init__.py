"""A bed of beads fluidised by water."""

from scenarios.beds.liquid_bed.study import STUDIES, Study, alginate, alumina, fluidise, glass

__all__ = ["STUDIES", "Study", "alginate", "alumina", "fluidise", "glass"]
