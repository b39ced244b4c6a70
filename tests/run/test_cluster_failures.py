"""Runs on several ranks that fail, are killed or stopped, or fill the disk: all ranks end, the folder stays whole."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from cluster import environment, needs_mpi
from command_line import cfddem
from test_cluster_commands import BED, TEXT, assert_same_files, assert_same_particles

from cfddem.backend.launch import launch_command
from cfddem.io import checkpoint
from cfddem.io.reading import open_run

pytestmark = needs_mpi

LONGEST = 10.0
"""Time in which all ranks end after one of them has failed [s]."""

FAILING = """
import os, signal, sys, time
from cfddem.backend.launch import communicator
from cfddem.backend.mpi import Ranks
from cfddem.cli.app import main
from cfddem.run.simulation import Simulation

step, swap, how, mark = Simulation.step, Ranks.swap, sys.argv[1], sys.argv[2]

def fail():
    with open(mark, "w") as file:
        file.write(repr(time.time()))
    if how == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if how.startswith("exit"):
        sys.exit(int(how[4:]))
    raise ValueError("something unforeseen")

def failing(self, until):
    if self.time > 0.006 and self.communicator.rank == 1:
        if how == "message":
            Ranks.swap = lambda *arguments: fail()
        else:
            fail()
    step(self, until)

Simulation.step = failing
sys.argv[1:] = sys.argv[3:]
main()
"""

SCRIPT = """
import time
from pathlib import Path
from cfddem import Case, Run
from cfddem.backend.launch import communicator

ranks = communicator()

def failing(simulation):
    if ranks.rank == 1:
        Path("mark").write_text(repr(time.time()))
        raise ValueError("something unforeseen")

Run.begin(Case.from_toml(Path("case.toml")), Path("run"), communicator=ranks, callbacks=[failing]).go()
"""

FULL_DISK = """
set -e
mount -t tmpfs -o size={room} tmpfs disk
set +e
{python} -m cfddem run case.toml -o disk/run --ranks 2
echo $? > code
ls -A disk/run disk/run/data disk/run/checkpoint > left
set -e
mount -o remount,size=50m disk
{python} -m cfddem resume disk/run --ranks 2
cp -r disk/run run
"""


CASES = {
    "beads": TEXT.replace("every = 0.005\nhistory_every = 0.001", "every = 0.0005"),
    "bed in water": BED.replace(
        "every = 0.005, history_every = 0.002", "every = 0.0005, record_collisions = true"
    ).replace("height = 0.04", "height = 0.045"),
}
"""Three ranks can share each."""


@pytest.fixture(scope="module", params=["beads", pytest.param("bed in water", marks=pytest.mark.slow)])
def home(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a case."""
    folder = tmp_path_factory.mktemp("failures")
    (folder / "case.toml").write_text(CASES[request.param])
    return folder


@pytest.fixture(scope="module")
def one(home: Path) -> Path:
    """The run of the case in one process."""
    assert cfddem("run", "case.toml", "-o", "one", folder=home).returncode == 0
    return home / "one"


def assert_whole(run: Path) -> None:
    """Every file of a run folder that is not marked as partial can be read, and the index lacks no snapshot."""
    seen = open_run(run)
    assert not seen.missing
    for number in range(len(seen.snapshots)):
        assert len(seen.particles(number)["position"]) in (300, 400)
    if checkpoint.exists(run):
        assert checkpoint.newest(run)["time"] >= 0.0


def assert_goes_on(run: Path, one: Path, ranks: int) -> None:
    """A resumed run ends with the particles and files of the run in one process."""
    done = cfddem("resume", str(run), "--until", "0.01", "--ranks", str(ranks))
    assert done.returncode == 0, done.stderr
    assert open_run(run).status == "finished"
    assert_same_particles(one, run)
    assert_same_files(one, run)


