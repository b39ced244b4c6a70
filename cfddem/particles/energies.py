"""Energy of the particles by channel: what springs hold, and what every force has done since the counting began.

A force at an instant moves its bodies over the half kick before and the half kick after it. The mean velocity of a
half kick is known, so that its work is what the kinetic energy gains, to round-off; the impulse of a film likewise.
What springs hold is taken from where the bodies are. The two meet to the accuracy of the motion in time.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cfddem.errors import InputError
from cfddem.kernels import CHUNKS, inline, prange, threaded
from cfddem.particles.forces import LINEAR, NOTHING, RESCALED, VERLET, pair_mass_and_radius, pair_row
from cfddem.particles.pairs import ENTRY, LOST, geometry
from cfddem.particles.state import kinetic_energy
from cfddem.particles.surfaces import SURFACE, portion, touched
from cfddem.particles.vectors import across, at, cross, dot, flat, minus, plus, put, times
from closures.blend import contact_share
from closures.contact import hertz_force, hertz_stiffness, mindlin_stiffness, spring_energy
from closures.friction import coulomb_limit, dry_or_lubricated

if TYPE_CHECKING:
    from cfddem.particles.solver import ParticleSolver

FILM, DAMPING, FRICTION, ROLLING, WALLS, STIFFENING, FALL = range(7)
CHANNELS = ("film", "contact_damping", "friction", "rolling", "walls", "stiffening", "fall")
"""What is counted: energy lost to films, dashpots, sliding and rolling; gained from moving walls, from tangential
springs that grow stiffer or softer with the overlap, and from gravity."""

ALMOST = 1.0 - 1e-9
"""A contact slides where its pull is Coulomb's limit, to rounding."""


class Count(NamedTuple):
    """What the count remembers from one step to the next, as compiled loops take it."""

    ahead: np.ndarray  # (N, 3) velocity after the first half kick of the step [m/s]
    way: np.ndarray  # (N, 3) of the kicks around this instant [m]
    turn: np.ndarray  # (N, 3) likewise [rad]
    path: np.ndarray  # (N, 3) way that the particle has drifted in the step [m]
    spring: np.ndarray  # (n,) square of the tangential spring [m2]
    stiffness: np.ndarray  # (n,) of it, times the share that the solids have in the load [N/m]
    power: np.ndarray  # (n,) that goes into it [W]
    held: np.ndarray  # (n,) energy of the normal spring [J]
    totals: np.ndarray  # (CHUNKS, channels) [J]


class Switches(NamedTuple):
    """What the count must know of :class:`cfddem.particles.forces.Laws`."""

    film: bool
    linear: bool
    rescaled: bool
    rolling: bool
    normal_stiffness: float  # of the linear contact [N/m]
    tangential_stiffness: float  # of the linear contact [N/m]


