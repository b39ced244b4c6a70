"""Commands that inform: the documentation of a law or a key, and the state of this machine."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cfddem.backend.errors import InputError
from cfddem.backend.json_text import as_json
from cfddem.backend.law_choice import import_laws
from cfddem.backend.tables import table
from cfddem.cli.cases import LAWS
from cfddem.cli.json_output import json_schema, print_json

SCHEMA = "case, or an output by the middle of its value `schema`: report, check, sweep, error, and others"


def explain(
    law: Annotated[str | None, Parameter(help="a law, kind, key, table of a case, or word; default: all laws")] = None,
    *,
    plot: Annotated[Path | None, Parameter(help="PNG file for a plot of the law")] = None,
    laws: Annotated[list[Path] | None, Parameter(help=LAWS, negative="")] = None,
    json: Annotated[bool, Parameter(help="print the documentation as JSON", negative="")] = False,
) -> None:
    """Show the documentation of a law: equation, arguments, range, reference. Or list laws: all, or those with a word.

    Keys of a case file are shown with unit and default: cfddem explain bed, cfddem explain bed.diameter

    Example: cfddem explain di_felice --plot di_felice.png
    """
    from cfddem.cli import explain_pages as pages
    from cfddem.io.files import require_folder

    import_laws(laws or ())
    by_kind, keys = pages.laws() if law is None else pages.of_kind(law), dict[str, pages.FieldInfo]()
    if law is not None and not pages.is_law(law):
        keys = pages.matching(law)
        if not (by_kind or pages.is_table(law)):  # a table is shown alone, without the laws that mention its name
            by_kind = pages.containing(law)
    require_folder(plot)
    several, chosen = bool(by_kind or keys), None
    if plot is not None and several:
        raise InputError("--plot", str(plot), "used with one law", "cfddem explain lists their names")
    if not several:
        assert law is not None
        chosen = pages.find(law)
        by_kind = {chosen.kind: {chosen.name: chosen}}
    absent = pages.not_there(law or "")
    if json:
        every = [pages.summary(law_of_kind) for kind in by_kind.values() for law_of_kind in kind.values()]
        listed = [pages.key_summary(*key_and_field) for key_and_field in keys.items()]
        print_json("explain", {"laws": every, "keys": listed, "not_there": " ".join(absent[1:])})
    else:
        print("\n".join(pages.page(chosen) if chosen else [*pages.key_lines(keys), *absent, *pages.listing(by_kind)]))
    if plot is not None and chosen is not None:
        print(pages.plot(chosen, plot), file=sys.stderr if json else sys.stdout)


def schema(
    name: Annotated[str, Parameter(help=SCHEMA)] = "case",
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
    if not quick:
        from cfddem.backend.compile import announce_compilation  # loads the compiler

        announce_compilation()
    answers = []
    for answer in examine(quick):
        answers.append(answer)
        if not json:
            first, *others = answer.text.split("\n")
            rows = [("ok" if answer.ok else "FAILS", answer.name, first), *(("", "", line) for line in others)]
            print("\n".join(table(rows, widths=(6, 15))), flush=True)
    if json:
        print_json(
            "doctor", {"ok": all(answer.ok for answer in answers), "checks": [asdict(answer) for answer in answers]}
        )
    if not all(answer.ok for answer in answers):
        sys.exit(1)


# ---------------------------------------------------------------- checks of the machine


TEST_CASE = """
title = "thirty spheres in water"
fluid = {density = 998.0, viscosity = 1e-3}
material.glass = {density = 2500.0, youngs_modulus = 6e10, contact_modulus = 1e7, poisson = 0.23, roughness = 1e-7}
column = {width = 0.02, height = 0.04, cell = 0.005}
bed = {diameter = 2e-3, count = 30, start = "suspended", inlet_velocity = 0.02}
run = {until = 0.01, every = 0.01}
"""

LARGEST_IMBALANCE = 1e-9
"""Largest relative imbalance of momentum exchange and volume in the test run [-]."""

TIME_FOR_RANKS = 120.0
"""Time in which two ranks must have exchanged messages and shared a fluid step [s]."""

LEAST_DISK = 1e9
"""Free disk space below which the doctor objects [byte]."""


@dataclass(frozen=True)
class Answer:
    """Result of one check; a line of `text` is a line of output."""

    name: str
    ok: bool
    text: str


def examine(quick: bool = False) -> Iterator[Answer]:
    """Run all checks in turn.

    quick  skip rendering and the test run
    """
    from cfddem.io.folder import provenance

    about = provenance()
    yield Answer("cfddem", True, about["cfddem"])
    yield Answer("python", True, f"{about['python']} on {about['platform']}")
    packages = about["dependencies"]
    yield Answer("packages", bool(packages), ", ".join(f"{name} {version}" for name, version in packages.items()))
    yield _threads()
    yield _gpu()
    yield _compiled_loops()
    yield from _law_packages()
    yield _disk(Path())
    if not quick:
        yield _rendering()
        yield _test_run()
    yield _processes(quick)


def _threads() -> Answer:
    from cfddem.backend.compile import use_threads

    return Answer("threads", True, f"{use_threads(None)} of {os.cpu_count()} processors, {platform.machine()}")


def _gpu() -> Answer:
    if find_spec("numba_cuda") is None:
        return Answer("gpu", True, "not used; for one of NVIDIA: pip install 'cfddem[gpu]'")
    from cfddem.backend.errors import InputError
    from cfddem.backend.gpu import name_of_gpu

    try:
        return Answer("gpu", True, f"{name_of_gpu()}; used where a case says run.gpu = true")
    except InputError as failure:
        return Answer("gpu", True, f"none: {failure.value}")


def _compiled_loops() -> Answer:
    from closures.compiled import cache_folder

    folder = cache_folder()
    files = list(folder.rglob("*.nbc")) if folder.exists() else []
    size = sum(path.stat().st_size for path in files)
    state = f"{len(files)} loops, {size / 1e6:.0f} MB" if files else "none yet; the first run takes minutes to compile"
    text = f"{state}\nin {folder}"
    if tempfile.gettempdir() in str(folder):
        text += "\na restart may delete them; set NUMBA_CACHE_DIR to a permanent folder"
    return Answer("compiled loops", True, text)


def _law_packages() -> Iterator[Answer]:
    """Installed packages with laws that could not be loaded."""
    from closures import registry

    for name, failure in registry.load_package_laws().items():
        yield Answer(f"laws of {name}", False, failure)


def _disk(folder: Path) -> Answer:
    free = shutil.disk_usage(folder).free
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as failure:
        return Answer("folder", False, f"{folder.resolve()} is not writable ({failure.strerror}); use another folder")
    text = f"{folder.resolve()} is writable\n{free / 1e9:.0f} GB free"
    if free <= LEAST_DISK:
        text += f", less than the {LEAST_DISK / 1e9:.0f} GB that a run may need"
    return Answer("folder", free > LEAST_DISK, text)


def _processes(quick: bool) -> Answer:
    """Whether a run can be shared by several processes: mpi4py, a launcher, messages and a fluid step of two ranks."""
    from cfddem.backend import launch
    from cfddem.backend.errors import InputError

    if find_spec("mpi4py") is None:
        return Answer("processes", True, f"one; for runs on several ranks: {launch.INSTALL}")
    try:
        command = launch.launch_command(2, launch.python_command("-m", "cfddem.cli.ranks_trial"))
    except InputError as failure:
        return Answer("processes", False, str(failure))
    if quick:
        return Answer("processes", True, f"mpi4py is there, launcher {command[0]}")
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_FOR_RANKS, check=False)
    except subprocess.TimeoutExpired:
        return Answer("processes", False, f"{command[0]} did not end within {TIME_FOR_RANKS:g} s")
    if done.returncode:
        return Answer("processes", False, f"{command[0]}: {(done.stderr or done.stdout).strip()[-300:]}")
    return Answer("processes", True, f"{done.stdout.strip()}\nlauncher {command[0]}")


def _rendering() -> Answer:
    from cfddem.plotting.rendering import why_not

    fault = why_not()
    return Answer("rendering", fault is None, fault or "works")


def _test_run() -> Answer:
    """A run of 0.01 s in a temporary folder; momentum exchange and volume must balance."""
    from cfddem.analysis.report import report
    from cfddem.backend.compile import use_threads
    from cfddem.backend.errors import CfddemError
    from cfddem.case.schema import Case
    from cfddem.run.runner import Run

    threads, begun = use_threads(None), time.monotonic()
    use_threads(1)
    try:
        with tempfile.TemporaryDirectory() as folder:
            Run.begin(Case.from_text(TEST_CASE, "test run"), Path(folder) / "run").go()
            ledger = report(Path(folder) / "run").ledger
    except (CfddemError, OSError) as failure:
        return Answer("test run", False, str(failure))
    finally:
        use_threads(threads)
    seconds = f"{time.monotonic() - begun:.1f} s"
    imbalance, lost = max(ledger["momentum_imbalance"], ledger["volume_imbalance"]), ledger["particles_lost"]
    balance = f"imbalance of momentum and volume {imbalance:.1g}, limit {LARGEST_IMBALANCE:g}"
    if lost or not imbalance < LARGEST_IMBALANCE:
        return Answer("test run", False, f"thirty spheres in water, {seconds}\n{balance}; {lost:g} particles lost")
    return Answer("test run", True, f"thirty spheres in water, {seconds}\n{balance}")
