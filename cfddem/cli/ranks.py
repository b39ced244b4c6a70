"""Commands on several ranks: start them, and end them together when one fails."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, NoReturn

from cfddem.backend.communicator import Communicator, division_of
from cfddem.backend.errors import InputError, failure_elsewhere
from cfddem.backend.launch import TERMINAL, communicator, launch_command, launched, python_command, require_mpi4py
from cfddem.cli.json_output import asked_for_json, print_failure

PATIENCE = 3.0
"""How long a rank that fails waits for the others to fail too, before it ends them [s]."""


FORWARDED = 0.3
"""Time for the launcher to pass a message on, before it ends all ranks [s]."""


STOPPED = (128 + signal.SIGINT, 128 + signal.SIGTERM)
"""Exit codes of runs that were stopped, not killed."""

PROCESSES = "CFDDEM_PROCESSES"
"""Names a folder in which every rank leaves its number, in a file named by its process."""


def on_ranks(ranks: int | None, threads: int | None, folder: Path, division: str | None = None) -> Communicator:
    """The communicator of a command; starts the command again on several ranks if they are asked for.

    ranks    as given to the command; None leaves the number to the launcher
    threads  as given to the command, for each rank; one if there are several ranks and it is None
    folder   of the run, which the message names if a rank is killed
    division  ranks along x, y and z, as given to the command
    errors   InputError if ranks cannot be started, or a launcher has started another number
    """
    started = launched()
    if ranks is not None and ranks < 1:
        raise InputError("--ranks", ranks, "at least 1")
    shape = division_of(division) if division else None
    if shape:
        if ranks and ranks != math.prod(shape):
            raise InputError("--division", division, f"of {ranks} ranks in all, as --ranks says")
        ranks = math.prod(shape)
    if started == 1 and ranks is not None and ranks > 1:
        _start(ranks, threads, folder)
    if ranks is not None and ranks != started:
        raise InputError("--ranks", ranks, f"{started}, the number of processes that the launcher started")
    if started > 1:
        from cfddem.backend.compile import use_threads

        use_threads(threads or 1)
    world = communicator()
    if started > 1:
        world.shape = shape
    if PROCESSES in os.environ:
        (Path(os.environ[PROCESSES]) / str(os.getpid())).write_text(str(world.rank), encoding="utf-8")
    return world


def _start(ranks: int, threads: int | None, folder: Path) -> NoReturn:
    """Run the same command on several ranks, and end with their exit code.

    errors  CfddemError if one of them is killed
    """
    require_mpi4py(ranks)
    os.environ.setdefault("NUMBA_NUM_THREADS", str(threads or 1))
    if sys.stderr.isatty():
        os.environ[TERMINAL] = "1"
    command = launch_command(ranks, python_command("-m", "cfddem", *sys.argv[1:]))
    with TemporaryDirectory(prefix="cfddem-") as processes:
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, env=os.environ | {PROCESSES: processes},
            preexec_fn=_end_with_parent if sys.platform == "linux" else None,
        ) as launcher:  # fmt: skip
            assert launcher.stdout is not None
            _forward_signals(launcher)
            text = _passed_on(launcher.stdout)
        code = launcher.returncode
        if number := _killed_by(text, code):
            raise failure_elsewhere(_killed(text, number, Path(processes), folder), 128 + number)
    sys.exit(code)


def _end_with_parent() -> None:
    """Let the launcher end where this process is killed, and the ranks with it."""
    import ctypes

    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def _forward_signals(launcher: subprocess.Popen[bytes]) -> None:
    """Pass signals on to the launcher, but not Ctrl-C, which the terminal sends to both."""

    def forward(number: int, _: object) -> None:
        if not (number == signal.SIGINT and _in_foreground()):
            launcher.send_signal(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, forward)


def _in_foreground() -> bool:
    """Whether the terminal sends Ctrl-C to this process."""
    try:
        terminal = os.open("/dev/tty", os.O_RDONLY)
    except OSError:  # there is none
        return False
    try:
        return os.tcgetpgrp(terminal) == os.getpgrp()
    finally:
        os.close(terminal)


def _passed_on(output: IO[bytes]) -> str:
    """Print what launcher and ranks print; returns its end."""
    end = b""
    while some := os.read(output.fileno(), 1 << 16):
        end = (end + some)[-10_000:]
        try:
            sys.stdout.buffer.write(some)
            sys.stdout.flush()
        except BrokenPipeError:  # its reader has closed it, as `head` does; the run goes on
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return end.decode(errors="replace")


def _killed_by(text: str, code: int) -> int:
    """Number of the signal that has killed a rank, or the launcher; 0 if none has.

    text  of the launcher: MPICH names the signal there, and ends with its number; Open MPI ends with 128 more
    """
    if killed := re.search(r"EXIT STRING: .*\(signal (\d+)\)", text):
        return int(killed[1])
    if code < 0:
        return -code
    return code - 128 if code > 128 and code not in STOPPED else 0


def _killed(text: str, number: int, processes: Path, folder: Path) -> str:
    """What to say of a killed rank."""
    killed = re.search(r"PID (\d+) RUNNING AT", text)
    file = processes / killed[1] if killed else processes
    which = f"rank {file.read_text(encoding='utf-8')}" if file.is_file() else "a rank"
    name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
    why = ", by hand or because memory ran out" if number == signal.SIGKILL else ""
    remedy = f"continue with: cfddem resume {folder}" if (folder / "run.json").exists() else "run it again"
    return f"{which} was killed by {name}{why}, and all others ended; {remedy}"


def end_together(message: str, code: int) -> NoReturn:
    """End this rank after a failure; the others end too.

    If all ranks fail, rank 0 prints its message. If others go on, this rank prints its message and ends them.

    message  lines without the name of the program; of an error of the program itself if empty
    code     exit code
    """
    from mpi4py import MPI

    world = MPI.COMM_WORLD
    rank, all_failed, waiting_since = world.Get_rank(), world.Ibarrier(), time.monotonic()
    while not (together := all_failed.Test()) and time.monotonic() - waiting_since < PATIENCE:
        time.sleep(0.02)
    if rank == 0 or not together:
        where = "" if together else f"rank {rank}: "
        text = message or traceback.format_exc()
        print("\n".join(f"cfddem: {where}{line}" for line in text.splitlines()), file=sys.stderr, flush=True)
        if asked_for_json() and message:
            print_failure(message, code)
            sys.stdout.flush()
    if not together:
        time.sleep(FORWARDED)
        world.Abort(code)
    sys.exit(code)
