"""Build the parts of a run from a case: grid, boundaries, walls, materials, solvers, forces and coupling."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.case.bed import Jet, at_times
from cfddem.case.column_grid import SIDE_OF, face_at, grid_of, open_floor, patch_faces
from cfddem.case.liquid import Bond
from cfddem.case.materials import pair_overrides
from cfddem.case.particle_properties import SPECIES
from cfddem.case.patches import PLANES
from cfddem.case.schema import Case
from cfddem.case.tables import Column
from cfddem.case.vessel_shape import corners_in
from cfddem.coupling.coupling import Coupling
from cfddem.coupling.forces.added_mass import AddedMass
from cfddem.coupling.forces.agitation import Agitation, FluctuatingForce, PseudoTurbulence
from cfddem.coupling.forces.drag import Drag, WallDrag
from cfddem.coupling.forces.history import History
from cfddem.coupling.forces.lift import Lift, Torque
from cfddem.coupling.forces.pressure import PressureForce, ViscousStress, Weight
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.sampled_flow import change_along
from cfddem.coupling.self_disturbance import SelfDisturbance
from cfddem.features.evaporation_keys import Evaporation
from cfddem.features.moving_walls import case_walls
from cfddem.fluid.block import Block, Division
from cfddem.fluid.conditions import Condition, FreeSlip, Inlet, NoSlip, Outlet, Periodic, discs, rectangle
from cfddem.fluid.grid import Array, Region, layers
from cfddem.fluid.solver import FluidSolver, Scheme
from cfddem.model.feature import FluidForce
from cfddem.particles.ghosts import SingleDomain, handed_out
from cfddem.particles.interactions.bond import BondLaw
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.neighbours import wrap
from cfddem.particles.solver import ParticleSolver, Sharing, SolverSettings
from cfddem.particles.state import Particles
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.shapes import Cylinder, Plane, Turned
from cfddem.particles.walls.wall import Wall
from cfddem.run.division import cells_of, space_of
from cfddem.run.initial_particles import particles_of
from closures.added_mass import zuber
from closures.registry import Law, law_of


class Parts(NamedTuple):
    """The particles of a run and their coupling with its fluid; none for a case of particles only."""

    particle_solver: ParticleSolver
    coupling: Coupling | None


def parts_of(
    case: Case,
    progress: Callable[[str], None] = lambda _: None,
    particles: Particles | None = None,
    communicator: Communicator = SERIAL,
) -> Parts:
    """Build the parts of a run.

    progress      receives a line of text on what is being done
    particles     of an earlier part of the run, of which each rank has some; made from the case if None
    communicator  path to sums, extremes and decisions over all ranks
    """
    table, walls, laws = materials_of(case), walls_of(case), laws_of(case)
    spheres = particles
    if spheres is None:
        if case.bed.start == "poured":
            progress(f"pouring {case.particle_count} particles")
        spheres = _made(case, table, walls, laws, communicator)
    if case.bed.species:
        spheres.declare(SPECIES)
    dry, cells = not case.has_fluid, cells_of(case, spheres.position, communicator)
    division = space_of(case, spheres.position, communicator, cells)
    if division is not None:
        wrap(spheres.position, np.where(case.column.periodic, case.column.size, math.inf))
        spheres = handed_out(spheres, division, communicator)
    solver = ParticleSolver(
        spheres,
        table,
        walls=walls,
        laws=laws,
        gravity=case.laws.gravity if dry else (0.0, 0.0, 0.0),
        box=case.column.periodic_lengths,
        settings=SolverSettings(
            domain=_domain(case), record=case.run.record_collisions, energies=case.run.energy_budget, gpu=case.run.gpu
        ),
        sharing=Sharing(communicator=communicator, division=division, balance=True),
    )
    if dry:
        return Parts(solver, None)
    _, coupling = flow_of(case, solver.particles, communicator, cells, solver.lists.ghosts)
    if coupling.sets_inertia:
        solver.refresh()  # the forces of films depend on the inertia
    return Parts(solver, coupling)


def _made(case: Case, table: np.ndarray, walls: list[Wall], laws: Laws, communicator: Communicator) -> Particles:
    """The particles of a case at the start, all of them on rank 0."""
    on_this_rank = list[Particles]()

    def no_rows() -> Particles:
        on_this_rank.append(particles_of(case, table, walls, laws))
        return on_this_rank[0].copy(slice(0))

    fields = communicator.by_first(no_rows)
    return on_this_rank[0] if on_this_rank else fields


def flow_of(
    case: Case,
    spheres: Particles,
    communicator: Communicator = SERIAL,
    cells: Division | None = None,
    owners: SingleDomain | None = None,
) -> tuple[FluidSolver, Coupling]:
    """The fluid of a case around its particles, and their coupling.

    spheres  particles of this rank
    cells    division of the cells among the ranks; None in one process
    owners   which rank owns which particles; as the cells if None
    """
    grid = grid_of(case)
    if cells is not None:
        grid = Block(grid, cells, communicator)
    fluid = FluidSolver(
        grid,
        boundaries_of(case),
        density=case.required_fluid.density,
        viscosity=case.required_fluid.viscosity_at(grid.centres()[2]),
        gravity=case.laws.gravity,
        scheme=Scheme(model=case.laws.model, convection=case.laws.convection),
        communicator=communicator,
    )
    kernel = FilterKernel(
        grid,
        case.column.periodic,
        mapping=case.laws.mapping,
        smoothing=case.laws.kernel_width * case.bed.largest_diameter,
        sizes=kernels_of(case),
        owners=owners,
    )
    beside = wall_drag_of(case.laws.wall_drag, walls_of(case), laws_of(case))
    forces = forces_of(case, fluid, kernel, beside)
    return fluid, Coupling(spheres, fluid, kernel, forces)


APART = 1.25
"""Particles whose diameters differ by less than this factor have the same kernel, that of the largest of them."""


def kernels_of(case: Case) -> list[tuple[float, float]]:
    """Radius and standard deviation of the kernel of each size of particles, ascending [m]; empty for one size."""
    if case.laws.kernel_width == 0.0:
        return []
    kinds = [species.sizes or [(species.diameter, 1.0)] for species in case.species.values()]
    diameters, largest = sorted({diameter for kind in kinds for diameter, _ in kind}, reverse=True), list[float]()
    for diameter in diameters:
        if not largest or largest[-1] >= APART * diameter:
            largest.append(diameter)
    widths = [(0.5 * diameter, case.laws.kernel_width * diameter) for diameter in reversed(largest)]
    return widths if len(widths) > 1 else []


def materials_of(case: Case) -> np.ndarray:
    """Pair table of the case's materials, in the order of the case."""
    return pair_table(list(case.material.values()), pair_overrides(case.material, case.pair))


