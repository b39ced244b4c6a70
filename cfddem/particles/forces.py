"""What two bodies do to each other where they touch: contact and friction.

The contact of a pair is a function of numbers alone, without arrays and without branches, so that the loop
that calls it runs on several pairs at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from cfddem.chosen_laws import OF_THE_PAIR_LOOP, chosen
from cfddem.errors import InputError
from cfddem.kernels import inline
from cfddem.particles.own_laws import address
from cfddem.particles.surfaces import SURFACE, touched
from cfddem.particles.vectors import across, at, cross, dot, either, minus, plus, times
from closures.blend import contact_share
from closures.cohesion import jkr_contact_radius, jkr_force, jkr_pull_off, jkr_stretch
from closures.contact import (
    hertz_damping,
    hertz_force,
    hertz_stiffness,
    linear_damping,
    mindlin_stiffness,
)
from closures.friction import (
    coulomb_limit,
    dry_or_lubricated,
    rolling_damping,
    rolling_limit,
    rolling_stiffness,
    twisting_limit,
)

DRIFT, VERLET = 0, 1
FILM, OVERLAP = 0, 1
HERTZ, LINEAR = 0, 1
TOTAL, RESCALED = 0, 1
NO_COHESION, JKR = 0, 1
FREE, CONSTANT_TORQUE, SPRING_DASHPOT = 0, 1, 2
ROLLING = 3.5
"""How much easier the contact point of two solid spheres is moved along the surface than their centres apart."""

INTEGRATORS = {"drift": DRIFT, "verlet": VERLET}
FRICTION_ONSETS = {"film": FILM, "overlap": OVERLAP}
CONTACTS = {"hertz": HERTZ, "linear": LINEAR}
COHESIONS = {"none": NO_COHESION, "jkr": JKR}
SPRINGS = {"total": TOTAL, "rescaled": RESCALED}
ROLLINGS = {"free": FREE, "constant_torque": CONSTANT_TORQUE, "spring_dashpot": SPRING_DASHPOT}

NOTHING = (0.0, 0.0, 0.0)
LEAST = 1e-300  # keeps divisions of pairs that do not touch finite; their results are dropped


class Laws(NamedTuple):
    """Which laws hold between two bodies."""

    film: bool = False  # is there a film at all
    integrator: int = DRIFT  # how the film enters the motion
    friction_onset: int = FILM  # where friction starts: at h_min, or at geometric overlap
    contact: int = HERTZ
    spring: int = TOTAL  # tangential force from the total displacement, or rescaled while loading
    rolling: int = FREE  # what resists rolling: nothing, a constant torque, or a spring that yields and a dashpot
    cohesion: int = NO_COHESION  # what holds dry solids together, in place of the elastic force of Hertz
    cutoff_ratio: float = 1.0  # h_co / R*
    normal_stiffness: float = 0.0  # of the linear contact [N/m]
    tangential_stiffness: float = 0.0  # of the linear contact [N/m]
    rolling_damping: float = 0.3  # of the rolling dashpot, over critical; 0.3 as in Ai et al. (2011) [-]
    minimum_gap: Callable[..., float] | None = None  # a law of one's own for h_min, or the one that is built in
    lubrication: Callable[..., float] | None = None  # a law of one's own for the resistance of a film

    def without_the_absent(self) -> Laws:
        """The same laws with each choice that is not made as None, which a loop compiled for it leaves out."""
        choices = ("film", "integrator", "friction_onset", "contact", "spring", "rolling", "cohesion")
        absent: dict[str, Any] = {name: None for name in choices if not getattr(self, name)}
        return self._replace(**absent)

    def dry(self) -> Laws:
        """The same laws without films."""
        return self._replace(film=False, minimum_gap=None, lubrication=None)

    def for_loops(self) -> Laws:
        """The same laws with those of one's own as loops take them."""
        own: dict[str, Any] = {
            name: address(getattr(self, name), name) for name in OF_THE_PAIR_LOOP if getattr(self, name) is not None
        }
        return self._replace(**own)

    def check(self) -> None:
        """Refuse choices that exclude each other."""
        if self.cohesion and self.film:
            raise InputError("cohesion", self.cohesion, "absent where there are films; adhesion is that of dry solids")
        if self.cohesion and self.contact != HERTZ:
            raise InputError("cohesion", self.cohesion, "with the contact of Hertz; linear springs do not adhere")
        for kind in OF_THE_PAIR_LOOP:
            if (law := getattr(self, kind)) is not None:
                name = chosen(kind, law).name
                if not self.film:
                    raise InputError(kind, name, "absent where there are no films", "take Laws(film=True)")


