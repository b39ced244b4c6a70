"""Solids and fluids, and what two solids do to each other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator, model_validator

from cfddem.errors import InputError, nearest
from cfddem.mistakes import refused
from closures import contact, minimum_gap


class Checked(BaseModel):
    """A frozen description whose values are checked when it is made; a refusal is a readable line a mistake."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _truth_is_no_number(cls, value: Any, about: ValidationInfo) -> Any:
        field = cls.model_fields[about.field_name or ""]
        if isinstance(value, bool) and field.annotation is not bool:
            raise InputError(about.field_name or "", value, "anything but true or false")
        return value

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as refusal:
            raise refused(refusal, type(self), values) from None

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # so that parts of it keep their own complaints


class Material(Checked):
    """A solid.

    The film always feels the real `youngs_modulus`. A smaller `contact_modulus` softens the contact alone,
    so that larger time steps are stable.
    """

    density: float = Field(gt=0, description="rho_p [kg/m3]")
    youngs_modulus: float = Field(gt=0, description="E, of the real solid [Pa]")
    poisson: float = Field(gt=-1, le=0.5, description="nu [-]")
    restitution: float = Field(1.0, gt=0, le=1, description="e, dry and normal [-]")
    friction: float = Field(0.0, ge=0, description="mu, dry [-]")
    rolling_friction: float = Field(0.0, ge=0, description="mu_r, lever of the resistance to rolling over R* [-]")
    friction_lubricated: float | None = Field(
        None, ge=0, description="mu where a film keeps the solids apart; the dry one if not given [-]"
    )
    surface_energy: float = Field(0.0, ge=0, description="gamma, half of what parting like solids costs [J/m2]")
    roughness: float = Field(0.0, ge=0, description="sigma, height of asperities [m]")
    contact_modulus: float | None = Field(None, gt=0, description="E of the contact; the real one if not given [Pa]")

    @model_validator(mode="after")
    def _softer_not_harder(self) -> Material:
        if self.contact_modulus is not None and self.contact_modulus > self.youngs_modulus:
            raise InputError(
                "contact_modulus", self.contact_modulus, "at most youngs_modulus", "it is there to soften contacts"
            )
        return self


class Fluid(Checked):
    """A Newtonian fluid, of one viscosity or in layers; viscosity 0 leaves the particles dry."""

    density: float = Field(gt=0, description="rho_f [kg/m3]")
    viscosity: float = Field(ge=0, description="eta, dynamic [Pa s]")
    viscosity_profile: tuple[tuple[float, float], ...] = Field(
        (), description="eta against height, [height, eta] pairs, straight between them; the card keeps to `viscosity`"
    )

    @model_validator(mode="after")
    def _layers_from_below(self) -> Fluid:
        heights, values = [height for height, _ in self.viscosity_profile], [eta for _, eta in self.viscosity_profile]
        if sorted(set(heights)) != heights:
            raise InputError("viscosity_profile", heights, "[height, eta] pairs in the order of height, in m and Pa s")
        if self.viscosity_profile and not min(self.viscosity, *values) > 0.0:
            raise InputError("viscosity_profile", min(self.viscosity, *values), "of positive viscosities, as viscosity")
        return self

    def viscosity_at(self, height: np.ndarray) -> np.ndarray:
        """eta at heights [m] [Pa s].

        >>> Fluid(density=1e3, viscosity=1e-3, viscosity_profile=((0.0, 1e-3), (0.1, 5e-3))).viscosity_at([0.05, 0.2])
        array([0.003, 0.005])
        """
        if not self.viscosity_profile:
            return np.full(np.shape(height), self.viscosity)
        heights, values = np.array(self.viscosity_profile).T
        return np.interp(height, heights, values)


PAIR = np.dtype(
    [
        ("film_modulus", "f8"),  # E* of the real solids [Pa]
        ("contact_modulus", "f8"),  # E* of the contact, perhaps softened [Pa]
        ("shear_modulus", "f8"),  # G* of the contact [Pa]
        ("restitution", "f8"),  # e [-]
        ("damping_ratio", "f8"),  # alpha of Tsuji's dashpot [-]
        ("linear_damping_ratio", "f8"),  # zeta of the linear dashpot [-]
        ("friction", "f8"),  # mu, dry [-]
        ("friction_lubricated", "f8"),  # mu, where a film holds [-]
        ("rolling_friction", "f8"),  # mu_r [-]
        ("work_of_adhesion", "f8"),  # w [J/m2]
        ("roughness_gap", "f8"),  # h_sigma [m]
    ],
    align=True,
)
"""One row of the table of material pairs."""

SMOOTHEST = 1e-10
"""No film is thinner than an atom: the least minimum gap of a pair, also of solids without roughness [m]."""

_OVERRIDABLE = (
    "restitution",
    "friction",
    "friction_lubricated",
    "rolling_friction",
    "work_of_adhesion",
    "roughness_gap",
)


def pair_table(
    materials: Sequence[Material], overrides: Mapping[tuple[int, int], Mapping[str, float]] | None = None
) -> np.ndarray:
    """What each two materials do to each other.

    Unless `overrides` says otherwise, unlike materials take the lower restitution and frictions, the mean
    roughness, the reduced moduli, and twice the geometric mean of the surface energies.

    materials  the solids of a run, walls among them
    overrides  {(i, j): {"friction": 0.3, ...}} for indices into `materials`
    returns    structured array (n, n) of dtype :data:`PAIR`, symmetric
    """
    table = np.zeros((len(materials), len(materials)), PAIR)
    for i, first in enumerate(materials):
        for j, second in enumerate(materials):
            row = table[i, j]
            real = (first.youngs_modulus, first.poisson, second.youngs_modulus, second.poisson)
            soft = (_contact_modulus(first), first.poisson, _contact_modulus(second), second.poisson)
            row["film_modulus"] = contact.reduced_modulus(*real)
            row["contact_modulus"] = contact.reduced_modulus(*soft)
            row["shear_modulus"] = contact.reduced_shear_modulus(*soft)
            row["restitution"] = min(first.restitution, second.restitution)
            row["friction"] = min(first.friction, second.friction)
            row["friction_lubricated"] = min(_lubricated(first), _lubricated(second))
            row["rolling_friction"] = min(first.rolling_friction, second.rolling_friction)
            row["work_of_adhesion"] = 2.0 * math.sqrt(first.surface_energy * second.surface_energy)
            row["roughness_gap"] = minimum_gap.asperities(first.roughness, second.roughness)
    for (i, j), values in (overrides or {}).items():
        for name, value in values.items():
            if name not in _OVERRIDABLE:
                raise InputError(f"pair ({i}, {j}).{name}", value, nearest(name, _OVERRIDABLE))
            table[i, j][name] = table[j, i][name] = value
    for row in table.reshape(-1):
        row["roughness_gap"] = max(float(row["roughness_gap"]), SMOOTHEST)
        row["damping_ratio"] = contact.damping_ratio(float(row["restitution"]))
        row["linear_damping_ratio"] = contact.linear_damping_ratio(float(row["restitution"]))
    return table


def _contact_modulus(material: Material) -> float:
    return material.youngs_modulus if material.contact_modulus is None else material.contact_modulus


def _lubricated(material: Material) -> float:
    return material.friction if material.friction_lubricated is None else material.friction_lubricated
