"""Steps of resuming a run, or of beginning one where another has ended: case, state, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.comparison import changed
from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.case.toml_text import parse, read_text
from cfddem.io import checkpoint
from cfddem.io.writer import RunFolder
from cfddem.run import history
from cfddem.run.simulation import Simulation
from closures.registry import REGISTRY, load_package_laws


def require_forward(until: float | None, state: Mapping[str, Any] | None) -> None:
    """Refuse an end [s] before the time of a checkpoint."""
    if state is not None and until is not None and until < state["time"]:
        limit = f"at least {state['time']:.6g} s, the time of the run"
        raise InputError("until", until, limit, "a run only continues forward")


@contextmanager
def status_restored_on_refusal(written: RunFolder, before: Mapping[str, Any]) -> Iterator[None]:
    """Give a folder its earlier status back if the run in it cannot be continued.

    before  `run.json` as it was
    """
    try:
        yield
    except InputError:
        if before["status"] != "running":
            written.finish(before["status"], before["message"])
        raise


def case_to_continue(folder: Path, state: Mapping[str, Any] | None, until: float | None) -> Case:
    """The case of a folder, with the intervals of a checkpoint and perhaps a new end [s].

    errors  InputError if its laws or tables are not known here
    """
    overrides = ({} if state is None else state["overrides"]) | (
        {} if until is None else {"run.until": until, "run.until_error": {}}
    )
    path = folder / "case.toml"
    text = read_text(path)
    case = Case.from_text(text, str(path), overrides, finished=True)
    for table in sorted(parse(text, str(path)).keys() - Case.model_fields.keys()):
        remedy = f"resume it with the file that declares the table: cfddem resume {folder} --laws FILE.py"
        raise InputError(table, None, "a table that is known here", remedy)
    for key, name in case.laws.missing.items():
        if name in REGISTRY.get(key, {}):
            return Case.from_toml(path, overrides)  # it says why the law cannot be used
        lost = [f"; the package {each} could not be loaded: {why}" for each, why in load_package_laws().items()]
        remedy = (
            f"resume it with the file that declares the law: cfddem resume {folder} --laws FILE.py; or install its "
            f"package; or import it in Python and call cfddem.Run.resume{''.join(lost)}"
        )
        raise InputError(f"laws.{key}", name, "a law that is known here", remedy)
    return case.with_files_of(folder)


def restored(
    case: Case,
    state: Mapping[str, Any],
    folder: Path,
    communicator: Communicator,
    **given: Any,
) -> Simulation:
    """The simulation of a checkpoint; InputError if the checkpoint does not fit.

    given  fields, callbacks and features of the simulation
    """
    try:
        simulation = Simulation.restored(case, state["simulation"], communicator=communicator, **given)
    except (KeyError, IndexError, TypeError) as failure:
        remedy = f"its checkpoint does not fit; run {folder}/case.toml again in another folder"
        raise InputError("folder", str(folder), "a run of this version of cfddem", remedy) from failure
    return simulation


def require_measures(written: RunFolder, case: Case) -> None:
    """Refuse to continue a history with other measures than it began with."""
    before, now = {*written.last_row}, {*history.all_columns(case)}
    if before and (odd := sorted((before - now) | (now - {*written.quantities["history"]}))):
        remedy = "resume the run from the script that declares them"
        raise InputError("measures", odd, "the same as when the run began", remedy)


# ---------------------------------------------------------------- a new run from the end of another


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
