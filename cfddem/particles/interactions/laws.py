"""The laws of a run: which ones the user has chosen, and what they put into the slots of the particle loops."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from inspect import signature
from typing import Any, NamedTuple

from cfddem.backend.errors import InputError, nearest
from cfddem.backend.law_choice import OF_THE_PAIR_LOOP, chosen
from cfddem.backend.law_set import bind_arguments, check_compiles, compile_source
from cfddem.backend.named import NAMES, can_be_named
from cfddem.model.fields import Field
from cfddem.particles.collision_events import FIELDS as RECORD_FIELDS
from cfddem.particles.interactions import bond, bridge, bridge_apart, contact, film, joint_films, shear_film
from cfddem.particles.interactions.bridge_law import NO_BRIDGES, BridgeLaws, NoBridges
from cfddem.particles.interactions.contact_law import COLUMNS, ContactLaw, Function, contact_named
from cfddem.particles.interactions.film_law import FilmLaw, built_in, gap_choices, range_check
from cfddem.particles.interactions.slots import ContactState, FilmState, GapState
from cfddem.particles.pair_graph import Graph
from cfddem.particles.system import Parameters, numbers
from closures.registry import REGISTRY

CHOICES = {
    "integrator": ("drift", "verlet"),
    "friction_onset": ("film", "overlap"),
    "spring": ("total", "rescaled"),
    "film_motions": ("normal", "full", "full_twist"),
    "rolling": ("none", "constant_torque", "spring_dashpot"),
}
"""Words that each choice may take."""


class Laws(NamedTuple):
    """Which laws hold between two particles.

    film                  there is a lubrication film
    integrator            "drift": films act by impulses, without a stability limit; "verlet": as an explicit force
    friction_onset        friction begins at h_min ("film") or at geometric overlap ("overlap")
    contact               name of a contact law, or a :class:`~cfddem.particles.interactions.contact_law.ContactLaw`
    spring                tangential force from the total displacement, or "rescaled" while the contact is loaded
    rolling               resistance to rolling: "none", "constant_torque" or "spring_dashpot"
    cutoff_ratio          reach of the film over R* [-]
    rolling_damping       of the rolling dashpot, over critical; 0.3 as in Ai et al. (2011) [-]
    minimum_gap           a user's law of the minimum gap; the built-in elastohydrodynamic one if not given
    lubrication           a user's film: its resistance, or a
                          :class:`~cfddem.particles.interactions.film_law.FilmLaw`; the built-in one if not given. A
                          registered law NAME resists sliding, too, where a law NAME_sliding is registered
    film_motions          motions that films resist: along the line of centres ("normal"), and sliding and rolling
                          ("full"), and twisting ("full_twist")
    film_tolerance        of the impulses of films that are solved together, over the first residual [-]
    bridge                laws of liquid bridges, where particles carry liquid
    """

    film: bool = False
    integrator: str = "drift"
    friction_onset: str = "film"
    contact: str | ContactLaw = "hertz"
    spring: str = "total"
    rolling: str = "none"
    cutoff_ratio: float = 1.0
    rolling_damping: float = 0.3
    minimum_gap: Callable[..., float] | None = None
    lubrication: Callable[..., float] | FilmLaw | None = None
    bridge: BridgeLaws | None = None
    film_motions: str = "normal"
    film_tolerance: float = 1e-3

    def dry(self) -> Laws:
        """The same laws without films and bridges."""
        return self._replace(film=False, minimum_gap=None, lubrication=None, bridge=None, film_motions="normal")

    def check(self) -> None:
        """Refuse unknown words, laws that cannot be compiled, and choices that exclude each other."""
        for name, words in CHOICES.items():
            value = getattr(self, name)
            if value not in words:
                raise InputError(name, value, nearest(str(value), words))
        check_contact_law(self.contact_law)
        if self.contact_law.adhesive and self.film:
            raise InputError("contact", self.contact_law.name, "a law without adhesion where there are films")
        if self.shears and not (self.film and self.integrator == "drift"):
            raise InputError(
                "film_motions", self.film_motions, '"normal" without films, and with the integrator "verlet"'
            )
        if self.film_motions == "full_twist" and self.slides_by_itself:
            limit, remedy = (
                '"full" for a film with its own resistance to sliding',
                "twisting is known for the built-in film",
            )
            raise InputError("film_motions", self.film_motions, limit, remedy)
        if not 0.0 < self.film_tolerance <= 1.0:
            raise InputError("film_tolerance", self.film_tolerance, "above 0 and at most 1")
        self.bridges.check()
        for kind in OF_THE_PAIR_LOOP:
            if (law := getattr(self, kind)) is None:
                continue
            if not self.film:
                name = getattr(law, "__name__", type(law).__name__)
                raise InputError(kind, name, "absent where there are no films", "take Laws(film=True)")
            if kind == "lubrication" and self.film_law is not None:
                self.film_law.check()
            else:
                check_compiles(f"laws.{kind}", chosen(kind, law).function)  # type: ignore[arg-type]

    @property
    def contact_law(self) -> ContactLaw:
        """The law of the normal contact."""
        return self.contact if isinstance(self.contact, ContactLaw) else contact_named(str(self.contact))

    @property
    def bridges(self) -> BridgeLaws | NoBridges:
        """The laws of liquid bridges, also where particles carry no liquid."""
        return NO_BRIDGES if self.bridge is None else self.bridge

    @property
    def shears(self) -> bool:
        """Whether films resist sliding and rolling."""
        return self.film_motions != "normal" or self.slides_by_itself

    @property
    def slides_by_itself(self) -> bool:
        """Whether a user's film has its own resistance to sliding."""
        return bool(self.film_law and self.film_law.sliding)

    @property
    def drifting(self) -> bool:
        """Whether films act by impulses."""
        return bool(self.film) and self.integrator == "drift"

    @property
    def joins(self) -> bool:
        """Whether there are films or bridges that are solved together."""
        return self.drifting or self.bridges.resists

    @property
    def apart(self) -> bool:
        """Whether closed bridges may resist by themselves; films of the same pairs, or with inertia, act with them."""
        return self.bridges.resists_evenly and not self.film

    @property
    def slides(self) -> bool:
        """Whether films or bridges resist sliding."""
        return self.shears or self.bridges.slides

    @property
    def film_law(self) -> FilmLaw | None:
        """The user's film law; None where the built-in one holds or there is no film."""
        if self.lubrication is None or isinstance(self.lubrication, FilmLaw):
            return self.lubrication
        law = chosen("lubrication", self.lubrication)
        sliding = REGISTRY["lubrication"].get(f"{law.name}_sliding")
        return FilmLaw(law.function, sliding=None if sliding is None else sliding.function)

    def parameters(
        self, gravity: tuple[float, float, float] = (0.0, 0.0, 0.0), free: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ) -> Parameters:
        """Numbers that the loops take.

        gravity  [m/s2]
        free     1 for each axis along which particles can move, else 0
        """
        return Parameters(
            gravity=_three(gravity),
            free=_three(free),
            cutoff_ratio=float(self.cutoff_ratio) if self.film else 0.0,
            film_tolerance=float(self.film_tolerance),
            rolling_damping=float(self.rolling_damping),
            contact=numbers(self.contact_law.parameters),
            bridge=self.bridges.numbers,
            bond=self.bridges.bond_numbers,
            bridge_functions=numbers(self.bridges.parameters),
        )

    def fields(self) -> list[Field]:
        """What pairs remember under these laws, and what the loops write for each pair."""
        fields = [*self.contact_fields, contact.TOUCHING]
        if self.film:
            fields += film.FIELDS
        if self.drifting:
            fields += joint_films.FIELDS
        if self.shears:
            fields += [*shear_film.FIELDS, *joint_films.SHEAR_FIELDS]
        if self.joins:
            fields += joint_films.JOINT_FIELDS
        if self.bridges.resists:
            fields += joint_films.BRIDGE_FIELDS
        if self.slides:
            fields += joint_films.SLIDING_FIELDS
        fields += self.bridges.fields
        if self.apart:
            fields += bridge_apart.FIELDS
        if self.minimum_gap is not None or self.lubrication is not None:
            fields.append(film.OUTSIDE)
        return fields

    @property
    def contact_fields(self) -> list[Field]:
        """What pairs remember of their contacts, and what the loop over contacts writes."""
        return [*contact.FIELDS, *self.contact_law.memory, *(contact.ROLLING_FIELDS if self.rolling != "none" else ())]

    def particle_fields(self) -> tuple[Field, ...]:
        """What particles remember under these laws, beyond the fields of every particle."""
        weak = joint_films.WEAK_PARTICLE_FIELDS if self.drifting else ()
        return (*self.bridges.particle_fields, *weak, *(joint_films.PARTICLE_FIELDS if self.joins else ()))

    @property
    def kept_apart(self) -> set[str]:
        """Fields that inactive triangles do not take over: one film and one bridge act, at the nearest of them."""
        return {"impulse", "shear_impulse", *self.bridges.kept_apart}

    def choices(self) -> dict[str, Any]:
        """What these laws put into the slots of the loops."""
        return _choices(self.contact_law, self._replace(contact="", film_tolerance=0.0))


