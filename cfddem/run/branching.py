"""A new run that begins where another one has ended, with other values of its case: what may change, and the state."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.comparison import changed
from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.io import checkpoint
from cfddem.run.resuming import case_to_continue

CHANGEABLE = (
    "title", "compare.*", "bed.inlet_velocity", "bed.seed", "fluid.viscosity", "fluid.viscosity_profile",
    "heat.inlet_temperature", "heat.wall_temperature.*", "run.until", "run.every", "run.history_every",
    "run.average_from", "run.until_error.*", "run.particle_step", "run.fluid_step", "run.reference_speed",
    *(f"{table}.{key}" for table in ("material.NAME", "pair.NAME.NAME") for key in (
        "youngs_modulus", "contact_modulus", "poisson", "restitution", "friction", "rolling_friction",
        "friction_lubricated", "roughness",
    )),
    "laws.drag", "laws.agitation", "laws.gravity", "laws.lift", "laws.torque", "laws.viscous_stress", "laws.convection",
    "laws.contact_parameters.*",
)  # fmt: skip
"""Keys whose values the state of a run does not hold, or holds in a field that is made anew."""

_CHANGEABLE = re.compile(
    "|".join(re.escape(key).replace("NAME", r"[^.]+").replace(r"\.\*", r"(\..*)?") for key in CHANGEABLE)
)


def branch_state(case: Case, origin: Path) -> dict[str, Any]:
    """The newest checkpoint of a run, as the state with which another case begins.

    errors  InputError for a run without a checkpoint, a key that cannot change within a run, or an end before the state
    """
    state = checkpoint.newest(origin)
    before = case_to_continue(origin, None, None)
    for key in changed([before, case]):
        if not _CHANGEABLE.fullmatch(key):
            others = ", ".join(each for each in CHANGEABLE if each.startswith(f"{key.split('.')[0]}."))
            remedy = f"of this table, {others} can change" if others else "run the changed case from its beginning"
            raise InputError(key, None, f"left as it is in {origin}, whose state depends on it", remedy)
    was, now = (each.agitation if isinstance(each.agitation, str) else each.agitation.name for each in (before, case))
    if was != now:
        limit = f"{was!r}, as in {origin}"
        raise InputError("laws.agitation", now, limit, f"name it where it is auto: --set laws.agitation={was}")
    try:
        time = float(state["time"])
        if case.run.until > time:
            _adapt(state["simulation"], case, before)
    except (KeyError, IndexError, TypeError, ValueError) as failure:
        remedy = "its checkpoint does not fit; run the case from its beginning"
        raise InputError("--from", str(origin), "a run of this version of cfddem", remedy) from failure
    if not case.run.until > time:
        remedy = "time goes on: --set run.until=END"
        raise InputError("run.until", case.run.until, f"above {time:.6g} s, where {origin} has ended", remedy)
    return state


def _adapt(parts: dict[str, Any], case: Case, before: Case) -> None:
    """Change what the state of a simulation holds of the values of its case."""
    parts["particle_step"] = None  # that of the new stiffness
    parts["particles"]["counters"]["accepted"] = 0.0
    if case.fluid != before.fluid:  # neither of them lacks one
        cells, particles = parts["fluid"]["viscosity"], parts["particles"]["particles"]
        fluid = case.required_fluid
        cells[:] = np.broadcast_to(fluid.viscosity_at(grid_of(case).centres()[2]), cells.shape)
        particles["viscosity"][:] = fluid.viscosity_at(particles["position"][:, 2])
