"""A Wurster coater: a bed that circulates through a draft tube."""

from scenarios.beds.wurster.study import Circulation, circulation

__all__ = ["Circulation", "circulation"]
