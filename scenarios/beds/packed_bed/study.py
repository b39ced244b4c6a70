"""Flow through a packed bed: the computed pressure drop, and that of the formula of the drag law.

.. math:: \\frac{dp'}{dz} = \\frac{18\\eta(1-\\varepsilon)F(Re,\\varepsilon)\\,U}{\\varepsilon\\,d^2}
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cfddem.analysis.measures import pressure_drop, profile
from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.run.simulation import Simulation
from closures.balance import pressure_gradient

STEADY, MOST_STEPS = 1e-6, 400


@dataclass(frozen=True)
class Drop:
    """Pressure drop of a slab in the middle of the bed."""

    reynolds: float  # on the superficial velocity
    voidage: float  # of the slab
    measured: float  # [Pa/m]
    formula: float  # [Pa/m]


def case(**overrides: object) -> Case:
    """The case of the gallery with other values."""
    return Case.from_toml(gallery_files()["packed-bed"], overrides)


def flow_through(described: Case, velocity: float, slab: tuple[float, float] = (0.25, 0.75)) -> Drop:
    """Let a fluid flow through the bed until the pressure drop is steady.

    velocity  superficial [m/s]
    slab      part of the height over which the drop is measured
    """
    fluid_of, diameter = described.required_fluid, described.bed.diameter
    law = described.laws.drag_law
    assert law is not None
    cell = described.column.cell
    edge = cell if isinstance(cell, float) else min(cell)
    simulation = Simulation(
        described.with_(**{"bed.inlet_velocity": velocity, "run.fluid_step": 0.2 * edge / velocity})
    )
    fluid = simulation.fluid
    height = described.column.height
    low, high = slab[0] * height, slab[1] * height
    before = np.inf
    for _ in range(MOST_STEPS):
        simulation.step()
        now = pressure_drop(fluid.pressure, fluid.grid.spacing, low, high)
        if abs(now - before) <= STEADY * abs(now):
            break
        before = now
    layers = profile(fluid.voidage)
    centres = (np.arange(len(layers)) + 0.5) * fluid.grid.spacing[2]
    voidage = float(layers[(centres > low) & (centres < high)].mean())
    reynolds = fluid_of.density * velocity * diameter / fluid_of.viscosity
    flow = velocity, diameter, fluid_of.density, fluid_of.viscosity, voidage
    formula = pressure_gradient(*flow, law.function)
    return Drop(reynolds, voidage, now / (high - low), formula)
