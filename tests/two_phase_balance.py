"""The balance of gas and particles of a bed, cell by cell, by another route than the solver's.

It takes the motion from a simulation: fluxes, voidage, and where the particles are with which Reynolds number. It has
temperatures, vapour and water of its own. Gas is carried by first-order upwind differences, implicitly in all cells at
once. Every particle exchanges with the cell of its centre alone, with the exact exponential of a step.

`stirred` layers have one state of the gas in each layer of cells, through which the mean flux rises: a bed without
bubbles.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import spsolve

from cfddem.features.heat import HeatExchange
from cfddem.model.feature import Equipment
from closures.evaporation import latent_heat, saturation_pressure, vapour_fraction
from closures.heat_transfer import gunn

PRESSURE = 101325.0

Place = Literal["cells", "kernel", "layers"]


class Balances(Equipment):
    """Follows the steps of a simulation with some balances."""

    name = "balances"

    def __init__(self, balances: list[TwoPhaseBalance]) -> None:
        self.balances = balances

    def before(self, simulation: Any, step: float) -> None:
        """Follow the step [s]."""
        for each in self.balances:
            each.step(step)


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
        particles, fluid = simulation.particles, simulation.required_fluid
        self.heat = specific * float(particles.mass[0])
        self.diameter = 2.0 * float(particles.radius[0])
        self.hot = particles.temperature[np.argsort(particles.id)].copy()
        cells = simulation.feature(HeatExchange).cells
        assert cells is not None
        self.gas, self.grid, self.leaving = cells.value.copy(), fluid.grid, inlet
        self.vapour: np.ndarray | None = None
        self.water = np.zeros(len(self.hot))
        self.dry: list[tuple[float, float]] = []  # time, and share of the water that is left

    def dry_at(self, share: float) -> float:
        """Time at which no more than a share of the water was left; infinite if it never was [s]."""
        return next((time for time, left in self.dry if left <= share), math.inf)

    def wet(self, water: float, vapour: np.ndarray, inlet: float, diffusivity: float) -> None:
        """Let the particles carry the same mass of water each [kg], in gas with a vapour (nz, ny, nx)."""
        self.water[:] = self.each = water
        self.vapour, self.inlet_vapour, self.diffusivity = vapour.copy(), inlet, diffusivity

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
        passed = h * b * (self._around(self.gas, cell) - self.hot)
        self.hot += passed / self.heat
        if self.vapour is None:
            return
        schmidt = self.viscosity / (self.density * self.diffusivity)
        sherwood = np.array([gunn(r, schmidt, e) for r, e in zip(reynolds.tolist(), voidage.tolist())])
        wet = self.water > 0.0
        pressure = np.array([saturation_pressure(t) for t in self.hot.tolist()])
        surface = np.array([vapour_fraction(min(p, 0.99 * PRESSURE), PRESSURE) for p in pressure.tolist()])
        around = self._around(self.vapour, cell)
        difference = np.where(np.abs(surface - around) > 1e-9, surface - around, 1e-9)
        stefan = np.log((1.0 - around) / (1.0 - np.minimum(around + difference, 0.99))) / difference
        g = np.where(wet, length * self.density * self.diffusivity * sherwood * stefan, 0.0)
        g = np.minimum(g, self.water / (h * np.maximum(surface, 1e-9)))
        self.vapour, self.leaving_vapour = self._carried(
            self.vapour, self.inlet_vapour, self.density, h, cell, g, g * surface
        )
        lost = np.minimum(h * g * (surface - self._around(self.vapour, cell)), self.water)
        self.water -= lost
        self.dry += [(simulation.time + h, float(self.water.mean() / self.each))]
        self.hot -= lost * np.array([latent_heat(t) for t in self.hot.tolist()]) / self.heat

    def _deposited(self, cell: np.ndarray, *values: np.ndarray) -> list[np.ndarray]:
        """Sums in the cells of values of the particles, by id."""
        if self.place != "kernel":
            return [np.bincount(cell, each, self.gas.size) for each in values]
        rows = np.empty((len(cell), len(values)))
        rows[np.argsort(self.simulation.particles.id)] = np.stack(values, axis=1)
        fields = self.simulation.required_coupling.kernel.spread(self.simulation.terms.cell_map, rows)
        return [each.reshape(-1) for each in fields]

    def _around(self, field: np.ndarray, cell: np.ndarray) -> np.ndarray:
        """Values of the cells with which every particle exchanges, by id."""
        if self.place != "kernel":
            return np.asarray(field.reshape(-1)[cell])
        kernel, places = self.simulation.required_coupling.kernel, self.simulation.terms.cell_map
        sampled = kernel.sample(places.stencil, places.radius, field[None])[:, 0]
        return np.asarray(sampled[np.argsort(self.simulation.particles.id)])

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
        fluid, (nx, ny, nz) = self.simulation.required_fluid, self.grid.cells
        volume = self.grid.cell_volume
        number = np.arange(nx * ny * nz).reshape(nz, ny, nx)
        eps = fluid.mean_voidage
        sums = self._deposited(cell, b, product)
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
        row, column, value = (np.concatenate(each) for each in (rows, columns, values))
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
