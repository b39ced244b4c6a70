"""A run folder with a synthetic record, written in a moment."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.io.folder import provenance
from cfddem.io.quantities import Quantity, of_fields
from cfddem.io.writer import RunFolder
from cfddem.particles.state import PARTICLE_FIELDS
from cfddem.run.history import all_columns

BED = """
title = "Beads <in> water & more"
[fluid]
density = 1000.0
viscosity = 1e-3
[material.glass]
density = 2500.0
youngs_modulus = 60e9
contact_modulus = 1e7
poisson = 0.25
[column]
width = 0.02
height = 0.06
cell = 0.005
sides = "free_slip"
[bed]
diameter = 2e-3
count = 2000
inlet_velocity = 0.05
[run]
until = 2.0
average_from = 1.0
[laws]
agitation = "none"
"""
WEIGHT = 2000 * math.pi / 6.0 * 8e-9 * 1500.0 * 9.81 / 0.02**2
"""Buoyant, over the floor [Pa]."""
OF_THE_FLUID = (
    "bed_voidage", "bed_voidage_from_pressure", "pressure_drop", "momentum_imbalance", "volume_imbalance",
    "out_of_range_count",
)  # fmt: skip


def quantities(case: Case) -> dict[str, dict[str, Quantity]]:
    fluid = {"voidage": Quantity("1", "voidage"), "velocity": Quantity("m/s", "velocity")}
    return {"history": all_columns(case), "particles": of_fields(PARTICLE_FIELDS), "fluid": fluid}


def made_up(folder: Path, text: str = BED, rows: int = 401, trend: float = 0.0, **constant: float) -> Path:
    """A synthetic run: the pressure drop carries the weight, the voidage is 0.6, with noise of known strength.

    constant  columns of the history that keep a value
    """
    case = Case.from_text(text)
    grid = grid_of(case)
    wet = case.fluid is not None
    run = RunFolder.create(folder, text, provenance(1), grid if wet else None, quantities(case))
    noise = np.random.default_rng(2).normal(size=(3, rows))
    for k, time in enumerate(np.linspace(0.0, 2.0, rows)):
        row = {
            "time": time,
            "fluid_steps": 10.0 * k,
            "bed_height": 0.04 + 1e-4 * noise[0, k] + trend * time,
            "bed_voidage": 0.6 + 1e-3 * noise[1, k],
            "bed_voidage_from_pressure": math.nan,
            "pressure_drop": WEIGHT * (1.0 + 0.01 * noise[2, k]),
            "granular_temperature": 1e-4,
            "largest_speed": 0.1,
            "contact_count": 7.0,
            "particle_count": 2000.0,
            "momentum_imbalance": math.nan if k == 0 else 1e-15,
            "volume_imbalance": 1e-9,
            "out_of_range_count": 2000.0 * k,
        } | constant
        if "film_step_count" in all_columns(case):
            row |= {"film_step_count": 50.0 * k, "film_iteration_count": 60.0 * k + 1.0, "film_damping_number": k / 4.0}
        run.append_history({name: value for name, value in row.items() if wet or name not in OF_THE_FLUID})
        if k % 100 == 0:
            fluid = {"voidage": np.full(grid.shape, 0.6)} if wet else None
            particles = {
                "position": 0.01 + 0.001 * np.eye(3), "velocity": np.eye(3), "radius": np.full(3, 1e-3),
                "id": np.arange(3),
            }  # fmt: skip
            run.write_snapshot(time, 100 * k, fluid, particles)
    run.note("wall_time", {"fluid": 3.0, "particles": 5.0})
    run.finish("finished")
    return folder
