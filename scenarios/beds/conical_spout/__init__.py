"""A conical spouted bed."""

from scenarios.beds.conical_spout.study import Spouting, olazar, spouting

__all__ = ["Spouting", "olazar", "spouting"]
