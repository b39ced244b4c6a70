"""Coupled runs on several ranks have the bits of one process, and nothing is lost at borders."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cluster import needs_mpi, on_mpi
from example_case import MIXTURE
from golden.beds import BEADS, SEEDS
from in_process_ranks import on_ranks
from test_case_walls import TETRAHEDRON, write_binary_stl

from cfddem.backend import portions
from cfddem.backend.communicator import SERIAL, Communicator, Shape, place_of
from cfddem.backend.errors import RunFailed
from cfddem.backend.portions import collected
from cfddem.case.schema import Case
from cfddem.coupling.forces.pressure import PressureForce
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.kernel_cells import GhostDeposit
from cfddem.features.heat import HeatExchange
from cfddem.fluid.block import Block, Division, divide, region_of
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.pressure import ranks as shared
from cfddem.fluid.pressure.multigrid import PressureEquation
from cfddem.io import checkpoint
from cfddem.particles.bricks import Bricks
from cfddem.particles.ghosts import DividedDomain, SingleDomain
from cfddem.particles.state import Particles
from cfddem.run import history
from cfddem.run.resuming import LARGE
from cfddem.run.simulation import Simulation

TIGHT = 1e-11
"""Tolerance of the pressure."""


@pytest.fixture(autouse=True)
def _small_grids_are_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several levels of these small grids are divided, too."""
    monkeypatch.setattr(shared, "SMALL", 100)


def case_of(text: str, **changes: Any) -> Case:
    """A case with changes, with __ for the point."""
    return Case.from_text(text, "case", {name.replace("__", "."): value for name, value in changes.items()})


ALL_FORCES: dict[str, Any] = {
    **{f"laws__{name}": True for name in ("lift", "torque", "viscous_stress")}, "laws__surface": "smeared",
}  # fmt: skip

BEDS = {
    "all forces": case_of(
        BEADS, column__cell=0.004, laws__added_mass=0.5, laws__history="mei_adrian",
        laws__agitation="pseudo_turbulence", **ALL_FORCES
    ),
    "crossing a periodic border": case_of(
        BEADS, column__cell=0.004, column__sides="periodic", column__ends="periodic", bed__inlet_velocity=0.0,
        bed__initial_velocity=[1.0, 0.9, 1.0],
    ),
    "mixture, pieces of spheres": case_of(MIXTURE, column__cell=0.002, laws__mapping="divided"),
}  # fmt: skip
BEDS["all forces and their energy"] = BEDS["all forces"].with_(**{"run.energy_budget": True})


def begun(case: Case, communicator: Communicator = SERIAL, state: dict[str, Any] | None = None) -> Simulation:
    """A run with a tight tolerance of the pressure."""
    simulation = Simulation(case, communicator=communicator, state=state)
    simulation.fluid.tolerance = TIGHT
    return simulation


def advanced(simulation: Simulation, steps: int) -> dict[str, Array]:
    """Particles by id, fluid, and what the history says after some steps."""
    for _ in range(steps):
        simulation.step()
    names = ["position", "velocity", "spin", "applied", "drag_impulse"]
    names += ["liquid"] if "liquid" in simulation.particles.fields else []
    order = np.argsort(simulation.whole("id"))
    particles = {name: simulation.whole(name)[order] for name in names}
    particles["temperature"] = np.zeros(0)
    if heat := [each for each in simulation.features if isinstance(each, HeatExchange)]:
        cells = list(collected(heat[0].cells_for_snapshot(), simulation.communicator).values())
        particles["temperature"] = np.append(simulation.whole("temperature")[order], cells)
    row = history.row(simulation)
    measured = ("bed_height", "pressure_drop", "bed_voidage_from_pressure", "out_of_range_count")
    fluid = simulation.fluid
    held = (1.0 - fluid.voidage) * fluid.boundaries.cut.own_volume()
    solids = simulation.communicator.sum(held) * fluid.grid.cell_volume
    volume = simulation.communicator.sum(simulation.owned.volume)
    return particles | collected(fluid.checkpoint(), simulation.communicator) | {
        "history": np.array([row[name] for name in measured]),
        "energy": np.array([row[name] for name in row if name.startswith("energy_")] or [0.0]),
        "imbalance": np.array([row["momentum_imbalance"], row["volume_imbalance"], solids / volume - 1.0]),
    }  # fmt: skip


