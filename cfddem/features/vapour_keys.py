"""Keys of the table `[vapour]`: mass fraction of one vapour in the fluid."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from cfddem.backend.errors import InputError
from cfddem.case.bed import Positive
from cfddem.case.feature_table import FeatureTable
from cfddem.case.patches import refuse_no_inlets
from cfddem.features.heat_keys import Heat, given_or

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
