"""The matrix of resolved suspensions: its points, each with a folder from which a run that was killed continues."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.compile import use_threads
from scenarios.references.resolved_suspension.measures import Series, even_window, measure
from scenarios.references.resolved_suspension.suspension import Point, Suspension, prepare
from scenarios.validation.table import Progress, replacing

SETTLE, AVERAGE = 10.0, 20.0
"""Time that is dropped, and time that is averaged [d/w]."""

LEAST_EVEN = 3.0
"""Shortest time over which an even suspension is measured [d/w]."""

SAMPLES = 16
"""Samples of force and velocity within d/w."""

_P = Point
POINTS: tuple[Point, ...] = (
    _P(3.6, 0.36, 45.0), _P(2.5, 0.36, 45.0), _P(7.0, 0.36, 45.0), _P(3.6, 0.20, 60.0),
    _P(3.6, 0.45, 45.0), _P(1.03, 0.36, 45.0), _P(3.6, 0.36, 100.0, diameter=16), _P(3.6, 0.30, 45.0),
    _P(2.5, 0.20, 60.0), _P(7.0, 0.45, 45.0), _P(1.03, 0.20, 30.0), _P(2.5, 0.45, 150.0, diameter=16),
)  # fmt: skip
"""The twelve points, the most valuable first; each runs with two seeds."""

SEEDS = (1, 2)

MADE = (
    f"Lattice Boltzmann D3Q19, one core, November 2026. First {SETTLE:g} d/w dropped; `even` holds the same measures "
    "over the time in which the suspension is developed and without a wave as long as the box, null if that is too "
    "short. Two values in brackets are mean and standard error over blocks of 3 d/w."
)
"""How the rows of a table were made."""


def runs() -> Iterator[Point]:
    """All runs of the matrix, in order."""
    for point in POINTS:
        for seed in SEEDS:
            yield replace(point, seed=seed)


def name(point: Point) -> str:
    """Name of the folder of a run."""
    return (
        f"ratio{point.density_ratio:g}_phi{point.solid_fraction:g}_re{point.reynolds:g}"
        f"_d{point.diameter}_box{point.box:g}_seed{point.seed}"
    )


@dataclass
class Kept:
    """A run in its folder: the suspension, what has been sampled, and how far it is."""

    suspension: Suspension
    series: Series = field(default_factory=Series)

    def save(self, path: Path) -> None:
        """Write everything that the next step depends on; a kill leaves a whole file, this state or the one before."""
        suspension = self.suspension
        state: dict[str, Any] = {
            "populations": suspension.flow.populations,
            "velocity": suspension.velocity,
            "spin": suspension.spin,
            "contact_impulse": suspension.contact_impulse,
            "steps": suspension.steps,
            "touching": suspension.touching,
            **flattened(suspension.solver.checkpoint(), "solver"),
            **flattened(self.series.arrays(), "series"),
        }
        with replacing(path) as fresh, open(fresh, "wb") as file:
            np.savez(file, **state)

    def load(self, path: Path) -> None:
        """Continue from a state that was saved."""
        suspension = self.suspension
        with np.load(path) as state:
            suspension.flow.populations[:] = state["populations"]
            for name in ("velocity", "spin", "contact_impulse", "touching"):
                setattr(suspension, name, state[name])
            suspension.steps = int(state["steps"])
            tree = nested({key: state[key] for key in state.files if "/" in key})
        suspension.solver.restore(tree["solver"])
        self.series = Series.of(tree["series"])


def flattened(tree: dict[str, Any], name: str) -> dict[str, np.ndarray]:
    """Leaves of nested dictionaries, by path."""
    leaves = {}
    for key, value in tree.items():
        path = f"{name}/{key}"
        leaves.update(flattened(value, path) if isinstance(value, dict) else {path: np.asarray(value)})
    return leaves


def nested(leaves: dict[str, np.ndarray]) -> dict[str, Any]:
    """The nested dictionaries again; arrays without dimension become numbers."""
    tree: dict[str, Any] = {}
    for path, value in leaves.items():
        *parents, last = path.split("/")
        place = tree
        for parent in parents:
            place = place.setdefault(parent, {})
        place[last] = value if value.ndim else value.item()
    return tree


def run(
    point: Point, folder: Path, progress: Progress, *, settle: float = SETTLE, until: float = SETTLE + AVERAGE
) -> dict[str, Any]:
    """Run a point, or continue it, and return its row; a point that is finished is read from its folder.

    settle  time that is dropped [d/w]
    until   end of the run [d/w]
    """
    home = folder / name(point)
    home.mkdir(parents=True, exist_ok=True)
    row_file, state_file = home / "row.json", home / "state.npz"
    if row_file.exists():
        done: dict[str, Any] = json.loads(row_file.read_text(encoding="utf-8"))
        if done["until"] >= until:
            return done
    kept = Kept(prepare(point))
    if state_file.exists():
        kept.load(state_file)
    tau = point.diameter / point.slip  # [steps]
    every = round(tau / SAMPLES)
    while kept.suspension.steps < until * tau:
        for _ in range(SAMPLES):
            kept.series.sample(kept.suspension, every)
        kept.save(state_file)
        progress(f"{name(point)}: {kept.suspension.steps / tau:.1f} of {until:g} d/w")
    row: dict[str, Any] = {
        "point": asdict(point),
        "settle": settle,
        "until": until,
        **measure(point, kept.series, settle),
        "even": even(point, kept.series),
    }
    with replacing(row_file) as fresh:
        fresh.write_text(json.dumps(row, indent=1) + "\n", encoding="utf-8")
    return row


def even(point: Point, series: Series) -> dict[str, Any] | None:
    """What is measured while the suspension is even; None if it is so for less than LEAST_EVEN."""
    start, end = even_window(point, series)
    return {"window_of_time": [start, end], **measure(point, series, start, end)} if end - start >= LEAST_EVEN else None


def write_table(rows: list[dict[str, Any]], path: Path, origin: str) -> None:
    """Write rows as a table, one to a line.

    origin  how the rows were made
    """
    lines = ",\n".join(json.dumps(row, separators=(",", ":")) for row in rows)
    with replacing(path) as fresh:
        fresh.write_text(f'{{"made": {json.dumps(origin)},\n"rows": [\n{lines}\n]}}\n', encoding="utf-8")


def main() -> None:
    """Run or continue the matrix: python -m scenarios.references.resolved_suspension.matrix FOLDER [RUN ...]."""
    use_threads(1)
    folder, *numbers = sys.argv[1:]
    listed = list(runs())
    chosen = [listed[int(number)] for number in numbers] or listed
    rows = [run(point, Path(folder), print) for point in chosen]
    write_table(rows, Path(folder) / "table.json", MADE)


if __name__ == "__main__":
    main()