@pytest.mark.parametrize(
    ("how", "code", "message"),
    [
        pytest.param("raise", 1, "cfddem: rank 1: ValueError: something unforeseen", marks=pytest.mark.slow),
        ("message", 1, "cfddem: rank 1: ValueError: something unforeseen"),
        pytest.param("exit4", 3, "cfddem: rank 1: sys.exit(4) was called within the run", marks=pytest.mark.slow),
        pytest.param("exit0", 3, "rank 1: sys.exit(0) was called within the run", marks=pytest.mark.slow),
    ],
)
def test_one_rank_that_fails_ends_all(home: Path, tmp_path: Path, how: str, code: int, message: str) -> None:
    """An exception in a step or within an exchange, and sys.exit: within 10 s, with its message and code."""
    fails(home, tmp_path, how, code, message)


@pytest.mark.slow  # as plain tests: a killed rank, and one process that goes on from two
def test_one_process_goes_on_where_a_rank_was_killed(home: Path, one: Path, tmp_path: Path) -> None:
    """From a whole folder, to the end of one process."""
    fails(home, tmp_path, "kill", 9, "")
    assert_goes_on(tmp_path / "run", one, ranks=1)


def fails(home: Path, tmp_path: Path, how: str, code: int, message: str) -> None:
    """Make a rank fail: all end within 10 s with its message and code, and leave a whole folder."""
    (tmp_path / "failing.py").write_text(FAILING)
    program = [sys.executable, str(tmp_path / "failing.py"), how, str(tmp_path / "mark")]
    command = launch_command(2, [*program, "run", str(home / "case.toml"), "-o", str(tmp_path / "run")])
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=600, check=False)
    took = time.time() - float((tmp_path / "mark").read_text())
    assert took < LONGEST, f"the ranks ended after {took:.1f} s"
    assert done.returncode == code and message in done.stderr, done.stderr
    assert_whole(tmp_path / "run")


def test_one_rank_of_a_script_that_fails_ends_all(home: Path, tmp_path: Path) -> None:
    """A program that is started by `python -m mpi4py`."""
    (tmp_path / "program.py").write_text(SCRIPT)
    shutil.copy(home / "case.toml", tmp_path)
    command = launch_command(2, [sys.executable, "-m", "mpi4py", "program.py"])
    done = subprocess.run(
        command, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=600, check=False
    )
    took = time.time() - float((tmp_path / "mark").read_text())
    assert took < LONGEST and done.returncode == 1 and "ValueError: something unforeseen" in done.stderr


