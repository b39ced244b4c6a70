"""Speeds of one machine that are kept in a file, so that a benchmark shows its numbers beside them.

`python -m scenarios.benchmarks.table` measures this machine and writes the file anew.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

FILE = Path(__file__).parents[1] / "data" / "speed.json"
"""What was measured, on which machine, with which versions."""


@cache
def kept() -> dict[str, Any]:
    """The file: `machine`, `triad [GB/s]`, and `speeds` by name."""
    speeds: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return speeds


def beside(name: str, speed: float) -> str:
    """How a speed compares with the kept one, as the end of a line; empty if there is none.

    name   of the benchmark, as :func:`speeds` has it
    speed  of this machine, in the unit of the benchmark
    """
    earlier = kept()["speeds"].get(name)
    return f"; {speed / earlier:.2f} times as fast as kept, {kept()['machine']}" if earlier else ""


def dense_bed(result: dict[str, Any]) -> str:
    """Name of a dense bed, from its result."""
    films = ", films that resist sliding" if result["films that resist sliding"] else ", films" * result["film"]
    bridges = ", bridges" if result["bridges per particle"] else ""
    gpu = f", {result['gpu']}" if result["gpu"] else ""
    return f"dense bed of {result['particles']}{films}{bridges}{gpu}, {result['threads']} thread(s)"


def fluid_box(cells: list[int], threads: int) -> str:
    """Name of a box of fluid."""
    return f"fluid of {' x '.join(map(str, cells))} cells, {threads} thread(s)"


def gas_bed(fluid_step: float, threads: int) -> str:
    """Name of the standard gas bed with a fluid step [s]."""
    return f"gas bed, fluid step {fluid_step:g} s, {threads} thread(s)"


def speeds(results: dict[str, Any]) -> Iterator[tuple[str, float]]:
    """Name and speed of each result of all benchmarks: million particle-steps/s, steps/s, simulated s in an hour."""
    for result in results.values():
        if "steps" in result:
            yield dense_bed(result), result["million particle-steps per second"]["cfddem"]
        for box in result.get("boxes", []):
            yield fluid_box(box["cells"], result["threads"]), 1.0 / box["step [s]"]
        for run in result.get("runs", []):
            yield gas_bed(run["fluid step [s]"], result["threads"]), 3600.0 / run["wall [s/s]"]
