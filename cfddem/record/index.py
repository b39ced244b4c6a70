"""The index of a run: one small VTKHDF file that shows all snapshots as one series of fluid and particles.

It holds no fields. Virtual datasets with relative paths point into the immutable snapshots, so it can be made
again from them at any time, and the folder can be moved. Layout: VTKHDF 2.1, a MultiBlockDataSet of an ImageData
`fluid` and a PolyData `particles`, each with its own steps, and steps at the root, which VTK 9.7 needs. A value
that lies in a missing snapshot reads as NaN, or -1 for whole numbers.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.errors import InputError
from cfddem.record.files import hdf5_in_memory
from cfddem.record.quantities import Quantity, quantity

POINTS = "Points"
"""What VTK calls the positions of particles."""


@dataclass(frozen=True)
class Box:
    """The grid of the fluid, as far as a picture needs it."""

    cells: tuple[int, int, int]
    spacing: tuple[float, float, float]
    origin: tuple[float, float, float]

    @property
    def shape(self) -> tuple[int, int, int]:
        """(nz, ny, nx)."""
        return self.cells[2], self.cells[1], self.cells[0]


@dataclass(frozen=True)
class Snapshot:
    """What the index must know of one snapshot."""

    name: str
    time: float
    step: int
    particles: int


@dataclass(frozen=True)
class Layout:
    """Datasets that every snapshot of a run holds: name -> (type, further axes)."""

    fluid: Mapping[str, tuple[str, tuple[int, ...]]]
    particles: Mapping[str, tuple[str, tuple[int, ...]]]

    @classmethod
    def of(cls, fluid: Mapping[str, Any], particles: Mapping[str, Any]) -> Layout:
        """The layout of arrays or datasets as they lie in a snapshot."""
        return cls(
            {name: (np.dtype(each.dtype).str, tuple(each.shape[4:])) for name, each in sorted(fluid.items())},
            {name: (np.dtype(each.dtype).str, tuple(each.shape[1:])) for name, each in sorted(particles.items())},
        )

    def must_equal(self, other: Layout) -> None:
        """Refuse a snapshot with other fields than the ones before it."""
        for block in ("fluid", "particles"):
            mine, given = getattr(self, block), getattr(other, block)
            if mine != given:
                names = sorted(name for name in {*mine, *given} if mine.get(name) != given.get(name))
                raise InputError(
                    f"snapshot.{block}",
                    names,
                    f"the same fields of the same type in every snapshot, {', '.join(mine) or 'none'}",
                )


def index(
    snapshots: Sequence[Snapshot],
    layout: Layout,
    box: Box | None,
    fields: Mapping[str, Quantity],
    texts: Mapping[str, str],
) -> bytes:
    """The bytes of `run.vtkhdf` for these snapshots, at least one.

    snapshots  in the order of time
    layout     of all of them
    box        grid of the fluid, or None
    fields     units and long names that the run declares
    texts      stored at the root beside the series: the case, where the run comes from
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
            _fluid(root.create_group("fluid"), snapshots, layout, box, fields)
            blocks.append("fluid")
        if layout.particles:
            _particles(root.create_group("particles"), snapshots, layout, fields)
            blocks.append("particles")
        assembly = root.create_group("Assembly", track_order=True)
        for place, block in enumerate(blocks):
            root[block].attrs["Index"] = place
            assembly[block] = h5py.SoftLink(f"/VTKHDF/{block}")
        table = file.create_group("snapshots")
        table["name"] = np.array([each.name.encode() for each in snapshots])
        for column in ("time", "step", "particles"):
            table[column] = np.array([getattr(each, column) for each in snapshots])
    return image.getvalue()


def listed(file: Any) -> list[Snapshot]:
    """The snapshots that an open index knows."""
    table = file["snapshots"]
    columns = (table[name][:].tolist() for name in ("name", "time", "step", "particles"))
    return [Snapshot(name.decode(), time, step, count) for name, time, step, count in zip(*columns)]


