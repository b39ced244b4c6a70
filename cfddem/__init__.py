"""CFD-DEM of spheres in a fluid, with lubrication films between close spheres."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if sys.flags.safe_path:  # as in every process that a command starts
    from cfddem.backend.working_folder import ignore_settings_files

    ignore_settings_files()

__version__ = "0.1.0"

if TYPE_CHECKING:  # type checkers do not call `__getattr__`
    from cfddem.analysis.report import report as report
    from cfddem.analysis.report_text import Report as Report
    from cfddem.backend.errors import CfddemError as CfddemError
    from cfddem.case.gallery import gallery as gallery
    from cfddem.case.materials import Fluid as Fluid
    from cfddem.case.materials import Material as Material
    from cfddem.case.schema import Case as Case
    from cfddem.data.fields import Field as Field
    from cfddem.fluid.grid import Grid as Grid
    from cfddem.fluid.solver import FluidSolver as FluidSolver
    from cfddem.io.reading import open_run as open_run
    from cfddem.model.feature import Equipment as Equipment
    from cfddem.model.feature import Feature as Feature
    from cfddem.model.feature import FluidForce as FluidForce
    from cfddem.model.feature import OwnForce as OwnForce
    from cfddem.particles.initial.pouring import pour as pour
    from cfddem.particles.interactions.bridge import coat as coat
    from cfddem.particles.interactions.bridge_law import BridgeLaws as BridgeLaws
    from cfddem.particles.interactions.laws import Laws as Laws
    from cfddem.particles.material_pairs import pair_table as pair_table
    from cfddem.particles.solver import ParticleSolver as ParticleSolver
    from cfddem.particles.state import make_particles as make_particles
    from cfddem.particles.walls.shapes import Box as Box
    from cfddem.particles.walls.shapes import Cone as Cone
    from cfddem.particles.walls.shapes import Cylinder as Cylinder
    from cfddem.particles.walls.shapes import Mesh as Mesh
    from cfddem.particles.walls.shapes import Plane as Plane
    from cfddem.preflight.summary import Preflight as Preflight
    from cfddem.run.check import check as check
    from cfddem.run.history import measure as measure
    from cfddem.run.runner import Run as Run
    from cfddem.run.simulation import Simulation as Simulation
    from cfddem.studies.notebook import run_case as run_case

_MODULES = {
    "Box": "cfddem.particles.walls.shapes",
    "BridgeLaws": "cfddem.particles.interactions.bridge_law",
    "coat": "cfddem.particles.interactions.bridge",
    "Case": "cfddem.case.schema",
    "check": "cfddem.run.check",
    "CfddemError": "cfddem.backend.errors",
    "Cone": "cfddem.particles.walls.shapes",
    "Cylinder": "cfddem.particles.walls.shapes",
    "Field": "cfddem.data.fields",
    "Fluid": "cfddem.case.materials",
    "Equipment": "cfddem.model.feature",
    "Feature": "cfddem.model.feature",
    "FluidForce": "cfddem.model.feature",
    "FluidSolver": "cfddem.fluid.solver",
    "gallery": "cfddem.case.gallery",
    "Grid": "cfddem.fluid.grid",
    "Laws": "cfddem.particles.interactions.laws",
    "Material": "cfddem.case.materials",
    "Mesh": "cfddem.particles.walls.shapes",
    "OwnForce": "cfddem.model.feature",
    "ParticleSolver": "cfddem.particles.solver",
    "Plane": "cfddem.particles.walls.shapes",
    "Preflight": "cfddem.preflight.summary",
    "Report": "cfddem.analysis.report_text",
    "report": "cfddem.analysis.report",
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
