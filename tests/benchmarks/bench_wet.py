"""Warm time of each wet scenario, and of the map of outcomes, in processes of their own.

    python tests/benchmarks/bench_wet.py

Every command runs twice; the second time counts, when its loops are compiled.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

LIMITS = {
    ("three-spheres",): 10.0,
    ("wet-pair",): 10.0,
    ("wet-wall", "--velocity", "0.6"): 10.0,
    ("three-spheres", "--map", "map.png"): 60.0,
}
"""Commands, and how long they may take [s]."""


def main() -> None:
    """Run them all."""
    with tempfile.TemporaryDirectory() as folder:
        for words, limit in LIMITS.items():
            for _ in range(2):
                begin = time.perf_counter()
                subprocess.run(
                    [sys.executable, "-m", "cfddem", *words],
                    cwd=Path(folder),
                    check=True,
                    stdout=subprocess.DEVNULL,
                )
                seconds = time.perf_counter() - begin
            print(f"cfddem {' '.join(words)}: {seconds:.1f} s (limit {limit:g} s)", flush=True)


if __name__ == "__main__":
    main()
