"""Viscosity of a sheared suspension by films alone: at three time steps, and beside published curves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from scenarios.validation.sheared_films.shear import SMOOTH, boyer, krieger_dougherty, morris_boulay, sheared
from scenarios.validation.table import Curves, Progress, Row, in_parts, worst

SOLID_FRACTIONS = (0.3, 0.4, 0.5, 0.55)
STEPS = (1.0 / 16.0, 1.0, 4.0)
"""Time steps over that which is recommended."""

FRICTION = 0.5
"""Of the spheres of the runs with friction."""

LONG = 2.0
"""Strain of the runs that are compared with published curves; the second half counts."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    return in_parts(PARTS, _draw, folder, progress)


def steps(curves: Curves) -> list[Row]:
    """Viscosity at a sixteenth of the recommended time step, at it and at four times that."""
    rows, balance = [], []
    for solid_fraction in SOLID_FRACTIONS:
        runs = {size: sheared(solid_fraction, steps_in_one=size) for size in STEPS}
        points = [(size, run.viscosity, runs[1.0].viscosity) for size, run in runs.items()]
        limit = 0.03 * runs[1.0].viscosity
        rows.append(worst(f"at {solid_fraction:g}: viscosity of films, against the recommended step", points, limit))
        balance += [(size, float(run.dissipated), 1.0) for size, run in runs.items()]
    return [*rows, worst("dissipated by films over work that is not stored", balance, 2e-3)]


def published(curves: Curves) -> list[Row]:
    """Viscosity after a long strain, beside published curves."""
    found = {each: sheared(each, strain=LONG) for each in SOLID_FRACTIONS}
    fractions = np.array([run.solid_fraction for run in found.values()])
    values = np.array([run.viscosity for run in found.values()])
    curves["viscosity"] = {"solid_fraction": (fractions, "-"), "films": (values, "-")}
    rows = []
    for name, run in found.items():
        at, value = run.solid_fraction, 1.0 + run.viscosity
        rows += [
            Row(f"at {name:g}: fluid and films, against Krieger & Dougherty", value, krieger_dougherty(at)),
            Row(f"at {name:g}: fluid and films, against Morris & Boulay", value, morris_boulay(at)),
            Row(f"at {name:g}: part of sliding and rolling in the work", float(run.sliding)),
        ]
    return rows


def friction(curves: Curves) -> list[Row]:
    """What friction of contacts adds, beside the frictional suspensions of Boyer, Guazzelli & Pouliquen (2011)."""
    rows = []
    for name in (0.4, 0.5):
        run = sheared(name, strain=LONG, solid=SMOOTH.model_copy(update={"friction": FRICTION}))
        rows += [
            Row(f"at {name:g}, friction {FRICTION:g}: fluid, films and contacts, against Boyer et al.",
                1.0 + run.viscosity, boyer(run.solid_fraction)),
            Row(f"at {name:g}, friction {FRICTION:g}: part of friction in the work", run.rubbed),
            Row(f"at {name:g}, friction {FRICTION:g}: dissipated over work that is not stored", run.dissipated, 1.0),
        ]  # fmt: skip
    return rows


def conditions(curves: Curves) -> list[Row]:
    """What the size of the box, the roughness and the reach of the films change at a solid fraction of 0.5."""
    usual = sheared(0.5, strain=LONG).viscosity
    changed = {
        "1200 spheres": sheared(0.5, strain=LONG, count=1200),
        "ten times the roughness": sheared(0.5, strain=LONG, solid=SMOOTH.model_copy(update={"roughness": 1e-6})),
        "a tenth of the roughness": sheared(0.5, strain=LONG, solid=SMOOTH.model_copy(update={"roughness": 1e-8})),
        "half the reach of films": sheared(0.5, strain=LONG, cutoff_ratio=0.5),
        "a quarter of the reach of films": sheared(0.5, strain=LONG, cutoff_ratio=0.25),
    }
    return [Row(f"at 0.5, {name}: viscosity of films", run.viscosity, usual) for name, run in changed.items()]


def _draw(folder: Path, curves: Curves) -> None:
    """Viscosity against solid fraction."""
    figure, axes = panels()
    at = np.linspace(0.25, 0.57, 100)
    axes.plot(at, [krieger_dougherty(each) for each in at], color=GREY, label="Krieger & Dougherty (1959)")
    axes.plot(at, [morris_boulay(each) for each in at], color=ORANGE, label="Morris & Boulay (1999)")
    found = curves["viscosity"]
    films = np.asarray(found["films"][0])
    axes.plot(found["solid_fraction"][0], 1.0 + films, "o", color=BLUE, label="fluid and films")
    axes.set_yscale("log")
    label(axes, "solid fraction", "-", "relative viscosity", "-")
    legend(axes)
    save(figure, folder / "sheared_films.png")


PARTS: tuple[Callable[[Curves], list[Row]], ...] = (steps, published, friction, conditions)
