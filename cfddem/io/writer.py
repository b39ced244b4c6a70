"""Writing a run folder: immutable snapshots, a small index over them, the history, the case and the provenance.

    run/
      run.json               format, status, grid, quantities with units, versions, seed
      case.toml              the case as it was run
      surfaces/wall_0.stl    copies of the surface files of its walls
      data/00000012.h5       one snapshot: /fluid/<name> (1, nz, ny, nx[, 3]), /particles/Points (n, 3) and <name>,
                             /collisions/<name> (c,)
      run.vtkhdf             all snapshots as one series for ParaView, pyvista and h5py
      history.h5             one dataset per column
      checkpoint/            full states to resume from

Every file is written atomically. Whenever a run is killed, every file is whole and everything up to the last snapshot
is in the folder.
"""

from __future__ import annotations

import io
import json
import math
import time as clock
from array import array
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError, RunFailed
from cfddem.backend.portions import Portions, take_part
from cfddem.case.toml_text import read_text
from cfddem.io import checkpoint
from cfddem.io.files import Values, hdf5_in_memory, put, remove_partial, write_hdf5, write_whole
from cfddem.io.folder import FORMAT, lock, make_folder, read_about, read_columns, require_free, scan
from cfddem.io.index import POINTS, GridBox, Layout, Snapshot, describe, field_name, index
from cfddem.io.quantities import Quantities, declared, from_json

_ALWAYS_INDEXED = 200
_INDEX_SHARE = 0.02
"""After so many snapshots the index may lag behind if writing it would take more than this share of the run time."""


