"""One sphere settles: its terminal velocity and its acceleration from rest.

A sphere in cells not much larger than itself disturbs the velocity and the voidage from which its own drag is computed.
The self-disturbance correction removes this (:mod:`cfddem.coupling.self_disturbance`). The sphere must then reach the
terminal velocity of the drag law at any Reynolds number, with any cell size, at any position within a cell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.run.simulation import Simulation
from closures.balance import speed_after, terminal_velocity
from closures.drag_single import schiller_naumann
from closures.registry import REGISTRY
from scenarios.validation.table import numbers

DIAMETER, WATER, VISCOSITY, DENSITY = 1e-3, 1000.0, 1e-3, 2500.0


@dataclass(frozen=True)
class Fall:
    """How fast a sphere fell, over the terminal velocity of the drag law."""

    reynolds: float
    cell: float  # over the diameter
    self_disturbance: bool
    velocity: float  # against the mean of the fluid, over the terminal velocity


def fall(
    reynolds: float,
    cell: float,
    *,
    self_disturbance: bool = True,
    place: float = 0.5,
    box: float = 60.0,
    times: float = 60.0,
) -> Fall:
    """Let a sphere fall through a periodic box, starting at its terminal velocity, and measure its final velocity.

    reynolds  of the terminal velocity by Schiller and Naumann [-]
    cell      edge over the diameter [-]
    self_disturbance  whether the correction is applied
    place     within its cell, 0 to 1 along each axis
    box       edge over the diameter; a larger box weakens periodic images and delays the wake [-]
    times     duration over the relaxation time of the sphere; shorter where it would reach its own wake
    """
    speed = reynolds * VISCOSITY / (WATER * DIAMETER)
    drag = 3.0 * math.pi * VISCOSITY * DIAMETER * speed * schiller_naumann(reynolds, 1.0)
    gravity = drag / ((DENSITY - WATER) * math.pi / 6.0 * DIAMETER**3)
    edge = cell * DIAMETER
    cells = max(8, round(box / cell))
    relaxation = DENSITY * math.pi / 6.0 * DIAMETER**3 * speed / drag
    end = min(times * relaxation, 0.5 * cells * edge / speed)
    step = min(0.2 * relaxation, 0.2 * edge / speed)
    start = (cells // 2 + place) * edge
    case = Case(
        fluid={"density": WATER, "viscosity": VISCOSITY},
        # soft enough for the step: there are no contacts
        material={"sphere": {"density": DENSITY, "youngs_modulus": 1e-9, "poisson": 0.25}},
        column={"width": cells * edge, "height": cells * edge, "cell": edge, "sides": "periodic", "ends": "periodic"},
        bed={"diameter": DIAMETER, "positions": [(start, start, start)], "initial_velocity": (0.0, 0.0, -speed)},
        laws={
            "gravity": (0.0, 0.0, -gravity),
            "drag": "schiller_naumann",
            "lubrication": "none",
            "self_disturbance_correction": self_disturbance,
        },
        run={
            "until": end,
            "particle_step": min(step, 0.02 * DIAMETER / speed),
            "fluid_step": step,
            "reference_speed": speed,
        },
    )
    simulation = Simulation(case)
    while simulation.time < end * (1.0 - 1e-12):
        simulation.step(end)
    fluid = float(simulation.required_fluid.velocity[..., 2].mean())
    velocity = (fluid - float(simulation.particles.velocity[0, 2])) / speed
    return Fall(reynolds, cell, self_disturbance, velocity)


def release(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and speed of fall [m/s] of the sphere of a case, from rest."""
    simulation = Simulation(case)
    interval = case.run.history_every or 0.01 * case.run.until
    times, speeds = [0.0], [0.0]
    while simulation.time < case.run.until * (1.0 - 1e-12):
        simulation.until(min(len(times) * interval, case.run.until))
        times.append(simulation.time)
        speeds.append(-float(simulation.particles.velocity[0, 2]))
    return np.array(times), np.array(speeds)


def equation_of_motion(case: Case, times: np.ndarray) -> np.ndarray:
    """Speed of the same sphere from rest by its equation of motion, alone in an endless fluid (n,) [m/s]."""
    if case.laws.history != "none":
        return _with_memory(case, times, case.run.until / 600.0)
    assert isinstance(case.laws.drag, str)
    law, gravity = REGISTRY["drag"][case.laws.drag].function, abs(case.laws.gravity[2])
    fluid = case.required_fluid
    sphere = (case.bed.diameter, case.solid.density, fluid.density, fluid.viscosity, law, gravity)
    speeds = [0.0]
    for begin, end in pairwise(times):
        speeds.append(speed_after(end - begin, speeds[-1], *sphere, added_mass=case.laws.added_mass_at(1.0)))
    return np.array(speeds)


