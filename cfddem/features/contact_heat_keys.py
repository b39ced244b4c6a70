"""Keys of the table `[contact_heat]`: heat between particles, with walls, and by radiation with the surroundings."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError, nearest, shown
from cfddem.case.bed import NonNegative, Positive
from cfddem.case.feature_table import FeatureTable, Findings
from cfddem.case.materials import Checked
from cfddem.features.heat_keys import Heat, Temperature, low_capacities
from closures.contact_heat import jump_distance

ROUGH = ("microhardness", "slope", "surface_roughness")
"""Keys by material that a rough contact needs."""


class WallHeat(Checked):
    """What a wall does to the particles that touch it."""

    temperature: Temperature | None = Field(None, description="temperature of the wall [K]")
    power: float | None = Field(
        None, description="heat into the wall, which passes all of it on; flux times area, instead of a temperature [W]"
    )
    coefficient: Positive | None = Field(
        None,
        description="coefficient of heat transfer between the wall and the cross-section of a particle that is near "
        "it; default: the contact and the gas, as between particles [W/m2/K]",
    )

    @property
    def is_powered(self) -> bool:
        """Whether the heat is given, not the temperature."""
        return self.power is not None

    @property
    def passes_heat(self) -> bool:
        """Whether it exchanges heat at all."""
        return self.is_powered or bool(self.temperature)

    @property
    def fixed(self) -> float:
        """The temperature; NaN where the heat is given [K]."""
        return self.temperature or math.nan

    @model_validator(mode="after")
    def _one_condition(self) -> WallHeat:
        if bool(self.temperature) == self.is_powered:
            how_many = "found both" if self.is_powered else "found none"
            raise InputError("temperature", self.temperature, "given, or power, and only one of them", how_many)
        return self


ADIABATIC = WallHeat.model_construct()
"""A wall that passes no heat."""


class ContactHeat(FeatureTable):
    """Heat between particles, with walls, and with the surroundings."""

    table: ClassVar[str] = "contact_heat"
    meaning: ClassVar[str] = "heat between particles, with walls, and by radiation with the surroundings"

    conductivity: dict[str, Positive] = Field({}, description="thermal conductivity of the solids, by material [W/m/K]")
    heat_capacity: dict[str, Positive] = Field(
        {}, description="specific heat capacity of the particles, by material; with [heat], that of [heat] [J/kg/K]"
    )
    particle_temperature: float | dict[str, float] | None = Field(
        None, description="temperature of new particles, or by species; with [heat], that of [heat] [K]"
    )
    contact: Literal["smooth", "rough", "none"] = Field(
        "smooth",
        description="conduction through the contact: of smooth spheres (Batchelor and O'Brien), with the resistance "
        "of the asperities (Yovanovich), or none",
    )
    radius: Literal["hertz", "overlap_circle"] = Field(
        "hertz",
        description="radius of the contact: hertz, that of the real solids under the force, also where "
        "contact_modulus softens the contact; or overlap_circle, where the two spheres intersect",
    )
    microhardness: dict[str, Positive] = Field({}, description="of a rough surface, by material [Pa]")
    slope: dict[str, Positive] = Field({}, description="mean slope of the asperities, by material [-]")
    surface_roughness: dict[str, Positive] = Field(
        {}, description="root mean square height of a surface, by material [m]"
    )
    gap: Literal["none", "lens", "rarefied"] = Field(
        "none",
        description="conduction through the gas between the surfaces: none; lens, from a least distance on (Rong and "
        "Horio); rarefied, with the jump of temperature at the surfaces (Bahrami and others)",
    )
    lens: Positive = Field(0.2, description="gap up to which the gas conducts, over the larger radius [-]")
    least_gap: Positive = Field(4e-10, description="smallest distance of the surfaces, of lens [m]")
    gas_conductivity: Positive | None = Field(None, description="thermal conductivity of the gas in the gaps [W/m/K]")
    accommodation: float = Field(0.7, gt=0, le=1, description="thermal accommodation of gas at surfaces [-]")
    free_path: Positive = Field(68e-9, description="mean free path of the gas [m]")
    prandtl: Positive = Field(0.7, description="Prandtl number of the gas [-]")
    heat_ratio: float = Field(1.4, ge=1, le=2, description="ratio of the specific heats of the gas [-]")
    wall: dict[str, WallHeat] = Field(
        {},
        description="walls by name: floor, lid, x_low, x_high, y_low, y_high, side of a cylinder, or the number of a "
        "[[wall]]; others pass no heat",
    )
    emissivity: dict[str, NonNegative] = Field(
        {}, description="emissivity of the particles by material, for radiation with the surroundings [-]"
    )
    surroundings_temperature: Temperature | None = Field(None, description="temperature of what particles see [K]")
    surroundings: Literal["uniform", "local"] = Field(
        "uniform",
        description="what particles see: that temperature, or, local, a mean of it and of the particles in the same "
        "cell of the column, by their solid fraction (Musser)",
    )
    held: bool = Field(
        False,
        description="particles stay where they start, with the forces there: steps are limited by run.fluid_step alone",
    )

    @property
    def holds_particles(self) -> bool:
        """Whether particles are held."""
        return self.held

    def refuse(self, case: Any) -> None:
        """Refuse unknown names, what is missing for a choice, and temperatures below absolute zero."""
        for table in ("conductivity", "heat_capacity", "emissivity", *ROUGH):
            for name, value in getattr(self, table).items():
                if name not in case.material:
                    raise InputError(f"contact_heat.{table}.{name}", value, nearest(name, list(case.material)))
                if table == "emissivity" and value > 1.0:
                    raise InputError(f"contact_heat.emissivity.{name}", value, "0 to 1", "1 is a black body")
        if self.held and case.feed:
            remedy = "particles that stay where they are leave no room for others"
            raise InputError("contact_heat.held", True, "false where there is a feed", remedy)
        if self.held and any(case.bed.initial_velocity):
            limit = "left out with contact_heat.held"
            raise InputError("bed.initial_velocity", shown(case.bed.initial_velocity), limit, "no particle moves")
        names = wall_names(case)
        for name in self.wall:
            if name not in names:
                raise InputError(f"contact_heat.wall.{name}", None, nearest(name, names))
        self._refuse_incomplete(case)
        self._refuse_temperatures(case)

    def _refuse_incomplete(self, case: Any) -> None:
        used = sorted({case.material_name_of(species) for species in case.species.values()})
        with_walls = sorted({*used, *(material_of_wall(case, name) for name in self.wall)})
        conducts = self.contact != "none" or self.gap == "rarefied"
        heated = [name for name in self.wall if not self.wall[name].coefficient]
        needed: list[tuple[str, list[str]]] = [("conductivity", with_walls if heated else used)] if conducts else []
        if not Heat.of(case):
            needed.append(("heat_capacity", used))
        elif self.heat_capacity:
            raise InputError("contact_heat.heat_capacity", None, "left out with [heat]", "it has heat.heat_capacity")
        if self.contact == "rough":
            needed += [(table, with_walls if heated else used) for table in ROUGH]
        if self.emissivity:
            needed.append(("emissivity", used))
        for table, names in needed:
            for name in names:
                if name not in getattr(self, table):
                    limit = "given: particles or heated walls are of this material"
                    raise InputError(f"contact_heat.{table}.{name}", None, limit)
        if self.gap != "none" and not self.gas_conductivity:
            raise InputError("contact_heat.gas_conductivity", None, f'given for gap = "{self.gap}"', "[W/m/K]")
        if self.emissivity and not self.surroundings_temperature:
            remedy = "the temperature that particles see by radiation [K]"
            raise InputError("contact_heat.surroundings_temperature", None, "given with emissivity", remedy)
        if case.bed.fixed and self.contact != "none":
            remedy = "take contact_heat.held = true, which keeps the forces of the start"
            raise InputError("bed.fixed", True, "false with conduction through contacts", remedy)

    def _refuse_temperatures(self, case: Any) -> None:
        start = self.particle_temperature
        if Heat.of(case):
            if start is not None:
                remedy = "it has heat.particle_temperature"
                raise InputError("contact_heat.particle_temperature", None, "left out with [heat]", remedy)
            return
        if start is None:
            raise InputError("contact_heat.particle_temperature", None, "given, or [heat]", "[K]")
        by_name = start if isinstance(start, dict) else {}
        for name, value in by_name.items():
            if name not in case.species:
                raise InputError(f"contact_heat.particle_temperature.{name}", value, nearest(name, list(case.species)))
        for name in case.species:
            value = by_name.get(name, math.nan) if isinstance(start, dict) else start
            if math.isnan(value):
                raise InputError(f"contact_heat.particle_temperature.{name}", None, "given for every species", "[K]")
            if value < 0.0:
                key = f"particle_temperature.{name}" if by_name else "particle_temperature"
                raise InputError(f"contact_heat.{key}", value, "at least 0 K, absolute zero", "temperatures are in K")

    def issues(self, case: Any) -> Findings:
        """Warn of heat capacities in kJ, and tell what the exchange cannot see."""
        yield from low_capacities("contact_heat.heat_capacity", self.heat_capacity)
        if self.radius == "overlap_circle" and any(material.contact_modulus for material in case.material.values()):
            reason = "contacts are softened by contact_modulus, and the circle of intersection grows with it"
            yield "warning", "contact_heat.radius", reason, 'take radius = "hertz", which uses youngs_modulus'

    def issues_of_bed(self, case: Any, bed: Any) -> Findings:
        """Warn where a particle in a fluid has no single temperature."""
        if heat := Heat.of(case):
            others = {name: value for name, value in self.conductivity.items() if name not in heat.solid_conductivity}
            yield from heat.issues_of_biot(case, bed, "contact_heat.conductivity", others)

    def by_material(self, case: Any, table: str, other: float = np.nan) -> np.ndarray:
        """Values of a table by number of material; `other` where none is given."""
        return np.array([getattr(self, table).get(name, other) for name in case.material])

    def start_temperatures(self, case: Any) -> np.ndarray:
        """Temperature of new particles by number of species [K]."""
        start = self.particle_temperature
        return np.array([start[name] if isinstance(start, dict) else start for name in case.species], float)

    @property
    def jump(self) -> float:
        """Gas parameter M of two surfaces [m]."""
        return jump_distance(self.accommodation, self.accommodation, self.heat_ratio, self.free_path, self.prandtl)


def wall_names(case: Any) -> list[str]:
    """Names of the walls, in the order of the particle solver."""
    column = case.column
    names = [] if column.ends == "periodic" else ["floor", "lid"]
    if case.line or case.vessel:
        names.append("side")
    else:
        sides = {"x": column.sides, "y": column.front or column.sides}
        names += [f"{axis}_{end}" for axis, kind in sides.items() if kind != "periodic" for end in ("low", "high")]
    return [*names, *map(str, range(len(case.wall)))]


def material_of_wall(case: Any, name: str) -> str:
    """Name of the material of a wall, by the name of the wall."""
    of_column = case.column.material or next(iter(case.species.values())).material or next(iter(case.material))
    return str((case.wall[int(name)].material if name.isdigit() else None) or of_column)
