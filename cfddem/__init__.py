"""CFD-DEM of spheres in a fluid, with lubrication films between close spheres."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

if sys.flags.safe_path:  # as in every process that a command starts
    from cfddem.backend.working_folder import ignore_settings_files

    ignore_settings_files()

__version__ = "0.1.0"

_MODULES = {
    "Box": "cfddem.particles.walls.shapes",
    "BridgeLaws": "cfddem.particles.interactions.bridge_law",
    "coat": "cfddem.particles.interactions.bridge",
    "Case": "cfddem.case.schema",
    "CfddemError": "cfddem.backend.errors",
    "Cone": "cfddem.particles.walls.shapes",
    "Cylinder": "cfddem.particles.walls.shapes",
    "Field": "cfddem.data.fields",
    "Fluid": "cfddem.case.materials",
    "Equipment": "cfddem.model.feature",
    "Feature": "cfddem.model.feature",
    "FluidForce": "cfddem.model.feature",
    "FluidSolver": "cfddem.fluid.solver",
    "Grid": "cfddem.fluid.grid",
    "Laws": "cfddem.particles.interactions.laws",
    "Material": "cfddem.case.materials",
    "Mesh": "cfddem.particles.walls.shapes",
    "OwnForce": "cfddem.model.feature",
    "ParticleSolver": "cfddem.particles.solver",
    "Plane": "cfddem.particles.walls.shapes",
    "Run": "cfddem.run.runner",
    "Simulation": "cfddem.run.simulation",
    "make_particles": "cfddem.particles.state",
    "measure": "cfddem.run.history",
    "open_run": "cfddem.io.reading",
    "pair_table": "cfddem.particles.material_pairs",
    "run_case": "cfddem.studies.notebook",
    "pour": "cfddem.particles.initial.pouring",
}
__all__ = ["__version__", *sorted(_MODULES)]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that `import cfddem` takes no time."""
    if name in _MODULES:
        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module 'cfddem' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_MODULES])
