"""The film between two particles: against closed forms, an independent solution, and where it is very stiff.

The model: Nijssen, Ottens & Padding, Powder Technol. (2023), doi:10.1016/j.powtec.2022.118017, eqs (1) to (10), with
the fifth root in the gap of Davis, Serayssol & Hinch, J. Fluid Mech. 163 (1986) 479. A step is 2 % of the Hertz time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from impacts import STEP, Pair, kinetic_energy, normal_speed
from scipy.integrate import solve_ivp

from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import SMOOTHEST, pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures import contact

GLASS = Material(density=2540, youngs_modulus=60e9, poisson=0.23, restitution=0.97, friction=0.15, roughness=134e-9)
DELRIN = Material(density=1400, youngs_modulus=2.8e9, poisson=0.35, restitution=0.97, friction=0.2, roughness=796e-9)


@dataclass
class TypicalCollision:
    """A head-on approach at speed v0 at the reach of the film, h_co = R*, as the model prescribes it."""

    pair: Pair
    strength: float = field(init=False)  # A [N s]
    speed_scale: float = field(init=False)  # B = A/m* [m/s]
    minimum_gap: float = field(init=False)
    by_film: bool = field(init=False)  # h_min by the film's pressure, not by asperities

    def __post_init__(self) -> None:
        pair = self.pair
        radius, row = pair.reduced_radius, pair.rows[0, 1]
        self.strength = 6.0 * math.pi * pair.viscosity * radius**2
        self.speed_scale = self.strength / pair.reduced_mass
        deformed = 0.37 * ((pair.viscosity * pair.approach / row["film_modulus"]) ** 2 * radius**3) ** 0.2
        self.by_film = bool(deformed > row["roughness_gap"])
        self.minimum_gap = max(deformed, float(row["roughness_gap"]))

    @property
    def logarithm(self) -> float:
        """ln(h_co/h_min)"""
        return math.log(self.pair.reduced_radius / self.minimum_gap)

    @property
    def depth(self) -> float:
        """delta_max/h_min of the dry impact."""
        pair = self.pair
        return contact.hertz_largest_overlap(pair.reduced_mass, pair.stiffness, pair.approach) / self.minimum_gap

    @property
    def film_rate(self) -> float:
        """lambda dt: the film's rate at h_min over a step."""
        return self.speed_scale / self.minimum_gap * STEP * self.pair.hertz_time

    def converged(self) -> float:
        """Restitution by closed forms in the film and a tight Runge-Kutta solution below h_min."""
        pair, speed = self.pair, self.pair.approach
        arriving = speed - self.speed_scale * self.logarithm
        if arriving <= 0.0:
            return 0.0
        loss = float(pair.rows[0, 1]["restitution"])
        ratio = -math.sqrt(5.0) * math.log(loss) / math.hypot(math.log(loss), math.pi)
        length = contact.hertz_largest_overlap(pair.reduced_mass, pair.stiffness, speed)
        gap_unit = self.minimum_gap / length
        stiffness = pair.stiffness * length**2.5 / (pair.reduced_mass * speed**2)
        film = self.speed_scale / speed

        def rates(_: float, state: np.ndarray) -> list[float]:
            overlap, sinking = state
            depth = max(overlap, 0.0)
            share = min(1.0, depth / gap_unit)
            solid = stiffness * depth**1.5 + ratio * math.sqrt(stiffness) * depth**0.25 * sinking
            return [sinking, -share * solid - film * (1.0 - share) / gap_unit * sinking]

        def back(_: float, state: np.ndarray) -> float:
            return float(state[0]) + 1e-14

        back.terminal, back.direction = True, -1.0  # type: ignore[attr-defined]
        solved = solve_ivp(
            rates, (0.0, 1e5), [0.0, arriving / speed], "LSODA", events=back, rtol=1e-10, atol=1e-13, max_step=np.inf
        )
        leaving = -speed * float(solved.y[1, -1]) if solved.status == 1 else 0.0
        return max(0.0, (leaving - self.speed_scale * self.logarithm) / speed)

    def simulated(self, integrator: str, fraction: float = STEP) -> float:
        """Restitution of the engine with one step size throughout."""
        pair = self.pair
        pair.gap = pair.reduced_radius
        record = integrator == "verlet"  # as other tests have it, whose loops these are
        laws = Laws(film=True, integrator=integrator)
        run = pair.simulation(laws, skin=4.0 * max(pair.radii), record=record)
        step = fraction * pair.hertz_time
        crossing = max(1, math.ceil(pair.gap / (pair.approach * step) / 20))
        for _ in range(5000):
            run.advance(step, crossing)
            rate = normal_speed(run)
            if rate > 0.0 and run.gap[0] >= pair.reduced_radius:
                return rate / pair.approach
            if abs(rate) < 5e-4 * pair.approach and run.gap[0] > 0.99 * self.minimum_gap:
                return 0.0
        raise AssertionError("the collision does not end")


