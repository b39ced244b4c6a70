"""No command executes code that lies in the working folder, whatever its name."""

from __future__ import annotations

import os
import pkgutil
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import NamedTuple

import pytest
from command_line import HOME
from made_up_run import made_up
from wheel import wheel_environment

from cfddem.backend.launch import python_command, safe_workers
from cfddem.cli.information import TEST_CASE
from closures.compiled import cache_folder

OPTIONAL = (
    "trame", "trame_vuetify", "imageio", "imageio_ffmpeg", "meshio", "pandas", "xarray", "distributed", "optuna",
    "mpi4py", "IPython", "ipykernel", "yaml", "gdb", "usercustomize", "sitecustomize", "pyvista", "vtk", "numba",
)  # fmt: skip
"""Packages that commands look for, installed or not."""

PACKAGES = ("cfddem", "closures", "scenarios")

CANARY = """
with open({mark!r}, "a") as mark:
    mark.write(__name__ + " in " + __file__ + "\\n")
raise ImportError("code in the working folder was executed")
"""

ENTRY_POINTS = "cfddem.closures", "numba_extensions", "pydantic", "matplotlib.backend", "xarray.backends", "dask.sizeof"


class Trap(NamedTuple):
    """A folder of canaries, and the file that they write when they are executed."""

    folder: Path
    mark: Path

    def executed(self) -> str:
        return self.mark.read_text() if self.mark.exists() else ""


def importable() -> set[str]:
    """Every name that a process of this Python can import at the top level, and some that it could."""
    here = {each.name for each in pkgutil.iter_modules()} | {name.partition(".")[0] for name in sys.modules}
    return {name for name in here | sys.stdlib_module_names | {*OPTIONAL} if name.isidentifier()} - {"__main__"}


def lay(folder: Path) -> Trap:
    """Put a canary of every importable name into a folder, and files of settings that name further ones."""
    mark = folder.with_name(f"{folder.name}-executed")
    text = CANARY.format(mark=str(mark))
    folder.mkdir(exist_ok=True)
    for name in sorted(importable() | {"canary_backend", "canary_locator", "canary_plugin"}):
        (folder / f"{name}.py").write_text(text)
    for name in PACKAGES:
        (folder / name).mkdir()
        for file in ("__init__", "__main__"):
            (folder / name / f"{file}.py").write_text(text)
    (folder / "matplotlibrc").write_text("backend: module://canary_backend\ntext.usetex: True\n")
    (folder / ".numba_config.yaml").write_text("cache_locator_classes: canary_locator.Locator\ndisable_jit: 1\n")
    about = folder / "canary-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: canary\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("".join(f"[{group}]\ncanary = canary_plugin\n" for group in ENTRY_POINTS))
    return Trap(folder, mark)