def walls_of(case: Case) -> list[Wall]:
    """Floor and lid unless the ends are periodic, sides unless they are periodic, or the vessel, then other walls."""
    width, depth, height = case.column.size
    names, first = list(case.material), next(iter(case.species.values()))
    solid = names.index(case.column.material or first.material or names[0])
    walls: list[Wall] = []
    if case.column.ends != "periodic":
        walls.append(Plane(material=solid))
        walls.append(Plane(point=(0.0, 0.0, height), normal=(0.0, 0.0, -1.0), material=solid))
    if case.vessel:
        spin, middle = (0.0, 0.0, case.vessel.spin), (0.5 * width, 0.5 * depth, 0.0)
        if not case.vessel.is_round:
            walls.append(Mesh.of_corners(corners_in(case.vessel, case.column), material=solid))
        elif case.vessel.is_upright:
            walls.append(Cylinder(point=middle, radius=case.line[0][1], spin=spin, material=solid))
        else:
            walls.append(Turned(line=case.line, point=middle, spin=spin, material=solid))
        return [*walls, *case_walls(case, solid)]
    if case.column.shape == "cylinder":
        walls.append(Cylinder(point=(0.5 * width, 0.5 * width, 0.0), radius=0.5 * width, material=solid))
        return [*walls, *case_walls(case, solid)]
    for axis, length, repeats in zip((0, 1), (width, depth), case.column.periodic):
        if not repeats:
            inward = np.eye(3)[axis]
            walls.append(Plane(normal=tuple(inward), material=solid))
            walls.append(Plane(point=tuple(length * inward), normal=tuple(-inward), material=solid))
    return [*walls, *case_walls(case, solid)]


