"""Start test programs on several ranks under MPI: `on_mpi(ranks, "module:function", ...)`."""

from __future__ import annotations

import importlib
import os
import pickle
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
import rooms  # noqa: F401  programs are functions of tests

from cfddem.backend.errors import InputError
from cfddem.backend.launch import launch_command

HERE = Path(__file__).parent


def why_not() -> str:
    """Why no program can be started under MPI here; empty if one can."""
    if find_spec("mpi4py") is None:
        return "mpi4py is not installed: pip install 'cfddem[cluster]'"
    try:
        launch_command(2, [])
    except InputError as refusal:
        return str(refusal)
    return ""


needs_mpi = pytest.mark.skipif(bool(why_not()), reason=why_not())


def on_mpi(ranks: int, program: str, *arguments: Any, timeout: float = 900.0) -> list[Any]:
    """Run `program(communicator, *arguments)` on ranks; returns what it returns, in the order of ranks.

    program  as "module:function", of a test or helper
    """
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "arguments").write_bytes(pickle.dumps(arguments))
        command = launch_command(ranks, [sys.executable, __file__, program, folder])
        done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=timeout, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return [pickle.loads((Path(folder) / str(rank)).read_bytes()) for rank in range(ranks)]


def environment() -> dict[str, str]:
    """The environment of a program on ranks: one thread each."""
    return os.environ | {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def main(program: str, folder: Path) -> None:
    """Run one rank."""
    from cfddem.backend.launch import communicator

    module, _, name = program.partition(":")
    ranks = communicator()
    result = getattr(importlib.import_module(module), name)(ranks, *pickle.loads((folder / "arguments").read_bytes()))
    (folder / str(ranks.rank)).write_bytes(pickle.dumps(result))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
