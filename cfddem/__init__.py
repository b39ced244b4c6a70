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
    from cfddem.case.feature_table import FeatureTable as FeatureTable
    from cfddem.case.gallery import gallery as gallery
    from cfddem.case.materials import Fluid as Fluid
    from cfddem.case.materials import Material as Material
    from cfddem.case.schema import Case as Case
    from cfddem.coupling.coupling import Coupling as Coupling
    from cfddem.coupling.forces.drag import Drag as Drag
    from cfddem.coupling.forces.pressure import PressureForce as PressureForce
    from cfddem.coupling.forces.pressure import Weight as Weight
    from cfddem.coupling.kernel import FilterKernel as FilterKernel
    from cfddem.fluid.conditions import FreeSlip as FreeSlip
    from cfddem.fluid.conditions import Inlet as Inlet
    from cfddem.fluid.conditions import NoSlip as NoSlip
    from cfddem.fluid.conditions import Outlet as Outlet
    from cfddem.fluid.conditions import Periodic as Periodic
    from cfddem.fluid.grid import Grid as Grid
    from cfddem.fluid.solver import FluidSolver as FluidSolver
    from cfddem.fluid.solver import Scheme as Scheme
    from cfddem.io.reading import open_run as open_run
    from cfddem.model.feature import Equipment as Equipment
    from cfddem.model.feature import Feature as Feature
    from cfddem.model.feature import FluidForce as FluidForce
    from cfddem.model.feature import OwnForce as OwnForce
    from cfddem.model.fields import Field as Field
    from cfddem.particles.initial.pouring import pour as pour
    from cfddem.particles.interactions.bridge import coat as coat
    from cfddem.particles.interactions.bridge_law import BridgeLaws as BridgeLaws
    from cfddem.particles.interactions.laws import Laws as Laws
    from cfddem.particles.material_pairs import pair_table as pair_table
    from cfddem.particles.solver import ParticleSolver as ParticleSolver
    from cfddem.particles.solver import SolverSettings as SolverSettings
    from cfddem.particles.state import make_particles as make_particles
    from cfddem.particles.walls.meshes import Mesh as Mesh
    from cfddem.particles.walls.shapes import Box as Box
    from cfddem.particles.walls.shapes import Cone as Cone
    from cfddem.particles.walls.shapes import Cylinder as Cylinder
    from cfddem.particles.walls.shapes import Plane as Plane
    from cfddem.preflight.summary import Preflight as Preflight
    from cfddem.run.check import check as check
    from cfddem.run.history import measure as measure
    from cfddem.run.runner import Run as Run
    from cfddem.run.simulation import Simulation as Simulation
    from cfddem.run.time_steps import StepSettings as StepSettings
    from cfddem.studies.notebook import run_case as run_case
    from cfddem.studies.sweep import open_sweep as open_sweep

_MODULES = {
    "Box": "cfddem.particles.walls.shapes",
    "BridgeLaws": "cfddem.particles.interactions.bridge_law",
    "Case": "cfddem.case.schema",
    "CfddemError": "cfddem.backend.errors",
    "check": "cfddem.run.check",
    "coat": "cfddem.particles.interactions.bridge",
    "Cone": "cfddem.particles.walls.shapes",
    "Coupling": "cfddem.coupling.coupling",
    "Cylinder": "cfddem.particles.walls.shapes",
    "Drag": "cfddem.coupling.forces.drag",
    "Equipment": "cfddem.model.feature",
    "Feature": "cfddem.model.feature",
    "FeatureTable": "cfddem.case.feature_table",
    "Field": "cfddem.model.fields",
    "FilterKernel": "cfddem.coupling.kernel",
    "Fluid": "cfddem.case.materials",
    "FluidForce": "cfddem.model.feature",
    "FluidSolver": "cfddem.fluid.solver",
    "FreeSlip": "cfddem.fluid.conditions",
    "gallery": "cfddem.case.gallery",
    "Grid": "cfddem.fluid.grid",
    "Inlet": "cfddem.fluid.conditions",
    "Laws": "cfddem.particles.interactions.laws",
    "make_particles": "cfddem.particles.state",
    "Material": "cfddem.case.materials",
    "measure": "cfddem.run.history",
    "Mesh": "cfddem.particles.walls.meshes",
    "NoSlip": "cfddem.fluid.conditions",
    "open_run": "cfddem.io.reading",
    "open_sweep": "cfddem.studies.sweep",
    "Outlet": "cfddem.fluid.conditions",
    "OwnForce": "cfddem.model.feature",
    "pair_table": "cfddem.particles.material_pairs",
    "ParticleSolver": "cfddem.particles.solver",
    "Periodic": "cfddem.fluid.conditions",
    "Plane": "cfddem.particles.walls.shapes",
    "pour": "cfddem.particles.initial.pouring",
    "Preflight": "cfddem.preflight.summary",
    "PressureForce": "cfddem.coupling.forces.pressure",
    "Report": "cfddem.analysis.report_text",
    "report": "cfddem.analysis.report",
    "Run": "cfddem.run.runner",
    "run_case": "cfddem.studies.notebook",
    "Scheme": "cfddem.fluid.solver",
    "Simulation": "cfddem.run.simulation",
    "SolverSettings": "cfddem.particles.solver",
    "StepSettings": "cfddem.run.time_steps",
    "Weight": "cfddem.coupling.forces.pressure",
}
__all__ = ["__version__", *sorted(_MODULES)]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that `import cfddem` takes no time."""
    if name in _MODULES:
        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module 'cfddem' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(["__doc__", "__file__", "__name__", *__all__])