class RunFolder:
    """Writes a run. Make one with `RunFolder.create`, or with `RunFolder.reopen` to continue a run."""

    def __init__(self, folder: Path, about: dict[str, Any], case_text: str) -> None:
        self.folder, self.case_text, self.about = folder, case_text, about
        self.quantities = from_json(about["quantities"])
        self.box = (
            None if about["grid"] is None else GridBox(**{key: tuple(values) for key, values in about["grid"].items()})
        )
        self.snapshots: list[Snapshot] = []
        self._layout: Layout | None = None
        self._real = np.dtype("f4" if about["precision"] == "single" else "f8")
        self._history: dict[str, array[float]] = {}
        self._history_is_new = False
        self._indexed, self._indexed_at, self._index_cost = 0, clock.monotonic(), 0.0
        self._lock = lock(folder)

    @classmethod
    def create(
        cls,
        folder: Path,
        case_text: str,
        provenance: Mapping[str, Any],
        grid: Any = None,
        quantities: Quantities | None = None,
        precision: str = "single",
    ) -> RunFolder:
        """Start a run in a new folder.

        folder      is created; must not hold a run
        case_text   the case in TOML, stored unchanged
        provenance  plain values, from `cfddem.io.folder.provenance()`
        grid        with cells, spacing and origin; None for particles alone
        quantities  unit and meaning of every field and column that will be written, by block
        precision   of real fields in snapshots, single or double; history and checkpoints are always double
        errors      InputError if the folder holds a run or cannot be written
        """
        folder = Path(folder)
        if precision not in ("single", "double"):
            raise InputError("output.precision", precision, "single or double")
        require_free(folder, case_text)
        about = {
            "format": FORMAT,
            "status": "running",
            "message": "",
            "precision": precision,
            "grid": None if grid is None else asdict(_box(grid)),
            "quantities": {block: dict(names) for block, names in (quantities or {}).items()},
            "provenance": dict(provenance),
        }
        make_folder(folder)
        run = cls(folder, about, case_text)
        write_whole(folder / "case.toml", case_text.encode())
        run._write_about()
        return run

    @classmethod
    def reopen(cls, folder: Path) -> RunFolder:
        """Continue a run that was stopped or killed. Everything written is kept until `drop_after`.

        folder  of the run
        errors  InputError if it holds no run, a run of another format, or one that another process is writing
        """
        folder = Path(folder)
        about = read_about(folder)
        run = cls(folder, about, read_text(folder / "case.toml"))
        for place in (folder, folder / "data", folder / "checkpoint"):
            remove_partial(place)
        run.snapshots, run._layout = scan(folder)
        run._history = {name: array("d", column) for name, column in read_columns(folder / "history.h5").items()}
        about.update(status="running", message="")
        run._write_about()
        return run

    # ------------------------------------------------------------ writing

    def write_snapshot(
        self,
        time: float,
        step: int,
        fluid: Mapping[str, Values] | None,
        particles: Mapping[str, Values] | None,
        collisions: np.ndarray | None = None,
    ) -> None:
        """Write the history so far, one snapshot, and the index, in this order.

        time, step  of the snapshot [s], [-]
        fluid       name -> (nz, ny, nx) or (nz, ny, nx, 3); None if the run has no grid
        particles   name -> (n,) or (n, 3), with `position`; rows are written in the order of `id`; may be None
        collisions  structured array of the collisions since the previous snapshot, or None
        errors      InputError for an undeclared field or a wrong shape; RunFailed if the disk fails
        """
        cells, points = self._cells(fluid or {}), self._points(particles or {})
        layout = Layout.of(cells, points)
        if self._layout is not None:
            self._layout.require_same(layout)
        if self.snapshots and time <= self.snapshots[-1].time:
            limit = f"later than the previous snapshot at {self.snapshots[-1].time:g} s"
            raise InputError("snapshot.time", time, limit, "call drop_after first")
        self.flush_history()
        number = 1 + int(self.snapshots[-1].name[:8]) if self.snapshots else 0
        count = points[POINTS].shape[0] if points else 0
        snapshot, collided = Snapshot(f"{number:08d}.h5", float(time), int(step), count), _columns(collisions)
        blocks: dict[str, Mapping[str, Values]] = {"fluid": cells, "particles": points, "collisions": collided}
        write_hdf5(self.folder / "data" / snapshot.name, partial(self._fill, snapshot, blocks))
        self.snapshots.append(snapshot)
        self._layout = layout
        elapsed = clock.monotonic() - self._indexed_at
        if len(self.snapshots) <= _ALWAYS_INDEXED or self._index_cost < _INDEX_SHARE * elapsed:
            self.write_index()

    def write_index(self) -> None:
        """Write `run.vtkhdf` from the list of snapshots."""
        begin = clock.monotonic()
        if self.snapshots and self._layout is not None:
            texts = {"case": self.case_text, "provenance": json.dumps(self.about["provenance"])}
            content = index(self.snapshots, self._layout, self.box, self.quantities, texts)
            write_whole(self.folder / "run.vtkhdf", content)
        else:
            (self.folder / "run.vtkhdf").unlink(missing_ok=True)
        self._indexed, self._indexed_at = len(self.snapshots), clock.monotonic()
        self._index_cost = self._indexed_at - begin

    def append_history(self, row: Mapping[str, float]) -> None:
        """Add a row. It is written with the next snapshot, checkpoint or `flush_history`.

        row     column -> number, with `time`; the same columns every time
        errors  InputError for different columns or an undeclared column
        """
        if not self._history:
            for name in row:
                declared(self.quantities, "history", name)
            self._history = {name: array("d") for name in row}
        if row.keys() != self._history.keys() or "time" not in row:
            odd = sorted(row.keys() ^ self._history.keys()) or ["time"]
            raise InputError(
                "history", odd, "the same columns in every row, with time", "write NaN for a missing value"
            )
        for name, value in row.items():
            self._history[name].append(value)
        self._history_is_new = True

    @property
    def last_row(self) -> dict[str, float]:
        """The last row of the history; empty before the first."""
        return {name: column[-1] for name, column in self._history.items() if column}

    @property
    def history(self) -> dict[str, np.ndarray]:
        """All rows so far, name -> copy of the column."""
        return {name: np.array(column) for name, column in self._history.items()}

    def flush_history(self) -> None:
        """Write all rows so far."""
        if not self._history_is_new:
            return
        image = io.BytesIO()
        with hdf5_in_memory(image, track_order=True) as file:
            for name, column in self._history.items():
                dataset = file.create_dataset(name, data=np.frombuffer(column))
                describe(dataset, declared(self.quantities, "history", name))
        write_whole(self.folder / "history.h5", image.getbuffer())
        self._history_is_new = False

    def write_checkpoint(self, state: Mapping[str, Any]) -> None:
        """Write the history so far, then the full state (`cfddem.io.checkpoint`)."""
        self.flush_history()
        checkpoint.write(self.folder, state)

    def note(self, name: str, value: Any) -> None:
        """Store a plain value in `run.json`; an earlier value of that name is replaced."""
        self.about[name] = value
        self._write_about()

    def drop_after(self, time: float) -> None:
        """Remove snapshots and history rows later than a time [s].

        The index is rewritten first, so that it never refers to a removed snapshot.
        """
        late = [snapshot for snapshot in self.snapshots if snapshot.time > time]
        self.snapshots = self.snapshots[: len(self.snapshots) - len(late)]
        if not self.snapshots:
            self._layout = None
        self.write_index()
        for snapshot in reversed(late):
            (self.folder / "data" / snapshot.name).unlink(missing_ok=True)
        if self._history:
            kept = np.frombuffer(self._history["time"]) <= time
            self._history = {name: array("d", np.frombuffer(series)[kept]) for name, series in self._history.items()}
            self._history_is_new = True
            self.flush_history()

    def finish(self, status: str, message: str = "") -> None:
        """Write everything that is left and how the run ended; release the folder.

        status   finished, stopped or failed
        message  one line for the user
        """
        if status not in ("finished", "stopped", "failed"):
            raise InputError("status", status, "finished, stopped or failed")
        self.about.update(status=status, message=message)
        try:
            self.flush_history()
            if self._indexed != len(self.snapshots):
                self.write_index()
            self._write_about()
        except RunFailed:
            if status != "failed":  # of a failed run the user must see the first failure, not this one
                raise
        finally:
            self._lock.close()

    # ------------------------------------------------------------ details

    def _write_about(self) -> None:
        write_whole(self.folder / "run.json", (json.dumps(self.about, indent=1) + "\n").encode())

    def _fill(self, snapshot: Snapshot, blocks: Mapping[str, Mapping[str, Values]], file: Any) -> None:
        """Write a snapshot into an open file."""
        file.attrs["time"], file.attrs["step"], file.attrs["format"] = snapshot.time, snapshot.step, FORMAT
        for block, arrays in blocks.items():
            for name, values in arrays.items():
                packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
                dataset = put(file, f"{block}/{name}", values, **packed if math.prod(values.shape) else {})
                describe(dataset, declared(self.quantities, block, field_name(name)))

    def _cells(self, fluid: Mapping[str, Values]) -> dict[str, Values]:
        """Cell fields with a leading axis of length one, in the precision of the run."""
        if (self.box is None) != (not fluid):
            raise InputError("snapshot.fluid", sorted(fluid), "given if and only if the run has a grid")
        shaped = {}
        for name, values in fluid.items():
            values = _known(values)
            if self.box is None or values.shape[:3] != self.box.shape or values.shape[3:] not in ((), (3,)):
                raise InputError(f"snapshot.fluid.{name}", values.shape, "(nz, ny, nx) or (nz, ny, nx, 3) of the grid")
            shaped[name] = _with_leading_axis(self._stored(values))
        return shaped

    def _points(self, particles: Mapping[str, Values]) -> dict[str, Values]:
        """Particle fields in the order of ids; positions under the name that VTK requires."""
        if not particles:
            if self.box is None:
                raise InputError("snapshot.particles", None, "given if the run has no grid")
            return {}
        if "position" not in particles:
            raise InputError("snapshot.particles", sorted(particles), "with the field 'position'")
        count, ids = _known(particles["position"]).shape[0], particles.get("id")
        order = slice(None) if ids is None or isinstance(ids, Portions) else np.argsort(ids, kind="stable")
        shaped = {}
        for name, values in particles.items():
            values = _known(values)
            if len(values.shape) not in (1, 2) or values.shape[0] != count:
                raise InputError(f"snapshot.particles.{name}", values.shape, f"one row for each of {count} particles")
            shaped[POINTS if name == "position" else name] = self._stored(
                values if isinstance(values, Portions) else values[order]
            )
        return shaped

    def _stored(self, values: Values) -> Values:
        """Reals in the precision of the run, flags as bytes, integers unchanged."""
        kind = self._real if values.dtype.kind == "f" else np.dtype("u1") if values.dtype.kind == "b" else values.dtype
        return values.as_type(kind) if isinstance(values, Portions) else values.astype(kind, copy=False)


