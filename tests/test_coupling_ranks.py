"""Coupled runs on several ranks: particles and fluid are those of one process, and nothing is lost at borders."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from cluster import needs_mpi, on_mpi
from example_case import MIXTURE
from golden.beds import BEADS, SEEDS
from in_process_ranks import on_ranks

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import RunFailed
from cfddem.case.schema import Case
from cfddem.coupling.reach import Reach
from cfddem.fluid.block import Block, Division
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.pressure import ranks as shared
from cfddem.run import history
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


ALL_FORCES = {f"laws__{name}": True for name in ("lift", "torque", "viscous_stress")}

BEDS = {
    "all forces": case_of(
        BEADS, column__cell=0.004, laws__added_mass=0.5, laws__agitation="pseudo_turbulence", run__energy_budget=True,
        **ALL_FORCES
    ),
    "crossing a periodic border": case_of(
        BEADS, column__sides="periodic", column__ends="periodic", bed__inlet_velocity=0.0,
        bed__initial_velocity=[0.5, 0.3, 1.0],
    ),
    "mixture, pieces of spheres": case_of(MIXTURE, column__cell=0.002, laws__mapping="divided"),
}  # fmt: skip


def begun(case: Case, communicator: Communicator = SERIAL, state: dict[str, Any] | None = None) -> Simulation:
    """A run with a tight tolerance of the pressure."""
    simulation = Simulation(case, communicator=communicator, state=state)
    assert simulation.fluid is not None
    simulation.fluid.tolerance = TIGHT
    return simulation


def advanced(simulation: Simulation, steps: int) -> dict[str, Array]:
    """Particles by id, fluid, and what the history says after some steps."""
    assert simulation.fluid is not None
    for _ in range(steps):
        simulation.step()
    names = ("position", "velocity", "spin", "applied", "drag_impulse")
    order = np.argsort(simulation.whole("id"))
    particles = {name: simulation.whole(name)[order] for name in names}
    row = history.row(simulation)
    measured = ("bed_height", "pressure_drop", "bed_voidage_from_pressure", "out_of_range_count")
    solids = simulation.communicator.sum(1.0 - simulation.fluid.voidage) * simulation.fluid.grid.cell_volume
    volume = simulation.communicator.sum(simulation.owned.volume)
    return particles | simulation.fluid.checkpoint() | {
        "history": np.array([row[name] for name in measured]),
        "energy": np.array([row[name] for name in row if name.startswith("energy_")] or [0.0]),
        "imbalance": np.array([row["momentum_imbalance"], row["volume_imbalance"], solids / volume - 1.0]),
    }  # fmt: skip


def bed_over_time(
    communicator: Communicator, text: str, changes: dict[str, Any], until: float
) -> tuple[Array, Array, dict[str, Array]]:
    """Mean pressure drop and bed height over the second half, largest imbalances, and the state at the end."""
    simulation, measured, imbalances = begun(case_of(text, **changes), communicator), [], []
    while simulation.time < until * (1.0 - 1e-9):
        simulation.step(until)
        row = history.row(simulation) if simulation.steps % 5 == 0 else None
        if row is not None:
            imbalances.append([row["momentum_imbalance"], row["volume_imbalance"]])
        if row is not None and simulation.time > 0.5 * until:
            measured.append([row["pressure_drop"], row["bed_height"]])
    return np.mean(measured, axis=0), np.max(np.abs(imbalances), axis=0), advanced(simulation, 0)


def difference(one: dict[str, Array], other: dict[str, Array]) -> float:
    """Largest difference of any array, over its largest value."""
    parts = [np.abs(one[name] - other[name]).max() / (np.abs(other[name]).max() + 1e-300) for name in other]
    return float(max(part for part, name in zip(parts, other) if name != "imbalance"))


@pytest.mark.parametrize("name", BEDS)
def test_a_divided_bed_is_the_whole_one(name: str) -> None:
    """Particles, fluid and history of two ranks; volume and momentum are conserved across the border."""
    steps = 5

    def program(communicator: Communicator) -> tuple[dict[str, Array], set[int]]:
        simulation = begun(BEDS[name], communicator)
        before = set(simulation.owned.id.tolist())
        return advanced(simulation, steps), before ^ set(simulation.owned.id.tolist())

    alone = advanced(begun(BEDS[name]), steps)
    for found, moved in on_ranks(2, program):
        assert difference(found, alone) < 1e-8
        assert np.abs(found["imbalance"]).max() < 1e-10
        assert len(moved) > 20 or "periodic" not in name


def test_volume_is_lost_where_ghosts_are_not_added(monkeypatch: pytest.MonkeyPatch) -> None:
    """The volume that one rank deposits on cells of another belongs to the bed."""
    monkeypatch.setattr(Reach, "collected", lambda self, fields: np.ascontiguousarray(self._inner(fields)))
    case = BEDS["all forces"]
    imbalance = on_ranks(2, lambda communicator: advanced(begun(case, communicator), 0)["imbalance"])[0]
    assert abs(imbalance[2]) > 1e-3


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_checkpoint_of_a_bed_goes_on_with_another_number_of_ranks(ranks: int) -> None:
    """Two steps on four ranks and two on fewer, against four steps in one process."""
    case = case_of(BEADS, column__cell=0.002, bed__initial_velocity=[0.3, 0.1, 0.2])
    alone = advanced(begun(case), 4)

    def half(communicator: Communicator) -> dict[str, Any]:
        simulation = begun(case, communicator)
        advanced(simulation, 2)
        return simulation.checkpoint()

    state = on_ranks(4, half)[0]

    def rest(communicator: Communicator) -> dict[str, Array]:
        return advanced(begun(case, communicator, state), 2)

    assert difference(on_ranks(ranks, rest)[0], alone) < 1e-8


# ---------------------------------------------------------------- under MPI


@needs_mpi
def test_two_ranks_under_mpi_are_one_process() -> None:
    """A small liquid bed."""
    given = BEADS, {"column__cell": 0.004, "bed__initial_velocity": [0.3, 0.2, 0.1]}, 0.01
    _, _, alone = bed_over_time(SERIAL, *given)
    for _, imbalance, found in on_mpi(2, "test_coupling_ranks:bed_over_time", *given):
        assert difference(found, alone) < 1e-8
        assert imbalance.max() < 1e-10


LARGE = {
    "liquid": (BEADS, {"column__width": 0.06, "column__height": 0.18}),
    "gas": (SEEDS, {"column__width": 0.036, "column__height": 0.072, "laws__self_disturbance_correction": True}),
}
"""Beds of 10 000 particles."""


@needs_mpi
@pytest.mark.slow
@pytest.mark.parametrize("name", LARGE)
def test_a_large_bed_differs_by_no_more_than_between_seeds(name: str) -> None:
    """0.1 s on two and four ranks: volume and momentum to 1e-10, pressure drop and height within three deviations."""
    text, changes = LARGE[name]
    given = changes | {"bed__count": 10_000}
    seeds = np.array([bed_over_time(SERIAL, text, given | {"bed__seed": seed}, 0.1)[0] for seed in (1, 2, 3)])
    scatter = seeds.std(axis=0, ddof=1)
    for ranks in (2, 4):
        mean, imbalance, _ = on_mpi(ranks, "test_coupling_ranks:bed_over_time", text, given, 0.1, timeout=3000.0)[0]
        assert imbalance.max() < 1e-10
        assert (np.abs(mean - seeds[0]) < 3.0 * scatter).all()


def test_a_particle_beyond_the_ghosts_is_reported() -> None:
    """Three layers of ghosts reach two and a half cells beyond the cells of a rank."""
    grid = Grid((12, 2, 2), (0.1, 0.1, 0.1))

    def program(communicator: Communicator) -> None:
        reach = Reach(Block(grid, Division(0, (0, 6, 12)), communicator), (False, False, False))
        reach.refuse_beyond(np.array([[0.6 + 0.24 * (1 - 2 * communicator.rank), 0.1, 0.1]]))
        with pytest.raises(RunFailed, match=r"2\.6 cells beyond"):
            reach.refuse_beyond(np.array([[0.6 + 0.26 * (1 - 2 * communicator.rank), 0.1, 0.1]]))

    on_ranks(2, program)
