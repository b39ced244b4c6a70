"""The balance of gas and particles of a bed, cell by cell, by another route than the solver's.

It takes the motion from a simulation: fluxes, voidage, and where the particles are with which Reynolds number. It has
temperatures, vapour and water of its own. Gas is carried by first-order upwind differences, implicitly in all cells at
once. Every particle exchanges with the cell of its centre alone, with the exact exponential of a step.

`stirred` layers have one state of the gas in each layer of cells, through which the mean flux rises: a bed without
bubbles.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import spsolve

from closures.evaporation import latent_heat, saturation_pressure, vapour_fraction
from closures.heat_transfer import gunn

PRESSURE = 101325.0


class TwoPhaseBalance:
    """Balance of a bed of equal spheres in a box.

    simulation    whose motion it takes
    density, capacity, conductivity, viscosity  of the gas
    specific      heat capacity of the particles [J/kg/K]
    inlet         temperature of the air that enters [K]
    stirred       every layer of cells has one state

    hot      temperature of the particles by id [K]
    gas      temperature of the cells (nz, ny, nx) [K]
    """

    def __init__(
        self,
        simulation: Any,
        gas: tuple[float, float, float, float],
        specific: float,
        inlet: float,
        stirred: bool = False,
    ) -> None:
        self.density, self.capacity, self.conductivity, self.viscosity = gas
        self.simulation, self.inlet, self.stirred = simulation, inlet, stirred
        particles, fluid = simulation.particles, simulation.required_fluid
        self.heat = specific * float(particles.mass[0])
        self.diameter = 2.0 * float(particles.radius[0])
        self.hot = particles.temperature[np.argsort(particles.id)].copy()
        from cfddem.features.heat import HeatExchange

        cells = simulation.feature(HeatExchange).cells
        assert cells is not None
        self.gas, self.grid, self.leaving = cells.value.copy(), fluid.grid, inlet
        self.vapour: np.ndarray | None = None
        self.water = np.zeros(len(self.hot))

    def wet(self, water: float, vapour: np.ndarray, inlet: float, diffusivity: float) -> None:
        """Let the particles carry the same mass of water each [kg], in gas with a vapour (nz, ny, nx)."""
        self.water[:] = water
        self.vapour, self.inlet_vapour, self.diffusivity = vapour.copy(), inlet, diffusivity

    def step(self) -> None:
        """Follow the step that the simulation has made."""
        simulation, fluid = self.simulation, self.simulation.required_fluid
        particles, flow, h = simulation.particles, simulation.terms.flow, simulation.last_step
        order = np.argsort(particles.id)
        place = np.floor(simulation.terms.cell_map.position / np.array(self.grid.spacing)).astype(int)
        place = np.clip(place, 0, np.array(self.grid.cells) - 1)
        nx, ny, nz = self.grid.cells
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
        if self.vapour is None:
            return
        schmidt = self.viscosity / (self.density * self.diffusivity)
        sherwood = np.array([gunn(r, schmidt, e) for r, e in zip(reynolds.tolist(), voidage.tolist())])
        wet = self.water > 0.0
        pressure = np.array([saturation_pressure(t) for t in self.hot.tolist()])
        surface = np.array([vapour_fraction(min(p, 0.99 * PRESSURE), PRESSURE) for p in pressure.tolist()])
        around = self.vapour.reshape(-1)[cell]
        difference = np.where(np.abs(surface - around) > 1e-9, surface - around, 1e-9)
        stefan = np.log((1.0 - around) / (1.0 - np.minimum(around + difference, 0.99))) / difference
        g = np.where(wet, length * self.density * self.diffusivity * sherwood * stefan, 0.0)
        g = np.minimum(g, self.water / (h * np.maximum(surface, 1e-9)))
        self.vapour, self.leaving_vapour = self._carried(
            self.vapour, self.inlet_vapour, self.density, h, cell, g, g * surface
        )
        lost = np.minimum(h * g * (surface - self.vapour.reshape(-1)[cell]), self.water)
        self.water -= lost
        self.hot -= lost * np.array([latent_heat(t) for t in self.hot.tolist()]) / self.heat

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
        sums = [np.bincount(cell, each, number.size) for each in (b, product)]
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
        if self.stirred:  # cells of a layer are one
            of_layer = lambda index: index // (nx * ny)  # noqa: E731
            row, column, size = of_layer(row), of_layer(column), nz
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
        if self.stirred:
            new = np.repeat(new, nx * ny)
        leaves = np.maximum(leaves, 0.0)
        left = float((leaves * new[top]).sum() / max(leaves.sum(), 1e-300))
        return new.reshape(nz, ny, nx), left
