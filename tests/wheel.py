"""The wheel in an environment of its own, which takes the dependencies from the present one."""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest
from command_line import HOME


def wheel_environment(folder: Path) -> tuple[Path, str]:
    """Build the wheel and install it; skips where it cannot be built.

    folder   empty
    returns  folder of the environment, and that of its packages
    """
    built = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(folder), str(HOME)],
        capture_output=True, text=True, cwd=folder,
    )  # fmt: skip
    if built.returncode:
        pytest.skip(f"the wheel cannot be built here: {built.stderr.strip().splitlines()[-1]}")
    home = folder / "environment"
    venv.create(home, symlinks=True)
    python, wheel = home / "bin" / "python", next(folder.glob("*.whl"))
    with (home / "of_this_one.pth").open("w") as file:
        file.write(sysconfig.get_path("purelib") + "\n")
    where = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], capture_output=True, text=True
    ).stdout.strip()
    shutil.move(home / "of_this_one.pth", where)
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "-q", "--no-deps", str(wheel)]
    subprocess.run(install, check=True, cwd=folder)
    return home, where
