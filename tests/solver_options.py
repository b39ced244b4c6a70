"""Options of a particle solver in one row, as helpers of tests pass them on."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from cfddem.particles.solver import Sharing, SolverSettings


def grouped(**options: Any) -> dict[str, Any]:
    """Arguments of a :class:`~cfddem.particles.solver.ParticleSolver` from these and from fields of its structures.

    >>> grouped(gravity=(0.0, 0.0, -9.81), skin=1e-4)["settings"].skin
    0.0001
    """
    made: dict[str, Any] = {}
    for name, kind in (("settings", SolverSettings), ("sharing", Sharing)):
        own = {field.name: options.pop(field.name) for field in fields(kind) if field.name in options}
        made |= {name: kind(**own)} if own else {}
    return made | options
