"""The fluid alone: flows with a known solution, a manufactured solution with particles, fixed beds, water at rest.

The solutions are in :mod:`scenarios.references.flows`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cfddem.plotting.curves import BLUE, GREY, ORANGE, decades, label, legend, panels, save
from scenarios.references.flows import (
    cavity,
    duct,
    error,
    fixed_bed,
    ghia,
    order,
    pipe,
    sound,
    taylor_green,
    water_at_rest,
)
from scenarios.validation.table import Curves, Progress, Row, in_parts, worst

CAVITIES = ((100, 10.0), (400, 35.0), (1000, 50.0))
"""Reynolds numbers, and times at which the flow is steady [s]."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    return in_parts((orders, channels, beds, cavities), _draw, folder, progress)


def orders(curves: Curves) -> list[Row]:
    """Order of the scheme: vortices that decay, and a manufactured solution with a moving voidage and drag."""
    cells = (16, 32, 64)
    rows = []
    for name, errors in (
        ("vortices", [taylor_green(n, n // 4, "central") for n in cells]),
        ("manufactured, model A", [error(n, n // 2, model="A")[:2] for n in cells]),
        ("manufactured, model B", [error(n, n // 2, model="B")[:2] for n in cells]),
    ):
        for field, errors_of_field in zip(("velocity", "pressure"), zip(*errors)):
            # an order above 2 passes, too
            rows.append(Row(f"{name}: order in L2, {field}", min(min(order(errors_of_field)), 2.0), 2.0, 0.1))
            curves[f"order/{name}/{field}"] = {
                "cells": (np.array(cells), "-"),
                "error": (np.array(errors_of_field), "-"),
            }
    limited = order([taylor_green(n, n // 4, "limited")[0] for n in cells])
    return [*rows, Row("vortices: order in L2, velocity, limited scheme", min(limited), 2.0)]


def channels(_: Curves) -> list[Row]:
    """A square duct and a round pipe made of cells."""
    return [
        Row("square duct, 16 cells across: error in L2 over largest velocity", duct(16), 0.0, 0.006),
        Row("round pipe, 32 cells across: flux over that of Hagen and Poiseuille", pipe(32), 1.0, 0.05),
    ]


def beds(_: Curves) -> list[Row]:
    """Fixed beds, and water at rest over a steep voidage."""
    drops = [
        (speed, fixed_bed(model, speed, cells), 1.0)
        for model in ("A", "B")
        for speed in (0.01, 0.5)
        for cells in ((10, 20), (12, 16, 12))
    ]
    still = [(0.0, water_at_rest(model), 0.0) for model in ("A", "B")]
    return [
        worst("fixed beds: pressure drop over Ergun's", drops, 0.005),
        worst("water at rest: velocity over sqrt(g H)", still, 1e-10),
    ]


def cavities(curves: Curves) -> list[Row]:
    """A cavity with a sliding lid, on 129 by 129 cells."""
    rows = []
    for reynolds, until in CAVITIES:
        for line, profile in cavity(reynolds, 129, until).items():
            table, kept = ghia(line, reynolds), sound(line, reynolds)
            points = list(zip(table["position"][kept], profile[kept], table["velocity"][kept]))
            rows.append(worst(f"cavity, Re {reynolds}: {line} against Ghia, over the lid's speed", points, 0.01))
            if reynolds == 1000:
                spectral = list(zip(table["position"], profile, table["spectral"]))
                rows.append(worst(f"cavity, Re {reynolds}: {line} against the spectral solution", spectral, 0.01))
            curves[f"cavity/{reynolds}/{line}"] = {
                "position": (table["position"], "-"),
                "velocity": (profile, "-"),
                "ghia": (table["velocity"], "-"),
            }
    return rows


def _draw(folder: Path, curves: Curves) -> None:
    """Errors against cells; velocities on the two lines of the cavity."""
    figure, axes = panels(3, width=11.0)
    for (name, columns), colour in zip(
        ((name, columns) for name, columns in curves.items() if name.endswith("/velocity")), (BLUE, ORANGE, GREY)
    ):
        axes[0].loglog(columns["cells"][0], columns["error"][0], "o-", color=colour, label=name.split("/")[1])
    axes[0].loglog((16, 64), (0.02, 0.02 / 16), "k:", label="second order")
    label(axes[0], "cells across", "-", "error of the velocity in L2", "-")
    decades(axes[0], 16, 32, 64)
    legend(axes[0])
    for axis, line, along in ((axes[1], "u", "height"), (axes[2], "v", "width")):
        for (reynolds, _), colour in zip(CAVITIES, (BLUE, ORANGE, GREY)):
            columns = curves[f"cavity/{reynolds}/{line}"]
            axis.plot(columns["position"][0], columns["velocity"][0], color=colour, label=f"Re {reynolds}")
            axis.plot(columns["position"][0], columns["ghia"][0], "o", color=colour, markersize=4)
        axis.plot([], [], "o", color="#444444", markersize=4, label="Ghia et al. (1982)")
        label(axis, f"place along the {along}", "-", f"{line} over the speed of the lid", "-")
        legend(axis)
    save(figure, folder / "fluid.png")
