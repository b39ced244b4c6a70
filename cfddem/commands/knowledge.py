"""Commands that tell: what a law says, and whether this machine is fit to run."""

from __future__ import annotations

import json as _json
import sys
import textwrap
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cfddem.commands.printing import tell_of_compilation


def explain(
    law: Annotated[str | None, Parameter(help="name of a law; lists all if not given")] = None,
    *,
    plot: Annotated[Path | None, Parameter(help="PNG to draw the law into")] = None,
    json: Annotated[bool, Parameter(help="print the page as JSON", negative="")] = False,
) -> None:
    """Show the page of a law: equation, arguments, range, reference; or list all laws.

    Example: cfddem explain di_felice --plot di_felice.png
    """
    from cfddem import pages
    from cfddem.record.files import must_have_folder

    if law is None:
        every = [pages.summary(each) for kind in pages.laws().values() for each in kind.values()]
        print(_json.dumps(every) if json else "\n".join(pages.listing()))
        return
    found = pages.find(law)
    must_have_folder(plot)
    print(_json.dumps(pages.summary(found)) if json else "\n".join(pages.page(found)))
    if plot is not None:
        print(pages.plot(found, plot), file=sys.stderr if json else sys.stdout)


def doctor(
    *,
    quick: Annotated[bool, Parameter(help="without pictures and the self-test", negative="")] = False,
    json: Annotated[bool, Parameter(help="print the answers as JSON", negative="")] = False,
) -> None:
    """Say whether this machine is fit to run: versions, threads, pictures, and a short test of itself.

    Ends with exit code 1 if something is wrong.

    Example: cfddem doctor --quick
    """
    from cfddem.doctor import examine

    if not quick:
        tell_of_compilation()
    answers = []
    for answer in examine(quick):
        answers.append(answer)
        if not json:
            line = f"{'ok' if answer.fine else 'WRONG':<6}{answer.name:<16}{answer.text}"
            print("\n".join(textwrap.wrap(line, 100, subsequent_indent=" " * 22)), flush=True)
    if json:
        print(_json.dumps([asdict(each) for each in answers]))
    if not all(each.fine for each in answers):
        sys.exit(1)
