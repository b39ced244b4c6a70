"""Beds compared with experiments or published laws: settling, fluidisation, bubbles, spouts, segregation.

Runs are kept as folders. Interrupted runs are continued; finished runs are not repeated.

The width of the filter kernel and all physical parameters are kept. Runs with stiffer contacts use the shorter step and
are compared with the run that only has the shorter step.

A bed that slugs is an oscillator: a small change of the drag changes its amplitude much. The particles of its snapshots
are therefore also put into finer cells, which shows the error of the cells without that of the motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cfddem.analysis import measures
from cfddem.analysis.bed_laws import buoyant_weight
from cfddem.analysis.bubbles import BubbleProfile, bubble_profile, find_bubbles
from cfddem.analysis.series import Average, block_average, even, mean_frequency, spectrum
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run
from cfddem.run.history import pressure_drop
from cfddem.run.simulation import Simulation
from closures.bed import exponent_richardson_zaki
from scenarios.beds.defluidisation.study import onsets
from scenarios.beds.gas_bed.study import mueller, van_wachem
from scenarios.beds.liquid_bed.study import alginate
from scenarios.beds.sedimentation.study import (
    SOLID_FRACTIONS,
    SYRUP,
    Settling,
    between_walls,
    exponent,
    in_periodic_box,
    vessel,
)
from scenarios.beds.segregation.study import VELOCITIES, balance, figure, mixture, separation, thresholds
from scenarios.beds.spouted_bed.study import BED_HEIGHT, SPOUTED, profiles
from scenarios.beds.spouted_bed.study import bed as spout
from scenarios.validation.kept_runs import finished
from scenarios.validation.table import Progress, Row, numbers

MUELLER_HEIGHT, PROBE = 0.05, 0.045
"""Measured height of Mueller's bed, and height of the pressure probe in van Wachem's [m]."""

SLABS = np.linspace(0.0, 0.12, 5)
"""Intervals of height in which bubbles are counted [m]."""

TRACE = 600
"""Values to which a digitised trace is interpolated."""

LEAST_APART = 0.8
"""Largest deviation of the separation from 1 for two species that have separated as predicted."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run the beds, and return the table."""
    return [
        *sedimentation(progress),
        *defluidised(folder, progress),
        *segregated(folder, progress),
        *bubbling(folder, progress),
        *flat(folder, progress),
        *spouted(folder, progress),
        *refined(folder, progress),
    ]


def sedimentation(progress: Progress) -> list[Row]:
    """Exponents in water and in syrup, in a periodic box and between walls."""
    rows = []
    case = vessel()
    fluid = case.required_fluid
    for place, viscosity in (("water", fluid.viscosity), ("syrup", SYRUP), ("water, between walls", None)):
        settlings: list[Settling] = []
        for share in SOLID_FRACTIONS:
            progress(f"sedimentation in {place} at a solid fraction of {share:g}")
            settlings.append(between_walls(share) if viscosity is None else in_periodic_box(share, viscosity=viscosity))
        reynolds = fluid.density * settlings[0].terminal * case.bed.diameter / (viscosity or fluid.viscosity)
        law = exponent_richardson_zaki(reynolds, 0.0)
        own, start = exponent(settlings)
        points = [
            {"at": settling.solid_fraction, "value": settling.velocity, "reference": settling.terminal}
            for settling in settlings
        ]
        rows += [
            Row(f"settling in {place}: exponent", own, law, 0.1 * law, points=points),
            Row(
                f"settling in {place}: velocity at zero solid fraction over that of one sphere",
                start / settlings[0].terminal,
                1.0,
            ),
        ]
    return rows


def defluidised(folder: Path, progress: Progress) -> list[Row]:
    """Minimum fluidisation on a slow ramp."""
    case = gallery()["defluidisation"]
    assert not isinstance(case.bed.inlet_velocity, float)
    slow = tuple((5.0 * time, speed) for time, speed in case.bed.inlet_velocity)
    run = finished(case, folder, "defluidisation", progress, {"bed.inlet_velocity": slow, "run.until": 6.5})
    up, down = onsets(case.with_(**{"bed.inlet_velocity": slow}), run.history)
    return [
        Row("fluidised: minimum velocity over balance, up", up.velocity / up.balance, 1.0, 0.05),
        Row("defluidised: minimum velocity over balance, down", down.velocity / down.balance, 1.0, 0.05),
        Row("bed voidage after the ramp minus before", down.voidage - up.voidage),
    ]


