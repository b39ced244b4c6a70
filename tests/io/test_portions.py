"""Files of several ranks: the bits of those of one process, and rank 0 never holds an array whole."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import in_process_ranks
import numpy as np
import pytest
from in_process_ranks import Rank, on_ranks

from cfddem.backend import portions
from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.portions import rows_by_id, rows_by_rank
from cfddem.fluid import block
from cfddem.fluid.block import Block, Division, in_portions
from cfddem.fluid.grid import Grid
from cfddem.io import checkpoint
from cfddem.io.quantities import Quantity
from cfddem.io.writer import RunFolder, folder_of_ranks

MOST = 150
"""Numbers in a portion."""

GRID = Grid((8, 7, 9), (1.0, 1.0, 1.0))
DIVISION = Division(((0, 4, 8), (0, 3, 7), (0, 4, 9)))

DRAW = np.random.default_rng(1)
IDS = np.delete(DRAW.permutation(400), slice(0, 400, 7))  # some particles have left
VELOCITY, FLAGS = DRAW.normal(0.0, 1.0, (len(IDS), 3)), DRAW.random(len(IDS)) < 0.5
CELLS, FLOW, FACES = DRAW.random(GRID.shape), DRAW.random((*GRID.shape, 3)), DRAW.random((3, 10, 8, 9))
OWNER = DRAW.choice([0, 1, 2, 4, 5, 6, 7], len(IDS))  # rank 3 has none

QUANTITIES = {
    "fluid": {"voidage": Quantity("1", ""), "velocity": Quantity("m/s", "")},
    "particles": {name: Quantity("1", "") for name in ("id", "position", "wet")},
}


class Watched(Rank):
    """A rank that notes how many numbers it has gathered at most."""

    most = 0

    def gathered(self, rows: np.ndarray) -> np.ndarray:
        whole = super().gathered(rows)
        self.most = max(self.most, whole.size)
        return whole


def state_of(communicator: Communicator) -> tuple[Grid, Mapping[str, Any]]:
    """The grid of a rank, and what it writes."""
    grid = GRID if communicator.size == 1 else Block(GRID, DIVISION, communicator)
    part = (lambda values, faces=False: values) if not isinstance(grid, Block) else grid.part
    flow = np.moveaxis(part(np.moveaxis(FLOW, -1, 0)), 0, -1)
    mine = np.flatnonzero(communicator.rank == OWNER) if communicator.size > 1 else np.arange(len(IDS))
    fields = {"id": IDS[mine], "position": VELOCITY[mine], "wet": FLAGS[mine]}
    return grid, {
        "fluid": {"voidage": in_portions(grid, part(CELLS), 0), "velocity": in_portions(grid, flow, 0)},
        "particles": {name: rows_by_id(values, IDS[mine], communicator) for name, values in fields.items()},
        "faces": in_portions(grid, part(FACES, True), 1, True),
        "pairs": rows_by_rank(VELOCITY[mine], communicator),
        "time": 0.5,
    }


def written(communicator: Communicator, folder: Path) -> int:
    """Write a snapshot and a checkpoint; returns the most numbers that the rank has gathered."""
    grid, state = state_of(communicator)
    run = folder_of_ranks(communicator, lambda: RunFolder.create(folder, "", {}, grid.whole, QUANTITIES))
    run.write_snapshot(0.0, 0, state["fluid"], state["particles"])
    run.write_checkpoint(state)
    run.finish("finished")
    return getattr(communicator, "most", 0)


def test_files_of_ranks_are_those_of_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Snapshot and checkpoint of 2 x 2 x 2 ranks, one of them without particles; portions of at most 150 numbers."""
    monkeypatch.setattr(portions, "LARGEST", MOST)
    monkeypatch.setattr(block, "LARGEST", MOST)
    monkeypatch.setattr(in_process_ranks, "Rank", Watched)
    written(SERIAL, tmp_path / "one")
    most = on_ranks(8, lambda communicator: written(communicator, tmp_path / "many"))
    layer = FACES[:, 0].size  # the least of cells or faces
    assert 0 < max(most) <= max(MOST, layer) < len(IDS) * 3
    names = ("one/data/00000000.h5", "many/data/00000000.h5")
    with h5py.File(tmp_path / names[0]) as one, h5py.File(tmp_path / names[1]) as many:
        for name in ("fluid/voidage", "fluid/velocity", "particles/id", "particles/Points", "particles/wet"):
            assert one[name].dtype == many[name].dtype and np.array_equal(one[name][()], many[name][()]), name
    one, many = (checkpoint.newest(tmp_path / folder) for folder in ("one", "many"))
    pairs = VELOCITY[np.argsort(OWNER, kind="stable")]
    for name, values in {**one["fluid"], **one["particles"], "faces": one["faces"], "pairs": pairs}.items():
        found = {**many["fluid"], **many["particles"], **many}[name]
        assert found.dtype == values.dtype and np.array_equal(found, values), name
    assert many["time"] == 0.5


def test_a_value_that_cannot_be_stored_leaves_no_file(tmp_path: Path) -> None:
    """Half a checkpoint is removed."""
    with pytest.raises(Exception, match=r"state\.b"):
        checkpoint.write(tmp_path, {"a": np.zeros(1000), "b": object()})
    assert not list((tmp_path / "checkpoint").iterdir())
