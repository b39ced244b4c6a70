"""The command line `cfddem`: its commands, and how their errors are printed."""

from __future__ import annotations

import logging
import os
import shutil
import sys
import textwrap
import warnings
from typing import Any, NoReturn

from cyclopts import App, CycloptsError, Group

from cfddem import __version__
from cfddem.backend.errors import CfddemError
from cfddem.backend.launch import several_ranks
from cfddem.backend.working_folder import ignore_settings_files
from cfddem.cli import cases, information, results, sweeps, validation
from cfddem.cli.json_output import asked_for_json, begin, print_failure
from cfddem.cli.ranks import end_together

WIDTH = 100
"""Widest line on a terminal [characters]."""

app = App(
    name="cfddem",
    version=__version__,
    help="""CFD-DEM of spheres in a fluid, with lubrication films between close spheres. All values are in SI units.

A first run: cfddem new liquid-bed, then cfddem check, cfddem run, cfddem report, cfddem view

Exit codes: 0 success. 1 a limit is exceeded (validate), warnings with --strict (check), or the machine is not ready
(doctor). 2 wrong input, or a case with errors. 3 the run failed. 130 stopped from the keyboard, 143 by SIGTERM.
128 and the number of the signal where one of several processes was killed, 137 by SIGKILL.
""",
    help_flags=["--help", "-h"],
    group_commands=Group("Options", sort_key=99),
)

COMMANDS = {
    "Cases": (cases.new, cases.check, cases.stability, cases.run, cases.resume, sweeps.sweep, sweeps.calibrate),
    "Results": (results.report, results.compare, results.view, results.export),
    "Collisions of a few spheres": ("collide", "wet-wall", "film-impact", "three-spheres", "wet-pair"),
    "Validation": (validation.validate, validation.bench),
    "Information": (information.explain, information.schema, information.doctor),
}
"""Commands by the panel of the help that lists them; those given by name are in :data:`COLLISIONS`."""

COLLISIONS = {
    "collide": ("collide", "Collide two spheres, or a sphere and a wall, in a fluid.",
                "--material delrin --stokes 30 --velocity 0.1"),
    "wet-wall": ("impact", "Let a sphere strike a wall under a thin liquid layer.",
                 "--particle glass_1.74 --film 2e-4 --velocity 0.6"),
    "film-impact": ("strike_film", "Let a bead fall through a liquid film onto a plate; the liquid's flow is computed.",
                    "--diameter 5.5e-3 --liquid m5 --film 0.45e-3 --velocity 0.5"),
    "three-spheres": ("simulate_three_spheres", "Let a wet sphere strike a resting pair of wet spheres.",
                      "--stokes 12 --theta12 30"),
    "wet-pair": ("collide_wet", "Let a wet sphere strike an equal one at rest; by default, steel in silicone oil.",
                 "--stokes 1.2 --angle 60"),
}  # fmt: skip
"""Name in :mod:`cfddem.cli.collisions`, summary and example of each; loaded when called, as they load the compiler."""

for position, (panel, commands) in enumerate(COMMANDS.items()):
    group = Group(panel, sort_key=position)
    for place, command in enumerate(commands):
        if not isinstance(command, str):
            app.command(command, group=group, sort_key=place)
            continue
        attribute, summary, example = COLLISIONS[command]
        text = f"{summary}\n\nExample: cfddem {command} {example}\n"
        app.command(f"cfddem.cli.collisions:{attribute}", name=command, help=text, group=group, sort_key=place)

app.register_install_completion_command(help="Complete commands and options in this shell with the Tab key.")


def main() -> None:
    """Run a command. A user's error ends in one line and exit code 2, never in a traceback."""
    if os.name == "nt":  # a redirected output may have an encoding that lacks a sign
        for stream in (sys.stdout, sys.stderr):
            getattr(stream, "reconfigure", lambda **_: None)(errors="replace")
    begin()
    if logging.lastResort is not None:  # of messages that no handler takes
        logging.lastResort.setFormatter(logging.Formatter("cfddem: warning: %(message)s"))
    try:
        ignore_settings_files()
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning  # type: ignore[assignment]
            app(sys.argv[1:], exit_on_error=False, print_error=False)
    except CycloptsError as failure:
        _fail(" ".join(str(failure).split()), 2)
    except CfddemError as failure:
        _fail(str(failure), failure.exit_code, failure)
    except BrokenPipeError:  # the reader of the output has closed it, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as failure:  # such as a full disk, or a folder without write permission
        _fail(f"{failure.filename or 'file'}: {failure.strerror or failure}", 2)
    except KeyboardInterrupt:
        _fail("stopped", 130)
    except Exception:
        if not several_ranks():
            raise
        end_together("", 1)


def _fail(message: str, code: int, failure: CfddemError | None = None) -> NoReturn:
    """Print an error, one for each line, and end; with `--json`, also as JSON."""
    if several_ranks():
        end_together(message, code)
    for line in message.splitlines():
        _print_error(line)
    if asked_for_json():
        print_failure(message, code, failure)
    sys.exit(code)


def _show_warning(message: Warning | str, *_: Any) -> None:
    """Print a warning in one line, without the place in the source."""
    _print_error(f"warning: {' '.join(str(message).split())}")


def _print_error(message: str) -> None:
    """Print an error: wrapped between words on a terminal, on one line elsewhere."""
    line = f"cfddem: {message}"
    if sys.stderr.isatty():
        width = min(WIDTH, shutil.get_terminal_size().columns)
        line = textwrap.fill(line, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    print(line, file=sys.stderr)


if __name__ == "__main__":
    main()
