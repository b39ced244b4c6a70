"""The laws that a user chooses: by name from the shelf or an installed package, or a function of one's own."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence

from cfddem.errors import InputError, nearest
from cfddem.mistakes import shown
from closures.law import Law

GAP_ARGUMENTS = ("roughness", "approach_speed", "viscosity", "reduced_modulus", "reduced_radius")
"""What a law of the minimum gap may ask for, by these names: [m], [m/s], [Pa s], [Pa], [m]."""

FILM_ARGUMENTS = ("gap", "viscosity", "reduced_radius", "minimum_gap", "cutoff_gap")
"""What a law of a film may ask for, by these names: [m], [Pa s], [m], [m], [m]; the first three it must."""

BUILT_IN = {"drag": ("none",), "minimum_gap": ("elastohydrodynamic",), "lubrication": ("nijssen", "none")}
"""What a case may say for a law that is no law to be looked up: nothing, or what is compiled into the pair loop."""

OF_THE_PAIR_LOOP: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "minimum_gap": (GAP_ARGUMENTS, ()),
    "lubrication": (FILM_ARGUMENTS, FILM_ARGUMENTS[:3]),
}
"""Kinds of law that the pair loop asks: what each may take, and what it must."""


def chosen(kind: str, law: str | Callable[..., float]) -> Law:
    """The card of a law that was chosen by its name, or passed as a function.

    kind  "drag", "minimum_gap" or "lubrication"
    """
    card = _named(kind, law) if isinstance(law, str) else _of_ones_own(kind, law)
    if not _can_be_asked(kind, card):
        may, must = OF_THE_PAIR_LOOP[kind]
        asked = f"it may take {', '.join(may)}" + (f", and must take {', '.join(must)}" if must else "")
        raise InputError(kind, card.name, f"a law of kind {kind!r} that the pair loop can ask", asked)
    return card


def _can_be_asked(kind: str, card: Law) -> bool:
    """Whether a law takes what those who ask laws of this kind have to give."""
    if kind not in OF_THE_PAIR_LOOP:
        return True
    may, must = OF_THE_PAIR_LOOP[kind]
    return card.kind == kind and set(must) <= set(inspect.signature(card.function).parameters) <= set(may)


def asked_by_name(law: Callable[..., float], names: Sequence[str], numbers: Sequence[float]) -> float:
    """What a law says, which takes some of these arguments, in any order."""
    known = dict(zip(names, numbers))
    return law(**{name: known[name] for name in inspect.signature(law).parameters})


def _named(kind: str, name: str) -> Law:
    from closures import shelf

    shelf.fill()
    laws = shelf.SHELF[kind]
    if name not in laws:
        shelf.fill_from_packages()
    if name not in laws:
        known = [*BUILT_IN[kind], *(each.name for each in laws.values() if _can_be_asked(kind, each))]
        remedy = "cfddem explain lists all laws"
        raise InputError(kind, shown(name), nearest(name, dict.fromkeys(known)), remedy)
    return laws[name]


def _of_ones_own(kind: str, function: Callable[..., float]) -> Law:
    from closures.law import page

    try:
        return page(function)
    except KeyError as failure:
        raise InputError(f"laws.{kind}", None, "a law", str(failure.args[0])) from None
