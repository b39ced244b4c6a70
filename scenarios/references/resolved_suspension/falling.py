"""Spheres that are held or fall: drag in a stream, ten Cate's fall in a box, and two spheres one above the other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from closures.drag_single import clift, schiller_naumann
from scenarios.references.resolved_suspension.flow import Flow, force_of, sphere_volume
from scenarios.references.resolved_suspension.suspension import Suspension
from scenarios.validation.table import reference

GRAVITY = 9.81
"""[m/s2]"""


def held_in_a_stream(
    reynolds: float, diameter: int = 10, speed: float = 0.06, width: int = 8, length: int = 10
) -> float:
    """Drag of a sphere held in a uniform stream, over the standard drag curve of Clift, Grace & Weber (1978).

    A layer across the end of the box holds the speed of the stream, so that the sphere does not meet its own wake.

    width, length  of the box [d]
    """
    shape = (width * diameter, width * diameter, length * diameter)
    viscosity = speed * diameter / reynolds
    static, moving = np.zeros(shape[::-1]), np.zeros((3, *shape[::-1]))
    layer = 2 * diameter
    static[-layer:] = 0.05 * np.sin(np.pi * (np.arange(layer) + 0.5) / layer)[:, None, None]
    moving[2] = speed * static
    flow = Flow(shape, viscosity, static=static, moving=moving)
    start = np.array([0.0, 0.0, speed])
    flow.move(start)
    flow.place(np.array([[0.5 * width, 0.5 * width, 3.0]]) * diameter + 0.2, 0.5 * diameter)
    still = np.zeros((1, 3))
    before, drag = 0.0, 1.0
    while abs(drag - before) > 3e-3 * drag:
        for _ in range(round(diameter / speed)):
            flow.advance(still, still)
        before, drag = drag, float(force_of(flow.sums(), still, still)[0, 2])
    return drag / (3.0 * math.pi * viscosity * diameter * speed * clift(reynolds, 1.0))


def ten_cate(case: str, width: int = 54, speed: float = 0.03) -> float:
    """Largest speed of a sphere that falls in a closed box, over the one measured by ten Cate et al. (2002).

    case   row of scenarios/data/tencate2002_cases.csv
    width  cells across the box of 100 mm
    speed  that speed on the lattice [cells/step]
    """
    table = reference("tencate2002_cases")
    row = table["case"].index(case)
    density, viscosity, fastest = (float(table[name][row]) for name in ("rho_f [kg/m3]", "mu_f [Pa s]", "u_max [m/s]"))
    cell = 0.1 / width
    step = speed * cell / fastest
    diameter = 0.015 / cell
    shape = (width + 1, width + 1, round(0.16 / cell) + 1)
    walls = np.zeros(shape[::-1])
    walls[0], walls[:, 0], walls[:, :, 0] = 1.0, 1.0, 1.0
    flow = Flow(shape, viscosity / density * step / cell**2, static=walls)
    ratio = 1120.0 / density
    weight = (ratio - 1.0) * sphere_volume(diameter) * GRAVITY * step**2 / cell
    centre = np.array([[0.5 * (width + 1), 0.5 * (width + 1), 0.5 + 0.1275 / cell]])
    sphere = Suspension(
        flow, centre, diameter, ratio, (0.0, 0.0, -weight), speed=speed, box=(None, None, None)
    )  # fmt: skip
    highest = 0.0
    while sphere.solver.particles.position[0, 2] > 0.06 / cell:
        sphere.step()
        highest = max(highest, -float(sphere.velocity[0, 2]))
    return highest / speed


@dataclass(frozen=True)
class Tumble:
    """Two spheres one above the other: times in d/U, U the terminal speed of one."""

    time: np.ndarray
    gap: np.ndarray  # over the diameter
    tilt: np.ndarray  # angle of the line of centres to the vertical [degrees]
    approach: np.ndarray  # speed of the upper sphere in excess of the lower, over U

    @property
    def order(self) -> tuple[float, float, float]:
        """When the upper sphere first outruns the lower by 5 % of U, when they touch, and when they lie aslant."""
        drafting = self.time[int(np.argmax(self.approach > 0.05))]
        kissing = self.time[int(np.argmax(self.gap < 0.02))]
        tumbling = self.time[int(np.argmax(self.tilt > 45.0))]
        return float(drafting), float(kissing), float(tumbling)


def two_spheres(reynolds: float = 60.0, ratio: float = 1.5, diameter: int = 10, until: float = 40.0) -> Tumble:
    """Two spheres that fall one above the other, 1 d apart and a twentieth of d aside, in a box of 4 x 4 x 12 d."""
    shape = (4 * diameter, 4 * diameter, 12 * diameter)
    speed = 0.05
    viscosity = speed * diameter / reynolds
    weight = 3.0 * math.pi * viscosity * diameter * speed * schiller_naumann(reynolds, 1.0)
    flow = Flow(shape, viscosity, force=(0.0, 0.0, 2.0 * weight / math.prod(shape)))
    low = np.array([2.0, 2.0, 4.0]) * diameter
    pair = np.array([low, low + np.array([0.05, 0.0, 2.0]) * diameter])
    fall = Suspension(flow, pair, diameter, ratio, (0.0, 0.0, -weight), speed=speed)
    box = np.array(shape, float)
    rows = []
    while fall.steps * speed / diameter < until:
        fall.step()
        if fall.steps % 20:
            continue
        apart = np.diff(fall.solver.particles.position, axis=0)[0]
        apart -= box * np.round(apart / box)
        distance = float(np.linalg.norm(apart))
        tilt = math.degrees(math.acos(min(abs(apart[2]) / distance, 1.0)))
        excess = float(fall.velocity[0, 2] - fall.velocity[1, 2]) / speed
        rows.append((fall.steps * speed / diameter, distance / diameter - 1.0, tilt, excess))
    return Tumble(*np.array(rows).T)
