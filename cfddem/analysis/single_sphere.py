"""One sphere in a fluid: its motion compared with the terminal velocity and the equation of motion of its drag law."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from closures.balance import speed_after, terminal_velocity

MOST_SNAPSHOTS = 200
"""Largest number of snapshots that are read."""

ALIGNED = 1e-3
"""A slip velocity is along gravity if its transverse part is below this fraction."""


def compared_with_drag_law(run: RunData, case: Case) -> Iterator[tuple[str, float, float, str]]:
    """Name, value of the run, value of the drag law, and unit, for a run with one sphere that settles or rises.

    The first row is the last speed against the terminal velocity; the second the speed at the time of the largest
    deviation from the equation of motion. Speeds are relative to the mean of the fluid, up to the first contact.
    """
    drag, fluid, law = case.laws.drag_function(), case.fluid, case.laws.drag_law
    if not case.is_one_sphere or case.bed.fixed or fluid is None or law is None or drag is None:
        return
    density, gravity = case.solid_density, np.array(case.laws.gravity)
    strength = math.hypot(*gravity)
    if fluid.viscosity == 0.0 or density == fluid.density or strength == 0.0:
        return
    times, slip = slip_velocity(run, case)
    if len(times) < 2:
        return
    direction = math.copysign(1.0, density - fluid.density) * gravity / strength
    speeds = slip @ direction
    sphere = (case.bed.diameter, density, fluid.density, fluid.viscosity, drag, strength)
    yield f"terminal velocity by {law.name}", float(speeds[-1]), terminal_velocity(*sphere), "m/s"
    if case.laws.history != "none":
        return  # the equation of motion has a memory
    transverse = np.abs(slip - np.outer(speeds, direction)).max()
    if transverse > ALIGNED * np.abs(slip).max():
        return
    exact = [float(speeds[0])]
    for begin, end in pairwise(times):
        exact.append(speed_after(end - begin, exact[-1], *sphere, added_mass=case.laws.added_mass_at(1.0)))
    worst = int(np.abs(speeds - exact).argmax())
    if worst:
        name = f"equation of motion, largest deviation at {times[worst]:.3g} s"
        yield name, float(speeds[worst]), exact[worst], "m/s"


def slip_velocity(run: RunData, case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and velocities [m/s] of the sphere relative to the mean fluid velocity, up to its first contact."""
    history = run.history
    contacts = history["time"][history["contact_count"] > 0.0]
    end, open_fraction = contacts.min(initial=math.inf), float(grid_of(case).open.mean())
    before = np.flatnonzero(run.times < end)
    chosen = before[np.unique(np.linspace(0, len(before) - 1, min(len(before), MOST_SNAPSHOTS)).astype(int))]
    times, slip = [], []
    for place in chosen.tolist():
        velocity = run.particles(place)["velocity"]
        if len(velocity):  # the sphere may have left the column
            times.append(run.times[place])
            slip.append(velocity[0] - run.fluid("velocity", place).mean(axis=(0, 1, 2)) / open_fraction)
    return np.array(times), np.array(slip, float).reshape(-1, 3)
