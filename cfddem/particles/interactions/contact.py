"""Contact of two solids: the normal force of the chosen law, and Coulomb friction with a tangential spring.

The functions are free of branches, so that the loop that calls them works on several pairs at once.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline
from cfddem.model.fields import Field
from cfddem.particles.interactions.slots import (
    DAMPING_MEAN,
    FILM,
    FROM_OVERLAP,
    RESCALED,
    ContactState,
    contact_overlap,
    derive,
    elastic_force,
    normal_damping,
    pull_off,
    remember,
    tangential_stiffness,
)
from cfddem.particles.vectors import LEAST, NOTHING, across, cross, dot, minus, plus, select, times
from closures.contact import contact_share
from closures.friction import coulomb_limit, dry_or_lubricated

ROLLING_MOBILITY = 3.5
"""Mobility of the contact point of two solid spheres along the surface, over that of their centres along the normal."""

FIELDS = (
    Field("force", "N", 3, "memory", meaning="contact force on the first body"),
    Field("couple", "N", 3, "memory", meaning="torque per radius, the same on both particles"),
    Field("spring", "m", 3, "memory", meaning="tangential displacement of the contact"),
    Field("minimum_gap", "m", role="memory", meaning="gap below which the solids touch: h_min, or reach of adhesion"),
)
TOUCHING = Field(
    "touching", role="scratch", dtype=np.uint8, initial=1.0, meaning="1 where solids touch, and 2 more where they did"
)
"""Of the last two steps. Where it is zero, nothing of a contact has to be renewed; it is not in a new list."""


@inline
def contact_state(kinematics, minimum_gap, step):
    """The contact as the functions of its law see it."""
    overlap = max(minimum_gap - kinematics.gap, LEAST)
    normal_speed = dot(kinematics.velocity, times(1.0 / kinematics.distance, kinematics.separation))
    return ContactState(
        overlap,
        kinematics.gap,
        normal_speed,
        step,
        minimum_gap,
        kinematics.reduced_radius,
        1.0 / kinematics.inverse_mass,
    )


@inline
def friction_coefficient(row, minimum_gap):
    """Of dry or of lubricated contacts."""
    friction = row.friction
    if FILM:
        friction = dry_or_lubricated(minimum_gap, row.roughness_gap, row.friction, row.friction_lubricated)
    return friction


@inline
def contact(kinematics, row, minimum_gap, spring, m, p, step):
    """Force on the first body, couple per radius on both, and the tangential spring and memory afterwards.

    The spring moves with the half-step velocity in the tangent plane of half a step ago and is then turned into the
    present plane, so that positions, velocities and history belong to the same instant.
    """
    state = contact_state(kinematics, minimum_gap, step)
    touching = kinematics.gap < minimum_gap
    share = contact_share(kinematics.gap, minimum_gap) if FILM else 1.0
    normal = times(1.0 / kinematics.distance, kinematics.separation)
    normal_speed = state.normal_speed

    d = derive(state, row, p, m)
    m = remember(state, row, p, m, d)
    elastic = elastic_force(state, row, p, m, d)
    adhesion = pull_off(state, row, p, m, d)
    overlap = contact_overlap(state, row, p, m, d)
    state = ContactState(overlap, state.gap, normal_speed, step, minimum_gap, state.reduced_radius, state.reduced_mass)
    damping = normal_damping(state, row, p, m, d)
    stiffness = tangential_stiffness(state, row, p, m, d)
    # in the steps in which the surfaces meet and part the dashpot acts for a part of the step only
    stride = max(abs(step * normal_speed), LEAST)
    lasted = overlap / stride
    damping *= 0.5 + DAMPING_MEAN * lasted if lasted < 1.0 else 1.0
    # a dashpot acts on the speed at the middle of the kick, which it changes itself
    kick = 0.5 * step * kinematics.inverse_mass * share
    mid_speed = (normal_speed + kick * elastic) / (1.0 + kick * damping)
    normal_force = elastic - damping * mid_speed

    # levers add up to the distance of the centres
    stretch = kinematics.distance * kinematics.inverse_sum
    halfway = minus(normal, times(0.5 * step, kinematics.turn))
    halfway = times(1.5 - 0.5 * dot(halfway, halfway), halfway)  # unit length, to second order of the turn
    slip = minus(across(kinematics.velocity, halfway), times(stretch, cross(kinematics.surface_spin, halfway)))
    before = max(overlap + step * normal_speed, 0.0)
    loading = RESCALED and before < overlap
    spring = times(math.sqrt(before / overlap) if loading else 1.0, spring)
    # in its first step a contact slides only from where friction begins
    gripped = -kinematics.gap / stride if FROM_OVERLAP else lasted
    portion = min(max(gripped, 0.0), 1.0) if normal_speed < 0.0 else 1.0
    spring = across(plus(spring, times(portion * step, slip)), normal)
    slip = across(slip, normal)

    mid_slip = minus(slip, times(ROLLING_MOBILITY * kick * stiffness, spring))
    mid_slip = times(1.0 / (1.0 + ROLLING_MOBILITY * kick * damping), mid_slip)
    pull = plus(times(stiffness, spring), times(damping, mid_slip))
    friction = friction_coefficient(row, minimum_gap)
    limit = coulomb_limit(friction, normal_force + 2.0 * adhesion)  # adhesion adds to the load, Thornton (1991)
    size = math.sqrt(dot(pull, pull))
    sliding = size > limit
    pull = times(limit / max(size, LEAST) if sliding else 1.0, pull)
    # a sliding spring carries what the dashpot leaves of Coulomb's limit, and never more than the limit
    carried = minus(pull, times(damping, slip))
    carried = select(dot(carried, carried) > limit * limit, pull, carried)
    spring = select(sliding, times(1.0 / max(stiffness, LEAST), carried), spring)

    gripping = touching and (not FROM_OVERLAP or kinematics.gap < 0.0)
    pull = select(gripping, pull, NOTHING)
    force = minus(times(normal_force, normal), pull)
    return (
        select(touching, times(share, force), NOTHING),
        times(share * stretch, cross(normal, pull)),
        select(gripping, spring, NOTHING),
        m,
        d,
    )
