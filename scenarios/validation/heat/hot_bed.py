"""A fluidised bed of hot seeds in cold gas, beside balances of both phases."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import spsolve

from cfddem.case.schema import Case
from cfddem.features.heat import HeatExchange
from cfddem.model.feature import Equipment
from cfddem.run.simulation import Simulation
from closures.heat_transfer import gunn
from scenarios.validation.heat.packed import HEAT
from scenarios.validation.table import Curves, Row

SEED = {"density": 1000.0, "youngs_modulus": 1.2e8, "contact_modulus": 1e6, "poisson": 0.3, "friction": 0.1}
LAWS = {"drag": "beetstra", "lubrication": "none", "self_disturbance_correction": False}

INLET, CAPACITY, SPEED = 300.0, 400.0, 1.2
"""Temperature [K] and velocity [m/s] of the cold gas, heat capacity of the hot seeds [J/kg/K]."""


def hot_case() -> Case:
    """3000 seeds of 400 K in gas of 300 K."""
    values: dict[str, Any] = {
        "fluid": {"density": 1.13, "viscosity": 1.68144e-5},
        "material": {
            "seed": SEED | {"restitution": 0.986},
            "wall": {"density": 1000.0, "youngs_modulus": 1.2e8, "contact_modulus": 1e6, "poisson": 0.3},
        },
        "column": {"width": 0.0144, "height": 0.0576, "cell": 0.0024, "material": "wall"},
        "bed": {
            "material": "seed", "diameter": 1.2e-3, "count": 3000, "seed": 1, "start": "suspended",
            "inlet_velocity": SPEED,
        },
        "laws": LAWS | {"heat_transfer": "gunn"},
        "heat": HEAT | {"heat_capacity": {"seed": CAPACITY}},
        "run": {"until": 1.0, "particle_step": 1e-5, "fluid_step": 2e-4, "reference_speed": 2.0},
    }  # fmt: skip
    return Case(**values)


def hot_bed(curves: Curves) -> list[Row]:
    """Hot seeds in cold gas, beside balances of both phases.

    Each balance has one thing less than the one before: bubbles and the place of every seed; its place alone; neither,
    gas that leaves as hot as the mean. The first two are those of :class:`TwoPhaseBalance`.
    """
    simulation = Simulation(hot_case())
    simulation.until(0.1)  # the gas of the start has left
    fluid, particles, heat = simulation.case.fluid, simulation.particles, simulation.feature(HeatExchange)
    assert fluid and heat.cells is not None
    flow = fluid.density * SPEED * simulation.case.column.floor_area * HEAT["fluid_heat_capacity"]
    air = (fluid.density, HEAT["fluid_heat_capacity"], HEAT["conductivity"], fluid.viscosity)
    in_cells, in_layers = (
        TwoPhaseBalance(simulation, air, CAPACITY, INLET, resolution) for resolution in ("cells", "layers")
    )
    simulation.add(Balances([in_cells, in_layers]))
    of_bed = float(heat.capacity(particles).sum())
    begin, first, gas = simulation.time, float(particles.temperature.mean()), heat.cells.content
    left, lines = first, []
    while simulation.time < 1.0:
        simulation.step()
        left -= flow * simulation.last_step * (heat.cells.leaving - INLET) / of_bed
        by_air = left - (heat.cells.content - gas) / of_bed
        mixed = INLET + (first - INLET) * math.exp(-flow / of_bed * (simulation.time - begin))
        mean = float(particles.temperature.mean())
        lines.append((simulation.time, mean, by_air, float(in_cells.hot.mean()), float(in_layers.hot.mean()), mixed))
    names = ("time", "run", "air that leaves", "every cell", "layers", "mixed at once")
    columns = dict(zip(names, np.array(lines).T))
    curves["hot bed"] = {name: (values, "s" if name == "time" else "K") for name, values in columns.items()}
    cooled = first - columns["run"][-1]
    rows = [Row("hot bed in cold gas: cooling of the seeds", cooled, unit="K")]
    for name in names[2:]:
        off = float(np.abs(columns["run"] - columns[name]).max()) / cooled
        limit = None if name == "mixed at once" else 0.02
        rows.append(Row(f"hot bed, balance ({name}): largest difference of the mean over the cooling", off, 0.0, limit))
    spread = float(particles.temperature.std())
    rows.append(Row("hot bed in cold gas: standard deviation of the seeds at the end", spread, unit="K"))
    return [*rows, Row("hot bed in cold gas: imbalance of heat", heat.imbalance, 0.0, 1e-11)]


# ---------------------------------------------------------------- the balance of gas and particles, cell by cell
#
# It takes another route than the solver's. It has the motion from a simulation: fluxes, voidage, and where the
# particles are with which Reynolds number. It has temperatures of its own. Gas is carried by first-order upwind
# differences, implicitly in all cells at once. Particles exchange by the exact exponential of a step, by `place`,
#
#     cells   with the cell of their centre alone
#     layers  with the cells of their layer, which have one state: the mean flux rises through a bed without bubbles


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
