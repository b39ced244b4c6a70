"""The tables of a case, as they are written. :class:`cfddem.case.schema.Case` compares them with each other."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from cfddem.backend.errors import InputError
from cfddem.case.bed import Bed, CaseFeed, CaseOutlet, Name, Point, Positive, Species
from cfddem.case.case_laws import CaseLaws
from cfddem.case.compare import CaseData
from cfddem.case.liquid import Liquid, Spray
from cfddem.case.materials import NO_FLUID, Checked, Fluid, Material, Materials, Pairs
from cfddem.case.patches import ENDS, CasePatch, lengths_of, open_area_of
from cfddem.case.vessel_shape import CaseVessel, Line, area_of_end, surface_in
from cfddem.case.walls import CaseWall


class Column(Checked):
    """The column and its grid: a box, or an upright cylinder of cells; around a vessel, the box of its cells."""

    shape: Literal["box", "cylinder"] = Field(
        "box",
        description="shape of the column; a cylinder is upright, with a wall of solid cells: a smooth one is [vessel]",
    )
    width: Positive = Field(description="width along x, or diameter of a cylinder [m]")
    depth: Positive | None = Field(None, description="depth along y; default: width [m]")
    height: Positive = Field(description="height along z [m]")
    cell: Positive | tuple[Positive, Positive, Positive] = Field(
        description="edge of a cubic cell, or edges along x, y, z; at least 2 diameters [m]"
    )
    sides: Literal["no_slip", "free_slip", "periodic"] = Field(
        "no_slip", description="boundary condition of the fluid on the sides"
    )
    front: Literal["no_slip", "free_slip", "periodic"] | None = Field(
        None, description="boundary condition on the two sides normal to y; default: sides"
    )
    ends: Literal["flow", "closed", "periodic"] = Field(
        "flow", description="floor and lid: inlet and outlet, closed walls, or periodic"
    )
    material: str | None = Field(None, description="material of the walls; default: that of the bed")

    @property
    def size(self) -> Point:
        """Edges of the box (x, y, z) [m]."""
        return self.width, self.width if self.depth is None else self.depth, self.height

    @property
    def cell_edges(self) -> Point:
        """Edges of a cell (x, y, z) [m]."""
        return self.cell if isinstance(self.cell, tuple) else (self.cell, self.cell, self.cell)

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Whether x, y, z are periodic."""
        return self.sides == "periodic", (self.front or self.sides) == "periodic", self.ends == "periodic"

    @property
    def periodic_lengths(self) -> tuple[float | None, float | None, float | None]:
        """Lengths of the column along periodic axes [m], None along the others."""
        x, y, z = (length if repeats else None for length, repeats in zip(self.size, self.periodic))
        return x, y, z

    @property
    def floor_area(self) -> float:
        """Area of the floor [m2]."""
        width, depth, _ = self.size
        return 0.25 * math.pi * width**2 if self.shape == "cylinder" else width * depth

    @model_validator(mode="after")
    def _check_cylinder(self) -> Column:
        if self.shape == "cylinder":
            if self.depth not in (None, self.width):
                raise InputError(
                    "depth", self.depth, "left out, or equal to width", "the width of a cylinder is its diameter"
                )
            if self.sides == "periodic":
                raise InputError("sides", self.sides, "no_slip or free_slip", "the side of a cylinder is a wall")
            if self.front is not None:
                raise InputError("front", self.front, "left out", "a cylinder has only one side")
        return self


