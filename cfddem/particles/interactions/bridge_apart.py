"""Closed bridges that act by themselves: as a force that follows the velocity, outside of the joint solution.

Below h_min the resistance of a bridge does not depend on the gap. Its force is then a dashpot, c times the rate of the
gap at the middle of the step, as the damping of a contact is. In a network in balance this force is exact, and its
error in time is of the order of that of the joint solution. The dashpots of all bodies are stable as long as

    S_1 + S_2 < 2,        S = dt/m sum max(c_along, (1 + m r^2/I) c_across)

for the two bodies of each: the sum, over all bridges of the body, bounds every eigenvalue of the dashpots times the
step (Gershgorin, by pairs), and kinetic energy falls in each kick while these are below 2. Springs at the largest step
that a run accepts lower the limit to 1.5, which is `MOST`.

A bridge acts by itself from one position to the next where it is closed at the first, will not open on the way by twice
its speed, and its bodies are not stiff. All others are rows of the joint solution, among them new bridges, those at
walls, and the only bridge of two bodies, whose impact a row follows more closely. Such a force acts for half a kick on
each side of an instant: for one of both where the bridge comes from the joint solution or goes to it.
"""

from __future__ import annotations

from cfddem.backend.compile import inline, part, prange, serial
from cfddem.model.fields import Field
from cfddem.particles.interactions.bridge import renew_bridge
from cfddem.particles.interactions.slots import BRIDGE_SLIDING
from cfddem.particles.pair_graph import edge_role, places_of
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, minus, plus, put, times

MOST = 1.5
"""Sum of the damping numbers S of two bodies below which their bridge may act by itself."""

MANY = 3.0
"""The same after a step has grown: half a kick of the last forces is stable up to 4."""

ROLLED = 3.5
"""1 + m r^2/I of a sphere."""

ALONE = 1.0 + 1e-9
"""Loads of two bodies over that of their bridge up to which they have no other."""

FIELDS = (
    Field("bridge_apart", "1/s", role="memory", meaning="load of both bodies where the bridge acts by itself, else 0"),
    Field("bridge_turn", "N", 3, "memory", meaning="couple of that bridge per radius, the same on both bodies"),
)
"""What pairs remember whose bridges may act by themselves."""


@inline
def damping_of(k, memory):
    """Largest resistance of the bridge of edge k to a motion of one of its bodies, turning included [kg/s]."""
    return max(memory.closed_along[k], ROLLED * memory.closed_across[k])


@inline
def resist_apart(k, between, closed, floor, system, step):
    """Force of the bridge of edge k by its resistance if it acts by itself; keeps its couple, and whether it goes on.

    between  normal, distance and gap
    closed   whether its gap is below `floor`
    step     0 where the positions are those of the last forces [s]
    """
    particles, edges, memory = system.particles, system.edges, system.memory
    i, j = edges.first[k], edges.second[k]
    normal, distance, gap = between
    velocity = minus(at(particles.velocity, i), at(particles.velocity, j))
    rate = dot(velocity, normal)
    load = particles.bridge_load[i] + particles.bridge_load[j]
    own = damping_of(k, memory) * (particles.inverse_mass[i] + particles.inverse_mass[j])
    before = memory.bridge_apart[k]
    stays = closed & (gap + 2.0 * step * rate < floor) & (step * load < MOST) & (load > ALONE * own)
    after = (load if stays else 0.0) if step > 0.0 else (before if closed else 0.0)
    memory.bridge_apart[k] = after
    share = (0.5 if before > 0.0 else 0.0) + (0.5 if after > 0.0 else 0.0)
    force = times(-share * memory.closed_along[k] * rate, normal)
    if BRIDGE_SLIDING:
        radius_i, radius_j = particles.radius[i], particles.radius[j]
        lever = distance / (radius_i + radius_j)
        turning = times(lever, plus(times(radius_i, at(particles.spin, i)), times(radius_j, at(particles.spin, j))))
        slip = minus(across(velocity, normal), cross(turning, normal))
        push = times(-share * memory.closed_across[k], slip)
        put(memory.bridge_turn, k, times(lever, cross(push, normal)))
        force = plus(force, push)
    return force


@inline
def find_load(i, system):
    """Sum of the damping rates of the bridges of particle i."""
    particles, edges, memory, total = system.particles, system.edges, system.memory, 0.0
    for place in places_of(i, edges):
        k, _ = edge_role(edges.incident[place])
        if memory.bridge_film[k] > 0.0:
            total += damping_of(k, memory)
    particles.bridge_load[i] = particles.inverse_mass[i] * total


@part
def find_loads(system, changed):
    """Loads of all particles, or of those whose bridges form or break."""
    particles = system.particles
    for i in prange(particles.owned):
        if not changed or particles.bridges_change[i]:
            find_load(i, system)


@serial
def release_stiff(system, step):
    """Mark bridges that are stiff at a larger step than the last, and let them pull alone; returns their number."""
    memory, count = system.memory, 0
    for k in range(system.edges.between_particles):
        if step * memory.bridge_apart[k] > MANY:
            put(memory.bridge_force, k, NOTHING)
            renew_bridge(k, system)
            put(memory.bridge_turn, k, NOTHING)
            memory.bridge_apart[k] = -1.0
            count += 1
    return count


@inline
def released(i, system):
    """Whether a bridge of particle i is marked."""
    edges, any_released = system.edges, False
    for place in places_of(i, edges):
        k, _ = edge_role(edges.incident[place])
        any_released = any_released or system.memory.bridge_apart[k] < 0.0
    return any_released


@serial
def end_release(memory):
    """Remove the marks."""
    for k in range(len(memory.bridge_apart)):
        memory.bridge_apart[k] = max(memory.bridge_apart[k], 0.0)
