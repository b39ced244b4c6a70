"""The loops over all pairs of particles, which work on several pairs at once.

The compiler does so only where it sees that no two arrays overlap: arrays must come as arguments of the loop, one by
one. `over_pairs` writes such a loop around a function of one pair that takes its arrays in structures.

Of the listed pairs of a loose bed few touch. A short loop finds those whose contacts are to be renewed, as the bodies
touch, or did at the last step. What these remember is packed, the loop over contacts runs over the packed pairs, and
its results go back to their places: some hundred pairs at a time, which stay in the cache meanwhile. Where most pairs
touch, the same loop runs over them as they are, and whether they still do is asked from time to time.
"""

from __future__ import annotations

import math
import re
from collections import namedtuple
from collections.abc import Callable, Collection, Iterable
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, kept_whole, prange, vector_part, vector_piece
from cfddem.backend.law_set import compile_source, specialise
from cfddem.backend.named import named_arrays
from cfddem.model.fields import Field
from cfddem.particles.interactions.bond import SMALLEST_GAP, dried, thinnest_film
from cfddem.particles.interactions.bridge import bridge_state
from cfddem.particles.interactions.bridge_apart import resist_apart
from cfddem.particles.interactions.bridge_solution import held_gap
from cfddem.particles.interactions.contact import contact, contact_state, resist_rolling
from cfddem.particles.interactions.film import renew_film
from cfddem.particles.interactions.kinematics import sphere_kinematics
from cfddem.particles.interactions.shear_film import pair_arms, renew_shear, slip_and_roll
from cfddem.particles.interactions.slots import (
    ADHESIVE,
    BRIDGE,
    BRIDGE_APART,
    BRIDGE_PULL,
    DRIFTING,
    DRYING,
    FILM,
    ROLLING,
    SHEAR,
    adhesive_reach,
    bridge_pull,
    read_memory,
    write_memory,
)
from cfddem.particles.pair_graph import of_two_spheres
from cfddem.particles.system import PairSystem, Parameters
from cfddem.particles.vectors import NOTHING, at, minus, plus, put, times

PairParticles = namedtuple("PairParticles", "position velocity spin radius inverse_mass material viscosity")
"""Arrays of the particles that loops over pairs read."""

PairEnds = namedtuple("PairEnds", "first second image")
"""Arrays of the graph that loops over pairs read."""

PIECE = 512
"""Listed pairs of which those that touch are packed at a time."""

FEW, REST = 0.6, 16
"""Share of pairs that touch below which these are packed, and steps until more pairs than that are asked again."""


@inline
def edge_contact(k, kinematics, row, share, memory, p, step):
    """Contact, friction and rolling of one edge, from its kinematics.

    share  part of the contact that belongs to this edge: below 1 where triangles of a mesh share one
    """
    separated = memory.minimum_gap[k]
    m = read_memory(memory, k)
    push, turn, spring, m, d = contact(kinematics, row, separated, at(memory.spring, k), m, p, step)
    state = contact_state(kinematics, separated, step)
    touching = kinematics.gap < separated
    if ADHESIVE:
        memory.minimum_gap[k] = adhesive_reach(state, row, p, m, d) if touching else 0.0
    if ROLLING:
        moment, roll = resist_rolling(kinematics, state, row, push, at(memory.roll, k), p, m, d)
        put(memory.moment, k, times(share, moment))
        put(memory.roll, k, roll)
    put(memory.force, k, times(share, push))
    put(memory.couple, k, times(share, turn))
    put(memory.spring, k, spring)
    write_memory(memory, k, m, touching)


@inline
def _apart(k, system):
    """Separation of a pair, its length, and the sum of the radii."""
    return kept_separation(k, system) if BRIDGE else of_two_spheres(k, system.particles, system.edges, system.shift)


@inline
def pair_touches(n, system):
    """Note whether the solids of one pair of particles touch, and whether they did at the last step."""
    memory, k = system.memory, np.uint64(n)
    if DRIFTING:
        gap = memory.film_gap[k]  # the loop over films has found it
    else:
        _, distance, radii = _apart(k, system)
        gap = distance - radii
    touches = 1 if gap < memory.minimum_gap[k] else 0
    if FILM and not DRIFTING:  # the force of the film has been added to that of the contact
        touches = 1
    memory.touching[k] = 2 * (memory.touching[k] & 1) + touches


