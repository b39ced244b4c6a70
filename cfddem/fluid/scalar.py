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

from cfddem.backend.errors import RunFailed
from cfddem.fluid.cell_groups import cell_groups
from cfddem.fluid.fields import CellField, CellFields
from cfddem.fluid.grid import Array
from cfddem.fluid.scalar_boundaries import SideFaces, scalar_walls
from cfddem.fluid.scalar_conditions import SOLID, ScalarSides
from cfddem.fluid.scalar_loops import (
    Carried,
    add_flows,
    carry,
    cell_flows,
    cell_rates,
    diffusivities,
    finish,
    followed_voidage,
    least_stored,
    leave,
    relax,
    sort_flows,
    take_exchange,
    volume_fluxes,
)
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


class ScalarFlow:
    """The flow that carries all scalars of a fluid, found once in a step.

    flux     eps u through every face, with the correction that lets the stored voidage follow that of the fluid [m/s]
    gate     1 between two open cells, 0 at solid cells and sides; aperture: times the open share of the face
    groups   of cells with one value, beside smooth walls
    growth   net outflow of every cell, outflow: twice what leaves it [1/s]
    lost     stored voidage less that of the fluid [-]
    least    of the stored voidage of every cell in the step (nz, ny, nx) [-]
    """

    def __init__(self, fluid: FluidSolver) -> None:
        self.fluid, self.time = fluid, math.nan
        cells = [CellField(name, "", "") for name in ("growth", "outflow", "lost")]
        self.fields = CellFields(fluid.grid, [*cells, *(CellField(name, "", "", "faces") for name in ("flux", "gate"))])
        self.least = np.ones(fluid.grid.shape)
        self.growth, self.groups = self.fields.owned("growth"), cell_groups(fluid)
        is_open = fluid.boundaries.halo.padded(fluid.grid.open, outside=0.0)
        for d in range(3):
            self.fields.gate[d] = is_open * np.roll(is_open, 1, axis=2 - d)
        self.aperture = self.fields.gate * fluid.boundaries.cut.aperture if fluid.grid.walls else self.fields.gate

    def follow(self, name: str, stored: Array) -> None:
        """Follow the step that the fluid has made, unless another scalar has let it.

        name    of the scalar
        stored  its voidage before, padded; that of all scalars is the same but for rounding
        """
        fluid, fields = self.fluid, self.fields
        if self.time == fluid.time:
            return
        step, inverse, of_fluid = fluid.last_step, fluid.inverse_spacing, fluid.fields
        followed_voidage(stored, of_fluid.voidage, of_fluid.voidage_rate, fluid.open_cells, step, fields.lost)
        fluid.boundaries.halo.fill(fields.lost)
        strength = FOLLOW / (step * inverse)
        volume_fluxes(of_fluid.velocity, of_fluid.mean_voidage, fields.lost, fields.gate, strength, fields.flux)
        self.groups.shut(fields.flux)
        cell_flows(fields.flux, inverse, fields.growth, fields.outflow)
        self.groups.gather(fields.growth)
        self.groups.gather(fields.outflow)
        least_stored(stored, fields.growth, fluid.open_cells, step, self.least)
        if fluid.communicator.smallest(self.least) <= 0.0:
            raise RunFailed(
                f"{name} of the fluid: a cell loses all of its fluid in the step of {step:.3g} s to "
                f"t = {fluid.time:g} s; take shorter fluid steps"
            )
        self.time = fluid.time