def bed_over_time(
    communicator: Communicator, text: str, changes: dict[str, Any], until: float, shape: Shape | None = None
) -> tuple[Array, Array, dict[str, Array]]:
    """Mean pressure drop and bed height over the second half, largest imbalances, and the state at the end."""
    if shape:
        communicator.shape = shape
    simulation, measured, imbalances = begun(case_of(text, **changes), communicator), [], []
    while simulation.time < until * (1.0 - 1e-9):
        simulation.step(until)
        row = history.row(simulation) if simulation.steps % 5 == 0 else None
        if row is not None:
            imbalances.append([row["momentum_imbalance"], row["volume_imbalance"]])
        if row is not None and simulation.time > 0.5 * until:
            measured.append([row["pressure_drop"], row["bed_height"]])
    return np.mean(measured, axis=0), np.max(np.abs(imbalances), axis=0), advanced(simulation, 0)


def differing(found: dict[str, Array], expected: dict[str, Array]) -> list[str]:
    """Names of the arrays whose bits differ."""
    return [name for name in expected if not np.array_equal(found[name], expected[name], equal_nan=True)]


def assert_same_bits(found: dict[str, Array], alone: dict[str, Array]) -> None:
    """All arrays have the bits of one process; energies, which each rank counts in turn, but their last digits."""
    exact = {each: values for each, values in alone.items() if each != "energy"}
    assert not differing(found, exact)
    assert found["energy"] == pytest.approx(alone["energy"], rel=1e-12)


PLAIN = {
    "all forces": (1, 2, 1), "crossing a periodic border": (1, 2, 2), "mixture, pieces of spheres": (1, 2, 1)
}  # fmt: skip
"""The shape in which each bed is divided in a plain test; the slow ones take all shapes."""


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        pytest.param(name, shape, marks=[pytest.mark.slow] * (PLAIN.get(name) != shape))
        for name in BEDS
        for shape in ((1, 2, 1), (2, 2, 1), (1, 2, 2))
    ],
)
def test_a_divided_bed_has_the_bits_of_the_whole_one(name: str, shape: tuple[int, int, int]) -> None:
    """Particles, fluid and history of slabs and bricks; volume and momentum are conserved across the borders.

    With all forces the ranks run on all threads.
    """
    steps, ranks, threads = 5, int(np.prod(shape)), None if "all forces" in name else 1

    def program(communicator: Communicator) -> tuple[dict[str, Array], set[int]]:
        communicator.shape = shape
        simulation = begun(BEDS[name], communicator)
        before = set(simulation.owned.id.tolist())
        return advanced(simulation, steps), before ^ set(simulation.owned.id.tolist())

    alone = advanced(begun(BEDS[name]), steps)
    for found, moved in on_ranks(ranks, program, threads):
        assert_same_bits(found, alone)
        assert np.abs(found["imbalance"]).max() < 1e-10
        assert len(moved) > 20 or "periodic" not in name


def test_sums_in_the_order_of_the_ranks_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    """The control: with scalar products of floats, rank by rank, bits of the pressure are lost."""

    def by_floats(self: PressureEquation, a: Array, b: Array) -> float:
        return sum(self.communicator._combine([float(np.sum(a * b))], lambda one, other: one + other))

    monkeypatch.setattr(PressureEquation, "_product", by_floats)
    case = BEDS["all forces"]
    alone = advanced(begun(case), 2)
    assert "pressure" in differing(on_ranks(3, lambda ranks: advanced(begun(case, ranks), 2))[0], alone)


FEW = {"column__height": 0.072, "bed__inlet_velocity": 0.66, "run__fluid_step": 4e-5}
"""Gas beds whose fluid steps have four particle steps; ranks spend their time on messages."""

