"""The grid of a column."""

from __future__ import annotations

from cfddem.case.schema import Column
from cfddem.fluid.grid import Grid, Region, outside_cylinder


def grid_of(column: Column) -> Grid:
    """Cells of the column; those outside a cylinder are solid."""
    return Grid.of_size(column.size, column.cell, solid=outside_column(column))


def outside_column(column: Column) -> Region | None:
    """Region of the box of cells that is outside the column; None if the column is the box."""
    if column.shape == "box":
        return None
    return outside_cylinder((0.5 * column.width, 0.5 * column.width, 0.0), 0.5 * column.width)
