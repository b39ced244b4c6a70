"""A Wurster coater: a bed that circulates through a draft tube and a spray."""

from scenarios.beds.wurster.study import Circulation, Coating, circulation, coating

__all__ = ["Circulation", "Coating", "circulation", "coating"]
