"""Energy of liquid bridges: what their resistance takes, what their pull stores, and what forms and breaks with them.

The pull of a bridge stores the work of separating its bodies from contact. A bridge that forms at a gap brings this
energy along, and a bridge that breaks takes it away: both have a line of their own. Half kicks in which a new or an old
pull acts alone belong to these lines, so that the account closes to the accuracy of the time integration.

A pull in a stiff film gives particles energy in each kick that the impulse of the film takes again: more than passes at
the speed at which they drift. The line of the resistance is therefore what pull and resistance together take beyond
what the pull stores. The same holds for the springs of contacts (`energy_of_contacts.BY_IMPULSES`).

Bonds form without stress. A bond that breaks takes along what its springs hold; the half kick in which they acted
last belongs to this line.
"""

from __future__ import annotations

from cfddem.backend.compile import inline, serial
from cfddem.particles.energy_of_contacts import BY_IMPULSES, EnergyAccount, half_motion, mean_motion, note_bridge_loss
from cfddem.particles.interactions.bond import bond_loads
from cfddem.particles.interactions.bridge import bridge_state
from cfddem.particles.interactions.bridge_changes import of_same_wall
from cfddem.particles.interactions.bridge_solution import pull_energy
from cfddem.particles.interactions.kinematics import pair_mass_and_radius
from cfddem.particles.interactions.slots import BRIDGE_APART, BRIDGE_PULL
from cfddem.particles.pair_graph import geometry
from cfddem.particles.vectors import at, dot, minus, plus, times
from cfddem.particles.walls.nearest_point import SURFACE, touched

RESISTANCE, FORMED, BROKEN = range(3)
DAMPING, BONDS_BROKEN = range(2)


@serial
def _follow_bridges(system, tally):
    """Move what is held for a bridge at a wall to the piece of the wall to which the bridge has passed."""
    edges, memory, walls = system.edges, system.memory, system.walls
    begin, number = edges.between_particles, len(edges.first)
    while begin < number:
        end, left, taken = begin, -1, -1
        while end < number and of_same_wall(begin, end, edges, walls):
            if memory.bridge_film[end] > 0.0 or memory.bridge_change[end] < 0:
                taken = end
            elif tally.stored[end] != 0.0:
                left = end
            end += 1
        if left >= 0 and taken >= 0:
            tally.stored[taken], tally.pull_work[taken] = tally.stored[left], tally.pull_work[left]
            tally.stored[left], tally.pull_work[left] = 0.0, 0.0
        begin = end


@inline
def _pulled(k, system, kick, sign):
    """Work of the force of the bridge of edge k in a half kick, and the part of it that a wall does."""
    particles, edges, memory = system.particles, system.edges, system.memory
    i, j = edges.first[k], edges.second[k]
    force = at(memory.bridge_force, k)
    moved, turned = half_motion(i, particles, kick, sign)
    if k < edges.between_particles:
        other, about = half_motion(j, particles, kick, sign)
        work = dot(force, minus(moved, other))
        if BRIDGE_APART:
            rolled = plus(times(particles.radius[i], turned), times(particles.radius[j], about))
            work += dot(at(memory.bridge_turn, k), rolled)
        return work, 0.0
    by_wall = dot(force, times(kick, touched(edges, k, SURFACE)))
    return dot(force, moved) - by_wall, by_wall


@inline
def _resisted(k, system, tally, step):
    """Energy that the resistance of edge k has taken in the step, and that a moving wall has put in through it."""
    particles, edges, memory = system.particles, system.edges, system.memory
    i, j = edges.first[k], edges.second[k]
    impulse, couple = at(memory.bridge_impulse, k), at(memory.bridge_couple, k)
    velocity, spin = mean_motion(i, particles, tally, step)
    turned = particles.radius[i] * dot(couple, spin)
    if k < edges.between_particles:
        other, spin = mean_motion(j, particles, tally, step)
        turned += particles.radius[j] * dot(couple, spin)
        return -dot(impulse, minus(velocity, other)) - turned, 0.0
    surface = touched(edges, k, SURFACE)
    return -dot(impulse, minus(velocity, surface)) - turned, dot(impulse, surface)


