"""What the coupling keeps between the parts of a fluid step: terms before it, and forces after it."""

from __future__ import annotations

from typing import NamedTuple

from cfddem.coupling.forces.agitation import AgitationTerms
from cfddem.coupling.forces.history import HistoryTerms
from cfddem.coupling.kernel import ParticleCellMap
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.transfer import ImplicitCoefficients
from cfddem.fluid.grid import Array


class CouplingTerms(NamedTuple):
    """What particles send into a fluid step, and what the coupling needs after it."""

    cell_map: ParticleCellMap
    flow: SampledFlow
    drag: Array  # conductance of the drag, with that of wall drag along the slip (N,) [kg/s]
    implicit: ImplicitCoefficients  # of drag and history force
    explicit: Array | None  # lift, viscous stress, added mass, wall drag across the slip (N, 3) [N]
    added: Array  # change of the added mass of every particle at the start of the step (N,) [kg]
    voidage: Array  # of the cells (nz, ny, nx)
    source: Array | None  # force on the fluid (nz, ny, nx, 3) [N/m3]
    agitation: AgitationTerms | None = None
    history: HistoryTerms | None = None

    @property
    def step(self) -> float:
        """Length of the fluid step [s]."""
        return self.implicit.step

    @property
    def fluctuating_force(self) -> Array | None:
        """Explicit force of agitation on every particle (N, 3) [N]."""
        return None if self.agitation is None else self.agitation.force

    @property
    def fields(self) -> tuple[Array, Array, Array, Array | None]:
        """Arguments of `FluidSolver.step` after the length of the step."""
        return self.voidage, self.implicit.cell_conductance, self.implicit.cell_product, self.source


class FluidForces(NamedTuple):
    """Forces of the fluid on every particle, constant over a fluid step (N, 3) [N]; None for those that a run lacks."""

    drag: Array
    pressure: Array | None  # of model A, without buoyancy
    weight: Array  # less buoyancy
    explicit: Array | None  # lift, viscous stress, added mass, wall drag across the slip
    agitation: Array | None  # by the acceleration of the fluctuation, or the fluctuating force; not that in the drag
    history: Array | None