def _known(values: Any) -> Values:
    """Values as an array if they are none in portions."""
    return values if isinstance(values, Portions) else np.asarray(values)


def _with_leading_axis(values: Values) -> Values:
    """The same values with a first axis of length one."""
    if not isinstance(values, Portions):
        return np.asarray(values[None])
    return Portions((1, *values.shape), values.dtype, lambda: (((0, *index), part) for index, part in values))


def _box(grid: Any) -> GridBox:
    return GridBox(
        tuple(int(n) for n in grid.cells),  # type: ignore[arg-type]
        tuple(float(h) for h in grid.spacing),  # type: ignore[arg-type]
        tuple(float(x) for x in grid.origin),  # type: ignore[arg-type]
    )


def _columns(table: np.ndarray | None) -> dict[str, np.ndarray]:
    """A structured array as columns, flags as bytes."""
    if table is None:
        return {}
    columns = {name: table[name] for name in table.dtype.names or ()}
    return {name: column.astype("u1") if column.dtype.kind == "b" else column for name, column in columns.items()}


# ---------------------------------------------------------------- folders of several ranks


class UnwrittenFolder(RunFolder):
    """A run folder whose writes do nothing but give rank 0 what it writes."""

    def __init__(self, folder: Path, about: dict[str, Any], case_text: str, quantities: Quantities) -> None:
        self.folder, self.about, self.case_text = folder, about, case_text
        self.quantities = {block: dict(names) for block, names in quantities.items()}
        self.snapshots, self._history = [], {}

    def write_snapshot(self, time: float, step: int, fluid: Any, particles: Any, collisions: Any = None) -> None:
        """See `RunFolder.write_snapshot`."""
        take_part(fluid)
        take_part(particles)

    def write_checkpoint(self, state: Mapping[str, Any]) -> None:
        """See `RunFolder.write_checkpoint`."""
        take_part(state)

    def _nothing(self, *arguments: Any, **named: Any) -> None:
        """Rank 0 does it."""

    write_index = append_history = flush_history = _nothing
    note = drop_after = finish = _nothing


def folder_of_ranks(communicator: Communicator, make: Callable[[], RunFolder]) -> RunFolder:
    """The folder that rank 0 makes, and one without writing on the other ranks; where rank 0 fails, all fail.

    make  called on rank 0
    """
    folders: list[RunFolder] = []

    def described() -> tuple[Path, dict[str, Any], str, Quantities]:
        folders.append(make())
        return folders[0].folder, folders[0].about, folders[0].case_text, folders[0].quantities

    about = communicator.by_first(described)
    return folders[0] if folders else UnwrittenFolder(*about)
