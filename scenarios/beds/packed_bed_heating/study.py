r"""Heating of a packed bed, and its exact solution for plug flow (Schumann, J. Franklin Inst. 208 (1929) 405-416).

With :math:`y = h a x/(\rho c\,U)` and :math:`z = h a\,(t - \varepsilon x/U)/((1-\varepsilon)\rho_s c_s)` the solids
and the fluid have

.. math:: T_s = e^{-y}\int_0^z e^{-s} I_0(2\sqrt{y s})\,ds, \qquad T_f = T_s + e^{-y-z} I_0(2\sqrt{y z})

of the difference between inlet and start.

`python -m scenarios.beds.packed_bed_heating.study OUTPUT.png` takes a few seconds.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.features.heat import HeatExchange
from cfddem.features.heat_keys import Heat
from cfddem.plotting.curves import BLUE, GREY, label, legend, panels, save
from cfddem.run.simulation import Simulation


@dataclass(frozen=True)
class Heating:
    """Mean temperature of layers of the bed at one time, 0 at the start and 1 for that of the inlet."""

    time: float  # [s]
    height: np.ndarray  # of the layers [m]
    solids: np.ndarray
    fluid: np.ndarray
    exact_solids: np.ndarray
    exact_fluid: np.ndarray

    @property
    def error(self) -> float:
        """Largest difference of a layer of solids from the exact solution."""
        return float(np.abs(self.solids - self.exact_solids).max())

    @property
    def mean_error(self) -> float:
        """Mean difference of the layers of solids from the exact solution."""
        return float(np.abs(self.solids - self.exact_solids).mean())


def case(**overrides: object) -> Case:
    """The case of the gallery with other values."""
    return Case.from_toml(gallery_files()["packed-bed-heating"], overrides)


def schumann(distance: float, time: float) -> tuple[float, float]:
    """Temperatures of solids and fluid.

    distance  y, transfer units up to the place [-]
    time      z, transfer units of the solids since the first fluid has passed there [-]
    """
    from scipy.integrate import quad
    from scipy.special import i0e

    def rate(z: float) -> float:  # with the scaled Bessel function
        return math.exp(-((math.sqrt(distance) - math.sqrt(z)) ** 2)) * float(i0e(2.0 * math.sqrt(distance * z)))

    if time <= 0.0:
        return 0.0, 0.0
    solids = float(quad(rate, 0.0, time, limit=200)[0])
    return solids, solids + rate(time)


def heating(described: Case, times: Sequence[float]) -> list[Heating]:
    """Heat the bed of a case; temperatures of its layers of cells at some times [s]."""
    simulation, keys = Simulation(described), Heat.of(described)
    assert keys is not None
    fluid, heat, profiles = simulation.fluid, simulation.feature(HeatExchange), []
    assert heat.cells is not None
    start, inlet, speed = keys.particle_temperature, keys.sides_of(described).inflow, described.bed.inlet_velocity
    layers, edge = fluid.grid.shape[0], fluid.grid.spacing[2]
    height = (np.arange(layers) + 0.5) * edge
    assert isinstance(speed, float) and isinstance(inlet, float)
    for time in times:
        simulation.until(time)
        particles = simulation.particles
        of_layer = np.minimum((particles.position[:, 2] / edge).astype(int), layers - 1)
        solids = np.bincount(of_layer, particles.temperature, layers) / np.bincount(of_layer, minlength=layers)
        size, capacity = described.column.size, heat.capacity(particles).sum()
        volume, conductance = math.prod(size), float(heat.conductance(simulation.terms).sum())
        voidage = 1.0 - float(particles.volume.sum()) / volume
        units = conductance / (fluid.density * keys.fluid_heat_capacity * speed * volume)  # per length [1/m]
        exact = [schumann(units * x, conductance / capacity * (time - voidage * x / speed)) for x in height]
        exact_solids, exact_fluid = np.transpose(exact)
        scaled = (solids - start) / (inlet - start), (heat.cells.value.mean(axis=(1, 2)) - start) / (inlet - start)
        profiles.append(Heating(time, height, *scaled, exact_solids, exact_fluid))
    return profiles


# ---------------------------------------------------------------- figure of the heated bed


TIMES = (0.2, 0.4, 0.6)


def figure(path: Path) -> None:
    """Temperatures of the beads against height, with the exact ones."""
    drawn, axes = panels(width=6.5, height=4.0)
    for number, profile in enumerate(heating(case(), TIMES)):
        first = number == 0
        axes.plot(1e3 * profile.height, profile.exact_solids, color=GREY, label="exact, beads" if first else None)
        axes.plot(
            1e3 * profile.height, profile.exact_fluid, color=GREY, ls="--", label="exact, water" if first else None
        )
        axes.plot(1e3 * profile.height, profile.solids, "o", color=BLUE, ms=4, label="run, beads" if first else None)
        axes.plot(
            1e3 * profile.height,
            profile.fluid,
            "o",
            color=BLUE,
            mfc="none",
            ms=4,
            label="run, water" if first else None,
        )
        print(f"t = {profile.time} s: largest {profile.error:.4f}, mean {profile.mean_error:.4f}")
    label(axes, "height", "mm", "temperature, 0 at the start, 1 at the inlet", "-")
    legend(axes, loc="upper right")
    save(drawn, path)


if __name__ == "__main__":
    figure(Path(sys.argv[1] if len(sys.argv) > 1 else "packed_bed_heating.png"))
