"""Run a case into a folder: history, snapshots and checkpoints; stop, fail and resume cleanly.

A run ends before its time by SIGINT or SIGTERM, between two steps, or by the errors of its means.
"""

from __future__ import annotations

import math
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NoReturn

import numpy as np

from cfddem.analysis.series import block_average, stationarity
from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError, RunFailed, RunStopped, UnstableStep, nearest
from cfddem.backend.portions import Portions
from cfddem.backend.stopwatch import Stopwatch
from cfddem.case.column_grid import grid_of
from cfddem.case.compare import require_measured_units
from cfddem.case.schema import Case, require_case
from cfddem.features.feature_list import FEATURES
from cfddem.fluid.block import in_portions
from cfddem.fluid.fields import FLUID_FIELDS
from cfddem.io import checkpoint
from cfddem.io.folder import (
    AVERAGES_FROM,
    prepare_folder,
    provenance,
    read_about,
    text_with_kept_files,
    with_kept_files,
)
from cfddem.io.quantities import Quantities, Quantity, of_fields
from cfddem.io.writer import RunFolder, folder_of_ranks
from cfddem.particles.guard import guard
from cfddem.run import history
from cfddem.run.history import all_columns
from cfddem.run.progress import Status
from cfddem.run.resuming import (
    LARGE,
    branch_state,
    case_to_continue,
    record_of,
    require_compiled,
    require_forward,
    require_measures,
    restored,
    status_restored_on_refusal,
    warn_of_changes,
)
from cfddem.run.simulation import Simulation

CHECKPOINT_SHARE = 0.02
"""A checkpoint is written with every snapshot, unless checkpoints would take more than this share of the wall time."""

REPORT_EVERY = 0.5
"""Wall time between two reports within an interval of the history [s]."""

_SAME = 1.0 - 1e-12
"""Two times whose ratio is closer to 1 than this are the same."""

RECORDED = ("voidage", "velocity", "pressure")
"""Fields of the fluid in snapshots, at cell centres."""

ORIGIN = "from"
"""Entry of the provenance of a run that began with the state of another: its folder and time."""

SOLID = "solid"
"""Field of the solid cells of a grid that has any."""

Report = Callable[[Status], None]


