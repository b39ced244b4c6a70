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

from cfddem.case.schema import Case
from cfddem.particles.initial.packing import random_packing
from cfddem.plotting.curves import label, legend, panels, save, shades
from cfddem.run.simulation import Simulation
from closures.stability import UniformBed
from scenarios.validation.table import Progress, Row, write_histories

VOIDAGE = 0.64

ROOM = 1.07
"""Spheres larger by this are packed, so that none touch when the wave is laid over them."""

WAVES = 2
"""Wavelengths in the box."""

START, FIT, END = 0.02, 0.03, 0.12
"""Amplitudes over the mean solid fraction: at the start, and where the growth is fitted."""

SEEDS = (1, 2, 3)
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

[run]
until = 1.0
reference_speed = 0.1
"""


@dataclass(frozen=True)
class Measured:
    """A wave as the simulation shows it."""

    growth: float  # [1/s]
    speed: float  # upward, against the mean of the particles [m/s]
    amplitude: np.ndarray  # of every reading, over the mean solid fraction
    time: np.ndarray  # [s]


def box(wavelength: float, *, cell: float = 0.004, seed: int = 1, **changes: object) -> Case:
    """Case of the box that holds waves of a length [m], a multiple of the cell."""
    case = Case.from_text(ALUMINA, "bed waves", {"column.height": WAVES * wavelength, "column.cell": cell, **changes})
    size = case.column.size
    count = round((1.0 - VOIDAGE) * math.prod(size) / case.bed.mean_volume)
    wider = np.full(count, ROOM * case.bed.diameter)
    places, _ = random_packing(wider, float((math.pi / 6.0 * wider**3).sum()) / math.prod(size), seed, shape=size)
    return case.with_(**{"bed.positions": [tuple(place) for place in places.tolist()]})


def theory(case: Case) -> UniformBed:
    """The uniform bed of the case, with its kernel and added mass."""
    assert case.fluid is not None and case.laws.drag_law is not None
    solids = case.particle_count * case.bed.mean_volume / math.prod(case.column.size)
    return UniformBed(
        1.0 - solids,
        case.bed.diameter,
        case.solid.density,
        case.fluid.density,
        case.fluid.viscosity,
        case.laws.drag_law.function,
        gravity=abs(case.laws.gravity[2]),
        kernel=case.laws.kernel_width * case.bed.diameter,
        added_mass=case.laws.added_mass,
    )


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
    assert fluid is not None
    height = particles.position[:, 2]
    by_particles = START * -rate / (1j * number)  # complex amplitudes of the velocities
    by_fluid = START * smoothed * (1.0 - bed.voidage) * (rate + 1j * number * slip) / (1j * number * bed.voidage)
    for _ in range(3):  # the displacement changes what it is made from: a second and third one mend the rest
        missing = START - 2.0 * np.exp(-1j * number * height).mean()
        height += (1j * missing * np.exp(1j * number * height)).real / number
    height %= case.column.height
    particles.velocity[:, 2] = (by_particles * np.exp(1j * number * height)).real
    simulation.particle_solver.refresh()
    fluid.boundaries.driving[2] = (1.0 - bed.voidage) * (bed.density - bed.fluid_density) * bed.gravity
    kernel = simulation.exchange.kernel
    fluid.set_voidage(1.0 - kernel.solid_fraction(kernel.map_particles(particles.position, particles.radius)))
    fluid.set_velocity((0.0, 0.0, lambda x, y, z: slip + (by_fluid * np.exp(1j * number * z)).real + 0.0 * x * y))
    times, components = [], []
    for row in range(ROWS):
        simulation.until(duration * (row + 1) / ROWS)
        drift = float(particles.velocity[:, 2].mean())
        times.append(simulation.time)
        components.append(2.0 * np.exp(-1j * number * particles.position[:, 2]).mean())
        if abs(components[-1]) > 1.3 * END or abs(drift) > 0.2 * slip:
            break
    return _fitted(np.array(times), np.array(components), number)


def _fitted(time: np.ndarray, component: np.ndarray, number: float) -> Measured:
    """Growth and speed of the wave where its amplitude is large against noise and small against one."""
    amplitude = np.abs(component)
    last = int(np.argmax(amplitude > END)) if (amplitude > END).any() else len(time)
    inside = slice(int(np.argmax(amplitude[:last] > FIT)) if (amplitude[:last] > FIT).any() else 0, last)
    growth = np.polyfit(time[inside], np.log(amplitude[inside]), 1)[0]
    turning = np.polyfit(time[inside], np.unwrap(np.angle(component[inside])), 1)[0]
    return Measured(float(growth), float(-turning / number), amplitude, time)


def study(folder: Path, progress: Progress) -> list[Row]:
    """Growth and speed of two waves against theory, and the short wave with agitation."""
    rows: list[Row] = []
    curves: dict[str, Any] = {}
    for wavelength, agitation in ((0.032, "none"), (0.048, "none"), (0.032, "pseudo_turbulence")):
        name = f"wave of {1e3 * wavelength:.0f} mm" + (", with agitation" if agitation != "none" else "")
        progress(name)
        cases = [box(wavelength, seed=seed, **{"laws.agitation": agitation}) for seed in SEEDS]
        waves = [single_wave(case, wavelength) for case in cases]
        expected = theory(cases[0]).wave(wavelength)
        growth, speed = (float(np.mean([getattr(each, part) for each in waves])) for part in ("growth", "speed"))
        spread = float(np.std([each.growth for each in waves], ddof=1) / math.sqrt(len(waves)))
        note = f"mean of {len(waves)} seeds, standard error {spread:.2g}"
        if agitation == "none":
            rows.append(Row(f"growth, {name}", growth, expected.growth, 0.1 * expected.growth, "1/s", note))
            rows.append(Row(f"speed, {name}", speed, expected.speed, None, "m/s"))
        else:
            rows.append(Row(f"growth above zero, {name}", max(growth, 0.0), 0.0, 2.0 * spread, "1/s", note))
            rows.append(Row(f"growth, {name}", growth, expected.growth, None, "1/s", "theory without agitation"))
        for seed, each in zip(SEEDS, waves):
            curves[f"{name}, seed {seed}"] = {"time": (each.time, "s"), "amplitude": (each.amplitude, "-")}
    write_histories(folder / "histories.h5", curves)
    draw(folder / "waves.png", curves)
    return rows


def draw(path: Path, curves: Mapping[str, Any]) -> None:
    """Amplitude of every wave against time."""
    figure, axes = panels()
    for shade, (name, columns) in zip(shades(len(curves)), curves.items()):
        axes.semilogy(columns["time"][0], columns["amplitude"][0], color=shade, label=name)
    label(axes, "time", "s", "amplitude over mean solid fraction", "-")
    legend(axes)
    save(figure, path)
