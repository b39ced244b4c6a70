"""The user's laws of a run: refused before the run if they cannot be compiled, recorded with it, compared later."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from typing import Any

from cfddem.backend.law_set import check_compiles, fingerprint
from cfddem.case.schema import Case
from cfddem.io.writer import RunFolder
from closures.registry import GROUP

RECORD = "laws"
"""Entry of the provenance in `run.json` with the laws of a run that are not built in."""

THEN = ", then "
"""Between the fingerprints of a law that was changed during the run."""


def require_compiled(case: Case) -> None:
    """Refuse a user's law that cannot be compiled, by its key.

    errors  InputError
    """
    for kind, law in case.laws.own_laws.items():
        check_compiles(f"laws.{kind}", law.function)


def record_of(case: Case) -> dict[str, Any]:
    """Entry of the provenance: name, module, package, version and fingerprint of every law that is not built in.

    returns  empty if all laws are built in
    """
    found = {kind: _described(law.name, law.function) for kind, law in case.laws.own_laws.items()}
    contact = case.laws.contact_law
    if not contact.force.__module__.startswith(("cfddem.", "closures.")):
        functions = tuple(each for each in vars(contact).values() if callable(each))
        found["contact"] = {**_described(contact.name, contact.force), "fingerprint": fingerprint(functions)}
    return {RECORD: found} if found else {}


def warn_of_changes(folder: RunFolder, case: Case) -> None:
    """Warn, in one line for each, of laws whose source has changed since the run was written; record the new ones."""
    about = folder.about["provenance"]
    before, now = about.get(RECORD, {}), record_of(case).get(RECORD, {})
    for kind in before.keys() & now.keys():
        old = str(before[kind]["fingerprint"])
        if old.rpartition(THEN)[2] == now[kind]["fingerprint"]:
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
