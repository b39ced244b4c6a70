"""Drag of a sphere beside a wall: the laws against exact resistances, and film and drag together."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.optimize import brentq

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.coupling.forces.drag import CLOSEST, WallDrag
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.self_disturbance_cut_cells import SolidsOfCells, WallsOfCells
from cfddem.coupling.self_disturbance_tables import MODES, tables_of
from cfddem.coupling.self_disturbance_walls import FARTHEST, PLACES, OwnSolids, flow_beside, solid_beside
from cfddem.coupling.transfer import Directions, after_source, by_axis, implicit_coefficients
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Grid
from cfddem.fluid.surfaces import Plane as SmoothPlane
from cfddem.fluid.surfaces import cylinder, turned
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from cfddem.run.simulation import Simulation
from closures.lubrication import film_resistance, film_strength
from closures.tangential_lubrication import film_logarithm, shear_resistance
from closures.wall_drag import along_wall, film_along_wall, towards_wall
from scenarios.beds.settling import study as settling
from scenarios.beds.settling.study import RADIUS as RADIUS_OF_NYLON
from scenarios.beds.settling.study import Walls, land, land_on_grid, landing_ode

RADIUS, VISCOSITY = 1e-3, 0.1
STOKES = 6.0 * math.pi * VISCOSITY * RADIUS

ALONG = {
    0.003202: 4.0222, 0.005004: 3.7863, 0.0453: 2.6480, 0.1276: 2.1516, 0.5431: 1.5674, 1.3524: 1.3079, 2.7622: 1.1738,
    9.0677: 1.0591,
}  # fmt: skip
"""Gap over radius: drag along the wall over Stokes', exact to the digits given. From 0.0453 on by `blake_rings`, below
by the limit near contact, 0.9543 - 8/15 ln x + (64/375) x ln(1/x) + 0.4287 x, with which `blake_rings` agrees within
2e-4 at 0.0453 and 0.1276. Goldman, Cox & Brenner (1967), table 1, have the same within 4e-4."""


def blake(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Velocities (n, m, 3, 3) at x (n, 3) by point forces at y (m, 3) over a no-slip wall at z = 0, times 8 pi eta.

    Blake, Proc. Camb. Phil. Soc. 70 (1971) 303.
    """
    identity = np.eye(3)

    def stokeslet(apart: np.ndarray) -> np.ndarray:
        distance = np.linalg.norm(apart, axis=-1)[..., None, None]
        found: np.ndarray = identity / distance + apart[..., :, None] * apart[..., None, :] / distance**3
        return found

    away = x[:, None, :] - y * [1.0, 1.0, -1.0]
    r, height = np.linalg.norm(away, axis=-1), y[:, 2]
    flow = stokeslet(x[:, None, :] - y) - stokeslet(away)
    for i in range(3):
        for j in range(3):
            doublet = identity[i, j] / r**3 - 3.0 * away[..., i] * away[..., j] / r**5
            gradient = (identity[i, j] * away[..., 2] + away[..., i] * identity[j, 2]) / r**3
            gradient -= identity[i, 2] * away[..., j] / r**3 + 3.0 * away[..., i] * away[..., 2] * away[..., j] / r**5
            flow[..., i, j] += (2.0 if j < 2 else -2.0) * height * (height * doublet - gradient)
    return flow


