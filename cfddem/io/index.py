"""The index of a run, `run.vtkhdf`: a small VTKHDF file that presents all snapshots as one time series.

The index holds no field data. Virtual datasets with relative paths refer to the immutable snapshots, so the index can
be rebuilt from them at any time, and the run folder can be moved. Layout: VTKHDF 2.1, a MultiBlockDataSet of an
ImageData `fluid` and a PolyData `particles`, each with its own steps, and steps at the root, which VTK 9.7 requires.
A value of a missing snapshot reads as NaN, or as -1 in signed integer fields.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.io.files import hdf5_in_memory, opened
from cfddem.io.quantities import TIME, Quantities, Quantity, declared

POINTS = "Points"
"""Name of particle positions in VTK."""


@dataclass(frozen=True)
class GridBox:
    """The grid of the fluid, as far as files and pictures need it."""

    cells: tuple[int, int, int]
    spacing: tuple[float, float, float]
    origin: tuple[float, float, float]

    @property
    def shape(self) -> tuple[int, int, int]:
        """(nz, ny, nx)."""
        return self.cells[2], self.cells[1], self.cells[0]


@dataclass(frozen=True)
class Snapshot:
    """What the index stores of one snapshot."""

    name: str
    time: float
    step: int
    particles: int


@dataclass(frozen=True)
class Layout:
    """The datasets of every snapshot of a run: name -> (type, further axes)."""

    fluid: Mapping[str, tuple[str, tuple[int, ...]]]
    particles: Mapping[str, tuple[str, tuple[int, ...]]]

    @classmethod
    def of(cls, fluid: Mapping[str, Any], particles: Mapping[str, Any]) -> Layout:
        """The layout of the arrays or datasets of one snapshot."""
        return cls(
            {name: (np.dtype(dataset.dtype).str, tuple(dataset.shape[4:])) for name, dataset in sorted(fluid.items())},
            {
                name: (np.dtype(dataset.dtype).str, tuple(dataset.shape[1:]))
                for name, dataset in sorted(particles.items())
            },
        )

    def require_same(self, other: Layout) -> None:
        """Refuse a snapshot whose fields differ from those of earlier snapshots.

        errors  InputError
        """
        for block in ("fluid", "particles"):
            mine, others = getattr(self, block), getattr(other, block)
            if mine != others:
                names = sorted(name for name in {*mine, *others} if mine.get(name) != others.get(name))
                raise InputError(
                    f"snapshot.{block}",
                    names,
                    f"the same fields of the same type in every snapshot: {', '.join(mine) or 'none'}",
                )


def index(
    snapshots: Sequence[Snapshot], layout: Layout, box: GridBox | None, quantities: Quantities, texts: Mapping[str, str]
) -> bytes:
    """The bytes of `run.vtkhdf`.

    snapshots   at least one, in order of time
    layout      of all snapshots
    box         grid of the fluid, or None
    quantities  units and meanings of the fields
    texts       name -> text, stored at the root beside the series
    """
    import h5py

    image = io.BytesIO()
    with hdf5_in_memory(image) as file:
        for name, text in texts.items():
            file[name] = text
        file["history"] = h5py.ExternalLink("history.h5", "/")
        root = file.create_group("VTKHDF", track_order=True)
        _stamp(root, "MultiBlockDataSet")
        _steps(root, snapshots)
        blocks = []
        if box is not None:
            _fluid(root.create_group("fluid"), snapshots, layout, box, quantities)
            blocks.append("fluid")
        if layout.particles:
            _particles(root.create_group("particles"), snapshots, layout, quantities)
            blocks.append("particles")
        assembly = root.create_group("Assembly", track_order=True)
        for place, block in enumerate(blocks):
            root[block].attrs["Index"] = place
            assembly[block] = h5py.SoftLink(f"/VTKHDF/{block}")
        table = file.create_group("snapshots")
        table["name"] = np.array([snapshot.name.encode() for snapshot in snapshots])
        for column in ("time", "step", "particles"):
            table[column] = np.array([getattr(snapshot, column) for snapshot in snapshots])
    return image.getvalue()


def listed(path: Path) -> list[Snapshot]:
    """The snapshots in the index of a run.

    errors  RunFailed if the file is missing or damaged
    """
    with opened(path) as data:
        table = data.file["snapshots"]
        columns = [data.read(table[name]).tolist() for name in ("name", "time", "step", "particles")]
        return [Snapshot(name.decode(), time, step, count) for name, time, step, count in zip(*columns)]


def describe(dataset: Any, quantity: Quantity) -> None:
    """Write unit and meaning as attributes of a dataset."""
    dataset.attrs["unit"], dataset.attrs["long_name"] = quantity.unit, quantity.meaning


def _fluid(group: Any, snapshots: Sequence[Snapshot], layout: Layout, box: GridBox, quantities: Quantities) -> None:
    """An ImageData with one row of each cell field per snapshot."""
    _stamp(group, "ImageData")
    group.attrs["WholeExtent"] = np.array([0, box.cells[0], 0, box.cells[1], 0, box.cells[2]], np.int64)
    group.attrs["Origin"], group.attrs["Spacing"] = np.array(box.origin), np.array(box.spacing)
    group.attrs["Direction"] = np.eye(3).ravel()
    steps, rows = _steps(group, snapshots), _at_least_two(np.arange(len(snapshots)))
    data, offsets = group.create_group("CellData"), steps.create_group("CellDataOffsets")
    group.create_group("PointData")
    parts = [(snapshot.name, 1) for snapshot in snapshots]
    for name, (kind, further) in layout.fluid.items():
        dataset = _virtual(data, name, parts, f"fluid/{name}", kind, (*box.shape, *further))
        describe(dataset, declared(quantities, "fluid", name))
        offsets[name] = rows


def _particles(group: Any, snapshots: Sequence[Snapshot], layout: Layout, quantities: Quantities) -> None:
    """A PolyData with the points of all snapshots; one cell holds all points of a step."""
    _stamp(group, "PolyData")
    parts = [(snapshot.name, snapshot.particles) for snapshot in snapshots]
    counts = [snapshot.particles for snapshot in snapshots]
    begins, shown = _at_least_two(np.concatenate([[0], np.cumsum(counts)[:-1]])), _at_least_two(np.array(counts))
    many, steps = len(shown), _steps(group, snapshots)
    group["NumberOfPoints"] = shown
    data, offsets = group.create_group("PointData"), steps.create_group("PointDataOffsets")
    group.create_group("CellData")
    for name, (kind, further) in layout.particles.items():
        dataset = _virtual(group if name == POINTS else data, name, parts, f"particles/{name}", kind, further)
        describe(dataset, declared(quantities, "particles", field_name(name)))
        if name != POINTS:
            offsets[name] = begins

    cells = np.zeros((many, 4), np.int64)
    cells[:, 0] = np.arange(many)
    steps["PartOffsets"], steps["NumberOfParts"] = np.arange(many), np.ones(many, np.int64)
    steps["PointOffsets"], steps["CellOffsets"] = begins, cells
    steps["ConnectivityIdOffsets"] = np.zeros((many, 4), np.int64)
    for name in ("Vertices", "Lines", "Polygons", "Strips"):
        topology, own = group.create_group(name), name == "Vertices"
        topology["NumberOfCells"] = np.full(many, int(own))
        topology["NumberOfConnectivityIds"] = shown if own else np.zeros(many, np.int64)
        topology["Offsets"] = np.stack([0 * shown, shown], axis=1).ravel() if own else np.zeros(many, np.int64)
        topology["Connectivity"] = np.arange(max(counts) if own else 0)


def field_name(name: str) -> str:
    """Name of a particle field whose dataset has the given name."""
    return "position" if name == POINTS else name


def _virtual(
    home: Any, name: str, parts: Sequence[tuple[str, int]], source: str, kind: str, further: tuple[int, ...]
) -> Any:
    """A dataset that concatenates one dataset of every snapshot.

    parts    (file name, rows) of each snapshot
    source   path of the dataset in the snapshots
    kind     type of the numbers
    further  axes after the first
    """
    import h5py

    shape = (sum(rows for _, rows in parts), *further)
    if shape[0] == 0:
        return home.create_dataset(name, shape, kind)
    joined, begin = h5py.VirtualLayout(shape, kind), 0
    for file, rows in parts:
        if rows:
            joined[begin : begin + rows] = h5py.VirtualSource(f"data/{file}", source, (rows, *further), kind)
            begin += rows
    fill = np.nan if np.dtype(kind).kind == "f" else 0 if np.dtype(kind).kind in "bu" else -1
    return home.create_virtual_dataset(name, joined, fillvalue=fill)


def _stamp(group: Any, kind: str) -> None:
    """Type and version, which every block needs; VTK reads strings of fixed length only."""
    import h5py

    group.attrs["Version"] = np.array([2, 1], np.int64)
    group.attrs.create("Type", kind.encode(), dtype=h5py.string_dtype("ascii", len(kind)))


def _steps(group: Any, snapshots: Sequence[Snapshot]) -> Any:
    """The times of a block."""
    times = np.array([snapshot.time for snapshot in snapshots])
    if len(times) == 1:
        times = np.array([times[0], np.nextafter(times[0], np.inf)])
    steps = group.create_group("Steps")
    steps.attrs["NSteps"] = len(times)
    steps["Values"] = times
    describe(steps["Values"], TIME)
    return steps


def _at_least_two(rows: np.ndarray) -> np.ndarray:
    """Repeat a single row: VTK treats a series of one step as a static file and fails."""
    return np.repeat(rows, 2) if len(rows) == 1 else rows
