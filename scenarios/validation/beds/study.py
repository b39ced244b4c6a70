"""Beds compared with experiments or published laws: settling, fluidisation, bubbles, spouts, segregation.

Runs are kept as folders. Interrupted runs are continued; finished runs are not repeated.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from cfddem.analysis.bed_laws import buoyant_weight
from cfddem.analysis.bubbles import BubbleProfile, bubble_profile, find_bubbles
from cfddem.analysis.measures import pressure_drop
from cfddem.analysis.series import block_average, even, mean_frequency, spectrum
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from closures.bed import exponent_richardson_zaki
from scenarios.beds.defluidisation.study import layers, onsets
from scenarios.beds.gas_bed.study import mueller, van_wachem
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
from scenarios.validation.beds.refinement import refined
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
    for place, viscosity in (
        ("water", fluid.viscosity),
        ("syrup", SYRUP),
        ("water, between walls", None),
    ):
        found: list[Settling] = []
        for share in SOLID_FRACTIONS:
            progress(f"sedimentation in {place} at a solid fraction of {share:g}")
            found.append(between_walls(share) if viscosity is None else in_periodic_box(share, viscosity=viscosity))
        reynolds = fluid.density * found[0].terminal * case.bed.diameter / (viscosity or fluid.viscosity)
        law = exponent_richardson_zaki(reynolds, 0.0)
        own, start = exponent(found)
        points = [{"at": each.solid_fraction, "value": each.velocity, "reference": each.terminal} for each in found]
        rows += [
            Row(f"settling in {place}: exponent", own, law, 0.1 * law, points=points),
            Row(
                f"settling in {place}: velocity at zero solid fraction over that of one sphere",
                start / found[0].terminal,
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
    up, down = onsets(case.with_(**{"bed.inlet_velocity": slow}), run.history, layers(run))
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
    seen = [
        find_bubbles(run.fluid("voidage", int(place)), run.grid.spacing, surface=float(surface), flat=True)
        for place, surface in zip(places, surfaces)
    ]
    return bubble_profile(seen, SLABS)


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
    drops = [pressure_drop(run.fluid("pressure", int(place)), run.grid.spacing, height, top) for place in places]
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
