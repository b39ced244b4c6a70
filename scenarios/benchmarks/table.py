"""All benchmarks of the commands, as one table of plain values; run as a program, it keeps their speeds."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Iterator
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

from cfddem.io.files import write_whole
from scenarios.beds.gas_bed import study as gas_bed
from scenarios.benchmarks import dense_bed, fluid_box, kept_speeds

SIZES = (10_000, 100_000)
"""Particles of the dense beds."""

Benchmark = tuple[Callable[[int], dict[str, Any]], Callable[[dict[str, Any]], Iterator[tuple[str, str]]]]


def benchmarks() -> dict[str, Benchmark]:
    """Name -> function of the number of threads, and its lines."""
    bed, lines = dense_bed.bench, dense_bed.rows
    table: dict[str, Benchmark] = {"dense bed of 10000, bridges": (partial(bed, 10_000, bridges=True), lines)}
    for size in SIZES:
        table[f"dense bed of {size}"] = partial(bed, size), lines
        table[f"dense bed of {size}, films"] = partial(bed, size, film=True), lines
    return table | {"fluid": (fluid_box.bench, fluid_box.rows), "gas bed": (gas_bed.bench, gas_bed.rows)}


def bench(threads: int = 1) -> dict[str, Any]:
    """Results of all benchmarks by name, one after the other.

    threads  of each
    """
    return {name: measure(threads) for name, (measure, _) in benchmarks().items()}


def rows(result: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """The results as lines of a table."""
    for name, (_, lines) in benchmarks().items():
        yield from lines(result[name])


def keep() -> None:
    """Measure this machine and write the file."""
    results = bench()
    document = {
        "machine": _processor(),
        "date": date.today().isoformat(),
        "triad [GB/s]": next(iter(results.values()))["triad [GB/s]"],
        "speeds": dict(kept_speeds.speeds(results)),
    }
    write_whole(kept_speeds.FILE, (json.dumps(document, indent=1) + "\n").encode())


def _processor() -> str:
    """Name of the processor where Linux tells it."""
    listed = Path("/proc/cpuinfo")
    lines = listed.read_text(encoding="utf-8").splitlines() if listed.exists() else []
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())


if __name__ == "__main__":
    keep()
