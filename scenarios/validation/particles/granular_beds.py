"""Dry and wet beds under gravity: a poured bed at rest, a tilted slope, a hopper, and suspensions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.initial.packing import lattice, random_packing
from cfddem.particles.initial.pouring import AT_REST, pour
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import kinetic_energy, make_particles
from cfddem.particles.walls.shapes import Cone, Cylinder, Plane
from closures.discharge import beverloo
from scenarios.validation.particles.few_spheres import DOWN, GRAVITY

DIAMETER = 1e-3
GRAIN = Material(density=2500, youngs_modulus=10e6, poisson=0.25, restitution=0.5, friction=0.5)
"""Grains of poured beds, of 1 mm."""


class Rest(NamedTuple):
    """A poured bed, and its motion after it has come to rest."""

    run: ParticleSolver
    poured: float  # energy of the fall [J]
    settled: float  # time at which it came to rest [s]
    energy: np.ndarray  # kinetic energy afterwards [J]
    weight: np.ndarray  # vertical force on the walls over the weight of the bed, afterwards [-]


def rest(
    count: int, width: float, watch: float, periodic: bool = True, samples: int = 100, rolling_friction: float = 0.1
) -> Rest:
    """Pour a bed and observe it at rest.

    Without resistance to rolling and twisting, spheres roll and spin indefinitely; a yielding spring and a dashpot
    resist here.

    width     of the square column [m]
    watch     time to observe the bed after it has come to rest [s] [s]
    periodic  repeat the column sideways instead of closing it by walls
    """
    fallen: list[float] = []
    run = pour(
        GRAIN.model_copy(update={"rolling_friction": rolling_friction}),
        np.full(count, DIAMETER),
        (width, width),
        seed=1,
        periodic=periodic,
        laws=Laws(rolling="spring_dashpot" if rolling_friction > 0.0 else "none"),
        progress=lambda time, share: fallen.append(share),
    )
    settled, weight = run.time, GRAVITY * float(run.particles.mass.sum())
    poured, resting = kinetic_energy(run.particles) / fallen[-1], settled
    energy: list[float] = []
    carried: list[float] = []
    step = 0.5 * run.time_scales(0.1).recommended
    while len(energy) < samples:
        run.advance(step, max(1, int(watch / samples / step)))
        energy.append(kinetic_energy(run.particles))
        carried.append(-float(run.wall_force[:, 2].sum()) / weight)
        if energy[-1] > AT_REST * poured and run.time < settled + 1.0:  # it moves again, so rest begins later
            resting, energy, carried = run.time, [], []
    return Rest(run, poured, resting, np.array(energy), np.array(carried))


def slope(
    friction: float,
    film: bool,
    onset: str = "film",
    shape: tuple[int, int, int] = (10, 8, 10),
    seed: int = 3,
    rolling_friction: float = 0.0,
) -> tuple[float, np.ndarray, np.ndarray]:
    """Tilt a bed on a rough bottom slowly until it flows.

    Spheres of 1 mm, periodic along and across the slope. Asperities of 5 um keep resting particles farther
    apart than their weight presses them together, as for glass, so that film and contact share the load at rest.

    film     under water, films on
    onset    of friction: "film" or "overlap"
    shape    of the bed along, across and normal to the slope, in diameters
    rolling_friction  mu_r of a yielding rolling spring with a dashpot; 0 for no resistance to rolling [-]
    returns  angle at which the mean speed reaches 0.2 sqrt(g d) [deg], NaN if it does not up to 60 degrees; and the
             history of angle [deg] and speed [m/s]
    """
    glass = Material(
        density=2500,
        youngs_modulus=50e9,
        contact_modulus=10e6,
        poisson=0.25,
        restitution=0.5,
        friction=friction,
        rolling_friction=rolling_friction,
        roughness=5e-6,
    )
    count = int(0.58 * math.prod(shape) * 6.0 / math.pi)
    places, box = random_packing(np.full(count, DIAMETER), 0.58, seed, shape)
    spheres = make_particles(
        places, 0.5 * DIAMETER, glass.density, viscosity=1e-3 if film else 0.0, fixed=places[:, 2] < DIAMETER
    )
    run = ParticleSolver(
        spheres,
        pair_table([glass]),
        laws=Laws(film=film, friction_onset=onset, rolling="spring_dashpot" if rolling_friction > 0.0 else "none"),
        gravity=DOWN,
        box=(box[0], box[1], None),
    )
    step, moving = 1e-5, run.particles.inverse_mass > 0.0
    run.advance(step, 5000)
    angle, speed, angles, speeds = 0.0, 0.0, [0.0], [0.0]
    flowing = 0.2 * math.sqrt(GRAVITY * DIAMETER)
    while angle < 60.0 and speed < flowing:
        angle += 0.1
        lean = math.radians(angle)
        run.gravity = (GRAVITY * math.sin(lean), 0.0, -GRAVITY * math.cos(lean))
        run.advance(step, 200)
        speed = float(run.particles.velocity[moving, 0].mean())
        angles.append(angle)
        speeds.append(speed)
    return angle if speed >= flowing else math.nan, np.array(angles), np.array(speeds)


def hopper(count: int, outlet: float, seconds: float) -> tuple[float, float]:
    """Let particles flow out of a drum with a round hole in its nearly flat bottom.

    outlet   diameter of the hole [particle diameters]
    seconds  length of the run
    returns  discharge of the later half of the run, and that of Beverloo et al. with a bulk density of
             0.58 of that of the particles [kg/s]
    """
    drum, hole = 1.25 * outlet * DIAMETER, 0.5 * outlet * DIAMETER
    layers = math.ceil(1.3 * count * DIAMETER**2 / (math.pi * drum**2))
    low, high = (-drum, -drum, DIAMETER), (drum, drum, (1.0 + 1.02 * (layers + 1)) * DIAMETER)
    places = lattice(DIAMETER, (low, high), 1.02, seed=2)
    places = places[np.hypot(places[:, 0], places[:, 1]) < drum - 0.55 * DIAMETER][:count]
    grain = GRAIN.model_copy(update={"youngs_modulus": 1e6})
    walls = [
        Cylinder(point=(0.0, 0.0, -DIAMETER), radius=drum),
        Cone(radius=hole, top_radius=1.1 * drum, length=0.02 * drum),
        Plane(point=(0.0, 0.0, -40.0 * DIAMETER)),
    ]
    run = ParticleSolver(
        make_particles(places, 0.5 * DIAMETER, grain.density), pair_table([grain]), walls=walls, gravity=DOWN
    )
    mass, out = float(run.particles.mass[0]), []
    for _ in range(20):
        run.advance(2e-5, int(seconds / 20 / 2e-5))
        out.append((run.time, mass * float((run.particles.position[:, 2] < -DIAMETER).sum())))
    time, gone = np.array(out[10:]).T
    return float(np.polyfit(time, gone, 1)[0]), beverloo(0.58 * grain.density, outlet * DIAMETER, DIAMETER, GRAVITY)


# ---------------------------------------------------------------- suspensions


class Crowd(NamedTuple):
    """Result of a run of a dense suspension."""

    smallest_gap: float  # over the minimum gap [-]
    energy: np.ndarray  # kinetic energy after each step or sample [J]
    momentum: float  # change over the sum of m |v| [-]
    speed: float  # largest speed over that of the shear [-]
    steps: int


SUSPENDED = Material(
    density=2500, youngs_modulus=50e9, contact_modulus=1e9, poisson=0.25, restitution=0.8, friction=0.3, roughness=1e-7
)
"""Spheres of 100 um in a fluid of 1 Pa s."""
HELD_APART = float(pair_table([SUSPENDED])[0, 0]["roughness_gap"])
"""Their minimum gap where asperities set it [m]."""


def suspension(
    count: int, solid_fraction: float, fixed: bool, viscosity: float = 1.0
) -> tuple[ParticleSolver, np.ndarray]:
    """Random spheres of 100 um in a periodic box, none touching.

    fixed   hold two layers, bottom and top, as plates; the box is open between them
    returns the run, and which particles belong to the upper plate
    """
    diameter = 1e-4
    grown = diameter * 1.0015
    places, box = random_packing(np.full(count, grown), solid_fraction * 1.0015**3, 5, (1.0, 1.0, 1.0))
    height = places[:, 2]
    lower, upper = height < 0.9 * diameter, height > box[2] - 0.9 * diameter
    spheres = make_particles(
        places, 0.5 * diameter, SUSPENDED.density, viscosity=viscosity, fixed=(lower | upper) if fixed else False
    )
    run = ParticleSolver(
        spheres, pair_table([SUSPENDED]), laws=Laws(film=True), box=(box[0], box[1], None if fixed else box[2])
    )
    return run, upper[run.particles.id]


def shear(solid_fraction: float, steps: int, speed: float = 0.02, press: float = 0.0, count: int = 1000) -> Crowd:
    """Shear a dense suspension between layers of its own spheres at the Hertz step.

    speed  of the upper layer, which is held [m/s]
    press  if given, the upper layer is a free lid under this pressure and half as much traction [Pa]
    """
    run, upper = suspension(count, solid_fraction, fixed=True)
    if press > 0.0:
        particles = run.particles
        particles.inverse_mass[upper] = 1.0 / particles.mass[upper]
        particles.inverse_inertia[upper] = 2.5 / (particles.mass[upper] * particles.radius[upper] ** 2)
        area = float(run.box[0] * run.box[1])
        particles.applied[upper] = np.array([0.5, 0.0, -1.0]) * press * area / int(upper.sum())
    else:
        run.particles.velocity[upper, 0] = speed
    run.refresh()
    step = run.time_scales(speed).recommended
    energy, smallest, fastest = [], math.inf, 0.0
    for _ in range(50):
        run.advance(step, max(1, steps // 50))
        pairs = run.edges.between_particles
        smallest = min(smallest, float(run.gap[:pairs].min()) / HELD_APART)
        fastest = max(fastest, float(np.linalg.norm(run.particles.velocity, axis=1).max()) / speed)
        energy.append(kinetic_energy(run.particles))
    return Crowd(smallest, np.array(energy), 0.0, fastest, run.steps)


def films_alone(solid_fraction: float, steps: int, step: float, viscosity: float = 1.0, count: int = 1000) -> Crowd:
    """Spheres with random velocities and without contacts: only films act.

    step  [s]
    """
    run, _ = suspension(count, solid_fraction, fixed=False, viscosity=viscosity)
    run.table["contact_modulus"] = 0.0
    run.table["shear_modulus"] = 0.0
    run.particles.velocity[:] = np.random.default_rng(1).normal(0.0, 0.02, run.particles.velocity.shape)
    run.refresh()
    mass = run.particles.mass[:, None]
    carried, size = (mass * run.particles.velocity).sum(axis=0), float((mass * np.abs(run.particles.velocity)).sum())
    energy, smallest = [kinetic_energy(run.particles)], math.inf
    for _ in range(steps):
        run.advance(step)
        energy.append(kinetic_energy(run.particles))
        smallest = min(smallest, float(run.gap.min()) / HELD_APART)
    drift = np.abs((mass * run.particles.velocity).sum(axis=0) - carried).max() / size
    return Crowd(smallest, np.array(energy), float(drift), math.nan, run.steps)