FILM_MOTIONS: dict[Any, str] = {"nijssen_full": "full", "nijssen_full_twist": "full_twist"}
"""Choice of a case -> motions that films resist."""


def laws_of(case: Case) -> Laws:
    """Laws between particles."""
    laws = case.laws
    own: dict[str, Any] = {kind: law.function for kind, law in laws.pair_laws.items()} if case.has_films else {}
    return Laws(
        film=case.has_films,
        film_tolerance=case.run.film_tolerance,
        friction_onset=laws.friction_onset,
        contact=laws.contact_law,
        rolling=laws.rolling_resistance,
        rolling_damping=laws.rolling_damping,
        bridge=bridge_laws_of(case),
        film_motions=FILM_MOTIONS.get(laws.film_in(case.around), "normal"),
        **own,
    )


def bridge_laws_of(case: Case) -> BridgeLaws | None:
    """Laws of the liquid bridges; None without a liquid."""
    liquid = case.liquid
    if liquid is None:
        return None
    return BridgeLaws(
        viscosity=liquid.viscosity,
        surface_tension=liquid.surface_tension,
        contact_angle=math.radians(liquid.contact_angle),
        pull=liquid.pull,
        film=liquid.film,
        tangential=liquid.tangential,
        cut=liquid.cut,
        rupture=liquid.rupture,
        redistribution=liquid.redistribution,
        minimum_gap=liquid.minimum_gap or max(materials_of(case)["roughness_gap"].ravel().tolist()),
        wall_contact_angle=None if liquid.wall_contact_angle is None else math.radians(liquid.wall_contact_angle),
        wall_share=liquid.wall_share,
        film_density=liquid.film_density,
        wall_film=liquid.wall_thickness,
        wall_patch=case.bed.diameter if liquid.wall_share > 0.0 else 0.0,
        dries=Evaporation.of(case) is not None,
        bond=_bond_of(liquid.bond),
    )


def _bond_of(bond: Bond | None) -> BondLaw | None:
    """Law of the solid bonds of dry bridges; None if these break."""
    if bond is None:
        return None
    strengths = bond.model_dump()
    return BondLaw(**strengths | {"shear_strength": bond.shear_strength or bond.tensile_strength})


