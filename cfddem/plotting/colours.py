"""The colours of spheres: which quantities of a run can colour them, their values, limits and colour maps."""

from __future__ import annotations

from typing import Any

import numpy as np

from cfddem.backend.errors import InputError, nearest
from cfddem.case.toml_text import parse
from cfddem.io.quantities import declared, shown_unit
from cfddem.io.reading import RunData

SPEED = "speed"
"""Magnitude of the velocity."""

AGGLOMERATE = "agglomerate"
"""The field whose values are names: every agglomerate gets a colour of its own."""

COLLISIONS = "collisions"
"""Number of recorded collisions of each particle that ended since the previous snapshot."""

TEMPERATURE = "temperature"
"""Its colours lie between the lowest and the highest one."""

MOISTURE = "moisture"
"""Liquid of each particle, with its part of the liquid of its bridges, over the volume of the particle."""

LIQUIDS = ("liquid_carried", "liquid")
"""Fields from which the moisture follows, the best first."""

SPECIES = "species"
"""The field whose values are numbers of the species of a mixture."""

SINGLE = 0.04
"""Part of the colours that is for single particles."""

_MAPS = {TEMPERATURE: ("inferno", 0.18, 0.92), MOISTURE: ("YlGnBu", 0.08, 1.0), "vapour": ("YlGnBu", 0.0, 0.9)}
"""Colour map of quantities of spheres and cells, and which part of it; of others viridis."""

_PLACES = ("id", "position")


def choices(run: RunData) -> list[str]:
    """Quantities of a run that can colour its spheres, the most useful first."""
    fields = set(run.particle_fields)
    choices_of_run = [SPECIES] if SPECIES in fields else []
    choices_of_run += [SPEED] if "velocity" in fields else []
    choices_of_run += [name for name in ("liquid", AGGLOMERATE, TEMPERATURE) if name in fields]
    choices_of_run += [MOISTURE] if fields & set(LIQUIDS) else []
    choices_of_run += [COLLISIONS] if run.collisions_of(-1) else []
    return choices_of_run + sorted(fields - {"velocity", *_PLACES, *choices_of_run})


def usual(run: RunData) -> str:
    """What colours the spheres where nothing is named: the species of a mixture, else the speed."""
    return SPECIES if SPECIES in run.particle_fields else SPEED


def values(run: RunData, snapshot: int, colour: str) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The particles of a snapshot, and the value of each one's colour.

    colour  speed, collisions, moisture, or a recorded field; of a vector its magnitude
    errors  InputError for an unknown field
    """
    particles = run.particles(snapshot)
    if "radius" not in particles:
        raise InputError("particles", sorted(particles), "recorded with their radius")
    name = "velocity" if colour == SPEED else colour
    if name == COLLISIONS and name not in particles and (recorded := run.collisions_of(snapshot)):
        return particles, _collision_counts(particles["id"], recorded)
    if name == MOISTURE and name not in particles and (liquid := next((n for n in LIQUIDS if n in particles), "")):
        return particles, particles[liquid] / (4.0 / 3.0 * np.pi * particles["radius"] ** 3)
    if name not in particles:
        remedy = "run.record_collisions = true records the collisions" if name == COLLISIONS else ""
        raise InputError("colour", colour, nearest(colour, choices(run)), remedy)
    field = particles[name]
    if name == AGGLOMERATE:
        return particles, scattered(field)
    return particles, magnitude(field) if field.ndim == 2 else field.astype(float)


def limits(numbers: np.ndarray, colour: str) -> tuple[float, float]:
    """Values of the first and the last colour; a few extreme values lie beyond."""
    if colour == AGGLOMERATE:
        return 0.0, 1.0
    if colour == SPECIES:
        return 0.0, max(1.0, float(numbers.max(initial=0.0)))
    high = float(np.quantile(numbers, 0.998)) if numbers.size else 1.0
    if colour == TEMPERATURE and numbers.size:
        low = float(np.quantile(numbers, 0.002))
        return low, high if high - low > 1e-3 else low + 1.0
    low = 0.0 if numbers.size == 0 or numbers.min() >= 0.0 else float(numbers.min())
    return low, high if high > low else low + 1.0


def label(run: RunData, colour: str) -> str:
    """Label of the colour bar of the spheres."""
    if colour == AGGLOMERATE:
        return "agglomerate; grey: single spheres"
    if colour == SPECIES:
        return ", ".join(f"{number} {name}" for number, name in enumerate(_species_names(run))) or colour
    if colour == COLLISIONS and colour not in run.particle_fields:
        return "collisions since previous snapshot  [-]"
    if colour == MOISTURE and colour not in run.particle_fields:
        return "moisture, liquid over solid volume  [-]"
    name = "velocity" if colour == SPEED else colour
    return f"{colour.replace('_', ' ')}  [{shown_unit(declared(run.quantities, 'particles', name).unit)}]"


def _species_names(run: RunData) -> list[str]:
    bed = parse(run.case_text, str(run.folder / "case.toml")).get("bed")
    species = bed.get("species") if isinstance(bed, dict) else None
    return list(species) if isinstance(species, dict) else []


def colour_map(colour: str) -> Any:
    """Colour map of the spheres."""
    if colour == SPECIES:
        from matplotlib.colors import LinearSegmentedColormap

        return LinearSegmentedColormap.from_list(SPECIES, ["#1f6fb5", "#12995a", "#e08a00"])
    if colour == AGGLOMERATE:
        return _many_colours()
    name, begin, end = _MAPS.get(colour, ("viridis", 0.12, 1.0))
    return part_of(name, begin, end)


def scattered(names: np.ndarray) -> np.ndarray:
    """A number for each agglomerate, alike for the same name in all snapshots; 0 for those of a single particle."""
    _, place, size = np.unique(names, return_inverse=True, return_counts=True)
    mixed = (0.6180339887498949 * names.astype(float)) % 1.0  # neighbouring names get distant colours
    return np.where(size[place] > 1, SINGLE + (1.0 - SINGLE) * mixed, 0.0)


def magnitude(vectors: np.ndarray) -> np.ndarray:
    """Length of each vector."""
    length: np.ndarray = np.linalg.norm(vectors, axis=-1)
    return length


def part_of(name: str, begin: float, end: float) -> Any:
    """Part of a colour map, without colours so dark that shading or lines on them cannot be seen."""
    import matplotlib as mpl
    from matplotlib.colors import ListedColormap

    return ListedColormap(mpl.colormaps[name](np.linspace(begin, end, 256)))


def _collision_counts(ids: np.ndarray, recorded: dict[str, np.ndarray]) -> np.ndarray:
    """Recorded collisions of each particle, whose ids increase; those with walls count once."""
    counts = np.zeros(len(ids))
    if not len(ids):
        return counts
    for end in ("first", "second"):
        place = np.minimum(np.searchsorted(ids, recorded[end]), len(ids) - 1)
        matches = ids[place] == recorded[end]
        np.add.at(counts, place[matches], recorded["weight"][matches])
    return counts


def _many_colours() -> Any:
    """Grey for single particles, and a map whose lightness changes, for all readers, for agglomerates."""
    import matplotlib as mpl
    from matplotlib.colors import ListedColormap

    hues = mpl.colormaps["plasma"](np.linspace(0.15, 0.95, 256))
    hues[: int(256 * SINGLE)] = (0.78, 0.78, 0.78, 1.0)
    return ListedColormap(hues)
