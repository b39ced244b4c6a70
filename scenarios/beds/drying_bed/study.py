r"""Drying of a fluidised bed, beside the balance of heat and water.

Air that leaves the bed saturated, at the temperature of the seeds, gives its heat to the water that it takes along:

.. math:: c\,(T_{in} - T) = L(T)\,(Y_s(T) - Y_{in}), \qquad \dot m = \rho U A\,(Y_s(T) - Y_{in})

The heat that warms the seeds at the start comes from the same air:

.. math:: t\,\rho U A\,c\,(T_{in} - T) = m L(T) + m_s c_s (T - T_0)

`python -m scenarios.beds.drying_bed.study OUTPUT.png` runs the bed, which takes some minutes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.features.evaporation_keys import Evaporation, VapourTable
from cfddem.features.heat_keys import Heat
from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from cfddem.run.history import row
from cfddem.run.simulation import Simulation
from closures.evaporation import latent_heat, saturation_pressure, vapour_fraction

DRY = 0.01
"""Share of the water at which the bed counts as dry [-]."""


@dataclass(frozen=True)
class Balance:
    """What the balance of heat and water gives."""

    temperature: float  # of the seeds while they dry at a constant rate [K]
    outlet: float  # mass fraction of vapour in the air that leaves [-]
    rate: float  # [kg/s]
    end: float  # time at which the water has gone [s]


@dataclass(frozen=True)
class Drying:
    """History of a run."""

    time: np.ndarray  # [s]
    water: np.ndarray  # that has evaporated, over all there was [-]
    temperature: np.ndarray  # mean of the seeds [K]
    outlet: np.ndarray  # mass fraction of vapour in the air that leaves [-]
    rate: np.ndarray  # of evaporation, between rows [kg/s]
    by_air: np.ndarray  # the same from the air that enters and leaves [kg/s]
    imbalance: float  # largest of heat, vapour and liquid [-]

    @property
    def end(self) -> float:
        """Time at which all water but a hundredth has gone [s]; infinite in a run that ends before."""
        dry = self.water >= 1.0 - DRY
        return float(self.time[np.argmax(dry)]) if dry.any() else float("inf")

    def mean(self, values: np.ndarray, begin: float, end: float) -> float:
        """Mean over rows of a window [s]."""
        return float(values[(self.time > begin) & (self.time <= end)].mean())


def case(**overrides: object) -> Case:
    """The case of the gallery with other values."""
    return Case.from_toml(gallery_files()["drying-bed"], overrides)


def _ramp(described: Case) -> np.ndarray:
    """Times [s] and velocities [m/s] of the air that enters (n, 2)."""
    speed = described.bed.inlet_velocity
    return np.array([[0.0, speed]] if isinstance(speed, float) else speed)


def balance(described: Case, water: float, capacity: float) -> Balance:
    """Balance of a case whose air leaves saturated.

    water     at the start [kg]
    capacity  heat capacity of all seeds [J/K]
    """
    heat, vapour, keys = Heat.of(described), VapourTable.of(described), Evaporation.of(described)
    assert heat and vapour and keys and described.fluid
    inlet, inflow = heat.inlet_temperature or heat.fluid_temperature, vapour.inflow
    low, high = 250.0, inlet
    for _ in range(60):
        middle = 0.5 * (low + high)
        surface = vapour_fraction(min(saturation_pressure(middle), keys.pressure), keys.pressure)
        sensible = heat.fluid_heat_capacity * (inlet - middle)
        low, high = (middle, high) if sensible > latent_heat(middle) * (surface - inflow) else (low, middle)
    ramp = _ramp(described)
    flow = described.fluid.density * described.column.floor_area * float(ramp[-1, 1])
    missed = float(np.trapezoid(ramp[-1, 1] - ramp[:, 1], ramp[:, 0]) / ramp[-1, 1])  # time, while the inlet opens
    wanted = water * latent_heat(middle) + capacity * (middle - heat.particle_temperature)
    end = wanted / (flow * heat.fluid_heat_capacity * (inlet - middle)) + missed
    return Balance(middle, surface, flow * (surface - inflow), end)


def drying(described: Case) -> tuple[Drying, Balance]:
    """Dry the bed of a case; its history, and the balance."""
    simulation, rows = Simulation(described), []
    keys, vapour = Evaporation.of(described), VapourTable.of(described)
    heat = Heat.of(described)
    assert keys and vapour and heat and described.fluid
    first = row(simulation)
    water = keys.liquid_density * (first["liquid_on_particles"] + first["liquid_in_bridges"])
    capacity = float((simulation.particles.mass * heat.capacities(described)[simulation.particles.material]).sum())
    while simulation.time < described.run.until - 1e-9:
        simulation.until(simulation.time + (described.run.history_every or 0.01))
        rows.append(row(simulation))
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    area = described.fluid.density * described.column.floor_area
    gone = np.append(0.0, columns["evaporated_mass"])
    result = Drying(
        time=columns["time"],
        water=columns["evaporated_mass"] / water,
        temperature=columns["mean_temperature"],
        outlet=columns["outlet_vapour"],
        rate=np.diff(gone) / np.diff(np.append(0.0, columns["time"])),
        by_air=area * np.interp(columns["time"], *_ramp(described).T) * (columns["outlet_vapour"] - vapour.inflow),
        imbalance=max(float(columns[f"{name}_imbalance"].max()) for name in ("heat", "vapour", "liquid")),
    )
    return result, balance(described, water, capacity)


# ---------------------------------------------------------------- figure of the drying bed


def figure(drying: Drying, balance: Balance, path: Path) -> None:
    """Temperature, water and rate of a run, with what the balance says."""
    drawn, (left, right) = panels(2, width=9.0, height=3.8)
    left.plot(drying.time, drying.temperature - 273.15, color=BLUE, label="mean of the seeds")
    left.axhline(balance.temperature - 273.15, color=GREY, ls="--", label="balance")
    left.axvline(balance.end, color=GREY, lw=1.0, ls=":", label="end by the balance")
    label(left, "time", "s", "temperature", "°C")
    legend(left, loc="upper left")
    right.plot(drying.time, 1e6 * drying.rate, color=BLUE, label="from the seeds")
    right.plot(drying.time, 1e6 * drying.by_air, color=ORANGE, label="by the air that leaves")
    right.axhline(1e6 * balance.rate, color=GREY, ls="--", label="balance")
    right.axvline(balance.end, color=GREY, lw=1.0, ls=":")
    label(right, "time", "s", "rate of evaporation", "mg/s")
    legend(right, loc="lower left")
    save(drawn, path)


if __name__ == "__main__":
    figure(*drying(case()), Path(sys.argv[1] if len(sys.argv) > 1 else "drying_bed.png"))
