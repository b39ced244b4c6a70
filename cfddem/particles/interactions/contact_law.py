"""What a contact law consists of.

A contact law is a set of functions of numbers. Each takes what it needs by name:

    overlap, gap [m], normal_speed [m/s], step [s], minimum_gap [m], reduced_radius [m], reduced_mass [kg]
    a column of the pair table: contact_modulus [Pa], shear_modulus [Pa], damping_ratio, linear_damping_ratio,
        restitution, friction, work_of_adhesion [J/m2], ...
    a parameter, a memory field or a derived value of the law, by its own name

The functions are compiled into the loops of a run (:mod:`cfddem.backend.law_set`). They should be free of branches:
`a if condition else b`, `min` and `max` keep the loop working on several pairs at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from inspect import signature
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.backend.law_set import adapted, check_compiles, written
from cfddem.data.fields import Field
from cfddem.particles.collision_events import FIELDS as RECORD_FIELDS
from cfddem.particles.interactions import contact, film, rolling
from cfddem.particles.interactions.slots import ContactState
from cfddem.particles.material_pairs import PAIR
from cfddem.particles.pair_graph import Graph
from cfddem.particles.step_limits import STABLE, STEPS_PER_HERTZ_TIME

COLUMNS: tuple[str, ...] = PAIR.names or ()
"""Columns of the pair table."""

Function = Callable[..., float]
Impact = Callable[[float, float, Any, float], tuple[float, float]]
"""Reduced mass [kg], reduced radius [m], row of the pair table, speed [m/s] -> default step and stability limit [s]."""

ARGUMENTS = "contact, row, p, m, d"

TAKEN = {each.name for each in (*contact.FIELDS, *film.FIELDS, film.OUTSIDE, *rolling.FIELDS, *RECORD_FIELDS)}
TAKEN |= set(Graph._fields)
"""Names of the built-in fields of pairs."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactLaw:
    """A contact law: normal force, damping and tangential stiffness of two solids that overlap.

    name                  in cases, messages and collision records
    force                 elastic normal force, repulsive where positive [N]
    damping               resistance of the dashpot, normal and tangential [kg/s]
    stiffness             derivative of the force with the overlap; sets the stable time step [N/m]
    tangential_stiffness  of the tangential spring [N/m]
    secant_stiffness      force over overlap; found from `force` if not given [N/m]
    energy                stored in the normal spring [J]; needed by runs that count energy. With a film it includes the
                          share of the solids in the load, `closures.contact.spring_energy`
    remember              memory at this instant: one number, or a tuple as long as `memory`
    memory                fields that each pair remembers while its contact lasts
    parameters            name -> value, the same for all pairs
    derived               name -> function, values that several functions of the law share
    overlap               equivalent overlap for damping and tangential stiffness; the overlap itself if not given [m]
    pull_off              largest pull of an adhesive contact [N]
    reach                 gap up to which an adhesive contact lasts after it has formed [m]
    damping_mean          mean of the damping while the overlap grows from 0, over its last value [-]
    impact                time scales of an impact; found from `stiffness` if not given
    """

    name: str
    force: Function
    damping: Function
    stiffness: Function
    tangential_stiffness: Function
    secant_stiffness: Function | None = None
    energy: Function | None = None
    remember: Callable[..., Any] | None = None
    memory: tuple[Field, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    derived: Mapping[str, Function] = field(default_factory=dict)
    overlap: Function | None = None
    pull_off: Function | None = None
    reach: Function | None = None
    damping_mean: float = 1.0
    impact: Impact | None = None

    def with_parameters(self, **values: float) -> ContactLaw:
        """The same law with other values of its parameters."""
        return replace(self, parameters={**self.parameters, **values})

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the parameters, as loops take them."""
        return tuple(float(value) for value in self.parameters.values())

    def choices(self) -> dict[str, Any]:
        """What goes into the slots of the loops."""
        functions = {
            "elastic_force": self.force,
            "normal_damping": self.damping,
            "tangent_stiffness": self.stiffness,
            "tangential_stiffness": self.tangential_stiffness,
            "secant_stiffness": self.secant_stiffness or _secant(self.force),
            "contact_overlap": self.overlap or _same_overlap,
            "pull_off": self.pull_off or _nothing,
            "adhesive_reach": self.reach or _nothing,
            "stored_energy": self.energy or _nothing,
        }
        made = {slot: adapted(function, ARGUMENTS, self._sources) for slot, function in functions.items()}
        sources = {name: source for name, source in self._sources.items() if name not in self.derived}
        parts = {f"law_{n}": adapted(each, ARGUMENTS[:-3], sources) for n, each in enumerate(self.derived.values())}
        calls = "".join(f"{name}({ARGUMENTS[:-3]}), " for name in parts)
        made["derive"] = written(f"def derive({ARGUMENTS[:-3]}):\n    return ({calls})\n", **parts)
        if self.remember is None:
            made["remember"] = written(f"def remember({ARGUMENTS}):\n    return m\n")
        else:
            made["remember"] = adapted(
                self.remember, ARGUMENTS, self._sources, "({},)" if len(self.memory) == 1 else "{}"
            )
        names = [each.name for each in self.memory]
        made["read_memory"] = written(
            f"def read_memory(memory, k):\n    return ({''.join(f'memory.{name}[k], ' for name in names)})\n"
        )
        made["write_memory"] = written(
            "def write_memory(memory, k, m, touching):\n"
            + "".join(f"    memory.{each.name}[k] = m[{n}] if touching else {float(each.initial)!r}\n"  # type: ignore[arg-type]
                      for n, each in enumerate(self.memory))
            + "    return\n",
            inf=math.inf, nan=math.nan,
        )  # fmt: skip
        return made | {"DAMPING_MEAN": self.damping_mean, "ADHESIVE": self.reach is not None}

    def check(self) -> None:
        """Refuse functions that cannot be compiled, and memory fields that loops cannot keep."""
        given = (
            self.force, self.damping, self.stiffness, self.tangential_stiffness, self.secant_stiffness, self.energy,
            self.remember, self.overlap, self.pull_off, self.reach, *self.derived.values(),
        )  # fmt: skip
        for each in given:
            if each is not None:
                check_compiles("laws.contact", each)
        for memory in self.memory:
            what = f"memory of the contact law {self.name!r}"
            if memory.components:
                raise InputError(what, memory.name, "one number", "declare a field for each component")
            if callable(memory.initial):
                raise InputError(what, memory.name, "a field whose initial value is a number")
            if memory.name in TAKEN:
                raise InputError(what, memory.name, "another name", "pairs have a field of this name")

    def evaluate(self, function: Function, state: ContactState, row: Any) -> float:
        """One function of the law for one contact that is loaded for the first time, outside of loops."""
        known = {**{name: float(row[name]) for name in COLUMNS}, **state._asdict(), **self.parameters}
        known |= {each.name: float(each.initial) for each in self.memory}  # type: ignore[arg-type]
        for name, each in self.derived.items():
            known[name] = _asked(each, known)
        if self.remember is not None:
            now = np.atleast_1d(_asked(self.remember, known))
            known |= {each.name: float(value) for each, value in zip(self.memory, now)}
        return float(_asked(function, known))

    def impact_steps(self, reduced_mass: float, reduced_radius: float, row: Any, speed: float) -> tuple[float, float]:
        """Default step and stability limit of an impact [s]; infinite without a speed."""
        if self.impact is not None:
            return self.impact(reduced_mass, reduced_radius, row, speed)
        if speed <= 0.0:
            return math.inf, math.inf
        energy, overlap = 0.0, 1e-9 * reduced_radius
        while energy < 0.5 * reduced_mass * speed**2 and overlap < reduced_radius:
            overlap *= 1.05
            state = ContactState(overlap, -overlap, 0.0, 0.0, 0.0, reduced_radius, reduced_mass)
            energy += self.evaluate(self.force, state, row) * overlap * (1.0 - 1.0 / 1.05)
        stiffest = max(self.evaluate(each, state, row) for each in (self.stiffness, self.tangential_stiffness))
        swing = math.sqrt(reduced_mass / stiffest)
        return math.pi * swing / STEPS_PER_HERTZ_TIME, STABLE * swing

    @property
    def _sources(self) -> dict[str, str]:
        """Where loops have each argument."""
        return {
            **{name: f"row.{name}" for name in COLUMNS},
            **{name: f"contact.{name}" for name in ContactState._fields},
            **{name: f"p[{n}]" for n, name in enumerate(self.parameters)},
            **{each.name: f"m[{n}]" for n, each in enumerate(self.memory)},
            **{name: f"d[{n}]" for n, name in enumerate(self.derived)},
        }


def _asked(function: Callable[..., Any], known: Mapping[str, Any]) -> Any:
    """Value of a function that takes some of the known values by name."""
    return function(**{name: known[name] for name in signature(function).parameters})


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
