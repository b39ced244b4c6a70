"""The balance of gas and particles of a bed, cell by cell, by another route than the solver's.

It takes the motion from a simulation: fluxes, voidage, and where the particles are with which Reynolds number. It has
temperatures of its own. Gas is carried by first-order upwind differences, implicitly in all cells at once. Particles
exchange by the exact exponential of a step, by `place`,

    cells   with the cell of their centre alone
    layers  with the cells of their layer, which have one state: the mean flux rises through a bed without bubbles
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import spsolve

from cfddem.features.heat import HeatExchange
from cfddem.model.feature import Equipment
from closures.heat_transfer import gunn

Place = Literal["cells", "layers"]


class Balances(Equipment):
    """Follows the steps of a simulation with some balances."""

    name = "balances"

    def __init__(self, balances: list[TwoPhaseBalance]) -> None:
        self.balances = balances

    def before(self, simulation: Any, step: float) -> None:
        """Follow the step [s]."""
        for balance in self.balances:
            balance.step(step)


class TwoPhaseBalance:
    """Balance of a bed of equal spheres in a box.

    simulation    whose motion it takes
    density, capacity, conductivity, viscosity  of the gas
    specific      heat capacity of the particles [J/kg/K]
    inlet         temperature of the air that enters [K]
    place         with which cells a particle exchanges

    hot      temperature of the particles by id [K]
    gas      temperature of the cells (nz, ny, nx) [K]
    """

    def __init__(
        self,
        simulation: Any,
        gas: tuple[float, float, float, float],
        specific: float,
        inlet: float,
        place: Place = "cells",
    ) -> None:
        self.density, self.capacity, self.conductivity, self.viscosity = gas
        self.simulation, self.inlet, self.place = simulation, inlet, place
        particles, fluid = simulation.particles, simulation.fluid
        self.heat = specific * float(particles.mass[0])
        self.diameter = 2.0 * float(particles.radius[0])
        self.hot = particles.temperature[np.argsort(particles.id)].copy()
        cells = simulation.feature(HeatExchange).cells
        assert cells is not None
        self.gas, self.grid, self.leaving = cells.value.copy(), fluid.grid, inlet

    def step(self, h: float) -> None:
        """Follow the step of the fluid that has been made [s], before the particles move."""
        simulation = self.simulation
        particles, flow = simulation.particles, simulation.terms.flow
        order = np.argsort(particles.id)
        place = np.floor(simulation.terms.cell_map.position / np.array(self.grid.spacing)).astype(int)
        place = np.clip(place, 0, np.array(self.grid.cells) - 1)
        nx, ny, _ = self.grid.cells
        cell = ((place[:, 2] * ny + place[:, 1]) * nx + place[:, 0])[order]
        reynolds, voidage = flow.reynolds[order], flow.voidage[order]
        length = math.pi * self.diameter
        prandtl = self.viscosity * self.capacity / self.conductivity
        nusselt = np.array([gunn(r, prandtl, e) for r, e in zip(reynolds.tolist(), voidage.tolist())])
        b = length * self.conductivity * nusselt
        b = self.heat * -np.expm1(-h * b / self.heat) / h
        amount = self.density * self.capacity
        self.gas, self.leaving = self._carried(self.gas, self.inlet, amount, h, cell, b, b * self.hot)
        passed = h * b * (self.gas.reshape(-1)[cell] - self.hot)
        self.hot += passed / self.heat

    def _carried(
        self,
        old: np.ndarray,
        enters: float,
        amount: float,
        h: float,
        cell: np.ndarray,
        b: np.ndarray,
        product: np.ndarray,
    ) -> tuple[np.ndarray, float]:
        """Values of the cells after a step, and the mean of what leaves; amount of the gas per volume."""
        fluid, (nx, ny, nz) = self.simulation.fluid, self.grid.cells
        volume = self.grid.cell_volume
        number = np.arange(nx * ny * nz).reshape(nz, ny, nx)
        eps = fluid.mean_voidage
        sums = [np.bincount(cell, weights, number.size) for weights in (b, product)]
        stored = amount * volume * fluid.voidage.reshape(-1) / h
        rows, columns, values = [], [], []
        left = 0.0
        right = stored * old.reshape(-1) + sums[1]
        diagonal = stored + sums[0]
        for axis in range(3):
            at = 2 - axis
            inner = np.moveaxis(fluid.face_velocity(axis), at, 0)
            voidage, numbers = np.moveaxis(eps, at, 0), np.moveaxis(number, at, 0)
            faces = 0.5 * (voidage[1:] + voidage[:-1]) * inner[1:-1] * self.grid.face_area(axis) * amount
            low, high = numbers[:-1], numbers[1:]
            up, down = np.maximum(faces, 0.0), np.maximum(-faces, 0.0)
            for into, source, rate in ((high, low, up), (low, high, down)):
                rows.append(into.ravel())
                columns.append(source.ravel())
                values.append(rate.ravel())
            if axis == 2:
                entering = voidage[0] * inner[0] * self.grid.face_area(2) * amount
                np.add.at(diagonal, numbers[0].ravel(), entering.ravel())
                np.add.at(right, numbers[0].ravel(), entering.ravel() * enters)
                top, leaves = numbers[-1].ravel(), (voidage[-1] * inner[-1]).ravel()
        row, column, value = (np.concatenate(pieces) for pieces in (rows, columns, values))
        np.add.at(diagonal, row, value)
        if self.place == "layers":  # cells of a layer are one
            row, column, size = row // (nx * ny), column // (nx * ny), nz
            apart = row != column
            lateral = np.zeros(number.size)
            np.add.at(lateral, np.concatenate(rows)[~apart], value[~apart])
            diagonal = (diagonal - lateral).reshape(nz, -1).sum(axis=1)
            right = right.reshape(nz, -1).sum(axis=1)
            row, column, value = row[apart], column[apart], value[apart]
        else:
            size = number.size
        matrix = diags_array(diagonal) - coo_array((value, (row, column)), shape=(size, size))
        new = np.asarray(spsolve(matrix.tocsc(), right))
        if self.place == "layers":
            new = np.repeat(new, nx * ny)
        leaves = np.maximum(leaves, 0.0)
        left = float((leaves * new[top]).sum() / max(leaves.sum(), 1e-300))
        return new.reshape(nz, ny, nx), left
