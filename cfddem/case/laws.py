"""The physical models and numerical schemes of a case."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any, Literal

from pydantic import Field, ValidationInfo, field_validator

from cfddem.backend.law_choice import BUILT_IN, chosen
from cfddem.case.bed import Point
from cfddem.case.materials import Checked
from closures.registry import Law


class CaseLaws(Checked):
    """Physical models and numerical schemes."""

    drag: str | Callable[..., float] | None = Field(
        "di_felice", description="drag law: none, a name from `cfddem explain`, or a function"
    )
    model: Literal["A", "B"] = Field(
        "A", description="model A: pressure gradient on both phases; model B: on the fluid alone"
    )
    lubrication: str | Callable[..., float] = Field(
        "nijssen", description="lubrication film between close spheres: nijssen, none, a law's name, or a function"
    )
    minimum_gap: str | Callable[..., float] = Field(
        "elastohydrodynamic",
        description="smallest gap that a film allows, unless roughness is larger: a law's name, or a function",
    )
    contact: Literal["hertz", "linear"] = Field("hertz", description="contact law")
    normal_stiffness: float = Field(0.0, ge=0, description="normal stiffness of the linear contact [N/m]")
    tangential_stiffness: float = Field(0.0, ge=0, description="tangential stiffness of the linear contact [N/m]")
    friction_onset: Literal["film", "overlap"] = Field(
        "film", description="friction begins at the minimum gap of the film, or at overlap of the solids"
    )
    rolling_resistance: Literal["none", "constant_torque", "spring_dashpot"] = Field(
        "none", description="rolling resistance model; uses rolling_friction of the materials"
    )
    rolling_damping: float = Field(0.3, ge=0, description="damping of the rolling dashpot over critical damping [-]")
    cohesion: Literal["none", "jkr"] = Field(
        "none", description="adhesion of dry solids; uses surface_energy of the materials, not allowed with films"
    )
    added_mass: float = Field(
        0.0, ge=0, description="added-mass coefficient C_m in C_m rho_f V; 0.5 for a single sphere [-]"
    )
    lift: bool = Field(False, description="Saffman-Mei shear lift and Magnus spin lift")
    torque: bool = Field(False, description="hydrodynamic torque against spin relative to the fluid")
    viscous_stress: bool = Field(False, description="force V div(tau) on particles; model A only")
    agitation: Literal["none", "pseudo_turbulence", "lattanzi"] = Field(
        "none", description="fluctuating force on each particle from the flow around its neighbours"
    )
    mapping: Literal["linear", "centroid", "divided"] = Field(
        "linear", description="distribution of particle volume over cells, before the filter kernel"
    )
    kernel_width: float = Field(
        1.5, ge=0, description="standard deviation of the filter kernel over the mean diameter [-]"
    )
    self_disturbance_correction: bool = Field(
        True, description="remove the disturbance that each particle causes at its own position from the sampled flow"
    )
    convection: Literal["limited", "central"] = Field("limited", description="convection scheme of the fluid")
    gravity: Point = Field((0.0, 0.0, -9.81), description="gravitational acceleration g [m/s2]")

    @field_validator("drag", "minimum_gap", "lubrication")
    @classmethod
    def _laws_exist(cls, value: Any, about: ValidationInfo) -> Any:
        kind = about.field_name or ""
        if value not in BUILT_IN.get(kind, ()) and (isinstance(value, str) or kind != "drag"):
            chosen(kind, value)
        return value

    @property
    def drag_law(self) -> Law | None:
        """Drag law with its range and reference; None without drag."""
        return None if self.drag is None or self.drag in BUILT_IN["drag"] else chosen("drag", self.drag)

    @property
    def pair_laws(self) -> dict[str, Law]:
        """Laws that replace the built-in laws of the pair loop, by kind."""
        given = {kind: getattr(self, kind) for kind in ("minimum_gap", "lubrication")}
        return {kind: chosen(kind, law) for kind, law in given.items() if law not in BUILT_IN[kind]}

    def drag_function(self, diameter_ratio: float = 1.0) -> Callable[[float, float], float] | None:
        """Drag factor as a function of Reynolds number and voidage; None without drag.

        diameter_ratio  diameter over the Sauter mean diameter, for laws that use it [-]
        """
        law = self.drag_law
        if law is None or "diameter_ratio" not in signature(law.function).parameters:
            return None if law is None else law.function
        function = law.function

        @wraps(function)
        def at_this_ratio(reynolds: float, voidage: float) -> float:
            return function(reynolds, voidage, diameter_ratio)

        return at_this_ratio