def segregated(folder: Path, progress: Progress) -> list[Row]:
    """Which species lies above, on both sides of the velocity of equal bulk densities."""
    published, end = thresholds(mixture()), 12.0
    rows = [
        Row(
            "two species change places, by the drag law", balance(mixture()), float(np.mean(list(published.values()))),
            unit="m/s", note=f"published: {min(published.values()):.3g} to {max(published.values()):.3g}",
        )
    ]  # fmt: skip
    runs = {}
    for velocity in VELOCITIES:
        case, slow = mixture(velocity), velocity < min(published.values())
        runs[velocity] = run = finished(case, folder, f"segregation_{velocity:g}", progress, {"run.until": end})
        beads, pellets = case.species
        apart = separation(run.history, (beads, pellets) if slow else (pellets, beads), 0.75 * end)
        above = pellets if slow else beads
        rows.append(Row(f"{above} above at {velocity:g} m/s: 0 mixed, 1 in layers", apart, 1.0, LEAST_APART))
    figure(runs, folder / "segregation.png")
    return rows


def spouted(folder: Path, progress: Progress) -> list[Row]:
    """A slice of the bed of Yue et al. (2020); its measured profiles are not available."""
    case, begin = spout(), 1.0
    run = finished(case, folder, "spouted", progress, {"run.until": 4.0, "run.average_from": begin})
    drop = block_average(run.history["pressure_drop"][run.history["time"] >= begin])
    weight = buoyant_weight(case) / case.column.floor_area
    note = f"error {drop.error / weight:.2g}; reference at the largest depth that spouts steadily"
    rows = [Row("spouted: pressure drop over weight", drop.mean / weight, SPOUTED, note=note)]
    for profile in profiles(run, case.column.width, begin):
        level = f"spouted, at {profile.height / BED_HEIGHT:.2f} of the bed's height:"
        fastest = float(np.nanmax(profile.speed, initial=0.0))
        rows.append(Row(f"{level} largest mean particle speed", fastest, unit="m/s"))
        rows.append(Row(f"{level} width of the spout", profile.spout_width, unit="m"))
    return rows


def bubbling(folder: Path, progress: Progress) -> list[Row]:
    """Mueller's bed."""
    case = mueller()
    run = finished(case, folder, "mueller", progress, {"run.until": 10.1})
    window = run.history["time"] > 1.1
    height = block_average(run.history["bed_height"][window])
    note = f"standard error {height.error:.2g}"
    return [
        Row("Mueller: mean height", height.mean, MUELLER_HEIGHT, 0.15 * MUELLER_HEIGHT, "m", note),
        *_weight("Mueller", case, run.history, window),
    ]


def flat(folder: Path, progress: Progress) -> list[Row]:
    """Van Wachem's bed."""
    case = van_wachem()
    run = finished(case, folder, "van_wachem", progress, {"run.until": 12.0, "run.average_from": 2.0})
    window = run.history["time"] > 2.0
    height = block_average(run.history["bed_height"][window])
    interval, heights = even(run.history["time"][window], run.history["bed_height"][window])
    times, probed = probe(run, 2.0)
    between, pressures = even(times, probed)
    return [
        Row("van Wachem: mean height", height.mean, 0.125, 0.0125, "m", f"standard error {height.error:.2g}"),
        Row("van Wachem: standard deviation of the height over measured, log2", math.log2(heights.std() / 0.014), 0.0),
        Row("van Wachem: main frequency of the height", spectrum(heights, interval).main, 2.65, 0.53, "Hz"),
        Row(
            "van Wachem: standard deviation of the pressure over measured, log2",
            math.log2(pressures.std() / 82.0),
            0.0,
            1.0,
        ),
        Row("van Wachem: main frequency of the pressure", spectrum(pressures, between).main, 2.25, 0.45, "Hz"),
        frequency("pressure", between, pressures),
        frequency("height", interval, heights),
        *_weight("van Wachem", case, run.history, window),
        *growing(bubbles(run, 2.0)),
    ]


def frequency(quantity: str, interval: float, values: np.ndarray) -> Row:
    """Mean frequency of a signal of van Wachem's bed and of the measured one, within two errors of their difference."""
    times, trace = numbers(f"vanwachem2001_{quantity}").values()
    spacing, measured = even(times, trace, TRACE)
    here, there = mean_frequency(values, interval), mean_frequency(measured, spacing)
    note = f"{here.periods} periods, error {here.error:.2g}; measured {there.periods}, error {there.error:.2g}"
    limit = 2.0 * math.hypot(here.error, there.error)
    return Row(f"van Wachem: mean frequency of the {quantity}", here.frequency, there.frequency, limit, "Hz", note)


def bubbles(run: RunData, begin: float) -> BubbleProfile:
    """Bubbles of a flat bed against height, from a time on [s]."""
    assert run.grid is not None
    places = np.flatnonzero(run.times > begin)
    surfaces = np.interp(run.times[places], run.history["time"], run.history["bed_height"])
    profiles = [
        find_bubbles(run.fluid("voidage", int(place)), run.grid.spacing, surface=float(surface), flat=True)
        for place, surface in zip(places, surfaces)
    ]
    return bubble_profile(profiles, SLABS)


