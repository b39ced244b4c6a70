"""A case: what is to be run, described once, checked when it is made, and never changed.

The same words stand in Python and in TOML. A case is data; reading one executes nothing. What a case leads to,
walls, boundaries, particles, is built by :mod:`cfddem.assembly`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError, ValidationInfo, field_validator, model_validator

from cfddem.bed import POURED_SOLID_FRACTION, Bed, Point, Positive, Species
from cfddem.case_text import parsed, put, read_text
from cfddem.chosen_laws import BUILT_IN, chosen
from cfddem.errors import InputError, nearest
from cfddem.materials import Checked, Fluid, Material
from cfddem.mistakes import Key, described, key_lines, line_of, refused, shown
from closures.law import Law


class Column(Checked):
    """The vessel and its grid: a box, or a round column that stands in one."""

    shape: Literal["box", "cylinder"] = Field("box", description="box or cylinder, upright")
    width: Positive = Field(description="along x; diameter of a cylinder [m]")
    depth: Positive | None = Field(None, description="along y; as wide as it is if not given [m]")
    height: Positive = Field(description="along z [m]")
    cell: Positive | tuple[Positive, Positive, Positive] = Field(description="edge of a cell, or three [m]")
    sides: Literal["no_slip", "free_slip", "periodic"] = Field("no_slip", description="what the fluid meets sideways")
    front: Literal["no_slip", "free_slip", "periodic"] | None = Field(
        None, description="the two sides normal to y, where they differ from the others"
    )
    ends: Literal["flow", "closed", "periodic"] = Field("flow", description="inlet below and outlet above, or not")
    material: str | None = Field(None, description="of the walls; that of the bed if not given")

    @property
    def size(self) -> Point:
        """Edges of the box (x, y, z) [m]."""
        return self.width, self.width if self.depth is None else self.depth, self.height

    @property
    def floor_area(self) -> float:
        """Area of the floor [m2]."""
        width, depth, _ = self.size
        return 0.25 * math.pi * width**2 if self.shape == "cylinder" else width * depth

    @model_validator(mode="after")
    def _round_columns_have_a_side(self) -> Column:
        if self.shape == "cylinder":
            if self.depth not in (None, self.width):
                raise InputError(
                    "depth", self.depth, "left out, or equal to width", "the width of a cylinder is its diameter"
                )
            if self.sides == "periodic":
                raise InputError("sides", self.sides, "no_slip or free_slip", "the side of a cylinder is a wall")
            if self.front is not None:
                raise InputError("front", self.front, "left out", "a cylinder has one side")
        return self


class CaseLaws(Checked):
    """Which laws hold."""

    drag: str | Callable[..., float] | None = Field("di_felice", description="name of a drag law, or a law")
    model: Literal["A", "B"] = Field("A", description="who carries the pressure gradient")
    lubrication: str | Callable[..., float] = Field(
        "nijssen", description="the film between two close spheres: nijssen, none, a law's name, or a law"
    )
    minimum_gap: str | Callable[..., float] = Field(
        "elastohydrodynamic", description="how close a film lets solids come, if not to their asperities: name, or law"
    )
    contact: Literal["hertz", "linear"] = Field("hertz", description="normal contact")
    normal_stiffness: float = Field(0.0, ge=0, description="of the linear contact [N/m]")
    tangential_stiffness: float = Field(0.0, ge=0, description="of the linear contact [N/m]")
    friction_onset: Literal["film", "overlap"] = Field("film", description="where friction sets in")
    rolling: Literal["free", "constant_torque", "spring_dashpot"] = Field(
        "free", description="what resists rolling, by the rolling_friction of the materials"
    )
    rolling_damping: float = Field(0.3, ge=0, description="of the rolling dashpot, over critical [-]")
    cohesion: Literal["none", "jkr"] = Field(
        "none", description="what holds dry solids together, by their surface_energy; not where there are films"
    )
    added_mass: float = Field(0.0, ge=0, description="coefficient C_m of C_m rho V; 0.5 for a sphere alone [-]")
    lift: bool = Field(False, description="lift of shear (Saffman-Mei) and of spin (Magnus)")
    torque: bool = Field(False, description="torque of the fluid against spin")
    viscous_stress: bool = Field(False, description="V div(tau) on particles, in model A")
    mapping: Literal["linear", "centroid", "divided"] = Field("linear", description="how particles fill cells")
    smoothing: float = Field(1.5, ge=0, description="standard deviation of the kernel over the mean diameter [-]")
    own_wind: bool = Field(True, description="take out the wind that a lone particle makes itself")
    convection: Literal["limited", "central"] = Field("limited", description="scheme of the fluid")
    gravity: Point = Field((0.0, 0.0, -9.81), description="g [m/s2]")

    @field_validator("drag", "minimum_gap", "lubrication")
    @classmethod
    def _laws_are_on_the_shelf(cls, value: Any, about: ValidationInfo) -> Any:
        kind = about.field_name or ""
        if value not in BUILT_IN.get(kind, ()) and (isinstance(value, str) or kind != "drag"):
            chosen(kind, value)
        return value

    @property
    def drag_law(self) -> Law | None:
        """The drag law, with its range and source; None where there is no drag."""
        return None if self.drag is None or self.drag in BUILT_IN["drag"] else chosen("drag", self.drag)

    @property
    def pair_laws(self) -> dict[str, Law]:
        """The laws that take the place of those built into the pair loop, by their kind."""
        given = {kind: getattr(self, kind) for kind in ("minimum_gap", "lubrication")}
        return {kind: chosen(kind, law) for kind, law in given.items() if law not in BUILT_IN[kind]}

    def drag_function(self, diameter_ratio: float = 1.0) -> Callable[[float, float], float] | None:
        """The drag law of a sphere by Reynolds number and voidage, among others of a Sauter mean; None without drag.

        diameter_ratio  diameter over that mean, for laws that ask for it [-]
        """
        law = self.drag_law
        if law is None or "diameter_ratio" not in signature(law.function).parameters:
            return None if law is None else law.function
        function = law.function

        @wraps(function)
        def of_this_size(reynolds: float, voidage: float) -> float:
            return function(reynolds, voidage, diameter_ratio)

        return of_this_size


class CaseRun(Checked):
    """How long, how often, how finely."""

    until: Positive = Field(description="end of the run [s]")
    every: Positive | None = Field(None, description="between snapshots; a fiftieth of the run if not given [s]")
    history_every: Positive | None = Field(None, description="between rows of history; a tenth of `every` [s]")
    average_from: float | None = Field(None, ge=0, description="begin of means; half of the run if not given [s]")
    step: Positive | None = Field(None, description="of the particles; 2 % of the Hertz time if not given [s]")
    fluid_step: Positive | None = Field(None, description="largest of the fluid; by its clocks if not given [s]")
    reference_speed: Positive | None = Field(
        None, description="fastest collision expected; estimated if not given [m/s]"
    )
    energy: bool = Field(False, description="keep the energy ledger, by channel; a run takes up to half as long again")
    collisions: bool = Field(False, description="record every encounter of two bodies, from first to last touch")


class Case(Checked):
    """A run, described.

    >>> case = Case(
    ...     fluid=dict(density=998.0, viscosity=1e-3),
    ...     material=dict(glass=dict(density=2540.0, youngs_modulus=60e9, poisson=0.23, friction=0.4)),
    ...     column=dict(width=0.02, height=0.12, cell=0.005),
    ...     bed=dict(diameter=2e-3, count=2000, inlet_velocity=0.05),
    ...     run=dict(until=2.0),
    ... )
    >>> case.solid.density
    2540.0
    """

    title: str = Field("", description="one line")
    fluid: Fluid | None = Field(None, description="left out: dry particles, poured and left alone")
    material: dict[str, Material] = Field(min_length=1, description="solids by name")
    column: Column
    bed: Bed
    laws: CaseLaws = CaseLaws.model_validate({})
    run: CaseRun

    @field_validator("title")
    @classmethod
    def _title_is_a_line(cls, value: str) -> str:
        if not value.isprintable() or len(value) > 200:
            raise InputError("title", value, "one line of at most 200 printable characters")
        return value

    @model_validator(mode="after")
    def _names_are_known(self) -> Case:
        named = {f"bed.species.{name}": each.material for name, each in self.bed.species.items()}
        for mistake in _unknown_names(list(self.material), named or {"bed": self.bed.material}, self.column.material):
            raise mistake
        return self

    @property
    def species(self) -> dict[str, Species]:
        """What the particles are, by name: the species of a mixture, or the bed, by the name of its material."""
        only = next(iter(self.material))
        return dict(self.bed.species) or {self.bed.material or only: self.bed}

    def material_of(self, species: Species) -> Material:
        """Material of the particles of a species."""
        return self.material[species.material or next(iter(self.material))]

    @property
    def solid(self) -> Material:
        """Material of the particles, where all are of one.

        Raises InputError for a mixture.
        """
        if self.bed.species:
            raise InputError("bed.species", None, "left out: this needs a bed of one material")
        return self.material_of(self.bed)

    @property
    def counts(self) -> dict[str, int]:
        """Number of particles of each species: given, or what a poured bed of the given height holds."""
        bed = self.bed
        if bed.height is None:
            return {name: each.count or len(bed.positions) for name, each in self.species.items()}
        solids = POURED_SOLID_FRACTION * self.column.floor_area * bed.height
        shares = bed.volumes(solids) or dict.fromkeys(self.species, solids)
        return {name: int(shares[name] / each.mean_volume) for name, each in self.species.items()}

    @property
    def volumes(self) -> dict[str, float]:
        """Volume of the particles of each species [m3]."""
        return {name: count * self.species[name].mean_volume for name, count in self.counts.items()}

    @property
    def solid_density(self) -> float:
        """Mean density of the particles, by their volume [kg/m3]."""
        volumes, species = self.volumes, self.species
        mass = sum(volume * self.material_of(species[name]).density for name, volume in volumes.items())
        return mass / sum(volumes.values())

    @property
    def has_films(self) -> bool:
        """Is there a film between two close spheres?"""
        return self.fluid is not None and self.fluid.viscosity > 0.0 and self.laws.lubrication != "none"

    @property
    def particle_count(self) -> int:
        """Number of all particles."""
        return sum(self.counts.values())

    @property
    def reference_speed(self) -> float:
        """Fastest collision to be expected [m/s]: given, or twice the inlet velocity, or a fall of a diameter."""
        if self.run.reference_speed is not None:
            return self.run.reference_speed
        fall = math.sqrt(math.hypot(*self.laws.gravity) * self.bed.largest)
        return max(2.0 * self.bed.inlet_speed, fall, math.hypot(*self.bed.velocity))

    @classmethod
    def from_toml(cls, path: str | Path, overrides: Mapping[str, Any] | None = None) -> Case:
        """Read a case from a TOML file.

        overrides  {"bed.inlet_velocity": 0.06, ...}, in the place of what the file says

        Raises InputError, naming all mistakes with file, line, key, value and limit.
        """
        return cls.from_text(read_text(Path(path)), str(path), overrides)

    @classmethod
    def from_text(cls, text: str, name: str = "case", overrides: Mapping[str, Any] | None = None) -> Case:
        """Read a case from the text of a TOML file; `name` is what errors call it."""
        values = parsed(text, name)
        for key, value in (overrides or {}).items():
            put(values, key.split("."), value, key)
        try:
            return cls.model_validate(values)
        except ValidationError as refusal:
            lines, given = key_lines(text), {tuple(key.split(".")) for key in overrides or {}}

            def place(key: Key) -> str:
                if key in given:
                    return "--set "
                line = line_of(key, lines)
                return f"{name}: " if line is None else f"{name}:{line}: "

            raise refused(refusal, cls, values, _mistakes_in_names(refusal, values), place) from None

    def to_toml(self) -> str:
        """The case as TOML; `Case.from_text` gives the same case back."""
        import tomli_w

        values = self.model_dump(exclude_defaults=True, exclude_none=True)
        for kind in BUILT_IN:
            if callable(law := getattr(self.laws, kind)):
                values["laws"][kind] = getattr(law, "__name__", "own law")
        return tomli_w.dumps(values)

    def with_(self, **changes: Any) -> Case:
        """A changed copy: `case.with_(**{"bed.inlet_velocity": 0.06})`, or whole sections by name."""
        values = self.model_dump()
        for key, value in changes.items():
            put(values, key.split("."), value, key)
        return Case(**values)


def _unknown_names(known: list[str], beds: Mapping[str, str | None], column: str | None) -> Iterator[InputError]:
    """Names of materials that no [material] has; `beds` says by key who names which."""
    for key, name in beds.items():
        if name is None and len(known) > 1:
            yield InputError(f"{key}.material", None, f"given, {nearest('', known)}")
    for key, name in {**beds, "column": column}.items():
        if name is not None and name not in known:
            remedy = "materials are tables [material.NAME]"
            yield InputError(f"{key}.material", shown(name), nearest(name, known), remedy)


def _mistakes_in_names(refusal: ValidationError, values: Mapping[str, Any]) -> list[InputError]:
    """Unknown names, looked for in the bare values where other mistakes keep the case from being made."""
    if any(each["loc"] == () for each in refusal.errors()):
        return []
    known, bed, column = (values.get(name) for name in ("material", "bed", "column"))
    if not (isinstance(known, dict) and known and isinstance(bed, dict) and isinstance(column, dict)):
        return []
    species = bed.get("species") or {"": bed}
    if not isinstance(species, dict):
        return []
    tables = {f"bed.species.{name}" if name else "bed": each for name, each in species.items()}
    named = {key: each.get("material") for key, each in tables.items() if isinstance(each, dict)}
    told = {described([key]): name for key, name in named.items() if isinstance(name, str | None)}
    other = column.get("material")
    names = [described([each]) for each in known]
    return list(_unknown_names(names, told, other if isinstance(other, str) else None))