class Scalar:
    """A scalar of a fluid, in every cell.

    fluid  whose steps it follows
    kind   what it is
    sides  conditions on the sides

    flow   that carries it and all other scalars of the fluid
    sums   since the start, of the value above `kind.start` times capacity [J] or [kg]: "inflow", "outflow", "walls",
           "displaced" by particles that entered or left
    leaving  mean value of what left through outlets in the last step in which something did; at first that at the start
    """

    def __init__(self, fluid: FluidSolver, kind: ScalarKind, sides: ScalarSides) -> None:
        self.fluid, self.kind, self.grid = fluid, kind, fluid.grid
        others = [scalar for scalar in fluid.followers if isinstance(scalar, Scalar)]
        self.flow: ScalarFlow = others[0].flow if others else ScalarFlow(fluid)
        roles: Mapping[str, Any] = {"value": "state", "stored": "state"}
        initial = {"value": kind.start, "next": kind.start, "stored": 1.0}
        names = ("value", "stored", "next", "diffusivity", "coefficient", "target", "missed")
        self.fields = CellFields(
            self.grid,
            [CellField(name, "", "", "cells", roles.get(name, "scratch"), initial.get(name, 0.0)) for name in names],
        )
        self._through = np.zeros((2, 3, *self.grid.padded_shape))
        self._faces = SideFaces.of(fluid.boundaries, sides, kind.capacity)
        self._walls = scalar_walls(fluid, self.flow.groups, sides.walls.get(SOLID), kind.capacity)
        self._spread = self.flow.groups.spread + self._walls.spread
        self._cells = {name: self.fields.owned(name) for name in ("stored", "target", "missed")}  # never exchanged
        self._rate = np.zeros(self.grid.shape)
        self._wall_rate = self._rate_of_walls()
        self.fields.owned("stored")[:] = self.flow.groups.averaged(fluid.voidage)
        self.sums = dict.fromkeys(("inflow", "outflow", "walls", "displaced"), 0.0)
        self.leaving, self.parts = kind.start, 1
        fluid.followers.append(self)

    # ------------------------------------------------------------ values

    @property
    def value(self) -> Array:
        """The value of every cell (nz, ny, nx), a view."""
        return self.fields.owned("value")

    @property
    def mean(self) -> float:
        """Mean value of the fluid."""
        total, weight = self.fluid.communicator.sum, self.fields.owned("stored") * self.flow.groups.volume
        return float(total(weight * self.value) / total(weight))

    @property
    def capacity(self) -> float:
        """Capacity of all the fluid: rho c V [J/K], or its mass [kg]."""
        amount = self.fields.owned("stored") * self.flow.groups.volume
        return float(self._amount * self.fluid.communicator.sum(amount))

    @property
    def content(self) -> float:
        """What the fluid holds above `kind.start`: its sum of the value times capacity [J] or [kg]."""
        amount = self.fields.owned("stored") * self.flow.groups.volume * (self.value - self.kind.start)
        return float(self._amount * self.fluid.communicator.sum(amount))

    @property
    def _amount(self) -> float:
        return self.kind.capacity * self.grid.cell_volume

    def displaced(self, change: Array) -> None:
        """Let fluid enter or leave cells with its value, where particles leave or enter: change of voidage."""
        stored, change = self.fields.owned("stored"), self.flow.groups.averaged(change)
        stored += change
        amount = change * self.flow.groups.volume * (self.value - self.kind.start)
        self.sums["displaced"] += float(self._amount * self.fluid.communicator.sum(amount))

    # ------------------------------------------------------------ one step

    def step(self, coefficient: Array | None = None, product: Array | None = None) -> Array:
        """Follow the step that the fluid has made.

        coefficient  beta of the exchange per volume of every cell (nz, ny, nx), [W/m3/K] or [kg/m3/s]; none if None
        product      beta times the value of the particles (nz, ny, nx)
        returns      value that the exchange has seen (nz, ny, nx): it has given beta (v - seen) per volume and time
        """
        step, fields = self.fluid.last_step, self.fields
        self.flow.follow(self.kind.name, fields.stored)
        parts = self._parts_of(step)
        exchanging = coefficient is not None and product is not None
        if exchanging:
            take_exchange(
                coefficient, product, fields.value, self.kind.capacity, fields.coefficient, fields.target, fields.missed
            )
        flows, self._of_walls = np.zeros(len(self._faces.places)), 0.0
        for _ in range(parts):
            if exchanging:
                self._relax(0.5 * step / parts)
            carried_by = self._move(step / parts)
            add_flows(carried_by, self.kind.start, step / parts, flows)
            if exchanging:
                self._relax(0.5 * step / parts)
        self._count(carried_by, flows)
        return np.asarray(self._cells["target"] - self._cells["missed"] * (0.5 / parts))

    def _parts_of(self, step: float) -> int:
        """Find the diffusivity, and into how many parts the step is divided."""
        fluid, fields, flow = self.fluid, self.fields, self.flow
        molecular = self.kind.conductivity / self.kind.capacity
        diffusivities(fluid.fields.mean_voidage, molecular, self.kind.spread == "none", fields.diffusivity)
        cell_rates(
            flow.fields.outflow, fields.diffusivity, self._spread, self._wall_rate, flow.least, fluid.open_cells,
            self._rate,
        )  # fmt: skip
        self.parts = max(1, math.ceil(step * fluid.communicator.largest(self._rate) * (1.0 - 1e-9)))
        return self.parts

    def _relax(self, step: float) -> None:
        """Exchange with the particles."""
        fields = self.fields
        relax(fields.value, fields.stored, fields.coefficient, fields.target, step, fields.missed)

    def _move(self, step: float) -> Carried:
        """Advection, diffusion and the flux of walls over a step [s]."""
        fields, of_flow = self.fields, self.flow.fields
        carried_by = Carried(
            fields.stored, of_flow.growth, of_flow.flux, fields.diffusivity, self.flow.aperture,
            self._faces.places, self._faces.rules, self._through, self.fluid.inverse_spacing,
        )  # fmt: skip
        groups, solid = self.flow.groups, self.grid.solid
        for stage in (0, 1):
            value = fields.next if stage else fields.value
            self.fluid.boundaries.halo.fill(value)
            carry(value, carried_by, stage, float(self.kind.unlimited))
            self._walls.correct(value, carried_by, stage)
            leave(carried_by, stage, fields.next)
            self._walls.give(stage, step, fields.next)
            groups.gather(fields.next)
            finish(fields.value, carried_by, step, fields.next)
            if solid is not None:
                self.grid.inner(fields.next)[solid] = self.kind.start
            groups.copy(fields.next)
        fields.swap("value", "next")
        self._cells["stored"][:] -= step * self.flow.growth
        self._of_walls += self._walls.supplied
        return carried_by

    def _count(self, carried_by: Carried, flows: Array) -> None:
        """Add what came through every face of a side in a step to the sums."""
        terms = np.empty((4, len(flows)))
        sort_flows(carried_by, flows, self._faces.area, self._faces.wall, self.kind.capacity, terms)
        inflow, outflow, walls, left = self.fluid.communicator.sum(terms, axis=1).tolist()
        left *= -self.fluid.last_step
        self.sums["inflow"] += inflow
        self.sums["outflow"] -= outflow
        self.sums["walls"] += walls + self.kind.capacity * self._of_walls
        if left > 0.0:
            self.leaving = self.kind.start - outflow / (left * self.kind.capacity)

    def _rate_of_walls(self) -> Array:
        """Rate of each cell by coefficients of its walls, beyond conduction (nz, ny, nx) [1/s]."""
        rate, faces = np.zeros(self.grid.padded_shape), self._faces
        coefficient = np.where(faces.rules[:, 5] > 0.0, 0.0, faces.rules[:, 1]) * faces.rules[:, 4]
        np.add.at(rate.reshape(-1), faces.places[:, 2], coefficient * self.fluid.inverse_spacing[faces.places[:, 0]])
        self.flow.groups.gather(rate)
        return np.asarray(self.grid.inner(rate) + self._walls.rate)

    # ------------------------------------------------------------ checkpoint

    def checkpoint(self) -> dict[str, Any]:
        """What the next step depends on, and the sums."""
        return {**self.fields.checkpoint(), "sums": dict(self.sums), "leaving": self.leaving}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.fields.restore(state)
        self.sums = {name: float(state["sums"][name]) for name in self.sums}
        self.leaving = float(state["leaving"])