class Meeting(NamedTuple):
    """Two bodies at one instant, seen from the first."""

    separation: tuple[float, float, float]  # from the second body to the first [m]
    distance: float  # of the centres, or from a wall [m]
    gap: float  # [m]
    velocity: tuple[float, float, float]  # of the first centre against the second [m/s]
    surface_spin: tuple[float, float, float]  # sum of spin times radius [m/s]
    reduced_radius: float  # R* [m]
    inverse_sum: float  # 1 / (R_i + R_j); 1 / R_i at a wall [1/m]
    inverse_mass: float  # 1 / m* [1/kg]
    turn: tuple[float, float, float]  # rate at which motion turns the normal [1/s]
    relative_spin: tuple[float, float, float]  # of the first body against the second [rad/s]
    inverse_inertia: float  # sum over both bodies, each about its centre [1/(kg m2)]


@inline
def contact(meeting, rows, which, minimum_gap, spring, laws, step):
    """Force on the first body, couple per radius on both, and the tangential spring afterwards.

    Hertz and dashpot, Mindlin and Coulomb, times the share that the solids have in the load. The spring moves
    with the half-step velocity in the tangent plane of half a step ago, and is then turned into the present
    one, so that positions, velocities and history belong to the same instant.
    """
    row = rows[which]
    touching = meeting.gap < minimum_gap
    overlap = max(minimum_gap - meeting.gap, LEAST)
    share = contact_share(meeting.gap, minimum_gap) if laws.film else 1.0
    normal = times(1.0 / meeting.distance, meeting.separation)
    normal_speed = dot(meeting.velocity, normal)

    reduced_mass = 1.0 / meeting.inverse_mass
    hertz = laws.contact != LINEAR
    stiffness = hertz_stiffness(row.contact_modulus, meeting.reduced_radius)
    elastic = hertz_force(stiffness, overlap) if hertz else laws.normal_stiffness * overlap
    held = 0.0
    if laws.cohesion:
        adhesion = (max(row.work_of_adhesion, LEAST), meeting.reduced_radius, row.contact_modulus)
        contact_radius = jkr_contact_radius(-meeting.gap, adhesion[0], adhesion[1], adhesion[2])
        elastic = jkr_force(contact_radius, adhesion[0], adhesion[1], adhesion[2])
        held = jkr_pull_off(adhesion[0], adhesion[1])
        overlap = max(contact_radius * contact_radius / meeting.reduced_radius, LEAST)  # of Hertz' contact as wide
    damping = (
        hertz_damping(row.damping_ratio, reduced_mass, stiffness, overlap)
        if hertz
        else linear_damping(row.linear_damping_ratio, reduced_mass, laws.normal_stiffness)
    )
    tangential_stiffness = (
        mindlin_stiffness(row.shear_modulus, meeting.reduced_radius, overlap) if hertz else laws.tangential_stiffness
    )
    # in the steps in which the surfaces meet and part, the dashpot lasts for a part of the step only; there
    # Hertz' grows as the fourth root of the overlap, and its mean is 4/5 of its present value
    stride = max(abs(step * normal_speed), LEAST)
    lasted = overlap / stride
    damping *= 0.5 + (0.8 if hertz else 1.0) * lasted if lasted < 1.0 else 1.0
    # a dashpot acts on the speed at the middle of the kick, which it changes itself
    kick = 0.5 * step * meeting.inverse_mass * share
    mid_speed = (normal_speed + kick * elastic) / (1.0 + kick * damping)
    normal_force = elastic - damping * mid_speed

    # levers add up to the distance of the centres
    stretch = meeting.distance * meeting.inverse_sum
    halfway = minus(normal, times(0.5 * step, meeting.turn))
    halfway = times(1.5 - 0.5 * dot(halfway, halfway), halfway)  # unit length, to second order of the turn
    slip = minus(across(meeting.velocity, halfway), times(stretch, cross(meeting.surface_spin, halfway)))
    before = max(overlap + step * normal_speed, 0.0)
    loading = laws.spring == RESCALED and before < overlap
    spring = times(math.sqrt(before / overlap) if loading else 1.0, spring)
    # in its first step a contact slides only from where friction sets in
    gripped = -meeting.gap / stride if laws.friction_onset == OVERLAP else lasted
    portion = min(max(gripped, 0.0), 1.0) if normal_speed < 0.0 else 1.0
    spring = across(plus(spring, times(portion * step, slip)), normal)
    slip = across(slip, normal)

    mid_slip = minus(slip, times(ROLLING * kick * tangential_stiffness, spring))
    mid_slip = times(1.0 / (1.0 + ROLLING * kick * damping), mid_slip)
    pull = plus(times(tangential_stiffness, spring), times(damping, mid_slip))
    friction = row.friction
    if laws.film:
        friction = dry_or_lubricated(minimum_gap, row.roughness_gap, row.friction, row.friction_lubricated)
    limit = coulomb_limit(friction, normal_force + 2.0 * held)  # Thornton (1991): the pull presses, too
    size = math.sqrt(dot(pull, pull))
    sliding = size > limit
    pull = times(limit / max(size, LEAST) if sliding else 1.0, pull)
    # a sliding spring carries what the dashpot leaves of Coulomb's limit, and never more than the limit
    carried = minus(pull, times(damping, slip))
    carried = either(dot(carried, carried) > limit * limit, pull, carried)
    spring = either(sliding, times(1.0 / max(tangential_stiffness, LEAST), carried), spring)

    gripping = touching and (laws.friction_onset != OVERLAP or meeting.gap < 0.0)
    pull = either(gripping, pull, NOTHING)
    force = minus(times(normal_force, normal), pull)
    return (
        either(touching, times(share, force), NOTHING),
        times(share * stretch, cross(normal, pull)),
        either(gripping, spring, NOTHING),
    )


