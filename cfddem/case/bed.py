"""The particles of a case: one kind or several species, their initial state, and the inlet flow."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from cfddem.backend.errors import InputError, shown
from cfddem.case.materials import Checked

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Point = tuple[float, float, float]
Sizes = tuple[tuple[Positive, Annotated[float, Field(ge=0)]], ...]
Size = tuple[NonNegative, NonNegative, NonNegative]
Name = Annotated[str, Field(pattern=r"^\w[\w-]*$", max_length=24)]

POURED_SOLID_FRACTION = 0.58
"""Solid fraction of a poured bed; converts a bed height to a number of particles and back [-]."""

_FRACTION_TOLERANCE = 1e-6
"""The fractions of a mixture add up to 1 within this [-]."""

InTime = float | tuple[tuple[float, float], ...]
"""A velocity: a number, or [time, velocity] pairs [s], [m/s]."""


def pairs_of(velocity: InTime) -> NDArray[np.float64]:
    """The [time, velocity] pairs of a velocity in time (n, 2); a number holds from 0 on [s], [m/s]."""
    return np.array([(0.0, velocity)] if isinstance(velocity, float) else velocity)


def at_times(velocity: InTime, times: NDArray[np.float64] | float) -> Any:
    """A velocity in time at some times [s], between its pairs by straight lines [m/s].

    >>> at_times(((0.0, 0.1), (2.0, 0.3)), [0.0, 1.0, 9.0]).tolist()
    [0.1, 0.2, 0.3]
    """
    return np.interp(times, *pairs_of(velocity).T)


def speeds_of(velocity: InTime) -> tuple[float, ...]:
    """Every value of a velocity in time [m/s]."""
    return tuple(pairs_of(velocity)[:, 1].tolist())


def check_times(name: str, velocity: InTime) -> None:
    """Raise InputError for a velocity whose times do not increase, or that has none."""
    times = [] if isinstance(velocity, float) else [time for time, _ in velocity]
    if velocity == () or sorted(set(times)) != times:
        raise InputError(name, None, "a number, or [time, velocity] pairs in increasing time")


class Jet(Checked):
    """A faster inlet through part of the floor."""

    velocity: float = Field(ge=0, description="superficial velocity, upward [m/s]")
    width: Positive = Field(description="width along x, or diameter of a round jet [m]")
    depth: Positive | None = Field(None, description="depth along y; default: the full depth of the column [m]")
    round: bool = Field(False, description="round instead of rectangular")

    def covers(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether it enters at places, from the middle of the floor (n,) [m]."""
        if self.round:
            return np.hypot(x, y) < 0.5 * self.width
        return (np.abs(x) < 0.5 * self.width) & (np.abs(y) < 0.5 * (self.depth or math.inf))


