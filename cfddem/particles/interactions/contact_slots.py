"""A contact law as the particle loops call it: its functions, adapted to the slots of the loops."""

from __future__ import annotations

import math
from collections.abc import Callable
from inspect import signature
from typing import Any

from cfddem.backend.errors import InputError
from cfddem.backend.law_set import adapted, check_compiles, written
from cfddem.backend.named import NAMES, can_be_named
from cfddem.particles.collision_events import FIELDS as RECORD_FIELDS
from cfddem.particles.interactions import bond, bridge, contact, film, rolling, shear_film
from cfddem.particles.interactions.contact_law import COLUMNS, ContactLaw, Function
from cfddem.particles.interactions.slots import ContactState
from cfddem.particles.pair_graph import Graph

ARGUMENTS = "contact, row, p, m, d"

TAKEN = {
    each.name
    for each in (*contact.FIELDS, *film.FIELDS, film.OUTSIDE, *shear_film.FIELDS, *rolling.FIELDS, *RECORD_FIELDS)
}
TAKEN |= {each.name for each in (*bridge.FIELDS, *bond.FIELDS)} | set(Graph._fields)
"""Names of the built-in fields of pairs."""


def contact_choices(law: ContactLaw) -> dict[str, Any]:
    """What a contact law puts into the slots of the loops."""
    functions: dict[str, Callable[..., float]] = {
        "elastic_force": law.force,
        "normal_damping": law.damping,
        "tangent_stiffness": law.stiffness,
        "tangential_stiffness": law.tangential_stiffness,
        "secant_stiffness": law.secant_stiffness or _secant(law.force),
        "contact_overlap": law.overlap or _same_overlap,
        "pull_off": law.pull_off or _nothing,
        "adhesive_reach": law.reach or _nothing,
        "stored_energy": law.energy or _nothing,
        "lost_energy": law.lost or _nothing,
    }
    places = _places(law)
    made = {slot: adapted(function, ARGUMENTS, places) for slot, function in functions.items()}
    sources = {name: place for name, place in places.items() if name not in law.derived}
    parts = {f"law_{n}": adapted(each, ARGUMENTS[:-3], sources) for n, each in enumerate(law.derived.values())}
    calls = "".join(f"{name}({ARGUMENTS[:-3]}), " for name in parts)
    made["derive"] = written(f"def derive({ARGUMENTS[:-3]}):\n    return ({calls})\n", **parts)
    if law.remember is None:
        made["remember"] = written(f"def remember({ARGUMENTS}):\n    return m\n")
    else:
        made["remember"] = adapted(law.remember, ARGUMENTS, places, "({},)" if len(law.memory) == 1 else "{}")
    names = [each.name for each in law.memory]
    made["read_memory"] = written(
        f"def read_memory(memory, k):\n    return ({''.join(f'memory.{name}[k], ' for name in names)})\n"
    )
    made["write_memory"] = written(
        "def write_memory(memory, k, m, touching):\n"
        + "".join(f"    memory.{each.name}[k] = m[{n}] if touching else {float(each.initial)!r}\n"  # type: ignore[arg-type]
                  for n, each in enumerate(law.memory))
        + "    return\n",
        inf=math.inf, nan=math.nan,
    )  # fmt: skip
    return made | {"DAMPING_MEAN": law.damping_mean, "ADHESIVE": law.adhesive}


def check_contact_law(law: ContactLaw) -> None:
    """Refuse functions that cannot be compiled, invalid parameters, and memory fields that loops cannot keep."""
    for name, value in law.parameters.items():
        if not can_be_named(name):
            raise InputError(f"parameter of the contact law {law.name!r}", name, NAMES)
        if not 0.0 <= value < math.inf:
            raise InputError(f"contact_parameters.{name}", value, "at least 0 and finite")
    for each in law.functions:
        if not each.__module__.startswith("cfddem."):
            check_compiles("laws.contact", each)
    for memory in law.memory:
        what = f"memory of the contact law {law.name!r}"
        if memory.components:
            raise InputError(what, memory.name, "one number", "declare a field for each component")
        if callable(memory.initial):
            raise InputError(what, memory.name, "a field whose initial value is a number")
        if memory.name in TAKEN:
            raise InputError(what, memory.name, "another name", "pairs have a field of this name")


def _places(law: ContactLaw) -> dict[str, str]:
    """Where loops have each argument."""
    return {
        **{name: f"row.{name}" for name in COLUMNS},
        **{name: f"contact.{name}" for name in ContactState._fields},
        **{name: f"p.contact.{name}" for name in law.parameters},
        **{each.name: f"m[{n}]" for n, each in enumerate(law.memory)},
        **{name: f"d[{n}]" for n, name in enumerate(law.derived)},
    }


def _same_overlap(overlap: float) -> float:
    return overlap


def _nothing() -> float:
    return 0.0


def _secant(force: Function) -> Function:
    """Force over overlap of a law, with the arguments of its force."""
    taken = list(signature(force).parameters)
    names = taken if "overlap" in taken else [*taken, "overlap"]
    scope: dict[str, Any] = {"force": force}
    exec(f"def secant({', '.join(names)}):\n    return force({', '.join(taken)}) / overlap\n", scope)
    return scope["secant"]  # type: ignore[no-any-return]
