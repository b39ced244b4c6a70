"""The implicit transfer of any quantity: heat between particles and cells, by the class that transfers momentum.

A sphere of diameter d exchanges heat with the coefficient Nu k/d over its surface, Nu of Ranz and Marshall (1952),
from memory; the tests do not depend on its numbers.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.transfer import ImplicitCoefficients, Transfer
from cfddem.fluid.grid import Array, Grid
from cfddem.model.fields import Field
from cfddem.particles.state import Particles, make_particles

TEMPERATURE = Field("temperature", "K", initial=300.0, snapshot=True, meaning="temperature")
HEAT_CAPACITY = 800.0
"""Of the solids [J/(kg K)]."""


class Cells:
    """Heat of a fluid at rest in cells, advanced implicitly by what particles send.

    capacity  of each cell (nz, ny, nx) [J/K]; infinite for a bath of constant temperature
    """

    def __init__(self, grid: Grid, temperature: Array, capacity: float) -> None:
        self.volume, self.temperature, self.capacity = grid.cell_volume, temperature.copy(), capacity

    @property
    def heat(self) -> float:
        return float((self.capacity * self.temperature).sum())

    def advance(self, sent: ImplicitCoefficients) -> tuple[Array, Array]:
        """Make a step; returns the weight of each cell and the temperature that acted on the particles."""
        share = sent.step * self.volume / self.capacity
        self.temperature += share * sent.cell_product[..., 0]
        self.temperature /= 1.0 + share * sent.cell_conductance
        return np.ones((*self.temperature.shape, 1)), self.temperature[..., None]


def heat_capacity(particles: Particles) -> Array:
    """Heat capacity of every particle (N,) [J/K]."""
    return HEAT_CAPACITY * particles.mass


def conductance(particles: Particles, flow: SampledFlow, conductivity: float) -> Array:
    """The conductance Nu k/d times the surface (N,) [W/K]."""
    nusselt = 2.0 + 0.6 * np.sqrt(flow.reynolds) * 0.7 ** (1.0 / 3.0)
    diameter = 2.0 * particles.radius
    return np.asarray(nusselt * conductivity / diameter * math.pi * diameter**2)


class Bed:
    """Spheres at rest in a box of fluid that exchange heat with it.

    conductivity  of the fluid [W/(m K)]
    capacity      of a cell [J/K]
    source        heat set free in every particle [W]
    """

    def __init__(self, conductivity: float, capacity: float, source: float = 0.0, fluid: float = 300.0) -> None:
        draw, grid = np.random.default_rng(1), Grid((6, 5, 8), (0.01, 0.01, 0.01))
        self.kernel = FilterKernel(grid, (True, False, False), smoothing=0.012)
        places = draw.uniform(0.0, 1.0, (50, 3)) * np.array(grid.size)
        self.particles = make_particles(places, draw.uniform(1e-3, 3e-3, 50), 2500.0)
        self.particles.declare(TEMPERATURE, draw.uniform(300.0, 400.0, 50))
        self.transfer, self.source = Transfer(self.kernel, "temperature", ("heat", "J"), heat_capacity), source
        self.conductivity = conductivity
        self.transfer.declare(self.particles)
        self.cells = Cells(grid, np.full(grid.shape, fluid), capacity)
        none, vectors = np.zeros(50), np.zeros((50, 3))
        reynolds = draw.uniform(0.0, 100.0, 50)
        self.flow = SampledFlow(vectors, vectors, none, reynolds, none, none)

    @property
    def conductance(self) -> Array:
        """Conductance between each particle and the fluid (N,) [W/K]."""
        return conductance(self.particles, self.flow, self.conductivity)

    @property
    def rate(self) -> Array:
        """Rate at which each particle approaches the fluid's temperature [1/s]."""
        return self.conductance / heat_capacity(self.particles)

    def step(self, step: float) -> None:
        particles = self.particles
        cell_map = self.kernel.map_particles(particles.position, particles.radius)
        sent = self.transfer.prepare(particles, cell_map, self.conductance, step)
        received = self.transfer.apply(particles, cell_map, sent, *self.cells.advance(sent))
        particles.temperature += step * (received[:, 0] + self.source) / heat_capacity(particles)

    @property
    def heat(self) -> float:
        return self.cells.heat + float((heat_capacity(self.particles) * self.particles.temperature).sum())


@pytest.mark.parametrize("conductivity", [1e-2, 1e2, 1e6], ids=["weak", "stiff", "very stiff"])
def test_total_heat_is_conserved(conductivity: float) -> None:
    """To round-off, whether a particle relaxes within many steps or within a millionth of one."""
    bed = Bed(conductivity, capacity=0.05)
    before, spread = bed.heat, bed.particles.temperature.std()
    for _ in range(20):
        bed.step(0.1)
    assert bed.heat == pytest.approx(before, rel=1e-14)
    assert bed.particles.temperature.std() < spread
    assert bed.particles.temperature.min() > 300.0 - 1e-9 and bed.particles.temperature.max() < 400.0


def test_temperature_relaxes_exponentially_with_second_order_in_the_step() -> None:
    """In a fluid of constant temperature: T - u = (T_0 - u) exp(-b t/C)."""
    errors = []
    for steps in (20, 40, 80):
        bed = Bed(0.5, capacity=math.inf)
        start, slow = bed.particles.temperature.copy(), float(bed.rate.max())
        for _ in range(steps):
            bed.step(1.0 / slow / steps)
        exact = 300.0 + (start - 300.0) * np.exp(-bed.rate / slow)
        errors.append(float(np.abs(bed.particles.temperature - exact).max()))
    assert errors[0] < 0.02
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.15)


def test_a_long_step_does_not_pass_the_temperature_of_the_fluid() -> None:
    bed = Bed(1e4, capacity=math.inf)
    bed.step(10.0)
    assert bed.particles.temperature == pytest.approx(300.0, abs=1e-2) and bed.particles.temperature.min() >= 300.0


@pytest.mark.parametrize("step", [0.1, 20.0], ids=["short steps", "long steps"])
def test_heated_particles_end_at_the_balance_of_source_and_transfer(step: float) -> None:
    """The source enters the implicit coefficients through the change over the step before."""
    bed = Bed(0.5, capacity=math.inf, source=1e-3)
    for _ in range(5 + math.ceil(15.0 / (bed.rate.min() * step))):
        bed.step(step)
    excess = 1e-3 / (bed.rate * heat_capacity(bed.particles))
    assert bed.particles.temperature - 300.0 == pytest.approx(excess, rel=1e-4)


def test_what_the_transfer_stores_moves_with_the_particles() -> None:
    """A particle that is inserted has received nothing before, and begins at its own temperature."""
    bed = Bed(0.5, capacity=0.05)
    bed.step(0.1)
    fresh = make_particles(np.full((1, 3), 0.02), 1e-3, 2500.0)
    fresh.declare(TEMPERATURE, 350.0)
    bed.particles.append(fresh)
    assert bed.particles.heat[-1] == 0.0 and bed.particles.temperature_before[-1] == 350.0
    assert {"temperature", "temperature_before", "heat"} <= bed.particles.checkpoint().keys()
