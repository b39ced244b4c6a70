"""Coupled runs in their folders: stopped, killed and failed runs resume bit for bit and record how they ended."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from disturbed_runs import CASES, TINY, WET, kill_and_go_on, long_enough, same_record, same_state

from cfddem import open_run
from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError, RunFailed, RunStopped
from cfddem.case.schema import Case
from cfddem.cli import app as cli
from cfddem.io import checkpoint
from cfddem.io.writer import RunFolder
from cfddem.run import runner
from cfddem.run.progress import Status
from cfddem.run.runner import Run, StopRequest
from cfddem.run.simulation import Simulation


def begin(folder: Path, text: str = TINY, report: Callable[[Status], None] = lambda _: None) -> Run:
    return Run.begin(Case.from_text(text), folder, text=text, report=report)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run without interruption."""
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    begin(folder).go()
    return folder


def test_a_run_records_history_snapshots_and_collisions(undisturbed: Path) -> None:
    seen = open_run(undisturbed)
    assert seen.status == "finished"
    assert seen.times == pytest.approx(np.arange(7) * 0.004)
    assert seen.history["time"] == pytest.approx(np.arange(25) * 0.001)
    assert len(seen.collisions["first"]) > 10 and (np.diff(seen.collisions["end"]) >= 0.0).all()
    assert seen.history["contact_count"][-1] > 10
    parts = seen.about["wall_time"]
    steps = {"time steps", "voidage and drag", "fluid", "forces of the fluid", "pairs and motion", "neighbour lists"}
    assert steps | {"measures", "snapshots", "checkpoints", "first calls", "preparation"} <= parts.keys()
    assert min(parts.values()) > 0.0


def test_a_run_of_another_version_is_refused_and_left_unchanged(
    tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = shutil.copytree(undisturbed, tmp_path / "run")
    state = checkpoint.newest(folder)
    del state["simulation"]["coupling"]["last_step"]
    monkeypatch.setattr(checkpoint, "newest", lambda *_: state)
    with pytest.raises(InputError, match=r"must be a run of this version of cfddem; .* run .*case.toml again"):
        Run.resume(folder, until=0.03)
    assert open_run(folder).status == "finished"


def test_an_impossible_folder_is_refused_before_any_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cfddem.run.runner.Simulation", lambda *_: pytest.fail("work was done"))
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="must be a writable folder; not a directory"):
        begin(tmp_path / "file" / "run")


