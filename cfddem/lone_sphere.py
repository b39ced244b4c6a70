"""A sphere alone in a fluid: how it fell, beside the terminal velocity and the equation of motion of its drag law."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from cfddem.assembly import grid_of
from cfddem.case import Case
from cfddem.record.reading import Run
from closures.balance import speed_after, terminal_velocity

MOST_SNAPSHOTS = 200
"""More snapshots than this are not read: they would tell no more."""

ALONG = 1e-3
"""A slip velocity lies along gravity where no more than this part of it points elsewhere."""


def beside_its_drag_law(run: Run, case: Case) -> Iterator[tuple[str, float, float, str]]:
    """Name, value of the run, value of the drag law, unit: of a run with one sphere that falls or rises.

    The first row is the last speed, the second the speed at the time at which the run is farthest from the equation
    of motion. Speeds are against the mean of the fluid; what comes after a touch is left out.
    """
    drag, fluid, law = case.laws.drag_function(), case.fluid, case.laws.drag_law
    if case.particle_count != 1 or case.bed.fixed or fluid is None or law is None or drag is None:
        return
    density, gravity = case.solid_density, np.array(case.laws.gravity)
    strength = math.hypot(*gravity)
    if fluid.viscosity == 0.0 or density == fluid.density or strength == 0.0:
        return
    times, slip = slip_velocity(run, case)
    if len(times) < 2:
        return
    way = math.copysign(1.0, density - fluid.density) * gravity / strength
    speeds = slip @ way
    sphere = (case.bed.diameter, density, fluid.density, fluid.viscosity, drag, strength)
    yield f"terminal velocity by {law.name}", float(speeds[-1]), terminal_velocity(*sphere), "m/s"
    across = np.abs(slip - np.outer(speeds, way)).max()
    if across > ALONG * np.abs(slip).max():
        return
    exact = [float(speeds[0])]
    for begin, end in pairwise(times):
        exact.append(speed_after(end - begin, exact[-1], *sphere, case.laws.added_mass))
    worst = int(np.abs(speeds - exact).argmax())
    if worst:
        name = f"equation of motion, farthest at {times[worst]:.3g} s"
        yield name, float(speeds[worst]), exact[worst], "m/s"


def slip_velocity(run: Run, case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and velocity [m/s] of a sphere against the mean of the fluid, in the snapshots until it touches."""
    history = run.history
    touches = history["time"][history["contact_count"] > 0.0]
    end, open_part = touches.min(initial=math.inf), float(grid_of(case.column).open.mean())
    before = np.flatnonzero(run.times < end)
    chosen = before[np.unique(np.linspace(0, len(before) - 1, min(len(before), MOST_SNAPSHOTS)).astype(int))]
    times, slip = [], []
    for place in chosen.tolist():
        velocity = run.particles(place)["velocity"]
        if len(velocity):  # it may have left the column
            times.append(run.times[place])
            slip.append(velocity[0] - run.fluid("velocity", place).mean(axis=(0, 1, 2)) / open_part)
    return np.array(times), np.array(slip, float).reshape(-1, 3)
