"""Collisions over a range of Stokes numbers, and their table."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from scenarios.collisions.immersed_pair.study import Collision

UNITS = {
    "velocity": "m/s",
    "viscosity": "Pa s",
    "rebound_angle_striker": "deg",
    "rebound_angle_relative": "deg",
    "minimum_gap": "m",
    "stop_gap": "m",
    "spin": "rad/s",
}
"""Units of the values of a collision; the others have none."""

IN_A_RANGE = 20
"""Stokes numbers of `LOW..HIGH`, in even ratios."""

NUMBERS = {
    "stokes", "restitution", "restitution_tangential", "friction_used", *UNITS,
}  # fmt: skip
"""Values of a collision that are numbers."""

MOST = 1000
"""Largest number of collisions of one command."""


@dataclass(frozen=True)
class CollisionRange:
    """Collisions that differ in their Stokes number."""

    collisions: Sequence[Collision]

    def summary(self) -> dict[str, Any]:
        """Plain values of all collisions."""
        return {"collisions": [collision.summary() for collision in self.collisions]}


def stokes_numbers(text: str) -> list[float]:
    """Stokes numbers of a text: one, several with commas, or a range in even ratios.

    errors  InputError

    >>> stokes_numbers("30"), stokes_numbers("1,10"), [round(each, 2) for each in stokes_numbers("1..100")[:3]]
    ([30.0], [1.0, 10.0], [1.0, 1.27, 1.62])
    """
    limit = "a number, numbers with commas, or LOW..HIGH above 0, such as 1..1000"
    span = re.fullmatch(r"(.+?)\.\.(.+)", text)
    try:
        numbers = [float(number) for number in (span.groups() if span else text.split(","))]
    except ValueError:
        raise InputError("stokes", text, limit) from None
    if span:
        low, high = numbers
        if not 0.0 < low < high < np.inf:
            raise InputError("stokes", text, limit, "the smaller one first")
        return [float(number) for number in np.geomspace(low, high, IN_A_RANGE)]
    if len(numbers) > MOST:
        raise InputError("stokes", len(numbers), f"at most {MOST} numbers")
    return numbers


def write_csv(collisions: Sequence[Collision], path: Path) -> None:
    """Write one row for each collision; values that are not known are empty."""
    rows = [collision.summary() for collision in collisions]
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(f"{name} [{UNITS.get(name, '-')}]" if name in NUMBERS else name for name in rows[0])
        table.writerows([_cell(number) for number in row.values()] for row in rows)


def _cell(value: Any) -> Any:
    return "" if value is None else " ".join(map(str, value)) if isinstance(value, list) else value
