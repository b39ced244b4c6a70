"""Laws chosen by the user: by name from the registry or an installed package, or as a function."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence

from cfddem.backend.errors import InputError, nearest, shown
from closures import registry
from closures.registry import Law, law_of

GAP_ARGUMENTS = ("roughness", "approach_speed", "viscosity", "reduced_modulus", "reduced_radius")
"""Arguments that a law of the minimum gap may take, by name: [m], [m/s], [Pa s], [Pa], [m]."""

FILM_ARGUMENTS = ("gap", "viscosity", "reduced_radius", "minimum_gap", "cutoff_gap")
"""Arguments that a film law may take, by name: [m], [Pa s], [m], [m], [m]; it must take the first three."""

AGITATION_ARGUMENTS = ("solid_fraction", "reynolds", "along", "density_ratio")
"""Arguments that a law of agitation may take, by name: of the mean slip, in the direction with this squared cosine."""

BUILT_IN: dict[str, tuple[str, ...]] = {
    "drag": ("none",),
    "minimum_gap": ("elastohydrodynamic",),
    "lubrication": ("nijssen", "nijssen_full", "nijssen_full_twist", "none"),
    "added_mass": (),
    "agitation": ("auto", "none", "lattanzi"),
}
"""Names that a case may use besides those of registered laws: no law, or the built-in one."""

ARGUMENTS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "minimum_gap": (GAP_ARGUMENTS, ()),
    "lubrication": (FILM_ARGUMENTS, FILM_ARGUMENTS[:3]),
    "agitation": (AGITATION_ARGUMENTS, AGITATION_ARGUMENTS[:1]),
}
"""Arguments that a law of a kind may take, and those that it must take."""

OF_THE_PAIR_LOOP = ("minimum_gap", "lubrication")
"""Kinds of law that the pair loop calls."""


def chosen(kind: str, law: str | Callable[..., float]) -> Law:
    """Registry entry of a law chosen by its name or passed as a function.

    kind  a key of `BUILT_IN`
    """
    entry = _named(kind, law) if isinstance(law, str) else _user_defined(kind, law)
    if not _can_be_called(kind, entry):
        may, must = ARGUMENTS[kind]
        asked = f"it may take {', '.join(may)}" + (f", and must take {', '.join(must)}" if must else "")
        loop = "pair loop" if kind in OF_THE_PAIR_LOOP else "coupling"
        raise InputError(kind, entry.name, f"a law of kind {kind!r} that the {loop} can call", asked)
    return entry


def _can_be_called(kind: str, entry: Law) -> bool:
    """Whether the caller of laws of this kind has all arguments that this one takes."""
    if kind not in ARGUMENTS:
        return True
    may, must = ARGUMENTS[kind]
    return entry.kind == kind and set(must) <= set(inspect.signature(entry.function).parameters) <= set(may)


def called_by_name(law: Callable[..., float], names: Sequence[str], numbers: Sequence[float]) -> float:
    """Value of a law that takes some of these arguments, in any order."""
    known = dict(zip(names, numbers))
    return law(**{name: known[name] for name in inspect.signature(law).parameters})


def _named(kind: str, name: str) -> Law:
    registry.load_built_in_laws()
    laws = registry.REGISTRY[kind]
    if name not in laws:
        registry.load_package_laws()
    if name not in laws:
        known = [*BUILT_IN[kind], *(each.name for each in laws.values() if _can_be_called(kind, each))]
        remedy = "cfddem explain lists all laws; for one of your own see docs/how-to/user-law.md"
        raise InputError(kind, shown(name), nearest(name, dict.fromkeys(known)), remedy)
    return laws[name]


def _user_defined(kind: str, function: Callable[..., float]) -> Law:
    try:
        return law_of(function)
    except KeyError as failure:
        raise InputError(f"laws.{kind}", None, "a law", str(failure.args[0])) from None
