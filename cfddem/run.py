"""A case, run into a folder: what is written when, and how a run ends, stops, fails and goes on."""

from __future__ import annotations

import signal
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.assembly import grid_of
from cfddem.case import Case
from cfddem.errors import CfddemError, RunFailed
from cfddem.particles.pouring import kinetic_energy
from cfddem.record import checkpoint
from cfddem.record.ledger import exchange_imbalance, volume_imbalance
from cfddem.record.measures import bed_height, cells_of, granular_temperature, pressure_drop
from cfddem.record.output import RunFolder
from cfddem.record.provenance import provenance
from cfddem.simulation import Simulation

FIELDS = {
    "fastest": ("m/s", "speed of the fastest particle"),
    "exchange_imbalance": ("1", "momentum given by the fluid and not got by particles, over that given"),
    "volume_imbalance": ("1", "volume gained by a cell against its faces, over the largest flux"),
    "outside_range": ("1", "how often the drag law was asked outside of its range, so far"),
}
"""What a run records beside the known quantities."""

CHECKPOINT_SECONDS = 60.0
"""A checkpoint is written with the next snapshot after so long, and at the end."""

Report = Callable[["Run"], None]


class Run:
    """A simulation that writes its folder.

    simulation  to be advanced
    folder      that is written
    report      is called after every row of history
    """

    def __init__(self, simulation: Simulation, folder: RunFolder, report: Report = lambda _: None) -> None:
        self.simulation, self.folder, self.report = simulation, folder, report
        plan = simulation.case.run
        self.end = plan.until
        every = plan.every or plan.until / 50.0
        self.rows_per_snapshot = max(1, round(every / (plan.history_every or every / 10.0)))
        self.interval = every / self.rows_per_snapshot
        self.row: dict[str, float] = {}
        self.wall_begin, self.time_begin = clock.monotonic(), simulation.time
        self._checkpoint_at = clock.monotonic()
        self._stop = ""

    @classmethod
    def begin(
        cls,
        case: Case,
        folder: Path,
        *,
        text: str | None = None,
        report: Report = lambda _: None,
        progress: Callable[[str], None] = lambda _: None,
    ) -> Run:
        """Prepare a case in a new folder.

        text      the case file as the user wrote it
        report    is called after every row of history
        progress  is told, in a line, what is being prepared
        """
        from cfddem.record.folder import refuse_taken

        written = case.to_toml() if text is None else text
        refuse_taken(Path(folder), written)
        simulation = Simulation(case, progress)
        grid = None if simulation.fluid is None else simulation.fluid.grid
        run = cls(simulation, RunFolder.create(Path(folder), written, provenance(case.bed.seed), grid, FIELDS), report)
        run._write_row()
        run._write_snapshot()
        return run

    @classmethod
    def resume(
        cls,
        folder: Path,
        *,
        until: float | None = None,
        report: Report = lambda _: None,
        progress: Callable[[str], None] = lambda _: None,
    ) -> Run:
        """Go on from the newest whole checkpoint of a folder, to the same bits; what was written later is dropped."""
        written = RunFolder.reopen(Path(folder))
        state = checkpoint.newest(Path(folder))
        overrides = state["overrides"] | ({} if until is None else {"run.until": until})
        case = Case.from_text(written.case_text, str(Path(folder) / "case.toml"), overrides)
        simulation = Simulation.restored(case, state["simulation"])
        written.drop_after(simulation.time)
        return cls(simulation, written, report)

    def go(self) -> None:
        """Run to the end; a failure leaves the last good snapshot and says so in the folder."""
        count = round(self.simulation.time / self.interval)
        try:
            with self._stopped_cleanly():
                while not self._stop and self.simulation.time < self.end * (1.0 - 1e-12):
                    count += 1
                    target = min(count * self.interval, self.end)
                    while not self._stop and self.simulation.time < target * (1.0 - 1e-12):
                        self.simulation.step(target)
                    if self._stop:
                        break
                    self._write_row()
                    if count % self.rows_per_snapshot == 0 or target == self.end:
                        self._write_snapshot()
                    self.report(self)
        except CfddemError as failure:
            self.folder.finish("failed", str(failure))
            raise
        self._write_checkpoint()
        self.folder.finish("stopped" if self._stop else "finished", self._stop)
        if self._stop:
            raise RunFailed(
                f"stopped by {self._stop} at t = {self.simulation.time:.6g} s; cfddem resume {self.folder.folder}"
            )

    @contextmanager
    def _stopped_cleanly(self) -> Iterator[None]:
        """SIGINT and SIGTERM end the run after the step at hand."""

        def stop(number: int, _: Any) -> None:
            self._stop = signal.Signals(number).name

        try:
            before = [(each, signal.signal(each, stop)) for each in (signal.SIGINT, signal.SIGTERM)]
        except ValueError:  # not the main thread, where nobody can be asked to stop
            before = []
        try:
            yield
        finally:
            for each, handler in before:
                signal.signal(each, handler)

    # ------------------------------------------------------------ what is written

    def _write_row(self) -> None:
        self.row = measure(self.simulation)
        self.folder.append_history(self.row)

    def _write_snapshot(self) -> None:
        simulation, bodies = self.simulation, self.simulation.particles.bodies
        fluid = None
        if simulation.fluid is not None:
            fluid = {
                "voidage": simulation.fluid.voidage,
                "velocity": simulation.fluid.velocity,
                "pressure": simulation.fluid.pressure,
            }
        particles = {name: getattr(bodies, name) for name in ("id", "position", "velocity", "spin", "radius", "force")}
        self.folder.write_snapshot(simulation.time, simulation.particles.steps, fluid, particles)
        if clock.monotonic() - self._checkpoint_at > CHECKPOINT_SECONDS:
            self._write_checkpoint()

    def _write_checkpoint(self) -> None:
        until = {"run.until": self.end}
        self.folder.write_checkpoint({"overrides": until, "simulation": self.simulation.checkpoint()})
        self._checkpoint_at = clock.monotonic()


def measure(simulation: Simulation) -> dict[str, float]:
    """One row of history: what a bed is like now."""
    bodies, fluid = simulation.particles.bodies, simulation.fluid
    column = simulation.case.column
    height = bed_height(bodies.position, bodies.radius)
    grid = grid_of(column)
    cells = cells_of(bodies.position, grid.shape, grid.spacing)
    row = {
        "time": simulation.time,
        "bed_height": height,
        "granular_temperature": granular_temperature(bodies.velocity, cells).mean,
        "kinetic_energy": kinetic_energy(bodies),
        "fastest": float(np.sqrt((bodies.velocity**2).sum(axis=1).max(initial=0.0))),
        "particle_count": float(bodies.count),
        "contact_count": float((simulation.particles.edges.force != 0.0).any(axis=1).sum()),
    }
    if fluid is None or simulation.exchange is None:
        return row
    floor = float(grid.open.mean()) * column.size[0] * column.size[1]
    solids = float(((4.0 / 3.0) * np.pi * bodies.radius**3).sum())
    row |= {
        "bed_voidage": 1.0 - 0.99 * solids / (floor * height),
        "pressure_drop": pressure_drop(fluid.pressure, grid.spacing, 0.0, column.height, open_cells=grid.open),
        "exchange_imbalance": exchange_imbalance(fluid, simulation.exchange),
        "volume_imbalance": volume_imbalance(fluid),
        "outside_range": float(simulation.exchange.outside),
    }
    return row
