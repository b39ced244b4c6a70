"""The loops over all pairs of particles, which work on several pairs at once.

The compiler does so only where it sees that no two arrays overlap: arrays must come as arguments of the loop, one by
one. `over_pairs` writes such a loop around a function of one pair that takes its arrays in structures.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Collection, Iterable
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.compile import inline, prange, vector_part
from cfddem.backend.law_set import specialise, written
from cfddem.data.fields import Field
from cfddem.particles.interactions.bridge_loops import WetParticles, kept_separation, pair_bridge, pair_bridge_impulse
from cfddem.particles.interactions.contact import contact, contact_state
from cfddem.particles.interactions.film import film_impulse_short, renew_film
from cfddem.particles.interactions.film_law import at_least
from cfddem.particles.interactions.kinematics import sphere_kinematics
from cfddem.particles.interactions.rolling import resist_rolling
from cfddem.particles.interactions.shear_film import pair_shear, renew_shear
from cfddem.particles.interactions.slots import (
    ADHESIVE,
    BRIDGE,
    COUNT_FILM,
    FILM,
    ROLLING,
    SHEAR,
    FilmState,
    adhesive_reach,
    film_outside,
    read_memory,
    write_memory,
)
from cfddem.particles.pair_graph import memory_class, of_two_spheres
from cfddem.particles.vectors import NOTHING, at, dot, minus, put, times

PairParticles = namedtuple("PairParticles", "position velocity spin radius inverse_mass material viscosity film_rate")
"""Arrays of the particles that loops over pairs read."""

ShearParticles = namedtuple("ShearParticles", "velocity spin radius viscosity slip_rate turn_rate")
"""The same of the loop over films that resist sliding."""

FarParticles = namedtuple("FarParticles", "velocity radius viscosity far_rate")
"""The same of the loop over films of pairs that cannot touch."""

PairEnds = namedtuple("PairEnds", "first second image")
"""Arrays of the graph that loops over pairs read."""


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
def pair_force(n, particles, edges, memory, shift, rows, kinds, cutoff_ratio, p, free, step):
    """Film and contact of one pair of particles."""
    k = np.uint64(n)
    i, j = edges.first[k], edges.second[k]
    apart = kept_separation(k, particles, edges, memory) if BRIDGE else of_two_spheres(k, particles, edges, shift)
    kinematics = sphere_kinematics(k, apart, particles, edges, free)
    row = rows[np.uint64(particles.material[i]) * kinds + np.uint64(particles.material[j])]
    if FILM:
        viscosity = 0.5 * (particles.viscosity[i] + particles.viscosity[j])
        renew_film(k, kinematics.gap, viscosity, kinematics.reduced_radius, 1.0, memory, row, cutoff_ratio)
        keep_geometry(k, kinematics.separation, kinematics.distance, kinematics.gap, memory)
        if SHEAR:
            asymmetry = (particles.radius[i] - particles.radius[j]) * kinematics.inverse_sum
            renew_shear(k, kinematics.gap, viscosity, kinematics.reduced_radius, asymmetry, 1.0, memory)
    edge_contact(k, kinematics, row, 1.0, memory, p, step)


@inline
def pair_film(n, particles, edges, memory, shift, rows, kinds, cutoff_ratio):
    """Film of one pair of particles that cannot touch."""
    k = np.uint64(n)
    i, j = edges.first[k], edges.second[k]
    separation, distance, radii = of_two_spheres(k, particles, edges, shift)
    gap = distance - radii
    reduced_radius = particles.radius[i] * particles.radius[j] / radii
    row = rows[np.uint64(particles.material[i]) * kinds + np.uint64(particles.material[j])]
    viscosity = 0.5 * (particles.viscosity[i] + particles.viscosity[j])
    renew_film(k, gap, viscosity, reduced_radius, 1.0, memory, row, cutoff_ratio)
    keep_geometry(k, separation, distance, gap, memory)
    if SHEAR:
        asymmetry = (particles.radius[i] - particles.radius[j]) / radii
        renew_shear(k, gap, viscosity, reduced_radius, asymmetry, 1.0, memory)


@inline
def keep_geometry(k, separation, distance, gap, memory):
    """Keep gap and direction of a pair for the impulse of its film, which acts at the same positions."""
    memory.film_gap[k] = gap
    put(memory.film_normal, k, times(1.0 / distance, separation))


@inline
def pair_impulse(n, particles, edges, memory, cutoff_ratio, step):
    """Impulse of the film of one pair of particles."""
    impulse_of_pair(np.uint64(n), particles, particles.film_rate, edges, memory, cutoff_ratio, False, step)


@inline
def far_impulse(n, particles, edges, memory, cutoff_ratio, step):
    """The same of one pair that cannot touch, where its film acts once in several steps."""
    impulse_of_pair(np.uint64(n), particles, particles.far_rate, edges, memory, cutoff_ratio, True, step)


@inline
def impulse_of_pair(k, particles, rates, edges, memory, cutoff_ratio, far, step):
    """Impulse of the film of edge k; `rates` are the resistances of films over the mass that share out the mass."""
    i, j = edges.first[k], edges.second[k]
    normal, gap = at(memory.film_normal, k), memory.film_gap[k]
    reduced_radius = particles.radius[i] * particles.radius[j] / (particles.radius[i] + particles.radius[j])
    speed = dot(minus(at(particles.velocity, i), at(particles.velocity, j)), normal)
    viscosity = 0.5 * (particles.viscosity[i] + particles.viscosity[j])
    film = FilmState(gap, viscosity, reduced_radius, memory.minimum_gap[k], cutoff_ratio * reduced_radius)
    then = (memory.resistance[k], memory.approach_speed[k], memory.accounted_gap[k])
    rate = rates[i] + rates[j]
    size, given, left = film_impulse_short(speed, film, rate, then, far, step)
    if COUNT_FILM:
        memory.outside[k] += film_outside(at_least(film)) if then[0] > 0.0 and not left else 0
    memory.accounted_gap[k] = given
    memory.hard[k] = left
    put(memory.impulse, k, times(size, normal))


class PairLoop(NamedTuple):
    """A loop over pairs."""

    body: Callable[..., Any]  # function of one pair
    rest: str  # what it takes beside the arrays
    particles: Any = PairParticles  # arrays of the particles that it reads
    needed_by: str = ""  # choice without which a run has no such loop


LOOPS: dict[str, PairLoop] = {
    "pair_forces": PairLoop(pair_force, "shift, rows, kinds, cutoff_ratio, p, free, step"),
    "update_films": PairLoop(pair_film, "shift, rows, kinds, cutoff_ratio", needed_by="FILM"),
    "film_impulses": PairLoop(pair_impulse, "cutoff_ratio, step", needed_by="FILM"),
    "far_impulses": PairLoop(far_impulse, "cutoff_ratio, step", FarParticles, "FAR"),
    "shear_impulses": PairLoop(pair_shear, "step", ShearParticles, "SHEAR"),
    "pair_bridges": PairLoop(pair_bridge, "shift, p", WetParticles, "BRIDGE"),
    "bridge_impulses": PairLoop(pair_bridge_impulse, "step", WetParticles, "BRIDGE"),
}
"""Slot -> loop over pairs."""


def loop_choices(fields: Iterable[Field], choices: dict[str, Any], kept_apart: Collection[str]) -> dict[str, Any]:
    """What goes into the slots of the loops over pairs that carry these fields.

    kept_apart  fields that inactive triangles do not take over
    """
    fields = list(fields)
    names = tuple(each.name for each in fields)
    loops = {slot: over_pairs(specialise(loop.body, choices), names, loop.rest, loop.particles)
             for slot, loop in LOOPS.items() if choices.get(loop.needed_by, True)}  # fmt: skip
    lines = ["put(memory.{0}, to, at(memory.{0}, k))" if each.components else "memory.{0}[to] = memory.{0}[k]"
             for each in fields]  # fmt: skip
    copied = [line.format(each.name) for line, each in zip(lines, fields)
              if each.role == "memory" and each.name not in kept_apart]  # fmt: skip
    return {
        **loops,
        "copy_memory": written("def copy_memory(memory, k, to):\n    " + "\n    ".join(copied) + "\n", put=put, at=at),
        "clear_contact": specialise(_clear_contact, choices),
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


def over_pairs(body: Any, names: tuple[str, ...], rest: str, particles: Any = PairParticles) -> Any:
    """A loop `(begin, end, particles, edges, memory, rest)` over pairs, with each array an argument of its own.

    body       (n, particles, edges, memory, rest), compiled by `inline`
    names      of the fields of a pair
    rest       further arguments
    particles  arrays of the particles that the body reads
    """
    structures = {"particles": particles, "edges": PairEnds, "memory": memory_class(names)}
    arrays = {name: [f"{name}_{each}" for each in made._fields] for name, made in structures.items()}
    every = ", ".join(each for some in arrays.values() for each in some)
    rebuilt = ", ".join(f"{name}_of({', '.join(some)})" for name, some in arrays.items())
    given = ", ".join(f"{name}.{each}" for name, made in structures.items() for each in made._fields)
    classes = {f"{name}_of": made for name, made in structures.items()}
    loop = (
        f"def over_pairs(begin, end, {every}, {rest}):\n"
        f"    for n in prange(begin, end):\n"
        f"        body(n, {rebuilt}, {rest})\n"
    )
    call = f"def call(begin, end, particles, edges, memory, {rest}):\n    over_pairs(begin, end, {given}, {rest})\n"
    return written(call, over_pairs=written(loop, vector_part, body=body, prange=prange, **classes))
