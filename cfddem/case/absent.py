"""What a case cannot have, or has by another name: what there is instead, and where limits stand."""

from __future__ import annotations

import re

LIMITS = "the page Limits has more"

ABSENT: dict[str, str] = {
    "turbulen|k_epsilon|k_omega|smagorinsky|rans$|les$": "no turbulence model acts in a case",
    "superquadric|aspherical|nonspherical|non_spherical|polyhedr|clump|shape_factor|sphericity|multisphere":
        "all particles are spheres",
    "electrostatic|magnet|van_der_waals|hamaker": "no such force: add yours in Python (page Add a force), or "
        "take the cohesion of laws.contact",
    "breakage|attrition|fragment": "particles do not break",
    "natural_convection|thermal_expansion|boussinesq": "warm fluid is lighter by heat.buoyancy; no density follows "
        "a gas law",
    "reaction|combustion|arrhenius": "no reactions; [vapour] and [evaporation] are water in air",
    "melting|solidification|condensation": "of phase changes there is the evaporation of water, [evaporation]",
    "compressib|mach$|speed_of_sound": "the fluid is incompressible",
    "bubble|level_set|volume_of_fluid": "there is one fluid; bubbles of a bed are regions of "
        "high voidage",
    "fill_level|fill_height|free_surface|half_filled|liquid_level": "one fluid fills the whole vessel, without a free "
        "surface; for a drum of particles in air leave out [fluid], or give that of the air",
    "rotation_rate|rpm$|angular_velocity": "a wall turns by spin, a vector [rad/s]",
    "stl$|stl_|mesh_file": "a surface is [[wall]] with shape = \"surface\" and file",
    "cooling": "temperatures are [heat] of the fluid and [contact_heat] of contacts and walls",
}  # fmt: skip
"""Patterns of words -> what to say."""

TABLES: dict[str, str] = {
    "heat": "Not there: viscosity that changes with the temperature, density that does beyond heat.buoyancy, "
    "temperatures inside a particle, and reactions. Conduction at contacts and radiation are contact_heat, drying is "
    "evaporation.",
    "contact_heat": "Not there: temperatures inside a particle, and radiation from particle to particle: each sees "
    "surroundings of one temperature.",
    "vapour": "Not there: more than one vapour, its effect on the density of the gas, and reactions.",
    "evaporation": "Not there: condensation, and pores; what bonds are made of has no mass.",
    "fluid": "Not there: turbulence models, compressibility, free surfaces, and a viscosity that flows with the fluid.",
    "vessel": "Not there: a free surface of the fluid, surfaces that turn, and walls that move "
    "through it. Not with a fluid: several processes.",
    "wall": "Not there: the effect of a moving wall on the fluid; and wear.",
    "liquid": "Not there: several liquids, flow through bridges, and the mass of the liquid.",
    "spray": "Not there: flight of drops, which land at once, and their momentum.",
    "laws": "Not there: forces between particles of other kinds than contacts, films and bridges; add yours in Python.",
    "bed": "Not there: particles that are not spheres, or that break.",
}
"""What a table does not have, in words."""


def absent(word: str) -> str:
    """What to say to somebody who asks for a word; empty where nothing is known.

    >>> absent("turbulence_model")
    'no turbulence model acts in a case; the page Limits has more'
    >>> absent("diameter")
    ''
    """
    plain = word.lower().replace("-", "_")
    for pattern, words in ABSENT.items():
        if re.search(rf"(^|[_.])({pattern})", plain):
            return f"{words}; {LIMITS}"
    return ""
