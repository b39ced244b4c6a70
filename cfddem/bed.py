"""A bed: its particles, of one kind or of several species, how they start, and the flow that meets them."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from cfddem.errors import InputError
from cfddem.materials import Checked
from cfddem.mistakes import shown

Positive = Annotated[float, Field(gt=0)]
Point = tuple[float, float, float]
Sizes = tuple[tuple[Positive, Annotated[float, Field(ge=0)]], ...]

Name = Annotated[str, Field(pattern=r"^\w[\w-]*$", max_length=24)]

POURED_SOLID_FRACTION = 0.58
"""Solid fraction of a poured bed, by which a bed's height is turned into a number of particles, and back."""

_SAME = 1e-6
"""Fractions add up to one within this."""


class Jet(Checked):
    """A faster inlet through a part of the floor."""

    velocity: float = Field(ge=0, description="superficial, upward [m/s]")
    width: Positive = Field(description="along x; diameter of a round one [m]")
    depth: Positive | None = Field(None, description="along y; the whole depth if not given [m]")
    round: bool = Field(False, description="a round hole")


class Species(Checked):
    """Particles of one material whose sizes follow one distribution."""

    material: str | None = Field(None, description="name of a [material]; the only one if not given")
    diameter: Positive = Field(
        0.0, description="d; the mean where sizes differ, the Sauter mean where sizes or species say it [m]"
    )
    spread: float = Field(0.0, ge=0, lt=0.5, description="standard deviation of the diameter over its mean [-]")
    distribution: Literal["normal", "log_normal"] = Field("normal", description="of the diameters, with a spread")
    sizes: Sizes = Field((), description="instead of a diameter: list of [diameter, share of the volume] [m, -]")
    count: int | None = Field(None, gt=0, description="number of particles")

    @model_validator(mode="after")
    def _one_size(self) -> Species:
        if self.sizes:
            for name in ("diameter", "spread"):
                if getattr(self, name):
                    raise InputError(name, getattr(self, name), "left out where sizes are given")
            if not sum(share for _, share in self.sizes) > 0.0:
                raise InputError("sizes", None, "a list with a share of the volume above 0")
            object.__setattr__(self, "diameter", self._sauter_of_sizes())
        elif self.diameter == 0.0 and not self._is_mixture:
            raise InputError("diameter", None, "given", "diameter is d; the mean where sizes differ [m]")
        return self

    @model_serializer(mode="wrap")
    def _without_what_follows(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        values: dict[str, Any] = plain(self)
        if self.sizes or self._is_mixture:
            values.pop("diameter", None)
        return values

    @property
    def _is_mixture(self) -> bool:
        return False

    def mean_power(self, power: Literal[2, 3]) -> float:
        """Mean of the diameter to a power, over the number of particles [m2 or m3]."""
        if self.sizes:
            number = sum(share / d**3 for d, share in self.sizes)
            return sum(share * d ** (power - 3) for d, share in self.sizes) / number
        square = self.spread**2
        if self.distribution == "log_normal":
            return float(self.diameter**power * (1.0 + square) ** (power * (power - 1) // 2))
        return float(self.diameter**power * (1.0 + (power * (power - 1) // 2) * square))

    @property
    def mean_volume(self) -> float:
        """Mean volume of a particle [m3]."""
        return math.pi / 6.0 * self.mean_power(3)

    @property
    def sauter(self) -> float:
        """Sauter mean of the diameter: that of spheres with the same volume over surface [m]."""
        return self.mean_power(3) / self.mean_power(2)

    def _sauter_of_sizes(self) -> float:
        try:
            return self.sauter
        except ArithmeticError:
            raise InputError("sizes", shown(self.sizes), "a list of diameters whose cubes can be added up") from None

    @property
    def smallest(self) -> float:
        """About the smallest diameter [m]."""
        if self.sizes:
            return min(d for d, share in self.sizes if share > 0.0)
        if self.distribution == "log_normal":
            return self.diameter * math.exp(-3.0 * math.sqrt(math.log1p(self.spread**2)))
        return self.diameter * max(0.1, 1.0 - 3.0 * self.spread)


class Part(Species):
    """A species of a mixture."""

    fraction: float | None = Field(
        None, gt=0, le=1, description="share of the volume of all particles, instead of a number [-]"
    )


class Bed(Species):
    """The particles, how they start, and the flow that meets them."""

    species: dict[Name, Part] = Field({}, description="of a mixture, by name; each with material, diameter and number")
    height: Positive | None = Field(None, description="of the poured bed, instead of a number [m]")
    arrangement: Literal["mixed", "layers"] = Field(
        "mixed", description="of several species at the start: mixed, or one above the other, the first below"
    )
    start: Literal["poured", "suspended", "packed", "at"] = Field(
        "poured", description="at rest below, spread evenly, packed at random all over, or placed"
    )
    positions: tuple[Point, ...] = Field((), description='centres, for start = "at" [m]')
    velocity: Point = Field((0.0, 0.0, 0.0), description="of all particles at the start [m/s]")
    fixed: bool = Field(False, description="particles that nothing moves: a packed bed")
    seed: int = Field(1, ge=0, description="same seed, same bed")
    inlet_velocity: float | tuple[tuple[float, float], ...] = Field(
        0.0, description="superficial, upward; a number, or a list of [time, velocity] [m/s]"
    )
    jet: Jet | None = Field(None, description="a faster inlet through a part of the floor")

    @model_validator(mode="after")
    def _one_number_of_particles(self) -> Bed:
        if self.species:
            self._species_say_it_all()
        else:
            given = [name for name in ("count", "height", "positions") if getattr(self, name)]
            if len(given) != 1:
                found = " and ".join(given) if given else "none of them"
                raise InputError("count", self.count, "given, or height, or positions, and only one", f"here {found}")
        if self.positions and self.start == "poured":
            object.__setattr__(self, "start", "at")
        if not isinstance(self.inlet_velocity, float):
            times = [time for time, _ in self.inlet_velocity]
            if not times or sorted(set(times)) != times:
                raise InputError("inlet_velocity", None, "a number, or [time, velocity] pairs in the order of time")
        if self.slowest_inlet < 0.0:
            raise InputError("inlet_velocity", self.slowest_inlet, "at least 0", "the inlet is below, and flows upward")
        return self

    @property
    def _is_mixture(self) -> bool:
        return bool(self.species)

    def _species_say_it_all(self) -> None:
        """What species give must not stand beside them, and must be enough."""
        for name in ("material", "diameter", "spread", "distribution", "sizes", "count", "positions"):
            value = getattr(self, name)
            if value != type(self).model_fields[name].default:
                raise InputError(name, value, "left out where species are given", f"give bed.species.NAME.{name}")
        if self.start == "packed" and self.arrangement == "layers":
            raise InputError("arrangement", "layers", 'mixed where start = "packed"', "such a bed is mixed at random")
        wanted, other = ("fraction", "count") if self.height else ("count", "fraction")
        for name, part in self.species.items():
            if getattr(part, wanted) is None:
                other_way = "bed.height is left out" if self.height else "bed.height is given"
                raise InputError(f"species.{name}.{wanted}", None, "given", f"or {other}, where {other_way}")
            if getattr(part, other) is not None:
                beside = "given" if self.height else "left out"
                raise InputError(
                    f"species.{name}.{other}", getattr(part, other), f"left out where bed.height is {beside}",
                    f"give {wanted} instead",
                )  # fmt: skip
        total = sum(part.fraction or 0.0 for part in self.species.values())
        if self.height and abs(total - 1.0) > _SAME:
            raise InputError("species", None, "given with fractions that add up to 1", f"here to {total:.6g}")
        object.__setattr__(self, "diameter", self._sauter_of_all())

    def _sauter_of_all(self) -> float:
        """Sauter mean of the diameters of all species [m]."""
        try:
            volumes = self.volumes(1.0)
            surfaces = sum(volume / self.species[name].sauter for name, volume in volumes.items())
            mean = sum(volumes.values()) / surfaces
        except ArithmeticError:
            mean = math.nan
        if not 0.0 < mean < math.inf:
            raise InputError("species", None, "given with diameters whose cubes can be added up", "they are in m")
        return mean

    def volumes(self, whole: float) -> dict[str, float]:
        """Volume of the particles of each species [m3].

        whole  of all particles, where the species give fractions [m3]
        """
        return {
            name: part.fraction * whole if part.fraction else (part.count or 0) * part.mean_volume
            for name, part in self.species.items()
        }

    @property
    def largest(self) -> float:
        """Diameter of the largest species, or its largest class of sizes [m]."""
        parts: list[Species] = list(self.species.values()) or [self]
        return max(max((d for d, _ in part.sizes), default=part.diameter) for part in parts)

    @property
    def slowest_inlet(self) -> float:
        """Superficial velocity through the floor, the smallest in time [m/s]."""
        inlet = self.inlet_velocity
        return inlet if isinstance(inlet, float) else min(speed for _, speed in inlet)

    @property
    def floor_speed(self) -> float:
        """Superficial velocity through the floor, the largest in time [m/s]."""
        inlet = self.inlet_velocity
        return inlet if isinstance(inlet, float) else max(speed for _, speed in inlet)

    @property
    def inlet_speed(self) -> float:
        """Superficial velocity through the floor or its jet, whichever is faster [m/s]."""
        return max(self.floor_speed, 0.0 if self.jet is None else self.jet.velocity)
