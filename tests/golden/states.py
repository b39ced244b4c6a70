"""How the states of golden runs are read."""

from __future__ import annotations

import numpy as np

from cfddem.fluid.solver import FluidSolver
from cfddem.particles.solver import ParticleSolver
from cfddem.run.simulation import Simulation
from golden.registry import State

FORGOTTEN = 1e-6
"""Springs below this part of the largest are left out: whether they are there may depend on rounding."""

PARTICLES = ("position", "velocity", "spin", "force", "torque")


def particle_state(run: ParticleSolver) -> State:
    """Particles in the order of their ids, in the first image of a periodic box; and what pairs remember."""
    made, order = run.particles, np.argsort(run.particles.id)
    state = {name: getattr(made, name)[order] for name in PARTICLES}
    state["id"] = made.id[order]
    state["time"] = np.array([run.time])
    for axis in np.flatnonzero(np.isfinite(run.box)):
        state["position"][:, axis] %= run.box[axis]
    if run.walls.wall.size:
        state["wall_force"] = run.wall_force
    if run.laws.film:
        state["film_resistance"] = _resistances(run, order)
        state["film_minimum_gap"] = _thickest(run, order)
    return state | _pairs(run)


def _resistances(run: ParticleSolver, order: np.ndarray) -> np.ndarray:
    """Sum of the resistances of the films that each particle has, in order [kg/s]."""
    edges, total = run.edges, np.zeros(run.particles.count)
    pairs = slice(edges.between_particles)
    np.add.at(total, edges.first, edges.resistance)
    np.add.at(total, edges.second[pairs], edges.resistance[pairs])
    return total[order]


def _thickest(run: ParticleSolver, order: np.ndarray) -> np.ndarray:
    """Largest minimum gap of the films that each particle has, in order [m]."""
    edges, between, most = run.edges, run.edges.between_particles, np.zeros(run.particles.count)
    values = np.where(edges.resistance > 0.0, edges.minimum_gap, 0.0)
    np.maximum.at(most, edges.first, values)
    np.maximum.at(most, edges.second[:between], values[:between])
    return most[order]


def _pairs(run: ParticleSolver) -> State:
    """Springs and rolling springs of pairs by their ids; -1 - n for piece n of the walls."""
    edges, ids, between = run.edges, run.particles.id, run.edges.between_particles
    first = ids[edges.first]
    second = np.append(ids[edges.second[:between]], -1 - edges.second[between:].astype(np.int64))
    swapped = (second >= 0) & (first > second)
    names = np.stack([np.where(swapped, second, first), np.where(swapped, first, second)], axis=1)
    sign, state = np.where(swapped, -1.0, 1.0)[:, None], {}
    for name in ("spring", "roll"):
        values = edges[name] if name in edges else np.zeros((0, 3))
        if len(values) == len(names):
            size = np.linalg.norm(values, axis=1)
            there = np.flatnonzero(size > FORGOTTEN * size.max(initial=0.0))
            there = there[np.lexsort(names[there].T[::-1])]
            state[f"{name}_pair"], state[name] = names[there], (sign * values)[there]
    return state


def fluid_state(simulation: Simulation) -> State:
    """Velocity, pressure and voidage of the cells."""
    return field_state(simulation.fluid)


def field_state(fluid: FluidSolver) -> State:
    """Velocity, pressure and voidage of a fluid solver."""
    return {
        "fluid_velocity": np.array(fluid.velocity),
        "pressure": np.array(fluid.pressure),
        "voidage": np.array(fluid.voidage),
    }


def state_of(simulation: Simulation) -> State:
    """Particles and fluid, and the fluid's force on each particle."""
    made = simulation.particles
    state = particle_state(simulation.particle_solver) | {"applied": made.applied[np.argsort(made.id)]}
    return state if not simulation.has_fluid else state | fluid_state(simulation)


def counted(run: ParticleSolver) -> State:
    """Energy by channel, and what is stored."""
    assert run.energies is not None
    return {"energies": np.array(run.energies.totals), "mechanical": np.array([run.energies.mechanical(run)])}


def collisions(run: ParticleSolver) -> State:
    """The record of collisions, a column a field, in the order of their ends and ids."""
    assert run.collisions is not None
    table = run.collisions.table
    table = table[np.lexsort((table["second"], table["first"], table["end"]))]
    return {f"collision_{name}": table[name].copy() for name in table.dtype.names or ()}


def liquid(run: ParticleSolver) -> State:
    """Liquid in films and in bridges."""
    bridges = run.bridges
    assert bridges is not None
    order, bodies = np.argsort(run.particles.id), bridges.bodies
    sorted_bridges = np.lexsort(bodies.T[::-1])
    return {
        "film_thickness": bridges.thickness[order],
        "bridge_pair": bodies[sorted_bridges],
        "bridge_volume": bridges.volume[sorted_bridges],
        "bridge_counts": np.array([bridges.formed, bridges.broken]),
    }


def different(one: State, other: State) -> State:
    """Largest difference of two states that must be the same bits."""
    assert one.keys() == other.keys()
    most = max(float(np.abs(one[name].astype(float) - other[name]).max(initial=0.0)) for name in one)
    return {"difference": np.array([most])}
