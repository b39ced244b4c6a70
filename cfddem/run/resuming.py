"""Steps of resuming a run: its case, its state, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.case.toml_text import parse, read_text
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
