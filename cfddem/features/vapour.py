r"""One vapour in the fluid, as a mass fraction in every cell, see :mod:`cfddem.fluid.scalar`.

What evaporates adds to it through :meth:`Vapour.exchange`: every particle has a surface of the mass fraction Y and a
conductance :math:`b = \rho D\,Sh\,A/d` and receives :math:`b\,(Y_f - Y)` from the cells around; a negative number
evaporates. Density and heat capacity of the fluid stay as they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cfddem.backend.portions import Portions
from cfddem.case.column_grid import brought_in
from cfddem.case.schema import Case
from cfddem.coupling.transfer import ExchangeLaw
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.evaporation_keys import VapourTable
from cfddem.fluid.block import in_portions
from cfddem.fluid.fields import CellField
from cfddem.fluid.scalar import Scalar, ScalarKind
from cfddem.fluid.scalar_conditions import ScalarSides

LEAST = 1e-6
"""Mass of vapour over that of the fluid below which nothing counts as given [-]."""

OF_FLUID = CellField("vapour", "1", "mass fraction of the vapour in the fluid")


class Vapour(CaseFeature):
    """The vapour in the fluid of a case.

    cells     its mass fraction in every cell
    received  mass of vapour that particles have received so far; below zero where they evaporate [kg]
    """

    name, table, kept = "vapour", "vapour", ("received", "scale")
    measures = (
        Measured("mean_vapour", "1", "recorded", "mean mass fraction of the vapour in the fluid",
                 lambda vapour, _: vapour.cells.mean),
        Measured("outlet_vapour", "1", "measure", "mean mass fraction of the vapour in the fluid that leaves",
                 lambda vapour, _: vapour.cells.leaving, lambda case: case.column.ends == "flow"),
        Measured("vapour_in", "kg", "recorded",
                 "vapour that the fluid has brought in, above its mass fraction at the start",
                 lambda vapour, _: vapour.cells.sums["inflow"]),
        Measured("vapour_out", "kg", "recorded",
                 "vapour that the fluid has carried out, above its mass fraction at the start",
                 lambda vapour, _: vapour.cells.sums["outflow"]),
        Measured("vapour_from_particles", "kg", "recorded", "vapour that the particles have given to the fluid",
                 lambda vapour, _: -vapour.received),
        Measured("vapour_imbalance", "1", "imbalance",
                 "change of the vapour in the fluid that nothing gave, over what was given",
                 lambda vapour, _: vapour.imbalance),
    )  # fmt: skip

    def __init__(self, case: Case, simulation: Any) -> None:
        keys, law, fluid = VapourTable.of(case), case.laws.heat_law, simulation.fluid
        assert keys is not None and law is not None
        self.keys, self.law, self.communicator = keys, ExchangeLaw(law), simulation.communicator
        self.conductivity = fluid.density * keys.diffusivity
        kind = ScalarKind(
            OF_FLUID.name, OF_FLUID.unit, OF_FLUID.meaning, keys.fluid_fraction, fluid.density, self.conductivity,
            keys.effective_diffusivity,
        )  # fmt: skip
        inflow = brought_in(case, keys.inflow, keys.patch_fraction)
        self.cells = Scalar(fluid, kind, ScalarSides(inflow, keys.outlet_fraction))
        self.received, self.scale, self._made = 0.0, 0.0, False

    @classmethod
    def cell_fields_of(cls, case: Case) -> tuple[CellField, ...]:
        """The mass fraction."""
        return (OF_FLUID,)

    @property
    def imbalance(self) -> float:
        """Change of the vapour in the fluid that nothing gave, over what was given, at least a millionth of the fluid
        [-]."""
        sums = self.cells.sums
        expected = sums["inflow"] - sums["outflow"] + sums["displaced"] - self.received
        scale = self.scale + abs(sums["inflow"]) + abs(sums["outflow"])
        return abs(self.cells.content - expected) / max(scale, LEAST * self.cells.capacity)

    def conductance(self, terms: Any) -> np.ndarray:
        """Conductance of the whole surface of every particle, by the law of heat transfer as Sherwood number (N,)
        [kg/s]."""
        particles = terms.particles
        numbers = self.law.numbers(terms.flow, particles.viscosity / self.conductivity)
        return np.asarray(2.0 * math.pi * particles.radius * self.conductivity * numbers)

    def exchange(self, simulation: Any, conductance: np.ndarray, surface: np.ndarray, step: float) -> np.ndarray:
        """Make the step of the vapour with particles that exchange with it; at most once in a step.

        conductance  of every particle, of its wet surface (N,) [kg/s]
        surface      mass fraction at this surface (N,) [-]
        step         [s]
        returns      mass that every particle receives from the cells (N,) [kg], the opposite of what they give
        """
        kernel, cell_map = simulation.coupling.kernel, simulation.terms.cell_map
        sent = np.stack([conductance, conductance * surface], axis=1)
        coefficient, product = kernel.spread(cell_map, sent) / kernel.grid.cell_volume
        fractions = self.cells.step(coefficient, product)
        around = kernel.sample(cell_map.stencil, cell_map.radius, fractions[None])[:, 0]
        received = np.asarray(step * conductance * (around - surface))
        sums = self.communicator.sum([received, np.abs(received)], axis=1)
        self.received += float(sums[0])
        self.scale += float(sums[1])
        self._made = True
        return received

    def after(self, simulation: Any) -> None:
        """Make the step of the vapour if nothing has exchanged with it."""
        if not self._made and self.cells.fluid.last_step > 0.0:
            self.cells.step()
        self._made = False

    def cells_for_snapshot(self) -> Mapping[str, np.ndarray | Portions]:
        """The mass fraction in the cells of all ranks."""
        return {OF_FLUID.name: in_portions(self.cells.grid, self.cells.value, 0)}

    def checkpoint(self) -> dict[str, Any]:
        """The mass fraction and the balance."""
        return super().checkpoint() | {"cells": self.cells.checkpoint()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        super().restore(state)
        self.cells.restore(state["cells"])