def growing(profile: BubbleProfile) -> list[Row]:
    """Bubble size in each interval of height, and whether it grows with height."""
    rows = []
    for low, high, number, size, error in zip(SLABS, SLABS[1:], *profile):
        name = f"van Wachem: bubble diameter at {1e3 * low:.0f} to {1e3 * high:.0f} mm"
        rows.append(Row(name, float(size), unit="m", note=f"{number:.2g} at a time, standard error {error:.2g}"))
    sizes = profile.diameter[profile.number > 0.0]
    shrinks = float(np.count_nonzero(np.diff(sizes) <= 0.0)) if len(sizes) > 1 else math.nan
    return [*rows, Row("van Wachem: intervals of height in which bubbles are not larger than below", shrinks, 0.0, 0.0)]


def probe(run: RunData, begin: float, height: float = PROBE) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and pressure at a height over that at the top [Pa], from the snapshots of a run."""
    assert run.grid is not None
    top = run.grid.spacing[2] * run.grid.cells[2]
    places = np.flatnonzero(run.times > begin)
    drops = [
        measures.pressure_drop(run.fluid("pressure", int(place)), run.grid.spacing, height, top) for place in places
    ]
    return run.times[places], np.array(drops)


def _weight(name: str, case: Case, history: dict[str, np.ndarray], window: np.ndarray) -> list[Row]:
    """Pressure drop over weight, without and with the contact force on the floor and the sides."""
    weight = buoyant_weight(case) / case.column.floor_area
    drop = block_average(history["pressure_drop"][window])
    walls = block_average(history["wall_load"][window])
    note = f"error {drop.error / weight:.2g}"
    return [
        Row(f"{name}: pressure drop over weight", drop.mean / weight, 1.0, 0.03, note=note),
        Row(f"{name}: pressure drop and wall support over weight", (drop.mean + walls.mean) / weight, 1.0, 0.01),
    ]


# ---------------------------------------------------------------- numerical convergence of beds


LIMIT = 0.05
"""Largest relative change of a converged mean."""

FINER = 1.5
"""Factor by which cells are finer."""

INSTANT, STEPS = 2e-5, 12
"""Fluid step [s], and their number, in which the gas flow adapts to given particles; these move by 0.1 mm."""


@dataclass(frozen=True)
class RefinementBed:
    """A bed, and the length of its run."""

    case: Case
    averaged_from: float  # [s]
    until: float  # [s]
    seeds: tuple[int, ...] = (1,)  # of the runs with stiffer contacts, and of those that they are compared with


class Means(NamedTuple):
    """Means that are compared, each with its standard error."""

    height: Average  # [m]
    drop: Average  # [Pa]
    variance: Average  # of the pressure drop [Pa2]

    @classmethod
    def of_seeds(cls, runs: Sequence[Means]) -> Means:
        """Means of runs that differ by their seed alone; errors by those of the runs, or by their scatter if larger."""
        if len(runs) == 1:
            return runs[0]
        return cls(*(_of_seeds(averages) for averages in zip(*runs)))


def _of_seeds(averages: Sequence[Average]) -> Average:
    values, errors = np.array([(average.mean, average.error) for average in averages]).T
    error = max(math.hypot(*errors) / len(values), float(values.std(ddof=1)) / len(values) ** 0.5)
    return averages[0]._replace(mean=float(values.mean()), error=error)


def liquid() -> RefinementBed:
    """Alginate beads in water, uniformly fluidised."""
    changes = {
        "title": "Liquid bed, for refinement",
        "column.width": 0.032,
        "bed.count": 1600,
        "run.particle_step": 4e-5,
    }
    return RefinementBed(alginate(0.009).with_(**changes), 6.0, 9.0)


def gas() -> RefinementBed:
    """Slugs of air in the narrow column of the gallery's ramp."""
    case = gallery()["defluidisation"]
    changes = {"title": "Slugging bed, for refinement", "bed.inlet_velocity": 0.6, "run.every": 0.25}
    return RefinementBed(case.with_(**changes), 1.0, 6.0, seeds=(1, 2))


def variants(case: Case) -> dict[str, tuple[dict[str, Any], str]]:
    """Changes to a case by name, and the name of the run that each is compared with."""
    step = case.run.particle_step
    assert step is not None
    stiffer = {
        f"material.{name}.contact_modulus": 4.0 * material.contact_modulus
        for name, material in case.material.items()
        if material.contact_modulus is not None
    }
    half = {"run.particle_step": 0.5 * step}
    return {
        "as it is": ({}, ""),
        "cells finer by 1.5": ({"column.cell": finer_cells(case, FINER)}, "as it is"),
        "half the particle step": (half, "as it is"),
        "four times the contact modulus": (stiffer | half, "half the particle step"),
    }


