"""Forces of liquid bridges on the particles they join: their laws, and the loops over all bridges.

Bridges are few compared with pairs. Their impulses are applied one after the other, each to the velocities left by the
one before: every bridge brakes, and none reverses a motion, however stiff it is. The loops run on one thread, in the
order of ids; results do not depend on the order of particles or the number of threads.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import inline, serial
from cfddem.backend.errors import InputError
from cfddem.particles.vectors import LEAST, across, at, cross, dot, minus, plus, put, times
from closures.bridge import (
    constant_capillary,
    constant_cut,
    davis_tangential,
    deforming_share,
    nase_tangential,
    static_share,
    zero_cut,
)
from closures.capillary import pendular_pull, rupture_length
from closures.contact import reduced
from closures.lubrication import film_strength
from closures.minimum_gap import glass_transition
from closures.numbers import capillary

ABSENT = -1
STATIC, DEFORMING = 0, 1
ZERO, CONSTANT = 0, 1
DAVIS, NASE = 0, 1
PENDULAR, EVEN = 0, 1

BRIDGE_FILMS = {"none": ABSENT, "static": STATIC, "deforming": DEFORMING}
CUTS = {"zero": ZERO, "constant": CONSTANT}
TANGENTIALS = {"none": ABSENT, "davis": DAVIS, "nase": NASE}
PULLS = {"none": ABSENT, "pendular": PENDULAR, "constant": EVEN}

SMALLEST_GAP = 1e-9
"""Gap below which the resistance of a film stays constant if nothing else limits it [m]."""


class BridgeLaws(NamedTuple):
    """Laws of liquid bridges."""

    viscosity: float = 0.0  # of the liquid; it also lengthens bridges that part fast [Pa s]
    surface_tension: float = 0.0  # [N/m]
    contact_angle: float = 0.0  # [rad]
    film: int = ABSENT  # resistance along the line of centres: absent, of a static or of a deforming bridge
    cut: int = ZERO  # that resistance below h_min: none, or as at h_min
    tangential: int = ABSENT  # resistance to sliding: none, by Davis, or by Nase
    pull: int = PENDULAR  # absent, by the volume of liquid with its rupture length, or constant
    minimum_gap: float = 0.0  # h_min, at least [m]
    transition_pressure: float = math.inf  # at which the liquid turns to glass, which sets h_min [Pa]
    every: int = 1  # steps of the particles between two kicks of the bridges

    def check(self) -> None:
        """Refuse values that no liquid has."""
        for name in ("viscosity", "surface_tension", "contact_angle", "minimum_gap"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise InputError(name, value, "at least 0 and finite")
        if not self.transition_pressure > 0.0:
            raise InputError("transition_pressure", self.transition_pressure, "above 0")
        if self.every < 1:
            raise InputError("every", self.every, "at least 1")


class Joined(NamedTuple):
    """The arrays of n bridges, as compiled loops take them; sorted by their first sphere and then their second."""

    first: np.ndarray  # (n,) int64, id of the sphere with the lower one
    second: np.ndarray  # (n,) int64, id
    volume: np.ndarray  # (n,) of liquid in the bridge [m3]
    film: np.ndarray  # (n,) d, thickness of the liquid on both spheres when the bridge formed [m]
    minimum_gap: np.ndarray  # (n,) h_min [m]


@inline
def resistances(gap, film, minimum_gap, reduced_radius, laws):
    """Resistance of a bridge along and across the line of centres [kg/s]."""
    held = max(constant_cut(gap, minimum_gap) if laws.cut == CONSTANT else gap, SMALLEST_GAP)
    along, sideways = 0.0, 0.0
    if laws.film != ABSENT:
        share = deforming_share(held, film) if laws.film == DEFORMING else static_share(held, film)
        along = film_strength(laws.viscosity, reduced_radius) * share / held
    if laws.tangential == DAVIS:
        sideways = davis_tangential(laws.viscosity, reduced_radius, held, film)
    elif laws.tangential == NASE:
        sideways = nase_tangential(laws.viscosity, reduced_radius, held, film)
    if laws.cut == ZERO:
        return zero_cut(along, gap, minimum_gap), zero_cut(sideways, gap, minimum_gap)
    return along, sideways


@inline
def pull_of(gap, film, volume, reduced_radius, laws):
    """Force with which a bridge pulls its particles together [N]."""
    if laws.pull == PENDULAR:
        return pendular_pull(laws.surface_tension, laws.contact_angle, reduced_radius, volume, gap)
    if laws.pull == EVEN and gap < film:
        return constant_capillary(laws.surface_tension, reduced_radius)
    return 0.0


@inline
def _apart(particles, i, j, box):
    """From the first sphere to the nearest image of the second: unit vector, distance, gap."""
    away = minus(at(particles.position, j), at(particles.position, i))
    # an open axis has an infinite box
    away = (
        away[0] - (box[0] * np.rint(away[0] / box[0]) if box[0] < np.inf else 0.0),
        away[1] - (box[1] * np.rint(away[1] / box[1]) if box[1] < np.inf else 0.0),
        away[2] - (box[2] * np.rint(away[2] / box[2]) if box[2] < np.inf else 0.0),
    )
    distance = math.sqrt(dot(away, away))
    return times(1.0 / distance, away), distance, distance - (particles.radius[i] + particles.radius[j])


@serial
def survey(joined, row, particles, box, laws, gap, room):
    """Gap of every bridge, and how far it can still be stretched [m]."""
    for k in range(len(gap)):
        i, j = row[joined.first[k]], row[joined.second[k]]
        normal, _, gap[k] = _apart(particles, i, j, box)
        longest = joined.film[k]
        if laws.pull == PENDULAR:
            parting = max(dot(minus(at(particles.velocity, j), at(particles.velocity, i)), normal), 0.0)
            number = capillary(laws.viscosity, parting, laws.surface_tension) if laws.surface_tension > 0.0 else 0.0
            longest = max(longest, rupture_length(number, laws.contact_angle, joined.volume[k]))
        room[k] = longest - gap[k]


@serial
def kick(joined, row, particles, box, laws, span, backwards):
    """Apply the impulses of bridges over a time, one bridge after the other, in their order or in reverse.

    A resistance acts on the pair as if it were alone; the solution is exact for a constant gap. Lever arms add up to
    the distance of the centres, so that angular momentum is kept.
    """
    number = len(joined.first)
    for turn in range(number):
        k = number - 1 - turn if backwards else turn
        i, j = row[joined.first[k]], row[joined.second[k]]
        normal, distance, gap = _apart(particles, i, j, box)
        radius = reduced(particles.radius[i], particles.radius[j])
        along, sideways = resistances(gap, joined.film[k], joined.minimum_gap[k], radius, laws)
        velocity = minus(at(particles.velocity, j), at(particles.velocity, i))
        mobility = particles.inverse_mass[i] + particles.inverse_mass[j]
        push = dot(velocity, normal) * -math.expm1(-span * along * mobility) / max(mobility, LEAST)
        push += span * pull_of(gap, joined.film[k], joined.volume[k], radius, laws)
        impulse = times(push, normal)
        if sideways > 0.0:
            stretch = distance / (particles.radius[i] + particles.radius[j])
            arm_i, arm_j = stretch * particles.radius[i], stretch * particles.radius[j]
            turning = plus(times(arm_i, at(particles.spin, i)), times(arm_j, at(particles.spin, j)))
            slip = minus(across(velocity, normal), cross(turning, normal))
            mobility += arm_i * arm_i * particles.inverse_inertia[i] + arm_j * arm_j * particles.inverse_inertia[j]
            drag = times(-math.expm1(-span * sideways * mobility) / max(mobility, LEAST), slip)
            impulse = plus(impulse, drag)
            couple = cross(normal, drag)
            put(particles.spin, i, plus(at(particles.spin, i), times(arm_i * particles.inverse_inertia[i], couple)))
            put(particles.spin, j, plus(at(particles.spin, j), times(arm_j * particles.inverse_inertia[j], couple)))
        put(particles.velocity, i, plus(at(particles.velocity, i), times(particles.inverse_mass[i], impulse)))
        put(particles.velocity, j, minus(at(particles.velocity, j), times(particles.inverse_mass[j], impulse)))


@serial
def new_contacts(edges, particles, box, film, keys, most_ids, found):
    """Find pairs whose films overlap and that have no bridge; returns their number.

    film  (N,) thickness of the film of each sphere, by row [m]
    keys  of the bridges there are, in ascending order: first id times `most_ids` plus second
    found filled with the keys of new pairs, as far as it has room
    """
    number = 0
    for k in range(edges.between_particles):
        i, j = np.int64(edges.first[k]), np.int64(edges.second[k])
        if _apart(particles, i, j, box)[2] >= film[i] + film[j]:
            continue
        one, other = particles.id[i], particles.id[j]
        key = min(one, other) * most_ids + max(one, other)
        place = np.searchsorted(keys, key)
        if place < len(keys) and keys[place] == key:
            continue
        if number < len(found):
            found[number] = key
        number += 1
    return number


@serial
def solid_gaps(joined, row, particles, box, laws):
    """Set h_min of new bridges, from the approach speed of their spheres."""
    for k in range(len(joined.first)):
        i, j = row[joined.first[k]], row[joined.second[k]]
        normal, _, _ = _apart(particles, i, j, box)
        approach = max(dot(minus(at(particles.velocity, i), at(particles.velocity, j)), normal), 0.0)
        radius = reduced(particles.radius[i], particles.radius[j])
        glass = glass_transition(laws.viscosity, approach, laws.transition_pressure, radius, joined.film[k])
        joined.minimum_gap[k] = max(glass, laws.minimum_gap)