@inline
def pair_force(n, system, step):
    """Contact of one pair of particles."""
    memory, p = system.memory, system.parameters
    k = np.uint64(n)
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    kinematics = sphere_kinematics(k, _apart(k, system), system)
    row = system.rows[np.uint64(particles.material[i]) * system.kinds + np.uint64(particles.material[j])]
    edge_contact(k, kinematics, row, 1.0, memory, p, step)


@inline
def pair_film(n, system, step):
    """Film of one pair of particles."""
    memory, k = system.memory, np.uint64(n)
    particles, edges = system.particles, system.edges
    i, j, radius = edges.first[k], edges.second[k], particles.radius
    separation, distance, radii = of_two_spheres(k, particles, edges, system.shift)
    gap, reduced_radius = distance - radii, radius[i] * radius[j] / radii
    row = system.rows[np.uint64(particles.material[i]) * system.kinds + np.uint64(particles.material[j])]
    viscosity = 0.5 * (particles.viscosity[i] + particles.viscosity[j])
    size = (reduced_radius, particles.inverse_mass[i] + particles.inverse_mass[j])
    normal = renew_film(k, (separation, distance, gap), viscosity, size, 1.0, system, row, step)
    if SHEAR:
        asymmetry, arms = (radius[i] - radius[j]) / radii, pair_arms(i, j, radius, gap)
        velocity = minus(at(particles.velocity, i), at(particles.velocity, j))
        slip, roll = slip_and_roll(velocity, at(particles.spin, i), at(particles.spin, j), normal, arms)
        renew_shear(k, normal, (viscosity, reduced_radius, asymmetry, 1.0), (slip, roll, arms), memory, step)


# ---------------------------------------------------------------- bridges of pairs
#
# The bridge of one pair of particles, without branches: for the loops that work on several pairs at once.
#
# Most bridges of a bed are closed: their gap is below h_min, where resistances do not depend on it. Loops over single
# edges treat the others, which are open (:mod:`~cfddem.particles.interactions.bridge_changes`).


WetParticles = namedtuple("WetParticles", "position radius film_thickness velocity spin inverse_mass bridge_load")
"""Arrays of the particles that loops over bridges read."""


@inline
def kept_separation(k, system):
    """Separation of a pair at the present positions, its length, and the sum of the radii."""
    particles, edges, memory = system.particles, system.edges, system.memory
    radii = particles.radius[edges.first[k]] + particles.radius[edges.second[k]]
    return at(memory.bridge_separation, k), memory.bridge_distance[k], radii


@inline
def pair_bridge(n, system, step):
    """Force of the bridge of a pair, its resistance if it is closed, and whether one forms.

    step  since the last positions; 0 if these are the same [s]
    """
    particles, edges, memory, shift, p = system.particles, system.edges, system.memory, system.shift, system.parameters
    k = np.uint64(n)
    i, j = edges.first[k], edges.second[k]
    separation, distance, radii = of_two_spheres(k, particles, edges, shift)
    put(memory.bridge_separation, k, separation)
    memory.bridge_distance[k] = distance
    gap, reduced_radius = distance - radii, particles.radius[i] * particles.radius[j] / radii
    state = bridge_state(k, gap, reduced_radius, memory, p)
    film = particles.film_thickness[i] + particles.film_thickness[j]
    bridged = memory.bridge_film[k] > 0.0
    floor = held_gap(state)
    closed = gap < floor
    thinnest = SMALLEST_GAP
    if DRYING:
        thinnest = max(thinnest, thinnest_film(reduced_radius, p.bridge.minimum_gap))
    forms = (not bridged) & (film > thinnest) & (gap < film)  # dry solids overlap without a bridge
    memory.bridge_change[k] = 1 if forms else 0
    memory.bridge_open[k] = bridged & (not closed)
    if DRYING:
        memory.bridge_open[k] = bridged & ((not closed) | dried(k, reduced_radius, memory))
    memory.bridge_resistance[k] = memory.closed_along[k] + memory.closed_across[k] if bridged & closed else 0.0
    force = NOTHING
    if BRIDGE_PULL:
        pull = bridge_pull(state)
        force = times(-pull / distance if bridged else 0.0, separation)
    if BRIDGE_APART:
        lasts = bridged & closed
        if DRYING:
            lasts = bridged & (not memory.bridge_open[k])
        between = (times(1.0 / distance, separation), distance, gap)
        force = plus(force, resist_apart(k, between, lasts, floor, system, step))
    if BRIDGE_PULL or BRIDGE_APART:
        put(memory.bridge_force, k, force)


