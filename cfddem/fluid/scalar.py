r"""A scalar in the fluid: its temperature, or the mass fraction of a vapour, T in every cell.

.. math:: \partial_t(\varepsilon C T) + \nabla\cdot(\varepsilon C u T) = \nabla\cdot(k_e\nabla T) + \beta(v - T)

with the capacity C of the fluid per volume (rho c, or rho), the conductivity k_e between the particles, and the values
v of the particles, which exchange with the coefficient beta.

**Times.** A step of the scalar follows one of the fluid. It goes from the voidage before to the voidage after, with
the flux eps u that the fluid has had between them. So the scalar belongs to the times of the voidage.

**Continuity to round-off.** The fluid satisfies continuity to the tolerance of its pressure. The scalar therefore
stores a voidage of its own, which follows from the fluxes exactly. A uniform value then stays uniform, and its sum is
conserved, to round-off. A weak flux between cells keeps this voidage at that of the fluid.

**Order.** Half a step of exchange, exact; advection and diffusion by Heun's two stages; the other half of the exchange.
Advection is upwind with the MC limiter. A step is divided until every stage keeps values between those around.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from cfddem.backend.errors import InputError, RunFailed
from cfddem.fluid.fields import CellField, CellFields
from cfddem.fluid.grid import Array
from cfddem.fluid.scalar_conditions import ScalarSides
from cfddem.fluid.scalar_loops import (
    balance,
    cell_rates,
    diffusivities,
    relax,
    through_faces,
    through_sides,
    volume_fluxes,
)
from cfddem.fluid.scalar_sides import SideFaces
from cfddem.fluid.solver import FluidSolver

FOLLOW = 0.05
"""Part of a difference between the stored voidage and that of the fluid that moves to a neighbour in a step [-]."""

Spread = Literal["none", "zehner_schluender"]


@dataclass(frozen=True)
class ScalarKind:
    """What a scalar is.

    name, unit, meaning  of its field
    start         value at the start, and zero of its balance
    capacity      of the fluid per volume: rho c [J/m3/K], or rho [kg/m3]
    conductivity  of the fluid alone: k [W/m/K], or rho D [kg/m/s]
    spread        conductivity between the particles: "none", eps k; "zehner_schluender", by their law
    unlimited     no limiter, for smooth fields
    """

    name: str
    unit: str
    meaning: str
    start: float
    capacity: float
    conductivity: float
    spread: Spread = "none"
    unlimited: bool = False


class Scalar:
    """A scalar of a fluid, in every cell.

    fluid  whose steps it follows
    kind   what it is
    sides  conditions on the sides

    sums   since the start, of the value above `kind.start` times capacity [J] or [kg]: "inflow", "outflow", "walls",
           "exchange" from the particles, "displaced" by particles that entered or left
    leaving  mean value of what left through outlets in the last step in which something did; at first that at the start
    """

    def __init__(self, fluid: FluidSolver, kind: ScalarKind, sides: ScalarSides) -> None:
        self.fluid, self.kind, self.grid = fluid, kind, fluid.grid
        if self.grid.walls:
            remedy = "take Grid.with_solid instead of smooth walls"
            raise InputError("walls", None, "solid cells where the fluid has a temperature or a vapour", remedy)
        cells = ("value", "stored", "next", "growth", "rate", "lost", "diffusivity", "coefficient", "target", "missed")
        roles: Mapping[str, Any] = {"value": "state", "stored": "state"}
        initial = {"value": kind.start, "next": kind.start, "stored": 1.0}
        self.fields = CellFields(
            self.grid,
            [
                *(
                    CellField(each, "", "", "cells", roles.get(each, "scratch"), initial.get(each, 0.0))
                    for each in cells
                ),
                *(CellField(each, "", "", "faces") for each in ("flux", "gate")),
            ],
        )
        self._through = np.zeros((2, 3, *self.grid.padded_shape))
        self._faces = SideFaces.of(fluid.boundaries, sides, kind.capacity)
        self._side = self._faces.places[:, 0], self._faces.places[:, 1]  # where the faces of sides are
        names = ("stored", "lost", "growth", "rate", "coefficient", "target", "missed")
        self._cells = {name: self.fields.owned(name) for name in names}  # views of what is never exchanged
        is_open = fluid.boundaries.halo.padded(self.grid.open, outside=0.0)
        for d in range(3):
            self.fields.gate[d] = is_open * np.roll(is_open, 1, axis=2 - d)
        self._wall_rate = self._rate_of_walls()
        self.fields.owned("stored")[:] = fluid.voidage
        self.sums = dict.fromkeys(("inflow", "outflow", "walls", "exchange", "displaced"), 0.0)
        self.leaving, self.parts = kind.start, 1
        fluid.followers.append(self.displaced)

    # ------------------------------------------------------------ values

    @property
    def value(self) -> Array:
        """The value of every cell (nz, ny, nx), a view."""
        return self.fields.owned("value")

    @property
    def mean(self) -> float:
        """Mean value of the fluid."""
        total, weight = self.fluid.communicator.sum, self.fields.owned("stored") * self.fluid.open_cells
        return float(total(weight * self.value) / total(weight))

    @property
    def content(self) -> float:
        """What the fluid holds above `kind.start`: its sum of the value times capacity [J] or [kg]."""
        held = self.fields.owned("stored") * self.fluid.open_cells * (self.value - self.kind.start)
        return float(self._amount * self.fluid.communicator.sum(held))

    @property
    def _amount(self) -> float:
        return self.kind.capacity * self.grid.cell_volume

    def displaced(self, change: Array) -> None:
        """Let fluid enter or leave cells with its value, where particles leave or enter: change of voidage."""
        stored = self.fields.owned("stored")
        stored += change
        held = change * self.fluid.open_cells * (self.value - self.kind.start)
        self.sums["displaced"] += float(self._amount * self.fluid.communicator.sum(held))

    # ------------------------------------------------------------ one step

    def step(self, coefficient: Array | None = None, product: Array | None = None) -> Array:
        """Follow the step that the fluid has made.

        coefficient  beta of the exchange per volume of every cell (nz, ny, nx), [W/m3/K] or [kg/m3/s]; none if None
        product      beta times the value of the particles (nz, ny, nx)
        returns      value that the exchange has seen (nz, ny, nx): it has given beta (v - seen) per volume and time
        """
        step = self.fluid.last_step
        parts = self._find_fluxes(step)
        exchanging = coefficient is not None and product is not None
        if exchanging:
            self._take_exchange(coefficient, product)
        of_sides = np.asarray(self.fields.flux.reshape(3, -1)[self._side])
        flows = np.zeros(len(of_sides))
        for _ in range(parts):
            if exchanging:
                self._relax(0.5 * step / parts)
            self._move(step / parts, of_sides, flows)
            if exchanging:
                self._relax(0.5 * step / parts)
        self._count(of_sides, flows)
        seen: Array = self._cells["target"] - self._cells["missed"] * (0.5 / parts)
        if coefficient is not None and product is not None:
            given = float(self.fluid.communicator.sum(product - coefficient * seen))
            self.sums["exchange"] += step * self.grid.cell_volume * given
        return seen

    def _find_fluxes(self, step: float) -> int:
        """Flux of the fluid, diffusivity, and rates of cells; returns into how many parts the step is divided."""
        fluid, fields, inverse = self.fluid, self.fields, self.fluid.inverse_spacing
        earlier = fluid.voidage - step * fluid.fields.owned("voidage_rate")
        self._cells["lost"][:] = (self._cells["stored"] - earlier) * fluid.open_cells
        fluid.boundaries.halo.fill(fields.lost)
        strength = FOLLOW / (step * inverse)
        volume_fluxes(fluid.fields.velocity, fluid.fields.mean_voidage, fields.lost, fields.gate, strength, fields.flux)
        molecular = self.kind.conductivity / self.kind.capacity
        diffusivities(fluid.fields.mean_voidage, molecular, self.kind.spread == "none", fields.diffusivity)
        cell_rates(fields.flux, fields.diffusivity, inverse, fields.growth, fields.rate)
        growth, stored = self._cells["growth"], self._cells["stored"]
        growth *= fluid.open_cells
        least = np.minimum(stored, stored - step * growth)
        if fluid.communicator.smallest(least) <= 0.0:
            raise RunFailed(
                f"{self.kind.name} of the fluid: a cell loses all of its fluid in the step of {step:.3g} s to "
                f"t = {fluid.time:g} s; take shorter fluid steps"
            )
        rate = (self._cells["rate"] + self._wall_rate) * fluid.open_cells
        self.parts = max(1, math.ceil(step * fluid.communicator.largest(rate / least) * (1.0 - 1e-9)))
        return self.parts

    def _take_exchange(self, coefficient: Any, product: Any) -> None:
        """Coefficient over capacity, and value of the particles in every cell."""
        self._cells["coefficient"][:] = coefficient / self.kind.capacity
        there = coefficient > 0.0
        self._cells["target"][:] = np.where(there, product / np.where(there, coefficient, 1.0), self.value)
        self.fields.missed.fill(0.0)

    def _relax(self, step: float) -> None:
        """Exchange with the particles."""
        fields = self.fields
        relax(fields.value, fields.stored, fields.coefficient, fields.target, step, fields.missed)

    def _move(self, step: float, of_sides: Array, flows: Array) -> None:
        """Advection, diffusion and the flux of walls over a step [s]; adds what came through every face of a side.

        of_sides  eps u through these, along their axes (m,) [m/s]
        """
        fields, inverse, through = self.fields, self.fluid.inverse_spacing, self._through
        for stage, second in ((0, 0.0), (1, 0.5)):
            value = fields.next if stage else fields.value
            self.fluid.boundaries.halo.fill(value)
            through_faces(
                value, fields.flux, fields.diffusivity, fields.gate, inverse, float(self.kind.unlimited), through[stage]
            )
            through_sides(
                value.reshape(-1), fields.flux.reshape(3, -1), fields.diffusivity.reshape(-1),
                self._faces.places, self._faces.rules, inverse, through[stage].reshape(3, -1),
            )  # fmt: skip
            balance(fields.value, fields.stored, fields.growth, through, second, step, inverse, fields.next)
            if self.grid.solid is not None:
                self.grid.inner(fields.next)[self.grid.solid] = self.kind.start
        fields.swap("value", "next")
        self._cells["stored"][:] -= step * self._cells["growth"]
        one, other = (each.reshape(3, -1)[self._side] for each in through)
        flows += step * self._faces.places[:, 3] * (0.5 * (one + other) - self.kind.start * of_sides)

    def _count(self, of_sides: Array, flows: Array) -> None:
        """Add what came through the sides in a step to the sums."""
        faces, into = self._faces, of_sides * self._faces.places[:, 3]
        brought = flows * faces.area * self.kind.capacity
        leaves = ~faces.wall & (into < 0.0)
        terms = np.where([~faces.wall & ~leaves, leaves, faces.wall], brought, 0.0)
        inflow, outflow, walls, left = self.fluid.communicator.sum(
            np.append(terms, [np.where(leaves, into * faces.area, 0.0)], axis=0), axis=1
        ).tolist()
        left *= -self.fluid.last_step
        self.sums["inflow"] += inflow
        self.sums["outflow"] -= outflow
        self.sums["walls"] += walls
        if left > 0.0:
            self.leaving = self.kind.start - outflow / (left * self.kind.capacity)

    def _rate_of_walls(self) -> Array:
        """Rate of each cell by coefficients of its walls, beyond conduction (nz, ny, nx) [1/s]."""
        rate, faces = np.zeros(self.grid.padded_shape), self._faces
        coefficient = np.where(faces.rules[:, 5] > 0.0, 0.0, faces.rules[:, 1]) * faces.rules[:, 4]
        np.add.at(rate.reshape(-1), faces.places[:, 2], coefficient * self.fluid.inverse_spacing[faces.places[:, 0]])
        return np.array(self.grid.inner(rate))

    # ------------------------------------------------------------ checkpoint

    def checkpoint(self) -> dict[str, Any]:
        """What the next step depends on, and the sums."""
        return {**self.fields.checkpoint(), "sums": dict(self.sums), "leaving": self.leaving}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.fields.restore(state)
        self.sums = {name: float(state["sums"][name]) for name in self.sums}
        self.leaving = float(state["leaving"])