def finer_cells(case: Case, factor: float) -> tuple[float, ...]:
    """Edges of cells that are finer by a factor, except across a column one cell thick [m]."""
    return tuple(edge if edge >= whole else edge / factor for edge, whole in zip(_edges(case), case.column.size))


def _edges(case: Case) -> tuple[float, float, float]:
    cell = case.column.cell
    return cell if isinstance(cell, tuple) else (cell, cell, cell)


def refined(folder: Path, progress: Progress) -> list[Row]:
    """A liquid bed and a gas bed that slugs."""
    rows = []
    for name, bed in (("liquid bed", liquid()), ("slugging gas bed", gas())):
        by_change: dict[str, Means] = {}
        for change, (changes, other) in variants(bed.case).items():
            limits = {"run.until": bed.until, "run.average_from": bed.averaged_from}
            runs = []
            for seed in bed.seeds if "run.particle_step" in changes else (1,):
                home = _home(name, change) + f"_seed_{seed}" * (seed > 1)
                run = finished(bed.case, folder, home, progress, changes | limits | {"bed.seed": seed})
                runs.append(means(run, bed.averaged_from))
            by_change[change] = Means.of_seeds(runs)
            if other:
                rows += compared(f"{name}, {change}", by_change[change], by_change[other], gusty=name != "liquid bed")
    progress("particles of the slugging gas bed in finer cells")
    return [*rows, *same_particles(gas(), open_run(folder / _home("slugging gas bed", "as it is")))]


def _home(name: str, change: str) -> str:
    """Folder of a run."""
    return f"refinement_{name}_{change}".replace(" ", "_")


def same_particles(bed: RefinementBed, run: RunData) -> list[Row]:
    """Ratios of the pressure drop, and of its deviation, of the particles of the snapshots in finer and finer cells."""
    factors = (1.0, FINER, 2.0 * FINER)
    drops = [instantaneous_drops(bed.case, run, bed.averaged_from, factor) for factor in factors]
    rows = []
    for factor, coarser, finer, coarse in zip(factors[1:], factors, drops[1:], drops):
        name = f"slugging gas bed, same particles in cells finer by {factor:g}"
        other = "those of the case" if coarser == 1.0 else f"cells finer by {coarser:g}"
        for quantity, ratio in (
            ("pressure drop", finer.mean() / coarse.mean()),
            ("standard deviation of the pressure", finer.std() / coarse.std()),
        ):
            note = f"{len(finer)} snapshots"
            rows.append(Row(f"{name}: {quantity} over that in {other}", float(ratio), 1.0, LIMIT, note=note))
    return rows


def instantaneous_drops(case: Case, run: RunData, begin: float, factor: float) -> np.ndarray:
    """Pressure drop over the particles of every snapshot from a time on [s], in cells that are finer by a factor."""
    drops = []
    for place in np.flatnonzero(run.times > begin):
        simulation = placed(case, run.particles(int(place)), factor)
        simulation.until(STEPS * INSTANT)
        drops.append(pressure_drop(simulation))
    return np.array(drops)


def placed(case: Case, particles: Mapping[str, np.ndarray], factor: float) -> Simulation:
    """The particles of a snapshot in cells that are finer by a factor; the gas is not in balance with them yet."""
    changes = {
        "column.cell": finer_cells(case, factor),
        "bed.count": None,
        "bed.positions": particles["position"].tolist(),
        "run.fluid_step": INSTANT,
    }
    simulation = Simulation(case.with_(**changes))
    simulation.particles.velocity[:] = particles["velocity"][simulation.particles.id]
    return simulation


def means(run: RunData, begin: float) -> Means:
    """Means of a run from a time on [s]."""
    history: Mapping[str, np.ndarray] = run.history
    window = history["time"] > begin
    drop = history["pressure_drop"][window]
    return Means(
        block_average(history["bed_height"][window]), block_average(drop), block_average((drop - drop.mean()) ** 2)
    )


def compared(name: str, changed: Means, kept: Means, gusty: bool) -> list[Row]:
    """Ratios of the means; for a bed that is not uniform, also of the pressure fluctuations."""
    rows = [
        _ratio(f"{name}: height over the reference run", changed.height, kept.height),
        _ratio(f"{name}: pressure drop over the reference run", changed.drop, kept.drop),
    ]
    if gusty:
        title = f"{name}: standard deviation of the pressure over the reference run"
        rows.append(_ratio(title, changed.variance, kept.variance, 0.5))
    return rows


def _ratio(quantity: str, changed: Average, kept: Average, power: float = 1.0) -> Row:
    error = power * np.hypot(changed.error / changed.mean, kept.error / kept.mean)
    return Row(quantity, float((changed.mean / kept.mean) ** power), 1.0, LIMIT, note=f"standard error {error:.2g}")