def _with_memory(case: Case, times: np.ndarray, step: float) -> np.ndarray:
    """The same with a history force, by the full convolution of its kernel at the present slip (n,) [m/s].

    step  of the integration, much shorter than the memory [s]
    """
    assert isinstance(case.laws.drag, str)
    fluid, diameter, gravity = case.required_fluid, case.bed.diameter, abs(case.laws.gravity[2])
    drag, law = REGISTRY["drag"][case.laws.drag].function, REGISTRY["history"][case.laws.history].function
    kinematic, volume = fluid.viscosity / fluid.density, math.pi / 6.0 * diameter**3
    weight = (case.solid.density - fluid.density) * volume * gravity
    inertia = (case.solid.density + case.laws.added_mass_at(1.0) * fluid.density) * volume
    stokes = 3.0 * math.pi * fluid.viscosity * diameter
    nodes, shares = np.polynomial.legendre.leggauss(6)
    ends = step * np.arange(round(times[-1] / step) + 1)
    speeds = np.zeros(len(ends))
    for n in range(1, len(ends)):
        before = speeds[n - 1]
        # mean of the kernel over every earlier step, with s = x^2 because the kernel is singular at 0
        low, high = np.sqrt(step * np.arange(n)), np.sqrt(step * np.arange(1, n + 1))
        roots = 0.5 * (high + low) + 0.5 * (high - low) * nodes[:, None]
        values = np.vectorize(law)(roots**2, before, diameter, kinematic)
        integral = ((high - low) * roots * values * shares[:, None]).sum(axis=0)
        gained = np.diff(speeds[:n])[::-1]
        remembered = stokes * float((integral[1:] * gained).sum()) / step
        newest = stokes * integral[0] / step
        friction = stokes * drag(fluid.density * diameter * before / fluid.viscosity, 1.0)
        speeds[n] = (inertia / step * before + weight - remembered + newest * before) / (
            inertia / step + friction + newest
        )
    return np.interp(times, ends, speeds)


def mordant() -> Case:
    """The bead of the gallery case."""
    return gallery()["settling"]


def unbounded(case: Case, drag: str) -> float:
    """Terminal velocity of the sphere of a case by a drag law, alone in an endless fluid [m/s]."""
    law, fluid, gravity = REGISTRY["drag"][drag].function, case.required_fluid, abs(case.laws.gravity[2])
    return terminal_velocity(case.bed.diameter, case.solid.density, fluid.density, fluid.viscosity, law, gravity)


def ten_cate(density: float, viscosity: float) -> Case:
    """The nylon sphere of ten Cate et al. (2002) in one of their oils, without the walls of their box."""
    diameter = 0.015
    edge = 4.0 * diameter
    return Case(
        title="A sphere settles in silicone oil",
        fluid={"density": density, "viscosity": viscosity},
        material={"nylon": {"density": 1120.0, "youngs_modulus": 1e3, "poisson": 0.4}},
        column={"width": 25 * edge, "height": 25 * edge, "cell": edge, "sides": "periodic", "ends": "closed"},
        bed={"diameter": diameter, "positions": [(12.5 * edge, 12.5 * edge, 20.5 * edge)]},
        laws={"drag": "abraham", "lubrication": "none", "added_mass": 0.5},
        run={"until": 2.0, "history_every": 0.02, "reference_speed": 0.1, "fluid_step": 0.005},
    )


def in_held_gas() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """MFIX DEM06, a particle in a gas at fixed velocity: time [s], velocity and exact velocity [m/s]."""
    listed = numbers("mfix_dem06_velocity_analytic")
    times, exact = listed["t"], listed["v_p"]
    diameter, edge = 1e-4, 2e-3
    case = Case(
        fluid={"density": 1.2, "viscosity": 1.8e-5},
        material={"grain": {"density": 2000.0, "youngs_modulus": 1e3, "poisson": 0.3}},
        column={"width": 8 * edge, "height": 8 * edge, "cell": edge, "sides": "periodic", "ends": "periodic"},
        bed={"diameter": diameter, "positions": [(8.4e-3, 8.6e-3, 15e-3)]},
        # the fluid velocity is fixed, so there is no self-disturbance
        # the listed velocities tend to the balance of the law at standard gravity, 9.80665 m/s2
        laws={
            "drag": "schiller_naumann",
            "lubrication": "none",
            "self_disturbance_correction": False,
            "gravity": (0.0, 0.0, -9.80665),
        },
        run={"until": float(times[-1]), "fluid_step": 2e-4, "reference_speed": 0.06},
    )
    simulation = Simulation(case)
    velocity = [0.0]
    for instant in times[1:]:
        while simulation.time < instant * (1.0 - 1e-12):
            simulation.required_fluid.set_velocity((0.0, 0.0, 0.4))
            simulation.step(float(instant))
        velocity.append(float(simulation.particles.velocity[0, 2]))
    return times, np.array(velocity), exact
