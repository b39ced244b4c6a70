"""The history of a run: measures of the simulation, one column each, one row at each recorded time.

A measure is one function of a simulation. `@measure(unit)` declares it: the name of the function becomes the name of
the column, the first line of its docstring the meaning. The column then appears in the history, and its mean with an
error in the report.

>>> from cfddem import measure
>>> @measure("m/s")
... def mean_speed(simulation):
...     \"\"\"Mean speed of the particles.\"\"\"
...     return np.linalg.norm(simulation.particles.velocity, axis=1).mean()
>>> forget("mean_speed")  # only needed to keep this example out of later runs
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cfddem.analysis import measures
from cfddem.analysis.layers import FEWEST_LAYERS, LAYER
from cfddem.backend.errors import InputError, shown
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature
from cfddem.features.feature_list import FEATURES
from cfddem.features.feeds import LANDED
from cfddem.fluid.budgets import continuity_residual, drag_exchange
from cfddem.fluid.cut_cells import open_share
from cfddem.fluid.wall_force import pressure_fall
from cfddem.io.quantities import TIME, Quantity, of_function
from cfddem.particles.state import kinetic_energy as kinetic_energy_of
from cfddem.preflight.bed_waves import is_liquid_bed
from cfddem.run.simulation import Simulation
from cfddem.run.wall_loads import loads_of_particles, wall_load_columns, wall_loads

Function = Callable[[Simulation], float]
"""A measure: a number for the present state of a simulation."""

MEAN_HEIGHT = "mean_height_"
"""Prefix of the columns with the mean height of each species."""


@dataclass(frozen=True)
class Measure:
    """Columns of the history that one function gives.

    columns   name -> quantity, for a case; empty if the case has no such columns
    values    name -> value, for a simulation
    shared    right on several ranks too
    """

    columns: Callable[[Case], Mapping[str, Quantity]]
    values: Callable[[Simulation], Mapping[str, float]]
    shared: bool = True


MEASURES: dict[str, Measure] = {}
"""All declared measures, by the name of their function."""

_BUILT_IN: set[str] = set()


def measure(
    unit: str, *, group: str = "measure", when: Callable[[Case], bool] = lambda case: True, shared: bool = False
) -> Callable[[Function], Function]:
    """Declare a function of a simulation as a measure.

    unit     SI, `1` for a plain number
    group    how the report shows it: `measure` (mean with an error), `imbalance` (largest value), `recorded` (not)
    when     of a case: whether the history has this column
    shared   the function gives the same number on several ranks: it reads `simulation.owned` and sums by
             `simulation.communicator`, or reads `simulation.whole(...)`. Others are refused there
    returns  decorator
    errors   InputError if a built-in measure has the name of the function

    >>> @measure("m")                                                 # doctest: +SKIP
    ... def highest_particle(simulation):
    ...     return float(simulation.particles.position[:, 2].max())
    """

    if callable(unit):
        raise InputError(
            "measure", getattr(unit, "__name__", ""), "declared with its unit", '@measure("m/s"), or @measure("1")'
        )

    def declare(function: Function) -> Function:
        name = function.__name__
        quantity = of_function(function, unit, group)

        def columns(case: Case) -> Mapping[str, Quantity]:
            return {name: quantity} if when(case) else {}

        def values(simulation: Simulation) -> Mapping[str, float]:
            value = function(simulation)
            try:
                if isinstance(value, str | bytes) or np.ndim(value):  # of a ragged list NumPy knows none
                    raise ValueError
                return {name: float(value)}
            except (TypeError, ValueError):
                lists = isinstance(value, list | tuple | np.ndarray)
                remedy = "take its mean, or one element" if lists else "return a float; NaN where there is no value"
                brief = np.shape(value) if isinstance(value, np.ndarray) else shown(value)
                raise InputError(f"measure {name}", brief, "one number", remedy) from None

        _declare(name, Measure(columns, values, shared))
        return function

    return declare


def forget(name: str) -> None:
    """Remove a measure; runs that have begun are not affected."""
    del MEASURES[name]


def all_columns(case: Case) -> dict[str, Quantity]:
    """Unit and meaning of every column of the history of a case."""
    columns = {"time": TIME}
    for declared in MEASURES.values():
        columns |= declared.columns(case)
    return columns


def units_of(case: Case) -> dict[str, str]:
    """Unit of every column of the history of a case."""
    return {name: quantity.unit for name, quantity in all_columns(case).items()}


def require_shared(case: Case, ranks: int) -> None:
    """Refuse measures of a user that do not say that they are right on several ranks."""
    for name, declared in MEASURES.items():
        if ranks > 1 and name not in _BUILT_IN and not declared.shared and declared.columns(case):
            remedy = "declare it with @measure(unit, shared=True) if it is"
            raise InputError("measure", name, "right on several ranks", remedy)


def row(simulation: Simulation) -> dict[str, float]:
    """One row of the history: the time, and every measure of the present state."""
    values = {"time": simulation.time}
    for declared in MEASURES.values():
        if declared.columns(simulation.case):
            values |= declared.values(simulation)
    return values


def _declare(name: str, declared: Measure) -> None:
    if name in _BUILT_IN:
        raise InputError("measure", name, "a new name", "a built-in measure has this name")
    MEASURES[name] = declared


# ---------------------------------------------------------------- kinds of cases


def _has_fluid(case: Case) -> bool:
    return case.has_fluid


def _is_bed(case: Case) -> bool:
    return case.particle_count > 1


def _is_fluid_bed(case: Case) -> bool:
    return _has_fluid(case) and _is_bed(case)


def _is_agitated(case: Case) -> bool:
    return _has_fluid(case) and case.agitation != "none"


def _has_moving_films(case: Case) -> bool:
    return case.has_films and not case.stands_still


def _is_mixture(case: Case) -> bool:
    return bool(case.bed.species)


# ---------------------------------------------------------------- the column and the bed in it

BED = (0.2, 0.8)
"""Part of the bed height, away from floor and surface, over which the bed is measured."""


def open_area(case: Case) -> float:
    """Floor area of the open cells [m2]."""
    return float(_open_areas(case)[0])


def open_volume(case: Case, low: float, high: float) -> float:
    """Volume of the open cells between two heights [m3]."""
    areas, edges = _open_areas(case), grid_of(case).spacing[2] * np.arange(grid_of(case).open.shape[0] + 1.0)
    edges[-1] = max(edges[-1], high)  # the top of the column, up to rounding
    return float((areas * np.diff(edges.clip(low, high))).sum())  # local: of the whole grid


def _open_areas(case: Case) -> np.ndarray:
    """Cross-section of the open cells in each layer of cells (nz,) [m2]."""
    column = case.column
    open_part = open_share(grid_of(case)).mean(axis=(1, 2))  # local: every rank knows the whole grid
    return np.asarray(open_part * column.size[0] * column.size[1])


def cells_of(simulation: Simulation) -> measures.Cells:
    """The cell of every particle of all ranks."""
    grid = grid_of(simulation.case)
    return measures.cells_of(simulation.whole("position"), grid.shape, grid.spacing)


def random_motion(simulation: Simulation) -> measures.GranularTemperature:
    """Granular temperature of all particles, in the cells of the fluid."""
    return measures.granular_temperature(simulation.whole("velocity"), cells_of(simulation))


def bed_solids(simulation: Simulation) -> float:
    """Volume of the particles of the bed: all but those that a feed has inserted, before their first contact [m3]."""
    owned = simulation.owned
    counted = owned.volume * owned.landed if LANDED.name in owned else owned.volume
    return float(simulation.communicator.sum(counted))


# ---------------------------------------------------------------- measures of the bed


@measure("1", group="recorded")
def fluid_steps(simulation: Simulation) -> float:
    """Number of fluid steps so far."""
    return simulation.steps


@measure("m")
def bed_height(simulation: Simulation) -> float:
    """Height below which 99 % of the particle volume lies; fed particles count from their first contact on."""
    position, radius = simulation.whole("position"), simulation.whole("radius")
    if LANDED.name in simulation.owned:
        landed = simulation.whole(LANDED.name) > 0
        position, radius = position[landed], radius[landed]
    return measures.bed_height(position, radius)


@measure("1", when=_is_fluid_bed)
def bed_voidage(simulation: Simulation) -> float:
    """Mean voidage of the bed, from its height."""
    solids = measures.OF_THE_BED * bed_solids(simulation)
    return 1.0 - solids / open_volume(simulation.case, 0.0, bed_height(simulation))


@measure("1", when=_is_fluid_bed)
def bed_voidage_from_pressure(simulation: Simulation) -> float:
    """Mean voidage of the bed, from the pressure gradient within it."""
    particles, fluid, grid = simulation.owned, simulation.fluid, grid_of(simulation.case)
    carried = 0.0 if simulation.case.stands_still else abs(simulation.gravity[2])  # the flow need not carry it
    total, volume = simulation.communicator.sum, particles.volume
    weight = (total(particles.density * volume) / total(volume) - fluid.density) * carried
    low, high = (share * bed_height(simulation) for share in BED)
    pressure = fluid.whole("pressure")
    return measures.voidage_from_pressure(pressure, grid.spacing, float(weight), low, high, open_cells=grid.open)


@measure("Pa", when=_is_fluid_bed)
def pressure_drop(simulation: Simulation) -> float:
    """Pressure drop from below the floor to the top, without the hydrostatic part."""
    fluid, grid = simulation.fluid, grid_of(simulation.case)
    inflow, voidage = fluid.grid.joined(fluid.volume_flux(2)[:-1])[0], fluid.whole("mean_voidage")[0]
    return pressure_fall(fluid, 2) + measures.entrance_pressure_drop(inflow, voidage, fluid.density, grid.open[0])


@measure("Pa", when=_has_fluid)
def wall_load(simulation: Simulation) -> float:
    """Vertical force of the particles on floor, sides and other walls, films included, per floor area."""
    force, _ = loads_of_particles(simulation.particle_solver)
    return -math.fsum(force[:, 2]) / open_area(simulation.case)


@measure("m2/s2", when=_is_bed)
def granular_temperature(simulation: Simulation) -> float:
    """Granular temperature, a third of the mean square of the velocity fluctuations."""
    return random_motion(simulation).mean


@measure("m2/s2", when=is_liquid_bed)
def granular_temperature_along(simulation: Simulation) -> float:
    """Mean square of the velocity fluctuations along z."""
    return float(random_motion(simulation).components[2])


@measure("m2/s2", when=is_liquid_bed)
def granular_temperature_across(simulation: Simulation) -> float:
    """Mean square of the velocity fluctuations along x or y, mean of the two."""
    components = random_motion(simulation).components
    return float(0.5 * (components[0] + components[1]))


@measure("1", when=is_liquid_bed)
def layer_deviation(simulation: Simulation) -> float:
    """Standard deviation of the solid fraction of layers of 2.5 diameters within the bed."""
    case = simulation.case
    low, high = (share * bed_height(simulation) for share in BED)
    count = int((high - low) / (LAYER * case.bed.diameter))
    if count < FEWEST_LAYERS:
        return math.nan
    edges = np.linspace(low, high, count + 1)
    area = np.array([open_volume(case, a, b) / (b - a) for a, b in pairwise(edges)])
    layers = measures.layer_solid_fraction(simulation.whole("position"), simulation.whole("radius"), edges, area)
    return float(layers.std())  # local: a layer of the whole column


@measure("Pa", when=is_liquid_bed)
def collisional_pressure(simulation: Simulation) -> float:
    """Pressure of the contacts within the bed: a third of the sum of force times separation, over the volume."""
    solver, positions = simulation.particle_solver, simulation.particles.position
    edges, pairs = solver.edges, slice(0, solver.edges.between_particles)
    mine = edges.first[pairs] < simulation.particles.owned  # one rank counts a pair that two compute
    touching = np.flatnonzero((edges.force[pairs] != 0.0).any(axis=1) & mine)  # local: components of a row
    apart = positions[edges.first[touching]] - positions[edges.second[touching]]
    box = np.where(np.isfinite(solver.box), solver.box, 0.0)
    apart -= box * np.rint(apart / np.maximum(box, np.finfo(float).tiny))
    volume = open_volume(simulation.case, 0.0, bed_height(simulation))
    return float(simulation.communicator.sum(edges.force[touching] * apart)) / (3.0 * volume)


@measure("Pa", when=is_liquid_bed)
def floor_pressure(simulation: Simulation) -> float:
    """Normal contact force of the particles on the floor, per floor area; NaN without a floor."""
    if simulation.case.column.ends == "periodic":
        return math.nan
    floor = -simulation.particle_solver.wall_force[0, 2]  # the floor is the first wall
    return float(simulation.communicator.sum(np.array([floor]))) / open_area(simulation.case)


@measure("J", group="recorded")
def kinetic_energy(simulation: Simulation) -> float:
    """Kinetic energy of the particles, with rotation."""
    return kinetic_energy_of(simulation.particles, simulation.communicator)


@measure("m/s")
def largest_speed(simulation: Simulation) -> float:
    """Speed of the fastest particle."""
    return math.sqrt(simulation.communicator.largest((simulation.owned.velocity**2).sum(axis=1), default=0.0))


@measure("1")
def contact_count(simulation: Simulation) -> float:
    """Number of contacts."""
    edges, owned = simulation.particle_solver.edges, simulation.particles.owned
    return simulation.communicator.count((edges.force != 0.0).any(axis=1) & (edges.first < owned))


@measure("1", group="recorded")
def particle_count(simulation: Simulation) -> float:
    """Number of particles."""
    return simulation.communicator.sum([simulation.particles.owned])


@measure("1", group="recorded", when=_has_fluid)
def out_of_range_count(simulation: Simulation) -> float:
    """How often drag and film laws were evaluated outside of their ranges so far."""
    of_fluid = simulation.coupling.outside
    return of_fluid.get("drag", 0) + simulation.communicator.sum([simulation.particle_solver.outside])


@measure("1", group="recorded", when=_is_agitated)
def agitation_out_of_range_count(simulation: Simulation) -> float:
    """How often the law of agitation was evaluated outside of its range so far."""
    return simulation.coupling.outside["agitation"]


# ---------------------------------------------------------------- films


@measure("1", group="recorded", when=_has_moving_films)
def film_step_count(simulation: Simulation) -> float:
    """Number of particle steps so far in which films were solved together."""
    return float(simulation.particle_solver.film_counts[0])


@measure("1", group="recorded", when=_has_moving_films)
def film_iteration_count(simulation: Simulation) -> float:
    """Number of iterations of these solutions so far."""
    return float(simulation.particle_solver.film_counts[1])


@measure("1", group="recorded", when=_has_moving_films)
def film_damping_number(simulation: Simulation) -> float:
    """Largest damping number of a film, its resistance times the particle step over the reduced mass."""
    return simulation.particle_solver.largest_film_rate * simulation.time_steps.particle_step


# ---------------------------------------------------------------- mixtures


@measure("1", when=_is_mixture)
def mixing_index(simulation: Simulation) -> float:
    """Mixing index of nearest neighbours, 0 segregated, 1 randomly mixed."""
    return measures.neighbour_mixing_index(simulation.whole("species"), simulation.whole("position"))


@measure("1", when=_is_mixture)
def lacey_index(simulation: Simulation) -> float:
    """Mixing index of Lacey for the first species, in cells of the fluid grid."""
    return measures.lacey_index(simulation.whole("species") == 0, cells_of(simulation))


def _mean_height_columns(case: Case) -> dict[str, Quantity]:
    return {
        f"{MEAN_HEIGHT}{name}": Quantity("m", f"mean height of {name}, by volume", "measure")
        for name in case.bed.species
    }


def mean_heights(simulation: Simulation) -> dict[str, float]:
    """Mean height of each species of a mixture, by volume [m]."""
    particles, names, total = simulation.owned, list(simulation.case.bed.species), simulation.communicator.sum

    def by_species(weights: np.ndarray) -> np.ndarray:
        return np.array([total(weights[particles.species == number]) for number in range(len(names))])

    mean = by_species(particles.volume * particles.position[:, 2]) / by_species(particles.volume)
    return {f"{MEAN_HEIGHT}{name}": float(height) for name, height in zip(names, mean)}


_declare("mean_heights", Measure(_mean_height_columns, mean_heights))


_declare("wall_loads", Measure(wall_load_columns, wall_loads))


# ---------------------------------------------------------------- conservation


@measure("1", group="imbalance", when=_has_fluid)
def momentum_imbalance(simulation: Simulation) -> float:
    """Momentum that the fluid gave and particles did not receive, over that given."""
    fluid, particles, total = simulation.fluid, simulation.owned, simulation.communicator.sum
    # walls, inlets and outlets belong to neither of the two sums
    received = np.concatenate([particles.drag_impulse, simulation.coupling.exchanged_impulse])
    sent, got = total(drag_exchange(fluid), axis=(0, 1, 2)), total(received, axis=0)
    return max(abs(part) for part in sent + got) / max(total(np.abs(particles.drag_impulse)), 1e-300)


@measure("1", group="imbalance", when=_has_fluid)
def volume_imbalance(simulation: Simulation) -> float:
    """Volume gained by a cell against the flux through its faces, over the largest flux."""
    fluid, largest = simulation.fluid, simulation.communicator.largest
    flux = max(largest(np.abs(fluid.volume_flux(d))) * fluid.grid.face_area(d) for d in range(3))
    return largest(np.abs(continuity_residual(fluid))) / max(flux, 1e-300)


# ---------------------------------------------------------------- features


def _declare_feature(kind: type[CaseFeature]) -> None:
    """Declare the columns that a feature of a case gives."""

    def columns(case: Case) -> Mapping[str, Quantity]:
        return kind.columns(case) if kind.is_in(case) else {}

    _declare(kind.name, Measure(columns, lambda simulation: simulation.feature(kind).values(simulation)))


for _kind in FEATURES:
    _declare_feature(_kind)


_BUILT_IN.update(MEASURES)
