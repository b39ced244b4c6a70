"""Verification of the resolved flow: spheres whose drag, fall or resistance is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closures.drag_resolved import beetstra, tenneti
from closures.drag_single import clift, schiller_naumann
from scenarios.references.resolved_suspension.film import approach_resistance, unresolved_film
from scenarios.references.resolved_suspension.flow import Flow, force_of, sphere_volume
from scenarios.references.resolved_suspension.suspension import Contacts, Point, Suspension, random_arrangement
from scenarios.validation.table import Row, reference, worst

ZICK_HOMSY = {0.064: 2.810, 0.125: 4.292, 0.216: 7.442, 0.343: 15.4}
"""Drag factor K of simple cubic arrays (Zick & Homsy 1982, table 2), by solid fraction; from memory.

At 0.064 and 0.125 the expansion of Sangani & Acrivos (1982), `cubic_expansion`, agrees to 0.1 %.
"""


def cubic_expansion(solid_fraction: float) -> float:
    """Drag factor of a dilute simple cubic array (Hasimoto 1959, continued by Sangani & Acrivos 1982).

    >>> [round(cubic_expansion(phi), 3) for phi in (0.001, 0.027, 0.125)]
    [1.212, 2.008, 4.289]
    """
    c = solid_fraction
    return 1.0 / (1.0 - 1.7601 * c ** (1 / 3) + c - 1.5593 * c**2 + 3.9799 * c ** (8 / 3) - 3.0734 * c ** (10 / 3))


def cubic_array(solid_fraction: float, diameter: float = 12.0, viscosity: float = 0.02) -> float:
    """Drag factor K of a simple cubic array in creeping flow: total force over 3 pi eta d U, U superficial."""
    cells = round(diameter * (math.pi / 6.0 / solid_fraction) ** (1.0 / 3.0))
    diameter = cells * (6.0 * solid_fraction / math.pi) ** (1.0 / 3.0)
    push = 1e-7
    flow = Flow((cells,) * 3, viscosity, force=(push, 0.0, 0.0))
    flow.place(np.full((1, 3), 0.5 * cells + 0.2), 0.5 * diameter)
    speed = _steady(flow, axis=0, change=1e-4)
    return push * cells**3 / (3.0 * math.pi * viscosity * diameter * speed)


def _steady(flow: Flow, axis: int, change: float, every: int = 200) -> float:
    """Mean velocity of the box once it changes by less than a share `change` in `every` steps."""
    still = np.zeros((len(flow.positions), 3))
    before = 0.0
    while True:
        for _ in range(every):
            flow.advance(still, still)
        now = float(flow.velocity()[axis].mean())
        if abs(now - before) < change * abs(now):
            return now
        before = now


def random_array(solid_fraction: float, reynolds: float, seed: int, diameter: int = 12) -> tuple[float, float]:
    """Fixed random spheres: Re_m that comes about after 12 d/w, and the drag factor F (as `closures.drag_resolved`)."""
    point = Point(2.0, solid_fraction, reynolds, seed, diameter=diameter)
    n = point.cells
    push = point.count * point.weight / n**3
    flow = Flow((n, n, n), point.viscosity, force=(0.0, 0.0, push))
    flow.place(random_arrangement(point), 0.5 * diameter)
    still = np.zeros((point.count, 3))
    turnover = round(diameter / point.slip)
    speeds = []
    for _ in range(12):
        for _ in range(turnover):
            flow.advance(still, still)
        speeds.append(float(flow.velocity()[2].mean()))
    speed = float(np.mean(speeds[-4:]))  # some arrays shed eddies
    voidage = 1.0 - point.count * sphere_volume(diameter) / n**3
    drag = voidage * push * n**3 / point.count
    return speed * diameter / point.viscosity, drag / (3.0 * math.pi * point.viscosity * diameter * speed)


def approach(gaps: Sequence[float], diameter: int = 12, viscosity: float = 0.1) -> list[float]:
    """Resistance of the grid to two spheres that approach, over 6 pi eta a, at gaps in cells.

    The spheres hold opposite velocities at frozen positions in a box of 3 x 3 x 4 d. Images shift the resistance by a
    constant that hardly depends on the gap: compare differences.
    """
    shape = (3 * diameter, 3 * diameter, 4 * diameter)
    flow, speed = Flow(shape, viscosity), 1e-4
    motion, still = np.array([[0.0, 0.0, speed], [0.0, 0.0, -speed]]), np.zeros((2, 3))
    forces = []
    for gap in gaps:
        middle = 0.5 * np.array(shape) + (0.2, 0.3, 0.1)
        lever = np.array([0.0, 0.0, 0.5 * (diameter + gap)])
        flow.place(np.array([middle - lever, middle + lever]), 0.5 * diameter)
        before, now = 0.0, 1.0
        while abs(now - before) > 1e-3 * now:
            for _ in range(100):
                flow.advance(motion, still)
            force = force_of(flow.sums(), motion, still)
            before, now = now, 0.5 * float(force[1, 2] - force[0, 2]) / (3.0 * math.pi * viscosity * diameter * speed)
        forces.append(now)
    return forces


def cubic_arrays() -> list[Row]:
    """Simple cubic arrays in creeping flow."""
    points = [(phi, cubic_array(phi), factor) for phi, factor in ZICK_HOMSY.items()]
    over = [(phi, drag / factor, 1.0) for phi, drag, factor in points]
    return [worst("cubic arrays, Re to 0: drag over Zick & Homsy", over, 0.03)]


def held_spheres() -> list[Row]:
    """One sphere in a stream."""
    return [
        Row(f"one sphere, Re {re:g}, box 8 d: drag over the standard drag", held_in_a_stream(re), 1.0, 0.05)
        for re in (20.0, 100.0)
    ]


def falling_spheres() -> list[Row]:
    """One sphere that falls in a closed box."""
    return [
        Row("ten Cate E1: fastest over measured", ten_cate("E1"), 1.0, 0.05),
        Row("ten Cate E3: fastest over measured", ten_cate("E3", speed=0.04), 1.0, 0.05),
    ]


def tumbling_spheres() -> list[Row]:
    """Two spheres one above the other draft, kiss and tumble."""
    fall = two_spheres()
    drafting, kissing, tumbling = fall.order
    note = f"drafting, kissing, tumbling at {drafting:.1f}, {kissing:.1f}, {tumbling:.1f} d/U"
    in_order = float(0.0 < drafting < kissing < tumbling)
    return [
        Row("two spheres draft, kiss and tumble in this order (1: yes)", in_order, 1.0, 0.0, note=note),
        Row("two spheres: deepest overlap over the diameter", max(-float(fall.gap.min()), 0.0), 0.0, 0.005),
    ]


def random_arrays() -> list[Row]:
    """Fixed random arrays at moderate Reynolds numbers."""
    rows = []
    for phi, reynolds, seed in ((0.36, 50.0, 1), (0.2, 50.0, 1), (0.36, 15.0, 2), (0.2, 15.0, 2)):
        mean_reynolds, factor = random_array(phi, reynolds, seed)
        name = f"fixed random array, solid fraction {phi:g}, Re {mean_reynolds:.0f}: drag over"
        rows.append(Row(f"{name} Tenneti et al.", factor / tenneti(mean_reynolds, 1.0 - phi), 1.0, 0.1))
        rows.append(Row(f"{name} Beetstra et al.", factor / beetstra(mean_reynolds, 1.0 - phi), 1.0))
    return rows


def approaching_spheres() -> list[Row]:
    """Two spheres that approach: grid and film together against the exact resistance."""
    gaps, diameter = (3.0, 2.0, 1.5, 1.0, 0.5, 0.25), 12
    grid = approach(gaps, diameter)
    exact = [approach_resistance(2.0 * gap / diameter) for gap in gaps]
    # force of the film at the speed of approach 2 U, over 6 pi eta a U
    films = [
        2.0 * unresolved_film(gap, 1.0, 0.25 * diameter, 2.0) / (3.0 * math.pi * diameter) if gap < 2.0 else 0.0
        for gap in gaps
    ]
    points = [
        (gap, (exact[0] + force - grid[0] + film) / right, 1.0)
        for gap, force, film, right in zip(gaps, grid, films, exact)
    ]
    return [worst("two spheres that approach: resistance of grid and film over the exact one", points[1:], 0.03)]


PARTS = (cubic_arrays, random_arrays, held_spheres, falling_spheres, tumbling_spheres, approaching_spheres)
"""The parts of the ladder."""


# ---------------------------------------------------------------- falling spheres


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
        flow, centre, diameter, ratio, (0.0, 0.0, -weight), Contacts(speed), box=(None, None, None)
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
    fall = Suspension(flow, pair, diameter, ratio, (0.0, 0.0, -weight), Contacts(speed))
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