class CaseRun(Checked):
    """Duration, output and time steps."""

    until: Positive = Field(description="end time [s]")
    every: Positive | None = Field(None, description="interval between snapshots; default: until / 50 [s]")
    history_every: Positive | None = Field(None, description="interval between history rows; default: every / 10 [s]")
    average_from: float | None = Field(
        None, ge=0, description="start of time averages; default: middle of the run, or of its last inlet step [s]"
    )
    until_error: dict[str, Positive] = Field(
        {},
        description="end early, once the standard error of the mean of each named measure is below this fraction of "
        "the mean; averages then begin where the start-up ends [-]",
    )
    particle_step: Positive | None = Field(None, description="particle time step; default: 2 % of the Hertz time [s]")
    fluid_step: Positive | None = Field(None, description="longest fluid time step; default: set by stability [s]")
    reference_speed: Positive | None = Field(
        None, description="expected highest collision speed, which sets the time step; default: estimated [m/s]"
    )
    film_tolerance: float = Field(
        1e-3, gt=0, le=1, description="to which the films of a step are solved together; energy falls at any value [-]"
    )
    energy_budget: bool = Field(
        False, description="record the energy budget, force by force; takes up to 50 % more time"
    )
    wall_forces: bool = Field(
        False,
        description="record force and torque of particles on every wall, and of the fluid on floor, lid, sides of a "
        "box and the wall of a vessel; without, those of particles on walls that move",
    )
    record_collisions: bool = Field(
        False, description="record every collision of two particles, from first to last contact"
    )
    gpu: bool = Field(False, description="make the steps of the particles on a graphics processor; no bridges")