def _domain(case: Case) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Corners of the box that no centre may leave; infinite along periodic directions [m]."""
    repeats, size = case.column.periodic, case.column.size
    low = tuple(-math.inf if is_periodic else 0.0 for is_periodic in repeats)
    high = tuple(math.inf if is_periodic else length for is_periodic, length in zip(repeats, size))
    return low, high  # type: ignore[return-value]


# ---------------------------------------------------------------- fluid


def boundaries_of(case: Case) -> dict[str, Condition | list[Condition]]:
    """Boundary conditions of the fluid on the six sides."""
    kinds = {"no_slip": NoSlip, "free_slip": FreeSlip, "periodic": Periodic}
    column = case.column
    sides, front = kinds[column.sides](), kinds[column.front or column.sides]()
    conditions: dict[str, Condition | list[Condition]] = {
        "x_low": sides, "x_high": sides, "y_low": front, "y_high": front,
    }  # fmt: skip
    if column.ends == "periodic":
        conditions |= {"z_low": Periodic(), "z_high": Periodic()}
    elif column.ends == "closed":
        conditions |= {"z_low": NoSlip(), "z_high": NoSlip()}
    else:
        conditions |= {"z_low": _inlet(case), "z_high": Outlet()}
    for name, side in SIDE_OF.items():
        conditions[name] = with_patches(case, side, conditions[name])
    return conditions


def _inlet(case: Case) -> list[Condition]:
    """Inlets in the floor: all of its open cells, and a jet in its middle."""
    velocity, is_open = case.bed.inlet_velocity, open_floor(case)

    def within(region: Region | None = None) -> Region | None:
        """The part of a region below open cells; all of it where every cell is open."""
        if is_open is None or region is None:
            return is_open or region
        return lambda *at: is_open(*at) & region(*at)

    if isinstance(velocity, float):
        inlets: list[Condition] = [Inlet(velocity, where=within())]
    else:
        inlets = [Inlet(1.0, in_time=lambda t: float(at_times(velocity, t)), where=within())]
    return [*inlets, *(Inlet(jet.velocity, where=within(_hole(jet, case.column))) for jet in case.bed.jets)]


def _hole(jet: Jet, column: Column) -> Region:
    width, depth, height = column.size
    if jet.round:
        return discs([(0.5 * width, 0.5 * depth)], diameter=jet.width)
    half_x, half_y = 0.5 * jet.width, 0.5 * (jet.depth or depth)
    low = (0.5 * width - half_x, 0.5 * depth - half_y, -height)
    return rectangle(low, (0.5 * width + half_x, 0.5 * depth + half_y, height))


# ---------------------------------------------------------------- forces between fluid and particles


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
        forces.append(Drag(laws.drag_law, fluid.model, kernel if case.surface == "sharp" else None))
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
    of_run, factors = (fluid, kernel, case.bed.seed), case.agitation_factors
    if not isinstance(law, Law):
        return [FluctuatingForce(*of_run, factors)]
    coefficient = next(iter(added_mass), AddedMass(law_of(zuber), fluid.density))
    return [PseudoTurbulence(*of_run, law, added_mass=coefficient, factors=factors)]


# ---------------------------------------------------------------- patches of floor, lid and sides
#
# The flow through a patch is its velocity times its area. Faces of cells do not follow the edge of a disc: through one
# that a patch covers in part, that part of the flow enters.


def with_patches(case: Case, side: str, base: Condition | list[Condition]) -> Condition | list[Condition]:
    """The conditions of a side with the patches of a case.

    side    as a patch names it
    base    conditions without patches
    errors  InputError for a patch that covers no opening
    """
    of_side = patch_faces(case, side)
    if not of_side.patches:
        return base
    listed = base if isinstance(base, list) else [base]
    flow, inlets = _before(listed[0]), of_side.inlets
    others = [of_side.whole(name) for name in of_side.patches if name not in inlets]
    entering = np.sum([of_side.shares[name] for name in inlets], axis=0) > 0.0  # local: every rank knows all patches
    covered = entering | np.any(others, axis=0)  # local: likewise
    axis, high = PLANES[side]
    replaced = any(patch.shape == "whole" and not patch.brings for patch in of_side.patches.values())
    closed = ~grid_of(case).open[layers(axis, -1 if high else 0)]
    if replaced or np.all(covered | closed):  # local: likewise
        listed = [NoSlip()]  # nothing of the side itself is left
    conditions = [*listed]
    for name, patch in of_side.patches.items():
        if not patch.brings:
            where = _at(case, side, of_side.whole(name))
            conditions.append(
                NoSlip(where=where) if patch.kind == "wall" else Outlet(patch.pressure or 0.0, where=where)
            )
        elif name == inlets[-1]:  # all inlets at once: two may share a face
            speeds = [(of_side.patches[one].speed, of_side.shares[one]) for one in inlets]
            velocity = _velocity(case, side, speeds, flow, of_side.rest)
            conditions.append(Inlet(velocity, where=_at(case, side, entering)))
    return conditions


def _before(condition: Condition) -> Callable[[float], float]:
    """Velocity that enters through the whole side without patches, as a function of time."""
    if not isinstance(condition, Inlet):
        return lambda time: 0.0
    speed, factor = float(condition.velocity), condition.in_time  # type: ignore[arg-type]
    return lambda time: speed * (factor(time) if factor else 1.0)


def _velocity(
    case: Case,
    side: str,
    speeds: Sequence[tuple[Callable[[float], float], Array]],
    flow: Callable[[float], float],
    rest: Array,
) -> Callable[[Array, Array, Array, float], Array]:
    """Inward speed at faces: that of every patch by its share, and that of the floor by the rest."""

    def velocity(x: Array, y: Array, z: Array, time: float) -> Array:
        face = face_at(case, side, x, y, z)
        entering: Any = sum(speed(time) * share[face] for speed, share in speeds)
        return np.asarray(entering + flow(time) * rest[face])

    return velocity


def _at(case: Case, side: str, chosen: np.ndarray) -> Region:
    """The faces of a side that are chosen."""

    def where(x: Array, y: Array, z: Array) -> np.ndarray:
        return np.asarray(chosen[face_at(case, side, x, y, z)])

    return where