class Run:
    """A simulation that writes a run folder. Make one with `Run.begin` or `Run.resume`, then call `go`.

    simulation  the simulation
    folder      that is written
    report      called after every row of history, and every half second of wall time; of several ranks on rank 0

    >>> from cfddem import gallery
    >>> Run.begin(gallery()["liquid-bed"], Path("bed")).go()    # doctest: +SKIP
    """

    def __init__(self, simulation: Simulation, folder: RunFolder, report: Report = lambda _: None) -> None:
        self.simulation, self.folder = simulation, folder
        self.report = report if simulation.communicator.rank == 0 else lambda _: None
        plan = simulation.case.run
        self.end = plan.until
        self.every = plan.every or plan.until / 50.0
        self.rows_per_snapshot = max(1, round(self.every / (plan.history_every or self.every / 10.0)))
        self.interval = self.every / self.rows_per_snapshot
        self.row = folder.last_row
        self._why = ""  # the run ends before its end
        self._stop = StopRequest()
        self._pace_from: tuple[float, float] | None = None  # wall time and simulated time after the first step [s]
        self._reported_at = clock.monotonic()
        self._checkpoint_at, self._checkpoint_cost = clock.monotonic(), 0.0

    # ------------------------------------------------------------ begin and resume

    @classmethod
    def begin(
        cls,
        case: Case,
        folder: Path,
        *,
        text: str | None = None,
        report: Report = lambda _: None,
        progress: Callable[[str], None] = lambda _: None,
        communicator: Communicator = SERIAL,
        origin: Path | None = None,
        **added: Any,
    ) -> Run:
        """Prepare a case in a new folder, and write its initial state.

        text               the case file as the user wrote it; made from the case if None
        report             called after every row of history
        progress           called with a line of text for each part of the preparation
        communicator       of the ranks that share the run; all of them call this. Rank 0 writes
        origin             folder of a run whose last state this one begins with: particles, contacts, flow and time
        added              fields, callbacks and features of the simulation, see `Simulation`
        errors             InputError if the folder holds a run or cannot be written, or for a case that differs from
                           that of `origin` in more than a run can change
        """
        require_case(case)
        folder, text = Path(folder), text_with_kept_files(case) if text is None else text
        history.require_shared(case, communicator.size)
        require_measures_of(case)
        require_measured_units(case.compare, history.units_of(case))
        require_compiled(case)
        state = None if origin is None else branch_state(case, Path(origin))
        communicator.by_first(lambda: prepare_folder(folder, text, case))
        case = with_kept_files(case, folder)
        wall = Stopwatch()
        with _no_empty_folder(folder):
            if state is None:
                simulation = Simulation(case, progress, communicator=communicator, **added)
            else:
                simulation = restored(case, state, Path(origin or ""), communicator, **added)
        wall.count("preparation")  # initial packing, loading of compiled loops
        simulation.timers.seconds |= wall.seconds
        grid = simulation.fluid.grid.whole if simulation.has_fluid else None
        about = (
            provenance(case.bed.seed)
            | record_of(case)
            | ({"ranks": communicator.size} if communicator.size > 1 else {})
            | ({} if state is None else {ORIGIN: {"folder": str(origin), "time": simulation.time}})
        )
        written = folder_of_ranks(
            communicator, lambda: RunFolder.create(folder, text, about, grid, quantities_of(simulation))
        )
        run = cls(simulation, written, report)
        run._write_initial_state()
        return run

    @classmethod
    def resume(
        cls,
        folder: Path,
        *,
        until: float | None = None,
        report: Report = lambda _: None,
        progress: Callable[[str], None] = lambda _: None,
        communicator: Communicator = SERIAL,
        **added: Any,
    ) -> Run:
        """Continue from the newest undamaged checkpoint of a folder, bit for bit; later snapshots and rows are dropped.

        A run that was killed before its first checkpoint starts again.

        until   new end [s]; the run then goes on to it, whatever `run.until_error` says
        others  as in `begin`
        errors  InputError if the folder holds no run, or one that cannot be continued
        """
        folder = Path(folder)
        later = LARGE if communicator.size > 1 else ()
        state = checkpoint.newest(folder, later) if checkpoint.exists(folder) else None
        before = read_about(folder)
        if state is None and ORIGIN in before["provenance"]:
            remedy = f"begin it again in another folder: cfddem run --from {before['provenance'][ORIGIN]['folder']}"
            raise InputError("folder", str(folder), "a run with a checkpoint", remedy)
        require_forward(until, state)
        case = case_to_continue(folder, state, until)
        history.require_shared(case, communicator.size)
        written = folder_of_ranks(communicator, lambda: RunFolder.reopen(folder))
        with status_restored_on_refusal(written, before):
            if state is None:
                simulation = Simulation(case, progress, communicator=communicator, **added)
            else:
                communicator.by_first(lambda: require_measures(written, case))
                simulation = restored(case, state, folder, communicator, **added)
                simulation.timers.seconds.update(written.about.get("wall_time", {}))
        warn_of_changes(written, case)
        written.drop_after(-1.0 if state is None else simulation.time)
        if until is not None:
            written.note(AVERAGES_FROM, None)
        run = cls(simulation, written, report)
        if written.about.get(AVERAGES_FROM) is not None:
            run._why = str(before["message"])
        if state is None:
            run._write_initial_state()
        return run

    # ------------------------------------------------------------ run

    def go(self) -> None:
        """Run to the end.

        errors  RunStopped after SIGINT or SIGTERM; RunFailed if the simulation fails. Both leave a folder that can be
                resumed
        """
        with self._status_recorded(), self._stop:
            for time, with_snapshot in self._rows():
                self._advance(time)
                if self.simulation.time < time * _SAME:  # stopped before the next row
                    break
                self._write_row()
                if with_snapshot:
                    self._write_snapshot()
                self._report()
                if with_snapshot and self._means_are_known():
                    break
            self._write_checkpoint()
            self._finish()

    def _rows(self) -> Iterator[tuple[float, bool]]:
        """Time of each row of history that is left [s], and whether a snapshot is due."""
        number = math.floor(self.simulation.time / self.interval / (_SAME * _SAME))
        while not self._stopped() and self.simulation.time < self.end * _SAME:
            number += 1
            time = min(number * self.interval, self.end)
            yield time, number % self.rows_per_snapshot == 0 or time == self.end

    def _advance(self, target: float) -> None:
        """Step to a time [s], or until the run is stopped."""
        while not self._stopped() and self.simulation.time < target * _SAME:
            try:
                self.simulation.step(target)
            except (InputError, UnstableStep) as failure:
                self._fail(failure)
            if self._pace_from is None:  # the first step loads or compiles loops and does not count
                self._pace_from = clock.monotonic(), self.simulation.time
            if clock.monotonic() - self._reported_at > REPORT_EVERY:
                self._report()

    def _means_are_known(self) -> bool:
        """Whether the means that `run.until_error` names are known, on all ranks; record then where they begin."""
        plan = self.simulation.case.run
        if not plan.until_error:
            return False
        start = self.simulation.communicator.by_first(
            lambda: averages_from(self.folder.history, plan.until_error, plan.average_from or 0.0)
        )
        if math.isnan(start):
            return False
        self.end = self.simulation.time
        names = " and ".join(name.replace("_", " ") for name in plan.until_error)
        self._why = f"when the error of {names} was small enough (run.until_error)"
        self.folder.note(AVERAGES_FROM, start)
        return True

    def _stopped(self) -> bool:
        """Whether the run is to stop, on all ranks."""
        return self._stop.agreed(self.simulation.communicator)

    def _fail(self, failure: Exception) -> NoReturn:
        """Report a failed step; name the particle that caused it if there is one."""
        solver = self.simulation.particle_solver
        guard(solver.particles, solver.edges, solver.gap, solver.domain, solver.time, math.nan, solver.walls.wall)
        raise RunFailed(f"t = {solver.time:.6g} s: {failure}") from failure

    def _report(self) -> None:
        simulation = self.simulation
        steps = simulation.particle_solver.steps
        self.report(Status(simulation.time, self.end, self.remaining, simulation.limiting, steps, self.row))
        self._reported_at = clock.monotonic()

    @property
    def remaining(self) -> float:
        """Wall time to the end, from the pace so far [s]; NaN before the first step."""
        if self._pace_from is None or self.simulation.time == self._pace_from[1]:
            return math.nan
        wall, time = self._pace_from
        return (clock.monotonic() - wall) * (self.end - self.simulation.time) / (self.simulation.time - time)

    def _finish(self) -> None:
        """Record that the run finished; or that it was stopped, and raise RunStopped."""
        if self.simulation.time >= self.end * _SAME:
            self.folder.finish("finished", self._why)
            return
        self.folder.finish("stopped", self._stop.name)
        where = f"at t = {self.simulation.time:.6g} s"
        message = f"stopped by {self._stop.name} {where}; continue with: cfddem resume {self.folder.folder}"
        raise RunStopped(message, self._stop.signal)

    @contextmanager
    def _status_recorded(self) -> Iterator[None]:
        """Record in the folder why the run ended early."""
        try:
            yield
        except RunStopped:
            raise
        except KeyboardInterrupt:
            self.folder.finish("stopped", "within a step")
            raise
        except SystemExit as end:
            message = f"sys.exit({end.code!r}) was called within the run"
            self.folder.finish("failed", message)
            if self.simulation.communicator.size == 1:
                raise
            raise RunFailed(message) from end  # the other ranks would wait for this one forever
        except BaseException as failure:
            self.folder.finish("failed", str(failure) or type(failure).__name__)
            raise

    # ------------------------------------------------------------ write

    def _write_initial_state(self) -> None:
        """The first row, snapshot and checkpoint."""
        self._write_row()
        self._write_snapshot()

    def _write_row(self) -> None:
        with self.simulation.timers.part("measures"):
            self.row = history.row(self.simulation)
            self.folder.append_history(self.row)

    def _write_snapshot(self) -> None:
        simulation, solver = self.simulation, self.simulation.particle_solver
        with simulation.timers.part("snapshots"):
            fluid: dict[str, np.ndarray | Portions] | None = None
            if simulation.has_fluid:
                grid = simulation.fluid.grid
                fluid = {name: in_portions(grid, getattr(simulation.fluid, name), 0) for name in RECORDED}
                for feature in simulation.features:
                    fluid |= feature.cells_for_snapshot()
                if SOLID in self.folder.quantities.get("fluid", {}):
                    fluid[SOLID] = ~grid.whole.open
            collisions = solver.collisions.take() if solver.collisions else None
            self.folder.write_snapshot(simulation.time, solver.steps, fluid, simulation.snapshot(), collisions)
        due = clock.monotonic() - self._checkpoint_at > self._checkpoint_cost / CHECKPOINT_SHARE
        if simulation.communicator.broadcast(due):
            self._write_checkpoint()

    def _write_checkpoint(self) -> None:
        """Write the full state, with the intervals, which would otherwise follow from a new end."""
        begin, simulation = clock.monotonic(), self.simulation
        with simulation.timers.part("checkpoints"):
            plan = {
                "run.until": self.end, "run.every": self.every, "run.history_every": self.interval,
                "run.until_error": simulation.case.run.until_error,
            }  # fmt: skip
            state: dict[str, Any] = {"time": simulation.time, "overrides": plan, "simulation": simulation.checkpoint()}
            self.folder.write_checkpoint(state)
        self.folder.note("wall_time", dict(simulation.timers.seconds))
        self._checkpoint_at = clock.monotonic()
        self._checkpoint_cost = self._checkpoint_at - begin


