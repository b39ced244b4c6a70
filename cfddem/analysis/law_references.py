"""The laws that a case uses, with their sources, for the list at the end of a report."""

from __future__ import annotations

from collections.abc import Iterator

from cfddem.case.schema import Case
from closures.registry import REGISTRY, Law, load_built_in_laws

FILM = {
    "nijssen": ("film_strength",),
    "nijssen_full": ("film_strength", "shear_resistance"),
    "nijssen_full_twist": ("film_strength", "shear_resistance"),
}
"""Names of the registered laws of the built-in films."""

BRIDGE = (
    ("capillary", "pull", "pull"),
    ("rupture", "rupture", "rupture"),
    ("bridge", "film", "share"),
    ("bridge", "tangential", "tangential"),
)
"""Kind of the laws of a bridge, key of `[liquid]` that names one, and the ending of its name in the registry."""


def references_of(case: Case) -> list[dict[str, str]]:
    """Kind, name and reference of each law of a case."""
    load_built_in_laws()
    found = [{"kind": law.kind.replace("_", " "), "name": law.name, "reference": law.reference} for law in _used(case)]
    if not case.bed.fixed and case.particle_count > 1 and "contact" not in case.laws.missing:
        contact = case.laws.contact_law
        found.append({"kind": "contact law", "name": contact.name, "reference": contact.reference})
    return [each for place, each in enumerate(found) if each not in found[:place]]


def _used(case: Case) -> Iterator[Law]:
    laws = case.laws
    if case.fluid is not None:
        given = (laws.drag_law, laws.added_mass_law, case.agitation)
        yield from (law for law in given if isinstance(law, Law))
        yield from (REGISTRY["history"][name] for name in (laws.history,) if name in REGISTRY["history"])
        yield from (REGISTRY["lift"][name] for name in ("saffman_mei", "magnus") if laws.lift)
        yield from (REGISTRY["lift"][name] for name in ("torque",) if laws.torque)
        yield from (REGISTRY["wall_drag"][name] for name in ("towards_wall", "along_wall") if laws.wall_drag != "none")
    if case.has_films and not case.bed.fixed:
        yield from (REGISTRY["lubrication"][name] for name in FILM.get(str(laws.film_in(case.fluid)), ()))
        yield laws.pair_laws.get("minimum_gap", REGISTRY["minimum_gap"]["elastohydrodynamic"])
        yield from (law for kind, law in laws.pair_laws.items() if kind == "lubrication")
    if case.liquid is not None:
        for kind, key, ending in BRIDGE:
            law = REGISTRY[kind].get(f"{getattr(case.liquid, key)}_{ending}")
            if law is not None:
                yield law
        if case.liquid.rupture == "capillary":
            yield REGISTRY["capillary"]["rupture_length"]
