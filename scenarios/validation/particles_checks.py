"""Runs behind the validation of the particle engine: one sphere, beds, slopes, hoppers and dense suspensions.

Each function sets up a case, runs it and returns numbers, which :mod:`scenarios.validation.particles` and the tests
compare with references.
"""

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
from closures import contact

GRAVITY = 9.81
DOWN = (0.0, 0.0, -GRAVITY)

BALL_RADIUS, BALL_DENSITY, DROP_HEIGHT = 0.1, 2600.0, 0.5
"""Sphere of MFIX DEM01 and DEM02, and the height of its centre at the start."""


def drop(stiffness: float, restitution: float, until: float, samples: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Let the sphere of DEM01 and DEM02 fall onto a linear spring.

    stiffness  k_n [N/m]
    until      end of the record [s]
    returns    time [s] and height of the centre [m]
    """
    ball = Material(density=BALL_DENSITY, youngs_modulus=1e9, poisson=0.3, restitution=restitution)
    sphere = make_particles([[0.0, 0.0, DROP_HEIGHT]], BALL_RADIUS, BALL_DENSITY)
    run = ParticleSolver(
        sphere,
        pair_table([ball]),
        walls=[Plane()],
        laws=Laws(contact="linear", normal_stiffness=stiffness, tangential_stiffness=stiffness),
        gravity=DOWN,
        skin=3.0 * DROP_HEIGHT,
    )
    whole = math.ceil(until / samples / (0.02 * math.pi * math.sqrt(float(sphere.mass[0]) / stiffness)))
    time, height = [0.0], [DROP_HEIGHT]
    for _ in range(samples):
        run.advance(until / samples / whole, whole)
        time.append(run.time)
        height.append(float(run.particles.position[0, 2]))
    return np.array(time), np.array(height)


def drop_exactly(stiffness: float, restitution: float, time: np.ndarray) -> np.ndarray:
    """Height of the same sphere from the solution of its damped oscillator, flight by flight (n,) [m]."""
    mass = BALL_DENSITY * 4.0 / 3.0 * math.pi * BALL_RADIUS**3
    rate = math.sqrt(stiffness / mass)
    ratio = -math.log(restitution) / math.hypot(math.pi, math.log(restitution))
    swing = rate * math.sqrt(1.0 - ratio**2)
    rest = GRAVITY / rate**2
    height = np.empty_like(time)
    begin, start, speed, flying = 0.0, DROP_HEIGHT - BALL_RADIUS, 0.0, True
    while begin <= time[-1]:
        ago = time - begin
        if flying:  # from height `start` above touch, with upward speed
            lasts = (speed + math.sqrt(speed**2 + 2.0 * GRAVITY * start)) / GRAVITY
            path = BALL_RADIUS + start + speed * ago - 0.5 * GRAVITY * ago**2
            speed -= GRAVITY * lasts
        else:
            sine = (-speed - ratio * rate * rest) / swing

            def overlap(t: np.ndarray | float, sine: float = sine) -> np.ndarray:
                decay = np.exp(-ratio * rate * np.asarray(t))
                return rest + decay * (-rest * np.cos(swing * np.asarray(t)) + sine * np.sin(swing * np.asarray(t)))

            path = BALL_RADIUS - overlap(ago)
            fine = np.linspace(1e-6, 3.0 * math.pi / swing, 200_001)
            apart = overlap(fine) <= 0.0
            lasts = float(fine[np.argmax(apart)]) if apart.any() else math.inf
            if not apart.any():
                height[ago >= 0.0] = path[ago >= 0.0]
                break
            speed = float((overlap(lasts - 1e-6 / rate) - overlap(lasts)) / (1e-6 / rate))
            start = 0.0
        here = ago >= 0.0
        height[here] = path[here]
        begin, flying = begin + lasts, not flying
    return height


def slide(friction: float, linear: bool = False, keep: float = 0.05) -> dict[str, float]:
    """MFIX DEM04: a sphere that lies on a floor is pushed to 0.1 m/s, slides, and rolls.

    linear   by linear springs instead of Hertz and Mindlin
    keep     time to follow the rolling sphere [s]
    returns  time at which sliding ends over u0/(mu g), then speed and spin over their first values at the end
             of sliding and after `keep`
    """
    radius, density, speed = 0.5e-3, 1e4, 0.1
    ball = Material(density=density, youngs_modulus=1e9, poisson=0.3, restitution=0.8, friction=friction)
    table = pair_table([ball])
    weight = density * 4.0 / 3.0 * math.pi * radius**3 * GRAVITY
    stiffness = 1e4
    hertz = contact.hertz_stiffness(float(table[0, 0]["contact_modulus"]), radius)
    overlap = weight / stiffness if linear else (weight / hertz) ** (2.0 / 3.0)
    laws = Laws(contact="linear", normal_stiffness=stiffness, tangential_stiffness=stiffness) if linear else Laws()
    sphere = make_particles([[0.0, 0.0, radius - overlap]], radius, density, velocity=[speed, 0.0, 0.0])
    run = ParticleSolver(sphere, table, walls=[Plane()], laws=laws, gravity=DOWN)
    step = 0.5 * run.time_scales(0.001).recommended
    slid = False
    while True:  # sliding begins where friction reaches Coulomb's limit, and ends where it falls below
        run.advance(step)
        pull, press = float(run.particles.force[0, 0]), float(run.particles.force[0, 2]) + weight
        sliding = abs(pull) > (1.0 - 1e-6) * friction * press
        if slid and not sliding:
            break
        slid = slid or sliding
    found = {"time": run.time * friction * GRAVITY / speed}
    for when, steps in (("end of sliding", 0), ("rolling", max(1, int(keep / step)))):
        run.advance(step, steps)
        found[f"speed, {when}"] = float(run.particles.velocity[0, 0]) / speed
        found[f"spin, {when}"] = float(run.particles.spin[0, 1]) * radius / speed
    return found


def strike(angle: float, linear: bool = False) -> dict[str, float]:
    """Kharaz et al. (2001): 5 mm aluminium oxide at 3.9 m/s on thick glass.

    angle   of impact, from the normal [deg]
    linear  by the linear springs of MFIX DEM05 instead of Hertz and Mindlin
    """
    alumina = Material(density=4000, youngs_modulus=380e9, poisson=0.23, friction=0.092, restitution=0.98)
    glass = Material(density=2500, youngs_modulus=70e9, poisson=0.25, friction=0.092, restitution=0.98)
    radius = 2.5e-3
    down, along = 3.9 * math.cos(math.radians(angle)), 3.9 * math.sin(math.radians(angle))
    table = pair_table([alumina, glass])
    sphere = make_particles([[0.0, 0.0, radius]], radius, alumina.density, velocity=[along, 0.0, -down])
    laws = Laws(contact="linear", normal_stiffness=1.72e7, tangential_stiffness=1.48e7) if linear else Laws()
    run = ParticleSolver(sphere, table, walls=[Plane(material=1)], laws=laws, skin=radius)
    step = run.time_scales(down).hertz
    while not (run.time > 10 * step and run.gap[0] > 0.0):
        run.advance(step)
    x, _, z = run.particles.velocity[0]
    return {
        "e_t": float(x) / along,
        "omega_out [rad/s]": float(run.particles.spin[0, 1]),
        "com_rebound_angle [deg]": math.degrees(math.atan2(x, z)),
    }


DIAMETER = 1e-3
GRAIN = Material(density=2500, youngs_modulus=10e6, poisson=0.25, restitution=0.5, friction=0.5)
"""Grains of poured beds, of 1 mm."""


class Rest(NamedTuple):
    """A poured bed and what it did after it had come to rest."""

    run: ParticleSolver
    poured: float  # energy it fell with [J]
    settled: float  # time from which on it was at rest [s]
    energy: np.ndarray  # kinetic energy afterwards [J]
    weight: np.ndarray  # vertical force on the walls over the weight of the bed, afterwards [-]


def rest(
    count: int, width: float, watch: float, periodic: bool = True, samples: int = 100, rolling_friction: float = 0.1
) -> Rest:
    """Pour a bed and watch it lie.

    Grains that nothing keeps from rolling and twisting roll and spin for ever: rolling is resisted by a spring that
    yields and a dashpot.

    width     of the square column [m]
    watch     time to look at the bed after it has come to rest [s]
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
    energy, carried = [], []
    step = 0.5 * run.time_scales(0.1).recommended
    while len(energy) < samples:
        run.advance(step, max(1, int(watch / samples / step)))
        energy.append(kinetic_energy(run.particles))
        carried.append(-float(run.wall_force[:, 2].sum()) / weight)
        if energy[-1] > AT_REST * poured and run.time < settled + 1.0:  # it swings back: at rest is from here on
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

    Spheres of 1 mm, periodic along and across the slope. Asperities of 5 um keep resting particles apart further
    than their weight presses them together, as in glass, so that they rest where film and contact share the load.

    film     under water, films on
    onset    of friction: "film" or "overlap"
    shape    of the bed along, across and normal to the slope, in diameters
    rolling_friction  mu_r of a rolling spring that yields and a dashpot; nothing resists rolling where it is 0 [-]
    returns  angle at which the mean speed reaches 0.2 sqrt(g d) [deg], and the history of angle [deg] and speed [m/s]
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
    grains = make_particles(
        places, 0.5 * DIAMETER, glass.density, viscosity=1e-3 if film else 0.0, fixed=places[:, 2] < DIAMETER
    )
    run = ParticleSolver(
        grains,
        pair_table([glass]),
        laws=Laws(
            film=film,
            friction_onset=onset,
            rolling="spring_dashpot" if rolling_friction > 0.0 else "none",
        ),
        gravity=DOWN,
        box=(box[0], box[1], None),
    )
    step, moving = 1e-5, run.particles.inverse_mass > 0.0
    run.advance(step, 5000)
    angle, speed, angles, speeds = 0.0, 0.0, [0.0], [0.0]
    while angle < 60.0 and speed < 0.2 * math.sqrt(GRAVITY * DIAMETER):
        angle += 0.1
        lean = math.radians(angle)
        run.gravity = (GRAVITY * math.sin(lean), 0.0, -GRAVITY * math.cos(lean))
        run.advance(step, 200)
        speed = float(run.particles.velocity[moving, 0].mean())
        angles.append(angle)
        speeds.append(speed)
    return angle, np.array(angles), np.array(speeds)


def hopper(count: int, outlet: float, seconds: float) -> tuple[float, float]:
    """Let particles flow out of a drum with a round hole in its nearly flat bottom.

    outlet   diameter of the hole [particle diameters]
    seconds  length of the run
    returns  discharge of the later half of the run, and that of Beverloo, Leniger & van de Velde (1961) with
             C = 0.58, k = 1.4 and a bulk density of 0.58 of that of the particles [kg/s]
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
    size = (outlet - 1.4) * DIAMETER
    return float(np.polyfit(time, gone, 1)[0]), 0.58 * 0.58 * grain.density * math.sqrt(GRAVITY) * size**2.5


class Crowd(NamedTuple):
    """What happened to a dense suspension."""

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
        spheres,
        pair_table([SUSPENDED]),
        laws=Laws(film=True),
        box=(box[0], box[1], None if fixed else box[2]),
    )
    return run, upper[run.particles.id]


def shear(solid_fraction: float, steps: int, speed: float = 0.02, press: float = 0.0, count: int = 1000) -> Crowd:
    """Shear a dense suspension between layers of its own spheres at the Hertz step.

    speed  of the upper layer, which is held [m/s]
    press  if given, the upper layer is a free lid under this pressure and half as much traction [Pa]
    """
    run, upper = suspension(count, solid_fraction, fixed=True)
    if press > 0.0:
        made = run.particles
        made.inverse_mass[upper] = 1.0 / made.mass[upper]
        made.inverse_inertia[upper] = 2.5 / (made.mass[upper] * made.radius[upper] ** 2)
        area = float(run.box[0] * run.box[1])
        made.applied[upper] = np.array([0.5, 0.0, -1.0]) * press * area / int(upper.sum())
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
    """Random velocities among spheres whose contacts have been taken away: only films act.

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