def blake_rings(gap: float, rings: int = 40, points: int = 80, turns: int = 64) -> float:
    """Drag along the wall over Stokes', by rings of point forces inside the sphere that move its surface."""

    def angles(count: int) -> np.ndarray:
        share = (np.arange(count) + 0.5) / count
        return math.pi * (share**2 if gap < 0.3 else share)

    around, seen = 2.0 * math.pi * (np.arange(turns) + 0.5) / turns, angles(points)
    radial = np.stack([np.cos(around), np.sin(around), 0.0 * around], axis=1)
    turned = np.stack([-np.sin(around), np.cos(around), 0.0 * around], axis=1)
    upward = np.tile([0.0, 0.0, 1.0], (turns, 1))
    patterns = (radial * radial[:, :1], turned * turned[:, :1], upward * radial[:, :1])
    height, width = 1.0 + gap - np.cos(seen), np.sin(seen)
    front, side = np.stack([width, 0.0 * width, height], axis=1), np.stack([0.0 * width, width, height], axis=1)
    columns = []
    for angle in angles(rings):
        inner = 1.0 - min(0.9 * (gap + 1.0 - math.cos(angle)), 0.5)
        ring = inner * math.sin(angle) * radial + (1.0 + gap - inner * math.cos(angle)) * upward
        in_front, aside = blake(front, ring), blake(side, ring)
        for pattern in patterns:
            fore, across = (np.einsum("nmij,mj->ni", flow, pattern) / turns for flow in (in_front, aside))
            columns.append(np.concatenate([fore[:, 0], fore[:, 2], across[:, 0]]))
    matrix = np.array(columns).T
    size = np.linalg.norm(matrix, axis=0)
    wanted = np.concatenate([np.ones(points), np.zeros(points), np.ones(points)])
    force = np.linalg.lstsq(matrix / size, wanted, rcond=1e-13)[0] / size
    assert np.abs(matrix @ force - wanted).max() < 1e-4
    return float(force[0::3].sum() + force[1::3].sum()) * 0.5 * 8.0 / 6.0


def test_the_table_is_the_drag_of_a_sphere_between_images() -> None:
    """Point forces with Blake's images that move the whole surface of the sphere along the wall: within 1e-4."""
    for gap in (0.1276, 0.5431, 2.7622):
        assert blake_rings(gap) == pytest.approx(ALONG[gap], abs=1e-4)


def brenner(gap: float) -> float:
    """Brenner's series (1961) for the drag towards a wall over Stokes'."""
    a, total = math.acosh(1.0 + gap), 0.0
    for n in range(1, max(10, int(20.0 / a))):
        squares = (2.0 * math.sinh((n + 0.5) * a)) ** 2 - ((2 * n + 1) * math.sinh(a)) ** 2
        ratio = (2.0 * math.sinh((2 * n + 1) * a) + (2 * n + 1) * math.sinh(2.0 * a)) / squares
        total += n * (n + 1) / ((2 * n - 1) * (2 * n + 3)) * (ratio - 1.0)
    return 4.0 / 3.0 * math.sinh(a) * total


def test_the_law_towards_a_wall_is_the_series() -> None:
    for gap in np.geomspace(CLOSEST, 10.0, 30).tolist():
        assert 1.0 / gap + towards_wall(gap) == pytest.approx(brenner(gap), rel=1.5e-3)


def test_the_law_along_a_wall_is_the_table() -> None:
    for gap, exact in ALONG.items():
        assert along_wall(gap) == pytest.approx(exact, rel=4e-3)
    for gap in (1e-4, 1e-3):
        assert along_wall(gap) == pytest.approx(0.9543 - 8.0 / 15.0 * math.log(gap), rel=4e-3)
    for gap in (5.0, 10.0, 50.0):
        place = 1.0 / (1.0 + gap)
        faxen = 1.0 - 9.0 / 16.0 * place + place**3 / 8.0 - 45.0 / 256.0 * place**4 - place**5 / 16.0
        assert along_wall(gap) == pytest.approx(1.0 / faxen, rel=4e-3)


def extra(slip: list[float], gaps: list[float], which: str = "nearest", **films: bool) -> np.ndarray:
    """Extra force over Stokes' conductance of spheres over a floor under a lid (N, 3)."""
    places = [[0.0, 0.0, (1.0 + gap) * RADIUS] for gap in gaps]
    spheres = make_particles(places, RADIUS, 2000.0, viscosity=VISCOSITY)
    lid = Plane(point=(0.0, 0.0, 30.0 * RADIUS), normal=(0.0, 0.0, -1.0))
    force = WallDrag([Plane(), lid], which, **({"film": True} | films))  # type: ignore[arg-type]
    return np.asarray(force.resistance(spheres) @ slip) / STOKES


