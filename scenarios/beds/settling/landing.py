"""The sphere of ten Cate et al. (2002) falls in a box of oil, with the extra drag beside its walls, onto the floor.

The fluid is at rest apart from what drag, added mass, film and wall drag describe (`QuiescentFluid`), or it is computed
on a coarse grid over a floor. The same equation of motion is integrated independently, with the exact resistance
towards the floor instead of film and law.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from scipy.integrate import solve_ivp

from cfddem.case.materials import Material
from cfddem.coupling.forces.wall_drag import WallDrag
from cfddem.coupling.quiescent_fluid import QuiescentFluid
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from cfddem.run.simulation import Simulation
from closures.added_mass import near_wall
from closures.drag_single import abraham
from closures.registry import law_of
from closures.wall_drag import along_wall, towards_wall
from scenarios.beds.settling.study import ten_cate

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
        laws=Laws(film=True), skin=RADIUS, check_steps=False,
    )  # fmt: skip
    beside = None if walls == "none" else WallDrag([FLOOR, *SIDES, LID], walls, film=True)
    oil = QuiescentFluid(
        run, density, viscosity, law_of(abraham), history="none", wall=FLOOR, wall_drag=beside,
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