def environment(trap: Trap, **more: str) -> dict[str, str]:
    """That of this process, with one thread, and an empty cache as far as the warm-up asks for it."""
    cache = trap.folder.with_name("cache")
    if not cache.exists() and cache_folder().exists():
        left = shutil.ignore_patterns("momentum.transport*")
        shutil.copytree(cache_folder(), cache / cache_folder().name, copy_function=os.link, ignore=left)
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONSAFEPATH")}
    return kept | {"NUMBA_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(cache), "COLUMNS": "100"} | more


def execute(trap: Trap, program: list[str], words: str, **more: str) -> subprocess.CompletedProcess[str]:
    """Run a command in the folder of canaries."""
    command = [*program, *words.split()]
    return subprocess.run(
        command, cwd=trap.folder, env=environment(trap, **more), capture_output=True, text=True, timeout=900
    )


def script() -> list[str]:
    """The console script of this environment."""
    return [str(Path(sysconfig.get_path("scripts")) / "cfddem")]


COMMANDS = {
    "check case.toml": (0,),
    "run case.toml -o bed": (0,),
    "run case.toml -o shared --ranks 2": (0,),
    "resume bed --until 0.012": (0,),
    "report bed": (0,),
    "view bed": (0, 3),
    "view bed --history": (0,),
    "export bed --to csv": (0,),
    "compare bed shared": (0,),
    "sweep case.toml --over bed.inlet_velocity=0.01,0.02 -o both --jobs 2": (0,),
    "doctor": (0, 1),
}
"""Commands, in an order in which they can be run, and their exit codes; 3 and 1 where a machine cannot render."""


def try_all(trap: Trap, program: list[str], **more: str) -> None:
    """Run all commands among canaries; none may be executed."""
    (trap.folder / "case.toml").write_text(TEST_CASE)
    for words, codes in COMMANDS.items():
        done = execute(trap, program, words, **more)
        assert not trap.executed(), words
        assert done.returncode in codes, (words, done.stdout[-1500:] + done.stderr[-1500:])


def test_a_canary_is_executed_where_python_does_so(tmp_path: Path) -> None:
    """The trap works: without `-P`, `python -c` and `python -m` execute what lies in the working folder."""
    trap = lay(tmp_path / "here")
    assert execute(trap, [sys.executable, "-c", "import pyvista"], "").returncode == 1
    assert "pyvista in" in trap.executed()
    assert execute(trap, [sys.executable, "-m", "cfddem"], "--version").returncode == 1
    assert len(trap.executed().splitlines()) == 2, "a module that `python -m` imports itself"


def test_no_canary_is_executed_by_processes_of_this_python(tmp_path: Path) -> None:
    """Those of `python_command`, and those that a library starts inside `safe_workers`."""
    trap, where = lay(tmp_path / "here"), {"PYTHONPATH": str(HOME)}
    assert execute(trap, python_command("-m", "cfddem"), "--version", **where).returncode == 0
    with safe_workers():
        inside = os.environ["PYTHONSAFEPATH"]
    assert execute(trap, [sys.executable, "-m", "joblib.externals.loky"], "", PYTHONSAFEPATH=inside).returncode == 1
    assert not trap.executed()


@pytest.mark.parametrize(
    "words", ["view . --history", *(pytest.param(each, marks=pytest.mark.slow) for each in ("view .", "report ."))]
)
def test_no_canary_in_a_run_folder_is_executed_by_commands_started_there(words: str, tmp_path: Path) -> None:
    """As the files `pyvista.py` and `matplotlibrc` of a run that somebody else has sent."""
    trap = lay(made_up(tmp_path / "run", rows=101))
    done = execute(trap, script(), words, PYTHONPATH=str(HOME))
    assert not trap.executed()
    assert done.returncode in ((0, 3) if words == "view ." else (0,)), done.stderr


def test_damaged_settings_of_other_packages_in_the_working_folder_disturb_no_command(tmp_path: Path) -> None:
    folder = made_up(tmp_path / "run", rows=101)
    for name in ("matplotlibrc", ".numba_config.yaml"):
        (folder / name).write_bytes(b"\xff{[" * 9)
    trap, where = Trap(folder, tmp_path / "mark"), {"PYTHONPATH": str(HOME)}
    done = execute(trap, script(), "report .", **where)
    assert (done.returncode, done.stderr) == (0, "")
    again = "import cfddem, pyvista, numba; numba.core.config.reload_config(); print('as ever')"
    assert execute(trap, python_command("-c", again), "", **where).stdout == "as ever\n"


def test_python_m_cfddem_imports_no_pyvista_of_the_working_folder(tmp_path: Path) -> None:
    """Python searches the working folder for the first few modules, and cfddem for no more."""
    trap = lay(tmp_path / "here")
    for name in sys.stdlib_module_names | {*PACKAGES}:
        (trap.folder / f"{name}.py").unlink(missing_ok=True)
        shutil.rmtree(trap.folder / name, ignore_errors=True)
    done = execute(trap, [sys.executable, "-m", "cfddem"], "check liquid-bed", PYTHONPATH=str(HOME))
    assert (done.returncode, trap.executed()) == (0, ""), done.stderr


@pytest.mark.slow
def test_no_command_of_this_installation_executes_a_canary(tmp_path: Path) -> None:
    try_all(lay(tmp_path / "here"), script(), PYTHONPATH=str(HOME))


@pytest.mark.slow
def test_no_command_of_the_wheel_executes_a_canary(tmp_path: Path) -> None:
    """The wheel in an environment of its own, which takes the dependencies from this one."""
    home, where = wheel_environment(tmp_path)
    python = home / "bin" / "python"
    trap = lay(tmp_path / "here")
    seen = execute(trap, [str(python), "-P", "-c", "import cfddem; print(cfddem.__file__)"], "")
    assert seen.stdout.startswith(where), "the wheel is tested, not the source"
    path = os.pathsep.join((sysconfig.get_path("scripts"), os.environ["PATH"]))
    try_all(trap, [str(home / "bin" / "cfddem")], PATH=path, LD_LIBRARY_PATH=str(Path(sys.prefix) / "lib"))  # of MPI
