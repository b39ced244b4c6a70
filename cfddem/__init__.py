"""Spheres in a fluid, with the thin film between them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "Box": "cfddem.particles.walls",
    "BridgeLaws": "cfddem.particles.bridge_loops",
    "Bridges": "cfddem.particles.bridges",
    "Case": "cfddem.case",
    "CfddemError": "cfddem.errors",
    "Cone": "cfddem.particles.walls",
    "Cylinder": "cfddem.particles.walls",
    "Fluid": "cfddem.materials",
    "FluidSolver": "cfddem.fluid.solver",
    "Grid": "cfddem.fluid.grid",
    "Laws": "cfddem.particles.forces",
    "Material": "cfddem.materials",
    "Mesh": "cfddem.particles.walls",
    "ParticleSolver": "cfddem.particles.solver",
    "Plane": "cfddem.particles.walls",
    "Simulation": "cfddem.simulation",
    "bodies": "cfddem.particles.state",
    "open_run": "cfddem.record.reading",
    "pair_table": "cfddem.materials",
    "pour": "cfddem.particles.pouring",
}
__all__ = ["__version__", *sorted(_HOME)]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for, so that `import cfddem` costs nothing."""
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'cfddem' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
