"""All that compiled loops over particles and pairs take, as one structure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.named import named_arrays
from cfddem.backend.struct import struct
from cfddem.particles.pair_graph import Graph
from cfddem.particles.walls.nearest_point import Walls


class Parameters(NamedTuple):
    """Numbers that do not change in a run, each with a name."""

    gravity: tuple[float, float, float]  # [m/s2]
    free: tuple[float, float, float]  # 1 for each axis along which particles can move, else 0
    cutoff_ratio: float  # reach of films over R*; 0 without films [-]
    film_tolerance: float  # of the impulses of films that are solved together [-]
    rolling_damping: float  # of the rolling dashpot, over critical [-]
    contact: Any  # of the contact law, by the names that it has declared
    bridge: Any  # `BridgeNumbers` of the laws of liquid bridges; nothing without them
    bond: Any  # `BondNumbers` of the bonds that dried bridges leave; nothing without them
    bridge_functions: Any  # of a user's functions of bridges, by their names


def numbers(values: Mapping[str, float]) -> Any:
    """Numbers as loops take them: read by their names."""
    return named_arrays("Numbers", tuple(values))(*map(float, values.values()))


@struct
class System(NamedTuple):
    """Particles, pairs and walls of a run, and the parameters of its laws."""

    particles: Any  # arrays of the particles, `Particles.view_with`
    edges: Graph  # which bodies each pair joins
    memory: Any  # what each pair remembers, `Edges.memory`
    walls: Walls
    shift: np.ndarray  # of the separation for each image of a periodic box [m]
    table: np.ndarray  # of pairs of materials
    parameters: Parameters
    film_counts: np.ndarray  # steps in which films were solved together, iterations, passes and films of these
    packed: Any = ()  # room for pairs whose contacts are renewed, `PackedFields.room`


class PairSystem(NamedTuple):
    """The part of a `System` that a loop over pairs of particles takes: each array is an argument of that loop."""

    particles: Any
    edges: Any
    memory: Any
    shift: np.ndarray
    rows: np.ndarray  # of the pair table, one after the other
    kinds: np.uint64  # number of materials
    parameters: Parameters


class _Spheres(NamedTuple):
    position: np.ndarray
    radius: np.ndarray
    inverse_mass: np.ndarray
    owned: int


class _Joined(NamedTuple):
    first: np.ndarray
    second: np.ndarray
    image: np.ndarray
    between_particles: int
    touch: np.ndarray


class _Bridges(NamedTuple):
    bridge_film: np.ndarray
    bridge_volume: np.ndarray
    bridge_gap: np.ndarray
    closed_along: np.ndarray
    closed_across: np.ndarray


@struct
class BridgeSystem(NamedTuple):
    """The part of a `System` that loops over bridges take once in a fluid step, when handing all of it over would take
    longer than the loop."""

    particles: _Spheres
    edges: _Joined
    memory: _Bridges
    shift: np.ndarray

    @classmethod
    def of(cls, system: System) -> BridgeSystem:
        """That part of a system."""
        kinds: tuple[Any, ...] = (_Spheres, _Joined, _Bridges)
        return cls(  # type: ignore[call-arg]
            *(kind(*(getattr(part, name) for name in kind._fields)) for kind, part in zip(kinds, system)),
            system.shift,
        )
