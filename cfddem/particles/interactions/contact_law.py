"""What a contact law consists of, and the registry of contact laws. Nothing is compiled here.

A contact law is a set of functions of numbers. Each takes what it needs by name:

    overlap, gap [m], normal_speed [m/s], step [s], minimum_gap [m], reduced_radius [m], reduced_mass [kg]
    a column of the pair table: contact_modulus [Pa], shear_modulus [Pa], damping_ratio, linear_damping_ratio,
        restitution, friction, work_of_adhesion [J/m2], ...
    a parameter, a memory field or a derived value of the law, by its own name

The functions are compiled into the loops of a run (:mod:`cfddem.particles.interactions.laws`). They should be
free of branches: `a if condition else b`, `min` and `max` keep the loop working on several pairs at once.

A law that is registered here can be chosen by its name in cases and in `Laws`; `cfddem explain` lists it. Each module
of the folder `contacts` registers one built-in law.
"""

from __future__ import annotations

import math
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError, nearest, shown
from cfddem.model.fields import Field
from cfddem.particles.material_pairs import PAIR
from cfddem.particles.step_criteria import stiffness_steps
from closures.registry import load_package_laws

COLUMNS: tuple[str, ...] = PAIR.names or ()
"""Columns of the pair table."""

Function = Callable[..., float]

_OTHERS = ("remember", "impact")
"""Functions of a law that do not give one number."""

_SHARES_OF_DIAMETER = (1e-6, 1e-4, 1e-3, 1e-2, 2e-2)
"""Overlaps at which a law is checked."""

FARTHEST = 1e4
"""Overlap over R* up to which the largest overlap of an impact is sought."""

