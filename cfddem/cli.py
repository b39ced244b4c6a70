"""The command line: the roof. The commands themselves stand in :mod:`cfddem.commands`."""

from __future__ import annotations

import os
import shutil
import sys
import textwrap

from cyclopts import App, CycloptsError

from cfddem import __version__
from cfddem.commands import cases, collisions, knowledge, proofs, results
from cfddem.errors import CfddemError

WIDTH = 100
"""Widest line on a terminal [characters]."""

app = App(
    name="cfddem",
    version=__version__,
    help="""Spheres in a fluid, with the thin film between them. All numbers are in SI units.

Exit codes: 0 all is well; 1 a limit does not hold (validate), amber with --strict (check), something is wrong
(doctor); 2 wrong input, or a case whose card is red; 3 a failed run; 130 stopped from the keyboard, 143 by SIGTERM.

Example: cfddem new liquid-bed, then cfddem check, cfddem run, cfddem report, cfddem view
""",
    help_flags=["--help", "-h"],
)

for command in (
    *(cases.new, cases.check, cases.run, cases.resume, cases.sweep),
    *(results.report, results.view, results.export),
    *(collisions.collide, collisions.wet_wall, collisions.three_spheres, collisions.wet_pair),
    *(proofs.validate, proofs.bench),
    *(knowledge.explain, knowledge.doctor),
):
    app.command(command)


app.register_install_completion_command(help="Complete commands and options in this shell with the Tab key.")


def main() -> None:
    """Run a command; a user's mistake ends in a line each and exit code 2, never in a traceback."""
    try:
        app(sys.argv[1:], exit_on_error=False, print_error=False)
    except CycloptsError as mistake:
        _tell(" ".join(str(mistake).split()))
        sys.exit(2)
    except CfddemError as failure:
        for line in str(failure).splitlines():
            _tell(line)
        sys.exit(failure.exit_code)
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as failure:  # a disk that is full, a folder that cannot be written to
        _tell(f"{failure.filename or 'file'}: {failure.strerror or failure}")
        sys.exit(2)
    except KeyboardInterrupt:
        _tell("stopped")
        sys.exit(130)


def _tell(mistake: str) -> None:
    """Print a mistake: broken between words on a terminal, one line where a program reads it."""
    line = f"cfddem: {mistake}"
    if sys.stderr.isatty():
        width = min(WIDTH, shutil.get_terminal_size().columns)
        line = textwrap.fill(line, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    print(line, file=sys.stderr)


if __name__ == "__main__":
    main()
