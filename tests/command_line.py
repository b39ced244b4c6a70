"""Runs `cfddem` commands for tests: in this process, or in a new one."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from pydantic import TypeAdapter

from cfddem.cli.app import app, main
from cfddem.cli.json_output import form, word

HOME = Path(__file__).parents[1]
WIDTH = 100
ANNOUNCED = "cfddem: compiling loops, up to two minutes the first time\n"
"""Left out of the errors: whether loops are compiled depends on what the machine has kept."""


class Done(NamedTuple):
    """Exit code and output of a command."""

    code: int
    out: str
    err: str


def call(*words: str) -> Done:
    """Run a command in this process, in a terminal of 100 columns."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["cfddem", *words])
        patch.setenv("COLUMNS", str(WIDTH))
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
    return Done(code, out.getvalue(), err.getvalue().replace(ANNOUNCED, ""))


def cfddem(*words: str, folder: Path | None = None, seconds: float = 900) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own, in a terminal of 100 columns."""
    environment = os.environ | {"COLUMNS": str(WIDTH), "NUMBA_NUM_THREADS": "1", "PYTHONPATH": str(HOME)}
    return subprocess.run(
        [sys.executable, "-m", "cfddem", *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=seconds,
    )


def parsed(text: str) -> dict[str, Any]:
    """What a command printed with `--json`; it has all names of its schema, and no others."""
    printed: dict[str, Any] = json.loads(text)
    name = printed["schema"].split("/")[1]
    assert printed["schema"] == word(name)
    adapter = TypeAdapter(form(name))
    assert adapter.dump_python(adapter.validate_json(text, strict=True), mode="json") == printed
    return printed


def commands() -> list[str]:
    """Names of all commands."""
    return sorted(name for name in app if not name.startswith("-"))
