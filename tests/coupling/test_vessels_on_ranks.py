"""Beds in vessels whose smooth walls cut the cells of several ranks: bits of one process."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from cluster import needs_mpi, on_mpi
from golden.beds import BEADS, SEEDS
from in_process_ranks import on_ranks
from test_case_walls import write_binary_stl
from test_coupling_ranks import advanced, assert_same_bits, begun, case_of
from test_surfaces_of_triangles import revolved

from cfddem.backend.communicator import SERIAL, Communicator, Shape
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.self_disturbance_cut_cells import SolidsOfCells, WallsOfCells
from cfddem.coupling.self_disturbance_tables import MODES
from cfddem.features.heat import HeatExchange
from cfddem.fluid.block import Block, divide, owners
from cfddem.fluid.cell_groups import Groups
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.pressure import ranks as shared
from cfddem.fluid.surfaces import Surface, cylinder, turned
from cfddem.fluid.thin_walls import divided, thin_wall
from cfddem.particles.bricks import Bricks
from cfddem.particles.ghosts import DividedDomain, SingleDomain
from cfddem.run import history
from cfddem.run.simulation import Simulation


@pytest.fixture(autouse=True)
def _small_grids_are_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several levels of these small grids are divided, too."""
    monkeypatch.setattr(shared, "SMALL", 100)


# ---------------------------------------------------------------- deposits and means

BOX = Grid((12, 10, 14), (0.1,) * 3)
AXIS = (0.57, 0.52, 0.0)
UPRIGHT = np.array([[0.63, y, z] for y, z in ((-1.0, -1.0), (2.0, -1.0), (2.0, 3.0), (-1.0, 3.0))])
BAFFLE = thin_wall(UPRIGHT[[[0, 1, 2], [0, 2, 3]]])
WALLS: dict[str, tuple[Surface, bool]] = {
    "slender cone": (turned([(0.0, 0.07), (1.4, 0.5)], AXIS), False),
    "cylinder with a baffle, periodic": (divided(BAFFLE, cylinder(AXIS, 0.46)), True),
}  # fmt: skip
"""Walls, and whether the box is periodic along z."""


def gathered(name: str, shape: tuple[int, int, int] | None, communicator: Communicator = SERIAL) -> list[Array]:
    """What 2 000 particles deposit in the cells, what they gather of it, and what walls leave of their own flow and
    solids, in the order of all particles."""
    walls, repeats = WALLS[name]
    grid, draw = within(BOX, walls), np.random.default_rng(1)
    away, turn = 0.4 * np.sqrt(draw.uniform(0.0, 1.0, 2000)), draw.uniform(0.0, 2.0 * np.pi, 2000)
    height = draw.uniform(0.02, 1.38, 2000)
    away *= 1.0 if repeats else height / 1.4
    places = np.stack([AXIS[0] + away * np.cos(turn), AXIS[1] + away * np.sin(turn), height], axis=1)
    cells, domain, mine = grid, SingleDomain(), np.arange(2000)
    if shape is not None:
        cells = Block(grid, divide(grid, communicator.size, shape=shape), communicator)
        bricks = Bricks.balanced(shape, places)
        domain, mine = DividedDomain(bricks, communicator), np.flatnonzero(bricks.owner(places) == communicator.rank)
    kernel = FilterKernel(cells, (False, False, repeats), smoothing=0.15, owners=domain)
    radius, field = np.full(2000, 0.01), draw.uniform(1.0, 2.0, (2, *grid.shape))
    cell_map = kernel.map_particles(places[mine], radius[mine])
    order = np.argsort(communicator.joined(mine))
    seen = [
        kernel.sample(cell_map.stencil, cell_map.radius, cells.part(field)),
        kernel.solids_with_slope(cell_map),
        WallsOfCells(kernel).left(places[mine], np.ones((len(mine), MODES, 3))),
        SolidsOfCells(FilterKernel(cells, kernel.periodic, owners=domain), 1).of(places[mine], radius[mine]),
    ]  # fmt: skip
    return [cells.joined(kernel.solid_fraction(cell_map)), *(communicator.joined(each)[order] for each in seen)]


@pytest.mark.parametrize("shape", [(2, 2, 2), (1, 3, 1)])
@pytest.mark.parametrize("name", WALLS)
def test_deposits_beside_walls_have_the_bits_of_one_process(name: str, shape: tuple[int, int, int]) -> None:
    """Of particles that ranks divide in another way than the cells."""
    alone = gathered(name, None)
    assert alone[0].max() > 0.0
    for found in on_ranks(int(np.prod(shape)), lambda ranks: gathered(name, shape, ranks)):
        assert all(np.array_equal(*pair) for pair in zip(found, alone))


