"""Initial particles: diameters, lattices, random packings without overlaps above a stated limit, tables of files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from cfddem.backend.compile import serial
from cfddem.backend.errors import CfddemError, InputError, nearest
from cfddem.particles.neighbours import list_edges, wrap
from cfddem.particles.pair_graph import Edges, shifts
from cfddem.particles.state import Particles, make_particles
from cfddem.particles.walls.arrays import wall_arrays

OVERLAP_LIMIT = 1e-4
"""Largest overlap that a packing may have, over the smaller of the two radii."""

Seed = int | tuple[int, ...] | np.random.Generator
Box = tuple[tuple[float, float, float], tuple[float, float, float]]


class PackingFailed(CfddemError):
    """Raised if a random packing does not reach its solid fraction."""

    exit_code = 2


def mono(count: int, diameter: float) -> np.ndarray:
    """Diameters of equal spheres (count,) [m].

    >>> mono(2, 1e-3).tolist()
    [0.001, 0.001]
    """
    _positive("diameter", diameter)
    return np.full(count, float(diameter))


def normal(count: int, mean: float, deviation: float, seed: Seed) -> np.ndarray:
    """Normally distributed diameters, cut off at three deviations and at a tenth of the mean (count,) [m].

    mean, deviation  [m]
    seed             of the random numbers
    """
    _positive("mean", mean)
    generator = np.random.default_rng(seed)
    low, high = max(0.1 * mean, mean - 3.0 * deviation), mean + 3.0 * deviation
    drawn = generator.normal(mean, deviation, count)
    while (outside := (drawn < low) | (drawn > high)).any():
        drawn[outside] = generator.normal(mean, deviation, int(outside.sum()))
    return drawn


def log_normal(count: int, median: float, spread: float, seed: Seed) -> np.ndarray:
    """Log-normally distributed diameters, cut off at three standard deviations (count,) [m].

    median  [m]
    spread  standard deviation of the logarithm of the diameter [-]
    """
    _positive("median", median)
    steps = np.random.default_rng(seed).standard_normal(count)
    return median * np.exp(spread * np.clip(steps, -3.0, 3.0))


def from_table(count: int, diameters: np.ndarray, number_fractions: np.ndarray, seed: Seed) -> np.ndarray:
    """Diameters drawn from a table of classes (count,) [m].

    diameters         of each class [m]
    number_fractions  share of each class in the number of particles; need not add up to one
    """
    weights = np.asarray(number_fractions, float)
    if (weights < 0).any() or not weights.sum() > 0:
        raise InputError("number_fractions", weights.tolist(), "at least 0, and not all 0")
    return np.random.default_rng(seed).choice(np.asarray(diameters, float), count, p=weights / weights.sum())


def lattice(diameter: float, room: Box, spacing: float = 1.05, seed: int | None = None) -> np.ndarray:
    """Centres on a cubic lattice that fills a box (N, 3) [m], layer by layer from below.

    diameter  of the largest sphere [m]
    room      two opposite corners [m]
    spacing   distance of neighbours over the diameter
    seed      of random shifts within the free space; no shifts if not given
    """
    _positive("diameter", diameter)
    low, high = np.asarray(room, float)
    number = np.floor((high - low) / (spacing * diameter) + 1e-9).astype(int)
    if (number < 1).any():
        raise InputError("room", (high - low).tolist(), f"at least {spacing * diameter:.3g} m along each axis")
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in number[::-1]), indexing="ij"), axis=-1).reshape(-1, 3)[:, ::-1]
    pitch = (high - low) / number
    centres = low + (cells + 0.5) * pitch
    if seed is not None:
        free = 0.5 * (pitch - diameter) * (1.0 - 1e-9)
        centres += np.random.default_rng(seed).uniform(-1.0, 1.0, centres.shape) * free
    return centres


def random_packing(
    diameters: np.ndarray,
    solid_fraction: float,
    seed: int,
    shape: tuple[float, float, float] = (1.0, 1.0, 1.0),
    most_sweeps: int = 20_000,
    periodic: tuple[bool, bool, bool] = (True, True, True),
    in_cylinder: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Pack spheres at random in a box, periodic or between walls, or in a cylinder, to a given solid fraction.

    Spheres start at random positions and are moved apart until no overlap exceeds :data:`OVERLAP_LIMIT`. No sphere
    overlaps a wall.

    diameters       (N,) [m]
    solid_fraction  up to about 0.62 for equal spheres [-]
    seed            of the initial positions
    shape           of the box, as ratios of its edges
    most_sweeps     through all pairs, after which the packing is given up
    periodic        along each axis; else the box ends at two walls
    in_cylinder     an upright cylinder takes the place of the box: the first two edges are its diameter, with walls
    returns         centres (N, 3) [m] and edges of the box, or of that around the cylinder (3,) [m]

    Raises PackingFailed if the fraction is not reached within `most_sweeps`.
    """
    if not 0.0 < solid_fraction < 0.74:
        raise InputError("solid_fraction", solid_fraction, "above 0 and below 0.74")
    if in_cylinder and shape[0] != shape[1]:
        raise InputError("shape", shape, "of equal first two edges, the diameter of the cylinder")
    if in_cylinder:
        periodic = (False, False, periodic[2])
    diameters = np.asarray(diameters, float)
    volume = float(np.sum(np.pi / 6.0 * diameters**3)) / solid_fraction
    ratios = np.asarray(shape, float)
    part_of_box = math.pi / 4.0 if in_cylinder else 1.0
    box = ratios * (volume / (part_of_box * np.prod(ratios))) ** (1.0 / 3.0)
    low, high = _centres_between_walls(diameters, box, np.array(periodic))
    margin = np.where(periodic, 0.0, 0.5 * diameters[:, None])
    chosen = np.random.default_rng(seed).uniform(0.0, 1.0, (len(diameters), 3))
    outmost = np.full(len(diameters), np.inf)
    if in_cylinder:
        outmost = 0.5 * (box[0] - diameters)
        distance, angle = 0.5 * np.sqrt(chosen[:, 0]), 2.0 * math.pi * chosen[:, 1]
        chosen[:, 0], chosen[:, 1] = 0.5 + distance * np.cos(angle), 0.5 + distance * np.sin(angle)
    position = margin + chosen * (box - 2.0 * margin)
    spheres = make_particles(position, 0.5 * diameters, 1000.0)
    skin, images = 0.2 * float(diameters.min()), np.where(periodic, box, np.inf)
    worst = np.inf
    for _ in range(most_sweeps // _SWEEPS + 1):
        wrap(spheres.position, images)
        graph = list_edges(spheres, wall_arrays(), 0.0, skin, images)
        worst = _push_apart(
            spheres.view, graph.flat_graph, shifts(images).reshape(-1), (low.reshape(-1), high.reshape(-1)), outmost,
            _SWEEPS, 0.25 * skin, OVERLAP_LIMIT,
        )  # fmt: skip
        if worst <= OVERLAP_LIMIT:
            wrap(spheres.position, images)
            return spheres.position, box
    raise PackingFailed(
        f"a solid fraction of {solid_fraction:g} leaves overlaps of {worst:.2g} radii (limit {OVERLAP_LIMIT:g}) after "
        f"{most_sweeps} sweeps; ask for less than about 0.62, still less between walls, or a wider size distribution"
    )


def _centres_between_walls(diameters: np.ndarray, box: np.ndarray, periodic: np.ndarray) -> tuple[np.ndarray, ...]:
    """Lowest and highest coordinates of centres, infinite along periodic axes, each (N, 3) [m]."""
    largest = float(diameters.max())
    for axis in np.flatnonzero(~periodic & (box < largest)):
        raise InputError(f"shape[{axis}]", float(box[axis]), f"at least {largest:.3g} m, the largest diameter")
    radius = 0.5 * diameters[:, None]
    return np.where(periodic, -np.inf, radius), np.where(periodic, np.inf, box - radius)


def largest_overlap(graph: Edges, gap: np.ndarray, radius: np.ndarray) -> float:
    """Largest overlap of a packing over the smaller radius [-]; 0 if nothing overlaps.

    gap     (n,) of every pair [m]
    radius  (N,) [m]
    """
    pairs = graph.between_particles
    if pairs == 0:
        return 0.0
    smaller = np.minimum(radius[graph.first[:pairs]], radius[graph.second[:pairs]])
    return max(0.0, float((-gap[:pairs] / smaller).max()))


_SWEEPS = 25


@serial
def _push_apart(particles, edges, shift, bounds, outmost, sweeps, reach, limit):
    """Move overlapping spheres apart, each by half of the overlap; returns the largest one left, over the radius.

    bounds   lowest and highest value of every coordinate
    outmost  largest distance of every sphere from the upright axis in the middle; infinite in a box
    """
    position, radius = particles.position, particles.radius
    low, high = bounds
    move = np.zeros_like(position)
    worst = 0.0
    for sweep in range(sweeps + 1):
        move[:] = 0.0
        worst = 0.0
        for k in range(edges.between_particles):
            i, j = 3 * int(edges.first[k]), 3 * int(edges.second[k])
            image = 3 * int(edges.image[k])
            square = 0.0
            for axis in range(3):
                square += (position[i + axis] - position[j + axis] + shift[image + axis]) ** 2
            touch = radius[i // 3] + radius[j // 3]
            if square < touch * touch:
                distance = np.sqrt(max(square, 1e-300))
                overlap = touch - distance
                worst = max(worst, overlap / min(radius[i // 3], radius[j // 3]))
                for axis in range(3):
                    push = 0.5 * (overlap + 1e-6 * touch)
                    push *= (position[i + axis] - position[j + axis] + shift[image + axis]) / distance
                    move[i + axis] += push
                    move[j + axis] -= push
        if worst <= limit or sweep == sweeps:
            return worst
        for place in range(len(move)):
            moved = position[place] + min(max(move[place], -reach), reach)
            position[place] = min(max(moved, low[place]), high[place])
        for i in range(len(outmost)):
            if outmost[i] < np.inf:
                x, y = 0.5 * (low[3 * i] + high[3 * i]), 0.5 * (low[3 * i + 1] + high[3 * i + 1])
                away = np.sqrt((position[3 * i] - x) ** 2 + (position[3 * i + 1] - y) ** 2)
                if away > outmost[i]:
                    position[3 * i] = x + (position[3 * i] - x) * outmost[i] / away
                    position[3 * i + 1] = y + (position[3 * i + 1] - y) * outmost[i] / away
    return worst


def _positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(name, value, "above 0 and finite")


# ---------------------------------------------------------------- tables from files


COLUMNS = ("x", "y", "z", "diameter", "density", "material")

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}
"""Units of length of a header [m]."""

DENSITIES = ("kg/m3", "kg/m^3", "kg/m\N{SUPERSCRIPT THREE}", "kg m-3")
"""How a header may write the unit of density."""

MICRO = ("\N{MICRO SIGN}", "\N{GREEK SMALL LETTER MU}")
"""How a header may write the u of um."""


def read_particles(path: str | Path, density: float | None = None, material: int = 0, scale: float = 1.0) -> Particles:
    """Particles at rest, read from a file.

    A `.csv` file begins with a line of names: `x, y, z, diameter` and optionally `density, material`. Units in
    brackets after a name must be those of `scale`. A `.npz` file has the arrays `position` (N, 3) and `diameter` (N,),
    and optionally the same.

    path      of the file
    density   of all particles if the file has none [kg/m3]
    material  of all particles if the file has none
    scale     length of the file's unit [m]
    errors    InputError, one line with file and column or particle, for anything else
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("particles", str(path), "a file that exists")
    read = {".csv": _columns, ".npz": _arrays}.get(path.suffix.lower())
    if read is None:
        raise InputError("particles", str(path), "a .csv or .npz file")
    columns = read(path, scale)
    for name in ("position", "diameter", *(("density",) if density is None else ())):
        if name not in columns:
            raise InputError(f"particles in {path.name}", sorted(columns), f"a table with {name}")
    for name, values in columns.items():
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values.reshape(len(values), -1)).all(axis=1)))
            raise InputError(f"{name} in {path.name}, particle {row}", values[row].tolist(), "a number")
    return make_particles(
        scale * columns["position"],
        0.5 * scale * columns["diameter"],
        columns.get("density", density),  # type: ignore[arg-type]
        material=columns.get("material", material),  # type: ignore[arg-type]
    )


def _columns(path: Path, scale: float) -> dict[str, np.ndarray]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("particles", str(path), "a text in UTF-8", "save the table as CSV in UTF-8") from None
    lines = [line for line in text.splitlines() if line.strip() and line[0] != "#"]
    if len(lines) < 2:
        raise InputError(f"particles in {path.name}", None, "rows of numbers below a line of names", "it has none")
    headings = [heading.partition("[") for heading in lines[0].split(",")]
    names = [name.strip() for name, _, _ in headings]
    for name in names:
        if name not in COLUMNS:
            raise InputError(f"column in {path.name}", name, nearest(name, COLUMNS))
    _require_units(path.name, {name: unit.strip("] \t") for name, (_, _, unit) in zip(names, headings)}, scale)
    try:
        table = np.genfromtxt(path, delimiter=",", skip_header=_lines_before_numbers(path), ndmin=2)
    except ValueError as refusal:
        raise InputError(f"particles in {path.name}", None, f"rows of {len(names)} numbers", str(refusal)) from None
    if table.shape[1] != len(names):
        raise InputError(f"particles in {path.name}", table.shape[1], f"{len(names)} numbers in a row")
    columns = dict(zip(names, table.T))
    if {"x", "y", "z"} <= set(names):
        columns["position"] = np.stack([columns.pop(axis) for axis in "xyz"], axis=1)
    return columns


def _require_units(file: str, units: Mapping[str, str], scale: float) -> None:
    """Refuse units of a header that are not those in which its columns are read; none is any."""
    lengths = {}
    for name, unit in units.items():
        plain = "u" + unit[1:] if unit.startswith(MICRO) else unit
        allowed = {"density": DENSITIES, "material": (unit,)}.get(name, (*LENGTHS,))  # a material is a number
        if unit and plain not in allowed:
            raise InputError(f"unit of {name} in {file}", unit, f"one of {', '.join(allowed)}")
        if unit and plain in LENGTHS and name in ("x", "y", "z", "diameter"):
            lengths[name] = plain
    if len({*lengths.values()}) > 1:
        several = ", ".join(f"{name} in {unit}" for name, unit in lengths.items())
        raise InputError(f"units in {file}", several, "one unit for x, y, z and diameter", "write all in the same")
    for name, unit in lengths.items():
        if not math.isclose(LENGTHS[unit], scale):
            raise InputError("scale", scale, f"{LENGTHS[unit]:g}, as {name} in {file} is in {unit}")


def _lines_before_numbers(path: Path) -> int:
    with path.open(encoding="utf-8-sig") as lines:
        for number, line in enumerate(lines):
            if line.strip() and not line.startswith("#"):
                return number + 1
    return 0


def _arrays(path: Path, scale: float) -> dict[str, np.ndarray]:
    names = ("position", "diameter", "density", "material")
    try:
        with np.load(path) as file:
            columns = {name: np.asarray(file[name], float) for name in file.files if name in names}
    except (ValueError, OSError, BadZipFile):
        raise InputError("particles", str(path), "a file of numpy arrays") from None
    if "position" in columns and (columns["position"].ndim != 2 or columns["position"].shape[1] != 3):
        raise InputError(f"position in {path.name}", columns["position"].shape, "a table (N, 3)")
    return columns
