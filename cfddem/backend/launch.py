"""Processes: how those of Python are started, and how many MPI has started; and their memory. Nothing imports MPI here.

A fluid step makes and frees some twenty arrays of its particles. The C library of Linux would return each to the
system, which clears the pages of the next one again: up to a tenth of the time of fluid and coupling.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError

SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MPI_LOCALNRANKS", "PALS_SIZE")
"""Variables in which launchers state the number of processes: MPICH and its relatives, Open MPI, Intel MPI, Cray."""

TERMINAL = "CFDDEM_TERMINAL"
"""Set where ranks were started from a terminal, which they do not see themselves."""

INSTALL = "pip install 'cfddem[cluster]', or build mpi4py against the MPI of the machine"


def python_command(*words: str) -> list[str]:
    """The command line of another process of this Python; code in the working folder is not imported (`-P`).

    words  such as `-m` and the name of a module
    """
    return [sys.executable, "-P", *words]


@contextmanager
def safe_workers() -> Iterator[None]:
    """Processes of Python that a library starts inside the block import no code in the working folder, either."""
    name = "PYTHONSAFEPATH"
    before = os.environ.get(name)
    os.environ[name] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def launched() -> int:
    """Number of processes that the launcher of this process has started; 1 without a launcher."""
    for name in SIZES:
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    if "PMIX_RANK" in os.environ:  # srun --mpi=pmix
        return int(os.environ.get("SLURM_STEP_NUM_TASKS", "1"))
    return 1


def several_ranks() -> bool:
    """Whether this process is one of several that can exchange messages."""
    return launched() > 1 and find_spec("mpi4py") is not None


def communicator() -> Communicator:
    """The communicator of this process: over MPI if a launcher has started several, else the serial one.

    errors  InputError if there are several processes and mpi4py is missing, or was built for another MPI than that of
            the launcher
    """
    started = launched()
    if started == 1:
        return SERIAL
    require_mpi4py(started)
    from cfddem.backend.mpi import Ranks

    ranks = Ranks()
    if ranks.size != started:
        limit = f"{started}, the number of processes started"
        raise InputError("ranks", ranks.size, limit, "launcher and mpi4py belong to different MPIs: use one of them")
    return ranks


def require_mpi4py(ranks: int) -> None:
    """Refuse several ranks without mpi4py."""
    if find_spec("mpi4py") is None:
        raise InputError("ranks", ranks, "1 without mpi4py", INSTALL)


def find_launcher() -> Path:
    """The program mpiexec: that of the Python environment, else the first on the path.

    errors  InputError if there is none
    """
    beside = Path(sys.executable).parent
    launcher = shutil.which("mpiexec", path=str(beside)) or shutil.which("mpiexec") or shutil.which("mpirun")
    if launcher is None:
        raise InputError("mpiexec", None, "on the path", INSTALL)
    return Path(launcher)


def launch_command(ranks: int, command: Sequence[str], environment: Mapping[str, str] = os.environ) -> list[str]:
    """The command line that runs a command on several ranks of this machine.

    Open MPI gets the options that it needs for more ranks than cores and for the user root; MPICH needs none.
    """
    program = find_launcher()
    options = []
    if is_open_mpi(program):
        options = ["--oversubscribe"] if ranks > (os.cpu_count() or 1) else []
        if os.geteuid() == 0 and "OMPI_ALLOW_RUN_AS_ROOT" not in environment:
            options.append("--allow-run-as-root")
    return [str(program), *options, "-n", str(ranks), *command]


def is_open_mpi(program: Path) -> bool:
    """Whether a launcher is that of Open MPI."""
    answer = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    return any(name in answer.stdout for name in ("Open MPI", "OpenRTE", "PRRTE"))


# ---------------------------------------------------------------- memory of arrays


TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Parameters of `mallopt` in <malloc.h>."""

LARGEST = 32 * 1024**2
"""Arrays up to this size are kept; the C library allows no more [bytes]."""


def keep_freed_memory() -> bool:
    """Keep the memory of freed arrays in this process; returns whether the C library can."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except AttributeError:  # a C library without it
        return False
    return bool(mallopt(MMAP_THRESHOLD, LARGEST)) and bool(mallopt(TRIM_THRESHOLD, 4 * LARGEST))