def describe(dataset: Any, known: Quantity) -> None:
    """Write unit and long name on a dataset."""
    dataset.attrs["unit"], dataset.attrs["long_name"] = known


def _fluid(group: Any, snapshots: Sequence[Snapshot], layout: Layout, box: Box, fields: Mapping[str, Quantity]) -> None:
    """An ImageData whose cell fields lie in the snapshots, one row each."""
    _stamp(group, "ImageData")
    group.attrs["WholeExtent"] = np.array([0, box.cells[0], 0, box.cells[1], 0, box.cells[2]], np.int64)
    group.attrs["Origin"], group.attrs["Spacing"] = np.array(box.origin), np.array(box.spacing)
    group.attrs["Direction"] = np.eye(3).ravel()
    steps, rows = _steps(group, snapshots), _twice(np.arange(len(snapshots)))
    data, offsets = group.create_group("CellData"), steps.create_group("CellDataOffsets")
    group.create_group("PointData")
    for name, (kind, further) in layout.fluid.items():
        _joined(data, name, snapshots, f"fluid/{name}", [1] * len(snapshots), kind, (*box.shape, *further), fields)
        offsets[name] = rows


def _particles(group: Any, snapshots: Sequence[Snapshot], layout: Layout, fields: Mapping[str, Quantity]) -> None:
    """A PolyData whose points lie in the snapshots; one cell holds all points of a step."""
    _stamp(group, "PolyData")
    counts = [each.particles for each in snapshots]
    begins, shown = _twice(np.concatenate([[0], np.cumsum(counts)[:-1]])), _twice(np.array(counts))
    many, steps = len(shown), _steps(group, snapshots)
    group["NumberOfPoints"] = shown
    data, offsets = group.create_group("PointData"), steps.create_group("PointDataOffsets")
    group.create_group("CellData")
    for name, (kind, further) in layout.particles.items():
        home = group if name == POINTS else data
        _joined(home, name, snapshots, f"particles/{name}", counts, kind, further, fields)
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


def _joined(
    home: Any,
    name: str,
    snapshots: Sequence[Snapshot],
    source: str,
    rows: Sequence[int],
    kind: str,
    further: tuple[int, ...],
    fields: Mapping[str, Quantity],
) -> None:
    """One dataset that strings together a dataset of every snapshot."""
    import h5py

    shape = (int(sum(rows)), *further)
    if shape[0] == 0:
        dataset = home.create_dataset(name, shape, kind)
    else:
        joined, begin = h5py.VirtualLayout(shape, kind), 0
        for snapshot, count in zip(snapshots, rows):
            if count:
                joined[begin : begin + count] = h5py.VirtualSource(
                    f"data/{snapshot.name}", source, (count, *further), kind
                )
                begin += count
        fill = np.nan if np.dtype(kind).kind == "f" else 0 if np.dtype(kind).kind in "bu" else -1
        dataset = home.create_virtual_dataset(name, joined, fillvalue=fill)
    describe(dataset, quantity("position" if name == POINTS else name, fields, "fields"))


def _stamp(group: Any, kind: str) -> None:
    """Type and version, which every block needs for itself; VTK reads strings of fixed length only."""
    import h5py

    group.attrs["Version"] = np.array([2, 1], np.int64)
    group.attrs.create("Type", kind.encode(), dtype=h5py.string_dtype("ascii", len(kind)))


def _steps(group: Any, snapshots: Sequence[Snapshot]) -> Any:
    """The times of a block."""
    times = np.array([each.time for each in snapshots])
    if len(times) == 1:
        times = np.array([times[0], np.nextafter(times[0], np.inf)])
    steps = group.create_group("Steps")
    steps.attrs["NSteps"] = len(times)
    steps["Values"] = times
    describe(steps["Values"], quantity("time", {}, "steps"))
    return steps


def _twice(rows: np.ndarray) -> np.ndarray:
    """VTK takes a series of one step for a static file and fails; until there is a second, show the first twice."""
    return np.repeat(rows, 2) if len(rows) == 1 else rows
