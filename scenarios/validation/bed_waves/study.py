"""Waves in a uniform fluidised bed: one wave in a periodic box, against the linear theory of the same equations.

Spheres fill a periodic box evenly, and a mean fall of pressure carries them. A plane wave of the solid fraction is laid
over them, with the velocities that the theory gives it (:class:`closures.stability.UniformBed`); its amplitude is the
Fourier component of the particles' heights. The spheres start at random places, and the component that these happen to
have is taken out first. (On a lattice, the layers of spheres beat with the layers of cells.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.measures import cells_of, granular_temperature
from cfddem.case.schema import Case
from cfddem.particles.initial.packing import random_packing
from cfddem.plotting.curves import BLUE, GREEN, ORANGE, SKY, label, legend, panels, save
from cfddem.preflight.bed_waves import uniform_bed, with_agitation
from cfddem.run.simulation import Simulation
from closures.stability import UniformBed
from scenarios.validation.table import Progress, Row, write_histories

VOIDAGE = 0.64

ROOM = 1.07
"""Spheres larger by this are packed, so that none touch when the wave is laid over them."""

WAVES = 2
"""Wavelengths in the box."""

START, SMALL, END = 0.02, 0.045, 0.12
"""Amplitudes over the mean solid fraction: at the start, up to which a wave is linear, and at the end.

The growth of larger waves is weaker: it is reported, and not compared with a linear theory.
"""

SEEDS = (1, 2, 3, 4, 5)
"""Seeds of the packings in a validation."""

ROWS = 400
"""Readings of the amplitude in a run."""

ALUMINA = """
title = "One wave in a uniform bed"

[fluid]
density = 997.0
viscosity = 8.354e-4

[material.alumina]
density = 3585.9
youngs_modulus = 3.0e11
contact_modulus = 1.0e6
poisson = 0.3
restitution = 0.9
friction = 0.1

[column]
width = 0.036
height = 0.064
cell = 0.004
sides = "periodic"
ends = "periodic"

[bed]
diameter = 3.087e-3
start = "placed"
positions = [[0.0, 0.0, 0.0]]

[laws]
drag = "wen_yu"
lubrication = "none"
self_disturbance_correction = false
surface = "sharp"

[run]
until = 1.0
reference_speed = 0.1
"""


@dataclass(frozen=True)
class Measured:
    """A wave as the simulation shows it."""

    growth: float  # while the amplitude is small [1/s]
    later: float  # growth from there to the end; NaN if it does not get there [1/s]
    speed: float  # upward, against the mean of the particles [m/s]
    granular_temperature: float  # mean over the run, of particles about the mean of their layer [m2/s2]
    amplitude: np.ndarray  # of every reading, over the mean solid fraction
    time: np.ndarray  # [s]


def box(wavelength: float, *, cell: float = 0.004, seed: int = 1, **changes: object) -> Case:
    """Case of the box that holds waves of a length [m], a multiple of the cell."""
    case = Case.from_text(ALUMINA, "bed waves", {"column.height": WAVES * wavelength, "column.cell": cell, **changes})
    size = case.column.size
    count = round((1.0 - VOIDAGE) * math.prod(size) / case.bed.mean_volume)
    wider = np.full(count, ROOM * case.bed.diameter)
    places, _ = random_packing(wider, float((math.pi / 6.0 * wider**3).sum()) / math.prod(size), seed, shape=size)
    return case.with_(**{"bed.positions": [tuple(place) for place in places.tolist()], "bed.seed": seed})


def theory(case: Case) -> UniformBed:
    """The uniform bed of the case, with its kernel and added mass."""
    solids = case.particle_count * case.bed.mean_volume / math.prod(case.column.size)
    return uniform_bed(case, 1.0 - solids)


def single_wave(case: Case, wavelength: float, *, duration: float = 0.3) -> Measured:
    """Lay a wave over the box, follow it, and fit its growth.

    case        of `box`
    wavelength  [m]
    duration    at most [s]; the run ends earlier where the wave is large
    """
    bed, number = theory(case), 2.0 * math.pi / wavelength
    wave, slip, smoothed = bed.wave(wavelength), bed.slip(), math.exp(-0.5 * (number * bed.kernel) ** 2)
    rate = complex(wave.growth, -number * wave.speed)
    simulation = Simulation(case)
    fluid, particles = simulation.fluid, simulation.particles
    coupling = simulation.coupling
    height = particles.position[:, 2]
    by_particles = START * -rate / (1j * number)  # complex amplitudes of the velocities
    by_fluid = START * smoothed * (1.0 - bed.voidage) * (rate + 1j * number * slip) / (1j * number * bed.voidage)
    for _ in range(3):  # the displacement changes what it is made from: a second and third one mend the rest
        missing = START - 2.0 * np.exp(-1j * number * height).mean()
        height += (1j * missing * np.exp(1j * number * height)).real / number
    height %= case.column.height
    particles.velocity[:, 2] = (by_particles * np.exp(1j * number * height)).real
    particles.velocity += _random_motion(case, particles.count)
    simulation.particle_solver.refresh()
    fluid.boundaries.driving[2] = (1.0 - bed.voidage) * (bed.density - bed.fluid_density) * bed.gravity
    kernel = coupling.kernel
    fluid.set_voidage(1.0 - kernel.solid_fraction(kernel.map_particles(particles.position, particles.radius)))
    fluid.set_velocity((0.0, 0.0, lambda x, y, z: slip + (by_fluid * np.exp(1j * number * z)).real + 0.0 * x * y))
    times, components, temperatures = [], [], []
    for row in range(ROWS):
        simulation.until(duration * (row + 1) / ROWS)
        drift = float(particles.velocity[:, 2].mean())
        times.append(simulation.time)
        components.append(2.0 * np.exp(-1j * number * particles.position[:, 2]).mean())
        cells = cells_of(particles.position, fluid.grid.shape, fluid.grid.spacing)
        temperatures.append(granular_temperature(particles.velocity, cells).mean)
        if abs(components[-1]) > 1.3 * END or abs(drift) > 0.2 * slip:
            break
    return _fitted(np.array(times), np.array(components), number, float(np.mean(temperatures)))


def _random_motion(case: Case, count: int) -> np.ndarray:
    """Velocities of the granular temperature that the agitation of the case is expected to keep up (N, 3) [m/s]."""
    temperature = with_agitation(theory(case), case).granular_temperature
    draw = np.random.default_rng(case.bed.seed).normal(0.0, math.sqrt(temperature), (count, 3))
    return np.asarray(draw - draw.mean(axis=0))


def _fitted(time: np.ndarray, component: np.ndarray, number: float, temperature: float) -> Measured:
    """Growth of the wave while it is small, growth after that, and its speed."""
    amplitude = np.abs(component)
    small, last = (int(np.argmax(above)) if (above := amplitude > size).any() else len(time) for size in (SMALL, END))

    def growth(begin: int, end: int) -> float:
        inside = slice(begin, end)
        return float(np.polyfit(time[inside], np.log(amplitude[inside]), 1)[0]) if end - begin > 2 else math.nan

    turning = np.polyfit(time[:last], np.unwrap(np.angle(component[:last])), 1)[0]
    return Measured(growth(0, small), growth(small, last), float(-turning / number), temperature, amplitude, time)


CASES: tuple[tuple[float, float, str, dict[str, Any]], ...] = (
    (0.032, 0.004, "", {}),
    (0.048, 0.004, "", {}),
    (0.032, 0.004, ", with Zuber's added mass", {"laws.added_mass": "zuber"}),
    (0.032, 0.008, ", cells of 8 mm", {"column.width": 0.04}),
    (0.048, 0.012, ", cells of 12 mm", {}),
    (0.032, 0.004, ", with agitation", {"laws.agitation": "free_spheres"}),
    (0.048, 0.004, ", with agitation", {"laws.agitation": "free_spheres"}),
)
"""Wavelength and cell of each comparison [m], its name, and changes of the case."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Growth and speed of waves against linear theory: fine and coarse cells, added mass, agitation."""
    rows: list[Row] = []
    curves: dict[str, Any] = {}
    for wavelength, cell, text, changes in CASES:
        name = f"wave of {1e3 * wavelength:.0f} mm{text}"
        progress(name)
        cases = [box(wavelength, cell=cell, seed=seed, **changes) for seed in SEEDS]
        waves = [single_wave(case, wavelength) for case in cases]
        rows += _rows(name, cases[0], wavelength, waves)
        for seed, wave in zip(SEEDS, waves):
            curves[f"{name}, seed {seed}"] = {"time": (wave.time, "s"), "amplitude": (wave.amplitude, "-")}
    write_histories(folder / "histories.h5", curves)
    draw(folder / "waves.png", curves)
    return rows


