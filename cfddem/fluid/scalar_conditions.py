"""Conditions of a scalar at the sides of the box, and on solid cells. Importing this module compiles nothing.

An inlet brings its value, an outlet lets the value of the cell leave. Walls hold a value, let a flux in, or exchange
with a coefficient. Periodic sides need no condition.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SOLID = "solid"
"""Name of smooth walls, or of the wall around solid cells, beside the names of the six sides."""


@dataclass(frozen=True)
class HeldWall:
    """A wall that holds a value; the fluid conducts between it and the centre of the cell.

    area  of the wall over that of its faces, here and below: a round wall is shorter than its staircase of cells
    """

    value: float
    area: float = 1.0


@dataclass(frozen=True)
class FluxWall:
    """A wall through which a flux enters, per area: [W/m2] of heat, [kg/m2/s] of a species."""

    flux: float = 0.0
    area: float = 1.0


@dataclass(frozen=True)
class ExchangeWall:
    """A wall with a coefficient between a value outside and the fluid: [W/m2/K] of heat, [kg/m2/s] of a species.

    to_cell  whether it is that to the centre of the cell; else to the surface, from where the fluid conducts
    """

    coefficient: float
    value: float
    area: float = 1.0
    to_cell: bool = False


Wall = HeldWall | FluxWall | ExchangeWall


@dataclass(frozen=True)
class ScalarSides:
    """Conditions of a scalar on all sides.

    inflow    value that inlets bring: a number, or a function of the name of a side and places x, y, z on it
    backflow  value that flows back through outlets; that of the cell if None
    walls     by the name of a side, or "solid" for smooth walls or those around solid cells; others
              are insulated
    """

    inflow: float | Callable[[str, Array, Array, Array], Array]
    backflow: float | None = None
    walls: Mapping[str, Wall] = field(default_factory=dict)