@inline
def contact_reach(meeting, row, minimum_gap):
    """Gap up to which an adhesive contact lasts: 0 until the solids touch, then how far they can be stretched."""
    stretch = jkr_stretch(row.work_of_adhesion, meeting.reduced_radius, row.contact_modulus)
    return stretch if meeting.gap < minimum_gap else 0.0


@inline
def resist_rolling(meeting, row, minimum_gap, force, roll, laws, step):
    """Moment on the first body, the second has its opposite, and the angle of the rolling spring afterwards.

    Where rolling is resisted, twisting is too, by the friction of the contact; nothing else would stop a top.

    force  of the contact on the first body [N]
    roll   angle by which the bodies have rolled on each other and not yielded [rad]
    """
    touching = meeting.gap < minimum_gap
    overlap = max(minimum_gap - meeting.gap, LEAST)
    share = contact_share(meeting.gap, minimum_gap) if laws.film else 1.0
    normal = times(1.0 / meeting.distance, meeting.separation)
    rate = across(meeting.relative_spin, normal)
    pressed = dot(force, normal)
    limit = rolling_limit(row.rolling_friction, meeting.reduced_radius, pressed)
    # a resistance of constant size stops the bodies and does not turn them round; each of a dozen contacts of a
    # body may take a tenth of what would stop it within the step
    softly = 0.1 / max(step * meeting.inverse_inertia, LEAST)
    friction = row.friction
    if laws.film:
        friction = dry_or_lubricated(minimum_gap, row.roughness_gap, row.friction, row.friction_lubricated)
    twist = dot(meeting.relative_spin, normal)
    twisting = twisting_limit(friction, math.sqrt(meeting.reduced_radius * overlap), pressed)
    twisting = -min(max(twist * softly, -twisting), twisting)
    if laws.rolling == CONSTANT_TORQUE:
        speed = math.sqrt(dot(rate, rate))
        moment = times(-min(limit, speed * softly) / max(speed, LEAST), rate)
        roll = NOTHING
    else:
        secant = hertz_stiffness(row.contact_modulus, meeting.reduced_radius) * math.sqrt(overlap)
        secant = share * (secant if laws.contact != LINEAR else laws.normal_stiffness)
        stiffness = rolling_stiffness(secant, row.rolling_friction, meeting.reduced_radius)
        roll = across(plus(roll, times(step, rate)), normal)
        size = stiffness * math.sqrt(dot(roll, roll))
        yields = size > limit
        roll = times(limit / max(size, LEAST) if yields else 1.0, roll)
        # a sphere that rolls turns about the contact: 7/2 of its inertia about the centre
        inertia = 3.5 / max(meeting.inverse_inertia, LEAST)
        damping = 0.0 if yields else rolling_damping(laws.rolling_damping, inertia, stiffness)
        moment = times(-1.0, plus(times(stiffness, roll), times(damping, rate)))
    moment = plus(moment, times(twisting, normal))
    return either(touching, moment, NOTHING), either(touching, roll, NOTHING)


@inline
def pair_mass_and_radius(k, bodies, edges):
    """Reduced radius and inverse of the reduced mass; those of the particle itself against a wall."""
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        radius = bodies.radius[i] * bodies.radius[j] / (bodies.radius[i] + bodies.radius[j])
        return radius, bodies.inverse_mass[i] + bodies.inverse_mass[j]
    return bodies.radius[i], bodies.inverse_mass[i]


@inline
def relative_velocity(k, bodies, edges):
    """Velocity of the first body's centre against the second's, or against the surface of a wall."""
    i, j = edges.first[k], edges.second[k]
    other = at(bodies.velocity, j) if k < edges.between_particles else touched(edges, k, SURFACE)
    return minus(at(bodies.velocity, i), other)


@inline
def pair_row(k, bodies, edges, walls, table):
    """What the materials of this pair do to each other."""
    i, j = edges.first[k], edges.second[k]
    other = bodies.material[j] if k < edges.between_particles else walls.material[j]
    return table[bodies.material[i], other]


@inline
def pair_viscosity(k, bodies, edges):
    """Viscosity of the fluid in the gap."""
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        return 0.5 * (bodies.viscosity[i] + bodies.viscosity[j])
    return bodies.viscosity[i]
