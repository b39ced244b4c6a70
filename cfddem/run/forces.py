"""The forces between fluid and particles that the laws of a case name."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Literal

import numpy as np

from cfddem.case.schema import Case
from cfddem.coupling.forces.added_mass import AddedMass
from cfddem.coupling.forces.agitation import FluctuatingForce, PseudoTurbulence
from cfddem.coupling.forces.agitation_terms import Agitation
from cfddem.coupling.forces.drag import Drag
from cfddem.coupling.forces.history import History
from cfddem.coupling.forces.lift import Lift
from cfddem.coupling.forces.pressure import PressureForce
from cfddem.coupling.forces.torque import Torque
from cfddem.coupling.forces.viscous_stress import ViscousStress
from cfddem.coupling.forces.wall_drag import WallDrag
from cfddem.coupling.forces.weight import Weight
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.self_disturbance import SelfDisturbance
from cfddem.coupling.velocity_gradient import change_along
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.walls.shapes import Wall
from closures.added_mass import zuber
from closures.registry import Law, law_of


def forces_of(
    case: Case, fluid: FluidSolver, kernel: FilterKernel, beside: Sequence[WallDrag] = ()
) -> list[FluidForce]:
    """The forces that the laws of a case name, in the order in which they act and are summed within a line.

    beside  drag beside walls, of `wall_drag_of`
    """
    laws = case.laws
    added_mass = [
        AddedMass(law, fluid.density, partial(change_along, fluid, kernel)) for law in [laws.added_mass_law] if law
    ]
    forces: list[FluidForce] = []
    if laws.viscous_stress and fluid.model == "A":
        forces.append(ViscousStress(fluid, kernel))
    if laws.lift:
        forces.append(Lift(fluid, kernel))
    if laws.drag_law:
        forces.append(Drag(laws.drag_law, fluid.model, kernel if laws.surface == "sharp" else None))
    forces += [*agitation_of(case, fluid, kernel, *added_mass), *beside, *added_mass]
    if laws.history != "none":
        forces.append(History(laws.history, fluid.density, fluid.model))
    if fluid.model == "A":
        forces.append(PressureForce(fluid, kernel))
    forces.append(Weight(fluid.density, np.array(laws.gravity)))
    if laws.torque:
        forces.append(Torque(fluid, kernel))
    if laws.self_disturbance_correction:
        forces.append(SelfDisturbance(fluid, kernel, bool(beside), any(force.sharp for force in forces)))
    return forces


def wall_drag_of(which: Literal["none", "nearest", "all"], walls: Sequence[Wall], laws: Laws) -> list[WallDrag]:
    """Extra drag beside walls; nothing without."""
    return [] if which == "none" else [WallDrag(walls, which, film=laws.film, shear=laws.shears)]


def agitation_of(case: Case, fluid: FluidSolver, kernel: FilterKernel, *added_mass: AddedMass) -> list[Agitation]:
    """Agitation of the particles by the disturbed flow around their neighbours; nothing without.

    added_mass  of the run, if it has one
    """
    law = case.agitation
    if law == "none":
        return []
    given = case.agitation_factors
    factors = {"drag_share_along": given.along, "drag_share_across": given.across, "time_share": given.time}
    if not isinstance(law, Law):
        return [FluctuatingForce(fluid, kernel, case.bed.seed, **factors)]
    coefficient = next(iter(added_mass), AddedMass(law_of(zuber), fluid.density))
    return [
        PseudoTurbulence(
            fluid, kernel, case.bed.seed, law, added_mass=coefficient, inertia_share=given.inertia, **factors
        )
    ]
