"""Measured collisions beside computed ones: restitution against the Stokes number, or rebound against impact angle.

stokes [-], restitution [-], error [-]
30, 0.52, 0.03
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.measured import MeasuredComparison
from cfddem.backend.errors import InputError
from cfddem.case.compare import ERROR, Array, Points, read_table
from cfddem.io.files import require_folder
from cfddem.plotting.curves import BLUE, ORANGE, label, legend, panels, save
from scenarios.collisions.immersed_pair.study import Collision

NAMES = {
    "stokes": ("stokes", "st", "stokes_number"),
    "angle": ("angle", "impact_angle"),
    "restitution": ("restitution", "e"),
    "rebound_angle": ("rebound_angle", "rebound_angle_relative"),
    "rebound_angle_striker": ("rebound_angle_striker",),
}
"""What a column may be called."""

UNITS = {"stokes": "1", "angle": "deg", "restitution": "1", "rebound_angle": "deg", "rebound_angle_striker": "deg"}

FIELDS = {"rebound_angle": "rebound_angle_relative"}
"""Names in a Collision, where they differ."""

ON_THE_LINE = 30
"""Collisions between the first and the last point, for the line of the figure."""

Collide = Callable[..., Collision]


@dataclass(frozen=True)
class MeasuredCollisions:
    """Computed collisions at measured points."""

    comparison: MeasuredComparison
    figure: Path

    def summary(self) -> dict[str, Any]:
        """Score as plain values, and the figure."""
        return self.comparison.score() | {"figure": str(self.figure)}


def compare_points(path: Path, collide: Collide, figure: Path) -> MeasuredCollisions:
    """Compute a collision at every measured point, and draw both.

    path     CSV file with columns stokes or angle, restitution or rebound angle, and perhaps error
    collide  computes a collision, given stokes or angle
    figure   PNG
    errors   InputError, one line, for a file that cannot be read
    """
    require_folder(figure)
    points = read_points(path)
    low, high = float(points.place.min()), float(points.place.max())
    spaced = np.geomspace(0.8 * low, 1.25 * high, ON_THE_LINE) if points.against == "stokes" else (
        np.linspace(max(0.0, low - 2.0), min(89.0, high + 2.0), ON_THE_LINE))  # fmt: skip

    curve = values_at(points, collide, spaced)
    comparison = MeasuredComparison(points, values_at(points, collide, points.place), 0.0, (spaced, curve))
    _draw(comparison, figure)
    return MeasuredCollisions(comparison, figure)


def values_at(points: Points, collide: Collide, places: Array) -> Array:
    """Computed values of the quantity of measured points, at Stokes numbers or angles."""
    name = FIELDS.get(points.quantity, points.quantity)
    return np.array([getattr(collide(**{points.against: float(place)}), name) for place in places])


def read_points(path: Path) -> Points:
    """Measured points of a file."""
    meanings = {word: name for name, words in NAMES.items() for word in words}
    columns = {meanings.get(column.name, column.name): column for column in read_table(path)}
    places = [name for name in ("stokes", "angle") if name in columns]
    values = [name for name in ("restitution", "rebound_angle", "rebound_angle_striker") if name in columns]
    if len(places) != 1 or len(values) != 1:
        limit = "a table with one of stokes and angle, and one of restitution and rebound angle"
        raise InputError(f"{path}", None, limit, f"found {', '.join(column.name for column in columns.values())}")
    for name in (places[0], values[0]):
        if columns[name].unit != UNITS[name]:
            raise InputError(f"{path} {columns[name].name}", columns[name].unit, f"given in units of {UNITS[name]}")
    place, value, error = columns[places[0]].values, columns[values[0]], columns.get(ERROR)
    least, most = (0.0, np.inf) if places[0] == "stokes" else (-1e-300, 90.0)
    if not ((place > least) & (place < most)).all():
        raise InputError(f"{path} {places[0]}", None, "above 0" if most == np.inf else "from 0 to below 90 degrees")
    if error is not None and (error.unit != value.unit or not (error.values > 0.0).all()):
        raise InputError(f"{path} error", None, f"above 0, in the unit of {value.name}")
    errors = np.full(len(place), np.nan) if error is None else error.values
    return Points(path.stem, values[0], value.unit, places[0], place, value.values, errors)


def _draw(comparison: MeasuredComparison, path: Path) -> None:
    points = comparison.points
    drawn, axes = panels(1, width=7.0, height=4.4)
    axes.plot(*comparison.line, color=BLUE, label="computed")
    bars = np.where(np.isfinite(points.error), points.error, 0.0)
    axes.errorbar(
        points.place, points.value, yerr=bars, fmt="o", color=ORANGE, markersize=5.0, capsize=2.5, zorder=3,
        label=f"measured: {points.name}",
    )  # fmt: skip
    if points.against == "stokes":
        axes.set(xscale="log", ylim=(-0.02, 1.05))
    name = "Stokes number  St" if points.against == "stokes" else "impact angle"
    unit = "deg" if points.unit == "deg" else "-"
    label(axes, name, "-" if points.against == "stokes" else "deg", points.quantity.replace("_", " "), unit)
    legend(axes)
    save(drawn, path)