def by_stokes(material: Material, diameter: float, stokes: float, speed: float, wall: bool = False) -> TypicalCollision:
    """A pair of equal spheres, or a sphere and a wall of the same, whose viscosity follows from St."""
    pair = Pair((material, material), (0.5 * diameter,) * 2, speed, wall=wall)
    pair.viscosity = pair.reduced_mass * speed / (6.0 * math.pi * pair.reduced_radius**2 * stokes)
    return TypicalCollision(pair)


CHECKPOINTS = {
    "delrin": (DELRIN, {20: 0.1054, 30: 0.3941, 50: 0.6250, 100: 0.7982, 200: 0.8848, 500: 0.9367, 2000: 0.9627}),
    "glass": (GLASS, {20: 0.0, 30: 0.2762, 50: 0.5539, 100: 0.7622, 200: 0.8664, 500: 0.9288, 2000: 0.9601}),
}
"""Converged restitution of 12.7 mm spheres at 0.1 m/s over St, solved independently of the engine and of this file."""


@pytest.mark.parametrize("name", CHECKPOINTS)
def test_immersed_restitution_at_checkpoints(name: str) -> None:
    """The engine and the solution in this file both give the converged values, within 1e-3 and the printed digit."""
    material, values = CHECKPOINTS[name]
    for stokes, restitution in values.items():
        collision = by_stokes(material, 12.7e-3, stokes, 0.1)
        assert collision.converged() == pytest.approx(restitution, abs=1e-4), stokes
        assert collision.simulated("drift") == pytest.approx(restitution, abs=1e-3), stokes


def random_collision(seed: int) -> TypicalCollision:
    """Diameter 0.2 to 13 mm, E 50 MPa to 190 GPa, rough and smooth, a pair, an unlike pair or a wall."""
    draw = np.random.default_rng(seed)
    kind = ("pair", "unlike", "wall")[seed % 3]
    solids = []
    for _ in range(2):
        solids.append(
            Material(
                density=draw.uniform(1000.0, 8000.0),
                youngs_modulus=math.exp(draw.uniform(math.log(50e6), math.log(190e9))),
                poisson=draw.uniform(0.1, 0.45),
                restitution=draw.uniform(0.8, 1.0),
                roughness=10 ** draw.uniform(-9.0, -6.0),
            )
        )
    diameter = math.exp(draw.uniform(math.log(0.2e-3), math.log(13e-3)))
    other = math.exp(draw.uniform(math.log(0.2e-3), math.log(13e-3)))
    if kind == "pair":
        solids[1], other = solids[0], diameter
    pair = Pair(tuple(solids), (0.5 * diameter, 0.5 * other), 10 ** draw.uniform(-1.7, 0.0), wall=kind == "wall")
    stokes = 10 ** draw.uniform(1.2, 2.7)
    pair.viscosity = pair.reduced_mass * pair.approach / (6.0 * math.pi * pair.reduced_radius**2 * stokes)
    return TypicalCollision(pair)


COLLISIONS = [random_collision(seed) for seed in range(30)]


def test_sample_holds_both_mechanisms() -> None:
    """The random collisions turn back on asperities and on the film's own pressure, deep and shallow."""
    assert 8 <= sum(collision.by_film for collision in COLLISIONS) <= 22
    assert min(e.depth for e in COLLISIONS) < 5.0 and max(e.depth for e in COLLISIONS) > 50.0
    assert sum(e.converged() > 0.0 for e in COLLISIONS) >= 20


@pytest.mark.parametrize("seed", range(30))
def test_lubricated_drift_is_converged(seed: int) -> None:
    """Restitution at 2 % of the Hertz time within 1e-3 of the converged solution of the same model."""
    collision = COLLISIONS[seed]
    assert collision.simulated("drift") == pytest.approx(collision.converged(), abs=1e-3)