def begun(home: Path, run: Path, processes: Path) -> subprocess.Popen[str]:
    """A long run on two ranks that has written a snapshot; its temporary files are in the folder `processes`."""
    words = ["run", str(home / "case.toml"), "-o", str(run), "--ranks", "2", "--set", "run.until=100"]
    process = subprocess.Popen(
        [sys.executable, "-m", "cfddem", *words], env=environment() | {"TMPDIR": str(processes)}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    until = time.monotonic() + 600.0
    while not (run / "data" / "00000001.h5").exists() and time.monotonic() < until:
        time.sleep(0.1)
    return process


@pytest.mark.parametrize("rank", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_a_killed_rank_is_named_with_what_to_do(home: Path, tmp_path: Path, rank: int) -> None:
    """In one line, with exit code 137, as the page of clusters says; the launcher's text remains."""
    run = tmp_path / "run"
    process = begun(home, run, tmp_path)
    (victim,) = (int(each.name) for each in tmp_path.glob("cfddem-*/*") if each.read_text() == str(rank))
    os.kill(victim, signal.SIGKILL)
    output, message = process.communicate(timeout=LONGEST)
    assert process.returncode == 128 + signal.SIGKILL
    assert message.splitlines()[-1] == (
        f"cfddem: rank {rank} was killed by SIGKILL, by hand or because memory ran out, and all others ended; "
        f"continue with: cfddem resume {run}"
    )
    assert str(victim) in output and not list(tmp_path.glob("cfddem-*"))
    assert_whole(run)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends processes with their parent")
def test_ranks_end_where_their_command_is_killed(home: Path, tmp_path: Path) -> None:
    process = begun(home, tmp_path / "run", tmp_path)
    process.kill()
    process.communicate(timeout=LONGEST)
    until = time.monotonic() + LONGEST
    while other_ranks(tmp_path / "run"):
        time.sleep(0.1)
        assert time.monotonic() < until


def kill_all(one: Path, run: Path, kills: int, seed: int) -> None:
    """Kill the launcher and all ranks at random instants, look at the folder, go on, and look at the end."""
    instants, ranks, home = random.Random(seed), 2, one.parent
    command = ["run", "case.toml", "-o", str(run)]
    for _ in range(kills):
        before = len(list((run / "data").glob("*.h5"))) if run.exists() else 0
        words = [sys.executable, "-m", "cfddem", *command, "--ranks", str(ranks)]
        process = subprocess.Popen(
            words, cwd=home, env=environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        until = time.monotonic() + 300.0
        while process.poll() is None and time.monotonic() < until:
            if run.exists() and len(list((run / "data").glob("*.h5"))) > min(before + instants.randint(0, 4), 17):
                break
            time.sleep(0.02)
        time.sleep(instants.uniform(0.0, 0.1))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        assert process.returncode == -signal.SIGKILL
        while other_ranks(run):
            time.sleep(0.1)
            assert time.monotonic() < until + LONGEST
        assert_whole(run)
        command, ranks = ["resume", str(run)], 5 - ranks
    assert_goes_on(run, one, ranks=2)


def other_ranks(run: Path) -> list[str]:
    """Processes that still write a run."""
    found = subprocess.run(["ps", "-eo", "stat,args"], capture_output=True, text=True, check=True).stdout
    return [line for line in found.splitlines() if str(run) in line and not line.startswith("Z")]


@pytest.mark.slow  # as a plain test: one rank that is killed
def test_killed_ranks_leave_a_whole_folder_that_goes_on(one: Path, tmp_path: Path) -> None:
    """Twice, going on with another number of ranks; the end is that of one process."""
    kill_all(one, tmp_path / "run", kills=2, seed=1)


@pytest.mark.slow
def test_many_kills_leave_a_whole_folder_that_goes_on(one: Path, tmp_path: Path) -> None:
    """Ten times."""
    kill_all(one, tmp_path / "run", kills=10, seed=2)


def _can_mount() -> bool:
    program = shutil.which("unshare")
    words = [program or "", "-m", "sh", "-c", "mount -t tmpfs -o size=1m tmpfs /mnt"]
    return program is not None and subprocess.run(words, capture_output=True, check=False).returncode == 0


@pytest.mark.slow  # as plain tests: a full disk in one process, and ranks of which one fails
@pytest.mark.skipif(not _can_mount(), reason="a small disk cannot be mounted here")
@pytest.mark.parametrize("room", ["400k", "100k"])
def test_a_full_disk_ends_all_ranks_and_leaves_a_whole_folder(home: Path, one: Path, tmp_path: Path, room: str) -> None:
    """Rank 0 writes; on a larger disk the run goes on to the end of one process."""
    shutil.copy(home / "case.toml", tmp_path)
    (tmp_path / "disk").mkdir()
    program = FULL_DISK.format(room=room, python=sys.executable)
    done = subprocess.run(
        ["unshare", "-m", "bash", "-c", program], cwd=tmp_path, env=environment(), capture_output=True, text=True,
        timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "code").read_text() == "3\n"
    assert "rank 0" in done.stderr and "no space left on device; free space on that disk" in done.stderr
    assert ".partial" not in (tmp_path / "left").read_text()
    assert_whole(tmp_path / "run")
    assert_same_particles(one, tmp_path / "run")
    assert_same_files(one, tmp_path / "run")


def test_a_scheduler_stops_all_ranks_with_a_checkpoint(home: Path, tmp_path: Path) -> None:
    """SIGTERM to the launcher: all ranks end within 10 s, with its code."""
    run = tmp_path / "run"
    process = begun(home, run, tmp_path)
    process.send_signal(signal.SIGTERM)
    try:
        _, message = process.communicate(timeout=LONGEST)
    finally:
        process.kill()
    assert process.returncode == 128 + signal.SIGTERM, message
    assert "stopped by SIGTERM" in message and message.count("continue with") == 1
    assert open_run(run).status == "stopped" and checkpoint.exists(run)
    assert_whole(run)
