"""Is this machine fit to run: versions, threads, compiled loops, pictures, room to write, a short test of itself."""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SELF_TEST = """
title = "thirty spheres in water"
fluid = {density = 998.0, viscosity = 1e-3}
material.glass = {density = 2500.0, youngs_modulus = 6e10, contact_modulus = 1e7, poisson = 0.23, roughness = 1e-7}
column = {width = 0.02, height = 0.04, cell = 0.005}
bed = {diameter = 2e-3, count = 30, start = "suspended", inlet_velocity = 0.02}
run = {until = 0.01, every = 0.01}
"""

CLOSED = 1e-9
"""A ledger that closes: what particles and fluid exchange differs by no more than this part of it."""


@dataclass(frozen=True)
class Answer:
    """What was found out."""

    name: str
    fine: bool
    text: str


def examine(quick: bool = False) -> Iterator[Answer]:
    """Look at the machine, one thing after the other.

    quick  leave out pictures and the test of itself
    """
    from cfddem.record.provenance import provenance

    about = provenance()
    yield Answer("cfddem", True, about["cfddem"])
    yield Answer("python", True, f"{about['python']} on {about['platform']}")
    packages = about["dependencies"]
    yield Answer("packages", bool(packages), ", ".join(f"{name} {version}" for name, version in packages.items()))
    yield _threads()
    yield _compiled()
    yield from _offered()
    yield _writable(Path())
    if not quick:
        yield _pictures()
        yield _self_test()


def _threads() -> Answer:
    from cfddem.kernels import use_threads

    return Answer("threads", True, f"{use_threads(None)} of {os.cpu_count()} processors, {platform.machine()}")


def _compiled() -> Answer:
    """The folder of compiled loops."""
    from closures.compiled import cache_folder

    folder = cache_folder()
    files = list(folder.rglob("*.nbc")) if folder.exists() else []
    size = sum(path.stat().st_size for path in files)
    state = f"{len(files)} loops, {size / 1e6:.0f} MB" if files else "none yet: the first run compiles for some minutes"
    kept = tempfile.gettempdir() not in str(folder)
    remedy = "" if kept else "; lost when the machine restarts, set NUMBA_CACHE_DIR to a folder that stays"
    return Answer("compiled loops", True, f"{state}, in {folder}{remedy}")


def _offered() -> Iterator[Answer]:
    """Laws that other packages offer."""
    from closures import shelf

    for name, failure in shelf.fill_from_packages().items():
        yield Answer(f"laws of {name}", False, failure)


def _writable(folder: Path) -> Answer:
    free = shutil.disk_usage(folder).free
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as failure:
        return Answer("folder", False, f"{folder.resolve()} cannot be written to ({failure.strerror}); go elsewhere")
    return Answer("folder", free > 1e9, f"{folder.resolve()} can be written to, {free / 1e9:.0f} GB free")


def _pictures() -> Answer:
    from cfddem.view.rendering import why_not

    fault = why_not()
    return Answer("pictures", fault is None, fault or "this machine renders")


def _self_test() -> Answer:
    """A run of a hundredth of a second, into a folder that is thrown away: does the ledger close?"""
    from cfddem.case import Case
    from cfddem.errors import CfddemError
    from cfddem.kernels import use_threads
    from cfddem.report import report
    from cfddem.run import Run

    threads, begun = use_threads(None), time.monotonic()
    use_threads(1)
    try:
        with tempfile.TemporaryDirectory() as folder:
            Run.begin(Case.from_text(SELF_TEST, "self-test"), Path(folder) / "run").go()
            ledger = report(Path(folder) / "run")["ledger"]
    except (CfddemError, OSError) as failure:
        return Answer("self-test", False, str(failure))
    finally:
        use_threads(threads)
    took = f"{time.monotonic() - begun:.1f} s"
    open_by = max(ledger["exchange_imbalance"], ledger["volume_imbalance"])
    if ledger["particles_lost"] or not open_by < CLOSED:
        return Answer("self-test", False, f"the ledger is open by {open_by:.2g}, limit {CLOSED:g}; {took}")
    return Answer("self-test", True, f"thirty spheres in water, ledger closed to {open_by:.1g}, {took}")
