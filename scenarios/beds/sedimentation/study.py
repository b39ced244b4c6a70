"""Hindered settling: the settling velocity falls with the solid fraction by the power law of Richardson and Zaki.

In a periodic box, a mean pressure gradient carries the weight of the suspension, as the floor of a vessel would, and
the spheres fall relative to the rising fluid. In a closed vessel, the fall of the upper boundary is measured. The
velocities at several solid fractions give the exponent.

`python -m scenarios.beds.sedimentation.study OUTPUT.png` runs the five suspensions (100 s) and draws them.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.measures import bed_height
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.plotting.curves import BLUE, GREY, label, legend, panels, save
from cfddem.run.simulation import Simulation
from closures.bed import exponent_richardson_zaki
from scenarios.beds.settling.study import unbounded

SOLID_FRACTIONS = (0.05, 0.1, 0.2, 0.3, 0.4)
SYRUP = 1.4e-2
"""Viscosity at which the spheres of the case settle with a Reynolds number below one [Pa s]."""

EDGE, HEIGHT = 16, 32
"""Width and height of the periodic box, in diameters; its cells have an edge of two."""

BOUNDARY = 0.95
"""Share of the spheres below the upper boundary; above, the suspension is too diffuse."""


NARROW: dict[str, Any] = {
    "column.width": 5e-3,
    "column.height": 25e-3,
    "column.sides": "periodic",
    "column.cell": 1.25e-3,
}
"""Changes that make the vessel ten diameters wide, without walls at its sides."""


@dataclass(frozen=True)
class Settling:
    """How fast a suspension settles."""

    solid_fraction: float
    velocity: float  # against the mixture, downward [m/s]
    terminal: float  # of a sphere alone, by the drag law of the run [m/s]


def vessel() -> Case:
    """The closed vessel of the case file."""
    return gallery()["sedimentation"]


def in_periodic_box(solid_fraction: float, *, viscosity: float | None = None, distance: float = 40.0) -> Settling:
    """Let the spheres of the case settle in a periodic box.

    solid_fraction  of the box [-]
    viscosity       of the fluid; the case's if not given [Pa s]
    distance        approximate settling distance in diameters; the first half is not averaged
    """
    case = vessel()
    diameter = case.bed.diameter
    count = round(solid_fraction * EDGE**2 * HEIGHT * 6.0 / math.pi)
    case = case.with_(
        **{
            "fluid.viscosity": viscosity or case.required_fluid.viscosity,
            "column": {
                "width": EDGE * diameter, "height": HEIGHT * diameter, "cell": 2.0 * diameter,
                "sides": "periodic", "ends": "periodic",
            },
            "bed.count": count,
        }
    )  # fmt: skip
    speed = unbounded(case)
    case = case.with_(**{"run.reference_speed": 0.5 * speed})
    simulation = Simulation(case)
    fluid, particles = simulation.fluid, simulation.particles
    solids = count * math.pi / 6.0 * diameter**3 / math.prod(fluid.grid.size)
    fluid.boundaries.driving[2] = solids * (case.solid.density - fluid.density) * abs(case.laws.gravity[2])
    end, rows = distance * diameter / (speed * (1.0 - solids) ** 3), 100
    falls = []
    for row in range(rows):
        simulation.until(end * (row + 1) / rows)
        rising = float((fluid.voidage * fluid.velocity[..., 2]).mean())
        falling = -float(particles.velocity[:, 2].mean())
        falls.append(falling - (solids * falling - rising))  # relative to the mixture, which moves in the box
    return Settling(solids, float(np.mean(falls[rows // 2 :])), speed)


def between_walls(solid_fraction: float, *, fall: float = 0.45, changes: Mapping[str, Any] | None = None) -> Settling:
    """Let the spheres of the case settle in the closed vessel.

    solid_fraction  at the start [-]
    fall            approximate fall of the boundary over the height; the first third is not fitted
    changes         to the case, such as :data:`NARROW`
    """
    case = vessel().with_(**(changes or {}))
    volume = math.pi / 6.0 * case.bed.diameter**3
    count = round(solid_fraction * math.prod(case.column.size) / volume)
    simulation = Simulation(case.with_(**{"bed.count": count}))
    particles, speed = simulation.particles, unbounded(case)
    solids = count * volume / math.prod(case.column.size)
    packed = 1.0 - solids / 0.58  # largest fall of the boundary over the height
    end, rows = min(fall, 0.7 * packed) * case.column.height / (speed * (1.0 - solids) ** 3), 90
    times, heights = [], []
    for row in range(rows):
        simulation.until(end * (row + 1) / rows)
        times.append(simulation.time)
        heights.append(bed_height(particles.position, particles.radius, BOUNDARY))
    fall, _ = np.polyfit(times[rows // 3 :], heights[rows // 3 :], 1)
    return Settling(solids, -float(fall), speed)


def exponent(settlings: Sequence[Settling]) -> tuple[float, float]:
    """Exponent n and velocity at no solids [m/s] of the power law through settling velocities, by least squares."""
    voidage = np.log([1.0 - settling.solid_fraction for settling in settlings])
    slope, intercept = np.polyfit(voidage, np.log([settling.velocity for settling in settlings]), 1)
    return float(slope), float(np.exp(intercept))


# ---------------------------------------------------------------- figure of hindered settling


def figure(settlings: Sequence[Settling], path: Path) -> None:
    """Velocities of suspensions over that of one sphere, on logarithmic axes, and two power laws."""
    case = vessel()
    terminal = settlings[0].terminal
    power, alone = exponent(settlings)
    reynolds = case.required_fluid.density * terminal * case.bed.diameter / case.required_fluid.viscosity
    published = exponent_richardson_zaki(reynolds, 0.0)
    drawn, axes = panels(width=6.5, height=4.2)
    voidage = np.linspace(0.55, 1.0, 50)
    axes.plot(
        voidage, alone / terminal * voidage**power, color=BLUE, label=f"power law through the points, n = {power:.3f}"
    )
    axes.plot(voidage, voidage**published, color=GREY, ls="--", label=f"Richardson and Zaki, n = {published:.3f}")
    points = [(1.0 - settling.solid_fraction, settling.velocity / terminal) for settling in settlings]
    axes.plot(*np.transpose(points), "o", color=BLUE, ms=7, label="runs in a periodic box")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks([0.6, 0.7, 0.8, 0.9, 1.0], ["0.6", "0.7", "0.8", "0.9", "1"])
    axes.set_yticks([0.2, 0.3, 0.5, 0.7, 1.0], ["0.2", "0.3", "0.5", "0.7", "1"])
    axes.minorticks_off()
    label(axes, "voidage", "-", "settling velocity over that of one sphere", "-")
    legend(axes, loc="upper left")
    save(drawn, path)


if __name__ == "__main__":
    suspensions = [in_periodic_box(share, distance=24.0) for share in SOLID_FRACTIONS]
    figure(suspensions, Path(sys.argv[1] if len(sys.argv) > 1 else "sedimentation.png"))
