r"""Self-disturbance: the velocity and the voidage that a particle itself causes in the cells around it.

A particle's force, deposited on cells, drives a flow that the particle then gathers from the same cells; its own
volume lowers the voidage there. Drag laws need the fluid without the particle. Both disturbances are known, because
the kernel and the discrete equations of the grid are. Per force, at a place f within its cell (0 to 1 along each axis),

.. math:: M_d(f) = \sum_{\Delta} G_d(\Delta) \prod_e A_e(\Delta_e),\qquad
          A(0) = (1-f)^2 + f^2,\ A(\pm1) = f(1-f)

where G is the flow of the grid's own Stokes equations, smoothing included, between cells that lie Delta apart. It is
a sum over waves. Each builds up at its own rate, nu times its eigenvalue L; waves of similar L are summed to one mode.
A moving particle leaves its disturbance behind: of a wave with the wave number k along its path the share
:math:`1/(1 + (Uk/\nu L)^2)` remains, which gives the steady sum (Oseen's, on the grid). With s the width of the
kernel, :math:`s^2 = M\eta/(2a_0)` where F a_0/rho is the first acceleration, every rate grows by nu/s^2 times
:func:`closures.disturbance.wake_decay`. Their sum is then close to the steady one; the rest is scaled away.

In a suspension the drag of the other particles damps the disturbance (Brinkman), which adds beta/(eps rho) to each
rate. Drag laws of dense beds are fitted to means that include every particle: of both disturbances only the share is
subtracted that the particle has in the solids gathered at its place.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, threaded
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.sampled_flow import Own
from cfddem.coupling.seen_solids import cells_of
from cfddem.coupling.self_disturbance_cut_cells import SolidsOfCells, WallsOfCells
from cfddem.coupling.self_disturbance_tables import MODES, PER_DECADE, tables
from cfddem.coupling.self_disturbance_walls import OwnSolids, WallsOfGrid, at_shares, cell_of, shares_in_cell
from cfddem.coupling.terms import CouplingTerms, total
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles
from closures.disturbance import wake_decay

DISTURBANCE = Field(
    "disturbance_modes", "m/s", (MODES, 3), "memory",
    meaning="fluid velocity that the particle itself causes at its place, by mode",
)  # fmt: skip


class SelfDisturbance(FluidForce):
    """Disturbance of every particle by its own force and volume.

    fluid         the fluid solver
    kernel        of the run; its tables are found once for each grid
    beside_walls  whether a law of the drag beside walls acts, so that walls of the grid stop the disturbance
    sharp         whether the surfaces of beds are sharp
    """

    name, fields = "self_disturbance", (DISTURBANCE,)

    def __init__(
        self, fluid: FluidSolver, kernel: FilterKernel, beside_walls: bool = False, sharp: bool = False
    ) -> None:
        grid, self.fluid = kernel.grid, fluid
        walls = fluid.boundaries if beside_walls else None
        self._kernel, kinds = kernel, range(len(kernel.stages))
        self._in_cells = [_own_solids(kernel, 2 if sharp else 1, walls, kind) for kind in kinds]
        cells = cells_of(kernel) if sharp else kernel
        self._seen = [_own_solids(cells, 1, walls, kind) for kind in kinds] if sharp else []
        self._walls = [WallsOfGrid(kernel, fluid.boundaries, kind) for kind in kinds] if beside_walls else []
        smooth = beside_walls and bool(grid.walls)
        self._smooth = [WallsOfCells(kernel, kind) for kind in kinds] if smooth else []
        self._cell = cell_of(kernel)
        self._tables = [tables(kernel, kind) for kind in kinds]

    def own(self, particles: Particles, cell_map: ParticleCellMap) -> Own:
        """What every particle gathers of its own."""
        modes = particles[DISTURBANCE.name]
        left = modes.copy() if self._walls else modes
        in_cells, of_surfaces = np.empty((2, particles.count))
        for kind, rows in self._kernel.of_each_kind(cell_map.radius):
            position, volume = cell_map.position[rows], cell_map.volume[rows]
            if self._walls:
                left[rows] *= self._walls[kind].left(position)
            if self._smooth:
                left[rows] = self._smooth[kind].left(position, left[rows])
            in_cells[rows] = self._in_cells[kind].of(position, volume)
            of_surfaces[rows] = self._seen[kind].of(position, volume) if self._seen else in_cells[rows]
        return Own(left, in_cells, of_surfaces)

    def end(self, terms: CouplingTerms) -> None:
        """The resistance of every particle has pushed the fluid; the drag of the others has stopped it."""
        if self.fluid.viscous:
            on_slip = total({line: terms.force(line) for line in terms.implicit_force}, terms.force("drag"))
            screening = terms.conductance("drag") * terms.flow.others / (self.fluid.density * terms.flow.voidage)
            self.advance(
                terms.particles, terms.cell_map, terms.flow.slip, on_slip, screening, self.fluid.density, terms.step
            )

    def advance(
        self,
        particles: Particles,
        cell_map: ParticleCellMap,
        slip: Array,
        drag: Array,
        screening: Array,
        density: float,
        step: float,
    ) -> None:
        """Let the modes grow and decay over a step [s] in which the particles have pushed the fluid.

        slip       u - v, without the self-disturbance (N, 3) [m/s]
        drag       on the particles; the fluid has received its opposite (N, 3) [N]
        screening  rate at which the drag of all other particles there stops the fluid (N,) [1/s]
        density    of the fluid [kg/m3]
        """
        numbers = np.arange(particles.count)
        pushed = Pushed(cell_map.position, drag, slip, screening, density, particles.viscosity, step)
        for kind, rows in self._kernel.of_each_kind(cell_map.radius):
            position, modes = cell_map.position[rows], particles.disturbance_modes
            left = self._walls[kind].left(position) if self._walls else np.empty((0, 0, 3))
            build = numbers[rows], pushed, self._cell, self._tables[kind], left
            _build_up(*build, modes)
            if self._smooth:
                grown = np.zeros_like(modes)
                _build_up(*build, grown)
                modes[rows] += self._smooth[kind].left(position, grown[rows]) - grown[rows]


def _own_solids(
    kernel: FilterKernel, passes: int, boundaries: Boundaries | None, kind: int
) -> OwnSolids | SolidsOfCells:
    """The solid fraction that particles gather of their own volume; see `OwnSolids`."""
    if boundaries and kernel.grid.walls:
        return SolidsOfCells(kernel, passes, kind)
    return OwnSolids(kernel, passes, boundaries, kind)


class Pushed(NamedTuple):
    """What particles do to the fluid in a step; see `SelfDisturbance.advance`."""

    position: Array  # at which they deposit (N, 3) [m]
    drag: Array  # (N, 3) [N]
    slip: Array  # (N, 3) [m/s]
    screening: Array  # (N,) [1/s]
    density: float  # [kg/m3]
    viscosity: Array  # (N,) [Pa s]
    step: float  # [s]


@inline
def _steady(moving, slowest, wave_number, shares):
    """Steady velocity times viscosity per force [1/m] at U/nu [1/m], interpolated in logarithms."""
    place = max(PER_DECADE * math.log10(max(wave_number, slowest) / slowest), 0.0)
    node = min(int(place), len(moving) - 2)
    low, high = at_shares(moving[node], shares), at_shares(moving[node + 1], shares)
    return low * (high / low) ** (place - node)


@threaded
def _build_up(rows, pushed, cell, tables, left, modes_of):
    """Exact relaxation of every mode of some particles towards its value under a steady force.

    rows    of these particles
    pushed  `Pushed`
    cell    origin and inverse spacing of the grid, and whether the mapping is linear
    tables  `Tables`
    left    share that walls leave, by place among the rows; empty without walls
    """
    position, drag, slip, screening, density, viscosity, step = pushed
    origin, inverse, linear = cell
    flow, rates, start, slowest, moving = tables
    modes = rates.shape[1]
    for place in prange(len(rows)):
        n = rows[place]
        diffusivity = viscosity[n] / density
        shares = shares_in_cell(n, position, origin, inverse, linear)
        speed = math.sqrt(slip[n, 0] ** 2 + slip[n, 1] ** 2 + slip[n, 2] ** 2)
        for d in range(3):
            at_rest = 0.0
            for k in range(modes):
                at_rest += at_shares(flow[d, k], shares)
            square = 0.5 * at_rest / at_shares(start[d], shares)
            decay = wake_decay(speed * math.sqrt(square) / diffusivity) / square
            total = 0.0
            for k in range(modes):
                total += at_shares(flow[d, k], shares) * rates[d, k] / (rates[d, k] + decay)
            scale = -_steady(moving[d], slowest, speed / diffusivity, shares) / total * drag[n, d] / viscosity[n]
            for k in range(modes):
                steady = scale * at_shares(flow[d, k], shares) * rates[d, k] / (rates[d, k] + decay)
                rate = diffusivity * (rates[d, k] + decay)
                remaining = math.exp(-step * (rate + screening[n]))
                steady *= rate / (rate + screening[n])
                if len(left) > 0:
                    steady *= left[place, k, d]
                modes_of[n, k, d] = steady + remaining * (modes_of[n, k, d] - steady)
