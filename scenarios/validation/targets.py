"""Targets of `cfddem validate`. Importing this module loads none of them."""

from __future__ import annotations

TARGETS: dict[str, str] = {
    "binary-collision": "scenarios.collisions.immersed_pair.validation",
    "particles": "scenarios.validation.particles.study",
    "fluid": "scenarios.validation.fluid.study",
    "coupling": "scenarios.validation.coupling",
    "beds": "scenarios.validation.beds.study",
    "lubrication": "scenarios.beds.lubrication_study.validation",
    "film-impact": "scenarios.collisions.film_impact.validation",
    "wet-tumbler": "scenarios.collisions.wet_tumbler.validation",
    "wet": "scenarios.validation.wet.study",
    "wet-beds": "scenarios.beds.wet_bed.validation",
    "waves": "scenarios.validation.bed_waves.study",
    "agitation": "scenarios.validation.agitation.study",
    "resolved": "scenarios.validation.resolved_suspension.study",
}
"""Name of each target, and the module that holds its `study`."""

ONLY_IF_NAMED = ("resolved", "wet-beds")
"""Targets that take up to a day; `all` leaves them out."""

PIECEMEAL = ("wet-beds",)
"""Targets that make their table of what has been computed, and go on with the rest another time."""