@inline
def _count_bridge(k, system, tally, step, before, after, totals):
    """Count the bridge of edge k at this instant."""
    memory, p = system.memory, system.parameters
    bridged, change = memory.bridge_film[k] > 0.0, memory.bridge_change[k] if step > 0.0 else 0
    if step > 0.0 and ((bridged and change <= 0) or change < 0):
        lost, by_wall = _resisted(k, system, tally, step)
        totals[RESISTANCE] += lost
        totals[-1] += by_wall
        note_bridge_loss(k, memory, lost)
    if change < 0:
        totals[BROKEN] += tally.stored[k] - tally.pull_work[k]
    stored, pulled = tally.stored[k], tally.pull_work[k]
    tally.stored[k] = 0.0
    tally.pull_work[k] = 0.0
    if not (BRIDGE_PULL or BRIDGE_APART) or not bridged:
        return
    if BRIDGE_PULL:
        _, _, gap = geometry(k, system)
        reduced_radius, _ = pair_mass_and_radius(k, system)
        tally.stored[k] = pull_energy(bridge_state(k, gap, reduced_radius, memory, p))
    work, by_wall = _pulled(k, system, before, -1.0)
    totals[-1] += by_wall
    if change > 0:
        totals[FORMED] += tally.stored[k] + work
    elif step > 0.0 and (BRIDGE_APART or stored != 0.0) and memory.bridge_resistance[k] > 0.0:
        surplus = pulled + work + tally.stored[k] - stored
        totals[RESISTANCE] -= surplus
        note_bridge_loss(k, memory, -surplus)
    tally.pull_work[k], by_wall = _pulled(k, system, after, 1.0)
    totals[-1] += by_wall


DRIED = "bridges_dried"
"""Energy lost as bridges dry, of runs in which they do; counted as they do."""

BRIDGES = EnergyAccount(
    ("bridge", "bridges_formed", "bridges_broken"),
    _count_bridge,
    form="bridges",
    begun=BY_IMPULSES,
    at_walls=_follow_bridges,
)
"""Energy lost to the resistance of bridges; energy gained where bridges form and lost where they break."""

DRYING_BRIDGES = BRIDGES._replace(channels=(*BRIDGES.channels, DRIED))
"""The same of bridges that dry."""


# ---------------------------------------------------------------- bonds


@inline
def _bond_work(k, system, loads, kick, sign):
    """Work of a force, a couple and a moment of edge k in a half kick."""
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    moved, turned = half_motion(i, particles, kick, sign)
    other, about = half_motion(j, particles, kick, sign)
    rolled = plus(times(particles.radius[i], turned), times(particles.radius[j], about))
    force, couple, moment = loads
    return dot(force, minus(moved, other)) + dot(couple, rolled) + dot(moment, minus(turned, about))


@inline
def _count_bond(k, system, tally, step, before, after, totals):
    """Count the bond of edge k at this instant."""
    memory = system.memory
    if memory.bond_radius[k] == 0.0:
        totals[BONDS_BROKEN] += tally.stored[k] - tally.pull_work[k] if step > 0.0 else 0.0
        tally.stored[k] = 0.0
        tally.pull_work[k] = 0.0
        return
    force, couple, moment, energy = bond_loads(k, system)
    whole = at(memory.bond_force, k), at(memory.bond_couple, k), at(memory.bond_moment, k)
    damping = minus(whole[0], force), minus(whole[1], couple), minus(whole[2], moment)
    totals[DAMPING] -= _bond_work(k, system, damping, before, -1.0) + _bond_work(k, system, damping, after, 1.0)
    tally.stored[k] = energy
    tally.pull_work[k] = _bond_work(k, system, whole, after, 1.0)


BONDS = EnergyAccount(("bond_damping", "bonds_broken"), _count_bond, pairs_only=True, form="bonds")
"""Energy lost to the dashpots of bonds, and where bonds break."""
