"""Solids and fluids as a case describes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from cfddem.backend.errors import InputError, nearest, shown
from cfddem.case.input_errors import dotted, input_error

KeysOf = Mapping[str, Sequence[str]]
"""Names of keys by shape."""


class Checked(BaseModel):
    """A frozen description. Its values are checked when it is made; every invalid value is one line of the error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_bool_as_number(cls, value: Any, about: ValidationInfo) -> Any:
        field = cls.model_fields[about.field_name or ""]
        if isinstance(value, bool) and field.annotation is not bool:
            remedy = f"{about.field_name}: {field.description}" if field.description else ""
            raise InputError(about.field_name or "", value, "something other than true or false", remedy)
        return value

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as failure:
            raise input_error(failure, type(self), values) from None

    def __setattr__(self, name: str, value: Any) -> None:
        raise InputError(
            name, shown(value), "left as it is", "case.with_(**{'bed.diameter': 2e-3}) makes a changed copy"
        )

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # a nested description keeps its own errors

    def _require_keys_of(self, shape: str, own: KeysOf, needed: KeysOf) -> None:
        """Refuse keys that only other shapes have, and require those that this one needs; both by shape."""
        for name in sorted({name for names in own.values() for name in names} - {*own[shape]}):
            if getattr(self, name) != type(self).model_fields[name].default:
                owners = " or ".join(f'"{other}"' for other, names in own.items() if name in names)
                limit = f'left out for shape = "{shape}"'
                raise InputError(name, shown(getattr(self, name)), limit, f"it belongs to shape = {owners}")
        for name in needed[shape]:
            if getattr(self, name) in (None, ()):
                raise InputError(name, None, f'given for shape = "{shape}"')

    def _repr_html_(self) -> str:
        """The keys that differ from their defaults, in a notebook."""
        from cfddem.backend.html import model_html

        return model_html(self)


class Material(Checked):
    """A solid.

    Films always use the real `youngs_modulus`. A smaller `contact_modulus` softens the contact only, so that
    larger time steps are stable.

    >>> glass = Material(density=2500.0, youngs_modulus=60e9, poisson=0.23, contact_modulus=1e7, roughness=134e-9)
    >>> glass.restitution
    1.0
    """

    density: float = Field(gt=0, description="density rho_p [kg/m3]")
    youngs_modulus: float = Field(gt=0, description="Young's modulus E of the real solid [Pa]")
    poisson: float = Field(gt=-1, le=0.5, description="Poisson's ratio nu [-]")
    restitution: float = Field(default=1.0, gt=0, le=1, description="dry normal restitution e [-]")
    friction: float = Field(default=0.0, ge=0, description="dry friction coefficient mu [-]")
    rolling_friction: float = Field(
        default=0.0, ge=0, description="rolling friction mu_r, of laws.rolling_resistance: lever arm over R* [-]"
    )
    friction_lubricated: float | None = Field(
        default=None, ge=0, description="friction coefficient while a film separates the solids; default: friction [-]"
    )
    surface_energy: float = Field(
        default=0.0, ge=0, description="surface energy gamma, half the work of adhesion of two like solids [J/m2]"
    )
    roughness: float = Field(default=0.0, ge=0, description="height of asperities sigma [m]")
    contact_modulus: float | None = Field(
        default=None, gt=0, description="Young's modulus used in contacts; default: youngs_modulus [Pa]"
    )

    @model_validator(mode="after")
    def _contact_not_stiffer_than_solid(self) -> Material:
        if self.contact_modulus is not None and self.contact_modulus > self.youngs_modulus:
            raise InputError(
                "contact_modulus", self.contact_modulus, f"at most youngs_modulus, {self.youngs_modulus:g} Pa",
                "it can only soften contacts",
            )  # fmt: skip
        return self


class MaterialPair(Checked):
    """Contact of two unlike materials; what is left out follows from the two."""

    restitution: float | None = Field(
        None, gt=0, le=1, description="dry normal restitution; default: the lower one [-]"
    )
    friction: float | None = Field(None, ge=0, description="dry friction coefficient; default: the lower one [-]")
    rolling_friction: float | None = Field(None, ge=0, description="rolling friction; default: the lower one [-]")
    friction_lubricated: float | None = Field(
        None,
        ge=0,
        description="friction while a film separates the solids; default: as of the materials, or friction [-]",
    )
    work_of_adhesion: float | None = Field(
        None, ge=0, description="work of adhesion; default: twice the geometric mean of the surface energies [J/m2]"
    )
    roughness: float | None = Field(None, ge=0, description="height of asperities; default: the mean of the two [m]")

    def values(self, first: Material, second: Material) -> dict[str, float]:
        """Entries of the pair table that replace those of the two materials."""
        properties = {name: value for name, value in self if value is not None}
        if "roughness" in properties:
            properties["roughness_gap"] = properties.pop("roughness")
        if self.friction is not None and first.friction_lubricated is None and second.friction_lubricated is None:
            properties.setdefault("friction_lubricated", self.friction)
        return properties


