"""The laws of liquid bridges: which ones the user has chosen, and what they put into the slots of the loops.

Each law is a word or a function of named arguments: gap, film, volume, reduced_radius, minimum_gap, viscosity,
surface_tension, contact_angle, capillary_number, and the user's own `parameters`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

from cfddem.backend.errors import InputError, nearest, shown
from cfddem.backend.law_set import bind_arguments, check_compiles
from cfddem.backend.named import can_be_named
from cfddem.model.fields import Field
from cfddem.particles.collision_events import COLLISION_FIELDS, WET_COLLISION_FIELDS, WET_FIELDS
from cfddem.particles.interactions import bond as solid_bond
from cfddem.particles.interactions.bond import BondLaw
from cfddem.particles.interactions.bridge import FIELDS, INERTIA_FIELDS, PARTICLE_FIELDS
from cfddem.particles.interactions.slots import BridgeState
from cfddem.particles.system import numbers
from closures import bridge, capillary, capillary_pull, rupture
from closures.lubrication import film_strength
from closures.registry import load_package_laws

Function = Callable[..., float]


@dataclass(frozen=True)
class BridgeFilm:
    """Resistance of a bridge along the line of centres.

    resistance  force per rate of the gap [kg/s]
    potential   its integral over the gap, as a function of the gap; Gauss' rule integrates if not given [N s]
    """

    resistance: Function
    potential: Function | None = None


@dataclass(frozen=True)
class BridgePull:
    """Attraction of a bridge.

    force   as a function of the gap [N]
    energy  its integral over the gap, from contact; Gauss' rule integrates if not given [J]
    """

    force: Function
    energy: Function | None = None


def _static(gap: float, film: float, viscosity: float, reduced_radius: float) -> float:
    return film_strength(viscosity, reduced_radius) * bridge.static_share(gap, film) / gap


def _static_potential(gap: float, film: float, viscosity: float, reduced_radius: float) -> float:
    return film_strength(viscosity, reduced_radius) * bridge.static_potential(gap, film)


def _deforming(gap: float, film: float, viscosity: float, reduced_radius: float) -> float:
    return film_strength(viscosity, reduced_radius) * bridge.deforming_share(gap, film) / gap


def _deforming_potential(gap: float, film: float, viscosity: float, reduced_radius: float) -> float:
    return film_strength(viscosity, reduced_radius) * bridge.deforming_potential(gap, film)


def _pitois(gap: float, volume: float, viscosity: float, reduced_radius: float) -> float:
    if volume == 0.0:
        return 0.0
    return film_strength(viscosity, reduced_radius) * bridge.pitois_share(gap, reduced_radius, volume) / gap


def _pitois_potential(gap: float, volume: float, viscosity: float, reduced_radius: float) -> float:
    if volume == 0.0:
        return 0.0
    return film_strength(viscosity, reduced_radius) * bridge.pitois_potential(gap, reduced_radius, volume)


def _constant(gap: float, film: float, surface_tension: float, reduced_radius: float) -> float:
    return bridge.constant_capillary(surface_tension, reduced_radius) if gap < film else 0.0


def _constant_energy(gap: float, film: float, surface_tension: float, reduced_radius: float) -> float:
    return bridge.constant_capillary(surface_tension, reduced_radius) * min(gap, film)


def _separation_of_films(film: float) -> float:
    return film


def _nothing(radius: float, other_radius: float) -> float:
    return 0.0


def _half(radius: float, other_radius: float) -> float:
    return 0.5


FILMS: dict[str, BridgeFilm | None] = {
    "none": None,
    "static": BridgeFilm(_static, _static_potential),
    "deforming": BridgeFilm(_deforming, _deforming_potential),
    "pitois": BridgeFilm(_pitois, _pitois_potential),
}
CUTS = ("zero", "constant")
TANGENTIALS: dict[str, Function | None] = {
    "none": None,
    "davis": bridge.davis_tangential,
    "nase": bridge.nase_tangential,
}
PULLS: dict[str, BridgePull | None] = {
    "none": None,
    "pendular": BridgePull(capillary.pendular_pull, capillary.pendular_energy),
    "willett": BridgePull(capillary_pull.willett_pull, capillary_pull.willett_energy),
    "rabinovich": BridgePull(capillary_pull.rabinovich_pull, capillary_pull.rabinovich_energy),
    "lambert": BridgePull(capillary_pull.lambert_pull, capillary_pull.lambert_energy),
    "constant": BridgePull(_constant, _constant_energy),
}
RUPTURES: dict[str, Function] = {
    "capillary": capillary.rupture_length,
    "lian": rupture.lian_rupture,
    "willett": rupture.willett_rupture,
    "film": _separation_of_films,
}
SHARES: dict[str, Function] = {"shi_mccarthy": capillary.liquid_share, "none": _nothing}
REDISTRIBUTIONS: dict[str, Function] = {
    "half": _half,
    "radius": rupture.share_by_radius,
    "contact_angle": rupture.share_by_contact_angle,
}

_WORDS: dict[str, dict[str, Any]] = {
    "film": FILMS,
    "tangential": TANGENTIALS,
    "pull": PULLS,
    "rupture": RUPTURES,
    "share": SHARES,
    "redistribution": REDISTRIBUTIONS,
}

_BUILT_IN = {kind: tuple(words) for kind, words in _WORDS.items()}


def register(kind: str, name: str, law: Function | BridgeFilm | BridgePull) -> None:
    """Make a user's law available by a name, in `BridgeLaws` and in the table [liquid] of a case.

    kind  "film", "tangential", "pull", "rupture", "share" or "redistribution"
    """
    if kind not in _WORDS:
        raise InputError("kind", kind, nearest(kind, _WORDS))
    if name in _BUILT_IN[kind]:
        raise InputError("name", name, f"a name that no built-in law of the kind {kind!r} has")
    _WORDS[kind][name] = law


def require_bridge_law(kind: str, name: str) -> None:
    """Refuse a name that no law of a kind has: built-in, registered, or of an installed package."""
    if name not in _WORDS[kind]:
        load_package_laws()
    if name not in _WORDS[kind]:
        raise InputError(kind, shown(name), nearest(name, _WORDS[kind]))


class BridgeNumbers(NamedTuple):
    """Numbers of the laws, as compiled loops take them."""

    viscosity: float  # [Pa s]
    surface_tension: float  # [N/m]
    contact_angle: float  # [rad]
    wall_contact_angle: float  # [rad]
    minimum_gap: float  # [m]
    transition_pressure: float  # [Pa]
    wall_share: float  # [-]
    wall_film: float  # [m]
    wall_patch: float  # [m]
    film_density: float  # [kg/m3]


@dataclass(frozen=True)
class BridgeLaws:
    """Laws of liquid bridges, an argument of :class:`~cfddem.particles.interactions.laws.Laws`.

    viscosity            of the liquid; it also lengthens bridges that part fast [Pa s]
    surface_tension      [N/m]
    contact_angle        [rad]
    film                 resistance along the line of centres: "none", "static", "deforming", "pitois", or a
                         function
    cut                  that resistance below h_min: "zero", or "constant" as at h_min
    tangential           resistance to sliding: "none", "davis", "nase", or a function
    pull                 attraction: "none", "pendular", "willett", "rabinovich", "lambert", "constant", or a function
    rupture              gap at which the bridge breaks, not below that at which it formed: "capillary" by its volume
                         and speed, "lian" or "willett" by its volume, "film" where the films separate, or a function
    share                part of a body's liquid that flows into a new bridge: "shi_mccarthy", "none", or a function of
                         radius and other_radius
    film_density         of the liquid: the added mass of the film is reversed with the bodies; 0 for a film
                         without inertia [kg/m3]
    wall_contact_angle   on walls, for the redistribution "contact_angle"; as on particles if not given [rad]
    redistribution       part of a broken bridge that a body gets: "half", "radius" by the radii, "contact_angle" by
                         the cosines of the contact angles, or a function
                         of radius and other_radius
    minimum_gap          h_min, at least [m]
    transition_pressure  at which the liquid turns to glass, which sets h_min [Pa]
    wall_share           part of the liquid on a wall, below a particle, that flows into a new bridge; 0 for walls that
                         take no liquid [-]
    wall_film            thickness of the liquid on the walls at the start [m]
    wall_patch           edge of the patches of wall whose liquid is counted, for instance a particle diameter [m]
    dries                bridges lose water to evaporation, and break where none is left
    bond                 what dry bridges between particles leave; nothing if not given
    parameters           numbers of a user's functions, by name: another value compiles nothing anew
    """

    viscosity: float = 0.0
    surface_tension: float = 0.0
    contact_angle: float = 0.0
    film: str | Function | BridgeFilm = "none"
    cut: str = "zero"
    tangential: str | Function = "none"
    pull: str | Function | BridgePull = "pendular"
    rupture: str | Function = "capillary"
    share: str | Function = "shi_mccarthy"
    redistribution: str | Function = "half"
    minimum_gap: float = 0.0
    transition_pressure: float = math.inf
    wall_share: float = 0.0
    wall_film: float = 0.0
    wall_patch: float = 0.0
    film_density: float = 0.0
    wall_contact_angle: float | None = None
    dries: bool = False
    bond: BondLaw | None = None
    parameters: Mapping[str, float] = field(default_factory=dict, hash=False)

    def check(self) -> None:
        """Refuse values that no liquid has, unknown words, and functions that cannot be compiled."""
        for name in ("viscosity", "surface_tension", "minimum_gap", "wall_film", "wall_patch", "film_density"):
            if not 0.0 <= (value := getattr(self, name)) < math.inf:
                raise InputError(name, value, "at least 0 and finite")
        for name in ("contact_angle", "wall_contact_angle"):
            if (angle := getattr(self, name)) is not None and not 0.0 <= angle <= math.pi:
                raise InputError(name, angle, "0 to pi")
        if not self.transition_pressure > 0.0:
            raise InputError("transition_pressure", self.transition_pressure, "above 0")
        if self.bond is not None:
            self.bond.check()
            if not self.dries:
                raise InputError("bond", None, "left out where bridges do not dry", "take dries=True")
        if not 0.0 <= self.wall_share <= 1.0:
            raise InputError("wall_share", self.wall_share, "0 to 1")
        if self.wall_share == 0.0 and self.wall_film > 0.0:
            raise InputError("wall_share", 0.0, "above 0 where walls have a film")
        if self.wall_share > 0.0 and self.wall_patch == 0.0:
            raise InputError("wall_patch", 0.0, "above 0 where walls carry liquid", "take a particle diameter")
        if self.film_density > 0.0 and self.film == "none":
            raise InputError("film_density", self.film_density, "0 without a film", 'or choose film = "deforming"')
        for name, value in self.parameters.items():
            if name in BridgeState._fields or not can_be_named(name) or not math.isfinite(value):
                raise InputError(f"parameters.{name}", value, "a finite number with a name of its own")
        if self.cut not in CUTS:
            raise InputError("cut", self.cut, nearest(str(self.cut), CUTS))
        if self.share == "none" and isinstance(self.pull, str) and self.pull not in ("none", "constant"):
            raise InputError(
                "share", "none", f"a law that fills bridges: the pull {self.pull!r} follows from the volume"
            )
        if self.share == "none" and self.film == "pitois":
            raise InputError("share", "none", "a law that fills bridges: the film 'pitois' follows from the volume")
        for name in _WORDS:
            law = getattr(self, name)
            if isinstance(law, str):
                require_bridge_law(name, law)
        for name, function in self._functions().items():
            check_compiles(f"laws.bridge.{name}", function)

    collision_memory, collision_fields = WET_FIELDS, WET_COLLISION_FIELDS
    kept_apart = frozenset(field.name for field in (*FIELDS, *INERTIA_FIELDS, *solid_bond.FIELDS))

    @property
    def particle_fields(self) -> tuple[Field, ...]:
        """What particles remember."""
        return (*PARTICLE_FIELDS, *(solid_bond.PARTICLE_FIELDS if self.bond else ()))

    @property
    def fields(self) -> tuple[Field, ...]:
        """What pairs remember of their bridges."""
        bonds = solid_bond.FIELDS if self.bond else ()
        return (*FIELDS, *(INERTIA_FIELDS if self.film_density > 0.0 else ()), *bonds)

    @property
    def pulling(self) -> tuple[str, ...]:
        """Fields of pairs on which pull and stiffness depend."""
        bonds = ("bridge_solid", "bond_radius") if self.bond else ()
        return ("bridge_film", "bridge_volume", "bridge_gap", *bonds)

    @property
    def bond_numbers(self) -> Any:
        """The numbers of bonds."""
        return self.bond.numbers if self.bond else numbers({})

    @property
    def slides(self) -> bool:
        """Whether bridges resist sliding."""
        return self._law("tangential") is not None

    @property
    def resists(self) -> bool:
        """Whether bridges resist any motion."""
        return self.slides or self._law("film") is not None

    @property
    def resists_evenly(self) -> bool:
        """Whether closed bridges resist alike at any gap, without inertia."""
        return self.resists and self.cut == "constant" and self.film_density == 0.0

    @property
    def numbers(self) -> BridgeNumbers:
        """The numbers of all laws."""
        on_walls = self.contact_angle if self.wall_contact_angle is None else self.wall_contact_angle
        values = {name: getattr(self, name) for name in BridgeNumbers._fields} | {"wall_contact_angle": on_walls}
        return BridgeNumbers(**{name: float(value) for name, value in values.items()})

    def choices(self) -> dict[str, Any]:
        """What these laws put into the slots of the loops."""
        of_bridge = {name: f"bridge.{name}" for name in BridgeState._fields[:-1]}
        of_bridge |= {name: f"bridge.functions.{name}" for name in self.parameters}
        of_radii = {name: name for name in ("radius", "other_radius")}
        of_angles = {name: name for name in ("contact_angle", "other_contact_angle")}
        choices: dict[str, Any] = {
            "BRIDGE": True,
            "DRYING": self.dries,
            "BOND": self.bond is not None,
            "CUT_CONSTANT": self.cut == "constant",
            "WALL_LIQUID": self.wall_share > 0.0,
        }
        for slot, function in self._functions().items():
            if slot == "drawn_share":
                choices[slot] = bind_arguments(function, "radius, other_radius", of_radii)
            elif slot == "returned_share":
                choices[slot] = bind_arguments(function, ", ".join(of_radii | of_angles), of_radii | of_angles)
            else:
                choices[slot] = bind_arguments(function, "bridge", of_bridge)
        return choices | {
            "BRIDGE_FILM": "bridge_resistance" in choices,
            "BRIDGE_INERTIA": self.film_density > 0.0,
            "BRIDGE_SLIDING": "sliding_resistance" in choices,
            "BRIDGE_PULL": "bridge_pull" in choices,
            "BRIDGE_POTENTIAL": "bridge_potential" in choices,
            "BRIDGE_ENERGY": "bridge_energy" in choices,
        }

    def _functions(self) -> dict[str, Function]:
        """Slot -> function."""
        film, pull = self._law("film"), self._law("pull")
        film = BridgeFilm(film) if callable(film) else film
        pull = BridgePull(pull) if callable(pull) else pull
        named = {
            "bridge_resistance": film and film.resistance,
            "bridge_potential": film and film.potential,
            "sliding_resistance": self._law("tangential"),
            "bridge_pull": pull and pull.force,
            "bridge_energy": pull and pull.energy,
            "bridge_rupture": self._law("rupture"),
            "drawn_share": self._law("share"),
            "returned_share": self._law("redistribution"),
        }
        return {slot: function for slot, function in named.items() if function is not None}

    def _law(self, name: str) -> Any:
        law = getattr(self, name)
        return _WORDS[name][law] if isinstance(law, str) else law


class NoBridges:
    """Laws of a run whose particles carry no liquid, with what the machine asks of :class:`BridgeLaws`.

    particle_fields   what particles remember
    fields            what pairs remember
    kept_apart        those fields that inactive triangles of a mesh do not take over
    pulling           fields of pairs on which the pull depends
    collision_memory  what pairs remember of a recorded collision, beyond the memory without liquid
    collision_fields  columns of the record of collisions
    resists, slides   there are no bridges that do; nor such as resist evenly
    """

    particle_fields: tuple[Field, ...] = ()
    fields: tuple[Field, ...] = ()
    kept_apart: frozenset[str] = frozenset()
    pulling: tuple[str, ...] = ()
    collision_memory: tuple[Field, ...] = ()
    collision_fields = COLLISION_FIELDS
    wall_share = 0.0
    resists = slides = resists_evenly = False
    parameters: Mapping[str, float] = {}
    numbers = numbers({})
    bond_numbers = numbers

    def check(self) -> None:
        """Nothing can be wrong."""

    def choices(self) -> dict[str, Any]:
        """What a run without liquid puts into the slots of the loops."""
        absent = ("BRIDGE", "BRIDGE_FILM", "BRIDGE_INERTIA", "BRIDGE_SLIDING", "DRYING", "BOND")
        return dict.fromkeys(absent, False)


NO_BRIDGES = NoBridges()

assert {*BridgeNumbers._fields} <= {field.name for field in fields(BridgeLaws)}