@pytest.mark.parametrize("rows", [6, 14])
def test_a_stopped_run_resumes_bit_for_bit(
    tmp_path: Path, undisturbed: Path, rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped between two snapshots, with films, contacts and open collisions."""
    monkeypatch.setattr(runner, "REPORT_EVERY", 0.0)

    def stop(status: Status) -> None:
        if status.row["time"] > (rows - 0.5) * 0.001:
            os.kill(os.getpid(), signal.SIGTERM)

    run = begin(tmp_path / "run", report=stop)
    with pytest.raises(RunStopped, match=r"stopped by SIGTERM at t = 0\.0\d+ s; continue with: cfddem resume") as ended:
        run.go()
    assert ended.value.exit_code == 128 + signal.SIGTERM
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert open_run(tmp_path / "run").status == "stopped"
    edges = run.simulation.particle_solver.edges
    assert (edges.resistance > 0.0).any() and np.isfinite(edges.begin).any()
    assert rows < 10 or (edges.force != 0.0).any()
    said: list[str] = []
    Run.resume(tmp_path / "run", report=lambda status: said.append(str(status))).go()
    assert open_run(tmp_path / "run").status == "finished"
    assert said[0].startswith("0.0") and "left" in said[0]
    same_state(tmp_path / "run", undisturbed)
    same_record(tmp_path / "run", undisturbed)


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_stop_between_two_rows_loses_no_row(tmp_path: Path, undisturbed: Path, share: float) -> None:
    """Stopped before and after the middle of an interval."""
    run = begin(tmp_path / "run", TINY.replace("history_every = 0.001", "history_every = 0.004"))
    step = run.simulation.step

    def stepping(until: float) -> None:
        step(until)
        if run.simulation.time > (2.0 + share) * 0.004:
            os.kill(os.getpid(), signal.SIGINT)

    run.simulation.step = stepping  # type: ignore[method-assign]
    with pytest.raises(RunStopped, match="SIGINT"):
        run.go()
    assert 0.008 < run.simulation.time < 0.012
    Run.resume(tmp_path / "run").go()
    assert open_run(tmp_path / "run").history["time"] == pytest.approx(np.arange(7) * 0.004)


def test_a_stop_in_the_step_that_reaches_a_row_keeps_the_row(tmp_path: Path) -> None:
    run = begin(tmp_path / "run")
    step = run.simulation.step

    def stepping(until: float) -> None:
        step(until)
        if run.simulation.time == until and until > 0.0025:
            os.kill(os.getpid(), signal.SIGTERM)

    run.simulation.step = stepping  # type: ignore[method-assign]
    with pytest.raises(RunStopped):
        run.go()
    assert open_run(tmp_path / "run").history["time"] == pytest.approx([0.0, 0.001, 0.002, 0.003])


def test_a_resumed_run_with_a_later_end_keeps_its_intervals(tmp_path: Path) -> None:
    text = TINY.replace("until = 0.024", "until = 0.004").replace("every = 0.004", "every = 0.002")
    begin(tmp_path / "run", text).go()
    with pytest.raises(InputError, match=r"until = 0\.003: must be at least 0\.004 s"):
        Run.resume(tmp_path / "run", until=0.003)
    Run.resume(tmp_path / "run", until=0.007).go()
    seen = open_run(tmp_path / "run")
    assert seen.times == pytest.approx([0.0, 0.002, 0.004, 0.006, 0.007])
    assert seen.history["time"] == pytest.approx(np.arange(8) * 0.001)


def test_a_run_killed_before_its_first_checkpoint_starts_again(tmp_path: Path, undisturbed: Path) -> None:
    run = begin(tmp_path / "run")
    run.folder._lock.close()
    for each in (tmp_path / "run" / "checkpoint").iterdir():
        each.unlink()
    Run.resume(tmp_path / "run").go()
    same_record(tmp_path / "run", undisturbed)


def test_the_first_step_of_a_run_resumed_from_its_start_is_the_same() -> None:
    """The flow at the start passes between the particles."""
    case = Case.from_text(TINY)
    whole = Simulation(case)
    resumed = Simulation.restored(case, whole.checkpoint())
    for each in (whole, resumed):
        each.step()
    assert np.array_equal(whole.particles.velocity, resumed.particles.velocity)
    assert np.array_equal(whole.fluid.fields.velocity, resumed.fluid.fields.velocity)


@pytest.mark.slow
def test_resuming_with_another_thread_count_is_bit_for_bit(tmp_path: Path) -> None:
    """More than a thousand particles, so that loops are threaded: started on one thread, resumed on two."""
    text = TINY.replace("width = 0.012", "width = 0.018").replace("height = 0.018", "height = 0.048")
    text = text.replace("count = 160", "count = 1050").replace("until = 0.024", "until = 0.008")
    before = use_threads(None)

    def stop(status: Status) -> None:
        if status.row["time"] > 0.0035:
            os.kill(os.getpid(), signal.SIGTERM)

    begin(tmp_path / "whole", text).go()
    with pytest.raises(RunStopped):
        begin(tmp_path / "run", text, stop).go()
    try:
        use_threads(2)
    except InputError:
        pytest.skip("one thread only: NUMBA_NUM_THREADS or the machine allows no more")
    try:
        Run.resume(tmp_path / "run").go()
    finally:
        use_threads(before)
    same_state(tmp_path / "run", tmp_path / "whole")
    same_record(tmp_path / "run", tmp_path / "whole")


# ---------------------------------------------------------------- failures


def lost(run: Run) -> None:
    run.simulation.particles.velocity[7] = (0.0, 0.0, -1e4)


def no_number(run: Run) -> None:
    run.simulation.particles.velocity[7, 1] = np.nan


@pytest.mark.parametrize(("how", "said"), [(no_number, "is NaN"), (lost, "particle 7 at")])
def test_a_failure_leaves_the_last_good_snapshot(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    how: Callable[[Run], None],
    said: str,
) -> None:
    """From the command line: one line and exit code 3; earlier data are whole and the run can be resumed."""
    (tmp_path / "case.toml").write_text(TINY)
    monkeypatch.chdir(tmp_path)
    write = Run._write_row

    def write_row(run: Run) -> None:
        write(run)
        if run.simulation.time > 0.0095:
            how(run)

    monkeypatch.setattr(Run, "_write_row", write_row)
    monkeypatch.setattr(sys, "argv", ["cfddem", "run", "case.toml", "-o", "bed"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == RunFailed.exit_code == 3
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("cfddem: ") and said in last
    seen = open_run("bed")
    assert (seen.status, len(seen.times)) == ("failed", 3) and said in seen.message
    assert np.isfinite(seen.particles()["velocity"]).all() and np.isfinite(seen.fluid("pressure")).all()
    assert len(seen.history["time"]) == 11
    monkeypatch.setattr(Run, "_write_row", write)
    Run.resume(Path("bed"), until=0.01).go()
    assert open_run("bed").status == "finished"


def test_an_interrupt_within_a_step_is_a_stop(tmp_path: Path) -> None:
    """As after a second Ctrl-C; the run can be resumed from the previous checkpoint."""

    def step(_: float) -> None:
        raise KeyboardInterrupt

    halted = SimpleNamespace(case=Case.from_text(TINY), time=0.0, step=step, communicator=SERIAL)
    folder = RunFolder.create(tmp_path / "run", TINY, {})
    with pytest.raises(KeyboardInterrupt):
        Run(halted, folder).go()  # type: ignore[arg-type]
    seen = open_run(tmp_path / "run")
    assert (seen.status, seen.message) == ("stopped", "within a step")


# ---------------------------------------------------------------- kills


@pytest.mark.slow
def test_ten_kills_of_a_real_run_leave_it_whole_and_its_end_unchanged(tmp_path: Path) -> None:
    """`python tests/disturbed_runs.py 100` does a hundred."""
    assert kill_and_go_on(tmp_path, kills=10, seed=4) >= 5
    begin(tmp_path / "whole", long_enough(10)).go()
    same_state(tmp_path / "run", tmp_path / "whole")
    same_record(tmp_path / "run", tmp_path / "whole")


@pytest.mark.slow
def test_kills_of_a_wet_run_leave_it_whole_and_its_end_unchanged(tmp_path: Path) -> None:
    """Bridges, liquid on walls, the spray and the visits to its zone are in the checkpoint."""
    assert kill_and_go_on(tmp_path, kills=6, seed=5, case=WET) >= 3
    begin(tmp_path / "whole", long_enough(6, WET)).go()
    same_state(tmp_path / "run", tmp_path / "whole")
    same_record(tmp_path / "run", tmp_path / "whole")
    history = open_run(tmp_path / "whole").history
    assert history["bridge_count"][-1] > 50 and history["liquid_sprayed"][-1] > 0.0
    assert history["liquid_imbalance"].max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gas", "hot"])
def test_kills_of_gas_and_hot_runs_leave_them_whole_and_their_ends_unchanged(kind: str, tmp_path: Path) -> None:
    """Beads in air, dry, and wet under a spray in hot air, which takes up the water."""
    assert kill_and_go_on(tmp_path, kills=6, seed=6, case=CASES[kind]) >= 3
    begin(tmp_path / "whole", long_enough(6, CASES[kind])).go()
    same_state(tmp_path / "run", tmp_path / "whole")
    same_record(tmp_path / "run", tmp_path / "whole")
    assert ("evaporated_mass" in open_run(tmp_path / "whole").history) == (kind == "hot")


def test_a_signal_that_comes_while_ranks_agree_is_not_lost() -> None:
    """The call that is under way does not know of it; the next one does."""

    class Late(Communicator):
        def _combine(self, local: Any, operation: Any) -> Any:
            if not stop:
                os.kill(os.getpid(), signal.SIGTERM)
            return local

    stop = StopRequest()
    with stop:
        assert not stop.agreed(Late())
        assert stop.agreed(Late()) and stop.name == "SIGTERM"
