"""Loops over the cells that belong to groups, see :class:`cfddem.fluid.cell_groups.Groups`."""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import serial


@serial
def put_means(at, group, count, shares, total, fields):
    """Make fields (m, cells) their means over groups, in all cells of these.

    at      cells of groups (n,), the group of each, and the number of groups
    shares  weights of these cells, whose sum over the group of each is `total` (n,)
    """
    sums = np.empty(count)
    for m in range(fields.shape[0]):
        sums[:] = 0.0
        for i in range(at.size):
            sums[group[i]] += fields[m, at[i]] * shares[i]
        for i in range(at.size):
            fields[m, at[i]] = sums[group[i]] / total[i]


@serial
def put_copies(at, large, divisor, fields):
    """Give all cells of groups the value of their large cell in fields (m, cells), over a divisor.

    at, large  cells of groups, and the large cell of each (n,)
    """
    values = np.empty(at.size)
    for m in range(fields.shape[0]):
        for i in range(at.size):
            values[i] = fields[m, large[i]] / divisor[i]
        for i in range(at.size):
            fields[m, at[i]] = values[i]