@pytest.mark.parametrize("seed", [n for n, e in enumerate(COLLISIONS) if e.depth < 15.0 and e.film_rate < 1.0])
def test_plain_verlet_is_near(seed: int) -> None:
    """Restitution with the film as a force within 0.012 where delta_max/h_min < 15 and lambda dt < 1."""
    collision = COLLISIONS[seed]
    assert collision.simulated("verlet") == pytest.approx(collision.converged(), abs=0.012)


@pytest.mark.parametrize("stokes", [1.0, 2.0, 4.0, 6.0])
@pytest.mark.parametrize("wall", [False, True], ids=["pair", "wall"])
def test_film_stops_a_slow_pair_where_it_must(stokes: float, wall: bool) -> None:
    """Above h_min the speed is linear in ln h, and the pair stops at h_co exp(-St); both within 1e-3 (ours 1e-6)."""
    collision = by_stokes(DELRIN, 12.7e-3, stokes, 0.1, wall)
    pair, reach = collision.pair, collision.pair.reduced_radius
    pair.gap = reach
    run = pair.simulation(Laws(film=True))
    step = STEP * pair.hertz_time
    for _ in range(400):
        run.advance(step, math.ceil(0.02 * reach / (pair.approach * step)))
        law = -pair.approach + collision.speed_scale * math.log(reach / run.gap[0])
        assert normal_speed(run) == pytest.approx(law, abs=1e-3 * pair.approach)
    assert abs(normal_speed(run)) <= 1e-6 * pair.approach
    assert run.gap[0] == pytest.approx(reach * math.exp(-stokes), rel=1e-3)


BEAD = Material(density=2500, youngs_modulus=60e9, poisson=0.23, restitution=0.97, friction=0.3, roughness=20e-9)
GLYCEROL = 1.0
BEAD_RADIUS = 50e-6


def bead(roughness: float) -> Material:
    """Glass of the given height of asperities [m]."""
    return BEAD.model_copy(update={"roughness": roughness})


def press(count: int, material: Material, force: float, gaps: list[float], wall: bool = False) -> ParticleSolver:
    """Beads of 100 um in a row along x in glycerol, pressed from both ends, or against the wall x = 0 [N, m]."""
    first = BEAD_RADIUS + gaps[0] if wall else 0.0
    steps = np.array([2.0 * BEAD_RADIUS + gap for gap in gaps[1 if wall else 0 :][: count - 1]])
    position = np.zeros((count, 3))
    position[:, 0] = first + np.concatenate([[0.0], np.cumsum(steps)])
    made = make_particles(position, BEAD_RADIUS, material.density, viscosity=GLYCEROL)
    made.applied[-1, 0] = -force
    if not wall:
        made.applied[0, 0] = force
    planes = [Plane(normal=(1.0, 0.0, 0.0))] if wall else []
    return ParticleSolver(made, pair_table([material]), walls=planes, laws=Laws(film=True))


def weighted_contact_energy(gap: float, minimum_gap: float, stiffness: float) -> float:
    """Work stored below h_min: quadrature of the Hertz force times its lever, from h to h_min."""
    if gap >= minimum_gap:
        return 0.0
    nodes, weights = np.polynomial.legendre.leggauss(40)
    below = minimum_gap - gap
    overlap = 0.5 * below * (nodes + 1.0)
    share = np.minimum(1.0, overlap / minimum_gap)
    return float(0.5 * below * np.sum(weights * share * stiffness * overlap**1.5))


def contact_modulus(material: Material) -> float:
    """E* of two of these solids [Pa]."""
    return float(pair_table([material])[0, 0]["contact_modulus"])


def total_energy(run: ParticleSolver) -> float:
    """Kinetic, stored in contacts, and potential of the press, which is 0 where all touch [J]."""
    modulus = float(run.table[0, 0]["contact_modulus"])
    stored = 0.0
    for k, (gap, minimum_gap) in enumerate(zip(run.gap, run.edges.minimum_gap)):
        radius = BEAD_RADIUS if k >= run.edges.between_particles else 0.5 * BEAD_RADIUS
        stored += weighted_contact_energy(gap, minimum_gap, contact.hertz_stiffness(modulus, radius))
    force = -float(run.particles.applied[-1, 0])
    return float(kinetic_energy(run.particles).sum()) + stored + force * float(run.gap.sum())


