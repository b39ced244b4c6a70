"""Commands that inform: the documentation of a law, and the state of this machine."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cfddem.backend.errors import InputError
from cfddem.backend.json_text import as_json
from cfddem.backend.tables import table
from cfddem.cli.json_output import json_schema, print_json
from cfddem.cli.printing import announce_compilation


def explain(
    law: Annotated[str | None, Parameter(help="a law, kind, key, table of a case, or word; default: all laws")] = None,
    *,
    plot: Annotated[Path | None, Parameter(help="PNG file for a plot of the law")] = None,
    json: Annotated[bool, Parameter(help="print the documentation as JSON", negative="")] = False,
) -> None:
    """Show the documentation of a law: equation, arguments, range, reference. Or list laws: all, or those with a word.

    Keys of a case file are shown with unit and default: cfddem explain bed, cfddem explain bed.diameter

    Example: cfddem explain di_felice --plot di_felice.png
    """
    from cfddem.cli import explain_pages as pages
    from cfddem.io.files import require_folder

    known, keys = pages.laws() if law is None else pages.of_kind(law), dict[str, pages.FieldInfo]()
    if law is not None and not pages.is_law(law):
        known, keys = known or pages.containing(law), pages.matching(law)
    require_folder(plot)
    several, found = bool(known or keys), None
    if plot is not None and several:
        raise InputError("--plot", str(plot), "used with one law", "cfddem explain lists their names")
    if not several:
        assert law is not None
        found = pages.find(law)
        known = {found.kind: {found.name: found}}
    absent = pages.not_there(law or "")
    if json:
        every = [pages.summary(each) for kind in known.values() for each in kind.values()]
        listed = [pages.key_summary(*each) for each in keys.items()]
        print_json("explain", {"laws": every, "keys": listed, "not_there": " ".join(absent[1:])})
    else:
        print(
            "\n".join([*pages.listing(known), *pages.key_lines(keys), *absent] if found is None else pages.page(found))
        )
    if plot is not None and found is not None:
        print(pages.plot(found, plot), file=sys.stderr if json else sys.stdout)


def schema(
    name: Annotated[str, Parameter(help="case, or the name in the middle of the word `schema` of an output")] = "case",
) -> None:
    """Print the JSON schema of case files, or of what a command prints with --json.

    Example: cfddem schema report
    """
    from cfddem.case.schema import Case

    print(as_json(Case.model_json_schema() if name == "case" else json_schema(name), indent=2))


def doctor(
    *,
    quick: Annotated[bool, Parameter(help="without rendering and the test run", negative="")] = False,
    json: Annotated[bool, Parameter(help="print the answers as JSON", negative="")] = False,
) -> None:
    """Check that this machine is ready: packages, threads, compiled loops, disk, rendering, and a short test run.

    Exit code: 1 if a check fails.

    Example: cfddem doctor --quick
    """
    from cfddem.cli.doctor import examine

    if not quick:
        announce_compilation()
    answers = []
    for answer in examine(quick):
        answers.append(answer)
        if not json:
            first, *others = answer.text.split("\n")
            rows = [("ok" if answer.ok else "FAILS", answer.name, first), *(("", "", line) for line in others)]
            print("\n".join(table(rows, widths=(6, 15))), flush=True)
    if json:
        print_json("doctor", {"ok": all(each.ok for each in answers), "checks": [asdict(each) for each in answers]})
    if not all(each.ok for each in answers):
        sys.exit(1)