class CaseTables(Checked):
    """Every table of a case but those that features own."""

    title: str = Field("", description="title, one line")
    fluid: Fluid | None = Field(None, description="the fluid; without this table, dry particles only")
    material: Materials = Field(min_length=1, description="solids by name")
    pair: Pairs = Field({}, description="contact of two unlike materials, by their names")
    column: Column
    vessel: CaseVessel | None = Field(None, description="a vessel with a smooth wall, in the column")
    patch: dict[Name, CasePatch] = Field({}, description="inlets, outlets and walls on floor, lid and sides, by name")
    bed: Bed
    wall: tuple[CaseWall, ...] = Field((), description="walls beside those of the column")
    feed: tuple[CaseFeed, ...] = Field((), description="boxes in which particles enter during the run")
    outlet: tuple[CaseOutlet, ...] = Field((), description="boxes in which particles are removed during the run")
    liquid: Liquid | None = Field(None, description="liquid on the particles, which forms bridges between them")
    spray: Spray | None = Field(None, description="zone where drops of the liquid land on the particles")
    laws: CaseLaws = CaseLaws.model_validate({})
    run: CaseRun
    compare: dict[Name, CaseData] = Field({}, description="measured data that the report draws beside the run")

    @field_validator("title")
    @classmethod
    def _title_is_one_line(cls, value: str) -> str:
        if not value.isprintable() or len(value) > 200:
            raise InputError("title", value, "one line of at most 200 printable characters")
        return value

    @property
    def species(self) -> dict[str, Species]:
        """Species by name; a bed of one kind is one species, named after its material."""
        only = next(iter(self.material))
        return dict(self.bed.species) or {self.bed.material or only: self.bed}

    def material_of(self, species: Species) -> Material:
        """Material of the particles of a species."""
        return self.material[self.material_name_of(species)]

    def material_name_of(self, species: Species) -> str:
        """Name of the material of a species."""
        return species.material or next(iter(self.material))

    @property
    def required_fluid(self) -> Fluid:
        """The fluid; InputError for a case without one."""
        if self.fluid is None:
            raise InputError("fluid", None, "given", "without this table the case has dry particles only")
        return self.fluid

    @property
    def has_fluid(self) -> bool:
        """Whether there is a fluid around the particles."""
        return bool(self.fluid)

    @property
    def around(self) -> Fluid:
        """What is around the particles: the fluid, or :data:`~cfddem.case.materials.NO_FLUID` around dry ones."""
        return self.fluid or NO_FLUID

    @property
    def in_liquid(self) -> bool:
        """Whether a liquid is around the particles."""
        return self.around.is_liquid

    @property
    def resists(self) -> bool:
        """Whether the fluid resists the particles: it has a viscosity and a law of drag."""
        return self.around.viscosity > 0.0 and self.laws.drag_law is not None

    @property
    def has_smooth_walls(self) -> bool:
        """Whether a smooth wall cuts cells of the fluid, or a thin one lies between them."""
        return self.has_fluid and (bool(self.vessel) or bool(self.thin_walls))

    @property
    def thin_walls(self) -> tuple[CaseWall, ...]:
        """Walls with the fluid on both sides, which does not pass through them."""
        return tuple(wall for wall in self.wall if wall.is_thin) if self.has_fluid else ()

    @property
    def fastest_inflow(self) -> float:
        """Highest superficial velocity over time through the floor, the jet or an inlet [m/s]."""
        return max([self.bed.fastest_inflow, *(patch.fastest for patch in self.patches.values())])

    @property
    def fastest_by_pressure(self) -> float:
        """Speed that the highest pressure of a patch gives free fluid up to the lowest, sqrt(2 dp / rho) [m/s]."""
        pressures = [
            patch.pressure or 0.0 for patch in self.patch.values() if patch.kind != "wall" and not patch.brings
        ]
        pressures += [0.0] * (self.column.ends == "flow")  # of the lid
        if not (self.patch and pressures):
            return 0.0
        return math.sqrt(2.0 * (max(pressures) - min(pressures)) / self.around.density)

    @property
    def patches(self) -> dict[str, CasePatch]:
        """The patches by name, with the velocities of those that have a mass flow."""
        density = self.around.density
        return {
            name: patch if patch.mass_flow is None else patch.by_velocity(density, open_area_of(self, patch))
            for name, patch in self.patch.items()
        }

    @property
    def openings(self) -> tuple[CasePatch, ...]:
        """Patches that are openings in the wall of the vessel; none without a vessel."""
        return tuple(patch for patch in self.patch.values() if patch.side not in ENDS) if self.vessel else ()

    @property
    def drains(self) -> dict[str, CasePatch]:
        """Patches through which particles leave, by name."""
        return {name: patch for name, patch in self.patch.items() if patch.particles == "leave"}

    def area_of(self, side: str) -> float:
        """Area of the floor, the lid, or a side of a box [m2]."""
        if side not in ENDS:
            return math.prod(lengths_of(self, side))
        return self.column.floor_area if not self.vessel else area_of_end(self.vessel, self.column, side)

    @property
    def has_sticky_sides(self) -> bool:
        """Whether the fluid sticks to the sides of the column, as to any round wall, or to the vessel in it."""
        sides = self.column.sides, self.column.front or self.column.sides
        return self.vessel is not None or self.column.shape == "cylinder" or "no_slip" in sides

    @property
    def line(self) -> Line:
        """Heights and radii of the round wall of the vessel or column, from the floor up [m]; empty in a box."""
        if self.vessel:
            return self.vessel.line_in(self.column)
        half = 0.5 * self.column.width
        return ((0.0, half), (self.column.height, half)) if self.column.shape == "cylinder" else ()

    @property
    def floor_area(self) -> float:
        """Area of the floor, inside the vessel if there is one [m2]."""
        return self.area_of("floor")

    def beyond_the_side(
        self, places: NDArray[np.float64], margin: float | NDArray[np.float64] = 0.0
    ) -> NDArray[np.float64]:
        """How far places (N, 3) are outside of the vessel or of a round column, across it if it is round (N,); negative
        inside, or in a box without a vessel [m].

        margin  from the wall, across it, a number or one of each place [m]
        """
        if self.vessel and not self.vessel.is_round:
            return np.asarray(margin - surface_in(self.vessel, self.column).distance(*places.T))
        if not self.line:
            return np.full(len(places), -np.inf)
        heights, radii = np.array(self.line).T
        slope = np.diff(radii) / np.diff(heights)
        piece = np.clip(np.searchsorted(heights, places[:, 2]) - 1, 0, len(slope) - 1)
        across = margin * np.sqrt(1.0 + slope[piece] ** 2)
        away = np.hypot(*(places[:, :2] - 0.5 * np.array(self.column.size[:2])).T)
        return np.asarray(away - np.interp(places[:, 2], heights, radii) + across)

    def closes_cells(self, wall: CaseWall) -> bool:
        """Whether a wall closes cells to the fluid."""
        return self.has_fluid and wall.side not in ("none", "thin")
