"""The pressure equation against a direct solver, and bits that do not depend on threads."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from cfddem.backend.communicator import SERIAL
from cfddem.fluid import budgets
from cfddem.fluid.grid import Grid, outside_cylinder
from cfddem.fluid.pressure.multigrid import OVER_RELAXATION, ClosedRegions, PressureEquation
from cfddem.fluid.solver import FluidSolver


def equation(
    cells, spacing=(1.0, 1.0, 1.0), periodic=(False, False, False), anchored=True, solid=False, seed=0, relaxation=1.0,
):  # fmt: skip
    """A pressure equation with random coefficients of contrast 30, its solid mask and its right-hand side."""
    rng = np.random.default_rng(seed)
    grid = Grid(cells, spacing)
    if solid:
        grid = grid.with_solid(outside_cylinder((cells[0] / 2, cells[1] / 2, 0), 0.45 * cells[0]))
    system = PressureEquation(grid, None if anchored else ClosedRegions.numbered(grid.open.astype(np.int64), SERIAL))
    for level in system.levels:
        level.relaxation = relaxation
    finest = system.finest
    for d, a in enumerate((finest.ax, finest.ay, finest.az)):
        a[:] = rng.uniform(0.1, 3.0, grid.shape) * grid.face_area(d) / spacing[d]
        first = [slice(None)] * 3
        first[2 - d] = 0
        if not periodic[d] or cells[d] == 1:
            a[tuple(first)] = 0.0
        a *= grid.open & np.roll(grid.open, 1, 2 - d)
    if anchored:
        finest.anchor[-1] = 2.0 * grid.open[-1] * grid.face_area(2) / spacing[2]
    b = rng.standard_normal(grid.shape) * grid.open
    if not anchored:
        b -= grid.open * b.sum() / grid.open.sum()
    system.prepare()
    return grid, system, b


def matrix(finest):
    """The same equation as a sparse matrix, assembled from its definition."""
    shape = finest.ax.shape
    number = np.arange(np.prod(shape)).reshape(shape)
    rows, columns, values = [number.ravel()], [number.ravel()], [finest.anchor.ravel()]
    for d, a in enumerate((finest.ax, finest.ay, finest.az)):
        other = np.roll(number, 1, 2 - d)
        for first, second, sign in ((number, number, 1), (other, other, 1), (number, other, -1), (other, number, -1)):
            rows.append(first.ravel())
            columns.append(second.ravel())
            values.append(sign * a.ravel())
    return coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))).tocsr()


CASES = {
    "box": {"cells": (12, 8, 20)},
    "odd box": {"cells": (13, 7, 21)},
    "one cell thick": {"cells": (16, 1, 12)},
    "flat cells": {"cells": (12, 12, 12), "spacing": (1.0, 1.0, 4.0)},
    "cylinder": {"cells": (14, 14, 16), "solid": True},
    "over-relaxed cylinder": {"cells": (14, 14, 16), "solid": True, "relaxation": OVER_RELAXATION},
    "closed": {"cells": (12, 8, 20), "anchored": False},
    "periodic": {"cells": (12, 8, 20), "anchored": False, "periodic": (True, True, True)},
    "over-relaxed odd periodic": {
        "cells": (11, 9, 15),
        "anchored": False,
        "periodic": (True, True, True),
        "relaxation": OVER_RELAXATION,
    },
    "odd periodic": {"cells": (11, 9, 15), "anchored": False, "periodic": (True, True, True)},
    "closed cylinder": {"cells": (14, 14, 16), "anchored": False, "solid": True, "periodic": (False, False, True)},
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_pressure_equation_agrees_with_a_direct_solver(case):
    """Against a direct sparse solve of the same equation, in at most 16 iterations for 1e-10."""
    grid, system, b = equation(**case)
    x, iterations = system.solve(b, 1e-10 * np.abs(b).max())
    full = matrix(system.finest)
    assert np.abs(full @ x.ravel() - b.ravel()).max() < 2e-10 * np.abs(b).max()
    assert iterations <= 16
    open_cells = np.flatnonzero(grid.open.ravel())
    if not case.get("anchored", True):
        assert abs(x[grid.open].mean()) < 1e-12 * np.abs(x).max()
        open_cells = open_cells[1:]  # one pressure given instead of the mean
    direct = np.zeros(b.size)
    direct[open_cells] = spsolve(full[open_cells][:, open_cells].tocsc(), b.ravel()[open_cells])
    difference = (x.ravel() - direct)[grid.open.ravel()]
    if not case.get("anchored", True):
        difference -= difference.mean()
    assert np.abs(difference).max() < 1e-7 * np.abs(x).max()
    assert not x[~grid.open].any()


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_preconditioner_is_symmetric(case):
    """a.M b = b.M a for random a, b, as conjugate gradients need."""
    grid, system, _ = equation(**case)
    rng = np.random.default_rng(1)
    a, b = (rng.standard_normal(grid.shape) * grid.open for _ in range(2))

    def cycle(residual):
        np.copyto(system.finest.b, residual)
        system._cycle(0)
        return system.finest.x.copy()

    assert (a * cycle(b)).sum() == pytest.approx((b * cycle(a)).sum(), rel=1e-11)
    assert (a * cycle(a)).sum() > 0.0


def test_pressure_iterations_are_independent_of_the_grid_size():
    """At most two iterations more on 64^3 than on 16^3."""
    counts = []
    for n in (16, 32, 64):
        _, system, b = equation((n, n, n))
        counts.append(system.solve(b, 1e-8 * np.abs(b).max())[1])
    assert counts[2] <= counts[0] + 2


def test_continuity_holds_in_each_of_two_separate_closed_regions():
    """Two chambers without an outlet, one of them stirred: no flow through the wall, continuity in both."""
    solid = np.zeros((8, 8, 9), dtype=bool)
    solid[:, :, 4] = True
    grid = Grid((9, 8, 8), (0.1,) * 3, solid=solid)
    fluid = FluidSolver(grid, density=1.0, viscosity=0.1)
    source = np.zeros((*grid.shape, 3))
    source[2, :, :4, 1] = 1.0
    for _ in range(5):
        fluid.step(0.01, source=source)
    assert np.abs(fluid.velocity[:, :, :4]).max() > 1e-4
    assert np.abs(fluid.velocity[:, :, 5:]).max() == 0.0
    assert np.abs(budgets.continuity_residual(fluid)).max() < 1e-8 * np.abs(fluid.velocity).max() * grid.face_area(0)


RUN = """
import numpy as np
from cfddem.fluid import budgets
from cfddem.fluid.conditions import Inlet, Outlet, Periodic
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver, Scheme
rng = np.random.default_rng(0)
grid = Grid((15, 9, 33), (0.01, 0.01, 0.012))
sides = {"z_low": Inlet(0.4), "z_high": Outlet(), "x_low": Periodic(), "x_high": Periodic()}
fluid = FluidSolver(grid, sides, density=1.2, viscosity=1.8e-5, scheme=Scheme(smagorinsky=0.1))
voidage = rng.uniform(0.4, 0.9, grid.shape)
fluid.set_voidage(voidage)
for _ in range(4):
    voidage = voidage + rng.uniform(-1e-3, 1e-3, grid.shape)
    fluid.step(1e-3, voidage, rng.uniform(0, 500, grid.shape))
print(np.abs(fluid.velocity).max(), hash(fluid.velocity.tobytes()), hash(fluid.pressure.tobytes()),
      hash(budgets.drag_exchange(fluid).tobytes()), hash(fluid.cell_pressure_gradient().tobytes()),
      hash(fluid.cell_viscous_force().tobytes()))
"""


def test_bits_do_not_depend_on_the_number_of_threads():
    """The same run on one, two and three threads gives the same arrays, bit by bit."""
    outputs = {
        subprocess.run(
            [sys.executable, "-c", RUN],
            env={**os.environ, "NUMBA_NUM_THREADS": str(threads), "PYTHONHASHSEED": "0"},
            capture_output=True, text=True, check=True,
        ).stdout
        for threads in (1, 2, 3)
    }  # fmt: skip
    assert len(outputs) == 1