MANY = {
    "films, agitation, history force, sharp": case_of(
        BEADS, column__cell=0.004, column__height=0.12, bed__initial_velocity=[0.2, 0.15, 0.1],
        run__fluid_step=8e-5, run__energy_budget=True, laws__agitation="pseudo_turbulence",
        laws__history="basset", laws__surface="sharp",
    ),
    "hot gas, beside walls": case_of(
        SEEDS, **FEW, bed__count=600, bed__initial_velocity=[0.3, 0.2, 0.1], laws__wall_drag="nearest",
        laws__self_disturbance_correction=True,
        heat={
            "particle_temperature": 400.0, "fluid_temperature": 300.0, "conductivity": 0.026,
            "fluid_heat_capacity": 1000.0, "heat_capacity": {"seed": 100.0},
        },
    ),
}  # fmt: skip

WET_AND_FED = """
[liquid]
viscosity = 5e-3
surface_tension = 0.02
liquid_fraction = 0.01
wall_share = 0.5
wall_thickness = 1e-6
[[feed]]
corner = [0.002, 0.002, 0.060]
size = [0.010, 0.010, 0.006]
rate = 4000.0
velocity = [0.0, 0.0, -0.5]
[[wall]]
shape = "surface"
solid = "none"
file = "FILE"
velocity = [0.0, 0.0, -0.1]
spin = [0.0, 0.0, 20.0]
"""
"""Liquid on particles and walls, particles that enter, and a mesh that sinks and turns."""


