"""Commands on several ranks: start them, and end them together when one fails."""

from __future__ import annotations

import os
import sys
import time
import traceback
from typing import NoReturn

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.backend.launch import TERMINAL, communicator, launch_command, launched, python_command, require_mpi4py

PATIENCE = 3.0
"""How long a rank that fails waits for the others to fail too, before it ends them [s]."""


FORWARDED = 0.3
"""Time for the launcher to pass a message on, before it ends all ranks [s]."""


def on_ranks(ranks: int | None, threads: int | None) -> Communicator:
    """The communicator of a command; starts the command again on several ranks if they are asked for.

    ranks    as given to the command; None leaves the number to the launcher
    threads  as given to the command, for each rank; one if there are several ranks and it is None
    errors   InputError if ranks cannot be started, or a launcher has started another number
    """
    started = launched()
    if ranks is not None and ranks < 1:
        raise InputError("--ranks", ranks, "at least 1")
    if started == 1 and ranks is not None and ranks > 1:
        _start(ranks, threads)
    if ranks is not None and ranks != started:
        raise InputError("--ranks", ranks, f"{started}, the number of processes that the launcher started")
    if started > 1:
        from cfddem.backend.compile import use_threads

        use_threads(threads or 1)
    return communicator()


def _start(ranks: int, threads: int | None) -> NoReturn:
    """Replace this process by a launcher of the same command on several ranks."""
    require_mpi4py(ranks)
    os.environ.setdefault("NUMBA_NUM_THREADS", str(threads or 1))
    if sys.stderr.isatty():
        os.environ[TERMINAL] = "1"
    command = launch_command(ranks, python_command("-m", "cfddem", *sys.argv[1:]))
    sys.stdout.flush()
    os.execv(command[0], command)


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
    if not together:
        time.sleep(FORWARDED)
        world.Abort(code)
    sys.exit(code)