def _three(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = values
    return float(x), float(y), float(z)


@lru_cache(maxsize=64)
def _choices(contact_law: ContactLaw, laws: Laws) -> dict[str, Any]:
    choices = {
        **contact_choices(contact_law),
        "FILM": bool(laws.film),
        "DRIFTING": laws.drifting,
        "JOINT": laws.joins,
        "SLIDES": laws.slides,
        "BRIDGE_RESISTS": laws.bridges.resists,
        "BRIDGE_APART": laws.apart,
        "RESCALED": laws.spring == "rescaled",
        "FROM_OVERLAP": laws.friction_onset == "overlap",
        "ROLLING": laws.rolling != "none",
        "rolling_torque": contact.ROLLINGS[laws.rolling],
        **(built_in() if laws.film else {}),
        **({"film_sliding": shear_film.built_in_sliding} if laws.shears else {}),
        "POTENTIAL": False,
        "SHEAR": laws.shears,
        "TWIST": laws.film_motions == "full_twist",
        "USER_GAP": laws.minimum_gap is not None,
        "COUNT_GAP": False,
        "COUNT_FILM": False,
        **laws.bridges.choices(),
    }
    if laws.minimum_gap is not None:
        entry = chosen("minimum_gap", laws.minimum_gap)
        choices |= gap_choices(entry.function)
        choices |= {"COUNT_GAP": bool(entry.ranges), "gap_outside": range_check("gap", GapState._fields, entry.ranges)}
    if (film_law := laws.film_law) is not None:
        choices |= film_law.choices()
        if not isinstance(laws.lubrication, FilmLaw):
            ranges = chosen("lubrication", laws.lubrication).ranges  # type: ignore[arg-type]
            choices |= {"COUNT_FILM": bool(ranges), "film_outside": range_check("film", FilmState._fields, ranges)}
    return choices


# ---------------------------------------------------------------- slots of a contact law
#
# A contact law as the particle loops call it: its functions, adapted to the slots of the loops.


ARGUMENTS = "contact, row, p, m, d"

TAKEN = {
    field.name
    for field in (
        *contact.FIELDS,
        contact.TOUCHING,
        *film.FIELDS,
        film.OUTSIDE,
        *shear_film.FIELDS,
        *contact.ROLLING_FIELDS,
        *RECORD_FIELDS,
    )
}
TAKEN |= {field.name for field in (*bridge.FIELDS, *bond.FIELDS)} | set(Graph._fields) | {"row", "wait"}
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
    choices = {slot: bind_arguments(function, ARGUMENTS, places) for slot, function in functions.items()}
    sources = {name: place for name, place in places.items() if name not in law.derived}
    parts = {
        f"law_{n}": bind_arguments(function, ARGUMENTS[:-3], sources) for n, function in enumerate(law.derived.values())
    }
    calls = "".join(f"{name}({ARGUMENTS[:-3]}), " for name in parts)
    choices["derive"] = compile_source(f"def derive({ARGUMENTS[:-3]}):\n    return ({calls})\n", **parts)
    if law.remember is None:
        choices["remember"] = compile_source(f"def remember({ARGUMENTS}):\n    return m\n")
    else:
        result = "({},)" if len(law.memory) == 1 else "{}"
        choices["remember"] = bind_arguments(law.remember, ARGUMENTS, places, result, len(law.memory))
    names = [field.name for field in law.memory]
    choices["read_memory"] = compile_source(
        f"def read_memory(memory, k):\n    return ({''.join(f'memory.{name}[k], ' for name in names)})\n"
    )
    choices["write_memory"] = compile_source(
        "def write_memory(memory, k, m, touching):\n"
        + "".join(f"    memory.{field.name}[k] = m[{n}] if touching else {float(field.initial)!r}\n"  # type: ignore[arg-type]
                  for n, field in enumerate(law.memory))
        + "    return\n",
        inf=math.inf, nan=math.nan,
    )  # fmt: skip
    return choices | {"DAMPING_MEAN": law.damping_mean, "ADHESIVE": law.adhesive}


def check_contact_law(law: ContactLaw) -> None:
    """Refuse functions that cannot be compiled, invalid parameters, and memory fields that loops cannot keep."""
    for name, value in law.parameters.items():
        if not can_be_named(name):
            raise InputError(f"parameter of the contact law {law.name!r}", name, NAMES)
        if not 0.0 <= value < math.inf:
            raise InputError(f"contact_parameters.{name}", value, "at least 0 and finite")
    for function in law.functions:
        if not function.__module__.startswith("cfddem."):
            check_compiles("laws.contact", function, len(law.memory) if function is law.remember else 1)
    for memory in law.memory:
        place = f"memory of the contact law {law.name!r}"
        if memory.components:
            raise InputError(place, memory.name, "one number", "declare a field for each component")
        if callable(memory.initial):
            raise InputError(place, memory.name, "a field whose initial value is a number")
        if memory.name in TAKEN:
            raise InputError(place, memory.name, "another name", "pairs have a field of this name")


def _places(law: ContactLaw) -> dict[str, str]:
    """Where loops have each argument."""
    return {
        **{name: f"row.{name}" for name in COLUMNS},
        **{name: f"contact.{name}" for name in ContactState._fields},
        **{name: f"p.contact.{name}" for name in law.parameters},
        **{field.name: f"m[{n}]" for n, field in enumerate(law.memory)},
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