@contextmanager
def _no_empty_folder(folder: Path) -> Iterator[None]:
    """Remove the folder of a run that ends while it is prepared, unless it holds files."""
    try:
        yield
    except BaseException as failure:
        with suppress(OSError):
            (folder / "data").rmdir()
            folder.rmdir()
        if isinstance(failure, KeyboardInterrupt):
            message = "stopped by SIGINT before the first step; the same command begins anew"
            raise RunStopped(message, signal.SIGINT) from None
        raise


def quantities_of(simulation: Simulation) -> Quantities:
    """Unit and meaning of everything that a run of a simulation writes."""
    case = simulation.case
    return {
        "history": history.all_columns(case),
        "particles": of_fields(field for field in simulation.particles.fields.values() if field.snapshot),
        "fluid": of_fields(field for field in FLUID_FIELDS if field.name in RECORDED)
        | of_fields(field for kind in FEATURES if kind.is_in(case) for field in kind.cell_fields_of(case))
        | ({SOLID: Quantity("1", "1 in solid cells, 0 in the fluid")} if grid_of(case).solid is not None else {}),
        "collisions": of_fields(simulation.particle_solver.laws.bridges.collision_fields)
        if case.run.record_collisions
        else {},
    }


# ---------------------------------------------------------------- when a run ends before its time