@pytest.fixture(autouse=True)
def _wet_and_fed(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Write the mesh, once."""
    if WET not in MANY:
        corners = 0.004 * TETRAHEDRON + (0.005, 0.006, 0.030)
        file = write_binary_stl(tmp_path_factory.mktemp("mesh") / "part.stl", corners)
        MANY[WET] = case_of(
            SEEDS + WET_AND_FED.replace("FILE", str(file)), **FEW, bed__count=500,
            bed__initial_velocity=[0.3, 0.2, -0.3],
        )  # fmt: skip


WET = "wet gas, fed and stirred"

MANY_SHAPES = ((1, 2, 1), (1, 1, 3), (2, 2, 1), (2, 1, 3), (2, 2, 2), (1, 2, 4), (1, 1, 8))
"""2, 3, 4, 6 and 8 ranks, eight of them in three ways."""


MANY_STEPS = 500


def many_steps(name: str, communicator: Communicator = SERIAL) -> dict[str, Array]:
    """500 fluid steps at the default tolerance of the pressure."""
    return advanced(Simulation(MANY[name], communicator=communicator), MANY_STEPS)


many_steps_alone = cache(many_steps)
"""In one process."""


@pytest.mark.slow
@pytest.mark.parametrize("shape", MANY_SHAPES, ids=lambda shape: "x".join(map(str, shape)))
@pytest.mark.parametrize("name", [*MANY, WET])
def test_any_number_of_ranks_has_the_bits_of_one(name: str, shape: Shape, monkeypatch: pytest.MonkeyPatch) -> None:
    """500 fluid steps in one process and on 2, 3, 4, 6 and 8 ranks, which divide the finest level of the pressure."""
    monkeypatch.setattr(shared, "SMALL", 500)

    def program(communicator: Communicator) -> dict[str, Array]:
        communicator.shape = shape
        return many_steps(name, communicator)

    alone = many_steps_alone(name)
    assert np.abs(alone["drag_impulse"]).max() > 0.0
    assert "hot" not in name or np.ptp(alone["temperature"]) > 10.0
    for found in on_ranks(int(np.prod(shape)), program):
        assert_same_bits(found, alone)


@pytest.mark.slow  # as plain tests: bricks of particles alone, and fields between both divisions
def test_bricks_follow_a_bed_that_leaves_one_side(monkeypatch: pytest.MonkeyPatch) -> None:
    """All particles go to one side: space is cut anew, work is equal after each cut, and bits are those of one process.

    The division of the cells stays: what particles deposit travels to other ranks.
    """
    shape, cuts, plain = (2, 2, 1), dict[int, list[float]](), DividedDomain._cut_anew
    case = case_of(
        BEADS, column__cell=0.004, laws__added_mass=0.5, laws__agitation="pseudo_turbulence", run__energy_budget=True,
        bed__initial_velocity=[0.8, 0.5, -0.1], **ALL_FORCES
    )  # fmt: skip

    def cut(self: DividedDomain, particles: Particles, work: Array) -> None:
        before = self.division
        plain(self, particles, work)
        if self.division is not before:
            shares = np.bincount(self.division.owner(particles.position), weights=work, minlength=4)
            shares = self.communicator.sum(shares, axis=())
            cuts.setdefault(self.communicator.rank, []).append(shares.max() / shares.mean())

    monkeypatch.setattr(DividedDomain, "_cut_anew", cut)

    def program(communicator: Communicator) -> dict[str, Array]:
        communicator.shape = shape
        return advanced(begun(case, communicator), 25)

    alone = advanced(begun(case), 25)
    for found in on_ranks(4, program):
        assert_same_bits(found, alone)
        assert np.abs(found["imbalance"]).max() < 1e-10
    assert len(cuts) == 4 and all(len(each) > 1 and max(each) < 1.1 for each in cuts.values())


@pytest.mark.parametrize("periodic", [(False, False, False), (True, True, True), (True, False, True)])
@pytest.mark.parametrize("shape", [(2, 2, 2), (1, 3, 2), (4, 1, 1)])
def test_fields_travel_between_the_division_of_cells_and_that_of_particles(
    shape: tuple[int, int, int], periodic: tuple[bool, bool, bool]
) -> None:
    """Every cell of a box has the value of its owner; every owner gets what all boxes hold, over periodic borders."""
    grid, draw, ranks = Grid((12, 10, 14), (0.01,) * 3), np.random.default_rng(1), int(np.prod(shape))
    places = draw.uniform(0.0, 1.0, (3000, 3)) ** 2 * grid.size
    division, whole = Bricks.balanced(shape, places), draw.normal(size=(2, *grid.shape))

    def program(communicator: Communicator) -> None:
        block = Block(grid, divide(grid, ranks, shape=shape), communicator)
        reach = GhostDeposit(block, periodic, division=division)
        first, lengths = reach.axes().first, reach.shape
        at = np.ix_(range(2), *((first[2 - d] + np.arange(lengths[d])) % grid.shape[d] for d in range(3)))
        assert np.array_equal(reach.spread(block.part(whole)), whole[at])
        held, expected = draw.integers(0, 100, (2, *lengths)), np.zeros(whole.shape, np.int64)
        np.add.at(expected, at, held)
        collected = reach.collected(held)
        assert np.array_equal(collected, block.part(communicator.sum(expected, axis=())))

    on_ranks(ranks, program)


@pytest.mark.parametrize("periodic", [(False, False, False), (True, True, False)])
def test_values_between_centres_have_the_bits_of_one_process(periodic: tuple[bool, bool, bool]) -> None:
    """A viscosity that grows with height, and one that differs from cell to cell, at places up to the walls."""
    grid, draw, shape = Grid((12, 10, 14), (0.01,) * 3), np.random.default_rng(2), (2, 2, 2)
    places = draw.uniform(0.0, 1.0, (2000, 3)) ** 2 * grid.size
    division, layered = Bricks.balanced(shape, places), np.broadcast_to(grid.centres()[2], grid.shape)
    uneven = draw.uniform(1.0, 2.0, grid.shape)

    def program(communicator: Communicator) -> list[Array]:
        cells, owners, mine = grid, SingleDomain(), np.arange(2000)
        if communicator.size > 1:
            cells = Block(grid, divide(grid, 8, shape=shape), communicator)
            owners, mine = (
                DividedDomain(division, communicator),
                np.flatnonzero(division.owner(places) == communicator.rank),
            )
        kernel = FilterKernel(cells, periodic, owners=owners)
        found = [kernel.between_centres(cells.part(each), places[mine]) for each in (layered, uneven)]
        order = np.argsort(communicator.joined(mine))
        return [communicator.joined(each)[order] for each in found]

    alone = program(SERIAL)
    inside = np.clip(places[:, 2], 0.005, 0.135)
    assert alone[0] == pytest.approx(inside, rel=1e-12)
    assert all(np.array_equal(*pair) for found in on_ranks(8, program) for pair in zip(found, alone))


def test_a_cut_that_hands_over_no_particle_changes_the_cells_of_a_rank() -> None:
    """The pressure force uses the cells of earlier steps again, but not those of another division of space."""

    def program(communicator: Communicator) -> None:
        communicator.shape = (1, 1, 2)
        simulation = begun(case_of(BEADS), communicator)
        advanced(simulation, 2)
        kernel, particles = simulation.coupling.kernel, simulation.owned
        force = next(each for each in simulation.coupling.forces if isinstance(each, PressureForce))
        bricks = kernel.owners.division
        kernel.owners.division = Bricks((*bricks.planes[:2], bricks.planes[2] - kernel.grid.spacing[2]))
        reach, cell_map = kernel.reach, kernel.map_particles(particles.position, particles.radius)
        assert kernel.reach is not reach
        after_cut = force.force(particles, cell_map)
        force.forget()
        np.testing.assert_array_equal(after_cut, force.force(particles, cell_map))

    on_ranks(2, program)


def test_volume_is_lost_where_ghosts_are_not_added(monkeypatch: pytest.MonkeyPatch) -> None:
    """The volume that one rank deposits on cells of another belongs to the bed."""

    def own(self: GhostDeposit, fields: Array) -> Array:
        rank, made = self._communicator.rank, np.zeros((len(fields), *self.grid.shape), np.int64)
        made[self._in_cells[rank][0]] = fields[self._in_box[rank][0]]
        return made

    monkeypatch.setattr(GhostDeposit, "collected", own)
    case = BEDS["all forces"]
    imbalance = on_ranks(2, lambda communicator: advanced(begun(case, communicator), 0)["imbalance"])[0]
    assert abs(imbalance[2]) > 1e-3


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_checkpoint_of_a_bed_goes_on_with_another_number_of_ranks(
    ranks: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two steps on four ranks and two on fewer, against four steps in one process; ranks read it in portions."""
    case = case_of(BEADS, column__cell=0.002, bed__initial_velocity=[0.3, 0.1, 0.2])
    alone = advanced(begun(case), 4)

    def half(communicator: Communicator) -> dict[str, Any]:
        simulation = begun(case, communicator)
        advanced(simulation, 2)
        return collected(simulation.checkpoint(), communicator)

    checkpoint.write(tmp_path, {"simulation": on_ranks(4, half)[0]})
    monkeypatch.setattr(portions, "LARGEST", 2000)
    rows, read = list[int](), checkpoint.Stored.__getitem__

    def noted(self: checkpoint.Stored, index: Any) -> Array:
        if "/particles/particles/" in self.name:
            rows.append(len(read(self, index)))
        return read(self, index)

    monkeypatch.setattr(checkpoint.Stored, "__getitem__", noted)

    def rest(communicator: Communicator) -> dict[str, Array]:
        state = checkpoint.newest(tmp_path, LARGE if ranks > 1 else ())["simulation"]
        return advanced(begun(case, communicator, state), 2)

    assert not differing(on_ranks(ranks, rest)[0], alone)
    assert max(rows, default=0) == (200 if ranks > 1 else 0)  # of 400 particles


# ---------------------------------------------------------------- under MPI


@needs_mpi
@pytest.mark.slow  # as a plain test: test_cluster_commands.py, a bed on two ranks
@pytest.mark.parametrize("shape", [(1, 2, 1), (2, 2, 2)])
def test_ranks_under_mpi_are_one_process(shape: tuple[int, int, int]) -> None:
    """A small liquid bed."""
    given = BEADS, {"column__cell": 0.004, "bed__initial_velocity": [0.3, 0.2, 0.1]}, 0.01
    _, _, alone = bed_over_time(SERIAL, *given)
    for _, imbalance, found in on_mpi(int(np.prod(shape)), "test_coupling_ranks:bed_over_time", *given, shape):
        assert not differing(found, alone)
        assert imbalance.max() < 1e-10


BEDS_OF_10_000 = {
    "liquid": (BEADS, {"bed__count": 10_000, "column__width": 0.06, "column__height": 0.18}),
    "gas": (
        SEEDS,
        {
            "bed__count": 10_000, "column__width": 0.036, "column__height": 0.072,
            "laws__self_disturbance_correction": True,
        },
    ),
}  # fmt: skip
"""Texts and changes of beds of 10 000 particles."""


@needs_mpi
@pytest.mark.slow
@pytest.mark.parametrize("name", BEDS_OF_10_000)
def test_a_large_bed_under_mpi_has_the_bits_of_one_process(name: str) -> None:
    """0.05 s on two and four ranks; volume and momentum to 1e-10."""
    given = *BEDS_OF_10_000[name], 0.05
    _, _, alone = bed_over_time(SERIAL, *given)
    for ranks in (2, 4):
        for _, imbalance, found in on_mpi(ranks, "test_coupling_ranks:bed_over_time", *given, timeout=3000.0):
            assert not differing(found, alone)
            assert imbalance.max() < 1e-10


@pytest.mark.parametrize(("shape", "periodic"), [((2, 2, 1), (False, False, False)), ((2, 1, 2), (True, True, True))])
def test_the_flux_of_solids_has_the_bits_of_one_process(
    shape: tuple[int, int, int], periodic: tuple[bool, bool, bool]
) -> None:
    """Every face of all ranks, of particles that cross the borders."""
    grid, draw = Grid((10, 9, 12), (0.01, 0.01, 0.01)), np.random.default_rng(4)
    places, ways = draw.uniform(0.006, 0.084, (150, 3)), draw.uniform(-0.006, 0.006, (150, 3))
    radius = draw.uniform(1e-3, 2e-3, 150)

    def program(communicator: Communicator) -> list[Array]:
        cells, mine = grid, np.ones(150, bool)
        if communicator.size > 1:
            cells = Block(grid, divide(grid, communicator.size, shape=shape), communicator)
            mine = Bricks(cells.division.planes(grid)).owner(places) == communicator.rank
        kernel = FilterKernel(cells, periodic, smoothing=0.012)
        before, after = (kernel.map_particles(each[mine], radius[mine]) for each in (places, places + ways))
        return kernel.solid_flux(before, after, 1e-3)

    alone = program(SERIAL)
    division = divide(grid, 4, shape=shape)
    for rank, found in enumerate(on_ranks(4, program)):
        for axis, flux in enumerate(found):
            more = [int(axis == each) for each in range(3)]
            assert np.array_equal(flux, alone[axis][region_of(division.starts, place_of(rank, shape), more)])


def test_a_particle_beyond_the_ghosts_is_reported() -> None:
    """Three layers of ghosts reach two and a half cells beyond the cells of a rank."""
    grid = Grid((12, 2, 2), (0.1, 0.1, 0.1))

    def program(communicator: Communicator) -> None:
        reach = GhostDeposit(Block(grid, Division(((0, 6, 12), (0, 2), (0, 2))), communicator), (False, False, False))
        reach.refuse_beyond(np.array([[0.6 + 0.24 * (1 - 2 * communicator.rank), 0.1, 0.1]]))
        with pytest.raises(RunFailed, match=r"2\.6 cells beyond"):
            reach.refuse_beyond(np.array([[0.6 + 0.26 * (1 - 2 * communicator.rank), 0.1, 0.1]]))

    on_ranks(2, program)
