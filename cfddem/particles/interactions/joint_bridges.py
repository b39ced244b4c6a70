"""What a liquid bridge adds to the equations of all films and bridges.

See `cfddem.particles.interactions.joint_solution`. A bridge resists along the line of centres by the mean of its
resistance over the way of the gap in the step, and across it by its resistance at the beginning of the step. A film and
a bridge of the same pair are one row of the equations; the impulses found are shared by their resistances.
"""

from __future__ import annotations

from cfddem.backend.compile import inline
from cfddem.particles.interactions.bridge import bridge_state, capillary_number_of, resistance_across
from cfddem.particles.interactions.bridge_solution import SMALLEST_GAP, cut_resistance, speed_after_bridge
from cfddem.particles.interactions.kinematics import pair_mass_and_radius
from cfddem.particles.interactions.shear_film import by_blocks, four_of, slip_and_roll_of
from cfddem.particles.interactions.slots import BRIDGE_FILM, BRIDGE_SLIDING, DRIFTING, SHEAR
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, plus, put, times

STILL = 1e-7
"""Change of the gap in a step, over the gap or h_min, below which the mean resistance is that at the gap."""


@inline
def floor_of(k, memory):
    """Gap below which the resistance of the bridge of edge k does not depend on it."""
    return max(memory.bridge_gap[k], SMALLEST_GAP)


@inline
def mean_along(e, rate, speed, impulse, system, step):
    """Resistance of the bridge of row e along the line of centres, over its way in this step; 0 without one.

    rate     of the gap before all impulses [m/s]
    speed    rate of the gap with all impulses, as found so far [m/s]
    impulse  of the bridge, as found so far [N s]
    """
    memory, p, k = system.memory, system.parameters, system.memory.joint_edge[e]
    if not BRIDGE_FILM or not memory.bridge_film[k] > 0.0:
        return 0.0
    gap, weight, floor = memory.joint_gap[e], memory.joint_weight[e], floor_of(k, memory)
    if max(gap, gap + step * speed) < floor:
        return memory.closed_along[k]
    state = bridge_state(k, gap, memory.joint_reduced_radius[e], memory, p, capillary_number_of(rate, p))
    free = speed - weight * impulse
    after = speed_after_bridge(free, state, gap, step, weight)
    if abs(step * after) <= STILL * max(abs(gap), floor):
        return cut_resistance(state, gap, floor)
    return (free - after) / (weight * step * after)


@inline
def across_of(k, gap, rate, system):
    """Resistance of the bridge of edge k to sliding; 0 without one."""
    memory, p = system.memory, system.parameters
    if not BRIDGE_SLIDING or not memory.bridge_film[k] > 0.0:
        return 0.0
    if gap < floor_of(k, memory):
        return memory.closed_across[k]
    reduced_radius, _ = pair_mass_and_radius(k, system)
    return resistance_across(bridge_state(k, gap, reduced_radius, memory, p, capillary_number_of(rate, p)))


@inline
def begin_bridge(e, k, normal, by_film, memory):
    """Normal impulse of the bridge of edge k in the last step, and its part in that of both.

    by_film  impulse of the film in the last step, without what it owed [N s]
    """
    impulse = dot(at(memory.bridge_impulse, k), normal) if memory.bridge_solved[k] else 0.0
    memory.bridge_solved[k] = memory.bridge_film[k] > 0.0
    part = 1.0
    if DRIFTING:
        both = by_film + impulse
        part = impulse / both if impulse * by_film > 0.0 else (0.5 if memory.bridge_solved[k] else 0.0)
    memory.joint_bridge[e] = part
    memory.joint_floor[e] = 0.0 if memory.joint_share[e] > 0.0 else floor_of(k, memory)
    return impulse


@inline
def keep_bridge(e, k, normal, memory):
    """Keep the impulse of the bridge of row e; returns it, its normal part first."""
    along = memory.joint_bridge[e] * (memory.joint_impulse[e] - memory.joint_debt[e])
    push = NOTHING
    if BRIDGE_SLIDING:
        push, roll = slip_and_roll_of(memory.joint_shear_impulse, e)
        if SHEAR and memory.joint_share[e] > 0.0:
            slip, _ = by_blocks(four_of(memory.joint_sliding, e), push, roll, normal)
            push = times(memory.bridge_across[k], slip)
        put(memory.bridge_couple, k, times(memory.bridge_lever[k], cross(push, normal)))
    put(memory.bridge_impulse, k, plus(times(along, normal), push))
    return along, push


@inline
def push_of_last_step(k, normal, memory):
    """Impulse of the bridge of edge k against sliding in the last step."""
    return across(at(memory.bridge_impulse, k), normal)
