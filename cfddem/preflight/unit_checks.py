"""Checks of units: values in SI units that no common fluid, solid or particle has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.case.wall_geometry import triangles
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.geometry_checks import bed_key, fits
from cfddem.preflight.issue import Issue, percent

LIGHT_GAS, VISCOUS_GAS, THIN_LIQUID, LIGHT_SOLID, SOFT_SOLID = 5.0, 1e-4, 5e-5, 10.0, 1e4
"""Plausible values in SI units; others suggest a wrong unit.

Fluids lighter than the first [kg/m3] are less viscous than the second [Pa s]; liquids are more viscous than the third;
solids are denser than the fourth [kg/m3] and stiffer than the last [Pa].
"""

LARGE_TENSION, ROUGH = 3.0, 0.05
"""Surface tension above that of every liquid, molten metals included [N/m]; roughness over the diameter of a particle
above which the surface is no longer that of a sphere [-]."""

LARGE_SURFACE, FITTING = 30.0, 3.0
"""Size of a surface over that of the column above which its file may be in mm, if it is in mm below the second [-]."""

LARGE_PARTICLE, VISCOUS_LIQUID = 0.1, 0.1
"""Diameter [m] and viscosity [Pa s] from which values may have been given in mm and mPa s."""


def check_length(case: Case, refused: bool) -> list[Issue]:
    """Check that the particles are not so large that their diameter is in mm; an error in a case that is refused."""
    diameter, narrowest = case.bed.largest_diameter, min(case.column.size)
    if diameter < LARGE_PARTICLE:
        return []
    beyond = "" if fits(case) else f", more than the column, {narrowest:.3g} m"
    reason = f"{diameter:.3g} m{beyond}; did you mean {1e-3 * diameter:.3g} m ({diameter:.3g} mm)?"
    return [Issue("error" if refused else "warning", bed_key(case, "diameter"), reason, "give all lengths in m")]


def unit_of_velocity(case: Case, bed: BedEstimate) -> str:
    """The unit that an inlet velocity above the terminal velocity suggests, as a question; empty if none."""
    fluid = case.required_fluid
    viscosity = fluid.viscosity
    if fluid.is_liquid and viscosity >= VISCOUS_LIQUID:
        return f"viscosity {viscosity:g} Pa s is {viscosity / 1e-3:.0f} times that of water; is it in mPa s?"
    if bed.onset < 1e-3 * bed.inlet < bed.terminal:
        return f"is it in mm/s? {1e-3 * bed.inlet:.3g} m/s fluidises the bed"
    return ""


def check_scales(case: Case) -> Iterator[Issue]:
    """Check that no surface file is so large that it may be in mm; an error where none of it lies in the column."""
    size = np.array(case.column.size)
    for number, wall in enumerate(case.wall):
        if wall.shape != "surface" or wall.scale != 1.0:
            continue
        try:
            corners = triangles(wall)
        except (InputError, OSError, ValueError):  # a surface that cannot be read is reported elsewhere
            continue
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        times = float((high - low).max() / size.max())
        if not LARGE_SURFACE < times < 1e3 * FITTING:
            continue
        near = ((corners.min(axis=1) <= size) & (corners.max(axis=1) >= 0.0)).all(axis=1)
        ends = " to ".join(f"({', '.join(f'{each:.4g}' for each in corner)})" for corner in (low, high))
        where = "is" if near.any() else "lies outside the column and is"
        yield Issue(
            "warning" if near.any() else "error", f"wall.{number}.scale",
            f"the surface, from {ends} m, {where} {times:.3g} times as large; is the file in millimetres?",
            "scale = 0.001 reads it in mm",
        )  # fmt: skip


def check_units(case: Case) -> Iterator[Issue]:
    """Check that densities, viscosities and moduli are plausible in SI units."""
    fluid = case.fluid
    if fluid is not None and fluid.density < LIGHT_GAS and fluid.viscosity > VISCOUS_GAS:
        yield Issue(
            "warning", "fluid.density",
            f"{fluid.density:.3g} kg/m3 is that of a gas, but {fluid.viscosity:.3g} Pa s is not",
            "water has 1000 kg/m3 and 1e-3 Pa s, air 1.2 kg/m3 and 1.8e-5 Pa s",
        )  # fmt: skip
    if fluid is not None and fluid.is_liquid and 0.0 < fluid.viscosity < THIN_LIQUID:
        yield Issue(
            "warning", "fluid.viscosity", f"{fluid.viscosity:.3g} Pa s is below that of any common liquid",
            "give the dynamic viscosity, the kinematic one times the density; water has 1e-3 Pa s",
        )  # fmt: skip
    if case.liquid is not None and case.liquid.surface_tension > LARGE_TENSION:
        tension = case.liquid.surface_tension
        yield Issue(
            "error", "liquid.surface_tension", f"{tension:.3g} N/m is above that of any liquid; did you mean "
            f"{1e-3 * tension:.3g} N/m ({tension:.3g} mN/m)?", "water has 0.072 N/m",
        )  # fmt: skip
    smallest: dict[str, float] = {}
    for species in case.species.values():
        name = case.material_name_of(species)
        smallest[name] = min(species.diameter, smallest.get(name, species.diameter))
    for name, diameter in smallest.items():
        rough = case.material[name].roughness
        if rough > ROUGH * diameter:
            yield Issue(
                "error", f"material.{name}.roughness",
                f"{rough:.3g} m is {percent(rough / diameter)} of the diameter; the limit is {percent(ROUGH)}",
                "give it in m; smooth glass has about 1e-7",
            )  # fmt: skip
    for name, solid in case.material.items():
        if solid.density < LIGHT_SOLID:
            yield Issue(
                "warning", f"material.{name}.density",
                f"{solid.density:.3g} kg/m3 is below that of any common solid",
                "densities are in kg/m3; glass has 2500",
            )  # fmt: skip
        if solid.youngs_modulus < SOFT_SOLID:
            yield Issue(
                "warning", f"material.{name}.youngs_modulus",
                f"{solid.youngs_modulus:.3g} Pa is below that of any common solid",
                "moduli are in Pa, glass has 6e10; to soften contacts only, set contact_modulus",
            )  # fmt: skip
