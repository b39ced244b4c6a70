"""The slots of the particle loops: where the laws and constants of a run go (:mod:`cfddem.backend.law_set`).

:meth:`cfddem.particles.interactions.laws.Laws.choices` fills them.
"""

from __future__ import annotations

from typing import NamedTuple

from cfddem.backend.law_set import Slot


class ContactState(NamedTuple):
    """A contact, as the functions of a contact law see it."""

    overlap: float  # > 0 [m]
    gap: float  # [m]
    normal_speed: float  # positive apart [m/s]
    step: float  # [s]
    minimum_gap: float  # [m]
    reduced_radius: float  # R* [m]
    reduced_mass: float  # m* [kg]


class FilmState(NamedTuple):
    """A film, as the functions of a film law see it."""

    gap: float  # [m]
    viscosity: float  # [Pa s]
    reduced_radius: float  # R* [m]
    minimum_gap: float  # h_min [m]
    cutoff_gap: float  # h_co [m]


class BridgeState(NamedTuple):
    """A liquid bridge, as the functions of its laws see it."""

    gap: float  # [m]
    film: float  # d, thickness of the liquid on both bodies together when the bridge formed [m]
    volume: float  # of the liquid in the bridge [m3]
    reduced_radius: float  # R* [m]
    minimum_gap: float  # h_min [m]
    viscosity: float  # [Pa s]
    surface_tension: float  # [N/m]
    contact_angle: float  # [rad]
    capillary_number: float  # of the speed at which the bodies part; in resistances, or meet, and 0 below h_min [-]
    functions: tuple[float, ...]  # parameters of a user's functions, by their names


class GapState(NamedTuple):
    """An approach, as a law of the minimum gap sees it."""

    roughness: float  # [m]
    approach_speed: float  # largest of this collision [m/s]
    viscosity: float  # [Pa s]
    reduced_modulus: float  # E* of the real solids [Pa]
    reduced_radius: float  # R* [m]


# ---------------------------------------------------------------- contact; arguments (contact, row, p, m, d):
# ContactState, row of the pair table, parameters of the law, memory of the pair, derived values

derive = Slot("derive")  # values that several functions of the law share; without the argument d
remember = Slot("remember")  # the memory at this instant
elastic_force = Slot("elastic_force")  # repulsive where positive [N]
contact_overlap = Slot("contact_overlap")  # overlap on which damping and tangential stiffness depend [m]
pull_off = Slot("pull_off")  # largest pull of adhesion [N]
normal_damping = Slot("normal_damping")  # [kg/s]
tangential_stiffness = Slot("tangential_stiffness")  # [N/m]
secant_stiffness = Slot("secant_stiffness")  # force over overlap [N/m]
tangent_stiffness = Slot("tangent_stiffness")  # derivative of the force [N/m]
stored_energy = Slot("stored_energy")  # in the normal spring, below h_min times its share in the load [J]
lost_energy = Slot("lost_energy")  # to hysteresis since the contact began [J]
adhesive_reach = Slot("adhesive_reach")  # gap up to which adhesion holds a contact [m]
read_memory = Slot("read_memory")  # (memory arrays, k) -> tuple of numbers
write_memory = Slot("write_memory")  # (memory arrays, k, tuple, whether the solids touch)

DAMPING_MEAN = Slot("DAMPING_MEAN")  # mean of the damping while the overlap grows from 0, over its last value
ADHESIVE = Slot("ADHESIVE")
RESCALED = Slot("RESCALED")  # the tangential spring is rescaled while the contact is loaded
FROM_OVERLAP = Slot("FROM_OVERLAP")  # friction begins at geometric overlap, not at h_min

# ---------------------------------------------------------------- rolling

ROLLING = Slot("ROLLING")
rolling_torque = Slot("rolling_torque")

# ---------------------------------------------------------------- film; argument FilmState or GapState

