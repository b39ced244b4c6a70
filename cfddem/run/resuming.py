"""Steps of resuming a run, or of beginning one where another has ended: case, state, and what is refused."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.comparison import changed
from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import check_compiles, fingerprint
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.case.toml_text import parse, read_text
from cfddem.io import checkpoint
from cfddem.io.folder import read_about
from cfddem.io.writer import RunFolder
from cfddem.run import history
from cfddem.run.simulation import Simulation
from closures.registry import GROUP, REGISTRY, load_package_laws

LARGE = (
    *(f"simulation/particles/{name}" for name in ("particles", "origin", "pairs", "bodies", "touch", "touch_bodies")),
    "simulation/fluid",
)  # fmt: skip
"""Entries of a checkpoint that grow with particles and cells; several ranks read them in portions."""


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
        lost = [f"; the package {package} could not be loaded: {why}" for package, why in load_package_laws().items()]
        remedy = (
            f"resume it with the file that declares the law: cfddem resume {folder} --laws FILE.py; or install its "
            f"package; or import it in Python and call cfddem.Run.resume{''.join(lost)}"
        )
        raise InputError(f"laws.{key}", name, "a law that is known here", remedy)
    return case.with_files_of(folder)


def restored(
    case: Case, state: Mapping[str, Any], folder: Path, communicator: Communicator, **arguments: Any
) -> Simulation:
    """The simulation of a checkpoint; InputError if the checkpoint does not fit.

    given  fields, callbacks and features of the simulation
    """
    try:
        simulation = Simulation.restored(case, state["simulation"], communicator=communicator, **arguments)
    except InputError:  # a ValueError that has its own words
        raise
    except (KeyError, IndexError, TypeError, ValueError) as failure:
        remedy = f"its checkpoint does not fit; run {folder}/case.toml again in another folder"
        raise InputError("folder", str(folder), "a run of this version of cfddem", remedy) from failure
    return simulation


def require_measures(written: RunFolder, case: Case) -> None:
    """Refuse to continue a history with other measures than it began with."""
    before, now = {*written.last_row}, {*history.all_columns(case)}
    if before and (odd := sorted((before - now) | (now - {*written.quantities.get("history", {})}))):
        remedy = "resume the run from the script that declares them"
        raise InputError("measures", odd, "the same as when the run began", remedy)


# ---------------------------------------------------------------- a new run from the end of another


CHANGEABLE = (
    "title", "compare.*", "bed.inlet_velocity", "bed.seed", "fluid.viscosity", "fluid.viscosity_profile",
    "bed.jet.velocity", "heat.inlet_temperature", "heat.outlet_temperature", "heat.wall_temperature.*",
    "heat.patch_temperature.*", "vapour.inlet_fraction", "vapour.outlet_fraction", "vapour.patch_fraction.*",
    "patch.NAME.velocity", "patch.NAME.mass_flow", "run.until", "run.every", "run.history_every",
    "run.average_from", "run.until_error.*", "run.particle_step", "run.fluid_step", "run.reference_speed",
    *(f"{table}.{key}" for table in ("material.NAME", "pair.NAME.NAME") for key in (
        "youngs_modulus", "contact_modulus", "poisson", "restitution", "friction", "rolling_friction",
        "friction_lubricated", "roughness",
    )),
    "laws.drag", "laws.gravity", "laws.lift", "laws.torque", "laws.viscous_stress",
    "laws.convection", "laws.contact_parameters.*",
)  # fmt: skip
"""Keys whose values the state of a run does not hold, or holds in a field that is made anew."""

NAMED = ("laws.agitation", "laws.surface")
"""Keys that the state depends on, whose `"auto"` may be replaced by the name of the law that it has chosen."""

_CHANGEABLE = re.compile(
    "|".join(re.escape(key).replace("NAME", r"[^.]+").replace(r"\.\*", r"(\..*)?") for key in CHANGEABLE)
)


def branch_state(case: Case, origin: Path) -> dict[str, Any]:
    """The newest checkpoint of a run, as the state with which another case begins.

    errors  InputError for a run without a checkpoint, a key that cannot change within a run, or an end before the state
    """
    read_about(origin)  # refuses what is no run
    state = checkpoint.newest(origin)
    before = case_to_continue(origin, None, None)
    for key in changed([before, case]):
        if key not in NAMED and not _CHANGEABLE.fullmatch(key):
            others = ", ".join(table for table in CHANGEABLE if table.startswith(f"{key.split('.')[0]}."))
            remedy = f"of this table, {others} can change" if others else "run the changed case from its beginning"
            raise InputError(key, None, f"left as it is in {origin}, whose state depends on it", remedy)
    for key in NAMED:
        chosen = [getattr(which, key.removeprefix("laws.")) for which in (before, case)]
        was, now = (law if isinstance(law, str) else law.name for law in chosen)
        if was != now:
            raise InputError(key, now, f"{was!r}, as in {origin}", f"name it where it is auto: --set {key}={was}")
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


# ---------------------------------------------------------------- laws of a user


RECORD = "laws"
"""Entry of the provenance in `run.json` with the laws of a run that are not built in."""

THEN = ", then "
"""Between the fingerprints of a law that was changed during the run."""


def require_compiled(case: Case) -> None:
    """Refuse a user's law that cannot be compiled, by its key, and a GPU that is not there.

    errors  InputError
    """
    if case.run.gpu:
        from cfddem.backend.gpu import name_of_gpu  # loads a compiler that other runs do not need

        name_of_gpu()
    for kind, law in case.laws.own_laws.items():
        check_compiles(f"laws.{kind}", law.function)


def record_of(case: Case) -> dict[str, Any]:
    """Entry of the provenance: name, module, package, version and fingerprint of every law that is not built in.

    returns  empty if all laws are built in
    """
    laws = {kind: _described(law.name, law.function) for kind, law in case.laws.own_laws.items()}
    contact = case.laws.contact_law
    if not contact.force.__module__.startswith(("cfddem.", "closures.")):
        functions = tuple(part for part in vars(contact).values() if callable(part))
        laws["contact"] = {**_described(contact.name, contact.force), "fingerprint": fingerprint(functions)}
    return {RECORD: laws} if laws else {}


def warn_of_changes(folder: RunFolder, case: Case) -> None:
    """Warn, in one line for each, of laws whose source has changed since the run was written; record the new ones."""
    about = folder.about["provenance"]
    before, now = about.get(RECORD, {}), record_of(case).get(RECORD, {})
    changed = changed_laws(about, case)
    for kind in before.keys() & now.keys():
        old = str(before[kind]["fingerprint"])
        if kind not in changed:
            now[kind] = before[kind]
            continue
        warnings.warn(
            f"laws.{kind} = {now[kind]['name']!r}: its source has changed since the run began; the result is not that "
            "of an uninterrupted run. For that, restore the source and resume a copy of the folder made before",
            stacklevel=2,
        )
        now[kind]["fingerprint"] = f"{old}{THEN}{now[kind]['fingerprint']}"
    if now != before:
        folder.note("provenance", {**about, RECORD: now})


def changed_laws(provenance: Mapping[str, Any], case: Case) -> list[str]:
    """Kinds of laws of a case whose source differs from that with which a run was written, by its provenance."""
    before, now = provenance.get(RECORD, {}), record_of(case).get(RECORD, {})
    marks = {kind: str(before[kind]["fingerprint"]).rpartition(THEN)[2] for kind in before.keys() & now.keys()}
    return sorted(kind for kind, mark in marks.items() if mark != now[kind]["fingerprint"])


def _described(name: str, function: Callable[..., float]) -> Mapping[str, str]:
    """A law as plain values; package and version are empty for a function of a script."""
    module = function.__module__
    package = version = ""
    for point in entry_points(group=GROUP):
        if point.dist is not None and point.module.partition(".")[0] == module.partition(".")[0]:
            package, version = point.dist.name, point.dist.version
    return {
        "name": name,
        "module": module,
        "package": package,
        "version": version,
        "fingerprint": fingerprint(function),
    }
