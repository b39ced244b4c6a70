"""Packed beds on a lattice: Schumann's solution, and beds of drops and of wet beads that dry."""

from __future__ import annotations

from typing import Any

import numpy as np

from cfddem.case.schema import Case
from cfddem.features.evaporation_keys import Evaporation
from cfddem.features.vapour import Vapour
from cfddem.run.history import row
from cfddem.run.simulation import Simulation
from closures.evaporation import latent_heat
from scenarios.beds.packed_bed_heating import heating
from scenarios.validation.heat.spheres import with_changes
from scenarios.validation.table import Curves, Row

HEAT: dict[str, Any] = {
    "particle_temperature": 400.0,
    "fluid_temperature": 300.0,
    "conductivity": 0.026,
    "fluid_heat_capacity": 1000.0,
    "heat_capacity": {"glass": 800.0},
}

DENSITY, WIDTH, SPEED = 1.2, 8e-3, 1.0
"""Of the air [kg/m3], of the column [m], of the air that dries [m/s]."""


def lattice(spacing: float, counts: tuple[int, int, int]) -> list[tuple[float, float, float]]:
    """Centres of spheres on a cubic lattice [m]."""
    x, y, z = (spacing * (np.arange(n) + 0.5) for n in counts)
    return [(float(a), float(b), float(c)) for c in z for b in y for a in x]


def packed(**changes: Any) -> Case:
    """A packed bed of 2 mm spheres in air, on a lattice; changes with __ for the point."""
    values: dict[str, Any] = {
        "fluid": {"density": DENSITY, "viscosity": 1.8e-5},
        "material.glass": {"density": 2500.0, "youngs_modulus": 1e6, "poisson": 0.25, "friction": 0.3},
        "column": {"width": WIDTH, "height": 0.048, "cell": 0.004, "sides": "free_slip"},
        "bed": {"diameter": 2e-3, "positions": lattice(2e-3, (4, 4, 20)), "inlet_velocity": 0.5, "fixed": True},
        "laws": {"drag": "gidaspow_smooth", "lubrication": "none", "agitation": "none"},
        "run": {"until": 1.0, "reference_speed": 1.0},
        "heat": HEAT,
    }
    return with_changes(values, changes)


def schumann(curves: Curves) -> list[Row]:
    """A packed bed that cools, beside Schumann's solution: cells of 0.27 transfer units, no filter."""
    layers = 120
    case = packed(
        column__height=layers * 2e-3, bed__positions=lattice(2e-3, (4, 4, layers)), bed__inlet_velocity=SPEED,
        laws__kernel_width=0.0,
        heat=HEAT | {
            "fluid_temperature": 400.0, "inlet_temperature": 300.0, "heat_capacity": {"glass": 5.0},
            "conductivity": 0.01,
        },
    )  # fmt: skip
    rows = []
    for profile in heating(case, (0.5, 0.8, 1.1)):
        rows.append(Row(f"Schumann's bed at {profile.time:g} s: largest error of a layer", profile.error, 0.0, 0.01))
        rows.append(Row(f"Schumann's bed at {profile.time:g} s: mean error", profile.mean_error, 0.0))
        curves[f"schumann/{profile.time:g} s"] = {
            "height": (profile.height, "m"), "solids": (profile.solids, "-"), "exact": (profile.exact_solids, "-"),
        }  # fmt: skip
    return rows


def wet_bed(layers: int, **changes: Any) -> Case:
    """Drops of 2 mm on a lattice in air of 320 K, which enters with a little vapour."""
    return packed(
        material__glass__density=998.0, bed__positions=lattice(4e-3, (2, 2, layers)), bed__inlet_velocity=SPEED,
        heat={
            "particle_temperature": 298.0, "fluid_temperature": 320.0, "conductivity": 0.027,
            "fluid_heat_capacity": 1007.0, "heat_capacity": {"glass": 420.0},
        },
        vapour={"fluid_fraction": 0.005, "diffusivity": 2.8e-5}, evaporation={"drops": ["glass"]},
        laws__kernel_width=0.0, **changes,
    )  # fmt: skip


def wet_beads() -> Case:
    """One layer of beads with a film of water in the same air."""
    film = {"viscosity": 1e-3, "surface_tension": 0.07, "thickness": 3e-6}
    return wet_bed(1, liquid=film).with_(**{"evaporation": {}, "heat.particle_temperature": 294.0})


def by_air(simulation: Simulation) -> float:
    """Rate of drying of a wet bed by the air that leaves [kg/s]."""
    return DENSITY * SPEED * WIDTH**2 * (simulation.feature(Vapour).cells.leaving - 0.005)


def _wet_bulb(case: Case) -> float:
    keys = Evaporation.of(case)
    assert keys is not None
    return keys.wet_bulb(case)


def wet_drops(curves: Curves) -> list[Row]:
    """Ten layers of drops: rate, heat, and temperature of the first layer."""
    simulation = Simulation(wet_bed(10))
    simulation.until(3.0)
    then = row(simulation)
    simulation.until(3.5)
    now, particles = row(simulation), simulation.particles
    rate = (now["evaporated_mass"] - then["evaporated_mass"]) / 0.5
    cooled = DENSITY * SPEED * WIDTH**2 * 1007.0 * (320.0 - now["outlet_temperature"])
    first = float(particles.temperature[particles.position[:, 2] < 3e-3].mean())
    latent = latent_heat(float(particles.temperature.mean()))
    lost = max(now[f"{name}_imbalance"] for name in ("heat", "vapour"))
    return [
        Row("bed of drops: rate of drying over that of the air that leaves", rate / by_air(simulation), 1.0, 0.01),
        Row("bed of drops: latent heat over the heat of the air", latent * rate / cooled, 1.0, 0.01),
        Row("bed of drops: lowest layer, wet bulb", first, _wet_bulb(simulation.case), 0.3, "K"),
        Row("bed of drops: imbalance of heat and vapour", lost, 0.0, 1e-10),
    ]


def dried_beads(curves: Curves) -> list[Row]:
    """A layer of beads with films, until it is dry: rate, plateau, and end."""
    simulation = Simulation(wet_beads())
    particles, times, water, warm = simulation.particles, [], [], []
    simulation.until(0.6)
    begin, then = simulation.time, row(simulation)
    whole = then["liquid_on_particles"]
    simulation.until(0.8)
    now = row(simulation)
    rate = (now["evaporated_mass"] - then["evaporated_mass"]) / (simulation.time - begin)
    leaves, plateau = by_air(simulation), float(particles.temperature.mean())
    end = simulation.time + 998.0 * float(particles.liquid.sum()) / leaves
    while particles.liquid.sum() > 1e-4 * whole and simulation.time < 10.0:
        simulation.step()
        times.append(simulation.time)
        water.append(float(particles.liquid.sum()))
        warm.append(float(particles.temperature.mean()))
    curves["dried beads"] = {"time": (times, "s"), "liquid": (water, "m3"), "temperature": (warm, "K")}
    now = row(simulation)
    lost = max(now[f"{name}_imbalance"] for name in ("heat", "vapour", "liquid"))
    return [
        Row("layer of wet beads: rate of drying over that of the air that leaves", rate / leaves, 1.0, 0.01),
        Row("layer of wet beads: plateau, wet bulb", plateau, _wet_bulb(simulation.case), 0.3, "K"),
        Row("layer of wet beads: end of drying over that of the balance", simulation.time / end, 1.0, 0.02),
        Row("layer of wet beads: imbalance of heat, vapour and liquid", lost, 0.0, 1e-10),
    ]
