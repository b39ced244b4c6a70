"""A bead falls through a liquid film onto a plate: the flow, its free surface, pressure and suction are computed."""

from scenarios.collisions.film_impact.materials import Liquid
from scenarios.collisions.film_impact.result import FilmImpact
from scenarios.collisions.film_impact.study import impact, sweep

__all__ = ["FilmImpact", "Liquid", "impact", "sweep"]