def test_groups_reach_across_the_borders_of_ranks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The control: where ranks keep the cells of their groups to themselves, bits are lost."""

    def alone(self: Groups, values: Array, given: Any, wanted: Any, count: int) -> Array:
        kept, rank = np.zeros((len(values), count)), self._communicator.rank
        if rank in wanted:
            kept[:, wanted[rank]] = values[:, given[rank]]
        return kept

    name, shape = "slender cone", (2, 2, 2)
    expected = gathered(name, None)
    grid = within(BOX, WALLS[name][0])
    number = Groups(grid, (False,) * 3).at
    assert len(number) > 100
    monkeypatch.setattr(Groups, "_exchanged", alone)
    found = on_ranks(8, lambda ranks: gathered(name, shape, ranks))[0]
    assert not np.array_equal(found[1], expected[1])


def test_every_cell_has_its_owner() -> None:
    """By the table of all ranks, and by the part of each."""
    division = divide(BOX, 6, shape=(1, 2, 3))

    def program(communicator: Communicator) -> None:
        block = Block(BOX, division, communicator)
        assert (block.part(owners(block)) == communicator.rank).all()
        assert np.count_nonzero(owners(block) == communicator.rank) == np.prod(block.shape)

    on_ranks(6, program)


# ---------------------------------------------------------------- beds

TUBE = {"shape": "cylinder", "point": [0.012, 0.012, 0.02], "radius": 0.0055, "length": 0.014, "solid": "thin"}
CONE = {"shape": "cone", "radius": 0.006, "length": 0.03}
HEAT = {
    "particle_temperature": 400.0, "fluid_temperature": 300.0, "conductivity": 0.026, "fluid_heat_capacity": 1000.0,
    "heat_capacity": {"seed": 100.0}, "wall_temperature": {"sides": 350.0},
}  # fmt: skip
WATER = BEADS.replace('sides = "free_slip"\n', "")
BEDS = {
    "cylinder": case_of(WATER, column__cell=0.004, bed__count=200, vessel={"shape": "cylinder"}),
    "cone, sharp": case_of(WATER, column__cell=0.004, bed__count=120, laws__surface="sharp", vessel=CONE),
    "cone with a draft tube": case_of(
        WATER, column__cell=0.002, column__height=0.04, bed__count=60, vessel=CONE, wall=[TUBE]
    ),
    "hot gas in a cone": case_of(
        SEEDS, column__height=0.036, column__cell=0.0012, bed__count=500, heat=HEAT,
        vessel={"shape": "cone", "radius": 0.004, "length": 0.02},
    ),
    "hot gas in a cone with a draft tube": case_of(
        SEEDS, column__height=0.036, column__cell=0.0012, bed__count=500, heat=HEAT,
        vessel={"shape": "cone", "radius": 0.004, "length": 0.02},
        vapour={"fluid_fraction": 0.002, "inlet_fraction": 0.01, "diffusivity": 2.5e-5},
        wall=[{**TUBE, "point": [0.0072, 0.0072, 0.006], "radius": 0.0025, "length": 0.012}],
    ),
}  # fmt: skip
PLAIN = {"cylinder": (1, 2, 1), "cone, sharp": (2, 2, 1)}
"""The shape in which a bed is divided in a plain test; the slow ones take all shapes."""


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        pytest.param(name, shape, marks=[pytest.mark.slow] * (PLAIN.get(name) != shape))
        for name in BEDS
        for shape in ((1, 2, 1), (2, 2, 1), (1, 2, 2))
    ],
)
def test_a_bed_in_a_vessel_has_the_bits_of_one_process(name: str, shape: tuple[int, int, int]) -> None:
    """Particles, fluid, temperatures and history; volume and momentum are conserved across the borders."""
    steps = 5

    def program(communicator: Communicator) -> dict[str, Array]:
        communicator.shape = shape
        simulation = begun(BEDS[name], communicator)
        state = advanced(simulation, steps)
        heat = [each for each in simulation.features if isinstance(each, HeatExchange)]
        return state | {"heat": np.array([list(each.values(simulation).values()) for each in heat])}

    alone = on_ranks(1, program)[0]
    assert np.abs(alone["drag_impulse"]).max() > 0.0
    assert "hot" not in name or np.ptp(alone["temperature"]) > 50.0
    for found in on_ranks(int(np.prod(shape)), program):
        assert_same_bits(found, alone)
        assert np.abs(found["imbalance"]).max() < 1e-10


# ---------------------------------------------------------------- many steps

NOZZLES = {
    "nozzle": {"kind": "inlet", "shape": "disc", "diameter": 0.008, "velocity": [[0.0, 0.2], [0.1, 0.5]]},
    "annulus": {"kind": "inlet", "shape": "ring", "diameter": 0.020, "inner_diameter": 0.010, "velocity": 0.15},
    "cover": {"kind": "wall", "side": "lid", "shape": "whole"},
    "chimney": {"kind": "outlet", "side": "lid", "shape": "disc", "centre": [0.008, 0.012], "diameter": 0.010},
    "vent": {"kind": "outlet", "side": "lid", "shape": "disc", "centre": [0.018, 0.012], "diameter": 0.008,
             "pressure": 2.0},
}  # fmt: skip
WEIR = {
    "kind": "outlet", "side": "x_high", "shape": "box", "centre": [0.012, 0.018], "size": [0.012, 0.012],
    "particles": "leave",
}  # fmt: skip
FEED = {"corner": [0.006, 0.006, 0.030], "size": [0.010, 0.010, 0.008], "rate": 400.0}
FEW: dict[str, Any] = {"run__fluid_step": 1.6e-4, "bed__initial_velocity": [0.2, 0.15, 0.1]}
"""Four particle steps in a fluid step; ranks spend their time on messages."""

MANY_STEPS = 300
MANY = {
    "cone with a draft tube": case_of(
        WATER, **FEW, column__cell=0.002, column__height=0.04, bed__count=60, vessel=CONE, wall=[TUBE]
    ),
    "turning cylinder with nozzles and two outlets": case_of(
        WATER, **FEW, column__cell=0.003, bed__count=150, bed__inlet_velocity=0.0,
        vessel={"shape": "cylinder", "spin": 8.0}, patch=NOZZLES, laws__surface="sharp", laws__wall_drag="nearest",
        laws__self_disturbance_correction=True, run__wall_forces=True,
    ),
    "weir and feed": case_of(
        WATER, **FEW, column__cell=0.003, bed__count=250, vessel={"shape": "cylinder"}, patch={"weir": WEIR},
        feed=[FEED], run__wall_forces=True,
    ),
}  # fmt: skip
SURFACE = "closed surface"
RINGS = [(0.0, 0.005), (0.020, 0.0115), (0.048, 0.0115)]
"""Heights and radii of a cone of triangles below a cylinder, within the column [m]."""


@pytest.fixture
def surface_file(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Write the closed surface, once."""
    if SURFACE not in MANY:
        file = write_binary_stl(tmp_path_factory.mktemp("surface") / "vessel.stl", revolved(RINGS))
        vessel = {"shape": "surface", "file": str(file), "point": [0.012, 0.012, 0.0]}
        MANY[SURFACE] = case_of(WATER, **FEW, column__cell=0.003, bed__count=100, vessel=vessel, run__wall_forces=True)