POINTS, WEIGHTS = (values.tolist() for values in np.polynomial.legendre.leggauss(8))
SHARES = [0.5 * (point + 1.0) for point in POINTS]
"""Gauss' rule of eight points from 0 to 1; the weights add up to 2."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactLaw:
    """A contact law: normal force, damping and tangential stiffness of two solids that overlap.

    name                  in cases, messages and collision records
    force                 elastic normal force, repulsive where positive [N]; `cfddem explain` shows its docstring
    damping               resistance of the dashpot, normal and tangential [kg/s]
    stiffness             derivative of the force with the overlap; sets the stable time step [N/m]
    tangential_stiffness  of the tangential spring [N/m]
    reference             source of the law, for `cfddem explain`
    secant_stiffness      force over overlap; found from `force` if not given [N/m]
    energy                stored in the normal spring [J]; needed by runs that count energy. With a film it includes the
                          share of the solids in the load, `closures.contact.spring_energy`
    lost                  energy that the normal force has dissipated since the contact began, for instance to plastic
                          deformation: a function of the memory [J]. Nothing if not given
    remember              memory at this instant: one number, or a tuple as long as `memory`
    memory                fields that each pair remembers while its contact lasts
    parameters            name -> value, at least 0, the same for all pairs
    derived               name -> function, values that several functions of the law share
    overlap               equivalent overlap for damping and tangential stiffness; the overlap itself if not given [m]
    pull_off              largest pull of an adhesive contact [N]
    reach                 gap up to which an adhesive contact lasts after it has formed [m]
    damping_mean          mean of the damping while the overlap grows from 0, over its last value [-]
    impact                default step and stability limit of an impact [s], a function that may also take `speed`
                          [m/s]; found from `stiffness` if not given
    """

    name: str
    force: Function
    damping: Function
    stiffness: Function
    tangential_stiffness: Function
    reference: str = ""
    secant_stiffness: Function | None = None
    energy: Function | None = None
    lost: Function | None = None
    remember: Callable[..., Any] | None = None
    memory: tuple[Field, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    derived: Mapping[str, Function] = field(default_factory=dict)
    overlap: Function | None = None
    pull_off: Function | None = None
    reach: Function | None = None
    damping_mean: float = 1.0
    impact: Callable[..., tuple[float, float]] | None = None

    def with_parameters(self, **values: float) -> ContactLaw:
        """The same law with other values of its parameters."""
        for name in values:
            if name not in self.parameters:
                limit = nearest(name, self.parameters) if self.parameters else "left out"
                raise InputError("contact_parameters", name, limit, f"these are the parameters of {self.name}")
        return replace(self, parameters={**self.parameters, **values}) if values else self

    @property
    def adhesive(self) -> bool:
        """Whether solids attract each other, also across a gap."""
        return self.reach is not None

    @property
    def functions(self) -> tuple[Callable[..., Any], ...]:
        """All functions that loops call."""
        every = (
            self.force, self.damping, self.stiffness, self.tangential_stiffness, self.secant_stiffness, self.energy,
            self.lost, self.remember, self.overlap, self.pull_off, self.reach, *self.derived.values(),
        )  # fmt: skip
        return tuple(function for function in every if function is not None)

    def takes(self, name: str) -> bool:
        """Whether a function of the law takes this argument."""
        return any(name in signature(function).parameters for function in self.functions)

    # ---------------------------------------------------------------- outside of loops

    def evaluate(self, function: Function, overlap: float, mass: float, radius: float, row: Any) -> float:
        """One function of the law for a contact that is loaded for the first time, at rest, without a film.

        overlap       > 0 [m]
        mass, radius  reduced [kg], [m]
        row           entry of the pair table
        """
        values = self._known(mass, radius, row)
        values |= {"overlap": overlap, "gap": -overlap, "normal_speed": 0.0, "step": 0.0, "minimum_gap": 0.0}
        values |= {field.name: float(field.initial) for field in self.memory}  # type: ignore[arg-type]
        for name, derived in self.derived.items():
            values[name] = _asked(derived, values)
        if self.remember is not None:
            now = np.atleast_1d(_asked(self.remember, values))
            values |= {field.name: float(value) for field, value in zip(self.memory, now)}
        return float(_asked(function, values))

    def impact_steps(self, mass: float, radius: float, row: Any, speed: float) -> tuple[float, float]:
        """Default step and stability limit of an impact at a speed [s]; infinite without a speed."""
        if self.impact is not None:
            return _asked(self.impact, {**self._known(mass, radius, row), "speed": speed})  # type: ignore[no-any-return]
        if speed <= 0.0:
            return math.inf, math.inf
        overlap = min(self.largest_overlap(mass, radius, row, speed), radius)
        stiffest = max(
            self.evaluate(stiffness, overlap, mass, radius, row)
            for stiffness in (self.stiffness, self.tangential_stiffness)
        )
        return stiffness_steps(mass, stiffest)

    def largest_overlap(self, mass: float, radius: float, row: Any, speed: float) -> float:
        """Largest overlap of an impact without damping [m]; infinite if the law does not stop it."""

        def energy(overlap: float) -> float:
            # over the square root of the overlap, in which most forces are polynomials
            forces = (self.evaluate(self.force, overlap * share**2, mass, radius, row) for share in SHARES)
            return overlap * sum(weight * share * force for weight, share, force in zip(WEIGHTS, SHARES, forces))

        return _first(lambda overlap: energy(overlap) >= 0.5 * mass * speed**2, radius)

    def resting_overlap(self, mass: float, radius: float, row: Any, load: float) -> float:
        """Overlap under a load [N] in [m]; infinite if the law does not carry it."""
        return _first(lambda overlap: self.evaluate(self.force, overlap, mass, radius, row) >= load, radius)

    def problems(self, mass: float, radius: float, row: Any) -> Iterator[tuple[bool, str]]:
        """What is wrong with the functions at overlaps from 1e-6 to 2 % of a diameter: whether fatal, and words.

        Each function must give a finite number, the stiffness be positive, and the damping not negative. A stiffness
        that is less than half of the slope of the force lets the time step be too long.
        """
        numbers = {
            name: function for name, function in vars(self).items() if callable(function) and name not in _OTHERS
        }
        for share in _SHARES_OF_DIAMETER:
            overlap, at = share * 4.0 * radius, f"at an overlap of {100.0 * share:g} % of a diameter"
            values = {}
            for name, function in numbers.items():
                try:
                    values[name] = self.evaluate(function, overlap, mass, radius, row)
                except InputError as failure:
                    yield True, str(failure)
                    return
                except Exception as failure:  # whatever a user's function raises
                    yield True, f"{name} fails ({failure}) {at}"
                    return
                if not math.isfinite(values[name]):
                    yield True, f"{name} is {values[name]} {at}"
                    return
            stiffness, damping = values["stiffness"], values["damping"]
            if stiffness <= 0.0 or damping < 0.0:
                limit = "stiffness must be positive, and damping not negative"
                yield True, f"stiffness is {stiffness:.3g} N/m and damping {damping:.3g} kg/s {at}: {limit}"
                return
            less, more = (self.evaluate(self.force, side * overlap, mass, radius, row) for side in (0.999, 1.001))
            slope = (more - less) / (0.002 * overlap)
            if stiffness < 0.5 * slope:
                effect = "the time step follows from stiffness"
                yield False, f"stiffness is {stiffness:.3g} N/m, but force rises by {slope:.3g} N/m {at}; {effect}"
                return

    def _known(self, mass: float, radius: float, row: Any) -> dict[str, Any]:
        """Arguments that do not change during an impact."""
        columns = {name: float(row[name]) for name in COLUMNS}
        return {**columns, "reduced_mass": mass, "reduced_radius": radius, **self.parameters}


def _asked(function: Callable[..., Any], values: Mapping[str, Any]) -> Any:
    """Value of a function that takes some of the known values by name."""
    taken = _arguments(function)
    if unknown := [name for name in taken if name not in values]:
        remedy = "declare another one in `parameters`, `memory` or `derived` of the law"
        raise InputError(f"argument of {function.__name__}", unknown[0], f"one of {', '.join(values)}", remedy)
    return function(**{name: values[name] for name in taken})


@cache
def _arguments(function: Callable[..., Any]) -> tuple[str, ...]:
    """Names of the arguments of a function of a law; looked up once, because a check asks thousands of times."""
    return tuple(signature(function).parameters)


def _first(reached: Callable[[float], bool], radius: float) -> float:
    """Smallest overlap at which a condition holds that stays true beyond; infinite above `FARTHEST` radii [m]."""
    low, high = math.log(1e-12 * radius), math.log(FARTHEST * radius)
    if not reached(math.exp(high)):
        return math.inf
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reached(math.exp(middle)) else (middle, high)
    return math.exp(high)


# ---------------------------------------------------------------- registry

CONTACTS: dict[str, ContactLaw] = {}
"""All contact laws that have been imported, by name."""


def register(law: ContactLaw) -> ContactLaw:
    """Make a contact law available by its name. Returns the law."""
    CONTACTS[law.name] = law
    return law


@cache
def load_contact_laws() -> None:
    """Import the built-in contact laws. Does not import numba.

    >>> load_contact_laws()
    >>> {"hertz", "jkr", "linear"} <= set(CONTACTS)
    True
    """
    for module in pkgutil.iter_modules([str(Path(__file__).parent / "contacts")]):
        import_module(f"{__package__}.contacts.{module.name}")


def all_contact_laws() -> Iterator[ContactLaw]:
    """All contact laws, those of installed packages included."""
    load_contact_laws()
    load_package_laws()
    yield from CONTACTS.values()


def contact_named(name: str) -> ContactLaw:
    """The contact law of a name, built-in, registered or of an installed package."""
    load_contact_laws()
    if name not in CONTACTS:
        load_package_laws()
    if name not in CONTACTS:
        remedy = "cfddem explain lists all laws; name the file of one of your own with --laws FILE.py"
        raise InputError("contact", shown(name), nearest(name, CONTACTS), remedy)
    return CONTACTS[name]
