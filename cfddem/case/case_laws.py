"""The physical models and numerical schemes of a case."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from cfddem.backend.errors import InputError, nearest
from cfddem.backend.law_choice import NotInstalled, chosen, drag_by_name
from cfddem.case.bed import NonNegative, Point
from cfddem.case.materials import NO_FLUID, Checked, Fluid
from cfddem.particles.interactions.contact_law import ContactLaw, contact_named
from closures.agitation import INERTIA_SHARE
from closures.kinds import BUILT_IN
from closures.registry import Law, is_built_in


class CaseLaws(Checked):
    """Physical models and numerical schemes."""

    drag: str | Callable[..., float] = Field(
        "di_felice", description="drag law: none (no drag), a name from `cfddem explain`, or a function"
    )
    model: Literal["A", "B"] = Field(
        "A", description="model A: pressure gradient on both phases; model B: on the fluid alone"
    )
    lubrication: str | Callable[..., float] = Field(
        "auto",
        description="lubrication film between close spheres: auto (nijssen in a liquid, none below 100 kg/m3), nijssen "
        "(along the line of centres), nijssen_full (also against sliding and rolling), nijssen_full_twist (and "
        "twisting), none, a law's name, or a function",
    )
    minimum_gap: str | Callable[..., float] = Field(
        "elastohydrodynamic",
        description="smallest gap that a film allows, unless roughness is larger: a law's name, or a function",
    )
    contact: str = Field(
        "hertz", description="contact law: a name from `cfddem explain`; jkr is not allowed with films"
    )
    contact_parameters: dict[str, NonNegative] = Field(
        {}, description="parameters of the contact law: normal_stiffness of linear [N/m], ..."
    )
    friction_onset: Literal["film", "overlap"] = Field(
        "film", description="friction begins at the minimum gap of the film, or at overlap of the solids"
    )
    rolling_resistance: Literal["none", "constant_torque", "spring_dashpot"] = Field(
        "none", description="rolling resistance model; uses rolling_friction of the materials"
    )
    rolling_damping: float = Field(0.3, ge=0, description="damping of the rolling dashpot over critical damping [-]")
    added_mass: float | str | Callable[..., float] = Field(
        0.0,
        description="added-mass coefficient C_m in C_m rho_f V, 0.5 for a single sphere [-]; "
        "or a law of the voidage: zuber, another name, or a function",
    )
    history: Literal["none", "mei_adrian", "basset"] = Field(
        "none",
        description="history force: of a single sphere at finite Re by Mei and Adrian, or in creeping flow by Basset",
    )
    wall_drag: Literal["none", "nearest", "all"] = Field(
        "none",
        description="extra drag of a single sphere beside the nearest wall or all walls, by Brenner and by Goldman, "
        "Cox and Brenner, less what the films apply. Prefer nearest: in a box, all lets measured spheres fall at 0.73 "
        "to 0.89 of their largest speed, nearest within 2.5 %",
    )
    lift: bool = Field(False, description="Saffman-Mei shear lift and Magnus spin lift")
    torque: bool = Field(False, description="hydrodynamic torque against spin relative to the fluid")
    viscous_stress: bool = Field(False, description="force V div(tau) on particles; model A only")
    agitation: str | Callable[..., float] = Field(
        "auto",
        description="fluctuating force on each particle from the flow around its neighbours: auto (free_spheres where "
        "it was measured, else none), none, free_spheres, pseudo_turbulence, lattanzi, a law's name, or a function",
    )
    agitation_drag_along: float | None = Field(
        None, ge=0, description="factor of the fluctuation along the mean slip in the drag; default: of the law [-]"
    )
    agitation_drag_across: float | None = Field(
        None, ge=0, description="factor of the fluctuation across the mean slip in the drag; default: of the law [-]"
    )
    agitation_inertia: float = Field(
        INERTIA_SHARE, ge=0, description="factor of the force by the acceleration of the fluctuation [-]"
    )
    agitation_time: float | None = Field(
        None, gt=0, description="factor of the correlation time of the fluctuation, d/w; default: of the law [-]"
    )
    heat_transfer: str | Callable[..., float] = Field(
        "ranz_marshall",
        description="Nusselt number of particles, where the case has heat; Sherwood number by analogy, where it has a "
        "vapour: ranz_marshall, gunn, wakao_kaguei, a law's name, or a function",
    )
    drying: str | Callable[..., float] = Field(
        "wet_share",
        description="rate of evaporation from a particle over that of a surface that is all wet: wet_share, in which "
        "the film covers a part of it, a law's name, or a function",
    )
    mapping: Literal["linear", "centroid", "divided"] = Field(
        "linear", description="distribution of particle volume over cells, before the filter kernel"
    )
    kernel_width: float = Field(
        1.5,
        ge=0,
        description="standard deviation of the filter kernel over the mean diameter of the species of a particle [-]",
    )
    surface: Literal["auto", "smeared", "sharp"] = Field(
        "auto",
        description="what particles at the surface of a bed see: smeared by the kernel; sharp, the suspension that "
        "they belong to, in model A; or auto (sharp in model A, smeared in model B)",
    )
    self_disturbance_correction: bool = Field(
        True, description="remove the disturbance that each particle causes at its own position from the sampled flow"
    )
    convection: Literal["limited", "central"] = Field("limited", description="convection scheme of the fluid")
    gravity: Point = Field((0.0, 0.0, -9.81), description="gravitational acceleration g [m/s2]")

    @field_validator("drag", mode="before")
    @classmethod
    def _none_is_a_word(cls, value: Any) -> Any:
        """None means no drag, too: as a word, because a case file has no null and would fall back to the default."""
        return "none" if value is None else value

    @field_validator("drag", "minimum_gap", "lubrication", "agitation", "heat_transfer", "drying")
    @classmethod
    def _laws_exist(cls, value: Any, about: ValidationInfo) -> Any:
        kind = about.field_name or ""
        return value if value in BUILT_IN.get(kind, ()) else _installed(kind, value, about)

    @field_validator("added_mass")
    @classmethod
    def _added_mass_is_a_number_or_a_law(cls, value: Any, about: ValidationInfo) -> Any:
        if isinstance(value, str) or callable(value):
            return _installed("added_mass", value, about)
        if not (value >= 0.0 and math.isfinite(value)):
            raise InputError("added_mass", value, "zero or positive, or the name of a law")
        return value

    @field_validator("contact")
    @classmethod
    def _contact_is_installed(cls, value: str, about: ValidationInfo) -> str:
        return _installed("contact", value, about)

    @model_validator(mode="after")
    def _surfaces_are_sharp_in_model_a(self) -> CaseLaws:
        if self.surface == "sharp" and self.model == "B":
            raise InputError("surface", self.surface, "smeared in model B", 'take laws.model = "A"')
        return self

    @model_validator(mode="after")
    def _contact_exists(self) -> CaseLaws:
        if "contact" in self.missing:
            return self
        parameters = contact_named(self.contact).parameters
        for name, value in self.contact_parameters.items():
            if name not in parameters:
                limit = nearest(name, parameters) if parameters else f"left out; {self.contact} has no parameters"
                raise InputError(f"contact_parameters.{name}", value, limit)
        return self

    @property
    def missing(self) -> dict[str, str]:
        """Names of laws, by their keys, that a finished run has used and this machine does not have."""
        return {kind: name for kind in (*BUILT_IN, "contact") if isinstance(name := getattr(self, kind), NotInstalled)}

    @property
    def contact_law(self) -> ContactLaw:
        """Contact law with the parameters of the case."""
        return contact_named(self.contact).with_parameters(**self.contact_parameters)

    def film_in(self, fluid: Fluid) -> str | Callable[..., float]:
        """The film law between close spheres in a fluid; "none" without viscosity, and by default in a gas.

        Films of a gas are thinner than the asperities of most solids.

        >>> [CaseLaws().film_in(Fluid(density=density, viscosity=1e-4)) for density in (1.2, 998.0)]
        ['none', 'nijssen']
        """
        if fluid.viscosity == 0.0:
            return "none"
        if self.lubrication == "auto":
            return "nijssen" if fluid.is_liquid else "none"
        return self.lubrication

    def film_in_words(self, fluid: Fluid) -> str:
        """The film law in a fluid, and whether it is the default; empty without a fluid."""
        if fluid is NO_FLUID or "lubrication" in self.missing:
            return ""
        film = self.film_in(fluid)
        name = film if isinstance(film, str) else getattr(film, "__name__", "user-defined law")
        kind = "liquid" if fluid.is_liquid else "gas"
        return f"{name}, the default in a {kind}" if self.lubrication == "auto" else name

    @property
    def added_mass_law(self) -> float | Law:
        """Added-mass coefficient, or the law that gives it."""
        law = 0.0 if "added_mass" in self.missing else self.added_mass
        return chosen("added_mass", law) if isinstance(law, str) or callable(law) else law

    def added_mass_at(self, voidage: float) -> float:
        """Added-mass coefficient at a voidage [-]."""
        law = self.added_mass_law
        return law.function(voidage) if isinstance(law, Law) else law

    @property
    def drag_law(self) -> Law | None:
        """Drag law with its range and reference; None without drag."""
        drag = self.drag
        return None if drag in (*BUILT_IN["drag"], *self.missing.values()) else chosen("drag", drag)

    @property
    def heat_law(self) -> Law | None:
        """Law of heat transfer; None if this machine lacks it."""
        return None if "heat_transfer" in self.missing else chosen("heat_transfer", self.heat_transfer)

    @property
    def drying_law(self) -> Law | None:
        """Law of the falling rate; None if this machine lacks it."""
        return None if "drying" in self.missing else chosen("drying", self.drying)

    @property
    def pair_laws(self) -> dict[str, Law]:
        """Laws that replace the built-in laws of the pair loop, by kind."""
        chosen_laws = {kind: getattr(self, kind) for kind in ("minimum_gap", "lubrication") if kind not in self.missing}
        return {kind: chosen(kind, law) for kind, law in chosen_laws.items() if law not in BUILT_IN[kind]}

    @property
    def own_laws(self) -> dict[str, Law]:
        """Laws of the case that are not built in, by their keys."""
        agitation = self.agitation
        named = isinstance(agitation, str) and agitation in (*BUILT_IN["agitation"], *self.missing.values())
        laws = {
            "drag": self.drag_law,
            "added_mass": self.added_mass_law,
            **self.pair_laws,
            "agitation": None if named else chosen("agitation", agitation),
            "heat_transfer": self.heat_law,
            "drying": self.drying_law,
        }
        return {kind: law for kind, law in laws.items() if isinstance(law, Law) and not is_built_in(law.function)}

    def drag_function(self, diameter_ratio: float = 1.0) -> Callable[[float, float], float] | None:
        """Drag factor as a function of Reynolds number and voidage; None without drag.

        diameter_ratio  diameter over the Sauter mean diameter, for laws that use it [-]
        """
        law = self.drag_law
        return None if law is None else drag_by_name(law, diameter_ratio)


def _installed(kind: str, law: Any, about: ValidationInfo) -> Any:
    """A law that this machine has; in the case of a finished run, else its name alone."""
    try:
        contact_named(law) if kind == "contact" else chosen(kind, law)
    except InputError:
        if not (isinstance(law, str) and (about.context or {}).get("finished")):
            raise
        return NotInstalled(law)
    return law
