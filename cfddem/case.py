"""A case: what is to be run, described once, checked when it is made, and never changed.

The same words stand in Python and in TOML. A case is data; reading one executes nothing. What a case leads to,
walls, boundaries, particles, is built by :mod:`cfddem.assembly`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from cfddem.errors import InputError
from cfddem.materials import Checked, Fluid, Material

Positive = Annotated[float, Field(gt=0)]
Point = tuple[float, float, float]


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

    @model_validator(mode="after")
    def _round_columns_have_a_side(self) -> Column:
        if self.shape == "cylinder":
            if self.depth not in (None, self.width):
                raise ValueError("depth: must be left out, or equal to width; the width of a cylinder is its diameter")
            if self.sides == "periodic" or self.front is not None:
                raise ValueError("sides: must be no_slip or free_slip; a cylinder has one side")
        return self


class Jet(Checked):
    """A faster inlet through a part of the floor."""

    velocity: float = Field(ge=0, description="superficial, upward [m/s]")
    width: Positive = Field(description="along x; diameter of a round one [m]")
    depth: Positive | None = Field(None, description="along y; the whole depth if not given [m]")
    round: bool = Field(False, description="a round hole")


class Bed(Checked):
    """The particles, how they start, and the flow that meets them."""

    material: str | None = Field(None, description="name of a [material]; the only one if not given")
    diameter: Positive = Field(description="d; the mean where sizes differ [m]")
    spread: float = Field(0.0, ge=0, lt=0.5, description="standard deviation of the diameter over its mean [-]")
    count: int | None = Field(None, gt=0, description="number of particles")
    height: Positive | None = Field(None, description="of the poured bed, instead of a number [m]")
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
        given = [name for name in ("count", "height", "positions") if getattr(self, name)]
        if len(given) != 1:
            raise ValueError(f"count: must be given, or height, or positions, and only one; here {given or 'none'}")
        if self.positions and self.start == "poured":
            object.__setattr__(self, "start", "at")
        if not isinstance(self.inlet_velocity, float):
            times = [time for time, _ in self.inlet_velocity]
            if not times or sorted(set(times)) != times:
                raise ValueError("inlet_velocity: must be a number or [time, velocity] pairs in the order of time")
        return self


class CaseLaws(Checked):
    """Which laws hold."""

    drag: str | Callable[[float, float], float] | None = Field("di_felice", description="name of a drag law, or a law")
    model: Literal["A", "B"] = Field("A", description="who carries the pressure gradient")
    lubrication: Literal["nijssen", "none"] = Field("nijssen", description="the film between two close spheres")
    contact: Literal["hertz", "linear"] = Field("hertz", description="normal contact")
    normal_stiffness: float = Field(0.0, ge=0, description="of the linear contact [N/m]")
    tangential_stiffness: float = Field(0.0, ge=0, description="of the linear contact [N/m]")
    friction_onset: Literal["film", "overlap"] = Field("film", description="where friction sets in")
    added_mass: float = Field(0.0, ge=0, description="coefficient C_m of C_m rho V; 0.5 for a sphere alone [-]")
    mapping: Literal["linear", "centroid", "divided"] = Field("linear", description="how particles fill cells")
    smoothing: float = Field(1.5, ge=0, description="standard deviation of the kernel over the mean diameter [-]")
    own_wind: bool = Field(True, description="take out the wind that a lone particle makes itself")
    convection: Literal["limited", "central"] = Field("limited", description="scheme of the fluid")
    gravity: Point = Field((0.0, 0.0, -9.81), description="g [m/s2]")


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

    @model_validator(mode="after")
    def _names_are_known(self) -> Case:
        known = list(self.material)
        for field, name in (("bed.material", self.bed.material), ("column.material", self.column.material)):
            if name is not None and name not in known:
                raise ValueError(f"{field}: must be one of {', '.join(known)}; {name!r} is no [material]")
        if self.bed.material is None and len(known) > 1:
            raise ValueError(f"bed.material: must be given, one of {', '.join(known)}")
        return self

    @property
    def solid(self) -> Material:
        """Material of the particles."""
        return self.material[self.bed.material or next(iter(self.material))]

    @classmethod
    def from_toml(cls, path: str | Path, overrides: Mapping[str, Any] | None = None) -> Case:
        """Read a case from a TOML file.

        overrides  {"bed.inlet_velocity": 0.06, ...}, in the place of what the file says

        Raises InputError, naming file, key, value and limit.
        """
        path = Path(path)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as failure:
            reason = failure.strerror if isinstance(failure, OSError) else "not UTF-8 text"
            raise InputError(f"case {path}", None, "a readable TOML file", f"{reason}") from None
        return cls.from_text(text, str(path), overrides)

    @classmethod
    def from_text(cls, text: str, name: str = "case", overrides: Mapping[str, Any] | None = None) -> Case:
        """Read a case from the text of a TOML file; `name` is what errors call it."""
        try:
            values = tomllib.loads(text)
        except (tomllib.TOMLDecodeError, RecursionError) as failure:
            raise InputError(name, None, "valid TOML", str(failure)) from None
        for key, value in (overrides or {}).items():
            _put(values, key.split("."), value, key)
        try:
            return cls.model_validate(values)
        except ValidationError as refusal:
            raise InputError(name, None, "a case", "; ".join(_complaints(refusal))) from None

    def to_toml(self) -> str:
        """The case as TOML; `Case.from_text` gives the same case back."""
        import tomli_w

        values = self.model_dump(exclude_defaults=True, exclude_none=True)
        if callable(self.laws.drag):
            values["laws"]["drag"] = getattr(self.laws.drag, "__name__", "own law")
        return tomli_w.dumps(values)

    def with_(self, **changes: Any) -> Case:
        """A changed copy: `case.with_(**{"bed.inlet_velocity": 0.06})`, or whole sections by name."""
        values = self.model_dump()
        for key, value in changes.items():
            _put(values, key.split("."), value, key)
        return Case(**values)


def _put(values: dict[str, Any], keys: list[str], value: Any, whole: str) -> None:
    """Set a value in nested tables."""
    for key in keys[:-1]:
        values = values.setdefault(key, {})
        if not isinstance(values, dict):
            raise InputError(whole, value, f"inside a table; {key} is a value")
    values[keys[-1]] = value


def _complaints(refusal: ValidationError) -> list[str]:
    return [".".join(str(part) for part in each["loc"]) + ": " + each["msg"] for each in refusal.errors()]