class StopRequest:
    """Catches SIGINT and SIGTERM inside a `with` block; true after the first one.

    A second signal acts as usual, so that a second Ctrl-C ends the process at once. Outside of the main thread no
    signal is caught.
    """

    def __init__(self) -> None:
        self.signal = 0  # number of the signal that was received; 0 before
        self._before: dict[int, Any] = {}

    def __bool__(self) -> bool:
        return self.signal != 0

    @property
    def name(self) -> str:
        """Name of the signal."""
        return signal.Signals(self.signal).name

    def agreed(self, communicator: Communicator) -> bool:
        """Whether a rank has received a signal; then all ranks take it for theirs."""
        number = communicator.largest([self.signal])
        if number:  # a signal that came during the call is found by the next one
            self.signal = number
        return bool(number)

    def __enter__(self) -> StopRequest:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._receive) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _receive(self, number: int, _: Any) -> None:
        self.signal = number
        signal.signal(number, self._before[number])


# ---------------------------------------------------------------- errors of means


FEWEST_INDEPENDENT = 16.0
"""Fewest uncorrelated values in a mean; with fewer, an error that is small by chance would end the run."""


def require_measures_of(case: Case) -> None:
    """Refuse names in `run.until_error` that are no measures of the case."""
    measures = sorted(name for name, quantity in all_columns(case).items() if quantity.group == "measure")
    for name in case.run.until_error:
        if name not in measures:
            raise InputError("run.until_error", name, nearest(name, measures))


def averages_from(history: Mapping[str, np.ndarray], limits: Mapping[str, float], earliest: float = 0.0) -> float:
    r"""Start of the averages once every mean is known; NaN while one is not.

    .. math:: \frac{s}{|\bar x|} \le \mathrm{limit}

    history   columns in time
    limits    largest standard error s of each mean over the mean [-]
    earliest  start of averages, if the start-up ends before it [s]
    returns   time at which the longest start-up ends [s]; NaN if a series is not stationary, its record too short for
              its correlation time, it has fewer than 16 uncorrelated values, or its error is above the limit

    Start-up and stationarity are those of :func:`cfddem.analysis.series.stationarity`, errors those of
    :func:`cfddem.analysis.series.block_average`.
    """
    series = [stationarity(history[name]) for name in limits]
    if not series or not all(one.stationary for one in series):
        return float("nan")
    start = max(int(np.searchsorted(history["time"], earliest)), *(one.start for one in series))
    all_known = all(_is_known(history[name][start:], limit) for name, limit in limits.items())
    return float(history["time"][start]) if all_known else float("nan")


def _is_known(values: np.ndarray, limit: float) -> bool:
    average = block_average(values)
    return average.enough and average.independent >= FEWEST_INDEPENDENT and average.error <= limit * abs(average.mean)