def many_steps(name: str, communicator: Communicator = SERIAL) -> dict[str, Array]:
    """Particles, fluid, history and the forces on all walls after 300 fluid steps."""
    simulation = Simulation(MANY[name], communicator=communicator)
    state = advanced(simulation, MANY_STEPS)
    forces = [value for key, value in history.row(simulation).items() if "_force_" in key or "_torque" in key]
    return state | {"ids": np.sort(simulation.whole("id")), "forces": np.array(forces)}


many_steps_alone = cache(many_steps)
"""In one process."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "shape"),
    [(name, shape) for name in (*MANY, SURFACE) for shape in ((1, 2, 1), (2, 2, 1), (2, 2, 2))],
)
@pytest.mark.usefixtures("surface_file")
def test_any_number_of_ranks_has_the_bits_of_one(name: str, shape: Shape) -> None:
    """300 fluid steps in one process and on 2, 4 and 8 ranks, which divide vessel, patches and groups of cells."""

    def program(communicator: Communicator) -> dict[str, Array]:
        communicator.shape = shape
        return many_steps(name, communicator)

    alone = many_steps_alone(name)
    assert np.abs(alone["drag_impulse"]).max() > 0.0
    entered_and_left = 250 < len(alone["ids"]) < alone["ids"].max()
    assert entered_and_left or name != "weir and feed"
    for found in on_ranks(int(np.prod(shape)), program):
        assert_same_bits(found, alone)


def of_mpi(communicator: Communicator, name: str) -> dict[str, Array]:
    """`many_steps`, in the order of arguments of programs under MPI."""
    return many_steps(name, communicator)


@needs_mpi
@pytest.mark.slow
@pytest.mark.parametrize("name", ["weir and feed"])
def test_a_vessel_under_mpi_has_the_bits_of_one_process(name: str) -> None:
    """300 fluid steps in two processes."""
    for found in on_mpi(2, "test_vessels_on_ranks:of_mpi", name):
        assert_same_bits(found, many_steps_alone(name))
