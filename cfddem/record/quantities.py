"""The quantities that a run records: unit and long name of each, the same in HDF5, tables and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from cfddem.errors import InputError


class Quantity(NamedTuple):
    """What a number is, and in what unit."""

    unit: str
    long_name: str


KNOWN = {
    "time": Quantity("s", "time"),
    "step": Quantity("1", "number of the step"),
    "id": Quantity("1", "name of the particle, never changes"),
    "position": Quantity("m", "position of the centre"),
    "velocity": Quantity("m/s", "velocity"),
    "spin": Quantity("rad/s", "angular velocity"),
    "radius": Quantity("m", "radius"),
    "density": Quantity("kg/m3", "density"),
    "material": Quantity("1", "row of the table of materials"),
    "species": Quantity("1", "number of the species, in the order of the case"),
    "force": Quantity("N", "sum of all forces"),
    "torque": Quantity("N m", "sum of all torques"),
    "drag": Quantity("N", "drag force"),
    "voidage": Quantity("1", "volume fraction of the fluid"),
    "pressure": Quantity("Pa", "pressure without the hydrostatic one"),
    "bed_height": Quantity("m", "height below which 99 % of the particle volume lies"),
    "pressure_drop": Quantity("Pa", "pressure drop from below the floor, without the hydrostatic one"),
    "wall_support": Quantity("Pa", "weight that floor and sides carry by contact, over the floor"),
    "bed_voidage": Quantity("1", "mean voidage of the bed, by its height"),
    "bed_voidage_pressure": Quantity("1", "mean voidage of the bed, by the slope of the pressure within it"),
    "granular_temperature": Quantity("m2/s2", "third of the mean square of the fluctuating velocity"),
    "kinetic_energy": Quantity("J", "kinetic energy of the particles"),
    "particle_count": Quantity("1", "number of particles"),
    "contact_count": Quantity("1", "number of contacts"),
    "first": Quantity("1", "id of the first body"),
    "second": Quantity("1", "id of the second body; -1 - w for wall w"),
    "begin": Quantity("s", "time when the pair came within reach"),
    "end": Quantity("s", "time when the pair parted"),
    "place": Quantity("m", "where the first body was when the pair parted"),
    "stokes": Quantity("1", "Stokes number of the approach, normal"),
    "approach_speed": Quantity("m/s", "normal speed when the pair came within reach"),
    "minimum_gap": Quantity("m", "smallest gap of the film"),
    "roughness_gap": Quantity("m", "gap at which asperities touch"),
    "elastohydrodynamic_gap": Quantity("m", "gap at which the pressure of the film deforms the solids, at that speed"),
    "deformed": Quantity("1", "1 where the pressure of the film, not the asperities, set the smallest gap"),
    "friction": Quantity("1", "coefficient of friction in force"),
    "restitution": Quantity("1", "normal speed after over before"),
    "restitution_tangential": Quantity("1", "tangential speed after over before"),
    "closest_gap": Quantity("m", "smallest gap that the pair came to; below the smallest gap of the film solids met"),
    "lost_to_film": Quantity("J", "energy that the film took; not a number where the run counts no energies"),
    "lost_to_contact": Quantity("J", "energy that the dashpot of the contact took"),
    "lost_to_friction": Quantity("J", "energy that sliding took"),
    "weight": Quantity("1", "number of encounters that the row stands for"),
}

MEAN_HEIGHT = "mean_height_"
"""Begin of the columns that say, for each species of a mixture, how high its particles are."""


def quantity(name: str, fields: Mapping[str, Quantity], where: str) -> Quantity:
    """Unit and long name of a quantity: as the run declares it, else as it is known.

    name    of the quantity
    fields  what the run declares
    where   begin of the message if nobody knows it
    errors  InputError where a quantity has no unit
    """
    try:
        return fields[name] if name in fields else KNOWN[name]
    except KeyError:
        raise InputError(
            f"{where}.{name}", None, "declared with its unit and long name", f"add {name!r}: ('unit', 'long name')"
        ) from None