GAPS = [10.0, 5.0, 2.0, 1.001, 0.999, 0.5, 0.1, 0.01, 1e-3, 1e-4]
MINIMUM = 1e-4 * RADIUS


@pytest.mark.parametrize("film", [True, False])
def test_a_sphere_feels_the_exact_resistance_towards_the_wall(film: bool) -> None:
    """Stokes' drag, the film and the extra drag together: within 0.2 % at every gap."""
    found = extra([0.0, 0.0, 1.0], GAPS, film=film)
    assert np.abs(found[:, :2]).max() < 1e-12
    for gap, one in zip(GAPS, found[:, 2].tolist()):
        strength = film_strength(VISCOSITY, RADIUS)
        of_film = film_resistance(strength, gap * RADIUS, MINIMUM, RADIUS) / STOKES if film else 0.0
        assert 1.0 + one + of_film == pytest.approx(brenner(gap), rel=2e-3)


@pytest.mark.parametrize("shear", [True, False])
def test_a_sphere_feels_the_exact_resistance_along_the_wall(shear: bool) -> None:
    """With and without a film against sliding: within 0.4 % at every gap."""
    gaps = list(ALONG)
    found = extra([1.0, 0.0, 0.0], gaps, shear=shear)
    assert np.abs(found[:, 1:]).max() < 1e-12
    for gap, one in zip(gaps, found[:, 0].tolist()):
        of_film = film_along_wall(gap) if shear else 0.0
        assert 1.0 + one + of_film == pytest.approx(ALONG[gap], rel=4e-3)


def test_the_part_of_the_film_is_that_of_the_film_against_sliding() -> None:
    for gap in (1e-3, 0.1, 0.9, 2.0):
        film = shear_resistance(VISCOSITY, RADIUS, -1.0) * film_logarithm(gap * RADIUS, MINIMUM, RADIUS)
        assert film_along_wall(gap) == pytest.approx(film / STOKES, abs=1e-12)


def test_an_oblique_motion_is_the_sum_of_both() -> None:
    both = extra([1.0, 0.0, -2.0], [0.3]) - extra([1.0, 0.0, 0.0], [0.3]) - extra([0.0, 0.0, -2.0], [0.3])
    assert np.abs(both).max() < 1e-12


def test_all_walls_are_summed() -> None:
    nearest, every = (extra([0.0, 0.0, 1.0], [4.0], which)[0, 2] for which in ("nearest", "all"))
    assert every - nearest == pytest.approx(1.0 / 24.0 + towards_wall(24.0) - 1.0)


def test_walls_that_move_are_refused() -> None:
    with pytest.raises(InputError, match="at rest"):
        WallDrag([Plane(velocity=(0.0, 0.0, 1.0))], "nearest", film=True)


@pytest.mark.parametrize("walls", ["none", "nearest"])
def test_a_sphere_lands_as_the_equation_of_motion_says(walls: Walls) -> None:
    """Film and wall drag against the exact resistance, by another integrator: within 1 % of the terminal velocity."""
    density, viscosity, terminal = 962.0, 0.113, 0.091  # ten Cate et al. (2002), E3
    gaps, speeds = land(density, viscosity, walls)
    exact = landing_ode(density, viscosity, walls, gaps)
    assert np.abs(speeds - exact).max() < 0.01 * terminal
    assert gaps[-1] < 0.01 * RADIUS_OF_NYLON