FILM = Slot("FILM")
SHEAR = Slot("SHEAR")  # films resist sliding and rolling
TWIST = Slot("TWIST")  # and twisting
DRIFTING = Slot("DRIFTING")  # films act by impulses; else as an explicit force
JOINT = Slot("JOINT")  # there are films that act by impulses, or bridges that resist
SLIDES = Slot("SLIDES")  # these resist sliding
film_resistance = Slot("film_resistance")  # at this gap or h_min, without lever [kg/s]
explicit_resistance = Slot("explicit_resistance")  # with lever; 0 for overlaps and out of reach [kg/s]
speed_after_short_film = Slot("speed_after_short_film")
speed_after_film = Slot("speed_after_film")
film_sliding = Slot("film_sliding")  # (scale, gap, viscosity, R*, h_min, asymmetry): scale times the resistance [kg/s]
user_resistance = Slot("user_resistance")
user_potential = Slot("user_potential")
user_short_potential = Slot("user_short_potential")
POTENTIAL = Slot("POTENTIAL")  # the user's film has a potential
SHORT_POTENTIAL = Slot("SHORT_POTENTIAL")
USER_GAP = Slot("USER_GAP")  # h_min is found by a user's law
user_minimum_gap = Slot("user_minimum_gap")
COUNT_GAP = Slot("COUNT_GAP")  # uses of the law outside of its range are counted
COUNT_FILM = Slot("COUNT_FILM")
gap_outside = Slot("gap_outside")  # 1 where the law is used outside of its range, else 0
film_outside = Slot("film_outside")

# ---------------------------------------------------------------- liquid bridge; argument BridgeState

BRIDGE = Slot("BRIDGE")  # bodies carry liquid, which forms bridges
BRIDGE_RESISTS = Slot("BRIDGE_RESISTS")  # bridges resist along the line of centres or across it
BRIDGE_APART = Slot("BRIDGE_APART")  # closed bridges may resist by themselves
DRYING = Slot("DRYING")  # bridges lose water, and break where none is left
BOND = Slot("BOND")  # and leave solid bonds
BRIDGE_FILM = Slot("BRIDGE_FILM")  # bridges resist along the line of centres
BRIDGE_INERTIA = Slot("BRIDGE_INERTIA")  # films of bridges are reversed with the bodies at contact
BRIDGE_SLIDING = Slot("BRIDGE_SLIDING")  # bridges resist across it
BRIDGE_PULL = Slot("BRIDGE_PULL")  # bridges attract
BRIDGE_POTENTIAL = Slot("BRIDGE_POTENTIAL")  # the resistance along the line of centres has a potential
BRIDGE_ENERGY = Slot("BRIDGE_ENERGY")  # the pull has a closed form of its energy
CUT_CONSTANT = Slot("CUT_CONSTANT")  # below h_min the resistance is that at h_min, not zero
WALL_LIQUID = Slot("WALL_LIQUID")  # walls carry liquid
bridge_resistance = Slot("bridge_resistance")  # along the line of centres [kg/s]
bridge_potential = Slot("bridge_potential")  # its integral over the gap [N s]
sliding_resistance = Slot("sliding_resistance")  # across the line of centres [kg/s]
bridge_pull = Slot("bridge_pull")  # [N]
bridge_energy = Slot("bridge_energy")  # integral of the pull over the gap, from contact [J]
bridge_rupture = Slot("bridge_rupture")  # largest gap of the bridge [m]
drawn_share = Slot("drawn_share")  # (radius, other radius): part of a body's liquid that flows into a new bridge
returned_share = Slot("returned_share")  # (both radii, both contact angles): part of a broken bridge that a body gets

# ---------------------------------------------------------------- loops

TRIANGLES = Slot("TRIANGLES")  # some walls are surfaces of triangles
RECORD = Slot("RECORD")  # collisions are recorded
find_touching = Slot("find_touching")
pack_contacts = Slot("pack_contacts")  # (begin, end, to, system) -> end of the packed
packed_forces = Slot("packed_forces")  # (begin, end, system, step), over packed pairs
pair_forces = Slot("pair_forces")
unpack_contacts = Slot("unpack_contacts")  # (begin, end, system)
update_films = Slot("update_films")
pair_bridges = Slot("pair_bridges")
copy_memory = Slot("copy_memory")  # (memory arrays, from, to)
clear_contact = Slot("clear_contact")  # (memory arrays, k)
