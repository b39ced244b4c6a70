"""What a user's law may be: its kinds and arguments, and names that have another meaning in a case."""

from __future__ import annotations

DRAG_ARGUMENTS = ("reynolds", "voidage", "diameter_ratio")
"""Arguments that a drag law may take, by name: Reynolds number of the superficial slip, voidage, diameter over the
Sauter mean of the particles around; it must take the first two."""

GAP_ARGUMENTS = ("roughness", "approach_speed", "viscosity", "reduced_modulus", "reduced_radius")
"""Arguments that a law of the minimum gap may take, by name: [m], [m/s], [Pa s], [Pa], [m]."""

FILM_ARGUMENTS = ("gap", "viscosity", "reduced_radius", "minimum_gap", "cutoff_gap")
"""Arguments that a film law may take, by name: [m], [Pa s], [m], [m], [m]; it must take the first three."""

AGITATION_ARGUMENTS = ("solid_fraction", "reynolds", "along", "density_ratio")
"""Arguments that a law of agitation may take, by name: of the mean slip, in the direction with this squared cosine."""

HEAT_ARGUMENTS = ("reynolds", "prandtl", "voidage")
"""Arguments that a law of heat transfer may take, by name: Reynolds number of the superficial slip; Prandtl number, or
the Schmidt number where the law is used for mass; voidage. It must take the first two."""

DRYING_ARGUMENTS = ("volume", "area", "full_thickness", "diameter", "sherwood")
"""Arguments that a law of drying may take, by name: volume of the liquid on a particle [m3], its area [m2], thickness
of a film that covers all [m], diameter [m], and Sherwood number [-]; it must take the first."""

BUILT_IN: dict[str, tuple[str, ...]] = {
    "drag": ("none",),
    "minimum_gap": ("elastohydrodynamic",),
    "lubrication": ("auto", "nijssen", "nijssen_full", "nijssen_full_twist", "none"),
    "added_mass": (),
    "agitation": ("auto", "none", "lattanzi"),
    "heat_transfer": (),
    "drying": (),
}
"""Names that a case may use besides those of registered laws: no law, or the built-in one."""

ARGUMENTS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "drag": (DRAG_ARGUMENTS, DRAG_ARGUMENTS[:2]),
    "minimum_gap": (GAP_ARGUMENTS, ()),
    "lubrication": (FILM_ARGUMENTS, FILM_ARGUMENTS[:3]),
    "added_mass": (("voidage",), ("voidage",)),
    "agitation": (AGITATION_ARGUMENTS, AGITATION_ARGUMENTS[:1]),
    "heat_transfer": (HEAT_ARGUMENTS, HEAT_ARGUMENTS[:2]),
    "drying": (DRYING_ARGUMENTS, DRYING_ARGUMENTS[:1]),
}
"""Arguments that a law of a kind may take, and those that it must take."""


def arguments_of(kind: str) -> str:
    """The arguments of a kind of law in words.

    >>> arguments_of("added_mass")
    'it may take voidage, and must take voidage'
    """
    may, must = ARGUMENTS[kind]
    return f"it may take {', '.join(may)}" + (f", and must take {', '.join(must)}" if must else "")
