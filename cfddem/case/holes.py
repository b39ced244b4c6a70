"""Holes of a distributor plate: one inlet through many discs, in rows around a centre or each at its place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError, shown

SAMPLES, OF_A_CELL = 24, 12
"""Fewest places across a hole, and across a cell, at which a hole is sampled."""

Array = NDArray[np.float64]


def in_rows(number: int, pitch: float) -> Array:
    """Places of holes in rows at 60 degrees about the origin, those nearest to it (N, 2) [m].

    number  of holes; 1, 7, 19, 37, 61 ... are whole rings of six sides
    pitch   distance of neighbours [m]

    >>> in_rows(7, 0.01).round(4).tolist()[:3]
    [[0.0, 0.0], [0.01, 0.0], [0.005, 0.0087]]
    """
    reach = math.ceil(math.sqrt(number)) + 1
    i, j = (steps.ravel() for steps in np.meshgrid(*2 * [np.arange(-reach, reach + 1)]))
    x, y = i + 0.5 * j, 0.5 * math.sqrt(3.0) * j
    turn = np.round(np.arctan2(y, x) % (2.0 * math.pi), 6)
    nearest = np.lexsort((turn, i * i + i * j + j * j))[:number]
    return np.asarray(pitch * np.stack([x, y], axis=-1)[nearest])


def samples(places: Array, diameter: float, spacing: tuple[float, float] | None = None) -> tuple[Array, Array]:
    """x and y of places spread evenly over the holes (M,) [m].

    places    of their centres (N, 2) [m]
    diameter  of each [m]
    spacing   of the places along x and y; default: for SAMPLES across a hole [m]
    """
    lines = []
    for apart in spacing or 2 * (diameter / SAMPLES,):
        reach = math.ceil(0.5 * diameter / apart)
        lines.append((np.arange(-reach, reach) + 0.5) * apart)
    x, y = (offsets.ravel() for offsets in np.meshgrid(*lines))
    within = np.hypot(x, y) <= 0.5 * diameter
    return (places[:, :1] + x[within]).ravel(), (places[:, 1:] + y[within]).ravel()


def samples_by_cells(places: Array, diameter: float, cell: tuple[float, float]) -> tuple[Array, Array]:
    """The same, with equally many places in every cell that a hole covers, so that it gets the velocity of the hole.

    The holes move onto the lattice of places, by less than 1/24 of a cell and 1/48 of their diameter along x and y.

    cell  edges along x and y of cells that begin at the origin [m]

    >>> x, y = samples_by_cells(np.array([[0.05, 0.05]]), 0.1, (0.01, 0.01))
    >>> middle = np.histogram2d(x, y, 10, [(0.0, 0.1)] * 2)[0][3:7, 3:7]
    >>> float(middle.min()), float(middle.max())
    (144.0, 144.0)
    """
    even = [2 * math.ceil(0.5 * max(OF_A_CELL, SAMPLES * edge / diameter)) for edge in cell]
    spacing = cell[0] / even[0], cell[1] / even[1]
    return samples(np.round(places / spacing) * spacing, diameter, spacing)


def refuse_holes(patch: Any) -> None:
    """Raise InputError for holes that are not an inlet of a plate, or that overlap.

    patch  of shape = "holes"
    """
    if not patch.brings or patch.side not in ("floor", "lid"):
        key, value = ("side", patch.side) if patch.brings else ("shape", "holes")
        limit = "floor or lid" if patch.brings else "that of an inlet by velocity or mass_flow"
        raise InputError(key, value, limit, 'holes are for a distributor plate; take shape = "disc" here')
    if isinstance(patch.holes, int):
        if patch.holes > 1 and patch.pitch is None:
            raise InputError("pitch", None, "given for a number of holes", "or list the places [x, y] of holes, in m")
        closest, key = patch.pitch if patch.holes > 1 else math.inf, "pitch"
    else:
        for name in ("pitch", "centre"):
            if getattr(patch, name) is not None:
                raise InputError(name, shown(getattr(patch, name)), "left out where holes are listed by place")
        places, key = np.array(patch.holes, float), "holes"
        rows = [np.hypot(*(places[n + 1 :] - place).T) for n, place in enumerate(places[:-1])]
        closest = float(np.concatenate(rows).min()) if rows else math.inf
    if closest < patch.diameter * (1.0 - 1e-9):
        raise InputError(
            key, shown(closest) if key == "pitch" else None, f"such that holes lie beside each other, "
            f"at least {patch.diameter:g} m apart", f"the nearest two are {closest:.3g} m apart; move them, or make "
            "diameter smaller",
        )  # fmt: skip