def bead_step(reference_speed: float, wall: bool) -> float:
    """2 % of the Hertz time of two beads at a reference speed [s]."""
    pair = Pair((BEAD, BEAD), (BEAD_RADIUS,) * 2, reference_speed, wall=wall)
    return STEP * pair.hertz_time


def rises(energies: list[float]) -> float:
    """Largest rise of the energy above any earlier value, over its maximum."""
    series = np.array(energies)
    return float(np.max(series - np.minimum.accumulate(series)) / series.max())


ROWS: dict[str, tuple[int, list[float], bool]] = {
    "pair": (2, [400e-9], False),
    "wall": (1, [400e-9], True),
    "three": (3, [400e-9, 150e-9], False),
    "five": (5, [300e-9, 60e-9, 200e-9, 90e-9], False),
    "four on a wall": (4, [100e-9, 300e-9, 50e-9, 200e-9], True),
}


def press_until_rest(row: str, roughness: float, reference_speed: float) -> None:
    """Press beads to h_min: gaps stay positive, the energy never rises by 1e-3 of its maximum.

    lambda dt, the film's rate at h_min over a step, is 1.4 to 33 here: a film that acts as a force throws the beads
    apart. In the end the contacts alone carry the press, within 2 %.
    """
    count, gaps, wall = ROWS[row]
    material = bead(roughness)
    radius = BEAD_RADIUS if wall and count == 1 else 0.5 * BEAD_RADIUS
    force = 0.3 * contact.hertz_stiffness(contact_modulus(material), radius) * roughness**1.5
    run = press(count, material, force, [gap + roughness for gap in gaps], wall)
    step = bead_step(reference_speed, wall and count == 1)
    widest = BEAD_RADIUS if wall else 0.5 * BEAD_RADIUS
    closing = 6.0 * math.pi * GLYCEROL * widest**2 / force  # time in which the widest film closes by e
    pause = math.ceil(8.0 * closing / step / 200)
    energies = [total_energy(run)]
    for _ in range(200):
        for steps in (1, 1, 3, pause):
            run.advance(step, steps)
            energies.append(total_energy(run))
            assert (run.gap > 0.0).all()
    assert rises(energies) <= 1e-3
    assert (run.gap < run.edges.minimum_gap).all()
    carried = np.linalg.norm(run.edges.force, axis=1)
    assert carried == pytest.approx(np.full(len(carried), force), rel=0.02)


@pytest.mark.parametrize(
    ("row", "roughness", "reference_speed"),
    [("pair", 20e-9, 0.1), ("pair", 134e-9, 0.01), ("wall", 20e-9, 0.01), ("five", 134e-9, 0.1)],
)
def test_stiff_film_under_a_press(row: str, roughness: float, reference_speed: float) -> None:
    """The 2 % step of a fast and of a slow reference speed, rough and smooth, many films at once."""
    press_until_rest(row, roughness, reference_speed)


@pytest.mark.slow
@pytest.mark.parametrize("reference_speed", [0.1, 0.01])
@pytest.mark.parametrize("roughness", [20e-9, 134e-9], ids=["20 nm", "134 nm"])
@pytest.mark.parametrize("row", ROWS)
def test_stiff_films_in_rows_under_a_press(row: str, roughness: float, reference_speed: float) -> None:
    """The same for every row, roughness and step."""
    press_until_rest(row, roughness, reference_speed)


def test_solids_without_roughness_part_from_rest() -> None:
    """A film between solids of roughness 0 ends at the size of an atom: a pair at touch, pulled apart, stays finite."""
    smooth = Material(density=2500, youngs_modulus=1e9, poisson=0.25)
    pair = make_particles(
        [[0.0, 0.0, 0.0], [2.1e-3, 0.0, 0.0]], 1e-3, 2500, velocity=[[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]]
    )
    pair.viscosity[:] = 1e-3
    run = ParticleSolver(pair, pair_table([smooth]), laws=Laws(film=True))
    run.advance(2e-4, 5)
    assert 0.0 < run.particles.velocity[1, 0] < 0.1
    assert run.edges.minimum_gap[0] == SMOOTHEST
