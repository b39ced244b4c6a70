"""Processor time that a mean of the same error takes, with a fixed end and with an end by the error.

    python tests/benchmarks/bench_time_to_mean.py [--measure bed_height] [--json FILE]

Three cases of the gallery run twice. First as they are, averaged over their second half. Then with the start
"expanded" where the first start is spread over the column, until the error of the mean is that of the first run.
Errors decrease with the root of the time, so that the second cost is given for the error of the first.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from time import process_time
from typing import Any

from cfddem.analysis.report import report
from cfddem.backend.compile import use_threads
from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.run.runner import Run

CASES: dict[str, dict[str, Any]] = {
    "wet-bed": {"run.average_from": None},
    "liquid-bed": {"run.average_from": None},
}
LONGEST = 3.0
"""The second run may take this many times the end of the first."""


def measured(name: str, changes: dict[str, Any], measure: str, folder: Path) -> dict[str, Any]:
    """Mean, error and processor time of a run, and where it ended."""
    case = Case.from_toml(gallery_files()[name], changes)
    run = Run.begin(case, folder)
    run.simulation.step()  # compiles
    begin = process_time()
    run.go()
    seconds = process_time() - begin
    found = report(folder)
    mean = found.measures[measure]
    return {"mean": mean.mean, "error": mean.error, "processor [s]": seconds, "window [s]": found.window}


def compared(name: str, changes: dict[str, Any], measure: str) -> dict[str, Any]:
    """Both runs of a case."""
    case = Case.from_toml(gallery_files()[name], changes)
    start = "expanded" if case.bed.start == "suspended" else case.bed.start
    with tempfile.TemporaryDirectory() as place:
        fixed = measured(name, changes, measure, Path(place, "fixed"))
        limit = {measure: fixed["error"] / abs(fixed["mean"])}
        longer = {"run.until": LONGEST * case.run.until, "run.every": case.run.every or case.run.until / 50.0}
        ends = {**changes, **longer, "bed.start": start, "run.until_error": limit}
        by_error = measured(name, ends, measure, Path(place, "by-error"))
    same = by_error["processor [s]"] * (by_error["error"] / fixed["error"]) ** 2
    return {"fixed end": fixed, "end by the error": by_error, "share of the time": same / fixed["processor [s]"]}


def main() -> None:
    """Run and print."""
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--measure", default="bed_height")
    asked.add_argument("--json", type=Path)
    words = asked.parse_args()
    use_threads(1)
    results = {}
    for name, changes in CASES.items():
        results[name] = compared(name, changes, words.measure)
        for kind in ("fixed end", "end by the error"):
            each = results[name][kind]
            window = "{:.3g} to {:.3g} s".format(*each["window [s]"])
            value = f"{each['mean']:.5g} +- {each['error']:.2g}"
            print(f"{name:<18} {kind:<17} {value:<22} {window:<18} {each['processor [s]']:.1f} s", flush=True)
        print(f"{'':<18} time for the same error: {results[name]['share of the time']:.2f} of a fixed end", flush=True)
    if words.json:
        words.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
