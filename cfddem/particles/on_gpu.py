"""The steps of :mod:`cfddem.particles.integrate` on a graphics processor.

One thread a particle, one thread a pair: what a thread does to its particle or pair are the functions that the loops
of the processor call. A thread of a particle sums the forces of its pairs in their order, so that results are the same
bits in every run. All steps until the next neighbour list are one launch, in which all threads wait for one another
between pairs and particles. Neighbour lists are made by the processor.

Arrays travel at each call: particles both ways, what pairs remember, and the graph where it is new.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.errors import InputError, RunFailed
from cfddem.backend.gpu import DeviceArrays, cuda, for_gpu, gpu_error, kernel, launch, name_of_gpu
from cfddem.backend.named import named_arrays
from cfddem.particles.integrate import drift, gather_forces, kick, may_touch, wall_contact
from cfddem.particles.interactions.pair_loops import WRITTEN, pair_force, pair_touches
from cfddem.particles.pair_graph import Graph
from cfddem.particles.system import System
from cfddem.particles.walls.mesh_contacts import pairs_at_walls
from cfddem.particles.walls.nearest_point import advance_walls, touch_edge

STEPS = 4096
"""The most steps of one launch."""

READ = ("position", "velocity", "spin", "radius", "inverse_mass", "inverse_inertia", "material", "applied", "force",
        "torque")  # fmt: skip
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


class _Parameters(NamedTuple):
    gravity: tuple[float, float, float]
    free: Any
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


@kernel
def _steps(system, at_walls, step, steps, origin, reach, moved_far, done):
    """Find the forces at the present positions (`steps` = 0), or make steps until a particle has moved by `reach`."""
    grid = cuda.cg.this_grid()
    mine, threads = cuda.grid(1), cuda.gridsize(1)
    particles, edges = system.particles, system.edges
    count, pairs = len(particles.radius), may_touch(edges)
    half = step if steps > 0 else 0.0
    for n in range(max(steps, 1)):
        if steps > 0:
            for i in range(mine, count, threads):
                kick(i, particles, step, False)
                if not drift(i, particles, system.parameters.free, step, origin) < reach * reach:
                    moved_far[n] = 1
            if mine == 0 and not advance_walls(system.walls, step) < reach:
                moved_far[n] = 1
        grid.sync()
        for k in range(mine, pairs, threads):
            pair_touches(k, system)
            if system.memory.touching[k] != 0:
                pair_force(k, system, half)
        for k in range(edges.between_particles + mine, len(edges.first), threads):
            touch_edge(k, at_walls)
            wall_contact(np.uint64(k), system, half)
        grid.sync()
        for i in range(mine, count, threads):
            gather_forces(i, system, pairs)
            if steps > 0:
                kick(i, particles, step, True)
        if mine == 0:
            done[0] = n + 1
        if moved_far[n] != 0:
            break


LEFT_OUT = {
    "FILM": "films",
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
        refused += ["an energy account"] * energies + [f"{ranks} ranks"] * (ranks > 1)
        if refused:
            remedy = "leave them out, or take gpu = false"
            raise InputError("gpu", " and ".join(refused), "a run of dry contacts", remedy)
        name_of_gpu()  # refuses where there is none
        self._steps, self._arrays = for_gpu(_steps, choices), DeviceArrays()
        self._moved_far, self._done = np.zeros(STEPS, np.uint8), np.zeros(1, np.int64)
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
        launch(
            self._steps, max(system.particles.owned, len(system.edges.first)), on_gpu, at_walls, step, steps,
            sent("origin", origin), reach, sent("moved_far", self._moved_far), sent("done", self._done),
        )  # fmt: skip
        written = {"particles": FOUND, "edges": ("touch",), "memory": system.memory._fields, "walls": MOVED}
        for part, names in written.items():
            for name in names:
                receive(f"{part}.{name}", getattr(getattr(system, part), name))
        receive("moved_far", self._moved_far)
        receive("done", self._done)

    def _sent(self, system: System) -> _System:
        """The system on the GPU."""
        new = system.edges.first is not self._listed
        self._listed = system.edges.first
        sent, parameters, table = self._arrays.sent, system.parameters, np.asarray(system.table)

        def part(of: str, names: tuple[str, ...], changed: bool = True) -> list[Any]:
            return [sent(f"{of}.{name}", getattr(getattr(system, of), name), changed) for name in names]

        return _System(
            particles=named_arrays("Particles", READ)(*part("particles", READ)),
            edges=system.edges._replace(**dict(zip(GRAPH, part("edges", GRAPH, new)))),
            memory=type(system.memory)(
                *(
                    (self._arrays.room if name in WRITTEN else sent)(f"memory.{name}", array)
                    for name, array in system.memory._asdict().items()
                )
            ),
            walls=named_arrays("Walls", WALLS)(*part("walls", WALLS)),
            shift=sent("shift", system.shift),
            rows=sent("rows", table.reshape(-1)),
            table=sent("table", table),
            kinds=len(table),
            parameters=_Parameters(parameters.gravity, parameters.free, parameters.rolling_damping, parameters.contact),
        )