class Energies:
    """The energy account of a particle solver.

    totals  energy of each of `CHANNELS` since the count began [J]
    way     along which the forces on each particle have acted in the last `advance`, by id (n, 3) [m]
    path    along which it has drifted meanwhile; the same but for the impulses of films (n, 3) [m]
    """

    def __init__(self, solver: ParticleSolver) -> None:
        laws = solver.laws
        if laws.cohesion:
            raise InputError("energies", None, "a run without cohesion", "the energy of adhesion is not counted")
        if laws.film and laws.integrator == VERLET:
            raise InputError("energies", None, "films in the lubricated drift", "that of plain Verlet is not counted")
        self._switches = Switches(
            bool(laws.film), laws.contact == LINEAR, laws.spring == RESCALED, bool(laws.rolling),
            laws.normal_stiffness, laws.tangential_stiffness,
        )  # fmt: skip
        self.totals = np.zeros(len(CHANNELS))
        self.fed = 0.0  # energy that particles brought with them, less what those taken out had [J]
        self.way = self.path = np.zeros((0, 3))
        self._edges: Any = None
        self._count: Any = None

    def before(self, solver: ParticleSolver, step: float, first: bool) -> None:
        """Before a step [s]; `first` of an advance, in which the forces at hand begin to act."""
        if first:
            self.way, self.path = np.zeros((2, int(solver.bodies.id.max(initial=-1)) + 1, 3))
        if first or self._edges is not solver.edges:
            self._count = _room(solver) if self._edges is not solver.edges else self._count
            self._edges = solver.edges
            self._pass(solver, 0.0, 0.0, 0.5 * step if first else 0.0)
        bodies = solver.bodies
        self._count.ahead[:] = bodies.velocity + (0.5 * step * bodies.inverse_mass)[:, None] * bodies.force

    def after(self, solver: ParticleSolver, step: float, last: bool) -> None:
        """After a step [s]; `last` of an advance."""
        self._pass(solver, step, 0.5 * step, 0.0 if last else 0.5 * step)

    def springs(self, solver: ParticleSolver) -> tuple[float, float]:
        """Energy of the normal and of the tangential springs [J]."""
        if self._edges is not solver.edges:
            self._edges, self._count = solver.edges, _room(solver)
            self._pass(solver, 0.0, 0.0, 0.0)
        return float(self._count.held.sum()), 0.5 * float((self._count.stiffness * self._count.spring).sum())

    def mechanical(self, solver: ParticleSolver) -> float:
        """Kinetic energy and that of the springs [J]."""
        return kinetic_energy(solver.bodies) + sum(self.springs(solver))

    def checkpoint(self) -> dict[str, Any]:
        """What has been counted."""
        return {"totals": self.totals.copy(), "fed": self.fed}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a `checkpoint()`."""
        self.totals, self.fed = np.array(state["totals"]), float(state["fed"])
        self._edges = None

    def _pass(self, solver: ParticleSolver, step: float, before: float, after: float) -> None:
        bodies, edges, walls, shift = solver.views
        count = flat(self._count._replace(totals=None))._replace(totals=self._count.totals)
        count.totals[:] = 0.0
        gravity = np.array(solver.gravity, float)
        _ways(bodies, count, gravity, np.array(solver.free, float), step, before, after)
        _work(bodies, edges, walls, count, shift, solver.table, self._switches, step, before, after)
        self.totals += count.totals.sum(axis=0)
        if before + after > 0.0:
            self.way[solver.bodies.id] += self._count.way
        if step > 0.0:
            self.path[solver.bodies.id] += self._count.path


def _room(solver: ParticleSolver) -> Count:
    number, count = len(solver.edges.first), solver.bodies.count
    ahead, way, turn, path = np.zeros((4, count, 3))
    spring, stiffness, power, held = np.zeros((4, number))
    return Count(ahead, way, turn, path, spring, stiffness, power, held, np.zeros((CHUNKS, len(CHANNELS))))


@threaded
def _ways(bodies, count, gravity, free, step, before, after):
    """How far each particle is moved in the half kicks around this instant; what it has fallen in the step."""
    number = len(bodies.radius)
    for chunk in prange(CHUNKS):
        totals = count.totals[chunk]
        for i in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            gain = 0.5 * (after * after - before * before)
            force, torque = at(bodies.force, i), at(bodies.torque, i)
            way = plus(times(before + after, at(bodies.velocity, i)), times(gain * bodies.inverse_mass[i], force))
            put(count.way, i, way)
            turn = plus(times(before + after, at(bodies.spin, i)), times(gain * bodies.inverse_inertia[i], torque))
            put(count.turn, i, turn)
            if step > 0.0 and bodies.inverse_mass[i] > 0.0:
                drifted = minus(at(bodies.velocity, i), times(0.5 * step * bodies.inverse_mass[i], force))
                drifted = (free[0] * drifted[0], free[1] * drifted[1], free[2] * drifted[2])
                put(count.path, i, times(step, drifted))
                totals[FALL] += step / bodies.inverse_mass[i] * dot(gravity, drifted)
            elif step > 0.0:
                put(count.ahead, i, at(bodies.velocity, i))


@inline
def _note(k, edges, channel, lost):
    """Add what edge k has lost to its encounter, where one is recorded; its columns are the first three channels."""
    if len(edges.entry) > 0 and not np.isnan(edges.entry[ENTRY * k]):
        begin = ENTRY * k + LOST
        if np.isnan(edges.entry[begin]):
            for each in range(3):
                edges.entry[begin + each] = 0.0
        edges.entry[begin + channel] += lost


@inline
def _film_works(k, bodies, edges, count, step):
    """Energy that the film of edge k has taken in the step, and that a moving wall has put in through it."""
    i, j = edges.first[k], edges.second[k]
    impulse = at(edges.impulse, k)
    drifted = minus(at(bodies.velocity, i), times(0.5 * step * bodies.inverse_mass[i], at(bodies.force, i)))
    speed = times(0.5, plus(at(count.ahead, i), drifted))
    if k < edges.between_particles:
        drifted = minus(at(bodies.velocity, j), times(0.5 * step * bodies.inverse_mass[j], at(bodies.force, j)))
        other, by_wall = times(0.5, plus(at(count.ahead, j), drifted)), 0.0
    else:
        other = touched(edges, k, SURFACE)
        by_wall = dot(impulse, other)
    return -dot(impulse, minus(speed, other)), by_wall


@inline
def _stiffnesses(k, gap, bodies, edges, walls, table, laws):
    """Normal spring of a contact: stiffness and power; tangential stiffness; overlap and the share of the solids."""
    row = pair_row(k, bodies, edges, walls, table)
    reduced_radius, _ = pair_mass_and_radius(k, bodies, edges)
    overlap = edges.minimum_gap[k] - gap
    share = portion(edges, k) * (contact_share(gap, edges.minimum_gap[k]) if laws.film else 1.0)
    if laws.linear:
        return laws.normal_stiffness, 1.0, laws.tangential_stiffness, overlap, share
    tangential = mindlin_stiffness(row.shear_modulus, reduced_radius, overlap)
    return hertz_stiffness(row.contact_modulus, reduced_radius), 1.5, tangential, overlap, share


@inline
def _forget(k, count, totals, step):
    """A contact that has ended takes what its tangential spring held with it."""
    totals[STIFFENING] -= 0.5 * count.stiffness[k] * count.spring[k] if step > 0.0 else 0.0
    count.spring[k] = 0.0
    count.stiffness[k] = 0.0
    count.power[k] = 0.0
    count.held[k] = 0.0


@inline
def _moved(k, bodies, edges, walls, count, duration):
    """What the forces at hand act along: way, turn times radius and turn of the first body against the second.

    Then the rates of the first two, the sum of the radii, and the way of a wall.
    """
    i, j = edges.first[k], edges.second[k]
    about = at(count.turn, i)
    way, turn = at(count.way, i), times(bodies.radius[i], about)
    velocity, surface_spin = at(bodies.velocity, i), times(bodies.radius[i], at(bodies.spin, i))
    if k < edges.between_particles:
        own = bodies.radius[j]
        other = at(count.turn, j)
        way, turn = minus(way, at(count.way, j)), plus(turn, times(own, other))
        velocity = minus(velocity, at(bodies.velocity, j))
        surface_spin = plus(surface_spin, times(own, at(bodies.spin, j)))
        return way, turn, minus(about, other), velocity, surface_spin, bodies.radius[i] + own, NOTHING
    surface = touched(edges, k, SURFACE)
    by_wall = times(duration, surface)
    about = minus(about, times(duration, at(walls.spin, walls.wall[j])))
    return minus(way, by_wall), turn, about, minus(velocity, surface), surface_spin, bodies.radius[i], by_wall


@inline
def _slides(k, bodies, edges, walls, table, laws, pressed, tangent):
    """Whether the contact of edge k is at Coulomb's limit."""
    row = pair_row(k, bodies, edges, walls, table)
    friction = row.friction
    if laws.film:
        held = edges.minimum_gap[k]
        friction = dry_or_lubricated(held, row.roughness_gap, row.friction, row.friction_lubricated)
    return math.sqrt(dot(tangent, tangent)) >= ALMOST * coulomb_limit(friction, pressed)


