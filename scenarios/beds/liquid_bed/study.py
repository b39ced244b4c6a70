"""A liquid-fluidised bed: its pressure drop carries its weight, and it expands as published laws predict.

Beads of glass in water, and of alumina and alginate after Ferreira et al. (2023), between frictionless sides. The
default case is a short demonstration; the studies here run longer, at several velocities.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.collections import EllipseCollection

from cfddem.analysis.bed_laws import buoyant_weight, expansion_laws
from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.io.reading import open_run
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.expansion import expansion_exponents
from cfddem.run import history
from cfddem.run.simulation import Simulation


@dataclass(frozen=True)
class Study:
    """A bed at several superficial velocities."""

    case: Callable[[float], Case]  # of a velocity [m/s]
    velocities: tuple[float, ...]  # [m/s]
    starting: float  # start of the averages [s]
    averaged: float  # length of the averages [s]


@dataclass(frozen=True)
class FluidisedBed:
    """Means of a fluidised bed."""

    velocity: float  # [m/s]
    drop_over_weight: float
    carried: float  # pressure drop and load of the walls, over the weight
    voidage: float
    balance: float  # at which the drag law carries a uniform bed
    expected: float  # mean of the published laws
    lowest: float  # of the published laws
    highest: float
    exponent: float  # of Richardson and Zaki
    height: float  # [m]
    layers: float  # deviation in time of the solid fraction of layers of 2.5 d in the lower two thirds
    inside: float  # voidage of these layers


def glass(velocity: float) -> Case:
    """The case of the gallery at another velocity [m/s], in a column high enough."""
    changes = {"bed.inlet_velocity": velocity, "column.height": 0.04}
    return Case.from_toml(gallery_files()["liquid-bed"], changes)


def coarse_glass(velocity: float) -> Case:
    """The same bed of beads 1.6 times as large, in a column as many diameters wide, at a velocity [m/s]."""
    return glass(velocity).with_(
        **{
            "title": "Liquid-fluidised bed of coarse glass beads",
            "column.width": 0.016,
            "column.height": 0.064,
            "column.cell": 0.004,
            "bed.diameter": 1.6e-3,
            "run.reference_speed": 0.08,
            "run.particle_step": None,
        }
    )


def alumina(velocity: float) -> Case:
    """Heavier and larger beads at a velocity [m/s], after Ferreira et al. (2023); plugs rise in this bed."""
    beads = {
        "density": 3585.9, "youngs_modulus": 3e11, "contact_modulus": 1e6, "poisson": 0.3, "restitution": 0.9,
        "friction": 0.1, "friction_lubricated": 0.05, "roughness": 1e-6,
    }  # fmt: skip
    return glass(velocity).with_(
        **{
            "title": "Liquid-fluidised bed of alumina beads",
            "fluid": {"density": 997.0, "viscosity": 8.354e-4},
            "material": {"alumina": beads},
            "column.width": 0.04,
            "column.height": 0.24,
            "column.cell": 0.008,
            "bed.diameter": 3.087e-3,
            "bed.count": 2000,
            "bed.start": "poured",
            "laws.drag": "wen_yu",
            "run.reference_speed": 0.1,
            "run.particle_step": None,
        }
    )


def alginate(velocity: float) -> Case:
    """The lighter beads of the same experiments at a velocity [m/s]; they start suspended, so that no plug rises."""
    beads = {
        "density": 1029.0, "youngs_modulus": 1e7, "contact_modulus": 2e5, "poisson": 0.3, "restitution": 0.9,
        "friction": 0.1, "friction_lubricated": 0.05, "roughness": 1e-6,
    }  # fmt: skip
    return alumina(velocity).with_(
        **{
            "title": "Liquid-fluidised bed of alginate beads",
            "material": {"alginate": beads},
            "column.height": 0.08,
            "bed.diameter": 2.66e-3,
            "bed.count": 2500,
            "bed.start": "suspended",
            "laws.drag": "di_felice",
            "run.reference_speed": 0.02,
        }
    )


STUDIES = {
    "glass": Study(glass, (0.030, 0.037, 0.045), 0.7, 1.5),
    "alumina": Study(alumina, (0.12, 0.157033, 0.20, 0.26), 2.0, 2.0),
    "alginate": Study(alginate, (0.006, 0.009, 0.012), 6.0, 4.0),
}
"""Voidage 0.55 to 0.8 by Richardson and Zaki."""


def fluidise(study: Study, velocity: float, **changes: Any) -> FluidisedBed:
    """Run a bed at one of its velocities [m/s], and average.

    changes  further keys of the case
    """
    described = study.case(velocity).with_(**changes)
    simulation = Simulation(described)
    simulation.until(study.starting)
    rows, layers = [], []
    for instant in study.starting + np.linspace(0.0, study.averaged, 101)[1:]:
        simulation.until(float(instant))
        rows.append(history.row(simulation))
        layers.append(_layers(simulation))
    mean = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
    weight = buoyant_weight(described) / described.column.floor_area
    inner = slice(1, max(2, int(2.0 / 3.0 * mean["bed_height"] / (2.5 * described.bed.diameter))))
    laws = [*expansion_laws(described).values()]
    return FluidisedBed(
        velocity=velocity,
        drop_over_weight=mean["pressure_drop"] / weight,
        carried=(mean["pressure_drop"] + mean["wall_load"]) / weight,
        voidage=mean["bed_voidage"],
        balance=estimate_bed(described).voidage,
        expected=float(np.mean(laws)),
        lowest=min(laws),
        highest=max(laws),
        exponent=expansion_exponents(described)["Richardson-Zaki"][0],
        height=mean["bed_height"],
        layers=float(np.std(layers, axis=0)[inner].mean()),
        inside=1.0 - float(np.mean(layers, axis=0)[inner].mean()),
    )


def _layers(simulation: Simulation) -> np.ndarray:
    """Solid fraction of layers of 2.5 d."""
    column, particles = simulation.case.column, simulation.particles
    edges = np.arange(0.0, column.height, 2.5 * simulation.case.bed.diameter)
    solids, _ = np.histogram(particles.position[:, 2], edges, weights=particles.volume)
    return np.asarray(solids / (column.floor_area * np.diff(edges)))


def exponent(beds: list[FluidisedBed]) -> float:
    """Slope of log U over log voidage."""
    return float(np.polyfit(np.log([bed.voidage for bed in beds]), np.log([bed.velocity for bed in beds]), 1)[0])


# ---------------------------------------------------------------- a movie of several beds side by side


FASTEST = 0.06
"""Vertical speed at the ends of the colour scale [m/s]."""

FRAMES_PER_SECOND = 20


def side_by_side(folders: Mapping[str, Path], path: Path, every: int = 1) -> None:
    """Write a movie of runs with equal times.

    folders  title -> folder of the run
    path     of the movie, a GIF
    every    snapshots from frame to frame
    """
    runs = {title: open_run(folder) for title, folder in folders.items()}
    first = next(iter(runs.values()))
    figure, axes = plt.subplots(1, len(runs), figsize=(2.2 * len(runs), 4.4), sharey=True, layout="constrained")
    beads = [run.particles(n) for run in runs.values() for n in (0, -1)]
    width, _, top = np.max([(each["position"] + each["radius"][:, None]).max(axis=0) for each in beads], axis=0)
    drawn = []
    for one, title in zip(axes, runs, strict=True):
        one.set(xlabel="x [mm]", title=title, xlim=(0, 1e3 * width), ylim=(0, 1.05e3 * top), aspect="equal")
        drawn.append(_no_spheres(one))
    axes[0].set_ylabel("height [mm]")
    figure.colorbar(drawn[-1], ax=axes, label="vertical speed [mm/s]", shrink=0.6)
    clock = axes[0].text(0.04, 0.965, "", transform=axes[0].transAxes)

    def draw(frame: int) -> list[object]:
        for spheres, run in zip(drawn, runs.values(), strict=True):
            _place(spheres, run.particles(frame))
        clock.set_text(f"{first.times[frame]:.2f} s")
        return [*drawn, clock]

    frames = range(0, len(first.times), every)
    FuncAnimation(figure, draw, frames=frames).save(path, PillowWriter(fps=FRAMES_PER_SECOND // every), dpi=80)  # type: ignore[arg-type]
    plt.close(figure)


def _no_spheres(axes: plt.Axes) -> EllipseCollection:
    spheres = EllipseCollection(
        [], [], [], units="x", offsets=np.zeros((0, 2)), offset_transform=axes.transData, cmap="RdBu_r", linewidth=0.2,
        edgecolor="0.3",
    )  # fmt: skip
    spheres.set_clim(-1e3 * FASTEST, 1e3 * FASTEST)
    axes.add_collection(spheres)
    return spheres


def _place(spheres: EllipseCollection, particles: Mapping[str, np.ndarray]) -> None:
    """Draw the spheres that the plane through the middle cuts, as the circles of the cut."""
    position, radius = particles["position"], particles["radius"]
    across = position[:, 1] - 0.5 * (position[:, 1].min() + position[:, 1].max())
    cut = np.abs(across) < radius
    size = 2e3 * np.sqrt(radius[cut] ** 2 - across[cut] ** 2)
    spheres.set_offsets(1e3 * position[cut][:, [0, 2]])
    spheres.set_widths(size)
    spheres.set_heights(size)
    spheres.set_angles(np.zeros(len(size)))
    spheres.set_array(1e3 * particles["velocity"][cut, 2])
