"""Keys of the tables `[vapour]` and `[evaporation]`: one vapour in the fluid, and water on particles, or drops of it.

Water evaporates into humid air of one state, or into the vapour of the fluid.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from cfddem.backend.errors import InputError, nearest
from cfddem.case.bed import NonNegative, Positive
from cfddem.case.feature_table import FeatureTable, Findings, Numbers
from cfddem.case.patches import refuse_no_inlets
from cfddem.features.heat_keys import GROUP, Heat, given_or, transfer_number
from closures.evaporation import (
    saturation_pressure,
    vapour_diffusivity,
    vapour_fraction,
    vapour_pressure,
    wet_bulb_temperature,
)
from closures.heat_transfer import ranz_marshall

Fraction = Annotated[float, Field(ge=0, lt=1)]


class VapourTable(FeatureTable):
    """One vapour in the fluid, as a mass fraction in every cell."""

    table: ClassVar[str] = "vapour"
    meaning: ClassVar[str] = "one vapour in the fluid, as a mass fraction in every cell"

    fluid_fraction: Fraction = Field(0.0, description="mass fraction of the vapour in the fluid at the start [-]")
    inlet_fraction: Fraction | None = Field(
        None, description="mass fraction in the fluid that enters; default: fluid_fraction [-]"
    )
    patch_fraction: dict[str, Fraction] = Field(
        {}, description="mass fraction in the fluid that enters through an inlet, by the name of its [patch.NAME] [-]"
    )
    outlet_fraction: Fraction | None = Field(
        None, description="mass fraction in fluid that flows back through the outlet; default: that of the cell [-]"
    )
    diffusivity: Positive = Field(description="diffusivity of the vapour in the fluid [m2/s]")
    effective_diffusivity: Literal["none", "zehner_schluender"] = Field(
        "none", description="diffusivity between particles: none, voidage times diffusivity; or the law"
    )

    @property
    def inflow(self) -> float:
        """Mass fraction in the fluid that enters [-]."""
        return given_or(self.inlet_fraction, self.fluid_fraction)

    def refuse(self, case: Any) -> None:
        """Refuse a vapour in a fluid without a temperature in its cells."""
        heat = Heat.of(case)
        if not heat:
            remedy = "add the table [heat], which says what evaporation cools"
            raise InputError("vapour", None, "left out without [heat]", remedy)
        if not heat.in_cells(case):
            remedy = 'set heat.fluid = "cells", with a law of drag'
            raise InputError("vapour", None, "left out where the fluid has one temperature", remedy)
        refuse_no_inlets(case, "vapour.patch_fraction", self.patch_fraction, "vapour.outlet_fraction")


# ---------------------------------------------------------------- evaporation


SATURATED = 1.01
"""Relative humidity up to which air counts as saturated [-]."""

NEARLY_ALL, HALF = 0.8, 0.5
"""Share of the water that the air can carry above which a spray gets a note; share of the way to saturation above which
a gas of one humidity gets a warning [-]."""

COLDEST, HOTTEST = 253.0, 640.0
"""Temperatures of the gas, of particles and of a spray between which the laws of water can be used [K]."""

LIKELY_CELSIUS = 200.0
"""Temperature below which a number is likely to be meant in degrees Celsius [K]."""


class Water(NamedTuple):
    """Estimates of the water of a case; NaN where a number has no meaning.

    Air that takes up water without other heat comes to the temperature of adiabatic saturation, close to the wet bulb.
    It can carry what it holds there, less what it brings.
    """

    schmidt: float  # Schmidt number [-]
    saturation: float  # temperature of air that has taken up all it can [K]
    carried: float  # most water that the air can take up per time [kg/s]
    reached: float  # share of it that the air takes up where all particles are wet [-]
    sprayed: float  # water that the spray brings per time [kg/s]
    at_start: float  # mass of the water at the start [kg]
    rate: float  # at which all particles, wet, lose water [kg/s]


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

    wall_coefficient: NonNegative = Field(
        0.0, description="coefficient of mass transfer of liquid on walls; 0: it does not evaporate [m/s]"
    )
    wall_temperature: Positive | None = Field(
        None, description="temperature of liquid on walls, which give its latent heat; default: of the gas [K]"
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
        of_water = {"fluid_temperature": heat.fluid_temperature, "inlet_temperature": heat.gas_temperature}
        of_water["outlet_temperature"] = given_or(heat.outlet_temperature, heat.gas_temperature)
        of_water |= {f"patch_temperature.{name}": value for name, value in heat.patch_temperature.items()}
        of_water["particle_temperature"] = heat.particle_temperature
        of_water["spray_temperature"] = given_or(heat.spray_temperature, heat.particle_temperature)
        for where, temperature in of_water.items():
            if not COLDEST <= temperature <= HOTTEST:
                limit = f"{COLDEST:g} to {HOTTEST:g} K with [evaporation]"
                kelvin = f"temperatures are in K; did you mean {temperature + 273.15:.3g} K ({temperature:g} °C)?"
                remedy = kelvin if temperature < LIKELY_CELSIUS else "the laws are those of water"
                raise InputError(f"heat.{where}", temperature, limit, remedy)
        for name in self.drops:
            if name not in case.material:
                raise InputError("evaporation.drops", name, nearest(name, list(case.material)))
        if not self.drops and not case.liquid:
            remedy = "or name the materials of drops in evaporation.drops"
            raise InputError("evaporation", None, "left out without [liquid]", remedy)
        if self.wall_coefficient > 0.0:
            if not case.liquid or case.liquid.wall_share == 0.0:
                limit = "0 where walls take no liquid"
                raise InputError("evaporation.wall_coefficient", self.wall_coefficient, limit, "see liquid.wall_share")
            if VapourTable.of(case):
                remedy = "cells do not take the vapour of walls"
                raise InputError("evaporation.wall_coefficient", self.wall_coefficient, "0 with [vapour]", remedy)
        if vapour := VapourTable.of(case):
            self._refuse_saturated_air(heat, vapour)
        else:
            key = "vapour_fraction" if self.relative_humidity is None else "relative_humidity"
            value = given_or(self.relative_humidity, self.vapour_fraction or 0.0)
            self._refuse_saturated(f"evaporation.{key}", value, heat.gas_temperature, self.partial_pressure(case))

    def _refuse_saturated_air(self, heat: Heat, vapour: VapourTable) -> None:
        """Refuse air above saturation at an inlet, at the start, at outlets and at patches."""
        key = f"vapour.{'fluid' if vapour.inlet_fraction is None else 'inlet'}_fraction"
        partial = vapour_pressure(vapour.inflow, self.pressure)
        self._refuse_saturated(key, vapour.inflow, heat.gas_temperature, partial)
        of_air: dict[str, tuple[float | None, float | None]] = {
            "vapour.fluid_fraction": (vapour.fluid_fraction, heat.fluid_temperature),
            "vapour.outlet_fraction": (vapour.outlet_fraction, heat.outlet_temperature),
        }
        for name, fraction in vapour.patch_fraction.items():
            of_patch = heat.patch_temperature.get(name, heat.gas_temperature)
            of_air[f"vapour.patch_fraction.{name}"] = fraction, of_patch
        for where, (share, warmth) in sorted(of_air.items()):
            if share is not None and warmth is not None:  # others are those of the cell
                self._refuse_saturated(where, share, warmth, vapour_pressure(share, self.pressure))
        for name in sorted(heat.patch_temperature.keys() - vapour.patch_fraction.keys()):
            temperature, where = heat.patch_temperature[name], f"heat.patch_temperature.{name}"
            self._refuse_saturated(where, temperature, temperature, partial, f"{key} = {vapour.inflow:g}, but ")

    def _refuse_saturated(self, key: str, value: float, temperature: float, partial: float, brought: str = "") -> None:
        """Refuse air above saturation, with a partial pressure of the vapour [Pa].

        brought  key and value of the fraction, where the key that is named is that of the temperature
        """
        saturated = saturation_pressure(temperature)
        if partial > SATURATED * saturated:
            most = vapour_fraction(min(saturated, self.pressure), self.pressure)
            remedy = f"{brought}the mass fraction of saturation at {temperature:g} K is {most:.4g}"
            limit = "that of air at most saturated" if brought else "at most saturated"
            raise InputError(key, value, limit, remedy)

    def _refuse_humidity(self, case: Any) -> None:
        """Refuse two humidities, or none; with `[vapour]` the humidity is that of the cells."""
        keys = [key for key in ("vapour_fraction", "relative_humidity") if getattr(self, key) is not None]
        if VapourTable.of(case):
            for key in keys:
                remedy = "[vapour] has the fraction in the cells"
                raise InputError(f"evaporation.{key}", getattr(self, key), "left out with [vapour]", remedy)
        elif len(keys) != 1:
            remedy = f"or relative_humidity, and only one of them; found {'both' if keys else 'none'}"
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

    def issues(self, case: Any) -> Findings:
        """Tell the wet-bulb temperature, and what leaves no bond."""
        reason = f"the wet-bulb temperature is {self.wet_bulb(case):.2f} K at {case.reference_speed:g} m/s"
        yield "note", "evaporation", reason, "wet particles come to it while they dry at a constant rate"
        radius = 0.5 * case.bed.largest_diameter
        if self.full_thickness > radius:
            reason = f"{self.full_thickness:g} m is more than the radius of a particle, {radius:.3g} m"
            yield "error", "evaporation.full_thickness", reason, "films are of micrometres: 5e-6"
        if case.liquid and case.liquid.bond:
            reason = "bonds form between particles; films, and bridges at walls, leave nothing when they dry"
            yield "note", "liquid.bond", reason, "the solids of the liquid have no mass"

    def numbers(self, case: Any, bed: Any) -> Numbers:
        """The wet bulb, the water that the air can carry, that of the spray, and the time of drying."""
        heat, water, flow = Heat.of(case), self.water(case, bed), bed.inflow * case.fluid.density
        assert heat
        prandtl = case.fluid.viscosity * heat.fluid_heat_capacity / heat.conductivity
        yield GROUP, "Le", water.schmidt / prandtl, "", "Lewis number of the vapour, Sc / Pr"
        yield GROUP, "wet bulb", self.wet_bulb(case), "K", f"at {case.reference_speed:g} m/s"
        if flow > 0.0:
            yield GROUP, "water that the air can carry", water.carried, "kg/s", f"saturated at {water.saturation:.1f} K"
            yield GROUP, "part of it when all is wet", water.reached, "", "by the surface of the particles"
        if case.spray:
            yield GROUP, "water sprayed", water.sprayed, "kg/s", ""
        if case.spray and flow > 0.0:
            yield GROUP, "water sprayed / carried", water.sprayed / water.carried, "", "above 1 the bed grows wet"
        if water.at_start > 0.0 and water.rate > 0.0:
            yield GROUP, "drying time", water.at_start / water.rate, "s", "of the liquid at the start, all wet"

    def issues_of_bed(self, case: Any, bed: Any) -> Findings:
        """Check a spray against what the air can carry, and that the air notices what evaporates."""
        water, vapour = self.water(case, bed), VapourTable.of(case)
        sprayed, most = water.sprayed, water.carried
        if bed.inflow > 0.0 and sprayed > NEARLY_ALL * most:
            wet = sprayed > most
            reason = f"{sprayed:.2g} kg/s of water; the air can carry {most:.2g} kg/s, saturated at "
            reason += f"{water.saturation:.1f} K" + (": the bed grows wet" if wet else "")
            less = f"spray below {NEARLY_ALL * most / self.liquid_density:.2g} m3/s"
            remedy = f"{less}, or use more, hotter or drier air"
            yield "warning" if wet else "note", "spray.rate", reason, remedy
        if not vapour and bed.inflow > 0.0 and water.reached > HALF and not case.bed.positions:
            reason = "the gas keeps its humidity, but wet particles would bring it "
            reason += f"{100.0 * water.reached:.0f} % of the way to saturation"
            yield "warning", "evaporation", reason, "add [vapour], so that the cells take what evaporates"

    def water(self, case: Any, bed: Any) -> Water:
        """Estimates of the water of a case."""
        heat, fluid, flow = Heat.of(case), case.fluid, bed.inflow * case.fluid.density
        assert heat
        schmidt = fluid.viscosity / (fluid.density * self.diffusivity_in(case))
        brought = vapour_fraction(self.partial_pressure(case), self.pressure)
        saturation = wet_bulb_temperature(heat.gas_temperature, brought, self.pressure, 1.0 / heat.fluid_heat_capacity)
        lengths = sum(case.counts[name] * math.pi * species.diameter for name, species in case.species.items())
        surface = lengths * transfer_number(case, bed, schmidt) * fluid.viscosity / schmidt
        carried = flow * self._drive(saturation, brought)
        reached = -math.expm1(-surface / flow) if flow > 0.0 else math.nan
        in_cells = flow > 0.0 and bool(VapourTable.of(case))
        return Water(
            schmidt=schmidt,
            saturation=saturation,
            carried=carried,
            reached=reached,
            sprayed=case.spray.rate * self.liquid_density if case.spray else 0.0,
            at_start=self._at_start(case),
            rate=carried * reached if in_cells else surface * self._drive(self.wet_bulb(case), brought),
        )

    def _drive(self, temperature: float, brought: float) -> float:
        """Vapour that air takes up until it is saturated, over its mass [-]."""
        at_surface = vapour_fraction(min(saturation_pressure(temperature), 0.999 * self.pressure), self.pressure)
        return (at_surface - brought) / (1.0 - at_surface)

    def _at_start(self, case: Any) -> float:
        """Mass of water at the start, in drops and films [kg]."""
        total = 0.0
        for name, species in case.species.items():
            if case.material_name_of(species) in self.drops:
                total += case.volumes[name] * case.material_of(species).density
            elif case.liquid:
                radius = np.array([0.5 * species.mean_power(3) ** (1.0 / 3.0)])
                film = float(case.liquid.volume_on(radius)[0]) * case.liquid.share_of_wet_particles
                total += case.counts[name] * film * self.liquid_density
        return float(total)
