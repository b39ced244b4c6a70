"""The grid of a column."""

from __future__ import annotations

from cfddem.case.schema import Column
from cfddem.fluid.grid import Grid, outside_cylinder


def grid_of(column: Column) -> Grid:
    """Cells of the column; those outside a cylinder are solid."""
    width, _, _ = column.size
    solid = None
    if column.shape == "cylinder":
        solid = outside_cylinder((0.5 * width, 0.5 * width, 0.0), 0.5 * width)
    return Grid.of_size(column.size, column.cell, solid=solid)
