"""Contact of two solids: the normal force of the chosen law, Coulomb friction with a tangential spring, and rolling.

The functions are free of branches, so that the loop that calls them works on several pairs at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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
    rolling_torque,
    secant_stiffness,
    tangential_stiffness,
)
from cfddem.particles.vectors import LEAST, NOTHING, across, cross, dot, minus, plus, select, times
from closures.contact import contact_share
from closures.friction import (
    coulomb_limit,
    dry_or_lubricated,
    rolling_damping,
    rolling_limit,
    rolling_stiffness,
    twisting_limit,
)

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


# ---------------------------------------------------------------- rolling and twisting


ROLLING_FIELDS = (
    Field("roll", "rad", 3, "memory", meaning="angle of the rolling spring"),
    Field("moment", "N m", 3, "memory", meaning="torque against rolling and twisting on the first body"),
)


class RollingState(NamedTuple):
    """A contact that rolls, as a law of rolling sees it."""

    normal: tuple[float, float, float]
    rate: tuple[float, float, float]  # of rolling [rad/s]
    limit: float  # largest torque [N m]
    stiffness: float  # of the rolling spring [N m/rad]
    softly: float  # torque over the rate of rolling that does not turn the motion round [N m s]
    inverse_inertia: float  # of both bodies [1/(kg m2)]


@inline
def resist_rolling(kinematics, contact, row, force, roll, p, m, d):
    """Moment on the first body (the second has its opposite) and the angle of the rolling spring afterwards.

    Twisting is resisted by the friction of the contact wherever rolling is resisted.

    contact  :class:`~cfddem.particles.interactions.slots.ContactState`
    force    of the contact on the first body [N]
    roll     angle of the rolling spring [rad]
    """
    touching = contact.gap < contact.minimum_gap
    share = contact_share(contact.gap, contact.minimum_gap) if FILM else 1.0
    normal = times(1.0 / kinematics.distance, kinematics.separation)
    rate = across(kinematics.relative_spin, normal)
    pressed = dot(force, normal)
    limit = rolling_limit(row.rolling_friction, contact.reduced_radius, pressed)
    # a torque of constant size must stop the particles without turning them round: each of up to ten contacts may take
    # a tenth of what would stop the body within the step
    softly = 0.1 / max(contact.step * kinematics.inverse_inertia, LEAST)
    friction = row.friction
    if FILM:
        friction = dry_or_lubricated(contact.minimum_gap, row.roughness_gap, row.friction, row.friction_lubricated)
    twist = dot(kinematics.relative_spin, normal)
    twisting = twisting_limit(friction, math.sqrt(contact.reduced_radius * contact.overlap), pressed)
    twisting = -min(max(twist * softly, -twisting), twisting)
    secant = share * secant_stiffness(contact, row, p, m, d)
    stiffness = rolling_stiffness(secant, row.rolling_friction, contact.reduced_radius)
    rolling = RollingState(normal, rate, limit, stiffness, softly, kinematics.inverse_inertia)
    moment, roll = rolling_torque(rolling, roll, contact.step, p)
    moment = plus(moment, times(twisting, normal))
    return select(touching, moment, NOTHING), select(touching, roll, NOTHING)


@inline
def constant_torque(rolling, roll, step, p):
    """A torque of constant size against rolling."""
    speed = math.sqrt(dot(rolling.rate, rolling.rate))
    return times(-min(rolling.limit, speed * rolling.softly) / max(speed, LEAST), rolling.rate), NOTHING


@inline
def spring_dashpot(rolling, roll, step, p):
    """A spring that yields at the largest rolling torque, and a dashpot that acts until then."""
    normal, rate, limit, stiffness = rolling.normal, rolling.rate, rolling.limit, rolling.stiffness
    roll = across(plus(roll, times(step, rate)), normal)
    size = stiffness * math.sqrt(dot(roll, roll))
    yields = size > limit
    roll = times(limit / max(size, LEAST) if yields else 1.0, roll)
    # a sphere that rolls turns about the contact: 7/2 of its inertia about the centre
    inertia = 3.5 / max(rolling.inverse_inertia, LEAST)
    damping = 0.0 if yields else rolling_damping(p.rolling_damping, inertia, stiffness)
    return times(-1.0, plus(times(stiffness, roll), times(damping, rate))), roll


ROLLINGS = {"none": None, "constant_torque": constant_torque, "spring_dashpot": spring_dashpot}