# ---------------------------------------------------------------- loops


class PairLoop(NamedTuple):
    """A loop over pairs."""

    body: Callable[..., Any]  # function of one pair: (n, system) and the rest
    rest: str = "step"  # what it takes beside the system
    particles: Any = PairParticles  # arrays of the particles that it reads
    needed_by: str = ""  # choice without which a run has no such loop
    how: Any = vector_part  # it is compiled
    twin: str = ""  # slot of the same loop over packed pairs


LOOPS: dict[str, PairLoop] = {
    "find_touching": PairLoop(pair_touches, rest="", how=vector_piece),
    "pair_forces": PairLoop(pair_force, how=vector_piece, twin="packed_forces"),
    "update_films": PairLoop(pair_film, needed_by="FILM"),
    "pair_bridges": PairLoop(pair_bridge, particles=WetParticles, needed_by="BRIDGE"),
}
"""Slot -> loop over pairs."""

PLACES = ("bridge_separation", "bridge_distance")
"""Fields of the present positions, where a loop before that over contacts has found them."""

WRITTEN = ("force", "couple", "moment")
"""Fields of a contact that are written anew without being read."""


def loop_choices(
    fields: Iterable[Field],
    packed: PackedFields,
    choices: dict[str, Any],
    kept_apart: Collection[str],
    parameters: Parameters,
) -> dict[str, Any]:
    """What goes into the slots of the loops over pairs that carry these fields.

    packed      what is packed for contacts
    kept_apart  fields that inactive triangles do not take over
    parameters  of the run; their names count
    """
    fields = list(fields)
    memory = named_arrays("Memory", tuple(field.name for field in fields))
    loops: dict[str, Any] = {}
    for slot, loop in LOOPS.items():
        if choices.get(loop.needed_by, True):
            arrays = packed.memory if loop.twin else memory
            loops |= over_pairs(slot, loop, specialise(loop.body, choices), arrays, parameters)
    copied = [_copied(field, "memory", "to", "memory", "k")
              for field in fields if field.role == "memory" and field.name not in kept_apart]  # fmt: skip
    return {
        **loops,
        **packed.loops(),
        "copy_memory": compile_source(
            "def copy_memory(memory, k, to):\n    " + "\n    ".join(copied) + "\n", put=put, at=at
        ),
        "clear_contact": specialise(_clear_contact, choices),
    }


def _copied(field: Field, to: str, row: str, source: str, k: str) -> str:
    """The line of a loop that copies the value of a field."""
    if field.components:
        return f"put({to}.{field.name}, {row}, at({source}.{field.name}, {k}))"
    return f"{to}.{field.name}[{row}] = {source}.{field.name}[{k}]"


class PackedFields(NamedTuple):
    """What is packed of the pairs that touch."""

    contact: list[Field]  # of the contact
    geometry: list[Field]  # what loops before have found, and the contact reads

    @property
    def memory(self) -> Any:
        """The class of the arrays of pairs that the loop over contacts takes."""
        return named_arrays("Memory", tuple(field.name for field in (*self.contact, *self.geometry)))

    def room(self) -> Any:
        """Arrays for a piece of the pairs of each chunk: "row" in the list, ends, and fields; "wait" of each piece."""
        number, fields = CHUNKS * (PIECE + 1), (*self.contact, *self.geometry)
        kinds = {"row": np.uint32, "first": np.uint32, "second": np.uint32, "image": np.uint8, "wait": np.uint8}
        arrays = {name: np.empty(number, kind) for name, kind in kinds.items()}
        arrays |= {field.name: np.empty(number * math.prod(field.shape), field.dtype) for field in fields}
        return named_arrays("Memory", tuple(arrays))(**arrays)

    def loops(self) -> dict[str, Any]:
        """Loops that pack contacts, and that bring them back."""
        read = [field for field in self.contact if field.name not in WRITTEN] + self.geometry
        ends = [f"packed.{name}[n] = edges.{name}[k]" for name in PairEnds._fields]
        taken = [*ends, *(_copied(field, "packed", "n", "memory", "k") for field in read)]
        returned = [_copied(field, "memory", "k", "packed", "n") for field in self.contact]
        pack = (
            "def pack_contacts(begin, end, to, system):\n"
            "    edges, memory, packed, last = system.edges, system.memory, system.packed, to\n"
            "    for k in range(begin, end):\n"
            "        packed.row[last] = k\n"
            "        last += 1 if memory.touching[k] != 0 else 0\n"
            "    for n in range(to, last):\n"
            "        k = packed.row[n]\n        " + "\n        ".join(taken) + "\n"
            "    return last\n"
        )
        unpack = (
            "def unpack_contacts(begin, end, system):\n"
            "    memory, packed = system.memory, system.packed\n"
            "    for n in range(begin, end):\n"
            "        k = packed.row[n]\n        " + "\n        ".join(returned) + "\n"
        )
        return {
            "pack_contacts": compile_source(pack, put=put, at=at),
            "unpack_contacts": compile_source(unpack, put=put, at=at),
        }


