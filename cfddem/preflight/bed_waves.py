"""Waves in the liquid bed of a case, by linear theory: which ones grow, how fast, and what they do to the bed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from cfddem.backend.tables import table
from cfddem.case.schema import Case
from cfddem.preflight.bed_estimate import BedEstimate, bed_drag
from cfddem.preflight.issue import Issue, plain
from cfddem.preflight.law_ranges import outside, state_of
from closures.agitation import agitated_temperature, free_spheres
from closures.registry import Law, law_of
from closures.stability import UniformBed, Wave

GRID_DAMPING = 5.0
r"""Factor of the damping of a wave by cells of the height h, :math:`5\,(c/\lambda)\,(h/\lambda)^2`; smeared surfaces.

Measured with single waves in periodic boxes of alumina in water, 2 to 4 packings each
(`scenarios/validation/bed_waves`). With 4 cells in a wavelength of 32, 48 and 64 mm the growth is 1.7, 0.9 and 0.5 1/s
below the theory (standard error 0.3 to 0.6), which are factors of 7.7, 4.4 and 3.0. With 6 to 12 cells no damping can
be told from the scatter, and with sharp surfaces none with 4 cells either: those waves are not damped here.
"""

WARN_AT = 3.0
"""Growth times passage from which a warning is given: a disturbance grows twentyfold on its way through the bed."""

STEPS = 161
"""Wavelengths in the search for the fastest one."""


@dataclass(frozen=True)
class BedWaves:
    """The uniform bed of a case and its waves.

    bed       without agitation
    agitated  with the granular temperature that the agitation of the case would give it; the same without agitation
    height    of the bed; infinite in a periodic column [m]
    cell      height of the cells [m]
    shortest  wavelength [m]
    longest   wavelength [m]
    """

    bed: UniformBed
    agitated: UniformBed
    height: float
    cell: float
    shortest: float
    longest: float

    def on_cells(self, bed: UniformBed, wavelength: float) -> Wave:
        """Wave of this length with the damping of the cells, which there is with smeared surfaces only."""
        wave = bed.wave(wavelength)
        if bed.cell is None:
            return wave
        return wave._replace(growth=wave.growth - grid_damping(wave.speed, wavelength, self.cell))

    def wavelengths(self, count: int) -> list[float]:
        """Wavelengths from the shortest to the longest, in even ratios [m]."""
        ratio = self.longest / self.shortest
        return [self.shortest * ratio ** (place / (count - 1)) for place in range(count)]

    def fastest(self, bed: UniformBed) -> tuple[float, Wave]:
        """Wavelength that grows fastest on the cells [m], and its wave."""
        best = max(self.wavelengths(STEPS), key=lambda wavelength: self.on_cells(bed, wavelength).growth)
        return best, self.on_cells(bed, best)

    def amplification(self, wave: Wave) -> float:
        """Factor by which a wave grows on its way through the bed; infinite in a periodic column that is unstable."""
        if wave.growth <= 0.0 or wave.speed <= 0.0:
            return 1.0
        return math.exp(min(wave.growth * self.height / wave.speed, 700.0))


def summary(waves: BedWaves, count: int = 12) -> dict[str, Any]:
    """The page of `cfddem stability` as plain values.

    count  number of wavelengths in the table
    """
    rows = []
    for wavelength in waves.wavelengths(count):
        plain, on_cells = waves.bed.wave(wavelength), waves.on_cells(waves.bed, wavelength)
        agitated = waves.on_cells(waves.agitated, wavelength)
        rows.append({
            "wavelength": wavelength, "speed": plain.speed, "growth": plain.growth, "on_cells": on_cells.growth,
            "agitated": agitated.growth,
        })  # fmt: skip
    wavelength, wave = waves.fastest(waves.agitated)
    bed = waves.bed
    return {
        "voidage": bed.voidage, "slip": bed.slip(), "kernel": bed.kernel, "added_mass": bed.added_mass,
        "granular_temperature": waves.agitated.granular_temperature, "height": waves.height, "cell": waves.cell,
        "waves": rows,
        "fastest": {"wavelength": wavelength, **wave._asdict(), "amplification": waves.amplification(wave)},
    }  # fmt: skip


def lines(waves: BedWaves) -> list[str]:
    """The page of `cfddem stability` as text."""
    numbers = summary(waves)
    agitated = numbers["granular_temperature"] > 0.0
    kernel, added_mass = 1e3 * numbers["kernel"], numbers["added_mass"]
    out = [
        f"Uniform bed: voidage {numbers['voidage']:.3f}, slip {numbers['slip']:.3g} m/s, kernel {kernel:.3g} mm, "
        f"added mass {added_mass:.3g}"
    ]
    if agitated:
        temperature = numbers["granular_temperature"]
        share = temperature / numbers["slip"] ** 2
        out.append(f"Granular temperature by agitation: {temperature:.2g} m2/s2, {share:.2g} of the squared slip")
    rows: list[tuple[str, ...]] = [("mm", "m/s", "1/s", "1/s", "1/s")]
    for row in numbers["waves"]:
        rates = (f"{row[name]:.2f}" for name in ("growth", "on_cells", "agitated"))
        rows.append((f"{1e3 * row['wavelength']:.1f}", f"{row['speed']:.3f}", *rates))
    columns = 4 + agitated
    headings = ("wavelength", "speed", "growth", "on cells", "agitated")[:columns]
    out += ["", *table([row[:columns] for row in rows], headings, right=range(columns), widths=(12, 9, 9, 9, 9))]
    damping = "less the damping of the cells" if waves.bed.cell is not None else "the same with sharp surfaces"
    meaning = f"growth: by theory; on cells: {damping}"
    out += ["", meaning + "; agitated: on cells, with agitation" * agitated]
    fastest = numbers["fastest"]
    verb = "grows" if fastest["growth"] > 0.0 else "decays"
    out += [
        "",
        f"The fastest wave is {1e3 * fastest['wavelength']:.1f} mm long, moves up at {fastest['speed']:.3f} m/s and "
        f"{verb} at {abs(fastest['growth']):.2f} 1/s.",
    ]
    if math.isfinite(waves.height):
        grown = fastest["amplification"]
        consequence = ", which breaks up into plugs" if grown > math.exp(WARN_AT) else ""
        out.append(
            f"A disturbance grows {grown:.3g}-fold on its way through {1e3 * waves.height:.0f} mm of bed{consequence}."
        )
    return out


def grid_damping(speed: float, wavelength: float, cell: float) -> float:
    """Damping of a wave by the cells [1/s].

    speed       of the wave [m/s]
    wavelength  [m]
    cell        height of the cells [m]

    >>> round(grid_damping(0.108, 0.032, 0.008), 2)
    1.05
    """
    return GRID_DAMPING * abs(speed) / wavelength * (cell / wavelength) ** 2


def is_liquid_bed(case: Case) -> bool:
    """Whether a case is a bed of free particles in a liquid."""
    return case.in_liquid and case.particle_count > 1 and not case.stands_still


def waves_of(case: Case, bed: BedEstimate) -> BedWaves | None:
    """The waves of the bed of a case; None unless it is a fluidised liquid bed.

    In a periodic column the bed fills the column evenly.
    """
    column = case.column
    if not case.in_liquid or not case.resists or case.stands_still:
        return None
    height, voidage = bed.height, bed.voidage
    if column.ends == "periodic":
        height, voidage = math.inf, 1.0 - bed.solid_volume / (case.floor_area * column.height)
    elif not bed.inlet > bed.onset:
        return None
    if not (0.0 < voidage < 1.0 and case.solid_density > case.around.density and case.laws.gravity[2] < 0.0):
        return None
    uniform = uniform_bed(case, voidage)
    cell = column.cell if isinstance(column.cell, float) else column.cell[2]
    longest = min(column.height, height)
    shortest = max(2.0 * cell, 2.0 * case.bed.diameter)
    if longest <= shortest:
        return None
    return BedWaves(uniform, with_agitation(uniform, case), height, cell, shortest, longest)


def uniform_bed(case: Case, voidage: float) -> UniformBed:
    """The uniform bed of a case at a voidage, for linear theory, with its surfaces and without granular temperature."""
    fluid, cell = case.required_fluid, case.column.cell
    return UniformBed(
        voidage,
        case.bed.diameter,
        case.solid_density,
        fluid.density,
        fluid.viscosity,
        bed_drag(case),
        gravity=math.hypot(*case.laws.gravity),
        kernel=case.laws.kernel_width * case.bed.largest_diameter,
        added_mass=case.laws.added_mass_at(voidage),
        restitution=next(iter(case.material.values())).restitution,
        cell=None if case.surface == "sharp" else cell if isinstance(cell, float) else cell[2],
    )


def with_agitation(bed: UniformBed, case: Case) -> UniformBed:
    """The bed with the granular temperature that the fluctuating velocity of the case gives to free particles.

    An estimate, see :func:`closures.agitation.agitated_temperature`. Without agitation and for "lattanzi" the bed is
    unchanged.
    """
    law, factors = case.agitation, case.agitation_factors
    if not isinstance(law, Law):
        return bed
    slip, solid = bed.slip(), 1.0 - bed.voidage
    reynolds = bed.voidage * bed.fluid_density * slip * bed.diameter / bed.viscosity
    values = {"solid_fraction": solid, "reynolds": reynolds, "density_ratio": bed.density / bed.fluid_density}
    variance = 0.0
    for weight, along, share in ((1.0, 1.0, factors.along), (2.0, 0.0, factors.across)):
        arguments = {name: value for name, value in {**values, "along": along}.items() if name in law.arguments}
        variance += weight / 3.0 * share**2 * law.function(**arguments) * slip**2
    added = bed.added_mass * bed.fluid_density
    relaxation = (bed.density + added) / bed.resistance(bed.voidage, slip)
    time = factors.time * bed.diameter / slip
    temperature = agitated_temperature(variance, time, relaxation, bed.diameter, solid, bed.restitution)
    return replace(bed, granular_temperature=temperature)


def check_waves(case: Case, bed: BedEstimate) -> Iterator[Issue]:
    """Warn of a liquid bed without agitation in which waves grow strong before they reach its surface."""
    waves = waves_of(case, bed)
    if waves is None or case.agitation != "none" or math.isinf(waves.height):
        return
    wavelength, wave = waves.fastest(waves.bed)
    grown = waves.amplification(wave)
    if grown > math.exp(WARN_AT):
        beyond = outside(law_of(free_spheres), state_of(case, bed))
        beyond = f" ({beyond})" if beyond else ""
        fold = plain(float(f"{grown:.2g}"))
        yield Issue(
            "warning", "laws.agitation",
            f"without agitation, waves of {1e3 * wavelength:.2g} mm grow {fold}-fold on their way through the "
            "bed, which breaks up into plugs",
            f'set laws.agitation = "free_spheres", which weakens waves{beyond}; cfddem stability shows them',
        )  # fmt: skip
