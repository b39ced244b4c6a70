"""The unresolved model in the box of a resolved run, measured in the same way.

The mean flow is uniform: the filter kernel is as wide as half of the box, so that all spheres see the same mean
velocity and voidage, and no wave of the box grows. Agitation comes from the closure alone; drag, contacts and films
dissipate it. Spheres, contacts, density ratio, solid fraction, mean slip and mean drag are those of the resolved run.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from cfddem.case.schema import Case
from cfddem.run.simulation import Simulation
from closures.drag_resolved import tenneti
from scenarios.references.resolved_suspension.impacts import new_impacts
from scenarios.references.resolved_suspension.measures import Series, measure
from scenarios.references.resolved_suspension.suspension import OVERLAP, Point, random_arrangement

DIAMETER, SLIP, DENSITY = 1e-3, 0.05, 1000.0
"""Diameter [m], mean slip [m/s] and fluid density [kg/m3] of the case; results are made dimensionless by them."""

SAMPLES, LOOKS = 16, 4
"""Samples within d/w, and looks for new contacts within each; more looks find no more contacts."""


def case_of(point: Point, row: dict[str, Any], **changes: Any) -> Case:
    """Case of the box of a resolved run.

    row      of the resolved run: its Reynolds number and its mean drag
    changes  further keys of the case
    """
    phi, d = row["solid_fraction"], DIAMETER
    viscosity = (1.0 - phi) * DENSITY * SLIP * d / row["reynolds"]
    volume, excess = math.pi / 6.0 * d**3, (point.density_ratio - 1.0) * DENSITY
    weight = 3.0 * math.pi * viscosity * d * row["drag_factor"] * SLIP
    reduced_mass, reduced_radius = 0.5 * point.density_ratio * DENSITY * volume, 0.25 * d
    reduced_modulus = 15.0 / 16.0 * reduced_mass * SLIP**2 / (math.sqrt(reduced_radius) * (OVERLAP * d) ** 2.5)
    modulus = 2.0 * reduced_modulus * (1.0 - 0.25**2)
    side = point.box * d
    places = random_arrangement(point) * (d / point.diameter) % side
    case = Case(
        fluid={"density": DENSITY, "viscosity": viscosity},
        material={
            "sphere": {
                "density": point.density_ratio * DENSITY,
                "youngs_modulus": 1e9 * modulus,
                "contact_modulus": modulus,
                "poisson": 0.25,
                "restitution": point.restitution,
                "friction": point.friction,
                "roughness": point.roughness * d,
            }
        },
        column={"width": side, "height": side, "cell": side / 3.0, "sides": "periodic", "ends": "periodic"},
        bed={"diameter": d, "start": "placed", "positions": [tuple(each) for each in places.tolist()]},
        laws={
            "drag": "tenneti",
            "agitation": "free_spheres",
            "self_disturbance_correction": False,
            "kernel_width": 0.5 * point.box,
            "gravity": (0.0, 0.0, -weight / (volume * excess)),
        },
        run={"until": 1e3, "reference_speed": SLIP},
    )
    return case.with_(**changes)


def run(row: dict[str, Any], *, settle: float = 10.0, until: float = 60.0, **changes: Any) -> dict[str, Any]:
    """Run the unresolved model in the box of a resolved run, and measure it in the same way.

    row            of the resolved run
    settle, until  time that is dropped, and end of the run [d/w]
    changes        further keys of the case
    """
    point = replace(Point(**row["point"]), reynolds=row["reynolds"])
    case = case_of(point, row, **changes)
    simulation = Simulation(case)
    ratio = row["drag_factor"] / tenneti(row["reynolds"], 1.0 - row["solid_fraction"])
    _hold_drag(simulation, ratio)
    fluid, particles = simulation.required_fluid, simulation.particles
    excess = (point.density_ratio - 1.0) * DENSITY
    fluid.boundaries.driving[2] = row["solid_fraction"] * excess * -case.laws.gravity[2]
    fluid.set_velocity((0.0, 0.0, SLIP))
    series = Series(round(point.diameter / point.slip / SAMPLES))
    touching = np.zeros(0, np.int64)
    for sample in range(round(SAMPLES * until)):
        hits, impact = 0.0, 0.0
        for look in range(LOOKS):
            velocity = particles.velocity[np.argsort(particles.id)]
            simulation.until((sample + (look + 1) / LOOKS) / SAMPLES * DIAMETER / SLIP)
            touching, speeds = new_impacts(simulation.particle_solver, velocity, touching)
            hits, impact = hits + len(speeds), impact + float(speeds.sum())
        _note(series, simulation, point, hits, impact)
    return measure(point, series, settle, weight=ratio * point.weight)


def _hold_drag(simulation: Simulation, ratio: float) -> None:
    """Multiply the drag law, so that the mean drag is that of the resolved run."""
    drag = simulation.forces["drag"]
    law = drag.conductance
    drag.conductance = lambda particles, flow: ratio * law(particles, flow)


def _note(series: Series, simulation: Simulation, point: Point, hits: float, impact: float) -> None:
    """Add a sample, in units of the lattice."""
    fluid, particles = simulation.required_fluid, simulation.particles
    order = np.argsort(particles.id)
    length, speed = point.diameter / DIAMETER, point.slip / SLIP
    weight = (particles.mass - fluid.density * particles.volume)[:, None] * np.array(simulation.case.laws.gravity)
    voidage = fluid.voidage[..., None]
    flow = (voidage * fluid.velocity).sum(axis=(0, 1, 2)) / voidage.sum()
    series.slip.append((flow - particles.velocity.mean(axis=0)) * speed)
    series.force.append((particles.applied - weight)[order] * (length * speed) ** 2 / DENSITY)
    series.velocity.append(particles.velocity[order] * speed)
    series.position.append(particles.position[order] * length)
    series.collisions.append(hits)
    series.impact.append(impact * speed)
