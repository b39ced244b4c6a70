"""A liquid-fluidised bed: its pressure drop carries its weight, and it expands as published laws predict.

Beads of glass in water, and of alumina and alginate after Ferreira et al. (2023), between frictionless sides. The
default case is a short demonstration; the studies here run longer, at several velocities.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.analysis.bed_laws import buoyant_weight, expansion_laws
from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
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


def exponent(velocities: list[float], voidages: list[float]) -> float:
    """Slope of log U over log voidage."""
    return float(np.polyfit(np.log(voidages), np.log(velocities), 1)[0])