class Species(Checked):
    """Particles of one material with one size distribution."""

    material: str | None = Field(None, description="name of a [material.NAME] table; default: the only one")
    diameter: Positive = Field(
        0.0, description="diameter d, or its mean; the Sauter mean where sizes or species are given [m]"
    )
    spread: float = Field(0.0, ge=0, lt=0.5, description="standard deviation of the diameter over its mean [-]")
    distribution: Literal["normal", "log_normal"] = Field("normal", description="size distribution, with a spread")
    sizes: Sizes = Field(
        (), description="[diameter, volume share] pairs, as of sieve fractions, instead of a diameter [m, -]"
    )
    count: int | None = Field(None, gt=0, description="number of particles")

    @model_validator(mode="after")
    def _one_size_definition(self) -> Species:
        if self.sizes:
            for name in ("diameter", "spread"):
                if getattr(self, name):
                    raise InputError(name, getattr(self, name), "left out where sizes are given")
            if not sum(share for _, share in self.sizes) > 0.0:
                raise InputError("sizes", None, "a list with at least one volume share above 0")
            object.__setattr__(self, "diameter", self._sauter_of_sizes())
        elif self.diameter == 0.0 and not self._is_mixture:
            raise InputError("diameter", None, "given", "diameter is d, or its mean [m]")
        return self

    @model_serializer(mode="wrap")
    def _without_derived_values(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        values: dict[str, Any] = plain(self)
        if self.sizes or self._is_mixture:
            values.pop("diameter", None)
        return values

    @property
    def _is_mixture(self) -> bool:
        return False

    def mean_power(self, power: Literal[2, 3]) -> float:
        """Number mean of the diameter to a power [m2 or m3]."""
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
    def sauter_diameter(self) -> float:
        """Sauter mean diameter: that of spheres with the same ratio of volume to surface [m]."""
        return self.mean_power(3) / self.mean_power(2)

    def _sauter_of_sizes(self) -> float:
        try:
            return self.sauter_diameter
        except ArithmeticError:
            raise InputError("sizes", shown(self.sizes), "diameters of 1e-100 to 1e100 m") from None

    @property
    def smallest_diameter(self) -> float:
        """Approximate smallest diameter: the smallest size, or three standard deviations below the mean [m]."""
        if self.sizes:
            return min(d for d, share in self.sizes if share > 0.0)
        if self.distribution == "log_normal":
            return self.diameter * math.exp(-3.0 * math.sqrt(math.log1p(self.spread**2)))
        return self.diameter * max(0.1, 1.0 - 3.0 * self.spread)


class MixtureSpecies(Species):
    """One species of a mixture."""

    fraction: float | None = Field(
        None, gt=0, le=1, description="share of the total particle volume, instead of a count [-]"
    )


AT_RANDOM = ("packed", "expanded")
"""Starts with a random packing, which fills a box."""


class Bed(Species):
    """The particles, their initial state, and the inlet flow."""

    species: dict[Name, MixtureSpecies] = Field(
        {}, description="species of a mixture by name, each with material, diameter and count or fraction"
    )
    height: Positive | None = Field(None, description="height of the poured bed, instead of a count [m]")
    arrangement: Literal["mixed", "layers"] = Field(
        "mixed", description="initial arrangement of several species: mixed, or in layers with the first at the bottom"
    )
    start: Literal["poured", "suspended", "expanded", "packed", "placed"] = Field(
        "poured",
        description="initial state: poured to rest, spread evenly over the column, at random up to the height expected "
        "in the flow, at random over the column, or at `positions`",
    )
    positions: tuple[Point, ...] = Field(
        (), description='particle centres, for start = "placed", in the order of the species [m]'
    )
    start_corner: Point | None = Field(
        None, description="lower corner of the box in which the particles start; default: the column [m]"
    )
    start_size: tuple[Positive, Positive, Positive] | None = Field(None, description="edges of that box [m]")
    initial_velocity: Point = Field((0.0, 0.0, 0.0), description="velocity of all particles at the start [m/s]")
    fixed: bool = Field(False, description="particles do not move: a packed bed")
    seed: int = Field(1, ge=0, description="random seed; the same seed gives the same bed")
    inlet_velocity: InTime = Field(
        0.0, description="superficial velocity through the floor, upward: a number, or [time, velocity] pairs [m/s]"
    )
    jet: Jet | None = Field(None, description="faster inlet through part of the floor")

    @model_validator(mode="after")
    def _count_and_inlet(self) -> Bed:
        if self.species:
            self._check_mixture()
        else:
            names = [name for name in ("count", "height", "positions") if getattr(self, name)]
            if len(names) != 1:
                choices = " and ".join(names) if names else "none"
                raise InputError(
                    "count", self.count, "given, or height, or positions, and only one of them", f"found {choices}"
                )
        if (self.start_corner is None) != (self.start_size is None):
            name = "start_corner" if self.start_corner is None else "start_size"
            raise InputError(name, None, "given, because the other one is", "start_corner and start_size give a box")
        for name in ("height", "positions"):
            if self.start_size is not None and getattr(self, name):
                raise InputError(name, None, "left out where start_corner and start_size are given", "give a count")
        if self.positions and self.start == "poured":
            object.__setattr__(self, "start", "placed")
        if bool(self.positions) != (self.start == "placed"):
            if self.positions:
                remedy = 'leave out start, or set start = "placed"'
                raise InputError("positions", None, f'left out with start = "{self.start}"', remedy)
            remedy = "one centre [x, y, z] for each particle, or another start"
            raise InputError("positions", None, 'given with start = "placed"', remedy)
        check_times("inlet_velocity", self.inlet_velocity)
        if self.lowest_inlet_velocity < 0.0:
            raise InputError(
                "inlet_velocity", self.lowest_inlet_velocity, "at least 0", "the fluid enters through the floor"
            )
        return self

    @property
    def _is_mixture(self) -> bool:
        return bool(self.species)

    def _check_mixture(self) -> None:
        """Check that the species define the particles completely, and that nothing else does."""
        for name in ("material", "diameter", "spread", "distribution", "sizes", "count"):
            value = getattr(self, name)
            if value != type(self).model_fields[name].default:
                raise InputError(name, value, "left out where species are given", f"give bed.species.NAME.{name}")
        if self.start in AT_RANDOM and self.arrangement == "layers":
            where = f'mixed where start = "{self.start}"'
            raise InputError("arrangement", "layers", where, "a random packing has no layers")
        wanted, other = ("fraction", "count") if self.height else ("count", "fraction")
        for name, part in self.species.items():
            if getattr(part, wanted) is None:
                alternative = "leave out bed.height" if self.height else "give bed.height"
                raise InputError(f"species.{name}.{wanted}", None, "given", f"or give {other} and {alternative}")
            if getattr(part, other) is not None:
                beside = "given" if self.height else "left out"
                raise InputError(
                    f"species.{name}.{other}", getattr(part, other), f"left out where bed.height is {beside}",
                    f"give {wanted} instead",
                )  # fmt: skip
        number = sum(part.count or 0 for part in self.species.values())
        if self.positions and (self.height or len(self.positions) != number):
            raise InputError(
                "positions", len(self.positions), f"as many as the species count together, {number}",
                "one centre for each particle, in the order of the species",
            )  # fmt: skip
        total = sum(part.fraction or 0.0 for part in self.species.values())
        if self.height and abs(total - 1.0) > _FRACTION_TOLERANCE:
            raise InputError("species", None, "given with fractions that add up to 1", f"they add up to {total:.6g}")
        object.__setattr__(self, "diameter", self._sauter_of_mixture())

    def _sauter_of_mixture(self) -> float:
        """Sauter mean diameter of all species together [m]."""
        try:
            volumes = self.species_volumes(1.0)
            surfaces = sum(volume / self.species[name].sauter_diameter for name, volume in volumes.items())
            mean = sum(volumes.values()) / surfaces
        except ArithmeticError:
            mean = math.nan
        if not 0.0 < mean < math.inf:
            raise InputError("species", None, "given with diameters of 1e-100 to 1e100 m", "diameters are in m")
        return mean

    def species_volumes(self, total: float) -> dict[str, float]:
        """Particle volume of each species [m3].

        total  volume of all particles, for species that are given by fraction [m3]
        """
        return {
            name: part.fraction * total if part.fraction else (part.count or 0) * part.mean_volume
            for name, part in self.species.items()
        }

    @property
    def largest_diameter(self) -> float:
        """Diameter of the largest species, or of its largest size class [m]."""
        parts: list[Species] = list(self.species.values()) or [self]
        return max(max((d for d, _ in part.sizes), default=part.diameter) for part in parts)

    @property
    def lowest_inlet_velocity(self) -> float:
        """Lowest superficial velocity through the floor over time [m/s]."""
        return min(speeds_of(self.inlet_velocity))

    @property
    def highest_inlet_velocity(self) -> float:
        """Highest superficial velocity through the floor over time, without the jet [m/s]."""
        return max(speeds_of(self.inlet_velocity))

    @property
    def jets(self) -> tuple[Jet, ...]:
        """The jet, if there is one."""
        return (self.jet,) if self.jet else ()

    @property
    def fastest_inflow(self) -> float:
        """Highest superficial velocity over time through the floor or the jet, whichever is higher [m/s]."""
        return max(self.highest_inlet_velocity, *(jet.velocity for jet in self.jets), 0.0)


class CaseFeed(Checked):
    """A box in which particles appear at a constant rate."""

    corner: Point = Field(description="lower corner of the box in which centres appear [m]")
    size: Size = Field(description="edges of the box; an edge may be 0 [m]")
    rate: Positive | None = Field(None, description="particles per second [1/s]")
    mass_rate: Positive | None = Field(None, description="mass per second, instead of a rate [kg/s]")
    species: str | None = Field(None, description="species of the bed that is fed; needed for a mixture")
    velocity: Point = Field((0.0, 0.0, 0.0), description="velocity of particles that enter [m/s]")
    begin: NonNegative = Field(0.0, description="time at which the feed begins [s]")
    end: Positive | None = Field(None, description="time at which it ends; default: the end of the run [s]")

    @model_validator(mode="after")
    def _one_rate_and_a_span(self) -> CaseFeed:
        if (self.rate is None) == (self.mass_rate is None):
            how_many = "found none" if self.rate is None else "found both"
            raise InputError("rate", self.rate, "given, or mass_rate, and only one of them", how_many)
        if self.end is not None and self.end <= self.begin:
            raise InputError("end", self.end, f"after the beginning, {self.begin:g} s")
        return self


class CaseOutlet(Checked):
    """A box in which particles are removed and counted."""

    corner: Point = Field(description="lower corner of the box; a particle leaves when its centre is inside [m]")
    size: tuple[Positive, Positive, Positive] = Field(description="edges of the box [m]")
