"""Checks of walls, feeds and outlets: whether they lie in the column, can be read, and can work."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from functools import reduce
from pathlib import Path

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.bed import POURED_SOLID_FRACTION, CaseFeed, Point
from cfddem.case.feeds import fed_species, feed_rate
from cfddem.case.schema import Case
from cfddem.case.walls import CaseWall
from cfddem.fluid.cell_counts import cell_counts
from cfddem.fluid.triangles import signed_volume
from cfddem.model.triangles import corners_of, inside_surface, is_closed
from cfddem.preflight.issue import Issue, Severity, percent

MANY_TRIANGLES, MOST_TRIANGLES, LARGEST_FILE = 200_000, 2_000_000, 1_000_000_000
"""Triangles of a surface above which preparation is slow, and above which it is refused; largest file [byte]."""

FINE = 0.05
"""Mean edge of the triangles over the smallest diameter below which a surface is needlessly fine [-]."""

LOOSE = 0.3
"""Solid fraction that random insertion reaches in a box [-]."""

FEWEST_ACROSS = 4.0
"""Cells across a thin tube, below which its flow has no profile [-]."""

MOST_CELLS = 5_000_000
"""Cells above which the pre-run check does not count those that walls close or surround, and those above a jet."""

MOST_LEAKS, BETWEEN, LEAKS = 200_000, 8, 0.25
"""The check does not look for walls thinner than a cell above so many cells. It looks at so many places between the
centres of two cells. This share of a wall may let the fluid pass without a warning [-]."""

SAMPLES, MOSTLY = 400, 0.5
"""Places tried in the box of a feed, and share of them that must be free of walls [-]."""


_GRID = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 6)] * 3), axis=-1).reshape(-1, 3)
"""Places in a box, over its edges."""


def check_walls_and_feeds(case: Case) -> Iterator[Issue]:
    """Check the walls, feeds and outlets of a case."""
    for number, wall in enumerate(case.wall):
        yield from _check_wall(case, wall, f"wall.{number}")
    for number, feed in enumerate(case.feed):
        yield from _check_feed(case, feed, f"feed.{number}")
    yield from _check_outlets(case)
    yield from _check_cells(case)


# ---------------------------------------------------------------- walls


def _check_wall(case: Case, wall: CaseWall, key: str) -> Iterator[Issue]:
    if wall.file is not None:
        issues = list(_check_surface(case, wall, key))
        yield from issues
        if any(issue.severity == "error" for issue in issues):
            return
    misplaced = [
        Issue(severity, f"{key}.{word}", reason, remedy)
        for severity, word, reason, remedy in wall.form.misplaced(np.array(case.column.size))
    ]
    yield from misplaced
    narrow, width = wall.form.opening or ("", 0.0)
    if wall.solid != "inside" and 0.0 < width < case.bed.largest_diameter:
        yield Issue(
            "warning", f"{key}.{narrow}",
            f"an opening of {width:.3g} m is narrower than a particle, {case.bed.largest_diameter:.3g} m",
            "use a larger radius; below about five diameters particles form arches",
        )  # fmt: skip
    if wall.moves and wall.has_schedule and wall.begin >= case.run.until:
        yield Issue("warning", f"{key}.begin", f"{wall.begin:g} s is not before the end of the run", "begin earlier")
    if math.isnan(wall.fastest) and case.run.reference_speed is None:
        yield Issue(
            "warning", "run.reference_speed", f"the speed of {key}, a surface file that spins, is not part of it",
            "set it to the speed of the tip, if that is the fastest",
        )  # fmt: skip
    if not misplaced and wall in case.thin_walls and not _enters(wall, np.array(case.column.size)):
        yield Issue(
            "error", key, f"no part of the {wall.shape} lies in the column",
            f"the column extends from 0 to {case.column.size} m; give all lengths in m",
        )  # fmt: skip
        return
    across = width / max(case.column.cell_edges)
    if wall.form.opening and wall in case.thin_walls and across < FEWEST_ACROSS:
        reason = f"{across:.2g} cells across the opening; its flow needs at least {FEWEST_ACROSS:g}"
        yield Issue(
            "warning", f"{key}.{narrow}", reason, "use smaller cells, but of at least 2 diameters, or a wider wall"
        )
    if wall.moves and (case.closes_cells(wall) or wall in case.thin_walls):
        yield Issue(
            "warning", f"{key}.velocity" if any(wall.velocity) else f"{key}.spin",
            "the fluid does not feel the motion of a wall: at its cells the velocity is 0",
            "the motion acts on particles that touch the wall",
        )  # fmt: skip
    if any(case.column.periodic) and not wall.form.repeats(np.array(case.column.periodic)):
        yield Issue(
            "error", key, f"a {wall.shape} is not the same all along the periodic sides of the column",
            'set column.sides or column.front to "no_slip"; only planes and endless cylinders along them repeat',
        )  # fmt: skip


def _enters(wall: CaseWall, column: np.ndarray) -> bool:
    try:
        return enters(wall.form.corners(), column)
    except (InputError, OSError, ValueError):  # a surface that cannot be read is reported elsewhere
        return True


def enters(corners: np.ndarray, column: np.ndarray) -> bool:
    """Whether the box around some triangle (n, 3, 3) [m] reaches into a column of a size (3,) [m]."""
    return bool(((corners.min(axis=1) <= column) & (corners.max(axis=1) >= 0.0)).all(axis=1).any())


def area_by_cells(case: Case, middle_x: float, middle_y: float, radius: float) -> float:
    """Area of the cells whose centres a circle holds [m], over its own [-]."""
    counts = cell_counts(case.column.size, case.column.cell)
    x, y = ((np.arange(n) + 0.5) * length / n for n, length in zip(counts[:2], case.column.size))
    inside = np.hypot(x[None, :] - middle_x, y[:, None] - middle_y) < radius
    cells = float(np.count_nonzero(inside)) * case.column.size[0] * case.column.size[1] / (counts[0] * counts[1])
    return cells / (math.pi * radius**2)


def _check_surface(case: Case, wall: CaseWall, key: str) -> Iterator[Issue]:
    """Check that a surface can be read, and is not needlessly fine."""
    try:
        size = Path(wall.file or "").stat().st_size
        if size > LARGEST_FILE:
            raise InputError("file", wall.file, f"at most {LARGEST_FILE / 1e9:g} GB")
        corners = wall.form.corners()
    except (InputError, OSError, ValueError) as failure:
        why = failure.strerror if isinstance(failure, OSError) else str(failure).partition(": ")[2] or str(failure)
        yield Issue("error", f"{key}.file", f"{wall.file}: {why}", "paths are relative to the case file")
        return
    edge = float(np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1).mean())
    smallest = min(species.smallest_diameter for species in case.species.values())
    if len(corners) > MANY_TRIANGLES:
        yield Issue(
            "error" if len(corners) > MOST_TRIANGLES else "warning", f"{key}.file",
            f"{len(corners)} triangles take long to prepare; the limit is {MOST_TRIANGLES}",
            "simplify the surface; edges of half a diameter are enough", False,
        )  # fmt: skip
    elif edge < FINE * smallest:
        yield Issue(
            "warning", f"{key}.file", f"its edges of {edge:.2g} m are below {FINE:g} diameters, which costs time",
            "simplify the surface, or check scale: the unit of the file in m", False,
        )  # fmt: skip
    yield from _check_vessel(case, wall, key, corners)
    if case.closes_cells(wall) and not is_closed(corners):
        yield Issue(
            "error", f"{key}.solid", "the surface is not closed, so that no cells lie inside",
            'close the surface, or set solid = "none"',
        )  # fmt: skip


def _check_vessel(case: Case, wall: CaseWall, key: str, corners: np.ndarray) -> Iterator[Issue]:
    """Warn of particles that all start outside of a closed surface in which they would have room."""
    bed = case.bed
    places = np.array(bed.positions, float).reshape(-1, 3)
    if bed.start_corner is not None and bed.start_size is not None:
        places = np.array(bed.start_corner) + _GRID * np.array(bed.start_size)
    room = sum(case.volumes.values()) / POURED_SOLID_FRACTION
    if not len(places) or not is_closed(corners) or case.closes_cells(wall):
        return
    if abs(signed_volume(corners)) > room and not inside_surface(corners, places).any():
        yield Issue(
            "warning", f"{key}.file", "all particles start outside of this closed surface, which has room for them",
            "move bed.start_corner or bed.positions into it if it is their vessel",
        )  # fmt: skip


def _check_cells(case: Case) -> Iterator[Issue]:
    """Check which cells the walls close to the fluid."""
    closed = closed_cells(case)
    for number, mask in closed.items():
        if not mask.any():
            yield Issue(
                "warning", f"wall.{number}.solid", "the wall closes no cell: the fluid passes through it",
                'use cells smaller than the wall is thick, or set solid = "none"',
            )  # fmt: skip
        elif (share := leaking_share(case, case.wall[number], closed)) > LEAKS:
            yield Issue(
                "warning", f"wall.{number}.solid",
                f"the wall is thinner than a cell: fluid passes through {percent(share)} of it",
                "use cells of half its thickness, or a thicker wall",
            )  # fmt: skip
    together = reduce(np.logical_or, closed.values(), np.zeros((1, 1, 1), bool))
    if together.all():
        yield Issue("error", "wall", "the walls close all cells to the fluid", 'check solid: "inside" or "outside"')
    elif case.column.ends == "flow" and together.shape[0] > 1 and together[0].all():
        yield Issue("error", "wall", "the walls close the whole floor, where the fluid enters", "raise the walls")


def closed_cells(case: Case) -> dict[int, np.ndarray]:
    """Cells that each wall closes to the fluid (nz, ny, nx) bool, by its number."""
    closing = {number: wall for number, wall in enumerate(case.wall) if case.closes_cells(wall)}
    counts = cell_counts(case.column.size, case.column.cell)
    if not closing or math.prod(counts) > MOST_CELLS:
        return {}
    lines = [(np.arange(n) + 0.5) * length / n for n, length in zip(counts, case.column.size)]
    z, y, x = np.meshgrid(lines[2], lines[1], lines[0], indexing="ij")
    centres = np.stack([x, y, z], axis=-1)
    closed = {}
    for number, wall in closing.items():
        with suppress(InputError, OSError):  # a surface that cannot be read, or is open, is reported elsewhere
            closed[number] = wall.closes(centres.reshape(-1, 3)).reshape(x.shape)
    return closed


def leaking_share(case: Case, wall: CaseWall, closed: dict[int, np.ndarray]) -> float:
    """Share of a wall that lies between two open cells, so that the fluid passes, in the worst direction [-].

    closed  cells that each wall closes
    """
    own = reduce(np.logical_or, closed.values())
    shape = own.shape[::-1]
    if own.size > MOST_LEAKS:
        return 0.0
    steps = np.array(case.column.size) / shape
    centres = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in shape), indexing="ij"), axis=-1) * steps
    is_open, worst = ~own.transpose(2, 1, 0), 0.0
    for axis in range(3):
        here, there = (np.take(is_open, range(k, shape[axis] - 1 + k), axis) for k in (0, 1))
        starts = np.take(centres, range(shape[axis] - 1), axis)[here & there]
        within = np.zeros(len(starts), bool)
        for part in (np.arange(BETWEEN) + 0.5) / BETWEEN:
            within |= wall.closes(starts + part * steps * np.eye(3)[axis])
        leaking, stopped = float(within.sum()), 0.5 * float((here ^ there).sum())  # a line enters and leaves the wall
        worst = max(worst, leaking / max(leaking + stopped, 1.0))
    return worst


# ---------------------------------------------------------------- feeds and outlets


def _check_feed(case: Case, feed: CaseFeed, key: str) -> Iterator[Issue]:
    diameter = fed_species(case, feed).diameter
    free = free_share(case, feed.corner, feed.size, 0.5 * diameter)
    if free < MOSTLY:
        severity: Severity = "error" if free == 0.0 else "warning"
        yield Issue(
            severity, f"{key}.corner", f"only {100.0 * free:.0f} % of the box is half a diameter away from walls",
            "move the box, or make it smaller",
        )  # fmt: skip
    rate, most = feed_rate(case, feed), largest_rate(case, feed)
    if rate > most:
        yield Issue(
            "error" if rate > 10.0 * most else "warning", f"{key}.{'rate' if feed.rate else 'mass_rate'}",
            f"{rate:.3g} particles per second; about {most:.2g} fall out of the box in time to make room",
            "use a larger box, a higher velocity or a lower rate; particles that find no place wait",
        )  # fmt: skip
    if feed.begin >= case.run.until:
        yield Issue("warning", f"{key}.begin", f"{feed.begin:g} s is not before the end of the run", "begin earlier")


def free_share(case: Case, corner: Point, size: Point, radius: float) -> float:
    """Share of the places in a box that are a radius away from planes, cylinders and cones [-]."""
    places = np.array(corner) + np.random.default_rng(1).uniform(size=(SAMPLES, 3)) * np.array(size)
    free = np.ones(SAMPLES, bool)
    for wall in case.wall:
        away = wall.form.distance(places)
        free &= ~(away < radius)
    free &= case.beyond_the_side(places, radius) < 0.0
    return float(np.count_nonzero(free)) / SAMPLES


def largest_rate(case: Case, feed: CaseFeed) -> float:
    """Particles per second that leave the box of a feed in time to make room for others, about [1/s]."""
    species = fed_species(case, feed)
    room = [edge + species.diameter for edge in feed.size]
    most = max(1.0, LOOSE * math.prod(room) / species.mean_volume)
    times = []
    for length, speed, pull in zip(room, feed.velocity, case.laws.gravity):
        along = abs(speed) if speed * pull >= 0.0 else 0.0
        if pull:
            times.append((math.sqrt(along**2 + 2.0 * abs(pull) * length) - along) / abs(pull))
        elif along:
            times.append(length / along)
    return most / max(min(times, default=math.inf), 1e-300)


def _check_outlets(case: Case) -> Iterator[Issue]:
    for number, outlet in enumerate(case.outlet):
        low, high = np.array(outlet.corner), np.array(outlet.corner) + np.array(outlet.size)
        for n, feed in enumerate(case.feed):
            begin, end = np.array(feed.corner), np.array(feed.corner) + np.array(feed.size)
            if (np.maximum(low, begin) <= np.minimum(high, end)).all():
                yield Issue(
                    "warning",
                    f"outlet.{number}",
                    f"it removes particles where feed.{n} inserts them",
                    "move one of them",
                )
        if _unreachable(case, outlet.corner, outlet.size):
            yield Issue(
                "error", f"outlet.{number}.corner", "all of the box lies behind walls, where no particle comes",
                "move the box to where particles leave",
            )  # fmt: skip


def _unreachable(case: Case, corner: Point, size: Point) -> bool:
    """Whether a box lies behind a wall with one side, or outside of a round column."""
    low = np.array(corner)
    places = np.concatenate([corners_of(low, low + np.array(size)), [low + 0.5 * np.array(size)]])
    for wall in case.wall:
        if not wall.leaves_its_place and (wall.form.distance(places) < 0.0).all():
            return True
    return bool((case.beyond_the_side(places) > 0.0).all())