@inline
def _contact_works(k, gap, separation, distance, bodies, edges, walls, count, table, laws, step, duration, totals):
    """Count what the contact of edge k has done, and keep what its springs hold."""
    normal = times(1.0 / distance, separation)
    stiffness, power, tangential, overlap, share = _stiffnesses(k, gap, bodies, edges, walls, table, laws)
    tangential *= share
    elastic = share * (hertz_force(stiffness, overlap) if power == 1.5 else stiffness * overlap)
    force, spring = at(edges.force, k), at(edges.spring, k)
    way, turn, about, velocity, surface_spin, radii, by_wall = _moved(k, bodies, edges, walls, count, duration)
    stretch = distance / radii
    pressed, approach = dot(force, normal), dot(way, normal)
    slip = minus(across(velocity, normal), times(stretch, cross(surface_spin, normal)))
    slid = minus(across(way, normal), times(stretch, cross(turn, normal)))
    pulled = dot(force, way) + dot(at(edges.couple, k), turn) - pressed * approach

    totals[WALLS] += dot(force, by_wall)
    damped = (elastic - pressed) * approach - pulled - tangential * dot(spring, slid)
    totals[DAMPING] += damped
    _note(k, edges, DAMPING, damped)
    if laws.rolling:
        totals[ROLLING] -= dot(at(edges.moment, k), about)
    square, rate = dot(spring, spring), tangential * dot(spring, slip)
    if step > 0.0:
        softer, was = count.stiffness[k], count.spring[k]
        kept = was * softer / tangential if laws.rescaled and tangential > softer else was
        taken = 0.25 * (softer + tangential) * (square - kept)
        totals[STIFFENING] += 0.5 * (tangential * square - softer * was) - taken
        if _slides(k, bodies, edges, walls, table, laws, pressed, minus(force, times(pressed, normal))):
            rubbed = 0.5 * step * (count.power[k] + rate) - taken
            totals[FRICTION] += rubbed
            _note(k, edges, FRICTION, rubbed)
    count.spring[k] = square
    count.stiffness[k] = tangential
    count.power[k] = rate
    count.held[k] = portion(edges, k) * spring_energy(stiffness, power, overlap, edges.minimum_gap[k])


@threaded
def _work(bodies, edges, walls, count, shift, table, laws, step, before, after):
    """Count what films have done in the step, contacts in the half kicks around this instant, and what springs hold."""
    number, pairs = len(edges.first), edges.between_particles
    near = edges.near if laws.film else pairs
    for chunk in prange(CHUNKS):
        totals = count.totals[chunk]
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            if laws.film and step > 0.0:
                lost, by_wall = _film_works(k, bodies, edges, count, step)
                totals[FILM] += lost
                _note(k, edges, FILM, lost)
                totals[WALLS] += by_wall
            if near <= k < pairs:
                continue
            separation, distance, gap = geometry(k, bodies, edges, shift)
            if gap < edges.minimum_gap[k]:
                _contact_works(
                    k, gap, separation, distance, bodies, edges, walls, count, table, laws, step, before + after, totals
                )
            else:
                _forget(k, count, totals, step)
