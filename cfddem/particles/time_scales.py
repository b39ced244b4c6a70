"""Time scales of the particles: how large a step their physics allows, and which criterion limits it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.compile import inline, serial
from cfddem.backend.law_choice import called_by_name
from cfddem.backend.law_set import specialise
from cfddem.backend.named import named_arrays
from cfddem.particles.interactions.bond import asperity_volume, stiffness_for_step
from cfddem.particles.interactions.bridge import bridge_state
from cfddem.particles.interactions.bridge_solution import held_gap
from cfddem.particles.interactions.kinematics import pair_mass_and_radius
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.interactions.slots import (
    BOND,
    BRIDGE,
    BRIDGE_PULL,
    DRYING,
    FILM,
    BridgeState,
    ContactState,
    bridge_pull,
    derive,
    read_memory,
    tangent_stiffness,
)
from cfddem.particles.pair_graph import Edges
from cfddem.particles.state import Particles
from cfddem.particles.step_criteria import STABLE, TimeScales, check_step, crossing_step
from cfddem.particles.system import System
from cfddem.particles.walls.nearest_point import Walls
from closures import lubrication, timescales
from closures.kinds import FILM_ARGUMENTS

__all__ = ["TimeScales", "check_step", "refusing", "time_scales"]


def time_scales(
    particles: Particles,
    edges: Edges,
    walls: Walls,
    gap: np.ndarray,
    table: np.ndarray,
    laws: Laws,
    reference_speed: float,
    communicator: Communicator = SERIAL,
) -> TimeScales:
    """Time scales of the particles of all ranks in their present state.

    gap              (n,) of every edge [m]
    reference_speed  expected fastest approach; the fastest particle counts, too [m/s]
    """
    fastest = communicator.largest(np.einsum("nd,nd->n", particles.velocity, particles.velocity), default=0.0)
    speed = max(reference_speed, math.sqrt(fastest))
    viscosity = communicator.largest(particles.viscosity, default=0.0)
    hertz, impact, film = math.inf, math.inf, math.inf
    for mass, radius, row in _lightest_pairs(particles, table):
        steps = laws.contact_law.impact_steps(mass, radius, row, speed)
        hertz, impact = min(hertz, steps[0]), min(impact, steps[1])
        if laws.film and laws.integrator == "verlet":
            strongest = _film_strength(laws, viscosity, radius, float(row["roughness_gap"]))
            film = min(film, 2.0 * timescales.film_time(mass, strongest, float(row["roughness_gap"])))
    largest_rate = specialise(_largest_rate, laws.choices())
    remembered = ("minimum_gap", *laws.bridges.pulling, *(field.name for field in laws.contact_law.memory))
    memory = named_arrays("Memory", remembered)(*(edges[name] for name in remembered))
    nowhere = np.zeros(0)  # gaps are known
    system = System(particles.view, edges.flat_graph, memory, walls, nowhere, table, laws.parameters(), np.zeros(4))
    rate = largest_rate(system, gap)
    overlap = STABLE / math.sqrt(max(rate, 1e-300))
    crossing = crossing_step(communicator.smallest(particles.radius), speed)
    return TimeScales(*communicator.smallest(np.array([[hertz, impact, overlap, film, crossing]]), axis=0).tolist())


def refusing(scales: TimeScales, films: bool) -> TimeScales:
    """Time scales by which a step is refused; with films only those of contacts, as films may stop an approach."""
    return replace(scales, impact=math.inf, film=math.inf, crossing=math.inf) if films else scales


def _film_strength(laws: Laws, viscosity: float, reduced_radius: float, gap: float) -> float:
    """Resistance of a film at the gap of asperities, times that gap [N s]."""
    if laws.film_law is None:
        return lubrication.film_strength(viscosity, reduced_radius)
    numbers = (gap, viscosity, reduced_radius, gap, laws.cutoff_ratio * reduced_radius)
    return gap * called_by_name(laws.film_law.resistance, FILM_ARGUMENTS, numbers)


def _lightest_pairs(particles: Particles, table: np.ndarray) -> list[tuple[float, float, np.ndarray]]:
    """Reduced mass, reduced radius and table row of the smallest pair of each two materials."""
    pairs = []
    for kind in np.unique(particles.material):
        own = np.flatnonzero(particles.material == kind)
        smallest = own[np.argmin(particles.radius[own])]  # local: of this rank
        for row in table[kind]:
            pairs.append((0.5 * float(particles.mass[smallest]), 0.5 * float(particles.radius[smallest]), row))
    return pairs


@inline
def _almost_dry(state, gap):
    """The same bridge at a gap, with the least liquid of a bridge."""
    volume = asperity_volume(state.reduced_radius, held_gap(state))
    return BridgeState(
        gap, state.film, volume, state.reduced_radius, state.minimum_gap,
        state.viscosity, state.surface_tension, state.contact_angle, state.capillary_number, state.functions,
    )  # fmt: skip


@inline
def _bridge_stiffness(k, gap, system):
    """Slope of the pull of the bridge of edge k over its gap, to one side [N/m]."""
    memory, p = system.memory, system.parameters
    radius, _ = pair_mass_and_radius(k, system)
    change = 1e-3 * memory.bridge_film[k]
    far = max(gap, change)
    near_state, far_state = bridge_state(k, far - change, radius, memory, p), bridge_state(k, far, radius, memory, p)
    slope = abs(bridge_pull(near_state) - bridge_pull(far_state)) / change
    if DRYING:  # the pull of a bridge that is almost dry ends within the asperities
        floor = held_gap(near_state)
        pulls = bridge_pull(_almost_dry(near_state, 0.0)) - bridge_pull(_almost_dry(near_state, 0.1 * floor))
        slope = max(slope, abs(pulls) / (0.1 * floor))
    return slope


@serial
def _largest_rate(system, gap):
    """Bound of the squared angular frequency: twice the stiffness of contacts and pulls on a particle over its mass."""
    particles, edges, memory, walls, table, p = (
        system.particles,
        system.edges,
        system.memory,
        system.walls,
        system.table,
        system.parameters,
    )
    stiffness = np.zeros(len(particles.radius))
    for k in range(len(gap)):
        if BRIDGE and BRIDGE_PULL and memory.bridge_film[k] > 0.0:
            stiff = _bridge_stiffness(k, gap[k], system)
            stiffness[edges.first[k]] += stiff
            if k < edges.between_particles:
                stiffness[edges.second[k]] += stiff
        if BOND and k < edges.between_particles:
            stiff = stiffness_for_step(k, system)
            stiffness[edges.first[k]] += stiff
            stiffness[edges.second[k]] += stiff
        separated = memory.minimum_gap[k] if FILM else 0.0
        overlap = separated - gap[k]
        if overlap <= 0.0:
            continue
        i, j = edges.first[k], edges.second[k]
        pair = k < edges.between_particles
        row = table[particles.material[i], particles.material[j] if pair else walls.material[j]]
        radius, inverse_mass = pair_mass_and_radius(k, system)
        state = ContactState(overlap, gap[k], 0.0, 0.0, separated, radius, 1.0 / inverse_mass)
        m = read_memory(memory, k)
        stiff = tangent_stiffness(state, row, p, m, derive(state, row, p, m))
        stiffness[i] += stiff
        if pair:
            stiffness[j] += stiff
    largest = 0.0
    for i in range(particles.owned):
        largest = max(largest, 2.0 * stiffness[i] * particles.inverse_mass[i])
    return largest