def _rows(name: str, case: Case, wavelength: float, waves: list[Measured]) -> list[Row]:
    """Rows of one comparison: with agitation the wave must not grow."""
    growth, speed, temperature = (
        float(np.mean([getattr(wave, part) for wave in waves])) for part in ("growth", "speed", "granular_temperature")
    )
    spread = float(np.std([wave.growth for wave in waves], ddof=1) / math.sqrt(len(waves)))
    note = f"mean of {len(waves)} seeds, standard error {spread:.2g}"
    bed = theory(case)
    expected, later = bed.wave(wavelength), float(np.mean([wave.later for wave in waves]))
    if case.agitation != "none":
        agitated = with_agitation(bed, case)
        estimate = agitated.granular_temperature
        return [
            Row(f"growth above zero, {name}", max(growth, 0.0), 0.0, 2.0 * spread, "1/s", note),
            Row(f"growth, {name}", growth, agitated.wave(wavelength).growth, None, "1/s", "theory with agitation"),
            Row(f"granular temperature, {name}", temperature, estimate, None, "m2/s2", "estimate"),
        ]
    return [
        Row(f"growth, {name}", growth, expected.growth, 0.15 * expected.growth, "1/s", note),
        Row(f"growth above an amplitude of {SMALL:g}, {name}", later, expected.growth, None, "1/s", "not linear"),
        Row(f"speed, {name}", speed, expected.speed, 0.05 * expected.speed, "m/s"),
    ]


def draw(path: Path, curves: Mapping[str, Any]) -> None:
    """Amplitude of every wave against time; one panel for each wavelength, one colour for each case."""
    lengths = sorted({wavelength for wavelength, _, _, _ in CASES})
    figure, both = panels(len(lengths), width=10.0, height=4.2, sharey=True)
    for wavelength, axes in zip(lengths, both):
        beginning = f"wave of {1e3 * wavelength:.0f} mm"
        cases = [text for length, _, text, _ in CASES if length == wavelength]
        for colour, text in zip((BLUE, GREEN, SKY, ORANGE) if len(cases) > 3 else (BLUE, SKY, ORANGE), cases):
            for seed in SEEDS:
                columns = curves[f"{beginning}{text}, seed {seed}"]
                named = text.removeprefix(", ") or "fine cells, no agitation"
                axes.semilogy(
                    columns["time"][0], columns["amplitude"][0], color=colour, label=named if seed == SEEDS[0] else None
                )
        label(axes, "time", "s", "amplitude over mean solid fraction", "-", beginning)
        axes.set_yticks((0.02, 0.05, 0.1), ("0.02", "0.05", "0.1"))
        axes.minorticks_off()
        legend(axes)
    both[-1].set_ylabel("")
    save(figure, path)
