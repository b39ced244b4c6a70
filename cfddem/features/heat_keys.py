"""Keys of the table `[heat]`: temperature of particles in a fluid of one temperature."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from cfddem.backend.errors import InputError
from cfddem.case.bed import Positive
from cfddem.case.feature_table import FeatureTable
from closures.heat_transfer import ranz_marshall

LARGEST_BIOT = 0.1
"""Biot number up to which a sphere has one temperature [-]."""


class Heat(FeatureTable):
    """Heat between particles of one temperature each and a fluid of one temperature."""

    table: ClassVar[str] = "heat"
    meaning: ClassVar[str] = "heat between particles of one temperature each and a fluid of one temperature"

    particle_temperature: float = Field(ge=0, description="temperature of new particles, above absolute zero [K]")
    fluid_temperature: float = Field(ge=0, description="temperature of the fluid, at the start if it changes [K]")
    conductivity: Positive = Field(description="thermal conductivity of the fluid [W/m/K]")
    fluid_heat_capacity: Positive = Field(description="specific heat capacity of the fluid [J/kg/K]")
    fluid_total_capacity: Positive | None = Field(
        None, description="heat capacity of all the fluid, well mixed; default: its temperature is held [J/K]"
    )
    heat_capacity: dict[str, Positive] = Field(
        description="specific heat capacity of the particles, by material [J/kg/K]"
    )
    solid_conductivity: dict[str, Positive] = Field(
        {}, description="thermal conductivity of the particles by material, for the Biot number in `check` [W/m/K]"
    )

    def refuse(self, case: Any) -> None:
        """Refuse particles without a heat capacity, unknown materials, and a case without a viscous fluid."""
        if case.fluid is None:
            raise InputError("heat", None, "left out without a [fluid]", "add the table [fluid]")
        if case.fluid.viscosity == 0.0:
            raise InputError("fluid.viscosity", 0.0, "above 0 with [heat]", "the law of heat needs a Reynolds number")
        for table in ("heat_capacity", "solid_conductivity"):
            if unknown := sorted(getattr(self, table).keys() - case.material.keys()):
                known = ", ".join(case.material)
                raise InputError(f"heat.{table}.{unknown[0]}", None, f"one of the materials {known}")
        for name in sorted({case.material_name_of(each) for each in case.species.values()}):
            if name not in self.heat_capacity:
                raise InputError(
                    f"heat.heat_capacity.{name}", None, "given: particles are of this material", "[J/kg/K]"
                )

    def issues(self, case: Any) -> Iterator[tuple[Literal["note", "warning", "error"], str, str, str]]:
        """Warn where a particle has no single temperature."""
        fluid = case.fluid
        prandtl = fluid.viscosity * self.fluid_heat_capacity / self.conductivity
        for species in case.species.values():
            name = case.material_name_of(species)
            if name in self.solid_conductivity and fluid.viscosity > 0.0:
                reynolds = fluid.density * case.reference_speed * species.diameter / fluid.viscosity
                nusselt = ranz_marshall(reynolds, prandtl)
                biot = nusselt * self.conductivity / (6.0 * self.solid_conductivity[name])
                if biot > LARGEST_BIOT:
                    reason = f"the Biot number h d / (6 k) is {biot:.2g} at Re = {reynolds:.3g}; the limit is 0.1"
                    remedy = "temperatures differ within a particle; use smaller particles, or take care"
                    yield "warning", f"heat.solid_conductivity.{name}", reason, remedy

    def capacities(self, case: Any) -> np.ndarray:
        """Specific heat capacity by number of material, NaN where none is given [J/kg/K]."""
        return np.array([self.heat_capacity.get(name, np.nan) for name in case.material])
