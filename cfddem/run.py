"""A case, run into a folder: what is written when, and how a run ends, stops, fails and goes on."""

from __future__ import annotations

import math
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from cfddem.case import Case
from cfddem.errors import InputError, RunFailed, RunStopped, UnstableStep
from cfddem.history import FIELDS, measure
from cfddem.particles.guard import guard
from cfddem.placement import species_of
from cfddem.record import checkpoint
from cfddem.record.folder import make_room, read_about, refuse_taken
from cfddem.record.output import RunFolder
from cfddem.record.provenance import provenance
from cfddem.record.quantities import MEAN_HEIGHT
from cfddem.simulation import Simulation

CHECKPOINT_SHARE = 0.02
"""A checkpoint is written with every snapshot, unless checkpoints would take more than this share of the time."""

SAY_EVERY = 0.5
"""Between two reports on the way to the next row of history [s]."""

_SAME = 1.0 - 1e-12
"""Two times closer than this are one."""

Report = Callable[["Run"], None]


class Run:
    """A simulation that writes its folder.

    simulation  to be advanced
    folder      that is written
    report      is called after every row of history, and now and then on the way to the next
    """

    def __init__(self, simulation: Simulation, folder: RunFolder, report: Report = lambda _: None) -> None:
        self.simulation, self.folder, self.report = simulation, folder, report
        plan = simulation.case.run
        self.end = plan.until
        self.every = plan.every or plan.until / 50.0
        self.rows_per_snapshot = max(1, round(self.every / (plan.history_every or self.every / 10.0)))
        self.interval = self.every / self.rows_per_snapshot
        self.row = folder.last_row
        self._begun: tuple[float, float] | None = None
        self._checkpoint_at, self._checkpoint_cost = clock.monotonic(), 0.0
        self._said_at = clock.monotonic()
        self._stop = 0

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
        written = case.to_toml() if text is None else text
        refuse_taken(Path(folder), written)
        make_room(Path(folder))
        begun = clock.monotonic()
        simulation = Simulation(case, progress)
        simulation.wall.seconds["preparation"] = clock.monotonic() - begun  # pouring, and compiling loops for it
        grid = None if simulation.fluid is None else simulation.fluid.grid
        fields = FIELDS | {
            f"{MEAN_HEIGHT}{name}": ("m", f"mean height of the centres of {name}") for name in case.bed.species
        }
        run = cls(simulation, RunFolder.create(Path(folder), written, provenance(case.bed.seed), grid, fields), report)
        run._write_beginning()
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
        """Go on from the newest whole checkpoint of a folder, to the same bits; what was written later is dropped.

        A run that was killed before its first checkpoint begins anew.
        """
        folder = Path(folder)
        state = checkpoint.newest(folder) if checkpoint.exists(folder) else None
        if state is not None and until is not None:
            _must_be_later(until, float(state["simulation"]["particles"]["clock"]["time"]))
        before = read_about(folder)
        written = RunFolder.reopen(folder)
        overrides = ({} if state is None else state["overrides"]) | ({} if until is None else {"run.until": until})
        case = Case.from_text(written.case_text, str(folder / "case.toml"), overrides)
        if state is None:
            written.drop_after(-1.0)
            run = cls(Simulation(case, progress), written, report)
            run._write_beginning()
            return run
        try:
            simulation = Simulation.restored(case, state["simulation"])
        except (KeyError, IndexError, TypeError) as failure:
            if before["status"] != "running":
                written.finish(before["status"], before["message"])
            remedy = f"its checkpoint was written by another; run {folder}/case.toml anew into another folder"
            raise InputError("folder", str(folder), "a run of this version of cfddem", remedy) from failure
        simulation.wall.seconds.update(written.about.get("wall_time", {}))
        if simulation.particles.collisions is not None:
            simulation.particles.collisions.put_back(state["collisions"])
        written.drop_after(simulation.time)
        return cls(simulation, written, report)

    @property
    def remaining(self) -> float:
        """Wall time to the end at the pace so far [s]; NaN before the first step."""
        if self._begun is None or self.simulation.time == self._begun[1]:
            return math.nan
        wall, time = self._begun
        return (clock.monotonic() - wall) * (self.end - self.simulation.time) / (self.simulation.time - time)

    def go(self) -> None:
        """Run to the end; a failure leaves the last good snapshot and says so in the folder."""
        rows = math.floor(self.simulation.time / self.interval / (_SAME * _SAME))
        try:
            with self._stopped_cleanly():
                while not self._stop and self.simulation.time < self.end * _SAME:
                    rows += 1
                    target = min(rows * self.interval, self.end)
                    self._advance(target)
                    if self.simulation.time < target * _SAME:
                        break
                    self._write_row()
                    if rows % self.rows_per_snapshot == 0 or target == self.end:
                        self._write_snapshot()
                    self._say()
                self._write_checkpoint()
                self._finish()
        except RunStopped:
            raise
        except KeyboardInterrupt:
            self.folder.finish("stopped", "in the middle of a step")
            raise
        except BaseException as failure:
            self.folder.finish("failed", str(failure) or type(failure).__name__)
            raise

    def _advance(self, target: float) -> None:
        """Go on to a time [s], or until the run is asked to stop."""
        while not self._stop and self.simulation.time < target * _SAME:
            try:
                self.simulation.step(target)
            except (InputError, UnstableStep) as refusal:
                self._blame(refusal)
            if self._begun is None:  # the first step loads or compiles loops: it says nothing of the pace
                self._begun = clock.monotonic(), self.simulation.time
            if clock.monotonic() - self._said_at > SAY_EVERY:
                self._say()

    def _blame(self, refusal: Exception) -> NoReturn:
        """Some part of a step would not go on: name the particle that is behind it, if one is."""
        moved = self.simulation.particles
        guard(moved.bodies, moved.edges, moved.gap, moved.domain, moved.time, math.nan, moved.walls.wall)
        raise RunFailed(f"t = {moved.time:.6g} s: {refusal}") from refusal

    def _say(self) -> None:
        self.report(self)
        self._said_at = clock.monotonic()

    def _finish(self) -> None:
        """Say in the folder how the run ended."""
        if self.simulation.time >= self.end * _SAME:
            self.folder.finish("finished")
            return
        name = signal.Signals(self._stop).name
        self.folder.finish("stopped", name)
        where = f"at t = {self.simulation.time:.6g} s"
        raise RunStopped(f"stopped by {name} {where}; go on with: cfddem resume {self.folder.folder}", self._stop)

    @contextmanager
    def _stopped_cleanly(self) -> Iterator[None]:
        """SIGINT and SIGTERM end the run after the step at hand; a second one does at once."""
        before: dict[int, Any] = {}

        def stop(number: int, _: Any) -> None:
            self._stop = number
            signal.signal(number, before[number])

        if threading.current_thread() is threading.main_thread():  # elsewhere nobody can be asked to stop
            before = {each: signal.signal(each, stop) for each in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for each, handler in before.items():
                signal.signal(each, handler)

    # ------------------------------------------------------------ what is written

    def _write_beginning(self) -> None:
        """What a run writes before its first step: with the first snapshot its first checkpoint."""
        self._write_row()
        self._write_snapshot()

    def _write_row(self) -> None:
        self.simulation.wall.start()
        self.row = measure(self.simulation)
        self.folder.append_history(self.row)
        self.simulation.wall.lap("measures")

    def _write_snapshot(self) -> None:
        simulation, bodies = self.simulation, self.simulation.particles.bodies
        simulation.wall.start()
        fluid = None
        if simulation.fluid is not None:
            fluid = {
                "voidage": simulation.fluid.voidage,
                "velocity": simulation.fluid.velocity,
                "pressure": simulation.fluid.pressure,
            }
        particles = {name: getattr(bodies, name) for name in ("id", "position", "velocity", "spin", "radius", "force")}
        if simulation.case.bed.species:
            particles["species"] = species_of(simulation.case)[bodies.id]
        record = simulation.particles.collisions
        encounters = None if record is None else record.take()
        self.folder.write_snapshot(simulation.time, simulation.particles.steps, fluid, particles, encounters)
        simulation.wall.lap("snapshots")
        if clock.monotonic() - self._checkpoint_at > self._checkpoint_cost / CHECKPOINT_SHARE:
            self._write_checkpoint()

    def _write_checkpoint(self) -> None:
        """The state to go on from; the intervals too, which would follow from the end otherwise."""
        begin, simulation = clock.monotonic(), self.simulation
        simulation.wall.start()
        plan = {"run.until": self.end, "run.every": self.every, "run.history_every": self.interval}
        state: dict[str, Any] = {"overrides": plan, "simulation": simulation.checkpoint()}
        if simulation.particles.collisions is not None:
            state["collisions"] = simulation.particles.collisions.table
        self.folder.write_checkpoint(state)
        simulation.wall.lap("checkpoints")
        self.folder.note("wall_time", dict(simulation.wall.seconds))
        self._checkpoint_at = clock.monotonic()
        self._checkpoint_cost = self._checkpoint_at - begin


def _must_be_later(until: float, time: float) -> None:
    if until < time:
        raise InputError("until", until, f"at least {time:.6g} s, where the run stands", "a run goes forward only")
