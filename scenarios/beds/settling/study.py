"""One sphere settles: its terminal velocity and its acceleration from rest.

A sphere in cells not much larger than itself disturbs the velocity and the voidage from which its own drag is computed.
The self-disturbance correction removes this (:mod:`cfddem.coupling.self_disturbance`). The sphere must then reach the
terminal velocity of the drag law at any Reynolds number, with any cell size, at any position within a cell.

`python -m scenarios.beds.settling.study OUTPUT.png` runs both cases and draws them.

The fluid is at rest apart from what drag, added mass, film and wall drag describe (`QuiescentFluid`), or it is computed
on a coarse grid over a floor. The same equation of motion is integrated independently, with the exact resistance
towards the floor instead of film and law.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.integrate import solve_ivp

from cfddem.case.gallery import gallery
from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.coupling.forces.drag import WallDrag
from cfddem.coupling.quiescent_fluid import QuiescentFluid
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from cfddem.run.simulation import Simulation
from closures.added_mass import near_wall
from closures.balance import Sphere, speed_after, terminal_velocity
from closures.drag_single import abraham, schiller_naumann
from closures.registry import REGISTRY, law_of
from closures.wall_drag import along_wall, towards_wall
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
    fluid = float(simulation.fluid.velocity[..., 2].mean())
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
    sphere = Sphere(case.bed.diameter, case.solid.density, fluid.density, fluid.viscosity, law, gravity)
    speeds = [0.0]
    for begin, end in pairwise(times):
        speeds.append(speed_after(end - begin, speeds[-1], sphere, added_mass=case.laws.added_mass_at(1.0)))
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


def unbounded(case: Case, drag: str = "") -> float:
    """Terminal velocity of a sphere of a case, alone in an endless fluid, by a drag law; by that of the case if empty
    [m/s]."""
    law = REGISTRY["drag"][drag] if drag else case.laws.drag_law
    assert law is not None
    fluid, gravity = case.required_fluid, abs(case.laws.gravity[2])
    return terminal_velocity(
        case.bed.diameter, case.solid.density, fluid.density, fluid.viscosity, law.function, gravity
    )


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
            simulation.fluid.set_velocity((0.0, 0.0, 0.4))
            simulation.step(float(instant))
        velocity.append(float(simulation.particles.velocity[0, 2]))
    return times, np.array(velocity), exact


# ---------------------------------------------------------------- figure of the settling bead


def figure(path: Path) -> None:
    """Speed against time: runs, equation of motion, and the exponential fitted to the measured one."""
    measured = numbers("mordant2000_glass_0p5mm")
    terminal, lasting = float(measured["U_terminal"][0]), float(measured["tau95"][0])
    drawn, axes = panels(width=6.5, height=4.2)
    case = mordant()
    for history, colour, text in (
        (case.laws.history, BLUE, "with history force"),
        ("none", ORANGE, "without history force"),
    ):
        changed = case.with_(**{"laws.history": history})
        times, speeds = release(changed)
        axes.plot(1e3 * times, 1e3 * speeds, color=colour, label=text)
        axes.plot(1e3 * times, 1e3 * equation_of_motion(changed, times), color="black", ls=":", lw=1.4)
    axes.plot([], [], color="black", ls=":", lw=1.4, label="equation of motion")
    exponential = 1e3 * terminal * (1.0 - np.exp(-3.0 * times / lasting))
    axes.plot(1e3 * times, exponential, color=GREY, ls="--", label="fit of Mordant and Pinton (2000)")
    where = (1e3 * lasting, 0.95e3 * terminal)
    axes.plot(*where, "o", color=GREY, ms=8)
    axes.annotate(f"95 % after {where[0]:.0f} ms", where, (70.0, 58.0), color="#444444")
    axes.set_xlim(0.0, 200.0)
    axes.set_ylim(0.0, 90.0)
    label(axes, "time", "ms", "speed of fall", "mm/s")
    legend(axes, loc="lower right")
    save(drawn, path)


# ---------------------------------------------------------------- landing in a box of oil


RADIUS, GRAVITY = 7.5e-3, 9.81
WIDTH, HEIGHT, RELEASE = 0.1, 0.16, 0.12
"""Of the box, and gap under the sphere when it is released [m]."""

NYLON = Material(density=1120.0, youngs_modulus=1e6, poisson=0.4, restitution=0.9, roughness=1e-3 * RADIUS)
FLOOR = Plane()
SIDES = (
    Plane(normal=(1.0, 0.0, 0.0)),
    Plane(point=(WIDTH, 0.0, 0.0), normal=(-1.0, 0.0, 0.0)),
    Plane(normal=(0.0, 1.0, 0.0)),
    Plane(point=(0.0, WIDTH, 0.0), normal=(0.0, -1.0, 0.0)),
)
LID = Plane(point=(0.0, 0.0, HEIGHT), normal=(0.0, 0.0, -1.0))

Walls = Literal["none", "nearest", "all"]
WALLS: tuple[Walls, ...] = ("none", "nearest", "all")


def land(density: float, viscosity: float, walls: Walls, step: float = 5e-4) -> tuple[np.ndarray, np.ndarray]:
    """Gap over the floor [m] and speed of fall [m/s] of the sphere, from rest until it has almost landed.

    density, viscosity  of the oil [kg/m3], [Pa s]
    walls               that raise the drag; the film on the floor acts always
    step                of the fluid; the sphere should move by little more than the gap at which it lands [s]
    """
    place = [[0.5 * WIDTH, 0.5 * WIDTH, RELEASE + RADIUS]]
    run = ParticleSolver(
        make_particles(place, RADIUS, NYLON.density), pair_table([NYLON]), walls=[FLOOR, *SIDES, LID],
        laws=Laws(film=True), settings=SolverSettings(skin=RADIUS, check_steps=False),
    )  # fmt: skip
    beside = None if walls == "none" else WallDrag([FLOOR, *SIDES, LID], walls, film=True)
    oil = QuiescentFluid(
        run, density, viscosity, law_of(abraham), history="none", added_mass=FLOOR, wall_drag=beside,
        gravity=(0.0, 0.0, -GRAVITY),
    )  # fmt: skip
    rows = [(RELEASE, 0.0)]
    while rows[-1][0] > 2.0 * NYLON.roughness and run.time < 20.0:
        oil.advance(step)
        rows.append((float(run.particles.position[0, 2]) - RADIUS, -float(run.particles.velocity[0, 2])))
    gaps, speeds = np.array(rows).T
    return gaps, speeds


def land_on_grid(
    density: float, viscosity: float, cell: float = 4.0, step: float = 2e-3
) -> tuple[np.ndarray, np.ndarray]:
    """The same in a coupled run, in a wide periodic box with a floor and a distant lid, and drag beside the floor.

    cell  edge of the cells of the fluid over the diameter
    step  of the fluid [s]; the film takes over from the drag at a gap of a radius, within one of these steps
    """
    edge = 2.0 * RADIUS * cell
    width = edge * round(48.0 / cell)
    case = ten_cate(density, viscosity).with_(**{
        "material.nylon.youngs_modulus": NYLON.youngs_modulus,
        "material.nylon.roughness": NYLON.roughness,
        "column.width": width,
        "column.height": width,
        "column.cell": edge,
        "bed.positions": [(0.5 * (width + edge), 0.5 * (width + edge), RELEASE + RADIUS)],
        "laws.lubrication": "nijssen",
        "laws.wall_drag": "nearest",
        "run.fluid_step": step,
        "run.until": 20.0,
    })  # fmt: skip
    simulation = Simulation(case)
    rows = [(RELEASE, 0.0)]
    while rows[-1][0] > 2.0 * NYLON.roughness and simulation.time < 20.0:
        simulation.step()
        particles = simulation.particles
        rows.append((float(particles.position[0, 2]) - RADIUS, -float(particles.velocity[0, 2])))
    gaps, speeds = np.array(rows).T
    return gaps, speeds


def landing_ode(
    density: float, viscosity: float, walls: Walls, gaps: np.ndarray, *, floor_alone: bool = False
) -> np.ndarray:
    """Speed at these gaps by the equation of motion [m/s].

    floor_alone  no other walls, and the added mass of a sphere far from walls
    """
    displaced = 4.0 / 3.0 * math.pi * RADIUS**3 * density
    mass, stokes = displaced * NYLON.density / density, 6.0 * math.pi * viscosity * RADIUS

    def factor(gap: float) -> float:
        x, aside = gap / RADIUS, 0.5 * WIDTH / RADIUS - 1.0
        floor = 1.0 / x + towards_wall(x) - 1.0
        if walls == "all":
            lid = (HEIGHT - gap) / RADIUS - 2.0
            return floor + 1.0 / lid + towards_wall(lid) - 1.0 + 4.0 * (along_wall(aside) - 1.0)
        if walls == "nearest" and floor_alone:
            return floor
        if walls == "nearest":
            lid = (HEIGHT - gap) / RADIUS - 2.0
            nearest = min(x, lid, aside)
            if nearest == aside:
                return along_wall(aside) - 1.0
            return floor if nearest == x else 1.0 / lid + towards_wall(lid) - 1.0
        return 1.0 / x if x < 1.0 else 0.0

    def rates(_: float, state: np.ndarray) -> tuple[float, float]:
        gap, speed = max(float(state[0]), 1e-3 * NYLON.roughness), float(state[1])
        reynolds = 2.0 * RADIUS * density * abs(speed) / viscosity
        away = gap + RADIUS
        coefficient, slope = 0.5, 0.0
        if not floor_alone:
            coefficient = near_wall(away, RADIUS)
            slope = (near_wall(away * (1.0 + 1e-5), RADIUS) - coefficient) / (1e-5 * away)
        force = (mass - displaced) * GRAVITY - stokes * (abraham(reynolds, 1.0) + factor(gap)) * speed
        return -speed, (force + 0.5 * displaced * slope * speed**2) / (mass + coefficient * displaced)

    def landed(_: float, state: np.ndarray) -> float:
        return float(state[0]) - 1.9 * NYLON.roughness

    landed.terminal = True  # type: ignore[attr-defined]
    solved = solve_ivp(
        rates, (0.0, 20.0), (RELEASE, 0.0), method="LSODA", rtol=1e-7, atol=1e-9, max_step=2e-3, events=landed
    )
    return np.interp(gaps, solved.y[0][::-1], solved.y[1][::-1])


if __name__ == "__main__":
    figure(Path(sys.argv[1] if len(sys.argv) > 1 else "settling.png"))
