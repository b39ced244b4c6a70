"""Keys of the table `[heat]`: temperature of particles and of the fluid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field

from cfddem.backend.errors import InputError
from cfddem.case.bed import Positive
from cfddem.case.feature_table import FeatureTable, Findings, Numbers
from cfddem.case.patches import refuse_no_inlets
from cfddem.fluid.scalar_conditions import SOLID, ExchangeWall, FluxWall, HeldWall, ScalarSides, Wall
from closures.heat_transfer import ranz_marshall


def _above_absolute_zero(value: float) -> float:
    """Refuse a temperature in degrees below zero."""
    if value < 0.0:
        raise InputError("", value, "at least 0 K, absolute zero", "temperatures are in K: 0 degrees C are 273.15 K")
    return value


Temperature = Annotated[float, AfterValidator(_above_absolute_zero)]
"""A temperature above absolute zero [K]."""

CELL_KEYS = (
    "inlet_temperature", "outlet_temperature", "wall_temperature", "wall_coefficient", "wall_flux", "expansion",
    "patch_temperature",
)  # fmt: skip
"""Keys that need a temperature in every cell."""

GROUP = "heat and drying"
"""Group of the numbers of the pre-run check."""

BOUSSINESQ = 0.1
"""Difference of density over the density up to which the approximation holds (Gray & Giorgini, Int. J. Heat Mass
Transfer 19 (1976) 545-551) [-]."""

LOWEST_CAPACITY = 20.0
"""Specific heat capacity below which it may be in kJ/kg/K: of solids lead has 129, hydrogen 14.3e3 [J/kg/K]."""

LARGEST_BIOT = 0.1
"""Biot number up to which a sphere has one temperature [-]."""


AROUND = "sides"
"""Name of all walls around a column at once, in the keys of walls."""


class Heat(FeatureTable):
    """Heat between particles of one temperature each and the fluid, which has a temperature in every cell."""

    table: ClassVar[str] = "heat"
    meaning: ClassVar[str] = "heat between particles of one temperature each and the fluid, cell by cell"

    particle_temperature: Temperature = Field(description="temperature of new particles [K]")
    fluid_temperature: Temperature = Field(description="temperature of the fluid, at the start if it changes [K]")
    fluid: Literal["auto", "cells", "uniform"] = Field(
        "auto",
        description="temperature of the fluid: in all its cells, or a uniform one; auto: cells, but uniform without "
        "drag or with fluid_total_capacity",
    )
    conductivity: Positive = Field(description="thermal conductivity of the fluid [W/m/K]")
    fluid_heat_capacity: Positive = Field(description="specific heat capacity of the fluid [J/kg/K]")
    fluid_total_capacity: Positive | None = Field(
        None, description="heat capacity of all the fluid, well mixed; default: its temperature is held [J/K]"
    )
    inlet_temperature: Temperature | None = Field(
        None, description="temperature of the fluid that enters; default: fluid_temperature [K]"
    )
    patch_temperature: dict[str, Temperature] = Field(
        {}, description="temperature of the fluid that enters through an inlet, by the name of its [patch.NAME] [K]"
    )
    outlet_temperature: Temperature | None = Field(
        None, description="temperature of fluid that flows back through the outlet; default: that of the cell [K]"
    )
    wall_temperature: dict[str, Temperature] = Field(
        {},
        description="temperature of walls of the column for the fluid, by x_low to z_high, or sides for all around, as "
        "the wall of a vessel; walls without a key are insulated [K]",
    )
    wall_coefficient: dict[str, Positive] = Field(
        {},
        description="coefficient between a wall_temperature and the fluid, see wall_coefficient_to; default: the "
        "surface of the wall has this temperature [W/m2/K]",
    )
    wall_coefficient_to: Literal["surface", "cell"] = Field(
        "surface",
        description="where wall_coefficient ends: surface, of the wall, from where the fluid conducts to the centre "
        "of its cell; or cell, a coefficient of heat transfer that has this resistance in it",
    )
    wall_flux: dict[str, float] = Field({}, description="heat flux from walls into the fluid, by name [W/m2]")
    buoyancy: Literal["none", "boussinesq"] = Field(
        "none",
        description="weight of the fluid by its temperature: none, or boussinesq, in the weight alone and linear; for "
        "differences of density of up to 10 %",
    )
    expansion: Positive | None = Field(
        None, description="thermal expansion of the fluid, of boussinesq; default: 1/fluid_temperature, of a gas [1/K]"
    )
    spray_temperature: Temperature | None = Field(
        None,
        description="temperature of the drops of [spray] as they land; default: that of the particle they meet [K]",
    )
    spray_heat_capacity: Positive = Field(
        4.17e6, description="heat capacity of the sprayed liquid per volume; default: water [J/m3/K]"
    )
    effective_conductivity: Literal["none", "zehner_schluender"] = Field(
        "none", description="conductivity of the fluid between particles: none, voidage times conductivity; or the law"
    )
    heat_capacity: dict[str, Positive] = Field(
        description="specific heat capacity of the particles, by material [J/kg/K]"
    )
    solid_conductivity: dict[str, Positive] = Field(
        {}, description="thermal conductivity of the particles by material, for the Biot number in `check` [W/m/K]"
    )

    def refuse(self, case: Any) -> None:
        """Refuse particles without a heat capacity, unknown materials, walls that are none, and a case without a
        viscous fluid."""
        if case.fluid is None:
            raise InputError("heat", None, "left out without a [fluid]", "add the table [fluid]")
        if case.fluid.viscosity == 0.0:
            raise InputError("fluid.viscosity", 0.0, "above 0 with [heat]", "the law of heat needs a Reynolds number")
        for table in ("heat_capacity", "solid_conductivity"):
            if unknown := sorted(getattr(self, table).keys() - case.material.keys()):
                materials = ", ".join(case.material)
                raise InputError(f"heat.{table}.{unknown[0]}", None, f"one of the materials {materials}")
        for name in sorted({case.material_name_of(species) for species in case.species.values()}):
            if name not in self.heat_capacity:
                raise InputError(
                    f"heat.heat_capacity.{name}", None, "given: particles are of this material", "[J/kg/K]"
                )

        if self.spray_temperature and not case.spray:
            remedy = "add the table [spray], or leave it out"
            raise InputError("heat.spray_temperature", self.spray_temperature, "left out without [spray]", remedy)
        if self.in_cells(case):
            self._refuse_walls(case)
            self._refuse_buoyancy(case)
        else:
            if self.buoyancy != "none":
                remedy = 'fluid = "cells"; leave fluid_total_capacity out'
                raise InputError("heat.buoyancy", self.buoyancy, "none where the fluid has one temperature", remedy)
            for key in CELL_KEYS:
                if getattr(self, key):
                    remedy = 'fluid = "cells"; leave fluid_total_capacity out'
                    raise InputError(f"heat.{key}", None, "left out where the fluid has one temperature", remedy)

    def _refuse_buoyancy(self, case: Any) -> None:
        """Refuse a weight by temperature that is unknown, and an expansion that nothing uses."""
        if self.buoyancy == "none" and self.expansion:
            raise InputError(
                "heat.expansion", self.expansion, "left out without buoyancy", 'set buoyancy = "boussinesq"'
            )
        if self.buoyancy != "none" and not self.expansion and (case.in_liquid or not self.fluid_temperature):
            remedy = "the default 1/fluid_temperature is that of a gas; water of 20 degrees C has 2.1e-4 [1/K]"
            raise InputError("heat.expansion", None, 'given with buoyancy = "boussinesq"', remedy)

    @property
    def expansion_coefficient(self) -> float:
        """Thermal expansion of the fluid [1/K]."""
        return self.expansion or 1.0 / self.fluid_temperature

    def _refuse_walls(self, case: Any) -> None:
        """Refuse names that are no walls of the column, and walls with too much or too little."""
        if self.fluid_total_capacity:
            remedy = "leave it out; the fluid in the cells has its density"
            raise InputError("heat.fluid_total_capacity", self.fluid_total_capacity, "left out with cells", remedy)
        refuse_no_inlets(case, "heat.patch_temperature", self.patch_temperature, "heat.outlet_temperature")
        walls = self.names_of_walls(case)
        for key in ("wall_temperature", "wall_coefficient", "wall_flux"):
            for name in getattr(self, key):
                if name not in walls:
                    raise InputError(f"heat.{key}.{name}", None, "one of the walls " + ", ".join(walls))
        for name in self.wall_coefficient:
            if name not in self.wall_temperature:
                remedy = f"add heat.wall_temperature.{name}"
                raise InputError(f"heat.wall_coefficient.{name}", None, "of a wall with a temperature", remedy)
        for name in self.wall_flux:
            if name in self.wall_temperature:
                remedy = "leave one of the two out"
                raise InputError(f"heat.wall_flux.{name}", None, "of a wall without a temperature", remedy)

    def in_cells(self, case: Any) -> bool:
        """Whether every cell of the fluid has a temperature of its own."""
        if self.fluid == "auto":
            return not self.fluid_total_capacity and case.laws.drag != "none"
        return self.fluid == "cells"

    @property
    def gas_temperature(self) -> float:
        """Temperature of the fluid that enters [K]."""
        return given_or(self.inlet_temperature, self.fluid_temperature)

    def names_of_walls(self, case: Any) -> list[str]:
        """Names that walls of the column can have in the keys of this table."""
        column = case.column
        kinds = [column.sides, column.sides, column.front or column.sides, column.front or column.sides]
        around = [name for name, kind in zip(("x_low", "x_high", "y_low", "y_high"), kinds) if kind != "periodic"]
        ends = {"flow": ["z_low"], "closed": ["z_low", "z_high"], "periodic": []}[column.ends]
        if case.vessel:
            return [AROUND, *ends]
        return [*([AROUND] if around else []), *around, *ends, SOLID]

    def sides_of(self, case: Any) -> ScalarSides:
        """Conditions of the temperature on the sides of the column."""
        round_wall = math.pi / 4.0 if case.column.shape == "cylinder" else 1.0
        walls, to_cell = dict[str, Wall](), self.wall_coefficient_to == "cell"
        for name in (*self.wall_temperature, *self.wall_flux):
            named = [name]
            if name == AROUND:
                named = [side for side in self.names_of_walls(case) if side[0] in "xy"]
                named += [SOLID] if case.column.shape == "cylinder" or case.vessel else []
            for side in named:
                area = round_wall if side[0] in "xys" else 1.0
                if name in self.wall_flux:
                    wall: Wall = FluxWall(self.wall_flux[name], area)
                elif name in self.wall_coefficient:
                    wall = ExchangeWall(self.wall_coefficient[name], self.wall_temperature[name], area, to_cell)
                else:
                    wall = HeldWall(self.wall_temperature[name], area)
                if name == AROUND:
                    walls.setdefault(side, wall)
                else:
                    walls[side] = wall
        return ScalarSides(self.gas_temperature, self.outlet_temperature, walls)

    def numbers(self, case: Any, bed: Any) -> Numbers:
        """Numbers of the largest particles in the flow of the bed, and times of heating."""
        fluid, largest = case.fluid, max(case.species.values(), key=lambda species: species.diameter)
        reynolds, prandtl = reynolds_of(case, bed), fluid.viscosity * self.fluid_heat_capacity / self.conductivity
        nusselt = self.nusselt(case, bed)
        yield GROUP, "Pr", prandtl, "", "Prandtl number"
        yield GROUP, "Pe", reynolds * prandtl, "", "Peclet number of a particle, Re Pr"
        yield GROUP, "Nu", nusselt, "", f"Nusselt number at Re = {reynolds:.3g}"
        of_contacts = case.contact_heat.conductivity if case.contact_heat else {}
        solids = {name: of_contacts[name] for name in self.heat_capacity.keys() & of_contacts.keys()}
        solids |= self.solid_conductivity
        biots = [nusselt * self.conductivity / (6.0 * solid) for solid in solids.values()]
        missing = "h d / (6 k); the limit is 0.1" if biots else "give heat.solid_conductivity"
        yield GROUP, "Bi", max(biots, default=math.nan), "", f"Biot number: {missing}"
        solid = case.material_of(largest).density * self.heat_capacity[case.material_name_of(largest)]
        time = solid * largest.diameter**2 / (6.0 * nusselt * self.conductivity)
        yield GROUP, "heating time of a particle", time, "s", "m c / (h A), of the largest species"
        if bed.inflow > 0.0 and self.in_cells(case):
            capacity = sum(
                case.volumes[name]
                * case.material_of(species).density
                * self.heat_capacity[case.material_name_of(species)]
                for name, species in case.species.items()
            )
            time = capacity / (bed.inflow * fluid.density * self.fluid_heat_capacity)
            yield GROUP, "heating time of the bed", time, "s", "heat capacity over that of the inflow per time"

    def issues(self, case: Any) -> Findings:
        """Warn of heat capacities in kJ, and where the density differs too much for the approximation of Boussinesq."""
        yield from low_capacities("heat.fluid_heat_capacity", {"": self.fluid_heat_capacity})
        yield from low_capacities("heat.heat_capacity", self.heat_capacity)
        of_others = (*self.wall_temperature.values(), *self.patch_temperature.values())
        others = (self.gas_temperature, self.particle_temperature, *of_others)
        largest = max(abs(temperature - self.fluid_temperature) for temperature in others)
        if self.buoyancy != "none" and self.expansion_coefficient * largest > BOUSSINESQ:
            share = 100.0 * self.expansion_coefficient * largest
            reason = f"temperatures differ by {largest:.3g} K and densities by {share:.2g} %; it holds up to 10 %"
            remedy = "gas that is warmed does not expand here: take velocities at the temperature of the bed"
            yield "warning", "heat.buoyancy", reason, remedy

    def issues_of_bed(self, case: Any, bed: Any) -> Findings:
        """Warn where a particle has no single temperature."""
        return self.issues_of_biot(case, bed, "heat.solid_conductivity", self.solid_conductivity)

    def issues_of_biot(self, case: Any, bed: Any, key: str, of_solid: Mapping[str, float]) -> Findings:
        """Warn where a particle has no single temperature, by the conductivities of a key."""
        for name in sorted({case.material_name_of(species) for species in case.species.values()} & of_solid.keys()):
            biot = self.nusselt(case, bed) * self.conductivity / (6.0 * of_solid[name])
            if biot > LARGEST_BIOT:
                reason = f"the Biot number h d / (6 k) is {biot:.2g} at Re = {reynolds_of(case, bed):.3g}"
                remedy = "take temperatures as means over a particle; its surface is nearer to that of the gas"
                yield "warning", f"{key}.{name}", f"{reason}; the limit is {LARGEST_BIOT:g}", remedy

    def nusselt(self, case: Any, bed: Any) -> float:
        """Nusselt number of the largest particles in the flow of the bed."""
        return transfer_number(case, bed, case.fluid.viscosity * self.fluid_heat_capacity / self.conductivity)

    def capacities(self, case: Any) -> np.ndarray:
        """Specific heat capacity by number of material, NaN where none is given [J/kg/K]."""
        return np.array([self.heat_capacity.get(name, np.nan) for name in case.material])


def reynolds_of(case: Any, bed: Any) -> float:
    """Reynolds number of the largest particles, superficial; at the reference speed where nothing flows in."""
    if bed.inlet > 0.0:
        return float(bed.reynolds)
    largest = max(species.diameter for species in case.species.values())
    return float(case.fluid.density * case.reference_speed * largest / case.fluid.viscosity)


def transfer_number(case: Any, bed: Any, prandtl: float) -> float:
    """Nusselt number in the flow of the bed by the law of the case; Sherwood number for a Schmidt number."""
    reynolds, voidage = reynolds_of(case, bed), min(max(bed.voidage, 0.1), 1.0)
    if not (law := case.laws.heat_law):
        return ranz_marshall(reynolds, prandtl, voidage)
    values = {"reynolds": reynolds, "prandtl": prandtl, "voidage": voidage}
    return float(law.function(**{name: values[name] for name in law.arguments}))


def low_capacities(key: str, capacities: Mapping[str, float]) -> Findings:
    """Warn of specific heat capacities that are too low for J/kg/K, by the names of their materials, or none."""
    for name, value in capacities.items():
        if value < LOWEST_CAPACITY:
            reason = f"{value:.3g} J/kg/K is below that of any solid or fluid"
            remedy = f"water has 4180, air 1007; did you mean {1e3 * value:.4g} J/kg/K ({value:.3g} kJ/kg/K)?"
            yield "warning", f"{key}.{name}".rstrip("."), reason, remedy


def given_or(value: float | None, default: float) -> float:
    """A value, or its default where it is not given."""
    return default if value is None else value