@pytest.mark.parametrize("slips", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_shares_of_the_self_disturbance_beside_a_wall(slips: bool) -> None:
    """Steady flow at 4.5 cells from a wall by the images of Lorentz, or of a wall without friction, within 4 %."""
    cell, strength, sweeps = 2e-3, (0.01,) * 3, 7
    lattice = (cell,) * 3, strength, sweeps
    free, beside = tables_of(*lattice), flow_beside(2, "slips" if slips else "side", *lattice)[0, 4, :, :, 0, 0]
    assert (beside >= 0.0).all()
    away = 4.5 * cell
    for d, lost in ((0, -3.0 / 8.0 if slips else 9.0 / 16.0), (2, 3.0 / 4.0 if slips else 9.0 / 8.0)):
        whole = free.flow[d, :, 0, 0, 0].sum()
        left = beside[:, d].sum() / whole
        assert left == pytest.approx(1.0 - lost / (6.0 * math.pi * away * whole), abs=0.04)
    assert solid_beside(2, *lattice)[round(4.5 * PLACES)] == pytest.approx(1.0, abs=1e-6)


def left_by(*normal: float) -> np.ndarray:
    """What a smooth plane leaves of flows along its normal and along it (2, 3, MODES): in the cell at the wall, in the
    next one along the normal, and in the seventh from it."""
    point, unit = (0.8, 0.8, 0.0), np.array(normal) / np.linalg.norm(normal)
    grid = within(Grid((20, 20, 4), (0.1,) * 3), SmoothPlane(point, normal))  # type: ignore[arg-type]
    kernel = FilterKernel(grid, (True,) * 3, smoothing=0.15)
    places = np.array([0.85, 0.85, 0.25]) + np.outer([0.0, 0.1, 0.7], normal)
    walls, left = WallsOfCells(kernel), []
    for direction in (unit, np.array([-unit[1], unit[0], 0.0])):
        flow = walls.left(places, np.tile(direction, (3, MODES, 1)))
        left.append(flow @ direction)
        assert flow == pytest.approx(left[-1][:, :, None] * direction, abs=1e-6)
    return np.array(left)


def test_cells_beside_a_smooth_wall_leave_what_a_plane_leaves_at_their_distance() -> None:
    """Straight, and in the frame of a slanting wall."""
    kernel = FilterKernel(Grid((8, 8, 4), (0.1,) * 3), (False,) * 3, smoothing=0.15)
    lattice = kernel.grid.spacing, tuple(kernel.stages[0][1]), kernel.stages[0][0]
    beside, alone = flow_beside(0, "smooth", *lattice)[0, :, :, :, 0, 0], tables_of(*lattice).flow[..., 0, 0, 0].T
    straight, slanting = left_by(1.0, 0.0, 0.0), left_by(1.0, 1.0, 0.0)
    for direction in range(2):
        share = beside[:, :, direction] / alone[:, direction]
        assert straight[direction, :2] == pytest.approx(np.sqrt(share[:2]), rel=1e-6)
        farther = 1.0 - (1.0 - share[4]) * (FARTHEST - 0.5) / 7.5
        assert straight[direction, 2] == pytest.approx(np.sqrt(farther), rel=1e-6)
    assert (straight[:, :, :2] < slanting[:, :, :2]).all()  # long waves


def test_a_wall_leaves_flow_on_the_axis_where_its_distance_has_no_slope() -> None:
    """An odd number of cells across: the differences of the distance cancel in those on the axis."""
    grid = within(Grid((13, 13, 4), (0.1,) * 3), cylinder((0.65, 0.65, 0.0), 0.6))
    walls = WallsOfCells(FilterKernel(grid, (False, False, True), smoothing=0.1))
    flow = np.tile(np.eye(3), (MODES, 1, 1)).swapaxes(0, 1)
    left = walls.left(np.full((3, 3), 0.65) * (1.0, 1.0, 0.23), flow)
    assert (np.einsum("pmd,pmd->pm", left, flow)[:, :2] > 0.5).all()


@pytest.mark.parametrize("layers", [10, 4, 3])
@pytest.mark.parametrize(("smoothing", "within_share"), [(0.0, 1e-9), (0.08, 2e-3)])
def test_solids_that_a_sphere_gathers_of_its_own_beside_a_round_wall(
    smoothing: float, within_share: float, layers: int
) -> None:
    """Against the deposit of each alone, in a periodic pipe with a throat; the control has no walls, and misses up to
    half of it. Among few cells the neighbour over the periodic side is as near as the one on the other side."""
    line = np.array([(0.0, 0.55), (0.08, 0.48), (0.17, 0.55), (0.1 * layers, 0.55)])
    grid = within(Grid((13, 13, layers), (0.1,) * 3), turned(line.tolist(), (0.631, 0.617, 0.0)))
    kernel = FilterKernel(grid, (False, False, True), smoothing=smoothing)
    draw = np.random.default_rng(1)
    height, turn = draw.uniform(0.0, 0.1 * layers, 40), draw.uniform(0.0, 2.0 * math.pi, 40)
    away = np.interp(height, *line.T) - draw.uniform(0.015, 0.15, 40)
    places = np.stack([0.631 + away * np.cos(turn), 0.617 + away * np.sin(turn), height], axis=1)
    radius = np.full(40, 0.01)
    maps = [kernel.map_particles(place[None], radius[:1]) for place in places]
    alone = [kernel.gather(each.stencil, kernel.solid_fraction(each)[None])[0, 0] for each in maps]
    volume = 4.0 / 3.0 * math.pi * radius**3
    error = np.abs(SolidsOfCells(kernel, 1).of(places, volume) / alone - 1.0)
    without = np.abs(OwnSolids(kernel, 1, None).of(places, volume) / alone - 1.0)
    print(f"largest error {error.max():.3g}, without walls {without.max():.3g}")
    assert error.max() < within_share < without.max()


EDGE = 8.0 * RADIUS_OF_NYLON
"""Cells of 4 diameters [m]; a vessel of 12 of them across."""
OIL = (970.0, 3.73)
"""Density [kg/m3] and viscosity [Pa s]: Re = 0.02."""


def speed(factor: float) -> float:
    """Of the drag of Abraham and this part of a wall that balance the weight [m/s]."""
    (density, viscosity), radius = OIL, RADIUS_OF_NYLON
    weight = 4.0 / 3.0 * math.pi * radius**3 * (1120.0 - density) * 9.81

    def missing(v: float) -> float:
        reynolds = 2.0 * radius * density * v / viscosity
        drag = 0.5 * density * v**2 * math.pi * radius**2 * 24.0 / 9.06**2 * (1.0 + 9.06 / math.sqrt(reynolds)) ** 2
        return drag + 6.0 * math.pi * viscosity * radius * v * factor - weight

    return float(brentq(missing, 1e-8, 1.0))


class Beside(NamedTuple):
    """A sphere beside the wall of a cylinder or cone, 12 cells across."""

    place: np.ndarray
    out: np.ndarray  # normal of the wall
    down: np.ndarray  # along the wall
    vessel: dict[str, Any]

    def moving(self, way: np.ndarray, **changes: Any) -> Simulation:
        """A run in which the weight acts along a direction."""
        return Simulation(settling.ten_cate(*OIL).with_(**{
            "material.nylon.youngs_modulus": 2e5, "column.width": 12.0 * EDGE, "column.height": 12.0 * EDGE,
            "column.sides": "no_slip", "vessel": self.vessel, "bed.positions": [tuple(self.place.tolist())],
            "laws.wall_drag": "nearest", "laws.gravity": tuple((9.81 * way).tolist()), "run.fluid_step": 0.05,
            "run.until": 200.0,
        } | changes))  # fmt: skip


def beside(turn: float, slope: float, gap: float, height: float) -> Beside:
    """A sphere at a gap over its radius.

    turn   azimuth of the place, from an axis of the grid [rad]
    slope  of the radius of a cone over the height; 0 for a cylinder
    height of the place on the wall, in cells
    """
    lean, middle, wall = math.atan(slope), 6.0 * EDGE, (6.0 - slope * (12.0 - height)) * EDGE
    out = np.array([math.cos(turn) * math.cos(lean), math.sin(turn) * math.cos(lean), -math.sin(lean)])
    down = -np.array([math.cos(turn) * math.sin(lean), math.sin(turn) * math.sin(lean), math.cos(lean)])
    place = np.array([middle + wall * math.cos(turn), middle + wall * math.sin(turn), height * EDGE])
    cone = {"shape": "cone", "radius": (6.0 - 12.0 * slope) * EDGE, "length": 12.0 * EDGE}
    return Beside(place - (gap + 1.0) * RADIUS_OF_NYLON * out, out, down, cone if slope else {"shape": "cylinder"})


def beside_a_smooth_wall(
    turn: float, slope: float, towards: bool, *, gaps: tuple[float, float], until: float, modulus: float = 2e5
) -> np.ndarray:
    """Time [s], gap over radius and error of the speed over the terminal velocity, in each step (n, 3).

    turn, slope  of `beside`
    towards      whether the sphere is pulled along the normal of the wall, or else down along the wall
    gaps         at the start, and the one that ends the run
    until        [s]
    modulus      Young's, which sets the step [Pa]
    """
    start = beside(turn, slope, gaps[0], 6.3 + turn * (not towards))  # at several places in the cell
    way, radius, middle = start.out if towards else start.down, RADIUS_OF_NYLON, 6.0 * EDGE
    simulation, found, gap = start.moving(way, **{"material.nylon.youngs_modulus": modulus}), [], gaps[0]
    while simulation.time < until and gap > gaps[1]:
        simulation.step()
        position, velocity = simulation.particles.position[0], simulation.particles.velocity[0]
        wall = 6.0 * EDGE - slope * (12.0 * EDGE - position[2])
        gap = (wall - math.hypot(*(position[:2] - middle))) * math.cos(math.atan(slope)) / radius - 1.0
        law = speed(1.0 / gap + towards_wall(gap) - 1.0) if towards else speed(along_wall(gap) - 1.0)
        found.append((simulation.time, gap, (float(velocity @ way) - law) / speed(0.0)))
    return np.array(found)


@pytest.mark.parametrize("vessel", ["column", "cylinder", "cone"])
def test_the_flow_that_a_sphere_drives_along_a_wall_is_the_one_that_is_subtracted(vessel: str) -> None:
    """A small force that acts along the wall for 6 s: both within 0.8 % of the velocity of the sphere far from walls.

    The flow is 4 to 9 % of it. Cells are cut at many places, and the sphere is between cells.
    """
    unit, errors = 6.0 * math.pi * OIL[1] * RADIUS_OF_NYLON, []
    simulation = beside(0.0, 0.25 * (vessel == "cone"), 3.0, 6.3).moving(
        np.array([0.0, 0.0, -1.0]), **({"vessel": None} if vessel == "column" else {})
    )
    fluid, kernel, force = simulation.coupling.fluid, simulation.coupling.kernel, simulation.coupling.forces
    own, spheres, shape = force["self_disturbance"], simulation.particles.without_ghosts(), fluid.grid.shape
    full, nothing = np.ones(shape), (np.zeros(shape), np.zeros((*shape, 3)))
    fluid.set_voidage(full)
    for turn in (0.0,) if vessel == "column" else (0.0, 0.2, 0.6, 0.785):
        for gap in (0.75, 1.5, 3.0):
            sphere = beside(turn, 0.25 * (vessel == "cone"), gap, 6.3 + turn)
            spheres.position[0], spheres.disturbance_modes[:] = sphere.place, 0.0
            cell_map, pull = kernel.map_particles(spheres.position, spheres.radius), 1e-9 * sphere.down
            source = np.moveaxis(kernel.spread(cell_map, pull[None]) / kernel.grid.cell_volume, 0, -1)
            fluid.set_velocity((0.0, 0.0, 0.0))
            for _ in range(60):
                fluid.step(0.1, full, *nothing, np.ascontiguousarray(source))
                at_rest = np.zeros((1, 3)), -pull[None], np.zeros(1)
                own.advance(spheres, cell_map, *at_rest, fluid.density, 0.1)
            driven = kernel.sample(cell_map.stencil, cell_map.radius, np.moveaxis(fluid.velocity, -1, 0))[0]
            taken = own.own(spheres, cell_map).modes[0].sum(axis=0)
            errors.append(float((driven - taken) @ pull / (pull @ pull) * unit))
    print(f"from {min(errors):+.4f} to {max(errors):+.4f}")
    assert np.abs(errors).max() < 0.008


@pytest.mark.slow
@pytest.mark.parametrize(
    ("turn", "slope", "closest", "modulus"),
    [(0.6, 0.0, 0.3, 1e6), *((turn, slope, 0.6, 2e5) for slope in (0.0, 0.25) for turn in (0.0, 0.2, 0.6, 0.785))],
)
def test_a_coupled_sphere_moves_to_a_smooth_wall_as_the_law_says(
    turn: float, slope: float, closest: float, modulus: float
) -> None:
    """In a cylinder and in a cone, at any azimuth: within 2 % of the terminal velocity. Counted twice, the drag would
    slow it by up to 15 %."""
    found = beside_a_smooth_wall(turn, slope, True, gaps=(4.6, closest), until=200.0, modulus=modulus)
    errors = found[found[:, 1] < 4.0, 2]
    print(f"errors from {errors.min():+.4f} to {errors.max():+.4f} of the terminal velocity")
    assert len(errors) > 50 and np.abs(errors).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("slope", [0.0, 0.25])
@pytest.mark.parametrize("turn", [0.0, 0.2, 0.6, 0.785])
def test_a_coupled_sphere_moves_along_a_smooth_wall_as_the_law_says(turn: float, slope: float) -> None:
    """Down the wall of a cylinder and of a cone, at three gaps: within 2 % of the terminal velocity."""
    errors = []
    for gap in (0.75, 1.5, 3.0):
        found = beside_a_smooth_wall(turn, slope, False, gaps=(gap, 0.3), until=2.5)
        errors += found[found[:, 0] > 1.2, 2].tolist()
    print(f"errors from {min(errors):+.4f} to {max(errors):+.4f} of the terminal velocity")
    assert len(errors) > 50 and np.abs(errors).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("cell", [4.0, 2.0])
@pytest.mark.parametrize("oil", [(970.0, 0.373, 0.038), (962.0, 0.113, 0.091)])
def test_a_coupled_sphere_lands_as_the_equation_of_motion_says(oil: tuple[float, float, float], cell: float) -> None:
    """E1 and E3 of ten Cate et al., whose grid feels the floor, too: within 1 % of the terminal velocity."""
    density, viscosity, terminal = oil
    gaps, speeds = land_on_grid(density, viscosity, cell)
    exact = landing_ode(density, viscosity, "nearest", gaps, floor_alone=True)
    assert np.abs(speeds - exact).max() < 0.01 * terminal


def test_motion_across_a_wall_decays_in_long_steps() -> None:
    """15 mm in oil along the floor, at small gaps, in steps of 8.1 ms."""
    for gap in (0.01, 0.14, 1.1):
        case = settling.ten_cate(*OIL).with_(**{
            "material.nylon.youngs_modulus": 2e5, "column.width": 8.0 * EDGE, "column.height": 8.0 * EDGE,
            "bed.positions": [(4.3 * EDGE, 4.1 * EDGE, (1.0 + gap) * RADIUS_OF_NYLON)],
            "bed.initial_velocity": (0.0, 0.0, -1e-4), "laws.wall_drag": "nearest", "laws.gravity": (9.81, 0.0, 0.0),
            "run.fluid_step": 0.05, "run.until": 200.0,
        })  # fmt: skip
        simulation, speeds = Simulation(case), []
        for _ in range(40):
            simulation.step()
            speeds.append(float(simulation.particles.velocity[0, 2]))
        to_and_fro = np.abs(np.diff(speeds, 2))
        assert to_and_fro[-1] < 1e-2 * to_and_fro[5], to_and_fro


def bead_on_the_floor(step: float | None, friction: float) -> tuple[float, float]:
    """Speed along the floor after 10 ms [m/s], and height over it [m], of 2 mm of glass in water without films.

    step  of the fluid; the default if None [s]
    """
    glass = {
        "density": 2540.0, "youngs_modulus": 60e9, "contact_modulus": 1e6, "poisson": 0.23, "friction": friction,
        "roughness": 1e-7,
    }  # fmt: skip
    case = Case(
        fluid={"density": 998.0, "viscosity": 1e-3}, material={"glass": glass},
        column={"width": 0.032, "height": 0.032, "cell": 0.008, "sides": "free_slip"},
        bed={"diameter": 2e-3, "positions": [(0.016, 0.016, 1.00001e-3)], "initial_velocity": (0.01, 0.0, 0.0)},
        laws={"wall_drag": "nearest", "lubrication": "none"}, run={"until": 0.01, "fluid_step": step},
    )  # fmt: skip
    (simulation := Simulation(case)).until(0.01)
    return float(simulation.particles.velocity[0, 0]), float(simulation.particles.position[0, 2]) - 1e-3


def test_a_bead_without_films_slows_down_along_the_floor_alike_in_any_step() -> None:
    """The resistance towards the floor, 1400 times that along it, has no effect on this motion, which begins at 10
    mm/s. With friction the contacts, whose forces act a step late, change it by 6 %."""
    for friction, error in ((0.0, 5e-3), (0.4, 0.08)):
        (coarse, height), (fine, _) = (bead_on_the_floor(step, friction) for step in (None, 1e-4))
        print(f"friction {friction}: {1e3 * coarse:.3f} mm/s, in short steps {1e3 * fine:.3f} mm/s, {height:.2g} m")
        assert coarse == pytest.approx(fine, rel=error) and fine < 9.5e-3
        assert abs(height) < 1e-5


def test_resistance_by_direction_is_that_of_each_direction() -> None:
    """Of a random tensor, against the transfer of one conductance in each of its principal directions."""
    draw = np.random.default_rng(1)
    axes = np.linalg.qr(draw.normal(size=(3, 3)))[0]
    resistance, capacity, step = np.array([1e-3, 2.0, 300.0]), np.array([0.5]), 0.01
    value, push = draw.normal(size=(2, 1, 3))
    last, zero = after_source(value, push), np.zeros((1, 3))
    least, tensor = resistance[:1], ((axes * (resistance - resistance[0])) @ axes.T)[None]
    implicit, target, _ = implicit_coefficients(least, capacity, value, zero, last, step, Directions(tensor, -value))
    along_axes = np.diag(by_axis(least, tensor)[0])
    assert np.linalg.eigvalsh(along_axes - tensor[0]).min() > least - 1e-9  # in no direction below the resistance
    received = -(implicit * target) @ axes
    for d in range(3):
        along, onto = ((each @ axes)[:, d : d + 1] for each in (value, push))
        b, v, _ = implicit_coefficients(
            resistance[d : d + 1], capacity, along, zero[:, :1], after_source(along, onto), step
        )
        assert received[:, d] == pytest.approx((-b * v)[:, 0], rel=1e-9)


@pytest.mark.slow
def test_a_case_with_drag_beside_walls_slows_a_sphere_over_the_floor() -> None:
    """A falling sphere at a gap of a radius loses more velocity in a step; far from walls nothing changes."""

    def change(height: float, which: str) -> float:
        case = settling.ten_cate(962.0, 0.113).with_(
            **{
                "bed.positions": [(0.75, 0.75, height)],
                "bed.initial_velocity": (0.0, 0.0, -0.05),
                "laws.wall_drag": which,
                "column.width": 1.5,
                "column.height": 1.5,
            }
        )
        simulation = Simulation(case)
        simulation.step()
        return float(simulation.particles.velocity[0, 2]) + 0.05

    near, far = ([change(height, which) for which in ("none", "nearest")] for height in (0.015, 0.75))
    assert near[1] > near[0]
    assert far[1] - far[0] < 0.05 * (near[1] - near[0])
