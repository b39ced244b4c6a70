"""Motion of a pair through its film and its contact: initial state, integration, and end of the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError, RunFailed, nearest
from cfddem.case.materials import Material
from cfddem.coupling.forces.drag import WallDrag
from cfddem.coupling.quiescent_fluid import QuiescentFluid
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures import contact, lubrication
from closures.drag_single import schiller_naumann
from closures.registry import law_of

COAST = 1e-5
"""A pair has stopped when its remaining kinetic and spring energy would change ln h by less than this."""

MOST_STEPS = 2_000_000


@dataclass(frozen=True)
class Setting:
    """Constants of a pair and its impact."""

    radius: tuple[float, float]  # of striker and target; infinite for a wall
    reduced_radius: float
    reduced_mass: float
    speed: float
    tangential_speed: float
    viscosity: float
    stiffness: float
    impact_step: float
    minimum_gap: float
    film_speed: float  # B = A/m*

    @property
    def cutoff_gap(self) -> float:
        return self.reduced_radius


def stage(
    setting: Setting,
    table: np.ndarray,
    materials: tuple[Material, Material],
    laws: Laws,
    full: bool,
    spin: tuple[float, float],
) -> ParticleSolver:
    """Place striker and target; the line of centres at contact is the x axis, the plane of motion is x-y."""
    velocity = np.array([setting.speed, setting.tangential_speed, 0.0])
    wall = math.isinf(setting.radius[1])
    start = 2.0 * setting.reduced_radius if full else setting.cutoff_gap if laws.film else 1e-3 * setting.reduced_radius
    at_contact = np.array([-setting.radius[0] - (0.0 if wall else setting.radius[1]), 0.0, 0.0])
    if full:
        place = at_contact - velocity * _time_to_contact(at_contact, velocity, start, wall)
    else:
        place = at_contact - np.array([start, 0.0, 0.0])
    spins = [[0.0, 0.0, spin[0]], [0.0, 0.0, spin[1]]]
    number = 1 if wall else 2
    pair = make_particles(
        np.array([place, np.zeros(3)])[:number],
        np.array(setting.radius[:number]),
        np.array([material.density for material in materials[:number]]),
        velocity=np.array([velocity, np.zeros(3)])[:number],
        spin=np.array(spins)[:number],
        material=np.arange(number, dtype=np.int32),
        viscosity=setting.viscosity,
    )
    return ParticleSolver(
        pair,
        table,
        walls=[WALL] if wall else [],
        laws=laws,
        settings=SolverSettings(
            free=(1.0, 1.0, 1.0) if full else (1.0, 0.0, 0.0),
            skin=8.0 * setting.reduced_radius,
            check_steps=False,  # the step is chosen here
            record=True,
        ),
    )


def _time_to_contact(at_contact: np.ndarray, velocity: np.ndarray, start: float, wall: bool) -> float:
    """Time from the initial gap to contact on the undisturbed path [s]."""
    if wall:
        return start / velocity[0]
    target = float(np.linalg.norm(at_contact)) + start
    along, square = float(at_contact @ velocity), float(velocity @ velocity)
    return (along + math.sqrt(along**2 + square * (target**2 - float(at_contact @ at_contact)))) / square


@dataclass(frozen=True)
class _Moment:
    """Gap and speeds of a pair at one time."""

    gap: float
    normal_speed: float
    speed: float
    rate: float = 0.0  # mean rate of the gap over the last step


def _look(simulation: ParticleSolver) -> _Moment:
    """Gap and speeds of the pair, as plain numbers."""
    position, velocity = simulation.particles.position.tolist(), simulation.particles.velocity.tolist()
    if len(position) == 1:
        (x, _, _), (u, v, w) = position[0], velocity[0]
        return _Moment(-x - float(simulation.particles.radius[0]), -u, math.hypot(u, v, w))
    r = [b - a for a, b in zip(*position)]
    u = [b - a for a, b in zip(*velocity)]
    distance = math.hypot(*r)
    approach = sum(a * b for a, b in zip(r, u)) / distance
    return _Moment(distance - float(simulation.particles.radius.sum()), approach, math.hypot(*u))


FLUID_STEP = 0.01
"""Longest step with a fluid around the pair, over the time in which the pair crosses its film at the impact speed."""


AT_REST = 1e-4
"""A pair in contact is at rest when it is slower in three steps, over the impact speed; a rebound is never."""


def integrate(
    simulation: ParticleSolver,
    setting: Setting,
    full: bool,
    fluid: QuiescentFluid | None = None,
    until: float | None = None,
) -> dict[str, np.ndarray]:
    """Integrate until the pair has left the film or stopped; returns the history as columns.

    until  follow it for this time instead, or until it rests in contact [s]

    Where only the film acts its impulse depends on the gap alone, so a step may take up to half of the gap, less
    where the film changes the speed so much that times would be coarse. The first step into the film is short,
    because a film acts from the step after the one that enters it.
    """
    advance: Callable[..., object] = simulation.advance if fluid is None else fluid.advance
    rows = [_row(simulation, _look(simulation), None)]
    laws, cutoff = simulation.laws, setting.cutoff_gap if simulation.laws.film else 0.0
    longest = math.inf if fluid is None else FLUID_STEP * setting.cutoff_gap / setting.speed
    if not full:
        advance(min(1e-6 * setting.cutoff_gap / setting.speed, setting.impact_step))
    turn = 0.004 * setting.reduced_radius / math.hypot(setting.speed, setting.tangential_speed) if full else math.inf
    touched = False
    for moment, minimum_gap in _moments(simulation, rows, fluid):
        touched = touched or moment.gap <= minimum_gap
        if until is not None:
            slow = AT_REST * setting.speed
            at_rest = all(row["gap"] < minimum_gap and abs(row["normal_speed"]) < slow for row in rows[-3:])
            if simulation.time >= until or at_rest:
                break
        elif moment.gap > cutoff and moment.normal_speed > 0.0:  # noqa: SIM114
            break
        elif laws.film and _halted(moment, minimum_gap, setting, full):
            break
        if laws.film and laws.integrator == "verlet":
            near = moment.gap < 4.0 * minimum_gap + 2.0 * setting.speed * setting.impact_step
            advance(setting.impact_step, 1 if near else 25)
        else:
            left = math.inf if until is None else until - simulation.time
            advance(min(_step(moment, minimum_gap, setting, cutoff, turn), longest, left))
    none = np.zeros(3)  # forces of the fluid are known from the first step on
    columns = {name: np.array([row.get(name, none) for row in rows]) for name in rows[-1]}
    return columns | {"touched": np.array(touched)}


def _moments(
    simulation: ParticleSolver, rows: list[dict[str, Any]], fluid: QuiescentFluid | None
) -> Iterator[tuple[_Moment, float]]:
    listed = simulation.edges.minimum_gap
    begins_with = float(listed[0])  # where a pair that has left the neighbour list begins anew
    while simulation.steps < MOST_STEPS:
        moment, listed = _look(simulation), simulation.edges.minimum_gap
        last = rows[-1]
        if simulation.time > last["time"]:
            moment = replace(moment, rate=(moment.gap - last["gap"]) / (simulation.time - last["time"]))
        rows.append(_row(simulation, moment, fluid))
        yield moment, float(listed[0]) if len(listed) else begins_with
    raise RunFailed(
        f"the pair neither separates nor halts within {MOST_STEPS} steps: gap {moment.gap:.3g} m, "
        f"speed {moment.speed:.3g} m/s at t = {simulation.time:.3g} s; try a larger step_fraction"
    )


def _row(simulation: ParticleSolver, moment: _Moment, fluid: QuiescentFluid | None) -> dict[str, Any]:
    around = {} if fluid is None else {f"force_{name}": force[0].copy() for name, force in fluid.force.items()}
    return around | {
        "time": simulation.time,
        "gap": moment.gap,
        "normal_speed": moment.normal_speed,
        "position": simulation.particles.position.copy(),
        "velocity": simulation.particles.velocity.copy(),
        "spin": simulation.particles.spin[:, 2].copy(),
        "force": simulation.particles.force[0].copy(),
    }


def _step(moment: _Moment, minimum_gap: float, setting: Setting, cutoff: float, turn: float) -> float:
    """Next step: a fraction of the Hertz time in contact, a fraction of the gap where only the film acts."""
    if moment.gap <= minimum_gap:
        return max(setting.impact_step, _creep_time(moment, minimum_gap, setting) if cutoff > 0.0 else 0.0)
    distance = moment.gap - minimum_gap if moment.normal_speed < 0.0 else moment.gap
    if moment.gap > cutoff:
        # the film begins with a full step inside it, which is kept short
        distance = min(distance, moment.gap - cutoff + 1e-3 * setting.cutoff_gap) if cutoff > 0.0 else distance
        turn = max(turn, setting.impact_step)
    stride = min(0.5, max(0.02, 0.05 * abs(moment.normal_speed) / setting.film_speed)) if moment.gap <= cutoff else 1.0
    return max(setting.impact_step, min(stride * distance / max(abs(moment.normal_speed), 1e-300), turn))


def _creep_time(moment: _Moment, minimum_gap: float, setting: Setting) -> float:
    """A tenth of the time in which a pair pressed below h_min relaxes, where the film overdamps it; else 0."""
    overlap, mass = minimum_gap - moment.gap, setting.reduced_mass
    if moment.gap <= 0.0 or overlap <= 0.0 or moment.rate <= 0.0:
        return 0.0
    stiffness = 2.5 * contact.hertz_force(setting.stiffness, overlap) / minimum_gap
    rate = lubrication.film_resistance(setting.film_speed, moment.gap, minimum_gap, setting.cutoff_gap)
    relaxation = rate * mass / stiffness
    return 0.1 * min(relaxation, overlap / moment.rate) if rate * rate * mass > 16.0 * stiffness else 0.0


def _halted(moment: _Moment, minimum_gap: float, setting: Setting, full: bool) -> bool:
    """Whether kinetic and spring energy are too small to change ln h noticeably against the film."""
    overlap = max(0.0, minimum_gap - moment.gap)
    share = min(1.0, overlap / minimum_gap)
    spring_energy = 0.4 * share * contact.hertz_force(setting.stiffness, overlap) * overlap
    speed = moment.speed if full else abs(moment.normal_speed)
    return speed + math.sqrt(2.0 * spring_energy / setting.reduced_mass) < COAST * setting.film_speed


# ---------------------------------------------------------------- forces of the fluid around


FORCES = ("drag", "added_mass", "history", "wall_drag")
"""Forces of the fluid, beyond the film."""

WALL = Plane(normal=(-1.0, 0.0, 0.0), material=1)
"""The wall; the sphere moves along x."""


def chosen_forces(names: str | Sequence[str]) -> tuple[str, ...]:
    """Names of forces, from "none", "all", or names joined by commas.

    >>> chosen_forces("drag,history"), chosen_forces("none")
    (('drag', 'history'), ())
    """
    words = names.replace(" ", "").split(",") if isinstance(names, str) else list(names)
    if words in (["none"], [""]):
        return ()
    if words == ["all"]:
        return FORCES
    for word in words:
        if word not in FORCES:
            raise InputError("surroundings", word, nearest(word, FORCES), 'names joined by commas, "all" or "none"')
    return tuple(words)


def fluid_around(
    run: ParticleSolver, forces: Sequence[str], density: float, viscosity: float, gravity: float, against_wall: bool
) -> QuiescentFluid | None:
    """A fluid at rest with these forces; None where nothing but the film and the contact acts.

    gravity  along x, from striker to target [m/s2]
    """
    if not forces and gravity == 0.0:
        return None
    if "wall_drag" in forces and forces != FORCES and not against_wall:
        raise InputError("surroundings", "wall_drag", "left out without a wall", 'or collide with against="wall"')
    beside = None
    if against_wall and "wall_drag" in forces:
        beside = WallDrag([WALL], "nearest", film=run.laws.film, shear=run.laws.shears)
    return QuiescentFluid(
        run,
        density,
        viscosity,
        law_of(schiller_naumann) if "drag" in forces else None,
        added_mass="added_mass" in forces and (WALL if against_wall else True),
        history="mei_adrian" if "history" in forces else "none",
        wall_drag=beside,
        gravity=(gravity, 0.0, 0.0),
    )
