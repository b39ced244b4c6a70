"""Properties of every pair of materials: the table that contacts and films read. Nothing is compiled here."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from cfddem.backend.errors import InputError, nearest
from closures import contact, minimum_gap

PAIR = np.dtype(
    [
        ("film_modulus", "f8"),  # E* of the real solids [Pa]
        ("contact_modulus", "f8"),  # E* of the contact, possibly softened [Pa]
        ("shear_modulus", "f8"),  # G* of the contact [Pa]
        ("restitution", "f8"),  # e [-]
        ("damping_ratio", "f8"),  # alpha of Tsuji's dashpot [-]
        ("linear_damping_ratio", "f8"),  # zeta of the linear dashpot [-]
        ("friction", "f8"),  # mu, dry [-]
        ("friction_lubricated", "f8"),  # mu, while a film separates the solids [-]
        ("rolling_friction", "f8"),  # mu_r [-]
        ("work_of_adhesion", "f8"),  # w [J/m2]
        ("roughness_gap", "f8"),  # h_sigma [m]
    ],
    align=True,
)
"""One entry of the pair table."""

SMOOTHEST = 1e-10
"""Lower limit of the minimum gap of a pair, about the size of an atom; also used for solids without roughness [m]."""

_OVERRIDABLE = (
    "restitution",
    "friction",
    "friction_lubricated",
    "rolling_friction",
    "work_of_adhesion",
    "roughness_gap",
)


class Solid(Protocol):
    """What particles need from a material; :class:`cfddem.case.materials.Material` describes each value."""

    @property
    def density(self) -> float: ...
    @property
    def youngs_modulus(self) -> float: ...
    @property
    def poisson(self) -> float: ...
    @property
    def restitution(self) -> float: ...
    @property
    def friction(self) -> float: ...
    @property
    def rolling_friction(self) -> float: ...
    @property
    def friction_lubricated(self) -> float | None: ...
    @property
    def surface_energy(self) -> float: ...
    @property
    def roughness(self) -> float: ...
    @property
    def contact_modulus(self) -> float | None: ...


def pair_table(
    materials: Sequence[Solid], overrides: Mapping[tuple[int, int], Mapping[str, float]] | None = None
) -> np.ndarray:
    """Properties of every pair of materials.

    Two unlike materials get the lower restitution, the lower friction coefficients, the mean roughness, the
    reduced moduli and twice the geometric mean of the surface energies. `overrides` replaces single values.

    materials  solids of a run, including those of the walls
    overrides  {(i, j): {"friction": 0.3, ...}} with indices into `materials`
    returns    structured array (n, n) of dtype :data:`PAIR`, symmetric

    >>> from cfddem import Material
    >>> glass = Material(density=2500.0, youngs_modulus=60e9, poisson=0.23, restitution=0.97, friction=0.2)
    >>> nylon = Material(density=1140.0, youngs_modulus=2.5e9, poisson=0.4, restitution=0.9, friction=0.25)
    >>> pairs = pair_table([glass, nylon])
    >>> float(pairs[0, 1]["restitution"]), float(pairs[0, 1]["friction"])
    (0.9, 0.2)
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


def _contact_modulus(material: Solid) -> float:
    return material.youngs_modulus if material.contact_modulus is None else material.contact_modulus


def _lubricated(material: Solid) -> float:
    return material.friction if material.friction_lubricated is None else material.friction_lubricated
