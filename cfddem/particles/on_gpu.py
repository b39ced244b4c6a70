"""The steps of :mod:`cfddem.particles.integrate` on a graphics processor.

One thread a particle, one thread a pair: what a thread does to its particle, pair or film are the functions that the
loops of the processor call. A thread of a particle sums the forces of its pairs in their order, so that results are the
same bits in every run. All steps until the next neighbour list are one launch, in which all threads wait for one
another between pairs and particles. Neighbour lists are made by the processor.

Arrays travel at each call: particles both ways, what pairs remember, and the graph where it is new.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.errors import InputError, RunFailed
from cfddem.backend.gpu import (
    BLOCK,
    MOST_BLOCKS,
    DeviceArrays,
    Threads,
    cuda,
    for_gpu,
    gpu_error,
    greatest_of_all,
    helper,
    kernel,
    launch,
    name_of_gpu,
    sum_of_all,
)
from cfddem.backend.named import named_arrays
from cfddem.particles.integrate import drift, gather_forces, kick, may_touch, wall_contact
from cfddem.particles.interactions import joint_films
from cfddem.particles.interactions.film import update_edge_film
from cfddem.particles.interactions.joint_equations import change_by, film_residual, greater, prepare_film
from cfddem.particles.interactions.joint_films import enter, is_due, leave, list_all_due, mark_due
from cfddem.particles.interactions.joint_solution import (
    MOST_ITERATIONS,
    PASSES,
    best_factor,
    film_direction,
    film_follows,
    film_product,
    keep_film,
    particle_follows,
    scale_film,
    scale_of,
    scale_particle,
    settled,
    take_impulses,
    whole_units,
)
from cfddem.particles.interactions.pair_loops import WRITTEN, pair_film, pair_force, pair_touches
from cfddem.particles.interactions.slots import FILM, JOINT, SLIDES
from cfddem.particles.pair_graph import Graph
from cfddem.particles.system import System
from cfddem.particles.walls.mesh_contacts import pairs_at_walls
from cfddem.particles.walls.nearest_point import advance_walls, touch_edge

STEPS = 4096
"""The most steps of one launch."""

READ = ("position", "velocity", "spin", "radius", "inverse_mass", "inverse_inertia", "material", "viscosity", "applied",
        "force", "torque")  # fmt: skip
"""Fields of the particles that the steps read."""

FOUND = ("position", "velocity", "spin", "force", "torque")
"""Fields of the particles that the steps write."""

WALLS = ("kind", "shape", "corner", "material", "wall", "velocity", "spin", "centre", "shift", "turned", "sweep",
         "travel")  # fmt: skip
"""Arrays of the walls that the steps read."""

MOVED = ("shift", "turned", "travel")
"""Those that they write."""


GRAPH = ("first", "second", "image", "touch", "start", "incident")
"""Arrays of the graph."""

SOLVED = {field.name for field in (*joint_films.JOINT_FIELDS, *joint_films.SLIDING_FIELDS)}
"""Fields of the pairs that a step with films writes before it reads them, and that nobody reads after it."""

SUMS = tuple(field.name for field in (*joint_films.WEAK_PARTICLE_FIELDS, *joint_films.PARTICLE_FIELDS))
"""The same of the particles."""


class _Parameters(NamedTuple):
    gravity: tuple[float, float, float]
    free: Any
    cutoff_ratio: float
    film_tolerance: float
    rolling_damping: float
    contact: Any


class _System(NamedTuple):
    """What `System` and `PairSystem` are on the processor."""

    particles: Any
    edges: Graph
    memory: Any
    walls: Any
    shift: Any
    rows: Any
    table: Any
    kinds: int
    parameters: _Parameters
    film_counts: Any


class _Shared(NamedTuple):
    """What all threads of a launch write."""

    tops: Any  # memory in which all blocks reduce numbers
    wholes: Any  # the same for integers
    moved_far: Any  # 1 at a step in which a particle or wall has moved by the reach
    done: Any  # number of steps made


@kernel
def _steps(system, at_walls, step, steps, origin, reach, shared):
    """Find the forces at the present positions (`steps` = 0), or make steps until a particle has moved by `reach`."""
    grid = cuda.cg.this_grid()
    mine, number = cuda.grid(1), cuda.gridsize(1)
    threads = Threads(
        grid, mine, number, cuda.threadIdx.x, cuda.blockDim.x, cuda.blockIdx.x, cuda.gridDim.x,
        cuda.shared.array(BLOCK, np.float64), cuda.shared.array(BLOCK, np.int64),
        shared.tops, shared.wholes,
    )  # fmt: skip
    particles, edges = system.particles, system.edges
    count, pairs, spheres = len(particles.radius), may_touch(edges), edges.between_particles
    half = step if steps > 0 else 0.0
    if JOINT and steps > 0:
        for k in range(mine, len(edges.first), number):
            mark_due(k, system, step)
        grid.sync()
        for i in range(mine, count, number):
            list_all_due(i, system)
    for n in range(max(steps, 1)):
        if JOINT and steps > 0:
            for i in range(mine, count, number):
                kick(i, particles, step, False)
            grid.sync()
            solve_films(system, step, threads)
        if steps > 0:
            for i in range(mine, count, number):
                if not JOINT:
                    kick(i, particles, step, False)
                if not drift(i, particles, system.parameters.free, step, origin) < reach * reach:
                    shared.moved_far[n] = 1
            if mine == 0 and not advance_walls(system.walls, step) < reach:
                shared.moved_far[n] = 1
        grid.sync()
        for k in range(mine, spheres if FILM else pairs, number):
            if FILM:
                pair_film(k, system, half)
            if k < pairs:
                pair_touches(k, system)
                if system.memory.touching[k] != 0:
                    pair_force(k, system, half)
        for k in range(spheres + mine, len(edges.first), number):
            touch_edge(k, at_walls)
            if FILM:
                update_edge_film(k, system, half)
            wall_contact(np.uint64(k), system, half)
        grid.sync()
        for i in range(mine, count, number):
            gather_forces(i, system, pairs)
            if steps > 0:
                kick(i, particles, step, True)
        if mine == 0:
            shared.done[0] = n + 1
        if shared.moved_far[n] != 0:
            break


LEFT_OUT = {
    "BRIDGE": "liquid bridges",
    "TRIANGLES": "walls of triangles",
    "RECORD": "a record of collisions",
}
"""What the steps on a GPU do not have yet, by the slot of the loops that tells."""


class StepsOnGpu:
    """The loop of :func:`cfddem.particles.integrate.integrate` on a GPU.

    choices   what the run puts into the slots of the loops
    energies  whether energies are counted, which only the processor does
    ranks     processes that share the particles
    """

    listing_cost = 500.0
    """Cost of a new list, which the processor makes, in the units of :data:`cfddem.particles.listing.LISTING_COST`."""

    def __init__(self, choices: Mapping[str, Any], energies: bool, ranks: int) -> None:
        refused = [words for slot, words in LEFT_OUT.items() if choices[slot]]
        refused += ["films as explicit forces"] * (choices["FILM"] and not choices["DRIFTING"])
        refused += ["an energy account"] * energies + [f"{ranks} ranks"] * (ranks > 1)
        if refused:
            remedy = "leave them out, or take gpu = false"
            raise InputError("gpu", " and ".join(refused), "a run of contacts, and films that act by impulses", remedy)
        name_of_gpu()  # refuses where there is none
        self._steps, self._arrays = for_gpu(_steps, choices), DeviceArrays()
        self._moved_far, self._done = np.zeros(STEPS, np.uint8), np.zeros(1, np.int64)
        self._tops, self._wholes = np.zeros(PLACES * MOST_BLOCKS), np.zeros(PLACES * MOST_BLOCKS, np.int64)
        self._listed: Any = None
        self._interrupted = False

    def __call__(
        self, system: System, step: float, steps: int, origin: np.ndarray, reach: float, time: float, log: np.ndarray
    ) -> tuple[int, float, int]:
        """Arguments and results of `integrate`; at most `STEPS` steps."""
        if self._interrupted:
            raise RunFailed("an advance on the GPU was interrupted, and its results were not received; begin anew")
        self._interrupted, steps = True, min(steps, STEPS)
        try:
            self._advance(system, step, steps, origin, reach)
        except Exception as failure:  # of the driver, of the compiler, or no memory is left
            raise gpu_error(failure) from failure
        self._interrupted = False
        far = 1 in self._moved_far[: max(steps, 1)]
        return min(int(self._done[0]), steps), math.inf if far else 0.0, 0

    def _advance(self, system: System, step: float, steps: int, origin: np.ndarray, reach: float) -> None:
        """Make steps: send, launch and receive."""
        sent, receive = self._arrays.sent, self._arrays.receive
        on_gpu = self._sent(system)
        at_walls = pairs_at_walls.py_func(on_gpu)
        at_walls = at_walls._replace(free=sent("free", at_walls.free))
        self._moved_far[:] = 0
        room = self._arrays.room
        shared = _Shared(
            room("tops", self._tops), room("wholes", self._wholes),
            sent("moved_far", self._moved_far), sent("done", self._done),
        )  # fmt: skip
        rows = max(system.particles.owned, len(system.edges.first))
        launch(self._steps, rows, on_gpu, at_walls, step, steps, sent("origin", origin), reach, shared)
        kept = tuple(name for name in system.memory._fields if name not in SOLVED)
        written = {"particles": FOUND, "edges": ("touch",), "memory": kept, "walls": MOVED}
        for part, names in written.items():
            for name in names:
                receive(f"{part}.{name}", getattr(getattr(system, part), name))
        receive("film_counts", system.film_counts)
        receive("moved_far", self._moved_far)
        receive("done", self._done)

    def _sent(self, system: System) -> _System:
        """The system on the GPU."""
        new = system.edges.first is not self._listed
        self._listed = system.edges.first
        sent, room = self._arrays.sent, self._arrays.room
        parameters, table = system.parameters, np.asarray(system.table)

        def part(of: str, names: tuple[str, ...], changed: bool = True) -> list[Any]:
            return [sent(f"{of}.{name}", getattr(getattr(system, of), name), changed) for name in names]

        sums = tuple(name for name in SUMS if name in system.particles._fields)
        scratch = [room(f"particles.{name}", getattr(system.particles, name)) for name in sums]
        return _System(
            particles=named_arrays("Particles", (*READ, *sums, "owned"))(
                *part("particles", READ), *scratch, system.particles.owned
            ),
            edges=system.edges._replace(**dict(zip(GRAPH, part("edges", GRAPH, new)))),
            memory=type(system.memory)(
                *(
                    room(f"memory.{name}", array)
                    if name in SOLVED
                    else sent(f"memory.{name}", array, new or name not in WRITTEN)
                    for name, array in system.memory._asdict().items()
                )
            ),
            walls=named_arrays("Walls", WALLS)(*part("walls", WALLS)),
            shift=sent("shift", system.shift),
            rows=sent("rows", table.reshape(-1)),
            table=sent("table", table),
            kinds=len(table),
            parameters=_Parameters(*(getattr(parameters, name) for name in _Parameters._fields)),
            film_counts=sent("film_counts", system.film_counts),
        )


# ---------------------------------------------------------------- films that are solved together
#
# The phases of `joint_solution.film_kick`, by its functions of one film and of one particle: one thread a film, one
# thread a particle, and all wait for one another where a phase reads what others have written. Here each edge has its
# own row of the equations, also where its film is not solved with the others. The order of the rows does not matter:
# sums over all films are sums of integers.


LEFT, WHOLE, BY_WANTED, BY_RESIDUAL, PRODUCT, FOLLOWED, OUTDATED, COUNT = range(8)
"""Place of each sum in the memory of all blocks."""

PLACES = 8
"""Number of these."""


@helper
def solve_films(system, step, threads):
    """Give the particles the impulses of all films over the coming step."""
    edges, memory, particles, grid = system.edges, system.memory, system.particles, threads.grid
    mine, number, rows, bodies = threads.mine, threads.number, len(edges.first), len(particles.radius)
    listed = 0
    for e in range(mine, rows, number):
        if is_due(e, memory):
            enter(e, e, system)
            prepare_film(e, system, step)
            listed += 1
        else:
            leave(e, system)
    count = sum_of_all(listed, COUNT, threads)
    if count == 0:
        return
    _spread(False, system, threads)
    iterations, passes, tolerance = 0, 0, system.parameters.film_tolerance
    while passes < PASSES:
        grid.sync()
        left, whole, by_wanted, by_residual = _residual(True, count, system, step, threads)
        if by_wanted + by_residual < 0.0:  # these impulses could add energy; a part of them takes the most
            factor = best_factor(by_wanted, by_residual)
            for e in range(mine, rows, number):
                if is_due(e, memory):
                    scale_film(e, system, factor)
            for i in range(mine, bodies, number):
                scale_particle(i, particles, factor)
            grid.sync()
            left, whole, by_wanted, by_residual = _residual(False, count, system, step, threads)
        limit = tolerance * tolerance * whole
        if settled(left, whole, limit, passes):
            break
        passes += 1
        share, outdated = 0.0, 0.0
        for _ in range(MOST_ITERATIONS):
            if share > 0.0:
                for e in range(mine, rows, number):
                    if is_due(e, memory):
                        film_direction(e, system, share)
                grid.sync()
            _spread(True, system, threads)
            grid.sync()
            length = left / _product(count, system, threads)
            before = left
            left, outdated = _follow(length, count, system, step, threads)
            iterations += 1
            share = left / before
            if not left > limit:
                break
        if not _total(1, outdated, OUTDATED, count, system, threads) > limit:
            break
    for e in range(mine, rows, number):
        if is_due(e, memory):
            keep_film(e, system)
    for i in range(mine, bodies, number):
        take_impulses(i, particles)
    if mine == 0:
        system.film_counts[0] += 1.0
        system.film_counts[1] += iterations
        system.film_counts[2] += passes
        system.film_counts[3] += count


@helper
def _spread(direction, system, threads):
    """See `spread`."""
    particles, memory = system.particles, system.memory
    impulse = memory.joint_direction if direction else memory.joint_impulse
    change = particles.film_along if direction else particles.film_change
    shear_impulse, turn = impulse, change
    if SLIDES:
        shear_impulse = memory.joint_shear_direction if direction else memory.joint_shear_impulse
        turn = particles.film_turn_along if direction else particles.film_turn
    for i in range(threads.mine, len(particles.radius), threads.number):
        change_by(i, impulse, shear_impulse, change, turn, system)


@helper
def _residual(renew, count, system, step, threads):
    """Resistances, if they are to be found anew, residuals, and four sums; see `find_residual`."""
    left, whole, by_wanted, by_residual = 0.0, 0.0, 0.0, 0.0
    for e in range(threads.mine, len(system.edges.first), threads.number):
        if is_due(e, system.memory):
            sums = film_residual(e, system, step, renew)
            left, whole = greater(left, sums[0]), greater(whole, sums[1])
            by_wanted, by_residual = greater(by_wanted, sums[2]), greater(by_residual, sums[3])
    return (
        _total(0, left, LEFT, count, system, threads),
        _total(1, whole, WHOLE, count, system, threads),
        _total(2, by_wanted, BY_WANTED, count, system, threads),
        _total(3, by_residual, BY_RESIDUAL, count, system, threads),
    )


@helper
def _product(count, system, threads):
    """Product of the direction with the matrix and itself."""
    top = 0.0
    for e in range(threads.mine, len(system.edges.first), threads.number):
        if is_due(e, system.memory):
            top = greater(top, film_product(e, system))
    return _total(0, top, PRODUCT, count, system, threads)


@helper
def _follow(length, count, system, step, threads):
    """See `follow_direction`; returns the sum of squares of the residual, and this thread's largest outdated term."""
    left, outdated = 0.0, 0.0
    for e in range(threads.mine, len(system.edges.first), threads.number):
        if is_due(e, system.memory):
            sums = film_follows(e, system, length, step)
            left, outdated = greater(left, sums[0]), greater(outdated, sums[1])
    for i in range(threads.mine, len(system.particles.radius), threads.number):
        particle_follows(i, system.particles, length)
    return _total(0, left, FOLLOWED, count, system, threads), outdated


@helper
def _total(column, top, place, count, system, threads):
    """Sum of one of the four terms of all films; see `total_of`.

    top    largest absolute value of the terms of this thread
    place  of the sum in the memory of all blocks
    """
    largest = greatest_of_all(top, place, threads)
    if not 0.0 < largest < math.inf:
        return largest
    power, whole = scale_of(largest, count), 0
    rows, scale = len(system.edges.first), math.ldexp(1.0, power)
    for e in range(threads.mine, rows, threads.number):
        if is_due(e, system.memory):
            whole += whole_units(scale * system.memory.joint_terms[column * rows + e])
    return math.ldexp(float(sum_of_all(whole, place, threads)), -power)
