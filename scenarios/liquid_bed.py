"""A liquid-fluidised bed: it carries its own weight, and expands as published laws say.

Alumina beads in water, after Ferreira et al. (2023), between frictionless sides. The default case is a short
demonstration; the study here runs it longer, at four velocities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cfddem.case import Case
from cfddem.gallery import gallery
from cfddem.report import buoyant_weight, expansion_exponents, expansion_laws
from cfddem.run import measure
from cfddem.simulation import Simulation

VELOCITIES = (0.12, 0.157033, 0.20, 0.26)
"""Superficial [m/s]; voidage 0.55 to 0.8 by Richardson and Zaki."""

STARTING, AVERAGED = 2.0, 2.0
"""Time left for the bed to expand, and time over which it is averaged then [s]."""


@dataclass(frozen=True)
class Bed:
    """Means of a fluidised bed."""

    velocity: float  # [m/s]
    drop_over_weight: float
    voidage: float
    expected: float  # mean of the published laws
    exponent: float  # of Richardson and Zaki
    height: float  # [m]


def case(velocity: float, **overrides: object) -> Case:
    """The case of the gallery at another velocity, in a column high enough."""
    return Case.from_toml(gallery()["liquid-bed"], {"bed.inlet_velocity": velocity, "column.height": 0.24, **overrides})


def fluidise(velocity: float, **overrides: object) -> Bed:
    """Run the bed at a superficial velocity [m/s], and average."""
    described = case(velocity, **overrides)
    simulation = Simulation(described)
    simulation.until(STARTING)
    rows = []
    for instant in STARTING + np.linspace(0.0, AVERAGED, 101)[1:]:
        simulation.until(float(instant))
        rows.append(measure(simulation))
    weight = buoyant_weight(described) / described.column.floor_area
    laws = expansion_laws(described)
    return Bed(
        velocity=velocity,
        drop_over_weight=float(np.mean([row["pressure_drop"] for row in rows])) / weight,
        voidage=float(np.mean([row["bed_voidage"] for row in rows])),
        expected=float(np.mean(list(laws.values()))),
        exponent=expansion_exponents(described)["Richardson-Zaki"][0],
        height=float(np.mean([row["bed_height"] for row in rows])),
    )


def exponent(beds: list[Bed]) -> float:
    """Slope of log U over log voidage."""
    return float(np.polyfit(np.log([bed.voidage for bed in beds]), np.log([bed.velocity for bed in beds]), 1)[0])
