"""Keys of the table `[evaporation]`: water on particles, or drops of it, in humid air of one state."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

from pydantic import Field

from cfddem.backend.errors import InputError, nearest
from cfddem.case.bed import NonNegative, Positive
from cfddem.case.feature_table import FeatureTable
from cfddem.features.heat_keys import Heat
from cfddem.features.vapour_keys import VapourTable
from closures.evaporation import (
    saturation_pressure,
    vapour_diffusivity,
    vapour_fraction,
    vapour_pressure,
    wet_bulb_temperature,
)
from closures.heat_transfer import ranz_marshall

SATURATED = 1.01
"""Relative humidity up to which air counts as saturated [-]."""

COLDEST, HOTTEST = 253.0, 640.0
"""Temperatures of the gas between which the laws of water can be used [K]."""


class Evaporation(FeatureTable):
    """Evaporation of water from particles into humid air of one state, and condensation."""

    table: ClassVar[str] = "evaporation"
    meaning: ClassVar[str] = "evaporation of water from particles into humid air of one state; needs [heat]"

    vapour_fraction: float | None = Field(None, ge=0, lt=1, description="mass fraction of vapour in the gas [-]")
    relative_humidity: float | None = Field(
        None, ge=0, description="humidity of the gas at its temperature over that of saturation, instead [-]"
    )
    pressure: Positive = Field(101325.0, description="pressure of the gas [Pa]")
    diffusivity: Positive | None = Field(None, description="diffusivity of the vapour; default: of water in air [m2/s]")
    rate: Literal["stefan", "dilute"] = Field(
        "stefan", description="driving force: with the flow of the vapour itself, or for little vapour"
    )
    full_thickness: NonNegative = Field(
        0.0,
        description="thickness of a film that covers all of a particle; thinner ones evaporate in proportion: the "
        "falling-rate period. 0: until a particle is dry [m]",
    )
    liquid_density: Positive = Field(998.0, description="density of the liquid on particles [kg/m3]")
    drops: tuple[str, ...] = Field(
        (), description="materials whose particles are drops of water, which shrink; others carry their [liquid]"
    )

    def refuse(self, case: Any) -> None:
        """Refuse vapour without heat, nothing that evaporates, and air above saturation."""
        heat = Heat.of(case)
        if not heat:
            raise InputError("evaporation", None, "left out without [heat]", "add [heat]: it takes latent heat")
        if heat.fluid_total_capacity:
            remedy = "the gas of [evaporation] has one state, and gains no vapour"
            raise InputError("heat.fluid_total_capacity", heat.fluid_total_capacity, "left out", remedy)
        self._refuse_humidity(case)
        if not COLDEST <= heat.gas_temperature <= HOTTEST:
            limit = f"{COLDEST:g} to {HOTTEST:g} K with [evaporation]"
            raise InputError("heat.fluid_temperature", heat.gas_temperature, limit, "the laws are those of water")
        for name in self.drops:
            if name not in case.material:
                raise InputError("evaporation.drops", name, nearest(name, list(case.material)))
        if not self.drops and not case.liquid:
            remedy = "or name the materials of drops in evaporation.drops"
            raise InputError("evaporation", None, "left out without [liquid]", remedy)
        saturated = saturation_pressure(heat.gas_temperature)
        if self.partial_pressure(case) > SATURATED * saturated:
            vapour = VapourTable.of(case)
            key = "evaporation.vapour_fraction" if self.relative_humidity is None else "evaporation.relative_humidity"
            value = self.vapour_fraction if self.relative_humidity is None else self.relative_humidity
            if vapour:
                key, value = "vapour.inlet_fraction", vapour.inflow
            most = vapour_fraction(min(saturated, self.pressure), self.pressure)
            remedy = f"the mass fraction of saturation at {heat.gas_temperature:g} K is {most:.4g}"
            raise InputError(key, value, "at most saturated", remedy)

    def _refuse_humidity(self, case: Any) -> None:
        """Refuse two humidities, or none; with `[vapour]` the humidity is that of the cells."""
        given = [key for key in ("vapour_fraction", "relative_humidity") if getattr(self, key) is not None]
        if VapourTable.of(case):
            for key in given:
                remedy = "[vapour] has the fraction in the cells"
                raise InputError(f"evaporation.{key}", getattr(self, key), "left out with [vapour]", remedy)
        elif len(given) != 1:
            remedy = f"or relative_humidity, and only one of them; found {'both' if given else 'none'}"
            raise InputError("evaporation.vapour_fraction", self.vapour_fraction, "given", remedy)

    def partial_pressure(self, case: Any) -> float:
        """Pressure of the vapour in the gas [Pa]."""
        heat = Heat.of(case)
        assert heat
        if vapour := VapourTable.of(case):
            return vapour_pressure(vapour.inflow, self.pressure)
        if self.relative_humidity is not None:
            return self.relative_humidity * saturation_pressure(heat.gas_temperature)
        return vapour_pressure(self.vapour_fraction or 0.0, self.pressure)

    def diffusivity_in(self, case: Any) -> float:
        """Diffusivity of the vapour [m2/s]."""
        heat = Heat.of(case)
        assert heat
        if vapour := VapourTable.of(case):
            return vapour.diffusivity
        return self.diffusivity or vapour_diffusivity(heat.gas_temperature, self.pressure)

    def wet_bulb(self, case: Any) -> float:
        """Temperature of a wet particle at the reference speed of the case [K]."""
        heat, fluid = Heat.of(case), case.required_fluid
        assert heat
        diffusivity = self.diffusivity_in(case)
        reynolds = fluid.density * case.reference_speed * case.bed.largest_diameter / fluid.viscosity
        nusselt = ranz_marshall(reynolds, fluid.viscosity * heat.fluid_heat_capacity / heat.conductivity)
        sherwood = ranz_marshall(reynolds, fluid.viscosity / (fluid.density * diffusivity))
        ratio = sherwood * fluid.density * diffusivity / (nusselt * heat.conductivity)
        fraction = vapour_fraction(self.partial_pressure(case), self.pressure)
        return wet_bulb_temperature(heat.gas_temperature, fraction, self.pressure, ratio)

    def issues(self, case: Any) -> Iterator[tuple[Literal["note", "warning", "error"], str, str, str]]:
        """Tell the wet-bulb temperature."""
        reason = f"the wet-bulb temperature is {self.wet_bulb(case):.2f} K at {case.reference_speed:g} m/s"
        yield "note", "evaporation", reason, "wet particles come to it while they dry at a constant rate"