@inline
def _clear_contact(memory, k):
    """Forget what a contact remembered that has ended."""
    put(memory.spring, k, NOTHING)
    if ROLLING:
        put(memory.roll, k, NOTHING)
    if ADHESIVE:
        memory.minimum_gap[k] = 0.0
    write_memory(memory, k, read_memory(memory, k), False)


def over_pairs(slot: str, of: PairLoop, body: Any, memory: Any, parameters: Parameters) -> dict[str, Any]:
    """A loop `(begin, end, system, rest)` over pairs, with each array and number an argument of its own.

    slot     of the loop
    of       what it takes
    body     (n, system, rest), compiled by `inline`, where the system is a `PairSystem`
    memory   arrays of the pairs
    returns  slot -> loop; also for packed pairs, which is the same machine code
    """
    arrays = {name: kind(*kind._fields) for name, kind in
              (("particles", of.particles), ("edges", PairEnds), ("memory", memory))}  # fmt: skip
    system = PairSystem(**arrays, shift="shift", rows="rows", kinds="kinds", parameters=parameters)  # type: ignore[arg-type]
    structures: dict[str, Any] = {}
    rebuilt = _rebuilt(system, "system", structures)
    places = _places(system, "system")
    names = ", ".join(place.replace(".", "_") for place in places)
    more = f", {of.rest}" if of.rest else ""
    loop = (
        f"def over_pairs(begin, end, {names}{more}):\n"
        f"    kept_whole()\n"
        f"    for n in prange(begin, end):\n"
        f"        body(n, {rebuilt}{more})\n"
    )
    made_loop = compile_source(loop, of.how, body=body, prange=prange, kept_whole=kept_whole, **structures)
    arguments = ", ".join({"system.rows": "rows", "system.kinds": "kinds"}.get(place, place) for place in places)
    calls = {slot: arguments}
    if of.twin:
        calls[of.twin] = re.sub(r"system\.(edges|memory)\.", "system.packed.", arguments)
    call = (
        f"def call(begin, end, system{more}):\n"
        f"    kinds, rows = uint64(len(system.table)), system.table.reshape(-1)\n"
        f"    over_pairs(begin, end, {{}}{more})\n"
    )
    return {
        name: compile_source(call.format(taken), over_pairs=made_loop, uint64=np.uint64)
        for name, taken in calls.items()
    }


def _places(value: Any, place: str) -> list[str]:
    """Where the arrays and numbers of a structure of structures are."""
    if not hasattr(value, "_fields"):
        return [place]
    return [inner for name, member in zip(value._fields, value) for inner in _places(member, f"{place}.{name}")]


def _rebuilt(value: Any, place: str, structures: dict[str, Any]) -> str:
    """The structure, made of arguments that are named after their places; collects the classes that it needs."""
    if not hasattr(value, "_fields"):
        return place.replace(".", "_")
    name = f"{place.replace('.', '_')}_of"
    structures[name] = type(value)
    inner = [_rebuilt(content, f"{place}.{member}", structures) for member, content in zip(value._fields, value)]
    return f"{name}({', '.join(inner)})"