Materials = dict[str, Material]

Pairs = dict[str, dict[str, MaterialPair]]


def pair_overrides(
    materials: Mapping[str, Material], pairs: Mapping[str, Mapping[str, MaterialPair]]
) -> dict[tuple[int, int], dict[str, float]]:
    """Values of pairs by the numbers of their materials, as `pair_table` takes them."""
    names = list(materials)
    return {
        (names.index(first), names.index(second)): pair.values(materials[first], materials[second])
        for first, row in pairs.items()
        for second, pair in row.items()
    }


def unknown_materials(materials: list[str], beds: Mapping[str, str | None], column: str | None) -> Iterator[InputError]:
    """Errors for material names without a [material.NAME] table; `beds` holds the name used under each key."""
    for key, name in beds.items():
        if name is None and len(materials) > 1:
            yield InputError(f"{key}.material", None, f"given, {nearest('', materials)}")
    uses: dict[str, list[str]] = {}
    for key, name in {**beds, "column": column}.items():
        if name is not None and name not in materials:
            uses.setdefault(name, []).append(key)
    for name, keys in uses.items():
        others = f"; {len(keys) - 1} more keys name it, too" if len(keys) > 1 else ""
        remedy = f"every material is a table [material.NAME]{others}"
        yield InputError(f"{keys[0]}.material", shown(name), nearest(name, materials), remedy)


def check_pairs(materials: Mapping[str, Material], pairs: Mapping[str, Mapping[str, MaterialPair]]) -> None:
    """Refuse pairs of unknown or like materials, and pairs that are given twice."""
    for first, row in pairs.items():
        for second in row:
            key = dotted(("pair", first, second))
            for name in (first, second):
                if name not in materials:
                    raise InputError(
                        key,
                        None,
                        f"a pair of materials: {nearest(name, materials)}",
                        f"no [{dotted(('material', name))}] is given",
                    )
            if first == second:
                raise InputError(key, None, "two unlike materials", f"give the values in [material.{first}]")
            if first in pairs.get(second, {}) and first < second:
                raise InputError(key, None, f"given once; [pair.{second}.{first}] is the same pair")


LIQUID_DENSITY = 100.0
"""A fluid at least this dense counts as a liquid, whose beds expand homogeneously [kg/m3]."""


class Fluid(Checked):
    """A Newtonian fluid with constant viscosity or a viscosity that varies with height.

    Viscosity 0 means no drag and no films.

    >>> Fluid(density=998.0, viscosity=1e-3).viscosity_profile
    ()
    """

    density: float = Field(gt=0, description="density rho_f [kg/m3]")
    viscosity: float = Field(ge=0, description="dynamic viscosity eta [Pa s]")
    viscosity_profile: tuple[tuple[float, float], ...] = Field(
        (),
        description="[height, eta] pairs, interpolated linearly; the pre-run check uses `viscosity` [m, Pa s]",
    )

    @property
    def is_liquid(self) -> bool:
        """Whether it is a liquid, and not a gas."""
        return self.density >= LIQUID_DENSITY

    @model_validator(mode="after")
    def _profile_ordered_and_positive(self) -> Fluid:
        heights, values = [height for height, _ in self.viscosity_profile], [eta for _, eta in self.viscosity_profile]
        if sorted(set(heights)) != heights:
            raise InputError("viscosity_profile", heights, "[height, eta] pairs in increasing height, in m and Pa s")
        if self.viscosity_profile and not min(self.viscosity, *values) > 0.0:
            lowest = min(self.viscosity, *values)
            raise InputError("viscosity_profile", lowest, "above 0 everywhere, and so must viscosity")
        return self

    def viscosity_at(self, height: np.ndarray) -> np.ndarray:
        """Dynamic viscosity at heights [m] [Pa s].

        >>> Fluid(density=1e3, viscosity=1e-3, viscosity_profile=((0.0, 1e-3), (0.1, 5e-3))).viscosity_at([0.05, 0.2])
        array([0.003, 0.005])
        """
        if not self.viscosity_profile:
            return np.full(np.shape(height), self.viscosity)
        heights, values = np.array(self.viscosity_profile).T
        return np.interp(height, heights, values)


NO_FLUID = Fluid.model_construct(density=0.0, viscosity=0.0)
"""What is around dry particles: it weighs nothing, resists nothing, and is no liquid."""
