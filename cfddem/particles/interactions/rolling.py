"""Resistance to rolling and twisting."""

from __future__ import annotations

import math
from typing import NamedTuple

from cfddem.backend.compile import inline
from cfddem.model.fields import Field
from cfddem.particles.interactions.slots import FILM, rolling_torque, secant_stiffness
from cfddem.particles.vectors import LEAST, NOTHING, across, dot, plus, select, times
from closures.contact import contact_share
from closures.friction import (
    dry_or_lubricated,
    rolling_damping,
    rolling_limit,
    rolling_stiffness,
    twisting_limit,
)

FIELDS = (
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
